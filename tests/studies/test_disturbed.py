"""`benchmark disturbed`: its methods on known truth, its units, its tables."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.angles import angle_error
from gyronorth.attitude import level
from gyronorth.earth import EARTH_RATE
from gyronorth.simulation.disturbance import ReferenceSet, reference_set
from gyronorth.studies import disturbed, disturbed_long, disturbed_paper
from gyronorth.studies.disturbed_methods import METHODS, Part, part_of, periodogram
from gyronorth.studies.study import StudyPlan


def ideal(heading, extra):
    """A part of recordings without noise at 32.11 N with `extra` (n, 3) rad/s on top."""
    latitude = np.radians(32.11)
    north, down = EARTH_RATE * np.cos(latitude), -EARTH_RATE * np.sin(latitude)
    rate = np.array([north * np.cos(heading), -north * np.sin(heading), down])
    made = ReferenceSet(rate + extra[None], np.array([heading]), 3.0, latitude, "")
    return Part(made, slice(0, 1), "quiet", 1e-9, 1)


@pytest.mark.parametrize("name", ["mean", "median", "Huber", "harmonic least squares"])
def test_classical_methods_give_the_heading_of_a_still_unit(name):
    rng = np.random.default_rng(1)
    part = ideal(2.3, rng.normal(0, 1e-10, (300, 3)))
    assert_allclose(angle_error(METHODS[name](part).heading, 2.3), 0, atol=1e-4)


def test_harmonics_take_out_a_tone_of_the_grid_and_huber_a_bump():
    time = (np.arange(300) + 0.5) / 3
    tone = 1e-5 * np.sin(2 * np.pi * (0.008 + 0.0125) * time)[:, None] * [1, -0.5, 0.2]
    part = ideal(1.0, tone)
    assert abs(angle_error(METHODS["harmonic least squares"](part).heading, 1.0)[0]) < 1e-3
    bump = np.random.default_rng(2).normal(0, 1e-6, (300, 3))
    bump[100:104] += 1e-3
    part = ideal(1.0, bump)
    off = {name: abs(angle_error(METHODS[name](part).heading, 1.0)[0]) for name in ("mean", "Huber", "median")}
    assert off["Huber"] < 0.05 * off["mean"]
    assert off["median"] < 0.05 * off["mean"]


@pytest.mark.slow
def test_part_is_the_reference_set_and_its_accelerometer_feels_the_same_motion():
    part = part_of(kind="mixed", duration=100.0, bias_deg_h=0.1, runs=2000, rows=(5, 8), seed=disturbed.SEED)
    assert part.made.sha256 == reference_set().sha256
    rate, accel = part.gyro, part.accel()
    # Roll by the accelerometer against the integrated rate: the noise of both over 10 s stays below 0.003 deg.
    roll, pitch = level(accel.reshape(3, 10, 30, 3).mean(axis=2))
    turned = np.cumsum(rate, axis=1) / 3
    seen = turned.reshape(3, 10, 30, 3).mean(axis=2)
    time = np.arange(10)
    for angle, axis in ((roll, 0), (pitch, 1)):
        trend = np.array(
            [np.polyval(np.polyfit(time, s - a, 1), time) for s, a in zip(seen[..., axis], angle, strict=True)]
        )
        assert np.abs(seen[..., axis] - angle - trend).max() < np.radians(0.01)


def test_periodogram_finds_tone_and_bump():
    index = np.arange(300) - 149.5
    cycles = (0.008 + 0.00125 * np.arange(234)) / 3
    rate = np.random.default_rng(3).normal(0, 1, (300, 3)) + 5 * np.sin(2 * np.pi * cycles[40] * index)[:, None]
    rate[50:53] += 60
    odds, height = periodogram(rate.astype(np.float32), index.astype(np.float32), cycles.astype(np.float32))
    assert np.flatnonzero(odds > 0).tolist() == [50, 51, 52]
    assert abs(int(np.argmax(height)) - 40) <= 1


@pytest.mark.slow
def test_units_and_report(monkeypatch):
    pytest.importorskip("onnxruntime")
    pytest.importorskip("torch")
    monkeypatch.setattr(disturbed, "CASES", (("mixed", 100.0, 0.1, 6, 3), ("beat", 10.0, 0.1, 4, 2)))
    monkeypatch.setattr(disturbed, "ROWS", 4)
    monkeypatch.setattr(disturbed, "BAYES_ROWS", 2)
    monkeypatch.setattr(disturbed_paper, "TRAINED", 16)
    monkeypatch.setattr(disturbed_paper, "VALIDATED", 8)
    units = disturbed.DISTURBED.units(StudyPlan(epochs=1))
    names = ["fast-0000", "fast-0004", "bayes-0000", "bayes-0002", "trained"]
    expected = [*(f"disturbed/mixed-100s-0.1/{name}" for name in names), "disturbed/beat-10s-0.1/fast-0000"]
    assert [unit.name for unit in units] == [*expected, "disturbed/cost"]
    results = {}

    def run(unit):
        needs = [run(need) for need in unit.needs]
        if unit.name not in results:
            results[unit.name] = unit.function(*needs, **unit.arguments)
        return results[unit.name]

    for unit in units[:-1]:
        run(unit)
    results["disturbed/cost"] = {"cpu_ms": dict.fromkeys(METHODS, 1.0)}
    assert json.loads(json.dumps(results)) == results
    # Nothing is said where a bundle or `bayes` does not take the window.
    assert set(results["disturbed/beat-10s-0.1/fast-0000"]["error_deg"]) == set(METHODS) - set(disturbed.WINDOWS)
    whole = units[0].function(**{**units[0].arguments, "rows": [0, 6]})["error_deg"]
    parts = [results[f"disturbed/mixed-100s-0.1/fast-000{i}"]["error_deg"]["learned"] for i in (0, 4)]
    assert_allclose(whole["learned"], [*parts[0], *parts[1]], atol=1e-5)
    report = disturbed.DISTURBED.report(StudyPlan(), results)
    table = report.tables[0]
    cells = {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}
    assert list(cells) == [*METHODS, *disturbed_paper.ROWS]
    assert cells["mean"]["ratio to the mean"].value == 1.0
    assert [cells[name]["recordings"] for name in ("mean", "bayes", "learned")] == [6, 3, 6]

    def rms(errors):
        return np.sqrt(np.mean(np.square(errors)))

    bayes = [e for i in (0, 2) for e in results[f"disturbed/mixed-100s-0.1/bayes-000{i}"]["error_deg"]["bayes"]]
    found = cells["learned"]
    assert_allclose(found["ratio to the mean"].value, rms(whole["learned"]) / rms(whole["mean"]), rtol=1e-5)
    assert_allclose(found["ratio to Huber"].value, rms(whole["learned"]) / rms(whole["Huber"]), rtol=1e-5)
    # Of the recordings that both saw, which are the first.
    assert_allclose(found["ratio to bayes"].value, rms(whole["learned"][:3]) / rms(bayes), rtol=1e-5)
    assert "held out" in report.tables[1].title


def test_recordings_that_train_the_papers_networks():
    pytest.importorskip("torch")
    from gyronorth.learn.disturbed_paper import draw_recordings
    from gyronorth.learn.settings import Settings

    drawn = draw_recordings(Settings(seed=disturbed.SEED), 50, stream=1)
    latitude, heading = np.radians(32.11), drawn.noisy.heading
    still = np.stack([np.cos(heading) * np.cos(latitude), -np.sin(heading) * np.cos(latitude)], axis=1) * EARTH_RATE
    # The heading of a set is the mean over the recording; bumps turn the unit by hundredths of a degree.
    assert_allclose(drawn.clean[:, 0, :2], still, atol=1e-12)
    assert_allclose(drawn.clean[:, 0, 2], -EARTH_RATE * np.sin(latitude))
    off = np.abs(drawn.noisy.gyro_l.mean(axis=1) - drawn.clean[:, 0])
    # 40 of the mix, then 10 quiet: bias of 0.1 and noise of 0.12 deg/h per axis; of 30 values none is beyond 4 sigma.
    assert np.degrees(off[40:].max()) * 3600 < 4 * np.hypot(0.1, 0.02 / np.sqrt(100 / 3600))
    assert np.median(off[:40]) > 2 * np.median(off[40:])
    test = reference_set(runs=50)
    other = draw_recordings(Settings(seed=disturbed.SEED), 50, stream=2)
    for one in (test.heading, other.noisy.heading):
        assert len(np.intersect1d(one, heading)) == 0


@pytest.mark.slow
def test_long_recordings(monkeypatch):
    pytest.importorskip("onnxruntime")
    monkeypatch.setattr(disturbed_long, "KINDS", ("warmup",))
    monkeypatch.setattr(disturbed_long, "DURATIONS", (400.0,))
    monkeypatch.setattr(disturbed_long, "RUNS", 6)
    monkeypatch.setattr(disturbed_long, "ROWS", 4)
    units = disturbed_long.LONG.units(StudyPlan())
    assert [unit.name for unit in units] == ["long/warmup-400s/0000", "long/warmup-400s/0004"]
    results = {unit.name: unit.function(**unit.arguments) for unit in units}
    assert json.loads(json.dumps(results)) == results
    (table,) = disturbed_long.LONG.report(StudyPlan(), results).tables
    cells = {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}
    assert list(cells) == [f"400 s: {name}" for name in disturbed_long.METHODS]
    errors = np.concatenate([unit["error_deg"]["learned"] for unit in results.values()])
    assert cells["400 s: learned"]["recordings"] == len(errors) == 6
    assert_allclose(cells["400 s: learned"]["CRMSE, deg"].value, np.sqrt(np.mean(errors**2)), rtol=1e-3)
    assert cells["400 s: mean"]["ratio to the mean"].value == 1.0
    assert cells["400 s: auto"]["CRMSE, deg"].value < 0.7 * cells["400 s: mean"]["CRMSE, deg"].value
    assert "400 s" in disturbed_long.LONG.floor(StudyPlan(), table)
