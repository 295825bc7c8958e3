"""Every message that ends in a line `Try:` is produced, and the line is run as it stands, bar what only the user knows.

The list is whole by the source: whoever makes a question or such a line without a case here fails the last test.
"""

from __future__ import annotations

import ast
import inspect
import json
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from cases.layouts import ACCEL as FORCE
from cases.layouts import (
    DPS,
    FRD,
    GYRO,
    OURS,
    PLAIN,
    ROWS,
    STATED,
    TEXT_TIME,
    TIME,
    TITLED,
    G,
    text,
    titled,
    whole,
    with_time,
)
from cases.running import RUN, followed

import gyronorth
from gyronorth.cli import app
from gyronorth.readers import source

SOURCE = Path(gyronorth.__file__).parent
SI = ("--gyro-unit", "rad/s", "--accel-unit", "m/s2")
HZ = {"HZ": "100"}
fields = TITLED.split(",")[1:]
stated = [*STATED, OURS]


@dataclass(frozen=True)
class Asked:
    """A message, by the function that makes it."""

    by: str  # file of the readers and function
    says: str  # words of the message
    name: str  # of the file
    make: Callable[[Path], object]  # writes it
    options: tuple[str, ...] = FRD
    fill: tuple[tuple[str, str], ...] = ()  # what only the user knows
    samples: int = ROWS
    accel: bool = True
    command: str = "info"


def of(content: bytes) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(content)


def archive(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as file:
        for name in ("a/run1.csv", "b/run2.csv"):
            file.writestr(name, text(stated))


def workbook(path: Path) -> None:
    import openpyxl

    book = openpyxl.Workbook(write_only=True)
    for sheet in (book.create_sheet("first"), book.create_sheet("second")):
        sheet.append(TITLED.split(","))
        for row in np.column_stack(PLAIN).tolist():
            sheet.append(row)
    book.save(path)


def r_data(path: Path) -> None:
    pd, rdata = pytest.importorskip("pandas"), pytest.importorskip("rdata")
    frame = pd.DataFrame(dict(zip(TITLED.split(","), PLAIN, strict=True)))
    rdata.write_rda(path, {"a": frame, "b": frame})


def miniseed(stations: tuple[str, ...], accel: str) -> Callable[[Path], None]:
    """Channels of floats: E, N, Z of rates, and the given letters of forces."""

    def make(path: Path) -> None:
        import pymseed

        traces = pymseed.MS3TraceList()
        start = pymseed.timestr2nstime("2024-03-01T11:58:00Z")
        turned = [values[:, [1, 0, 2]] * [1, 1, -1] for values in (GYRO, FORCE)]
        for station in stations:
            for kind, letters, values in (("J", "ENZ", turned[0]), ("N", accel, turned[1])):
                for k, letter in enumerate(letters):
                    name = f"FDSN:XX_{station}_00_H_{kind}_{letter}"
                    traces.add_data(name, values[:, k].copy(), "d", 100.0, starttime=start)
        encoding = pymseed.DataEncoding.FLOAT64
        path.write_bytes(b"".join(traces.generate(max_record_length=512, encoding=encoding, format_version=2)))

    return make


def mcap(path: Path) -> None:
    """Two topics of JSON, each a whole recording."""
    writer_of = pytest.importorskip("mcap.writer")
    with path.open("wb") as file:
        writer = writer_of.Writer(file)
        writer.start(profile="", library="")
        for topic in ("/imu/a", "/imu/b"):
            schema = writer.register_schema("Sample", "jsonschema", b"{}")
            channel = writer.register_channel(topic, "json", schema)
            for time, d, g in zip(TIME, DPS.tolist(), G.tolist(), strict=True):
                sample = {"t_us": round(1e6 * time), "gyro_dps": d, "accel_g": g}
                writer.add_message(channel, round(1e9 * time), json.dumps(sample).encode(), 0)
        writer.finish()


def own_messages(path: Path) -> None:
    """Two topics of messages of a driver's own, each a whole recording."""
    values = np.column_stack([GYRO, FORCE]).tolist()
    content = [struct.pack("<4xI4xq6d", i, round(1e9 * TIME[i]), *values[i]) for i in range(ROWS)]
    definition = b"uint32 seq\nint64 time_ns\nfloat64[3] gyro  # rad/s\nfloat64[3] accel  # [m/s2]\n"
    with path.open("wb") as file:
        writer = pytest.importorskip("mcap.writer").Writer(file)
        writer.start(profile="ros2", library="")
        schema = writer.register_schema("drv_msgs/msg/Raw", "ros2msg", definition)
        for topic in ("/a", "/b"):
            channel = writer.register_channel(topic, "cdr", schema)
            for i in range(ROWS):
                writer.add_message(channel, round(1e9 * TIME[i]), b"\0\1\0\0" + content[i][4:], 0)
        writer.finish()


two_gyros = of(text(titled("t (s)", *(f"gyro{k}_{a} (deg/s)" for k in (1, 2) for a in "xyz"), *(
    f"acc_{a} (m/s2)" for a in "xyz")), (TIME, *DPS.T, *DPS.T, *FORCE.T), ("%.3f", *["%.10f"] * 9)))  # fmt: skip


def at(time: np.ndarray | list[str]) -> bytes:
    return text(stated, with_time(time), TEXT_TIME if isinstance(time, list) else ("%.6f", *TEXT_TIME[1:]))


late = np.where(np.arange(ROWS) < 400, TIME, TIME + 3600)
again = np.where(np.arange(ROWS) < 400, TIME, TIME - 4.0)
bad = text(stated).replace(b"\n4.000,", b"\nnan,", 1)
counts = text([OURS], (TIME, *np.round(DPS * 3.6e8).T, *np.round(G * 1e6).T), ("%.3f", *["%d"] * 6))
SLOW = of(text(stated, with_time(whole(500.0)), TEXT_TIME))
CASES = [
    Asked("archive.py:_chosen", "Say which one", "runs.zip", archive, (), command="import"),
    Asked("columns.py:_doubts", "no title says so", "bare.csv",
          of(text(["t (s),x,y,z"], (TIME, *GYRO.T), ("%.3f", *["%.14f"] * 3))), accel=False),
    Asked("columns.py:_unnamed_force", "are like the specific force", "s.csv",
          of(text(titled("t_s", *(f"gyro_{a}_dps" for a in "xyz"), "s1", "s2", "s3")))),
    Asked("columns.py:_which", "triples may be", "two.csv", two_gyros),
    Asked("columns.py:by_titles", "Which one is meant?", "two.csv", two_gyros),
    Asked("columns.py:by_numbers", "is like a clock", "bare.txt", of(text([], sep=" "))),
    Asked("columns.py:_strange_unit", "a unit that is not known", "odd.csv", of(text(titled("time (s)", *(
        f"gyro_{a} (odd/s)" for a in "xyz"), *(f"acc_{a} (m/s2)" for a in "xyz"))))),
    Asked("columns.py:_unnamed_clock", "is like a clock", "ticking.csv", of(text(titled(
        "ticking", *fields), (TIME + 0.001 * np.sin(TIME), *PLAIN[1:])))),
    Asked("declared.py:_accel_question", "gravity fits m/s2", "unit.csv", of(text([OURS]))),
    Asked("declared.py:_gyro_question", "Earth rate", "unit.csv", of(text([OURS]))),
    Asked("declared.py:_open", "does not state its rate", "rate.csv",
          of(text(titled(*fields), PLAIN[1:], TEXT_TIME[1:])), fill=tuple(HZ.items())),
    Asked("columns.py:by_numbers_of_titles", "No title of letters.csv is known", "letters.csv",
          of(text(["a,b,c,d,e,f,g"]))),
    Asked("columns.py:by_numbers_of_titles", "No title of digits.csv is known", "digits.csv",
          of(text(["a,b,c,1,2,d,e"]))),
    Asked("formats/csv.py:_chosen", "has no header", "bare.csv", of(text([]))),
    Asked("formats/csv.py:_counting", "its columns w_x, ... hold whole numbers", "lsb.csv", of(text(
        ["# gyro: 100000000 LSB/(deg/s), accel: 1000000 LSB/g", "t_s,gx,gy,gz,ax,ay,az"],
        (TIME, *np.round(DPS * 1e8).T, *np.round(G * 1e6).T), ("%.3f", *["%d"] * 6)))),
    Asked("formats/mcap.py:_json_topic", "2 topics of JSON", "two.mcap", mcap),
    Asked("message_table.py:choose_own", "Which one is meant?", "own.mcap", own_messages),
    Asked("formats/miniseed.py:_named", "holds 2 rotational sensors", "m.mseed", miniseed(("A", "B"), "ENZ"), SI),
    Asked("formats/miniseed.py:_automatic", "is not known", "m.mseed", miniseed(("A",), "123"), (*SI, "--axes", "rfu"),
          accel=False),
    Asked("formats/r_data.py:open_r_data", "holds 2 tables", "imu.RData", r_data),
    Asked("formats/workbook.py:_sheets", "has 2 sheets", "imu.xlsx", workbook),
    Asked("grid.py:_agree", "of slow.csv steps by", "slow.csv", SLOW, ("--time-unit", "s"), fill=tuple(HZ.items())),
    Asked("grid.py:_check_coarse", "it is too coarse", "coarse.csv", of(at(np.floor(TIME * 4) / 4)), ()),
    Asked("grid.py:_check_gaps", "--window", "gap.csv", of(at(late)), (), samples=400),
    Asked("grid.py:_check_whole", "counts in whole numbers", "whole.csv",
          of(text(stated, with_time(whole(1e12)), TEXT_TIME)), (), fill=tuple(HZ.items())),
    Asked("grid.py:_restarted", "--window", "again.csv", of(at(again)), (), samples=400),
    Asked("grid.py:_settle", "in every row", "still.csv", of(at(np.zeros(ROWS))), (), fill=tuple(HZ.items())),
    Asked("grid.py:raise_bad", "--drop-bad-rows", "bad.csv", of(bad), ()),
    Asked("reading.py:check", "--gyro-unit", "rads.csv", of(text([OURS], (TIME, *GYRO.T, *FORCE.T), ("%.3f", *[
        "%.14f"] * 3, *["%.6f"] * 3))), (*FRD, "--gyro-unit", "deg/s", "--accel-unit", "m/s2")),
    Asked("text_clock.py:_unit", "in a unit that is not known", "unit.csv",
          of(text(titled("timestamp", *fields), with_time(whole(12.5e6, 99)), TEXT_TIME)), (), fill=tuple(HZ.items())),
    Asked("text_clock.py:_written", "which is no time", "words.csv",
          of(text(titled("time", *fields), with_time([f"sample {i}" for i in range(ROWS)]), TEXT_TIME)),
          (*FRD, "--columns", "t=time"), fill=tuple(HZ.items())),
    Asked("usable.py:mostly_unusable", "all are whole numbers", "counts.csv", of(counts),
          (*FRD, "--gyro-unit", "deg/s", "--accel-unit", "g"), fill=(("DEG_PER_S_IN_ONE_COUNT", f"{1 / 3.6e8:.12g}"),)),
]  # fmt: skip
#: Those that are made in a process of their own, where nobody looks over their shoulder.
APART = (
    "formats/mcap.py",
    "message_table.py",
    "formats/miniseed.py",
    "formats/r_data.py",
    "formats/workbook.py",
    "archive.py",
)


@pytest.fixture
def makers(monkeypatch):
    """The functions that make questions in this process."""
    found: set[str] = set()
    create = source.Question.__init__

    def watched(self, *args, **kwargs):
        frame = inspect.currentframe()
        while frame is not None and len(found) < 1000:
            found.add(f"{Path(frame.f_code.co_filename).name}:{frame.f_code.co_name}")
            frame = frame.f_back
        create(self, *args, **kwargs)

    monkeypatch.setattr(source.Question, "__init__", watched)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("asked", CASES, ids=lambda asked: asked.by)
def test_the_line_of_a_message_works_as_it_stands(tmp_path, makers, asked):
    asked.make(tmp_path / asked.name)
    result = RUN.invoke(app, [asked.command, str(tmp_path / asked.name), *asked.options])
    assert asked.says in result.stderr
    if not asked.by.startswith(APART):
        assert asked.by.rpartition("/")[2] in makers
    result = followed(result, dict(asked.fill), "--json")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["samples"] == asked.samples
    assert (found["force_mean_m_s2"] is not None) == asked.accel


@pytest.mark.slow
def test_every_message_of_the_source_has_a_case():
    """Calls that make a question or cure, and texts that hold such a line, by file and function."""
    there = set()
    for path in sorted((SOURCE / "readers").rglob("*.py")):
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(function, ast.FunctionDef):
                continue
            for node in ast.walk(function):
                called = getattr(node.func, "id", getattr(node.func, "attr", "")) if isinstance(node, ast.Call) else ""
                texts = isinstance(node, ast.Constant) and "Try: gyronorth" in str(node.value)
                if called in ("Question", "_cured") or texts:
                    there.add(f"{path.relative_to(SOURCE / 'readers').as_posix()}:{function.name}")
    passed_on = {"grid.py:_cured"}  # what its callers say
    assert there - passed_on == {asked.by for asked in CASES}
    elsewhere = [path for path in SOURCE.rglob("*.py") if "Try: gyronorth" in path.read_text(encoding="utf-8")]
    assert {path.name for path in elsewhere} == {"asking.py", "archive.py"}
