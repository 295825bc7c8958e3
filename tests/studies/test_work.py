"""Units of work: resumable, whole or not at all, the same on any executor."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
from study_units import dying, dying_once, failing, logged, slow, square, total
from typer.testing import CliRunner

from gyronorth.cli import app
from gyronorth.errors import InputError
from gyronorth.files import no_empty_folder
from gyronorth.many.workers import executor_on
from gyronorth.studies.benchmark import left_out, run_benchmark, shortened, studies_of
from gyronorth.studies.expected import Remaining, expected_seconds
from gyronorth.studies.study import StudyPlan
from gyronorth.studies.work import Job, data_sha256, run_units, with_needs


@pytest.fixture
def pool():
    with ThreadPoolExecutor(2) as executor:
        yield executor


def ends_with(error: Exception):
    """A method that raises."""

    def method(*arguments, **named):
        raise error

    return method


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_result_file_holds_what_repeats_it(tmp_path, pool):
    units = [Job("a/one", square, {"value": 3, "seed": 5})]
    assert run_units(units, tmp_path, pool, command="gyronorth benchmark x") == {"a/one": {"square": 9}}
    content = json.loads((tmp_path / "units/a/one.json").read_text())
    assert content["result"] == {"square": 9}
    assert content["seed"] == 5
    assert content["arguments"] == {"value": 3, "seed": 5}
    assert content["command"] == "gyronorth benchmark x"
    assert content["data_sha256"] == data_sha256()
    assert content["commit"]


def test_finished_units_are_not_run_again_and_changed_ones_are(tmp_path, pool):
    log = tmp_path / "log"
    units = [Job(f"u/{i}", logged, {"value": i, "log": str(log)}) for i in range(3)]
    run_units(units[:2], tmp_path, pool, command="")
    run_units(units, tmp_path, pool, command="")
    assert sorted(log.read_text().split()) == ["0", "1", "2"]
    changed = [Job("u/0", logged, {"value": 7, "log": str(log)})]
    assert run_units(changed, tmp_path, pool, command="")["u/0"] == {"square": 49}


def test_a_unit_gets_what_it_needs_and_that_is_run_once(tmp_path, pool):
    log = tmp_path / "log"
    first = [Job(f"u/{i}", logged, {"value": i, "log": str(log)}) for i in (1, 2)]
    results = run_units(
        [Job("t/a", total, {}, tuple(first)), Job("t/b", total, {}, tuple(first[:1]))], tmp_path, pool, command=""
    )
    assert results["t/a"] == {"total": 5}
    assert results["t/b"] == {"total": 1}
    assert sorted(log.read_text().split()) == ["1", "2"]


def test_a_failing_unit_is_raised_and_the_others_are_kept(tmp_path):
    units = [Job("ok", slow, {"value": 2, "seconds": 0.2}), Job("bad", failing, {"value": 1})]
    with ThreadPoolExecutor(2) as executor, pytest.raises(RuntimeError, match="unit 1 failed"):
        run_units(units, tmp_path, executor, command="")
    assert list(files_of(tmp_path)) == ["units/ok.json"]


def test_two_units_of_one_name_are_refused(tmp_path, pool):
    with pytest.raises(ValueError, match="Two different units are called x"):
        run_units([Job("x", square, {"value": 1}), Job("x", square, {"value": 2})], tmp_path, pool, command="")


def test_a_whole_benchmark_leaves_out_what_runs_by_name_only():
    names = [study.name for study in studies_of("paper")]
    assert left_out("paper") == ["protocol_leak", "temporal"]
    assert not set(names) & {"protocol_leak", "temporal"}
    assert [study.name for study in studies_of("paper", ("temporal",))] == ["temporal"]
    assert left_out("paper", ("temporal",)) == left_out("published") == []


def test_the_paper_takes_two_hours_of_the_three_allowed():
    """By what is told before it starts: a third less, since that is good to a factor only."""
    plan = StudyPlan()
    jobs = with_needs([job for study in studies_of("paper") for job in study.units(study.plan_of(plan))])
    assert sum(expected_seconds(job) for job in jobs) < 2 * 3600


def test_what_units_took_is_told_beside_what_was_expected(tmp_path, pool):
    units = [Job(f"u/{k}", square, {"value": k}) for k in range(2)]
    remaining = Remaining({"a": units}, tmp_path)
    assert remaining.balance() == ""
    run_units(units[:1], tmp_path, pool, command="", spent=remaining.spent)
    assert remaining.balance() == "1 unit run: 2 s of CPU told, 0 s spent."
    remaining.spent(units[1], 59.9)
    assert remaining.balance() == "2 units run: 4 s of CPU told, 60 s spent."
    run_units(units[:1], tmp_path, pool, command="", spent=remaining.spent)  # is there already
    assert remaining.balance() == "2 units run: 4 s of CPU told, 60 s spent."


def test_a_study_says_after_how_many_epochs_its_trainings_end():
    """Those of the choice of the epoch after 60, as on the results page, unless `--epochs` says otherwise."""
    protocol, table_2 = studies_of("paper", ("protocol",)), studies_of("paper", ("table_2",))
    assert protocol[0].plan_of(StudyPlan()) == StudyPlan(epochs=60)
    assert protocol[0].plan_of(StudyPlan(epochs=500)) == StudyPlan(epochs=500)
    assert table_2[0].plan_of(StudyPlan()) == StudyPlan()
    note = shortened([*protocol, *table_2], StudyPlan())
    assert note == "Trainings end early in protocol (60 epochs); with --epochs 500 they go on to their end."
    assert shortened(protocol, StudyPlan(epochs=500)) == shortened(table_2, StudyPlan()) == ""


def test_what_remains_is_told_from_the_pace_so_far(tmp_path):
    """Two studies of units that are expected to take the same; each takes 100 s. No line within a minute."""
    units = {
        "a": [Job(f"a/{k}", square, {"value": k}) for k in range(2)],
        "b": [Job(f"b/{k}", square, {"value": k}) for k in range(4)],
    }
    now = 0.0
    remaining = Remaining(units, tmp_path, clock=lambda: now)
    assert remaining.line("a", 0, 2) is None
    now = 100.0
    assert remaining.line("a", 1, 2) == "a: 1 of 2 units; about 8 min left for all."
    now = 130.0
    assert remaining.line("a", 2, 2) is None
    now = 400.0
    assert remaining.line("b", 2, 4) == "b: 2 of 4 units; about 3 min left for all."


def test_unknown_benchmarks_and_studies_are_refused():
    with pytest.raises(InputError, match="no benchmark 'nothing'"):
        studies_of("nothing")
    with pytest.raises(InputError, match="has no study 'table_9'"):
        studies_of("paper", ("table_9",))
    with pytest.raises(InputError, match="splits is 0"):
        StudyPlan(splits=0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nothing",), "no benchmark 'nothing'"),
        (("published", "--study", "table_9"), "no study 'table_9'"),
        (("published", "--data", "nowhere"), "nowhere holds no files"),
        (("published", "--scheduler", "tcp://127.0.0.1:9"), "Dask"),
    ],
)
def test_a_refused_benchmark_leaves_no_folder(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["benchmark", *arguments, "-o", "new/er/out"])
    assert result.exit_code == 2
    assert message in result.output
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_was_there_or_is_filled_stays(tmp_path):
    def refused(folder: Path, *, filled: bool) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        if filled:
            (folder / "unit.json").write_text("{}")
        raise InputError("Refused.")

    for folder, filled in ((tmp_path, False), (tmp_path / "a" / "b", True)):
        with pytest.raises(InputError), no_empty_folder(folder):
            refused(folder, filled=filled)
    assert (tmp_path / "a" / "b" / "unit.json").is_file()


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_refused():
    pytest.importorskip("distributed", reason="Dask (extra `scale`) is not installed")
    with pytest.raises(InputError, match="No Dask scheduler answers"), executor_on("tcp://127.0.0.1:9"):
        pass


@pytest.mark.slow
def test_benchmark_writes_json_and_markdown_and_continues(tmp_path):
    seen = []
    for _ in range(2):
        with executor_on(None, workers=1) as executor:
            written = run_benchmark(
                "published", tmp_path, executor, only=("noise",), progress=lambda *state: seen.append(state)
            )
    assert [path.name for path in written] == ["noise.md"]
    assert seen[-1] == ("noise", 1, 1)
    assert len(seen) == 3  # the second run starts with all done
    study = json.loads((tmp_path / "noise.json").read_text())
    assert study["schema"] == "gyronorth.study/1"
    assert study["command"] == "gyronorth benchmark published --study noise -o FOLDER"
    assert "Angle random walk" in (tmp_path / "noise.md").read_text()


def test_workers_that_end_are_told_and_what_is_finished_is_kept(tmp_path):
    units = [Job("ok", square, {"value": 2}), Job("bad", dying, {"value": 1})]
    with executor_on(None, workers=1) as executor:
        run_units(units[:1], tmp_path, executor, command="")
        with pytest.raises(InputError, match=r"workers were lost before .* fewer --workers"):
            run_units(units, tmp_path, executor, command="")
    assert list(files_of(tmp_path)) == ["units/ok.json"]


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of Dask about what is lost on purpose
def test_what_dask_loses_is_told_or_computed_again(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed", reason="Dask (extra `scale`) is not installed")
    fetch = distributed.Client._gather

    async def fetched_then_lost(client, futures, *arguments, **named):
        """The scheduler tells of a lost worker between the result and the question for its state."""
        result = await fetch(client, futures, *arguments, **named)
        for future in futures:
            future._state.lose()
        return result

    # In this process: a worker of its own that dies may be on its way back when the cluster is closed.
    cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None)
    with cluster, executor_on(cluster.scheduler_address) as executor:
        with monkeypatch.context() as patch:
            patch.setattr(distributed.Client, "_gather", fetched_then_lost)
            results = run_units([Job("a", square, {"value": 3})], tmp_path, executor, command="")
        assert results == {"a": {"square": 9}}
        with pytest.raises(RuntimeError, match="unit 1 failed"):
            run_units([Job("b", failing, {"value": 1})], tmp_path, executor, command="")
        given_up = distributed.KilledWorker("c", SimpleNamespace(address="tcp://127.0.0.1:1"), 3)
        with monkeypatch.context() as patch:
            patch.setattr(distributed.Future, "result", ends_with(given_up))
            with pytest.raises(InputError, match="workers were lost before"):
                run_units([Job("c", square, {"value": 1})], tmp_path, executor, command="")
    assert list(files_of(tmp_path)) == ["units/a.json"]


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of Dask about the worker that is killed on purpose
def test_dask_gives_the_same_files_and_a_killed_worker_loses_nothing(tmp_path):
    distributed = pytest.importorskip("distributed", reason="Dask (extra `scale`) is not installed")

    def units(mark):
        many = [Job(f"u/{i}", square, {"value": i}) for i in range(10)]
        return [*many, Job("dies", dying_once, {"value": 4, "mark": mark}), Job("t", total, {}, tuple(many))]

    mark = tmp_path / "mark"
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
    with cluster, executor_on(cluster.scheduler_address) as executor:
        run_units(units(str(mark)), tmp_path / "dask", executor, command="c")
        with distributed.Client(cluster) as client:
            client.wait_for_workers(2, timeout=300)  # a worker that is on its way back cannot be closed
    assert mark.exists()  # a worker did die
    with ThreadPoolExecutor(1) as executor:
        run_units(units(str(mark)), tmp_path / "local", executor, command="c")
    assert files_of(tmp_path / "dask") == files_of(tmp_path / "local")
