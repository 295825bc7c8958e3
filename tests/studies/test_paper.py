"""The studies of the paper: the perfect learner, the choice of the epoch, and what is told of a user's recordings."""

from __future__ import annotations

import gzip
import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from gyronorth.cli import app
from gyronorth.errors import InputError
from gyronorth.evaluation import Interval, Split
from gyronorth.report.study_figures import study_figure, write_study_figures
from gyronorth.studies import networks, paper_protocol, source
from gyronorth.studies.benchmark import run_benchmark
from gyronorth.studies.network_tables import COLUMNS, Pooled, shares_of_splits
from gyronorth.studies.networks import OWN_NETWORK, heading_unit, merged, split_data, split_json, splits_of
from gyronorth.studies.paper_augmentation import (
    AUGMENTATION,
    LIMIT,
    augmentation_unit,
    first_two_windows,
    limit_row,
    perfect_learner,
)
from gyronorth.studies.study import SELECTIONS, StudyPlan
from gyronorth.studies.tables import Table, verdict

RAD = np.pi / 180


def test_the_perfect_learner_takes_off_the_mean_error_within_the_span():
    """Written out: the test at 10 deg sees 350 and 30 (errors 1 and 3), that at 100 sees none, that at 190 sees 180."""
    known, error = np.array([350.0, 30.0, 180.0]) * RAD, np.array([1.0, 3.0, -5.0]) * RAD
    tested, own = np.array([10.0, 100.0, 190.0]) * RAD, np.array([4.0, 4.0, 4.0]) * RAD
    found = perfect_learner(known, error, tested, own, span=20 * RAD)
    assert_allclose(found.error / RAD, [2, 4, 9], atol=1e-9)
    assert found.covered.tolist() == [True, False, True]


def test_the_perfect_learner_is_the_least_squares_fit_of_the_augmented_data():
    """What no network can beat on them: of all turned copies, the mean error at a heading is the learner's."""
    rng = np.random.default_rng(1)
    known, error = rng.uniform(0, 2 * np.pi, 24), rng.normal(0, 4 * RAD, 24)
    turn = np.linspace(-20, 20, 4001) * RAD
    heading = np.mod(known[:, None] + turn, 2 * np.pi).ravel()
    copies = np.repeat(error, len(turn))
    at = rng.uniform(0, 2 * np.pi, 30)
    found = perfect_learner(known, error, at, np.zeros(30), span=20 * RAD)
    for k, one in enumerate(at):
        near = np.abs(np.angle(np.exp(1j * (heading - one)))) < 0.02 * RAD
        expected = copies[near].mean() if near.any() else 0.0
        assert found.error[k] == pytest.approx(-expected, abs=0.15 * RAD)


def test_a_leak_is_worth_more_than_the_augmentation():
    plan = StudyPlan(splits=40)
    results = {unit.name: unit.function(**unit.arguments) for unit in AUGMENTATION.units(plan)[:1]}
    one = next(iter(results.values()))
    assert len(one["recording"]) == 240
    honest, leak = (np.square(one[key]["error_deg"]).sum() for key in ("span_20", "leak_20"))
    assert leak < 0.6 * honest
    assert one["leak_20"]["outside"] == []
    assert json.loads(json.dumps(one, allow_nan=False)) == one


def test_the_whole_circle_leaves_nothing_to_learn():
    """Averaged over all headings the error is the set's mean, which is next to none."""
    one = augmentation_unit(draw=0, splits=100, seed=0)
    before, after = (np.sqrt(np.mean(np.square(x))) for x in (one["model_based_deg"], one["span_180"]["error_deg"]))
    assert after == pytest.approx(before, rel=0.1)


def test_the_limit_is_a_row_of_every_network_table():
    plan = StudyPlan()
    row = limit_row(plan, splits_of(plan, 3))
    assert row[0] == LIMIT
    assert len(row) == len(COLUMNS)
    assert 1 < row[4].value < 8


def test_shares_of_splits_by_hand():
    """Ratios 0.5, 0.8 and 2."""
    one = Pooled([np.array([0.5]), np.array([0.8]), np.array([2.0])], [np.ones(1)] * 3, np.arange(3))
    assert shares_of_splits(one) == (pytest.approx(0.8), "66.7 %", "33.3 %")


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (Interval(0.7, 0.6, 0.74), "holds"),
        (Interval(0.9, 0.75, 1.2), "**does not hold**"),
        (Interval(0.7, 0.5, 0.9), "cannot be told"),
        (Interval(0.7, 0.5, 1.1), "cannot be told (the interval contains 1)"),
        (0.74, "holds"),
        (0.75, "**does not hold**"),
    ],
)
def test_verdicts_in_three_words(found, expected):
    assert verdict(found, high=0.74) == expected


def test_tests_that_are_lost_are_left_out_of_one_figure():
    one = Pooled([np.array([3.0, 4.0, 170.0]) * RAD], [np.ones(3)], np.arange(3))
    assert one.kept() == pytest.approx(np.sqrt(12.5))
    assert Pooled([np.array([2.0])], [np.ones(1)], np.arange(1)).kept() is None


def test_a_leak_trains_on_the_second_window_of_the_tested():
    from gyronorth.learn.settings import Settings

    plan, settings = StudyPlan(), Settings()
    split = split_json(splits_of(plan, 1)[0])
    honest, leak = (split_data(split, plan.recordings(), settings, leak=leak) for leak in (False, True))
    assert len(leak.train) == len(honest.train) + 6
    assert leak.test is not None
    assert leak.train.recording[-6:].tolist() == leak.test.recording.tolist() == split["test"]
    assert_allclose(leak.train.gyro_l[-6:], plan.recordings().gyro_l[split["test"], 300:600])
    with pytest.raises(InputError, match=r"two windows of 200 s"):
        split_data(split, plan.recordings(), settings.model_copy(update={"samples": 600}), leak=True)


SMALL = {"heading": {"hidden": 3, "layers": 1, "augment": {"copies": 2}}}


def test_a_selection_that_is_not_honest_decides_what_it_says():
    """The unit's epoch is the best on test, the last one, or chosen as ever."""
    variant = merged(merged(OWN_NETWORK, SMALL), {"heading": {"rate": 0.05}})
    for selection in ("validation", "test", "last", "leak"):
        plan = StudyPlan(epochs=3, selection=selection)
        unit = heading_unit(variant, plan, splits_of(plan, 1)[0], seed=0)
        result = unit.function(**unit.arguments)
        curve = [entry["test" if selection == "test" else "validation"] for entry in result["history"]]
        assert result["best_epoch"] == (3 if selection == "last" else int(np.argmin(curve)) + 1)
        assert ("selection" in unit.arguments) == (selection != "validation")
        assert len(result["train"]["recording"]) == 24


@pytest.mark.parametrize("selection", ["test", "last", "leak"])
def test_a_selection_that_is_not_honest_labels_every_table_and_text(selection):
    plan, table = StudyPlan(selection=selection), Table("t", ("a",), (("b",),))
    assert SELECTIONS[selection] in AUGMENTATION.markdown(table, plan)
    assert SELECTIONS[selection] in plan.about()
    assert f"--selection {selection}" in plan.options()
    assert SELECTIONS[selection] not in StudyPlan().about() + AUGMENTATION.markdown(table, StudyPlan())


@pytest.mark.parametrize("selection", ["validation", "leak"])
def test_a_figure_says_how_the_epoch_was_chosen(selection):
    study = json.loads((Path(__file__).parents[2] / "docs/results/data/paper/scale.json").read_text())
    study["plan"] = {"selection": selection}
    title = study_figure(study).get_suptitle()
    assert ("not an honest choice" in title) == (selection != "validation")


@pytest.mark.parametrize("by_steps", [False, True])
def test_figures_of_scale_and_training_are_drawn_from_old_and_new_files(by_steps):
    """Fig. 4 against the reverse steps; Fig. 7 with one line a split."""
    folder = Path(__file__).parents[2] / "docs/results/data/paper"
    scale, sweep = (json.loads((folder / f"{name}.json").read_text()) for name in ("scale", "t_back"))
    scale["curves"].pop("by_steps", None)
    first = {t: splits[0] for t, splits in sweep["curves"]["training"].items()}
    sweep["curves"]["training"] = {t: [one, one] for t, one in first.items()} if by_steps else first
    if by_steps:
        points = [{"steps": n, "horizontal_gain": 1.0 + n / 900} for n in (1, 50, 900)]
        scale["curves"]["by_steps"] = {"sequence": points, "none": points}
    assert len(study_figure(scale).subfigs) == (2 if by_steps else 0)
    panels = study_figure(sweep).subfigs[1].axes
    assert panels[0].get_legend_handles_labels()[1] == ["train", "validation", "test"]
    assert len(panels[0].lines) == (6 if by_steps else 3)


def test_an_unknown_selection_is_refused():
    with pytest.raises(InputError, match="one of validation, test, last, leak"):
        StudyPlan(selection="best")  # type: ignore[arg-type]


def test_few_epochs_are_told():
    assert "**not trained**" in StudyPlan(epochs=2).about()
    assert "**not trained to the end**" in StudyPlan(epochs=60).about()
    assert "epochs" not in StudyPlan().about()


def test_the_choice_of_the_epoch_is_reported_from_one_training(monkeypatch):
    """A choice on test is never worse on test than any other of the same trainings."""
    monkeypatch.setattr(paper_protocol, "TOGETHER", 2)
    monkeypatch.setattr(paper_protocol, "ALONE", {"tiny": merged(OWN_NETWORK, SMALL)})
    study = paper_protocol.protocol_study("protocol", "t", paper_protocol.ALONE)
    plan = StudyPlan(network_splits=1, epochs=4)
    units = study.units(plan)
    assert [len(unit.arguments["splits"]) for unit in units] == [2, 2]
    results = {unit.name: json.loads(json.dumps(unit.function(**unit.arguments))) for unit in units}
    rows = {row[1]: row for row in study.report(plan, results).tables[0].rows}
    ratio = {chosen: row[2].value for chosen, row in rows.items()}
    assert ratio["**on test**"] <= min(ratio["on validation"], ratio["no choice: the last epoch"])
    assert rows["no choice: the last epoch"][-1] == "4 to 4"
    assert rows["nothing to choose"][0] == LIMIT


@pytest.fixture(scope="module")
def clone(tmp_path_factory):
    """A clone with the public repository's file names; slow recordings, which say their rate and units themselves."""
    folder, rng = tmp_path_factory.mktemp("clone"), np.random.default_rng(2)
    for i in range(36):
        heading, place = 10.0 * i, folder / "data" / ("Train" if i < 30 else "Test")
        place.mkdir(parents=True, exist_ok=True)
        across = np.array([np.cos(heading * RAD), -np.sin(heading * RAD), -0.63]) * 0.0035
        gyro = across + 3e-4 * rng.standard_normal(3) + 5e-4 * rng.standard_normal((615, 3))
        table = np.column_stack([np.arange(615), gyro, np.tile([0, 0, -9.8], (615, 1))])
        head = ["# rate_hz: 3", "# gyro_unit: deg/s", "# accel_unit: m/s2", "# axes: frd"]
        head += [f"# heading_true_deg: {heading}", ",w_x,w_y,w_z,f_x,f_y,f_z"]
        np.savetxt(place / f"x_{heading:g}.csv", table, "%.7g", ",", header="\n".join(head), comments="")
    for name in ("data/x_GC_MA.csv", "data/Test/x_results.csv"):
        (folder / name).write_text("T,RMSE\n10,9\n")
    return folder


@pytest.mark.slow
def test_only_numbers_name_recordings_and_folders_are_sessions(clone):
    found = source.public_set(str(clone))
    assert found.recordings.gyro_l.shape == (36, 615, 3)
    assert found.passed_over == ("x_results.csv", "x_GC_MA.csv")
    assert (found.sessions.count("Train"), found.sessions.count("Test")) == (30, 6)
    about = StudyPlan(data=str(clone)).about()
    assert "On the first 205 s of the 36 recordings" in about
    assert "Train (30)" in about
    assert "x_GC_MA.csv" in about
    assert "reconstruction" not in about


def in_a_copy(clone, tmp_path):
    """A clone that a test may spoil, and a table of one of its recordings."""
    folder = tmp_path / "clone"
    shutil.copytree(clone, folder)
    return folder, (folder / "data/Train/x_30.csv").read_text()


@pytest.mark.slow
def test_recordings_that_are_not_taken_are_told_whatever_they_are_called(clone, tmp_path):
    """Capitals are the same name; what is packed, a copy or below zero is passed over, and said to be."""
    folder, text = in_a_copy(clone, tmp_path)
    (folder / "data/Train/x_30.csv").rename(folder / "data/Train/X_30.CSV")
    with gzip.open(folder / "data/Train/x_41.csv.gz", "wt") as packed:
        packed.write(text)
    for name in ("x_30 (1).csv", "x_-10.csv"):
        (folder / "data/Train" / name).write_text(text)
    found = source.public_set(str(folder))
    assert found.sessions.count("Train") == 30
    assert set(found.passed_over) == {"x_GC_MA.csv", "x_results.csv", "x_41.csv.gz", "x_30 (1).csv", "x_-10.csv"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "made", "message"),
    [
        ("Test/x_30.csv", str, "Train/x_30.csv holds the same samples as .*Test/x_30.csv: .* Remove one of them"),
        (
            "Train/x_30.csv",
            lambda text: "".join(text.splitlines(True)[:200]),
            r"x_30.csv lasts 64\.\d s; .* need 100 s",
        ),
    ],
)
def test_recordings_that_are_there_twice_or_cut_off_are_refused_by_name(clone, tmp_path, name, made, message):
    folder, text = in_a_copy(clone, tmp_path)
    (folder / "data" / name).write_text(made(text))
    with pytest.raises(InputError, match=message):
        source.public_set(str(folder))


@pytest.mark.slow
def test_no_page_of_a_users_clone_speaks_of_the_reconstruction(clone, tmp_path, monkeypatch):
    monkeypatch.setattr("gyronorth.studies.published_transfer.SETS", 1)
    monkeypatch.setattr("gyronorth.studies.published_splits.ARCS", (5,))
    plan = StudyPlan(data=str(clone), splits=2)
    run_benchmark("published", tmp_path, at_once(), plan=plan, only=("noise", "splits", "harm"))
    run_benchmark("paper", tmp_path, at_once(), plan=plan, only=("augmentation",))
    assert len(write_study_figures(tmp_path)) == 2
    for path in [*tmp_path.glob("*.md"), *tmp_path.glob("*.json")]:
        text = path.read_text()
        assert "reconstruction" not in text.lower(), path.name
        assert "printed mean rates" not in text
    assert "x_results.csv, x_GC_MA.csv" in (tmp_path / "noise.md").read_text()


@pytest.mark.long
def test_the_main_table_runs_on_a_users_clone(clone, tmp_path):
    options = ["--network-splits", "1", "--splits", "1", "--epochs", "1", "--workers", "1"]
    command = ["benchmark", "paper", "--study", "table_2", "--data", str(clone), *options, "-o", str(tmp_path / "o")]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    text = (tmp_path / "o/table_2.md").read_text()
    assert LIMIT in text
    assert "reconstruction" not in text.lower()


class at_once:
    """An executor in this process."""

    def __init__(self, *_, **__):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def submit(self, function, *given):
        from concurrent.futures import Future

        future = Future()
        future.set_result(function(*given))
        return future


def test_too_few_recordings_for_a_split_are_told(monkeypatch):
    monkeypatch.setattr(StudyPlan, "recordings", lambda _self: SimpleNamespace(heading_true=np.zeros(20)))
    with pytest.raises(InputError, match="20 recordings; a 24/4/6 split needs 34"):
        networks.splits_of(StudyPlan(data="mine"), 1)


@pytest.mark.slow
def test_windows_of_short_recordings_know_no_leak(clone):
    data = source.described(str(clone))
    heading, error, second, _ = first_two_windows(0, data)
    assert len(heading) == len(error) == len(second) == 36
    assert isinstance(splits_of(StudyPlan(data=str(clone)), 1)[0], Split)
