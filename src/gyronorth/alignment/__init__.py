"""Alignment: from a conditioned recording to the attitude of the unit.

`closed_form` is the reference; `inertial` traces gravity in an inertial frame. Both take
batches, shape (..., n, 3), and return an `Attitude`: the rate that Earth's rotation shows in
the level frame, with the variance that the method itself could measure.
"""
