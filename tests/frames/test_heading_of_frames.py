"""The heading of the frames is that of the numbers that were sent, within their quantisation."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest
from frames import encoders
from frames.encoders import CASES

import gyronorth as gn
from gyronorth.attitude import mat_bn
from gyronorth.earth import STANDARD_GRAVITY, earth_rate_n
from gyronorth.frames import decode, protocol_info
from gyronorth.readers.axes import in_axes, mat_bf
from gyronorth.recording import Recording

LATITUDE, N = radians(48.0), 1500


def still(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A unit at rest with heading 40 deg, a little roll and pitch, noise above the quantisation: body axes."""
    mat, rng = mat_bn(radians(3.0), radians(-2.0), radians(40.0)), np.random.default_rng(3)
    gyro = mat @ earth_rate_n(LATITUDE) + 2e-5 * rng.standard_normal((n, 3))
    return gyro, mat @ np.array([0.0, 0.0, -STANDARD_GRAVITY]) + 5e-3 * rng.standard_normal((n, 3))


@pytest.mark.slow
@pytest.mark.parametrize("name", list(CASES))
def test_the_heading_is_that_of_what_was_sent(name, monkeypatch):
    mat = mat_bf(protocol_info(CASES[name](1).protocol).axes or "frd")
    gyro_b, accel_b = still(N)
    monkeypatch.setattr(encoders, "signal", lambda n, up, noise=0.0: (gyro_b[:n] @ mat, accel_b[:n] @ mat))
    case = CASES[name](N)
    samples, report = decode(case.preamble + b"".join(case.frames), case.protocol, case.options)
    assert samples.accel is not None
    decoded = Recording(in_axes(samples.gyro, mat), in_axes(samples.accel, mat), report.rate_hz or 0.0)
    sent = Recording(gyro_b, accel_b, case.rate_hz)
    found, expected = (gn.heading(each, latitude=LATITUDE, method="mean") for each in (decoded, sent))
    # errors of rounding, uniform within a step, of the mean of N; five sigma. Tilt moves heading by tan(latitude).
    of_rate = case.gyro_step / np.sqrt(12 * N) / (7.292e-5 * np.cos(LATITUDE))
    of_tilt = case.accel_step / np.sqrt(12 * N) / STANDARD_GRAVITY * np.tan(LATITUDE)
    assert abs(found.heading - expected.heading) < 5 * (of_rate + 2 * of_tilt) + 1e-6
    assert abs(found.heading - radians(40.0)) < radians(5.0)
