"""A unit at rest that sends frames, for tests of the live instrument."""

from __future__ import annotations

from math import radians

import numpy as np
from frames import encoders
from frames.encoders import CASES, Case

from gyronorth.attitude import mat_bn
from gyronorth.earth import STANDARD_GRAVITY, earth_rate_n
from gyronorth.frames import protocol_info
from gyronorth.readers import ReadOptions
from gyronorth.readers.axes import mat_bf

LATITUDE, HEADING, SECONDS = radians(48.0), radians(40.0), 12.0


def unit(name: str, monkeypatch, *, seconds: float = SECONDS, rate_hz: float | None = None) -> tuple[Case, ReadOptions]:
    """A unit at rest, and what must be declared of it; at the usual rate of its case if none is given."""
    rate_hz = rate_hz or CASES[name](1).rate_hz
    n, rng = round(seconds * rate_hz), np.random.default_rng(3)
    mat = mat_bn(radians(3.0), radians(-2.0), HEADING)
    gyro_b = mat @ earth_rate_n(LATITUDE) + 2e-6 * np.sqrt(rate_hz) * rng.standard_normal((n, 3))
    accel_b = mat @ np.array([0.0, 0.0, -STANDARD_GRAVITY]) + 5e-3 * rng.standard_normal((n, 3))
    protocol = CASES[name](1).protocol
    axes = protocol_info(protocol).axes
    mat_vf = mat_bf(axes or "frd")
    monkeypatch.setattr(encoders, "signal", lambda n, up, noise=0.0: (gyro_b[:n] @ mat_vf, accel_b[:n] @ mat_vf))
    case = CASES[name](n, rate=rate_hz)
    declared = case.options
    options = ReadOptions(
        latitude=LATITUDE,
        axes=None if axes else "frd",
        rate_hz=declared.rate_hz,
        gyro_unit=declared.gyro_unit,
        increments=None if declared.increments is None else declared.increments != "none",
        imu=declared.imu,
        protocol=case.protocol if case.protocol == "anpp" else None,
    )
    return case, options
