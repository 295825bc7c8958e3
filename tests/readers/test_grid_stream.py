"""One stream of rows, of a file or of a sensor that runs."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from gyronorth.readers.grid_stream import GridStream
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import Facts, Source, rows_block

STATED = Facts(gyro_unit="rad/s", accel_unit="m/s2", axes="flu", rate_hz=100.0)
COLUMNS = ("w_x", "w_y", "w_z", "f_x", "f_y", "f_z")


def stream() -> GridStream:
    """A stream of increments of angle at 100 Hz, axes forward-left-up."""
    source = Source("csv", "rec.csv", COLUMNS, lambda: iter(()), STATED)
    return GridStream(source, ReadOptions(increments="gyro"))


def rows(*rates: float) -> np.ndarray:
    """A row for each rate of a unit that turns about its y, rad/s."""
    return np.array([[0.0, rate / 100, 0.0, 0.0, 0.0, 9.8] for rate in rates])


def test_rows_are_plausible_by_their_rate_and_not_by_their_increment():
    """35 rad/s is more than any sensor gives: 0.35 rad in a sample of 10 ms."""
    values = rows(1.0, 34.0, 36.0, np.nan)
    values[0, 3:] = 0.0  # no force at all, as no body at rest feels
    assert stream().usable(values).tolist() == [False, True, False, False]


def test_samples_come_in_the_axes_of_the_source_and_are_turned_to_those_of_the_body():
    ours = stream()
    samples = np.concatenate([ours.grid.push(rows_block(rows(2.0, 3.0), 0)), ours.grid.flush()])
    assert (samples.shape, ours.width) == ((2, 6), 6)
    gyro_b, accel_b = ours.in_body_axes(samples)
    assert_allclose(gyro_b, [[0, -2, 0], [0, -3, 0]], atol=1e-12)
    assert accel_b is not None
    assert_allclose(accel_b, [[0, 0, -9.8]] * 2)
