"""One posterior over the heading of one stationary pose: a mixture over what may be wrong with unit and platform."""
