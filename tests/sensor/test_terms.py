"""An error term more, as CONTRIBUTING says: one file is written, and everything takes the term from there."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from math import exp
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src/gyronorth"
#: What is added to `sensor/terms.py`: exponentially correlated noise of 20 s (IEEE Std 952-1997, C.1.1.5).
FIELD = "    correlated: float = 0.0  # standard deviation of exponentially correlated noise of 20 s, u\n"
TERM = """

def _correlated_covariance(errors: TriadErrors, first: Array, last: Array, _: float) -> Array:
    length, same = last - first, np.eye(len(first), dtype=bool)
    gap = np.maximum(np.maximum(first[None, :] - last[:, None], first[:, None] - last[None, :]), 0.0)
    lost = -np.expm1(-length / 20)
    across = np.outer(lost / length, lost / length) * 400 * np.exp(-gap / 20)
    return errors.correlated**2 * np.where(same, 800 * (length / 20 - lost) / length**2, across)


CORRELATED = Term(
    "correlated",
    "correlated_noise",
    "drift",
    TermUnit("correlated_noise_deg_h", "correlated noise", "deg/h", DEG_PER_HOUR),
    TermUnit("correlated_noise_mg", "correlated noise", "mg", MILLI_G),
    _correlated_covariance,
    lambda errors, duration, weighting: gauss_markov_variance(errors.correlated**2, 20.0, duration, weighting),
    lambda errors, tau: errors.correlated**2 * gauss_markov_allan_variance(tau, 20.0),
    lambda errors, f, _: errors.correlated**2 * 40 / (1 + (40 * np.pi * f) ** 2),
    lambda errors: ProcessLaw(processes=((errors.correlated**2, 20.0),)),
)
TERMS = (*TERMS, CORRELATED)
"""
#: What a user of it does.
USE = """
import json, sys
import numpy as np
import gyronorth as gn
from gyronorth.allan import identify
from gyronorth.sensor.law import NoiseLaw
from gyronorth.simulation import sensor_errors

sensor = gn.read_sensor("unit.json")
gn.write_sensor(sensor, "again.json")
law = NoiseLaw(sensor.gyro)
mean = sensor_errors(sensor.gyro, (600, 200), 2.0, rng=np.random.default_rng(0)).mean(axis=1) / sensor.gyro.correlated
record = sensor_errors(sensor.gyro, (1, 40_000), 2.0, rng=np.random.default_rng(1))[0]
found = identify(record, rate_hz=2.0).terms["correlated_noise"]
fine = gn.simulate(sensor, latitude=0.5, heading=1.0, duration=60, rate_hz=5, rng=np.random.default_rng(2))
print(json.dumps({
    "same": gn.read_sensor("again.json") == sensor,
    "drawn": mean.var(),
    "covariance": law.mean_covariance([0], [200], rate_hz=2.0)[0, 0] / sensor.gyro.correlated**2,
    "variance": float(sum(law.mean_variance(100.0).values())) / sensor.gyro.correlated**2,
    "identified": [found.status, found.value / sensor.gyro.correlated],
    "drift_deg": np.degrees(gn.heading(fine, sensor=sensor, method="mean").sigma_parts["drift"]),
}))
"""


@pytest.mark.slow
def test_an_error_term_more_is_one_file(tmp_path):
    package = tmp_path / "src/gyronorth"
    package.mkdir(parents=True)
    for entry in SOURCE.iterdir():
        if entry.name not in ("sensor", "__pycache__"):
            (package / entry.name).symlink_to(entry)
    shutil.copytree(SOURCE / "sensor", package / "sensor", ignore=shutil.ignore_patterns("__pycache__"))
    terms = package / "sensor/terms.py"
    before = "    turn_on_bias: float = 0.0"
    terms.write_text(terms.read_text().replace(before, FIELD + before, 1) + TERM)
    profile = {"schema": "gyronorth.sensor/1", "name": "unit", "gyro": {"correlated_noise_deg_h": 2.0}}
    (tmp_path / "unit.json").write_text(json.dumps(profile))
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "src")}
    done = subprocess.run(
        [sys.executable, "-c", USE], cwd=tmp_path, capture_output=True, text=True, env=environment, check=False
    )
    assert done.stderr == ""
    found = json.loads(done.stdout)
    expected = 2 / 25 * (5 - 1 + exp(-5))  # 2 v / a^2 (a - 1 + exp(-a)), a = 100 s / 20 s
    assert found["same"] is True
    assert found["covariance"] == pytest.approx(expected, rel=1e-9)
    assert found["variance"] == pytest.approx(expected, rel=1e-9)
    assert found["drawn"] == pytest.approx(expected, rel=4 * (2 / 1800) ** 0.5)  # 1800 means
    status, value = found["identified"]
    assert status == "identified"
    assert value == pytest.approx(1.0, abs=0.2)
    assert found["drift_deg"] > 1.0
