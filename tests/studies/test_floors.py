"""The floors below the tables of the studies, against the closed form N / (Omega cos lat sqrt(T))."""

from __future__ import annotations

import json
import re
from concurrent.futures import ThreadPoolExecutor
from math import cos, radians, sqrt
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.angles import angle_error
from gyronorth.published import fit_noise, published
from gyronorth.studies import disturbed, paper_variants
from gyronorth.studies.benchmark import STUDIES, run_benchmark
from gyronorth.studies.methods import floor
from gyronorth.studies.study import StudyPlan
from gyronorth.studies.tables import Table

DATA = Path(__file__).parents[2] / "docs/results/data"
STUDY = {study.name: study for study in STUDIES}
#: Horizontal Earth rate at 32.11 N, deg/h: 360 deg in a sidereal day.
NORTH = 360 / 23.9344696 * cos(radians(32.11))


def lines(name):
    """Last line below each table of a study of the results pages, by title."""
    study = STUDY[name]
    content = json.loads((DATA / study.benchmark / f"{name}.json").read_text())
    tables = [Table(t["title"], tuple(t["columns"]), tuple(map(tuple, t["rows"]))) for t in content["tables"]]
    return {t.title: study.markdown(t, StudyPlan(**content["plan"])).strip().splitlines()[-1] for t in tables}


def values(line):
    return [(float(value), float(at)) for value, at in re.findall(r"([\d.]+) deg at ([\d.]+) s", line)]


def white_floor(arw, duration):
    """In deg, of an angle random walk in deg/sqrt(h) and a duration in s."""
    return np.degrees(arw / sqrt(duration / 3600) / NORTH)


@pytest.mark.parametrize(
    ("name", "durations"),
    [
        *((name, [100]) for name in ("scale", "t_back", "seeds", *(f.name for f in paper_variants.FAMILIES))),
        ("duration", [10, 20, 30, 45, 60, 80, 100]),
        ("noise", [10, 20, 30, 60, 240]),
    ],
)
def test_of_the_twin_it_is_that_of_its_noise(name, durations):
    found = values(next(iter(lines(name).values())))
    assert [at for _, at in found] == durations
    arw = np.degrees(fit_noise().arw) * 60
    assert_allclose([value for value, _ in found], [white_floor(arw, at) for at in durations], atol=6e-4)


def test_of_the_twin_itself_at_each_of_its_windows():
    windows = [at for _, at in values(lines("noise")["The reconstruction itself"])]
    assert windows == [10, 15, 20, 30, 45, 60, 100, 115, 230]


def test_with_a_bias_that_cannot_be_learnt():
    figures = published()
    rate, heading = np.degrees(figures.mean_rate) * 3600, figures.heading_true
    bias = np.mean([(rate[:, 0] - NORTH * np.cos(heading)).std(), (rate[:, 1] + NORTH * np.sin(heading)).std()])
    expected = np.hypot(white_floor(np.degrees(fit_noise().arw) * 60, 100), np.degrees(bias / NORTH))
    assert_allclose(np.degrees(floor(StudyPlan().recordings(), 100.0)), expected, rtol=1e-6)


def test_of_disturbed_recordings_with_and_without_the_residual_bias():
    found = lines("disturbed")
    assert "Floor" not in found.pop("Cost of a recording of 100 s")
    assert len(found) == len(disturbed.CASES) == 15
    for title, line in found.items():
        duration, bias = map(float, re.search(r": (\d+) s, residual bias ([\d.]+) deg/h", title).groups())
        at, noise, both, law = re.search(
            r"at (\d+) s: ([\d.]+) deg for white .*, ([\d.]+) deg with .* normal law of ([\d.]+) deg/h", line
        ).groups()
        assert (float(at), float(law)) == (duration, bias)
        expected = white_floor(0.02, duration)
        assert_allclose(float(noise), expected, atol=6e-4)
        assert_allclose(float(both), np.hypot(expected, np.degrees(bias / NORTH)), atol=6e-4)


def test_of_a_denoisers_own_error_it_is_what_the_mean_of_the_noised_set_attains():
    found = {name: lines(name) for name in ("table_1", "denoisers")}
    line = found["table_1"]["Table 1: normalisation: the denoisers' own error"]
    # At the equator, over all headings, a sequence deviates by Omega sqrt(2/9), the set by Omega sqrt(1/3).
    beta = 1e-4 + np.arange(1, 1001) * 4e-7
    ratio = np.degrees(np.sqrt(1 / np.prod(1 - beta) - 1) / sqrt(300))
    assert f"alone): {ratio * sqrt(2 / 9):.3f} deg;" in line
    assert f"{ratio * sqrt(1 / 3):.3f} deg for `of the data set`" in line
    assert "103.923 deg, the noise leaving no heading, for `per sequence and channel` and `none`" in line
    # At the latitude of the site: errors of means of drawn noise.
    line = found["denoisers"]["Denoiser: latitude, loss, data, embedding: the denoisers' own error"]
    value = float(re.search(r"([\d.]+) deg for `latitude of the site`", line)[1])
    heading, latitude = np.linspace(0, 2 * np.pi, 20000), radians(32.11)
    rate = cos(latitude) * np.stack([np.cos(heading), -np.sin(heading)], axis=1)
    deviation = np.column_stack([rate, np.full(20000, -np.sin(latitude))]).std(axis=1, keepdims=True)
    mean = rate + np.random.default_rng(1).standard_normal(rate.shape) * deviation * np.radians(ratio)
    off = angle_error(np.arctan2(-mean[:, 1], mean[:, 0]), heading)
    assert_allclose(value, np.degrees(np.sqrt(np.mean(off**2))), rtol=0.03)  # 20,000 squares know it to 0.5 %


def test_the_synthetic_test_set_has_the_size_that_is_told():
    pytest.importorskip("torch")
    from gyronorth.learn.settings import Settings
    from gyronorth.learn.stages import denoiser_data

    assert len(denoiser_data(Settings())[2]) == 144
    assert all("draw of 144 recordings" in v for k, v in lines("table_1").items() if k.endswith("own error"))


def test_the_command_writes_it_too(tmp_path):
    with ThreadPoolExecutor(1) as executor:
        run_benchmark("published", tmp_path, executor, only=("noise",))
    text = (tmp_path / "noise.md").read_text()
    assert all(line in text for line in lines("noise").values())
    assert text.count("Floor (Cramér-Rao") == 2
