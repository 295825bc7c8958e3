"""The formats, one file each, ending in its `FORMAT`; their rows stand in `gyronorth.catalogue`."""
