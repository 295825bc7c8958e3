"""The cells of `benchmark stress`, their recordings and their oracle."""

import numpy as np
import pytest

from gyronorth.earth import EARTH_RATE
from gyronorth.studies.stress import LATITUDE, Cell, cells, judge_cell, oracle_sigma, recordings
from gyronorth.uncertainty import horizontal_rate_variance


def test_every_cell_has_a_name_of_its_own():
    names = [cell.name for cell in cells()]
    assert len(set(names)) == len(names) > 50


def test_the_oracle_of_an_honest_unit_is_the_error_budget():
    """White noise and a constant: the mean is sufficient, with an accelerometer or without."""
    for accel in (True, False):
        cell = Cell("hg9900", 100.0, "honest", 0.0, 0.0, accel, True)
        parts = horizontal_rate_variance(cell.unit(), latitude=LATITUDE, duration=100.0)
        total = parts["noise"] + cell.unit().gyro.turn_on_bias ** 2 + (parts["levelling"] if accel else 0.0)
        expected = np.sqrt(total) / (EARTH_RATE * np.cos(LATITUDE))
        assert oracle_sigma(cell) == pytest.approx(expected, rel=0.01)


def test_what_is_known_less_costs_the_oracle_more():
    still, windy, blind = (
        oracle_sigma(Cell("hg9900", 100.0, what, 0.1, 0.0, accel, True))
        for what, accel in (("honest", True), ("wind", True), ("wind", False))
    )
    assert still < windy < 2 * still < blind


def test_a_nudge_is_in_the_true_heading():
    cell = Cell("hg9900", 60.0, "nudge", 0.3, 0.0, True, True)
    gyro_b, _, truth = recordings(cell, 3, np.random.default_rng(1))
    start = np.random.default_rng(1).uniform(0, 2 * np.pi, 3)
    turned = (truth - start + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(np.abs(turned), np.radians(0.3), rtol=1e-6)
    angle = gyro_b[..., 2].sum(axis=1) / 10 + EARTH_RATE * np.sin(LATITUDE) * 60
    np.testing.assert_allclose(angle, turned, atol=np.radians(0.05))


def test_a_unit_of_work_gives_plain_numbers():
    cell = list(vars(Cell("isa100c", 60.0, "honest", 0.0, 0.0, True, True)).values())
    found = judge_cell(cell=cell, runs=2, method="posterior", seed=[0, 1])
    assert set(found) == {"error_deg", "sigma_deg", "half_deg", "inside", "valid"}
    assert all(len(values) == 2 for values in found.values())
