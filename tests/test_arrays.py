"""Figures of arrays: those that stand in for numpy's are the same to the bit."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from gyronorth.arrays import mean_of_rows, median, robust_noise

NUMBERS = st.floats(-1e6, 1e6) | st.just(float("nan"))


@pytest.mark.slow
@given(arrays(float, array_shapes(min_dims=1, max_dims=3, max_side=7), elements=NUMBERS))
def test_median_is_that_of_numpy(x):
    assert np.array_equal(median(x), np.median(x), equal_nan=True)
    for axis in range(x.ndim):
        assert np.array_equal(median(x, axis=axis), np.median(x, axis=axis), equal_nan=True)


def test_median_of_nothing_is_no_number():
    assert np.isnan(median(np.zeros(0)))


@pytest.mark.parametrize("order", [1, 2])
def test_robust_noise_is_that_of_a_sample_whatever_else_there_is(order):
    white = 3.0 * np.random.default_rng(1).standard_normal((8000, 3))
    # The median size of 24,000 Gaussian numbers is known to 0.8 %, of differences that share samples to 1.1 %.
    np.testing.assert_allclose(robust_noise(white, order=order), 3.0, rtol=0.04)
    np.testing.assert_allclose(robust_noise(white, axis=0, order=order), [3.0] * 3, rtol=0.06)
    moved = white + np.linspace(0, 900, 8000)[:, None] + 50 * np.sin(np.linspace(0, 20, 8000))[:, None]
    moved[100:140] += 1e4
    np.testing.assert_allclose(robust_noise(moved, order=order), robust_noise(white, order=order), rtol=0.02)


@pytest.mark.parametrize("shape", [(1, 3), (100_001, 3), (5, 1001, 3), (40, 25, 60, 6)])
def test_mean_of_rows_is_that_of_numpy(shape):
    wide = np.random.default_rng(0).normal(9.8, 1.0, (*shape[:-1], shape[-1] + 2))
    for x in (wide, wide[..., : shape[-1]]):
        assert np.array_equal(mean_of_rows(x), x.mean(axis=-2))


@pytest.mark.slow
def test_a_short_heading_loads_no_more_than_it_needs(tmp_path):
    """Libraries that cost as much as the heading itself are not loaded for it."""
    import gyronorth as gn

    path = tmp_path / "x.csv"
    rng = np.random.default_rng(1)
    gn.write(gn.simulate("sdc500", latitude=0.6, heading=1.0, duration=30.0, rate_hz=20.0, rng=rng), path)
    code = (
        "import sys; sys.argv = ['gyronorth', 'heading', sys.argv[1], '--sensor', 'sdc500', '--method', 'mean']\n"
        "from gyronorth.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print(*sorted({'numpy.ma', 'scipy', 'pyarrow', 'sqlite3', 'rich', 'gyronorth.deviation_document',"
        " 'multiprocessing'} & set(sys.modules)), file=sys.stderr)"
    )
    run = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert run.stderr.split() == []
