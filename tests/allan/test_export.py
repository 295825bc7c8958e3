"""Profiles in the words of other estimators: figures in their units."""

from __future__ import annotations

from math import radians, sqrt

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from gyronorth.allan.export import EXPORTS, WALK_TIME, walk_of
from gyronorth.catalogue import ALLAN_EXPORTS
from gyronorth.cli import app
from gyronorth.readers import write
from gyronorth.sensor import Sensor
from gyronorth.sensor.law import NoiseLaw
from gyronorth.sensor.model import TriadErrors
from gyronorth.simulation import simulate

ARW, VRW = radians(0.15) / 60, 0.07 / 60
SENSOR = Sensor(
    "unit",
    TriadErrors(white=ARW, random_walk=1e-7, flicker=radians(0.5) / 3600, scale_factor=3e-4),
    TriadErrors(white=VRW, flicker=5e-4),
)


def parsed(name: str) -> dict:
    return yaml.safe_load(EXPORTS[name](SENSOR, 200.0).removeprefix("%YAML:1.0\n"))


def test_names_are_those_of_the_help():
    assert tuple(EXPORTS) == ALLAN_EXPORTS


@pytest.mark.parametrize("name", ["kalibr", "openvins"])
def test_densities_are_continuous(name):
    found = parsed(name)["imu0"] if name == "openvins" else parsed(name)
    assert found["gyroscope_noise_density"] == pytest.approx(ARW, rel=1e-5)
    assert found["accelerometer_noise_density"] == pytest.approx(VRW, rel=1e-5)
    assert found["gyroscope_random_walk"] == pytest.approx(1e-7, rel=1e-5)
    assert found["update_rate"] == 200
    drawn = NoiseLaw(TriadErrors(white=ARW)).draw(
        (1, 20000), 200.0, constant=np.zeros((1, 3)), rng=np.random.default_rng(1)
    )
    assert drawn.std() == pytest.approx(found["gyroscope_noise_density"] * sqrt(200.0), rel=0.02)


def test_a_walk_stands_for_flicker_at_one_averaging_time():
    law = NoiseLaw(TriadErrors(flicker=5e-4)).allan_variance([WALK_TIME]).sum()
    assert walk_of(SENSOR.accel) ** 2 * WALK_TIME / 3 == pytest.approx(law, rel=0.03)


def test_gauss_markov_figures():
    found = parsed("kf-gins")["imunoise"]
    assert found["arw"] == pytest.approx([0.15] * 3, rel=1e-4)
    assert found["vrw"] == pytest.approx([0.07] * 3, rel=1e-4)
    assert found["gbstd"] == pytest.approx([1.82 * 0.5] * 3, rel=1e-4)
    assert found["abstd"] == pytest.approx([1.82 * 50] * 3, rel=1e-4)  # 5e-4 m/s^2 are 50 mGal
    assert found["gsstd"] == pytest.approx([300] * 3)
    model = parsed("navtk")
    assert model["gyro_random_walk_sigma"] == pytest.approx([ARW] * 3, rel=1e-5)
    assert model["accel_bias_tau"] == [1000.0] * 3
    assert model["accel_bias_initial_sigma"] == pytest.approx([1.82 * 5e-4] * 3, rel=1e-5)


@pytest.mark.slow
def test_the_command_prints_it_and_nothing_else(tmp_path):
    recording = simulate(
        "stim300", latitude=0.8, heading=0.0, duration=120.0, rate_hz=50.0, rng=np.random.default_rng(2)
    )
    write(recording, tmp_path / "rec.npz")
    result = CliRunner().invoke(app, ["allan", str(tmp_path / "rec.npz"), "--export", "kalibr"])
    assert result.exit_code == 0
    assert yaml.safe_load(result.stdout)["update_rate"] == 50
    assert CliRunner().invoke(app, ["allan", "x.npz", "--export", "matlab"]).exit_code == 2
