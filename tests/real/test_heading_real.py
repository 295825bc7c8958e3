"""Headings of real recordings whose truth, or whose uselessness, is known."""

from dataclasses import replace

import numpy as np
import pytest

from gyronorth.conditioning import decimated
from gyronorth.pipeline import heading
from gyronorth.readers import ReadOptions, read

TRUTH = 90.6  # deg, the author's own fine alignment


@pytest.fixture(scope="module")
def lasergyro(real_data):
    return read(real_data / "lasergyro.imu")


def half_width(estimate):
    return np.degrees((estimate.interval95[1] - estimate.interval95[0]) % (2 * np.pi)) / 2


def error(estimate):
    return (np.degrees(estimate.heading) - TRUTH + 180) % 360 - 180


@pytest.mark.slow
@pytest.mark.parametrize("window", [None, (0, 300), (600, 950), (1020, 1500)])
def test_inertial_frame_on_a_swaying_vehicle(lasergyro, window):
    recording = lasergyro if window is None else lasergyro.window(*window)
    for method in ("inertial", "auto"):
        estimate = heading(recording, method=method)
        assert estimate.valid
        assert estimate.method == ("posterior" if method == "auto" else method)
        assert abs(error(estimate)) <= 0.05
        assert abs(error(estimate)) <= half_width(estimate)


@pytest.mark.parametrize(("window", "most", "widest"), [(None, 2.5, 12.0), ((600, 950), 1.0, 2.0)])
def test_mean_on_a_swaying_vehicle(lasergyro, window, most, widest):
    recording = lasergyro if window is None else lasergyro.window(*window)
    estimate = heading(recording, method="mean")
    assert estimate.valid
    assert abs(error(estimate)) <= most
    assert abs(error(estimate)) <= half_width(estimate) <= widest
    assert "swaying" in {warning.code for warning in estimate.warnings}
    if window is not None:
        assert abs(np.degrees(estimate.implied_latitude) - 34.246048) <= 0.6


@pytest.mark.slow
@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.long)])
def test_short_windows_at_3_hz(lasergyro, every):
    slow = decimated(lasergyro, 3.0)
    estimates = [heading(slow.window(start, start + 100)) for start in range(0, 1800, 100 * every)]
    errors = np.array([error(estimate) for estimate in estimates])
    sigmas = np.degrees([estimate.sigma for estimate in estimates])
    assert np.sqrt(np.mean(errors**2)) <= 0.30
    assert np.sum(np.abs(errors) <= [half_width(estimate) for estimate in estimates]) >= len(errors) - 1
    # Without a profile a bias of many times what shows cannot be ruled out: ten times the error of these windows.
    assert np.sqrt(np.mean(sigmas**2)) <= 2.0


def test_stim300_with_200_deg_per_hour_of_bias_is_refused(real_data):
    options = ReadOptions(
        variable="data",
        columns={"w_x": 4, "w_y": 5, "w_z": 6, "f_x": 8, "f_y": 9, "f_z": 10},
        gyro_unit="deg/s",
        accel_unit="g",
        rate_hz=125.0,
    )
    recording = read(real_data / "stim300_cart_static_then_turn.mat", options)
    latitude = np.radians(41.8342)
    still = heading(recording.window(0, 78), latitude=latitude)
    reason = next(finding for finding in still.reasons if finding.code == "rate_norm")
    # (-208, 43, 140) deg/h: a norm of 255, 240 above Earth rate.
    assert reason.value == pytest.approx(240, abs=5)
    # Then it drives: no single pose.
    whole = {finding.code for finding in heading(recording, latitude=latitude, method="mean").reasons}
    assert {"rate_norm", "motion"} <= whole


def test_parked_car_with_an_xsens_is_refused(real_data):
    recording = read(real_data / "xsens_mti_static.txt", ReadOptions(rate_hz=100.0))
    codes = {finding.code for finding in heading(replace(recording, latitude=None), latitude=np.radians(23.05)).reasons}
    assert "rate_norm" in codes
