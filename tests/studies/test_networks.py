"""Training units of the studies: no recording in two parts, one denoiser for all that share it, plain results."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.angles import angle_error
from gyronorth.errors import InputError
from gyronorth.published import model_based
from gyronorth.recording import Recording
from gyronorth.simulation import simulate
from gyronorth.studies import networks, paper_table_2, paper_variants
from gyronorth.studies.network_tables import DIVERGED, circle_lost, network_row
from gyronorth.studies.networks import BASELINE, WITHOUT_DENOISER, denoiser_unit, heading_unit, splits_of
from gyronorth.studies.paper_cost import COST
from gyronorth.studies.published_splits import split_units
from gyronorth.studies.source import described, public_recordings, recordings_of
from gyronorth.studies.study import StudyPlan

PLAN = StudyPlan(epochs=1)
TINY = {
    "denoiser": {"layers": 1, "hidden": 4},
    "heading": {"layers": 1, "hidden": 4, "augment": {"copies": 2}},
    "synthetic": {"headings": 40},
    "sampler": {"kind": "ddim", "jumps": 1},
}


def run(unit):
    """A unit and what it needs, as the executor does, through JSON as the files do."""
    needs = [run(need) for need in unit.needs]
    return json.loads(json.dumps(unit.function(*needs, **unit.arguments), allow_nan=False))


def test_networks_and_other_methods_are_tested_on_the_same_recordings():
    network = paper_table_2.network_units(StudyPlan())["baseline network (II-B)"]
    others = split_units(StudyPlan())
    for one, other in zip(network, others, strict=False):
        for part in ("train", "validation", "test"):
            assert sorted(one.arguments["split"][part]) == sorted(other.arguments[part])


def test_variants_of_sampler_and_heading_share_a_denoiser_and_others_do_not():
    name = denoiser_unit({}, PLAN, seed=0).name
    assert denoiser_unit({"sampler": {"noise": False}}, PLAN, seed=0).name == name
    assert denoiser_unit({"heading": {"dropout": 0.2}}, PLAN, seed=0).name == name
    assert denoiser_unit({"denoiser": {"tau": 0.5}}, PLAN, seed=0).name != name
    assert denoiser_unit({}, PLAN, seed=1).name != name
    assert denoiser_unit({}, PLAN, seed=0, split=splits_of(PLAN, 1)[0]).name != name


def test_a_plan_never_lengthens_a_training():
    """`--epochs` is a maximum: 500 leaves the paper's 300 and 150 as they are, and its units the same."""
    from gyronorth.learn.settings import Settings

    assert {"denoiser": Settings().denoiser.epochs, "heading": Settings().heading.epochs} == networks.FULL
    split, long, short = splits_of(PLAN, 1)[0], StudyPlan(epochs=500), StudyPlan(epochs=200)
    for variant in ({}, WITHOUT_DENOISER, BASELINE):
        assert (
            heading_unit(variant, long, split, seed=0).key() == heading_unit(variant, StudyPlan(), split, seed=0).key()
        )
    assert heading_unit(BASELINE, short, split, seed=0).arguments["settings"]["heading"]["epochs"] == 200
    assert "epochs" not in heading_unit({}, short, split, seed=0).arguments["settings"]["heading"]
    assert denoiser_unit({}, short, seed=0).arguments["settings"]["denoiser"]["epochs"] == 200


@pytest.mark.slow
def test_a_unit_is_the_same_whatever_was_denoised_before_it(monkeypatch):
    """Units share what a denoiser made of a recording: with memory and without, bit by bit."""
    splits = splits_of(PLAN, 2)
    units = [heading_unit(TINY, PLAN, split, seed=k) for k, split in enumerate(splits)]
    shared = [run(unit) for unit in units]
    monkeypatch.setattr(networks, "remembering", networks.rebuilt)
    assert [run(unit) for unit in units] == shared


def test_the_baseline_of_the_studies_is_that_of_the_settings():
    from gyronorth.learn.settings import Settings, baseline

    assert Settings.model_validate(BASELINE) == baseline()


def test_what_needs_no_denoiser_trains_none():
    split = splits_of(PLAN, 1)[0]
    assert heading_unit(WITHOUT_DENOISER, PLAN, split, seed=0).needs == ()
    assert heading_unit(BASELINE, PLAN, split, seed=0).needs == ()
    assert len(heading_unit({}, PLAN, split, seed=0).needs) == 1


def test_every_variant_is_a_valid_setting():
    from gyronorth.learn.settings import Settings

    for family in paper_variants.FAMILIES:
        units = [heading_unit(variant, PLAN, splits_of(PLAN, 1)[0], seed=0) for variant in family.variants.values()]
        settings = [Settings.model_validate(unit.arguments["settings"]) for unit in units]
        assert all(one.rate_hz == 3.0 for one in settings)


def test_a_trained_unit_tells_errors_of_each_part_and_the_closed_form_beside():
    split = splits_of(PLAN, 1)[0]
    result = run(heading_unit(TINY, PLAN, split, seed=0))
    twin = recordings_of(PLAN.seed)
    for part, expected in (("train", split.train), ("validation", split.validation), ("test", split.test)):
        assert result[part]["recording"] == sorted(expected.tolist())
        first = twin.gyro_l[result[part]["recording"], :300].mean(axis=1)
        error = angle_error(np.arctan2(-first[:, 1], first[:, 0]), twin.heading_true[result[part]["recording"]])
        assert_allclose(result[part]["model_based_deg"], np.degrees(error), rtol=1e-5)
    assert {"loss", "validation", "test"} <= set(result["history"][0])
    row = network_row("tiny", [result], seed=0)
    assert row[4].value > 10  # one epoch of four units knows no heading
    assert len(result["circle_error_deg"]) == networks.CIRCLE
    assert float(row[9].split()[0]) > 50  # so most of the circle is lost


class OffBeyond270:
    """A network that knows all headings but those from 270 deg on, where it is off by 90 deg."""

    settings = SimpleNamespace(samples=3)

    def headings_of_clean(self, gyro_l):
        heading = model_based(gyro_l)
        return np.where(heading >= 1.5 * np.pi - 1e-9, heading - np.pi / 2, heading)


def test_the_lost_part_of_the_circle_is_counted():
    error = networks.circle_error(OffBeyond270())
    assert_allclose(error[:135], 0, atol=1e-9)
    assert_allclose(error[135:], -90)
    assert circle_lost([{"circle_error_deg": error}]) == "25.0 %"


def test_cost_of_training_is_of_both_stages():
    def cheap(*, layout, **_):
        return {"denoiser_epoch_s": 2.0, "heading_epoch_s": 3.0, "denoise_s": 60.0} | {
            "denoiser_epochs": 30,
            "heading_epochs": 20,
        }

    results = {name: cheap(layout=name) for name in ("cost/flattened", "cost/temporal")}
    table = COST.report(PLAN, results).tables[0]
    assert [row[-1] for row in table.rows] == [3.0, 3.0]  # (30 x 2 + 20 x 3 + 60) s


def test_a_denoiser_unit_is_rebuilt_as_it_was_trained():
    from gyronorth.learn.settings import Settings
    from gyronorth.learn.stages import train_denoiser

    unit = denoiser_unit(TINY, PLAN, seed=3)
    result = run(unit)
    settings = Settings.model_validate(unit.arguments["settings"])
    gyro = recordings_of(0).gyro_l[:2, :300]
    assert_allclose(networks.rebuilt(result, settings).clean(gyro), train_denoiser(settings).clean(gyro), rtol=0)
    # one epoch predicts next to nothing: the noise's own mean square, 1
    assert all(0.8 < share < 1.2 for share in result["test"]["noise_error_share"])


def test_a_training_that_diverged_is_a_word_not_a_number():
    part = {"recording": [0, 1], "error_deg": [None, 1.0], "model_based_deg": [1.0, 2.0]}
    result = {"train": part, "validation": part, "test": part, "best_epoch": 0}
    assert network_row("x", [result], seed=0)[1:5] == (DIVERGED,) * 4


@pytest.fixture
def public(tmp_path, monkeypatch):
    """Four short recordings in the published layout, in two folders as in the repository."""
    monkeypatch.setattr("gyronorth.studies.source.WINDOW", 10.0)
    for i, heading in enumerate((10.0, 120.0, 200.5, 300.0)):
        recording = simulate(
            "sdc500",
            latitude=np.radians(32.11),
            heading=np.radians(heading),
            duration=12.0 + i,
            rate_hz=600.0,
            rng=np.random.default_rng(i),
        )
        folder = tmp_path / "data" / ("Train" if i < 3 else "Test")
        folder.mkdir(parents=True, exist_ok=True)
        write_published(recording, folder / f"x_{heading:g}.csv")
    return tmp_path


def write_published(recording: Recording, path):
    """The layout of the public repository: an unnamed index, deg/s, m/s^2."""
    accel = recording.accel_b
    table = np.column_stack([np.arange(len(accel)), np.degrees(recording.gyro_b), accel])
    np.savetxt(path, table, delimiter=",", header=",w_x,w_y,w_z,f_x,f_y,f_z", comments="")


@pytest.mark.slow
def test_public_recordings_come_at_3_hz_with_their_heading_and_mean(public):
    found = public_recordings(str(public))
    assert found.gyro_l.shape == (4, 36, 3)  # the shortest lasts 12 s
    assert sorted(np.degrees(found.heading_true).round(6)) == [10, 120, 200.5, 300]
    # white noise of the data sheet, 0.02 deg/sqrt(h), from 35 differences x 3 axes: 10 % and flicker on top
    assert 0.016 < np.degrees(found.arw) * 60 < 0.026
    assert described(str(public)) == described(str(public))
    assert recordings_of(0, described(str(public))).gyro_l.shape == (4, 36, 3)


def test_a_folder_without_public_recordings_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"no files x_<heading>.csv"):
        public_recordings(str(tmp_path))


@pytest.mark.slow
def test_recordings_that_changed_are_refused(public):
    with pytest.raises(InputError, match="changed since the study began"):
        recordings_of(0, {"folder": str(public), "sha256": "0" * 64})
