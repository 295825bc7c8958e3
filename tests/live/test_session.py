"""A session: the same answer as from the file it saves, whatever the stream does, and nothing lost."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from math import degrees, radians
from pathlib import Path

import numpy as np
import pytest
from live_stream import HEAD, RATE_HZ, Played, rows_in, seconds, session_of, timed_rows
from still import HEADING, LATITUDE, TITLES

import gyronorth as gn
from gyronorth.errors import InputError
from gyronorth.live import session as session_module
from gyronorth.live.events import Connected, Lost
from gyronorth.live.lines import LineReader
from gyronorth.live.recorder import Recorder, check_place
from gyronorth.live.reporting import report_text, write_report
from gyronorth.live.session import LiveSettings, Session
from gyronorth.live.status import Status
from gyronorth.live.stretch import Stretch
from gyronorth.live.wording import lights
from gyronorth.readers import ReadOptions

ROOT = Path(__file__).parents[2]
ROWS = timed_rows(seconds(0, 40))


def codes(status: Status) -> list[str]:
    """Reasons that the samples give, before the end or at it."""
    assert status.measured is not None
    return [reason.code for reason in status.measured.reasons]


@pytest.mark.slow
def test_the_answer_is_that_of_the_file(tmp_path):
    session = session_of(HEAD, ROWS, save=tmp_path / "rec.csv", method="auto")
    status, offline = session.status, gn.heading(gn.read(tmp_path / "rec.csv"))
    assert (status.state, session.error, codes(status)) == ("ended", None, [])
    assert rows_in(tmp_path / "rec.csv") == ROWS
    assert status.estimate is not None
    assert status.estimate.heading == pytest.approx(offline.heading, abs=1e-12)
    assert status.estimate.sigma == pytest.approx(offline.sigma, rel=1e-9)
    assert status.estimate.heading is not None
    assert status.estimate.sigma is not None
    assert abs(status.estimate.heading - HEADING) < 3 * status.estimate.sigma
    assert [reason.code for reason in status.estimate.reasons] == ["source_ended"]  # nothing may be steered by it


def test_times_too_coarse_to_use_are_a_reason():
    """Ten rows share each printed time: nine of ten are left out, which no average of the rest makes up for."""
    status = session_of(HEAD, timed_rows(np.floor(seconds(0, 40) * RATE_HZ / 10) / RATE_HZ * 10)).status
    assert status.counters.strays > 3000
    assert "gaps" in codes(status)
    assert status.estimate is not None
    assert "too coarse" in next(reason.message for reason in status.estimate.reasons if reason.code == "gaps")


def test_a_new_stretch_does_not_answer_for_the_times_of_the_last():
    coarse = timed_rows(np.floor(seconds(0, 20) * RATE_HZ / 10) / RATE_HZ * 10)
    fine = timed_rows(seconds(1000, 1020))
    status = session_of(HEAD, coarse, 0.3, fine[:1000], 0.3, fine[1000:]).status
    assert (status.counters.time_jumps, "gaps" in codes(status)) == (1, False)
    assert status.counters.strays > 1500


def test_a_measured_rate_is_written_into_the_file(tmp_path):
    rng = np.random.default_rng(20240501)
    times = seconds(0, 40) * 1.003 + rng.uniform(-1e-3, 1e-3, 4000)
    session = session_of(HEAD, timed_rows(times), save=tmp_path / "rec.csv")
    recording = gn.read(tmp_path / "rec.csv")
    assert session.status.rate_hz == recording.rate_hz == pytest.approx(RATE_HZ / 1.003, rel=1e-4)
    assert session.status.estimate is not None
    assert session.status.estimate.heading == pytest.approx(gn.heading(recording, method="mean").heading, abs=1e-9)


def test_lost_rows_and_garbage_are_counted_and_cost_nothing_else(tmp_path):
    rng = np.random.default_rng(20240501)
    fate = rng.random(len(ROWS))
    fate[[0, -1]] = 1  # what is lost at either end cannot be counted
    kept = [row for row, chance in zip(ROWS, fate, strict=True) if chance >= 0.02]
    noisy = [
        row if chance >= 0.01 else "#!\0\n"
        for row, chance in zip(ROWS, fate, strict=True)
        if chance < 0.01 or chance >= 0.02
    ]
    session = session_of(HEAD, noisy, save=tmp_path / "rec.csv")
    counters, offline = session.status.counters, gn.heading(gn.read(tmp_path / "rec.csv"), method="mean")
    assert rows_in(tmp_path / "rec.csv") == kept
    assert (counters.good, counters.garbage, counters.lost) == (len(kept), (fate < 0.01).sum(), (fate < 0.02).sum())
    assert session.status.estimate is not None
    assert session.status.estimate.heading == pytest.approx(offline.heading, abs=1e-9)


def test_a_connection_that_breaks_leaves_a_gap(tmp_path):
    """In the middle of a row; the header comes again with the next connection."""
    again = [Lost("closed by the other side"), Connected()]
    session = session_of(HEAD, ROWS[:2000], ROWS[2000][:20], *again, HEAD, ROWS[2300:], save=tmp_path / "rec.csv")
    counters = session.status.counters
    assert rows_in(tmp_path / "rec.csv") == ROWS[:2000] + ROWS[2300:]
    assert (counters.reconnects, counters.garbage, counters.lost, counters.gaps) == (1, 1, 300, 1)
    assert (counters.restarts, codes(session.status)) == (0, [])


def test_without_times_a_broken_connection_begins_a_new_recording(tmp_path):
    rows = [row.partition(",")[2] for row in ROWS]
    head = HEAD.replace("t,w_x", "w_x").replace("# axes", "# rate_hz: 100\n# axes")
    session = session_of(head, rows[:1500], Lost("gone"), Connected(), rows[1500:], save=tmp_path / "rec.csv")
    assert session.status.counters.restarts == 1
    assert rows_in(tmp_path / "rec.csv") == rows[:1500]
    assert rows_in(tmp_path / "rec.2.csv") == rows[1500:]
    assert session.status.seconds == pytest.approx(25)


@pytest.mark.parametrize("jump", [3600.0, -10.0])
def test_a_clock_that_jumps_begins_a_new_recording_and_loses_no_row(tmp_path, jump):
    later = timed_rows(seconds(0, 30) + 40 + jump, seed=2)
    session = session_of(HEAD, ROWS, later, save=tmp_path / "rec.csv")
    counters = session.status.counters
    assert (counters.time_jumps, counters.restarts, counters.strays) == (1, 1, 0)
    assert "time stamps jumped" in session.status.message
    assert rows_in(tmp_path / "rec.csv") == ROWS
    assert rows_in(tmp_path / "rec.2.csv") == later
    assert session.status.recording == tmp_path / "rec.2.csv"
    assert gn.read(tmp_path / "rec.2.csv").duration == pytest.approx(30)


def test_a_gap_that_cannot_be_bridged_begins_a_new_recording(tmp_path):
    session = session_of(HEAD, ROWS[:1000], ROWS[2500:], save=tmp_path / "rec.csv")
    assert session.status.counters.restarts == 1
    assert rows_in(tmp_path / "rec.csv", tmp_path / "rec.2.csv") == ROWS[:1000] + ROWS[2500:]


def test_a_stream_that_declares_another_unit_begins_a_new_recording(tmp_path):
    other = HEAD.replace("gyro_unit: rad/s", "gyro_unit: deg/s")
    scaled = [
        ",".join([f[0], *(repr(degrees(float(w))) for w in f[1:4]), *f[4:]]) for f in (r.split(",") for r in ROWS)
    ]
    session = session_of(HEAD, ROWS[:1000], Lost("gone"), Connected(), other, scaled[1000:], save=tmp_path / "rec.csv")
    assert session.status.counters.restarts == 1
    assert "# gyro_unit: deg/s" in (tmp_path / "rec.2.csv").read_text()
    assert codes(session.status) == []


@pytest.mark.parametrize("line", ["# gyro_unit: furlong", "# latitude_deg: 9000", "# axes: qqq"])
def test_a_spoiled_statement_is_left_aside(tmp_path, line):
    spoiled = HEAD.replace("t,w_x", f"{line}\nt,w_x")
    session = session_of(HEAD, ROWS[:2000], Lost("gone"), Connected(), spoiled, ROWS[2000:], save=tmp_path / "rec.csv")
    assert (session.error, session.status.counters.restarts) == (None, 0)
    assert "left aside" in session.status.message
    assert rows_in(tmp_path / "rec.csv") == ROWS


def test_a_stretch_that_makes_no_samples_is_recorded_all_the_same(tmp_path):
    """After a jump of time the rows come at a tenth of the declared rate."""
    head, slow = HEAD.replace("t,w_x", "# rate_hz: 100\nt,w_x"), timed_rows(5000 + seconds(0, 3) * 10)
    session = session_of(head, ROWS, slow, save=tmp_path / "rec.csv")
    assert (session.error, session.status.state, session.status.estimate) == (None, "ended", None)
    assert "100 Hz is declared" in session.status.message
    assert rows_in(tmp_path / "rec.csv", tmp_path / "rec.2.csv") == ROWS + slow


def test_implausible_rows_are_left_out_and_counted(tmp_path):
    fields = ROWS[2000].split(",")
    dead, wild = ",".join([*fields[:4], "0", "0", "0\n"]), ",".join([fields[0], "1e7", *fields[2:]])
    session = session_of(HEAD, ROWS[:2000], dead, wild, ROWS[2001:], save=tmp_path / "rec.csv")
    assert session.status.counters.implausible == 2
    assert rows_in(tmp_path / "rec.csv") == ROWS[:2000] + ROWS[2001:]
    assert gn.heading(gn.read(tmp_path / "rec.csv"), method="mean").valid


def test_a_wrong_unit_is_a_reason():
    session = session_of(HEAD.replace("# gyro_unit: rad/s", "# gyro_unit: deg/h"), ROWS)
    assert "units_suspect" in codes(session.status)


def test_axes_that_do_not_fit_are_a_reason():
    up = [",".join([*f[:6], f[6].replace("-", "")]) for f in (row.split(",") for row in ROWS)]
    session = session_of(HEAD.replace("# axes: frd\n", ""), up)
    assert "axes_suspect" in codes(session.status)


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (HEAD.replace("# gyro_unit: rad/s\n", ""), "--gyro-unit"),
        (HEAD[: HEAD.index("# latitude")] + HEAD[HEAD.index("t,w_x") :], "--latitude"),
        (HEAD.replace("t,w_x", "# rate_hz: 50\nt,w_x"), "50 Hz is declared"),
        (HEAD.replace("t,w_x,w_y", "t,w_x,q"), "w_y"),
    ],
)
def test_what_is_wrong_from_the_first_on_ends_the_session(head, message):
    session = session_of(head, ROWS)
    assert isinstance(session.error, InputError)
    assert message in str(session.error)
    assert session.status.state == "failed"


def test_a_fault_of_ours_is_shown_and_the_recording_stays(tmp_path, monkeypatch):
    def fail(self, rows):
        if rows.values[-1, 0] > 20:
            raise ZeroDivisionError("a fault")
        return push(self, rows)

    push = Stretch.push
    monkeypatch.setattr(Stretch, "push", fail)
    session = session_of(HEAD, ROWS[:1500], 0.3, ROWS[1500:], save=tmp_path / "rec.csv")
    assert isinstance(session.error, ZeroDivisionError)
    assert rows_in(tmp_path / "rec.csv") == ROWS[:1500]


def test_marks_stop_and_start(tmp_path):
    def command(name: str, text: str = "") -> None:
        session.command(name, text)

    played = Played(
        *(HEAD, ROWS[:1000], lambda: command("mark", "door\nopened"), ROWS[1000:2000], lambda: command("stop")),
        *(ROWS[2000:2500], lambda: command("start"), ROWS[2500:]),
    )
    session = Session(played, LiveSettings(ReadOptions(), method="mean", save=tmp_path / "rec.csv"))
    session.start()
    assert session.ended.wait(300)
    session.close()
    text = (tmp_path / "rec.csv").read_text()
    assert rows_in(tmp_path / "rec.csv") == ROWS[:2000]
    assert rows_in(tmp_path / "rec.2.csv") == ROWS[2500:]
    (mark,) = [line for line in text.splitlines() if line.startswith("# mark: ")]
    assert "door opened" in mark
    assert len(gn.read(tmp_path / "rec.csv").gyro_b) == 2000


def test_a_source_that_stalls_makes_the_heading_invalid(tmp_path, monkeypatch):
    monkeypatch.setattr(session_module, "STALL", 0.3)
    seen: list[Status] = []

    def look() -> None:
        deadline = time.monotonic() + 300
        while time.monotonic() < deadline:
            status = session.status
            if status.trouble == "stalled" and status.found:
                seen.append(status)
                return
            time.sleep(0.05)

    session = Session(Played(HEAD, ROWS[:3500], look, ROWS[3500:]), LiveSettings(ReadOptions(), method="mean"))
    session.start()
    assert session.ended.wait(300)
    session.close()
    (stalled,) = seen
    assert codes(stalled) == ["stalled"]
    assert stalled.rate_of_turn is None
    assert session.status.counters.stalls >= 1
    assert codes(session.status) == []


def test_what_waits_when_the_session_is_closed_is_recorded(tmp_path):
    session = Session(
        Played(HEAD, *(ROWS[at : at + 50] for at in range(0, 4000, 50)), 60),
        LiveSettings(ReadOptions(), method="mean", save=tmp_path / "rec.csv"),
    )
    session.start()
    while session.status.counters.good < 4000:
        time.sleep(0.01)
    session.close()
    assert rows_in(tmp_path / "rec.csv") == ROWS


def test_a_file_that_exists_is_left_alone(tmp_path):
    (tmp_path / "rec.csv").write_text("mine")
    (tmp_path / "rec.2.csv").write_text("mine too")
    session = session_of(HEAD, ROWS[:1500], save=tmp_path / "rec.csv")
    assert [path.read_text() for path in (tmp_path / "rec.csv", tmp_path / "rec.2.csv")] == ["mine", "mine too"]
    assert session.status.recording == tmp_path / "rec.3.csv"
    assert rows_in(tmp_path / "rec.3.csv") == ROWS[:1500]


def test_a_recording_is_named_only_once_its_file_is_there(tmp_path):
    before = []
    played = Played(
        HEAD, lambda: before.append(session.status), 0.3, lambda: before.append(session.status), ROWS[:1500]
    )
    session = Session(played, LiveSettings(ReadOptions(), method="mean", save=tmp_path / "rec.csv"))
    assert session.status.recording is None
    session.start()
    assert session.ended.wait(300)
    session.close()
    for status in before:
        assert (status.recording, status.to_json()["live"]["recording"]) == (None, None)
    assert "The file is made with the first good row" in lights(before[0])
    assert session.status.recording == tmp_path / "rec.csv"


@pytest.mark.parametrize(("method", "warmed"), [("auto", 1), ("mean", 0)])
def test_other_methods_are_loaded_at_the_start_where_auto_may_turn_to_them(monkeypatch, method, warmed):
    calls = []
    monkeypatch.setattr("gyronorth.live.estimation._warm", lambda: calls.append(method))
    session_of(HEAD, ROWS[:100], method=method)
    assert len(calls) == warmed


def live_of(given: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """`live -` without a page, on what it is given."""
    command = [sys.executable, "-m", "gyronorth.cli", "live", "-", "--no-page", "--method", "mean", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    return subprocess.run(command, env=environment, input=given, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_garbage_alone_is_counted_and_shown_and_leaves_no_file(tmp_path):
    arguments = ("--latitude", "32", "--save", str(tmp_path / "rec.csv"))
    run = live_of("a poem\nof two lines\n$GPGGA,1\n", *arguments, "--json")
    assert (run.returncode, json.loads(run.stdout.splitlines()[-1])["live"]["recording"]) == (2, None)
    for words in ("3 lines from standard input", "3 rejected", "'$GPGGA,1'", "t,w_x,w_y,w_z", "no file was made"):
        assert words in run.stderr
    assert "Traceback" not in run.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_rows_that_no_sensor_gives_point_to_the_unit():
    run = live_of("t,w_x,w_y,w_z\n0,900,0,0\n0.1,900,0,1\n", "--latitude", "32", "--gyro-unit", "rad/s")
    assert run.returncode == 2
    assert "2 hold values that no sensor gives. Check --gyro-unit" in run.stderr


@pytest.mark.slow
def test_nothing_at_all_is_no_heading():
    run = live_of("", "--latitude", "32")
    assert (run.returncode, run.stdout) == (3, "No heading: no row came from standard input.\n")


def test_a_full_disk_is_shown_and_the_heading_goes_on(tmp_path, monkeypatch):
    room, write = [200_000], os.write

    def full(descriptor: int, data: memoryview) -> int:
        if room[0] == 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        done = write(descriptor, data[: room[0]])
        room[0] -= done
        return done

    monkeypatch.setattr("gyronorth.live.recorder.os.write", full)
    session = session_of(HEAD, *(ROWS[at : at + 100] for at in range(0, 4000, 100)), save=tmp_path / "rec.csv")
    assert session.status.recording_error is not None
    assert "No space left" in session.status.recording_error
    assert (session.status.seconds, codes(session.status)) == (40, [])
    assert (tmp_path / "rec.csv").stat().st_size == 200_000
    recording = gn.read(tmp_path / "rec.csv")  # the last row is cut off
    assert 1000 < len(recording.gyro_b) < 4000


def test_after_a_full_disk_the_recording_goes_on_in_a_new_file(tmp_path, monkeypatch):
    full, write = [False], os.write

    def writing(descriptor: int, data: memoryview) -> int:
        if full[0] and descriptor > 2 and os.readlink(f"/proc/self/fd/{descriptor}").endswith(".csv"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(descriptor, data)

    monkeypatch.setattr("gyronorth.live.recorder.os.write", writing)
    monkeypatch.setattr("gyronorth.live.recorder.RETRY_INTERVAL", 0.0)
    filled, emptied = (lambda: full.__setitem__(0, True)), (lambda: full.__setitem__(0, False))
    session = session_of(
        HEAD, ROWS[:1000], 0.5, filled, ROWS[1000:2000], 0.5, emptied, ROWS[2000:], save=tmp_path / "rec.csv"
    )
    assert session.status.recording == tmp_path / "rec.2.csv"
    assert rows_in(tmp_path / "rec.csv", tmp_path / "rec.2.csv") == ROWS[:1000] + ROWS[2000:]
    assert "No space left" in (session.status.recording_error or "")
    assert "1000 rows are missing" in (session.status.recording_error or "")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rec.2.csv", "rec.csv"]
    assert gn.read(tmp_path / "rec.2.csv").duration == pytest.approx(20)


def test_a_removed_recording_is_told_and_goes_on_in_a_new_file(tmp_path, monkeypatch):
    monkeypatch.setattr("gyronorth.live.recorder.RETRY_INTERVAL", 0.0)

    def remove() -> None:
        (tmp_path / "rec.csv").unlink()

    session = session_of(HEAD, ROWS[:1000], 1.0, remove, 1.5, ROWS[1000:], save=tmp_path / "rec.csv")
    assert "removed" in (session.status.recording_error or "")
    assert rows_in(tmp_path / "rec.csv") == ROWS[1000:]


def test_a_report_is_written_over_no_other_file(tmp_path):
    (tmp_path / "rec.html").write_text("mine")
    session = session_of(HEAD, ROWS, save=tmp_path / "rec.csv")
    assert write_report(session.status, session.settings) == tmp_path / "rec-2.html"
    assert (tmp_path / "rec.html").read_text() == "mine"


@pytest.mark.slow
@pytest.mark.parametrize("token", [["--token", "a long secret"], ["--token=a long secret"]])
def test_a_report_states_command_and_recording_but_no_token(tmp_path, monkeypatch, token):
    monkeypatch.setattr("sys.argv", ["gyronorth", "live", "udp:4000", *token, "--no-page"])
    session = session_of(HEAD, ROWS, save=tmp_path / "rec.csv")
    text = report_text(session.status, session.settings)
    assert "gyronorth live udp:4000 --token" in text
    assert str(tmp_path / "rec.csv") in text
    assert "secret" not in text


def test_a_place_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        check_place(tmp_path / "no" / "rec.csv")
    with pytest.raises(InputError, match=r"must end in \.csv"):
        check_place(tmp_path / "rec.npz")


def test_a_file_that_cannot_be_made_is_an_error_of_the_recording(tmp_path):
    folder = tmp_path / "gone"
    session = session_of(HEAD, ROWS[:1500], save=folder / "rec.csv")
    assert session.status.recording_error is not None
    assert "No such file" in session.status.recording_error
    assert session.status.estimate is not None


def test_the_head_of_a_recording_says_all_that_was_declared(tmp_path):
    options = ReadOptions(gyro_unit="deg/h", accel_unit="g", axes="flu", latitude=radians(-33))
    batches = LineReader("stream", options).push("".join(ROWS[:3]).encode())
    stretch = Stretch("stream", batches[0].form, gn_facts(), options)
    recorder = Recorder(tmp_path / "rec.csv")
    recorder.begin(stretch, "tcp:here:1", start_time_utc="2026-01-01T00:00:00.000Z")
    recorder.rate(123.4)
    recorder.rows(batches[0].rows)
    recorder.close()
    head = (tmp_path / "rec.csv").read_text().splitlines()[:9]
    assert [line.strip() for line in head] == [
        "# format: gyronorth.live/1",
        "# source: tcp:here:1",
        "# gyro_unit: deg/h",
        "# accel_unit: g",
        "# axes: flu",
        "# latitude_deg: -33.0",
        "# start_time_utc: 2026-01-01T00:00:00.000Z",
        "# rate_hz: 123.4",
        "t,w_x,w_y,w_z,f_x,f_y,f_z",
    ]


def gn_facts():
    from gyronorth.readers.source import Facts

    return Facts()


def test_json_lines_hold_the_estimate_and_the_counters(tmp_path):
    waiting = json.loads(json.dumps(Status("waiting", "here").to_json()))
    assert waiting["live"]["state"] == "waiting"
    document = json.loads(json.dumps(session_of(HEAD, ROWS, save=tmp_path / "rec.csv").status.to_json()))
    assert document["schema"] == "gyronorth.heading/1"
    assert document["valid"] is False
    assert [reason["code"] for reason in document["reasons"]] == ["source_ended"]
    assert (document["live"]["good"], document["live"]["state"], document["live"]["fitness"]) == (
        4000,
        "ended",
        "invalid",
    )


@pytest.mark.long  # in one process and without a benchmark: test_lost_rows_and_garbage_are_counted_...
def test_a_bad_line_costs_no_good_row():
    """The benchmark's stream, shortened: 1 % lost, 1 % garbage, three connections that break."""
    command = [sys.executable, "-m", "benchmarks.live_soak", "--minutes", "0.5", "--speed", "20"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    run = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert run.stdout, run.stderr
    figures = json.loads(run.stdout)
    assert figures["good_rows_missing_in_the_file"] == 0
    assert figures["in_order_and_nothing_else"]
    assert figures["garbage_counted"] > 0
    assert (figures["reconnects"], figures["restarts"]) == (3, 0)
    assert figures["difference_deg"] < 0.05


@pytest.mark.slow
def test_after_kill_9_the_file_holds_whole_rows_and_all_that_had_come(tmp_path):
    saved = tmp_path / "rec.csv"
    command = [
        sys.executable,
        "-m",
        "gyronorth.cli",
        "live",
        "-",
        "--no-page",
        "--method",
        "mean",
        "--save",
        str(saved),
    ]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": str(ROOT / "src")}
    )
    assert process.stdin is not None
    rows = timed_rows(seconds(0, 400))
    process.stdin.write((HEAD + "".join(rows[:100])).encode())
    process.stdin.flush()
    for sent in range(100, 2600, 50):
        process.stdin.write("".join(rows[sent : sent + 50]).encode())
        process.stdin.flush()
    process.stdin.write(rows[2600][:20].encode())  # the next row is under way
    process.stdin.flush()
    while not (saved.exists() and len(rows_in(saved)) > 1000):
        assert process.poll() is None
        time.sleep(0.02)
    came = len(rows_in(saved))
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdin.close()
    kept = rows_in(saved)
    whole = [row for row in kept if row.endswith("\n")]
    assert whole == rows[: len(whole)]
    assert len(whole) >= came - 1
    assert len(gn.read(saved).gyro_b) == len(whole)


def test_recording_of_increments_says_that_it_holds_them(tmp_path):
    rows = [line.split(",") for line in timed_rows(seconds(0, 20))]
    lines = [",".join([row[0], *(repr(float(value) / RATE_HZ) for value in row[1:])]) + "\n" for row in rows]
    reading = ReadOptions(increments="both", gyro_unit="rad/s", accel_unit="m/s2", latitude=LATITUDE)
    session = session_of(",".join(TITLES) + "\n", lines, reading=reading, save=tmp_path / "rec.csv")
    assert session.error is None
    assert "# increments: both\n" in (tmp_path / "rec.csv").read_text()
    live = session.status.measured
    assert live is not None
    assert gn.heading(gn.read(tmp_path / "rec.csv"), method="mean").heading == pytest.approx(live.heading, abs=1e-12)
