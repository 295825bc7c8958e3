"""The methods, one file each: what stands between a problem and the numerics that solve it."""
