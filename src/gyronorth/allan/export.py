"""A sensor profile in the words of other estimators: Kalibr, OpenVINS, KF-GINS, NavToolkit.

All four take continuous-time figures: a noise density, of which one sample at the rate f has the standard deviation
density x sqrt(f), and a random walk of the bias or a Gauss-Markov bias. The profile's flicker is none of these. Where
the recording shows no random walk, Kalibr's is the one whose Allan deviation at `WALK_TIME` is the flicker's floor.

Sources: Kalibr's wiki, "IMU noise model"; OpenVINS, "Sensor calibration"; KF-GINS, `dataset/kf-gins.yaml`; NavToolkit,
`navtk::filtering::ImuModel`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.sensor import Sensor, TriadErrors

#: Averaging time, s, at which a walk stands for a flicker.
WALK_TIME = 100.0
#: Allan deviation of flicker over its coefficient: sqrt(2 ln 2 / pi).
FLOOR = float(np.sqrt(2 * np.log(2) / np.pi))
#: Standard deviation of the in-run bias at one instant over the coefficient of flicker (`sensor.model`).
INSTANT = 1.82
MILLI_GAL = 1e-5


def walk_of(errors: TriadErrors) -> float:
    """Rate (acceleration) random walk, u / sqrt(s): that identified, else what stands for the flicker."""
    return errors.random_walk or FLOOR * errors.flicker * float(np.sqrt(3 / WALK_TIME))


def _comment(sensor: Sensor, rate_hz: float) -> str:
    walk = "identified" if sensor.gyro.random_walk else f"in place of flicker, equal to its floor at {WALK_TIME:g} s"
    return (
        f"# {sensor.name}, by gyronorth allan. Continuous-time: one sample at {rate_hz:g} Hz has the noise density\n"
        f"# times sqrt({rate_hz:g}). Random walk of the gyro bias: {walk}.\n"
    )


def _densities(sensor: Sensor, pad: str = "") -> str:
    figures = {
        "accelerometer_noise_density": (sensor.accel.white, "m/s^2/sqrt(Hz)"),
        "accelerometer_random_walk": (walk_of(sensor.accel), "m/s^3/sqrt(Hz)"),
        "gyroscope_noise_density": (sensor.gyro.white, "rad/s/sqrt(Hz)"),
        "gyroscope_random_walk": (walk_of(sensor.gyro), "rad/s^2/sqrt(Hz)"),
    }
    return "".join(f"{pad}{name}: {value:.6e} # {unit}\n" for name, (value, unit) in figures.items())


def _same(figure: str) -> str:
    """One figure for all three axes."""
    return f"[{figure}, {figure}, {figure}]"


def kalibr(sensor: Sensor, rate_hz: float) -> str:
    """`imu.yaml` of Kalibr."""
    return f"{_comment(sensor, rate_hz)}{_densities(sensor)}rostopic: /imu0\nupdate_rate: {rate_hz:g} # Hz\n"


def openvins(sensor: Sensor, rate_hz: float) -> str:
    """`kalibr_imu_chain.yaml` of OpenVINS."""
    identity = "".join(f"    - [{', '.join(f'{value:.1f}' for value in row)}]\n" for row in np.eye(4))
    return (
        f"%YAML:1.0\n{_comment(sensor, rate_hz)}imu0:\n  T_i_b:\n{identity}{_densities(sensor, '  ')}"
        f'  model: "calibrated"\n  rostopic: /imu0\n  time_offset: 0.0\n  update_rate: {rate_hz:g} # Hz\n'
    )


def kf_gins(sensor: Sensor, rate_hz: float) -> str:
    """The block `imunoise` of KF-GINS: the biases are Gauss-Markov."""
    gyro, accel = sensor.gyro, sensor.accel
    figures = {
        "arw": (gyro.white / DEG_PER_SQRT_HOUR, "deg/sqrt(hr)"),
        "vrw": (accel.white * 60, "m/s/sqrt(hr)"),
        "gbstd": (INSTANT * gyro.flicker / DEG_PER_HOUR, "deg/hr"),
        "abstd": (INSTANT * accel.flicker / MILLI_GAL, "mGal"),
        "gsstd": (gyro.scale_factor * 1e6, "ppm"),
        "asstd": (accel.scale_factor * 1e6, "ppm"),
    }
    rows = "".join(f"  {name}: {_same(f'{value:.6g}')} # {unit}\n" for name, (value, unit) in figures.items())
    return f"{_comment(sensor, rate_hz)}imunoise:\n{rows}  corrtime: {gyro.flicker_longest / 3600:.6g} # hr\n"


def navtk(sensor: Sensor, rate_hz: float) -> str:
    """The fields of NavToolkit's `ImuModel`, SI: the biases are Gauss-Markov, of one instant and of switch-on."""
    rows = []
    for name, errors in (("accel", sensor.accel), ("gyro", sensor.gyro)):
        bias = INSTANT * errors.flicker
        figures = {
            "random_walk_sigma": errors.white,
            "bias_sigma": bias,
            "bias_tau": errors.flicker_longest,
            "bias_initial_sigma": float(np.hypot(bias, errors.turn_on_bias)),
        }
        rows += [f"{name}_{field}: {_same(f'{value:.6e}')}\n" for field, value in figures.items()]
    return _comment(sensor, rate_hz) + "".join(rows)


#: Name -> the text of a profile for it.
EXPORTS: dict[str, Callable[[Sensor, float], str]] = {
    "kalibr": kalibr, "openvins": openvins, "kf-gins": kf_gins, "navtk": navtk,
}  # fmt: skip
