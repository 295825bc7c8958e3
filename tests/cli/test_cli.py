"""The command line: exit codes, what is printed and written, messages, start-up."""

from __future__ import annotations

import csv
import inspect
import io
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from math import radians

import numpy as np
import pytest
from pynmeagps import NMEAReader
from typer.testing import CliRunner

from gyronorth import readers
from gyronorth.catalogue import HELD_OUT, KINDS, PLATFORM, SLOW
from gyronorth.cli import app
from gyronorth.cli.progress import reading_file
from gyronorth.report import figures
from gyronorth.sensor import read_sensor
from gyronorth.simulation import simulate

DESIGN_KEYS = """
schema heading_deg sigma_deg interval95_deg valid reasons warnings method method_reason bundle roll_deg pitch_deg
latitude_deg sensor duration_s rate_hz end_time_utc poses sigma_parts_deg gyro_bias_deg_h rate_mean_deg_h
rate_norm_deg_h implied_latitude_deg gyro_bias_sigma_deg_h scale_factor_ppm scale_factor_sigma_ppm disturbance fitness
orientation
"""
KEYS = DESIGN_KEYS.split()
#: Older versions of click mix the two streams unless told not to.
RUNNER = CliRunner(**({"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}))
#: Stands for a recording in the arguments of tests that never read it to the end.
HERE = "REC"


def run(*arguments: object):
    """Run the command line in process."""
    return RUNNER.invoke(app, [str(argument) for argument in arguments])


def run_json(*arguments: object):
    """Run a command that prints one JSON value and nothing else; its exit code and the value."""
    result = run(*arguments)
    assert result.stderr == ""
    return result.exit_code, json.loads(result.stdout, parse_constant=pytest.fail)


@pytest.fixture(scope="module")
def rec(tmp_path_factory):
    """60 s of a ring-laser unit at 32.11 N, heading 40, roll 2, pitch -1."""
    path = tmp_path_factory.mktemp("cli") / "rec.csv"
    result = run(
        *("simulate", "--sensor", "hg9900", "--latitude", 32.11, "--heading", 40, "--roll", 2, "--pitch", -1),
        *("--duration", 60, "--rate", 20, "--seed", 1, "-o", path),
    )
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", f"wrote {path}\n")
    return path


#: A bias that no heading survives: the heading of such a recording is refused.
SPOILED = ("--gyro-bias", "100,0,0")


class TestHeading:
    def test_valid(self, rec):
        code, doc = run_json("heading", rec, "--sensor", "hg9900", "--json")
        assert code == 0
        assert list(doc) == KEYS
        assert doc["valid"] is True
        assert doc["reasons"] == []
        assert abs(doc["heading_deg"] - 40) < 5 * doc["sigma_deg"]
        assert doc["roll_deg"] == pytest.approx(2, abs=0.01)
        assert doc["pitch_deg"] == pytest.approx(-1, abs=0.01)
        assert doc["latitude_deg"] == pytest.approx(32.11)

    @pytest.mark.slow
    def test_refused_is_3_with_reasons_and_all_outputs(self, rec, tmp_path):
        outputs = {option: tmp_path / f"out.{option}" for option in ("csv", "png", "html")}
        result = run(
            *("heading", rec, "--sensor", "hg9900", *SPOILED),
            *("--csv", outputs["csv"], "--plot", outputs["png"], "--report", outputs["html"]),
        )
        assert result.exit_code == 3
        assert "refused: do not use this heading" in result.stdout
        assert re.search(r"reason +rate_norm: .*\d+\.\d+ deg/h; at most \d", result.stdout)
        assert "\x1b" not in result.stdout
        (row,) = csv.DictReader(outputs["csv"].read_text().splitlines())
        assert row["valid"] == "false"
        assert "rate_norm" in row["reasons"].split(";")
        assert outputs["png"].read_bytes().startswith(b"\x89PNG")
        assert "must not be used" in outputs["html"].read_text()
        assert sorted(path.name for path in tmp_path.iterdir()) == ["out.csv", "out.html", "out.png"]

    def test_refused_json(self, rec):
        code, doc = run_json("heading", rec, "--sensor", "hg9900", "--json", *SPOILED)
        assert code == 3
        assert doc["valid"] is False
        assert {"code", "message", "value", "limit"} == set(doc["reasons"][0])

    def test_density_on_request(self, rec):
        _, plain = run_json("heading", rec, "--sensor", "hg9900", "--json")
        code, doc = run_json("heading", rec, "--sensor", "hg9900", "--json", "--posterior")
        assert code == 0
        assert "posterior" not in plain
        assert len(doc["posterior"]["heading_deg"]) == len(doc["posterior"]["density_per_deg"]) == 256
        assert run("heading", rec, "--sensor", "hg9900", "--posterior").exit_code == 2

    def test_nmea(self, rec):
        result = run("heading", rec, "--sensor", "hg9900", "--nmea")
        ths, hdt, status = (NMEAReader.parse(line + "\r\n") for line in result.stdout.split())
        assert result.exit_code == 0
        assert abs(hdt.headingT - 40) < 1
        assert (ths.headt, ths.mi) == (hdt.headingT, "A")
        assert status.payload[0] == "A"
        refused = run("heading", rec, "--sensor", "hg9900", "--nmea", *SPOILED)
        assert refused.exit_code == 3
        assert refused.stdout.startswith("$HETHS,,V*")
        assert "$PGNRS,V," in refused.stdout
        assert "HDT" not in refused.stdout

    def test_gyro_bias_is_subtracted_in_deg_per_hour(self, rec):
        _, plain = run_json("heading", rec, "--json")
        _, shifted = run_json("heading", rec, "--json", "--gyro-bias", "1,-2,3")
        difference = np.subtract(plain["rate_mean_deg_h"], shifted["rate_mean_deg_h"])
        np.testing.assert_allclose(difference, [1, -2, 3], atol=1e-9)

    def test_known_attitude_replaces_levelling(self, rec):
        _, doc = run_json("heading", rec, "--json", "--roll", 5, "--pitch", "-3")
        assert (doc["roll_deg"], doc["pitch_deg"]) == (pytest.approx(5), pytest.approx(-3))

    def test_boresight_turns_the_heading(self, rec):
        _, plain = run_json("heading", rec, "--json")
        _, turned = run_json("heading", rec, "--json", "--boresight", "0,0,90")
        assert (plain["heading_deg"] - turned["heading_deg"]) % 360 == pytest.approx(90, abs=0.1)

    def test_window(self, rec):
        _, doc = run_json("heading", rec, "--json", "--window", "10:40")
        assert doc["duration_s"] == pytest.approx(30)

    def test_method(self, rec):
        _, doc = run_json("heading", rec, "--json", "--method", "inertial")
        assert (doc["method"], doc["method_reason"]) == ("inertial", "asked for")

    def test_foreign_columns_units_and_axes(self, rec, tmp_path):
        """The same data as deg/s and g, right-front-up, under other names: the same heading."""
        recording = readers.read(rec)
        gyro, force = np.degrees(recording.gyro_b), recording.accel_b / 9.80665
        time = np.arange(len(gyro)) / recording.rate_hz
        rfu = [np.stack([x[:, 1], x[:, 0], -x[:, 2]], axis=1) for x in (gyro, force)]
        path = tmp_path / "foreign.csv"
        header = "sec,g1,g2,g3,a1,a2,a3"
        np.savetxt(path, np.column_stack([time, *rfu]), delimiter=",", header=header, comments="", fmt="%.17g")
        _, ours = run_json("heading", rec, "--json")
        code, doc = run_json(
            *("heading", path, "--json", "--latitude", 32.11, "--axes", "rfu", "--gyro-unit", "deg/s"),
            *("--accel-unit", "g", "--columns", "t=sec,w_x=g1,w_y=g2,w_z=g3,f_x=a1,f_y=a2,f_z=a3"),
        )
        assert code == 0
        assert doc["heading_deg"] == pytest.approx(ours["heading_deg"], abs=1e-6)

    @pytest.mark.slow
    def test_report_lists_what_was_declared(self, rec, tmp_path, monkeypatch):
        monkeypatch.setattr("gyronorth.report.html.svg_text", lambda figure, salt: "")  # drawn in tests/report
        out = tmp_path / "out.html"
        declared = ("--window", "5:55", "--boresight", "0,0,90", "--gyro-bias", "0.1,0,0", "--roll", 2, "--pitch", -1)
        run("heading", rec, "--report", out, *declared)
        page = out.read_text()
        for text in ("5 to 55 s", "0°, 0°, 90°", "0.1, 0, 0 deg/h", "2°, -1°", str(rec), "frd, stated", "rad/s, m/s2"):
            assert text in page


class Screen(io.StringIO):
    """A terminal that remembers what was drawn."""

    def isatty(self):
        return True


class TestProgress:
    def test_reading_a_file_is_a_bar_with_the_time_that_remains(self, rec, monkeypatch):
        monkeypatch.setattr(sys, "stderr", screen := Screen())
        with reading_file(rec) as progress:
            assert progress is not None
            readers.read(rec, progress=progress)
        drawn = screen.getvalue()
        assert "reading rec.csv" in drawn
        assert "100%" in drawn
        assert "0:00:00" in drawn  # remaining

    def test_nothing_is_drawn_where_nobody_looks(self, rec, monkeypatch):
        monkeypatch.setattr(sys, "stderr", silent := io.StringIO())
        with reading_file(rec) as progress:
            assert progress is None
        assert silent.getvalue() == ""


class TestFolder:
    @pytest.fixture
    def folder(self, rec, tmp_path):
        folder = tmp_path / "folder"
        folder.mkdir()
        (folder / "x_10.csv").write_bytes(rec.read_bytes())
        (folder / "x_9.csv").write_bytes(rec.read_bytes())
        return folder

    def test_all_valid(self, folder, tmp_path):
        result = run("heading", folder, "--sensor", "hg9900", "--csv", tmp_path / "out.csv")
        assert result.exit_code == 0
        assert [line.split()[0] for line in result.stdout.splitlines()] == ["file", "x_9.csv", "x_10.csv"]
        rows = list(csv.DictReader((tmp_path / "out.csv").read_text().splitlines()))
        assert [row["file"] for row in rows] == ["x_9.csv", "x_10.csv"]
        assert all(abs(float(row["error_deg"])) < 1 for row in rows)

    def test_a_bad_file_is_a_row_and_the_worst_code_counts(self, folder):
        (folder / "bad.csv").write_text("t,w_x,w_y,w_z\n0,a,b,c\n")
        code, array = run_json("heading", folder, "--sensor", "hg9900", "--json")
        assert code == 2
        assert [document["file"] for document in array] == ["bad.csv", "x_9.csv", "x_10.csv"]
        assert array[0]["valid"] is False
        assert array[0]["error"]
        assert array[1]["error"] is None
        assert list(array[1])[2:] == KEYS
        assert "error: " in run("heading", folder).stdout

    def test_a_refused_file(self, folder):
        assert run("heading", folder, "--sensor", "hg9900", *SPOILED).exit_code == 3

    @pytest.mark.parametrize("option", [("--plot", "x.png"), ("--report", "x.html"), ("--nmea",)])
    def test_outputs_of_one_recording(self, folder, option):
        result = run("heading", folder, *option)
        assert result.exit_code == 2
        assert f"{option[0]} takes one recording" in result.stderr

    def test_empty_folder(self, tmp_path):
        result = run("heading", tmp_path)
        assert result.exit_code == 2
        assert "holds no recordings" in result.stderr

    def test_a_curve_of_an_empty_folder_says_what_it_needs(self, tmp_path):
        (tmp_path / "empty").mkdir()
        result = run("calibrate", tmp_path / "empty", "-o", tmp_path / "curve.json")
        assert result.exit_code == 2
        for words in ("is empty and holds no recordings", ".csv", "at least 7 recordings at known headings"):
            assert words in result.stderr
        assert not (tmp_path / "curve.json").exists()

    def test_a_wrong_sensor_is_one_error(self, folder):
        result = run("heading", folder, "--sensor", "hg990")
        assert result.exit_code == 2
        assert "hg990" in result.stderr
        assert result.stdout == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--latitude", "north"), ("--latitude", "'north'", "32.11")),
        (("--latitude", "nan"), ("--latitude", "'nan'", "32.11")),
        (("--latitude", "91"), ("--latitude", "'91'", "-90 to 90")),
        (("--latitude", "33"), ("32.1100", "33.0000", "0.1 deg")),
        (("--window", "10-20"), ("--window", "'10-20'", "600:950")),
        (("--window", "20:10"), ("--window", "'20:10'", "600:950")),
        (("--window", "0:61"), ("0:61", "60")),
        (("--rate", "-1"), ("--rate", "'-1'", "100")),
        (("--rate", "1e9"), ("--rate", "1e+09")),
        (("--boresight", "1,2"), ("--boresight", "'1,2'", "0,0,90")),
        (("--boresight", "1,2,inf"), ("--boresight", "'1,2,inf'", "0,0,90")),
        (("--gyro-bias", "x,0,0"), ("--gyro-bias", "'x,0,0'", "deg/h")),
        (("--roll", "200", "--pitch", "0"), ("--roll", "'200'", "1.5")),
        (("--roll", "2"), ("--roll and --pitch",)),
        (("--axes", "xyz"), ("--axes", "'xyz'", "frd")),
        (("--gyro-unit", "turns/s"), ("--gyro-unit", "'turns/s'", "deg/h")),
        (("--accel-unit", "ft"), ("--accel-unit", "'ft'", "m/s2")),
        (("--columns", "a=b"), ("--columns", "'a=b'", "w_x=gx")),
        (("--method", "magic"), ("--method", "magic", "inertial")),
        (("--sensor", "nope"), ("'nope'", "sdc500")),
        (("--json", "--nmea"), ("--json and --nmea",)),
        (("--plot", "x.gif"), ("--plot", "x.gif", ".png")),
        (("--report", "x.pdf"), ("--report", "x.pdf", ".html")),
        (("--csv", "no/such/x.csv"), ("--csv", "folder", "no/such")),
        (("--csv", HERE), ("--csv", "is the recording")),
        (("--csv", "x.png", "--plot", "x.png"), ("--plot", "--csv")),
        (("--nonsense",), ("--nonsense",)),
        (("--any-session",), ("--any-session", "deviation.json")),
        (("--deviation", "curve.json", "--gyro-bias", "1,0,0"), ("--gyro-bias", "twice")),
        (("--deviation", "curve.json", "--method", "turned"), ("closed form", "turned", "--method mean")),
    ],
)
def test_bad_usage_is_one_message(rec, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    result = run("heading", rec, *(str(rec) if argument == HERE else argument for argument in arguments))
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert len(result.stderr.splitlines()) <= 2  # the message, and where the help is
    for word in words:
        assert word in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_deviation_curve_knows_the_boresight_it_was_measured_with(tmp_path):
    swing, rng = tmp_path / "swing", np.random.default_rng(3)
    swing.mkdir()
    for number in range(8):
        made = {"latitude": radians(32.11), "heading": number * np.pi / 4, "duration": 30, "rate_hz": 3, "rng": rng}
        readers.write(replace(simulate("sdc500", **made), session="swing"), swing / f"{number}.csv")
    curve = tmp_path / "curve.json"
    assert run("calibrate", swing, "-o", curve, "--boresight", "0,0,90").exit_code == 0
    corrected = ("heading", swing / "2.csv", "--deviation", curve, "--sensor", "sdc500", "--json")
    refused = run(*corrected, "--boresight", "0,0,-90")
    assert refused.exit_code == 2
    assert "curve.json was measured with --boresight 0,0,90, but this is 0,0,-90" in refused.stderr
    assert run(*corrected).exit_code == 2
    _, found = run_json(*corrected, "--boresight", "0,0,90")
    assert [warning["code"] for warning in found["warnings"]] == ["deviation_applied"]
    # The same of a unit that is still running, in its session.
    live = ("live", *corrected[1:], "--boresight", "0,0,90", "--no-page", "--speed", 100)
    last = json.loads(run(*live).stdout.splitlines()[-1])
    assert last["heading_deg"] == pytest.approx(found["heading_deg"], abs=1e-6)
    assert [warning["code"] for warning in last["warnings"]] == ["deviation_applied"]
    assert "with --boresight 0,0,90, but this is 0,0,0" in run("live", *corrected[1:], "--no-page").stderr


def test_missing_latitude(rec, tmp_path):
    path = tmp_path / "no_latitude.csv"
    path.write_text("\n".join(line for line in rec.read_text().splitlines() if "latitude" not in line) + "\n")
    result = run("heading", path)
    assert result.exit_code == 2
    assert "--latitude" in result.stderr


def test_missing_file_and_damaged_file(rec, tmp_path):
    missing = run("heading", tmp_path / "nope.csv")
    assert (missing.exit_code, missing.stderr) == (2, f"error: There is no file {tmp_path / 'nope.csv'}.\n")
    damaged = tmp_path / "damaged.csv"
    damaged.write_text(rec.read_text().replace("\n1.0,", "\n1.0,oops,", 1))
    result = run("heading", damaged)
    assert result.exit_code == 2
    assert "Row " in result.stderr
    assert "--drop-bad-rows" in result.stderr
    dropped = run_json("heading", damaged, "--drop-bad-rows", "--json")[1]
    assert "rows_dropped" in [warning["code"] for warning in dropped["warnings"]]


class TestWriting:
    """A failing write is one message, and what stood there before stays."""

    def check(self, tmp_path, name, *arguments):
        (tmp_path / name).write_text("before")
        result = run(*arguments)
        assert (result.exit_code, result.stdout) == (2, "")
        assert "No space left on device" in result.stderr
        assert (tmp_path / name).read_text() == "before"
        assert [path.name for path in tmp_path.iterdir()] == [name]

    @staticmethod
    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    def test_csv(self, rec, tmp_path, monkeypatch):
        monkeypatch.setattr(csv, "writer", self.fail)
        self.check(tmp_path, "out.csv", "heading", rec, "--csv", tmp_path / "out.csv")

    def test_plot(self, rec, tmp_path, monkeypatch):
        monkeypatch.setattr(figures.Figure, "savefig", self.fail)
        self.check(tmp_path, "out.png", "heading", rec, "--plot", tmp_path / "out.png")

    @pytest.mark.slow
    def test_report(self, rec, tmp_path, monkeypatch):
        from pathlib import Path

        monkeypatch.setattr(Path, "write_text", lambda path, *_, **__: self.fail() if "part" in path.name else None)
        (tmp_path / "out.html").write_bytes(b"before")
        result = run("heading", rec, "--report", tmp_path / "out.html")
        assert result.exit_code == 2
        assert (tmp_path / "out.html").read_bytes() == b"before"
        assert [path.name for path in tmp_path.iterdir()] == ["out.html"]


class TestRecordings:
    def test_the_same_seed_gives_the_same_bytes(self, tmp_path):
        arguments = ("--sensor", "sdc500", "--latitude", "-60", "--heading", 350, "--duration", 10, "--rate", 50)
        for name, seed in (("a.csv", 3), ("b.csv", 3), ("c.csv", 4)):
            assert run("simulate", *arguments, "--seed", seed, "-o", tmp_path / name).exit_code == 0
        a, b, c = ((tmp_path / name).read_bytes() for name in ("a.csv", "b.csv", "c.csv"))
        assert a == b
        assert a != c
        recording = readers.read(tmp_path / "a.csv")
        assert recording.latitude == pytest.approx(radians(-60))
        assert recording.heading_true == pytest.approx(radians(350))

    def test_turns_and_no_accelerometer(self, tmp_path):
        path = tmp_path / "turned.npz"
        result = run(
            *("simulate", "--sensor", "hg9900", "--latitude", 10, "--heading", 30, "--duration", 60, "--rate", 10),
            *("--seed", 1, "--no-accel", "--turn", "10:5:90", "--turn", "30:10:-200", "-o", path),
        )
        assert result.exit_code == 0
        recording = readers.read(path)
        assert recording.accel_b is None
        assert recording.heading_true == pytest.approx(radians(30 + 90 - 200 + 360))
        assert np.degrees(recording.gyro_b[120:130, 2].mean()) == pytest.approx(18, abs=0.01)  # 90 deg in 5 s

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (("--turn", "3:4"), ("--turn", "'3:4'", "60:5:90")),
            (("--turn", "8:4:90"), ("12 s",)),
            (("--seed", "x"), ("--seed", "'x'")),
            (("--duration", "0"), ("--duration", "'0'")),
            (("--disturbance", "quake"), ("'quake'", "sway")),
            (("-o", "x.txt"), ("x.txt", ".npz")),
        ],
    )
    def test_bad_usage(self, tmp_path, monkeypatch, arguments, words):
        monkeypatch.chdir(tmp_path)
        good = {"--sensor": "sdc500", "--latitude": 9, "--heading": 3, "--duration": 10, "--rate": 10, "--seed": 1}
        given = good | {"-o": "x.csv"} | {arguments[0]: arguments[1]}
        result = run("simulate", *(part for pair in given.items() for part in pair))
        assert result.exit_code == 2
        for word in words:
            assert word in result.stderr
        assert list(tmp_path.iterdir()) == []

    def test_help_and_message_list_the_same_disturbances(self, tmp_path):
        where = ("--sensor", "sdc500", "--latitude", 9, "--heading", 3, "--duration", 10, "--rate", 10, "--seed", 1)
        refused = run("simulate", *where, "-o", tmp_path / "x.csv", "--disturbance", "quake").stderr
        listed = refused.partition("known are ")[2].partition(".")[0].split(", ")
        assert listed == [*KINDS, *SLOW, *PLATFORM, *HELD_OUT]
        shown = re.search(r"--disturbance(.*?)\[default", run("simulate", "--help").stdout, re.DOTALL)
        assert shown is not None
        assert [word for word in re.findall(r"[a-z]+", shown[1]) if word in listed] == listed

    def test_convert_keeps_the_mean_at_any_ratio(self, rec, tmp_path):
        assert run("convert", rec, "-o", tmp_path / "slow.npz", "--decimate-to", 3).exit_code == 0
        before, after = readers.read(rec), readers.read(tmp_path / "slow.npz")
        assert (after.rate_hz, len(after.gyro_b)) == (3, 180)
        np.testing.assert_allclose(after.gyro_b.mean(axis=0), before.gyro_b.mean(axis=0), rtol=1e-9)
        assert (after.latitude, after.heading_true) == (before.latitude, before.heading_true)

    def test_convert_does_not_overwrite_its_input(self, rec):
        before = rec.read_bytes()
        result = run("convert", rec, "-o", rec)
        assert result.exit_code == 2
        assert rec.read_bytes() == before

    def test_convert_upwards_is_refused(self, rec, tmp_path):
        result = run("convert", rec, "-o", tmp_path / "x.csv", "--decimate-to", 100)
        assert result.exit_code == 2
        assert "20 Hz" in result.stderr

    def test_info(self, rec):
        code, doc = run_json("info", rec, "--json")
        assert code == 0
        assert (doc["samples"], doc["rate_hz"], doc["latitude_deg"]) == (1200, 20, pytest.approx(32.11))
        text = run("info", rec).stdout
        assert "1200 samples, 60 s at 20 Hz" in text
        assert re.search(r"true heading +40\.00 deg", text)


class TestSensors:
    def test_sensors_cite_their_sources(self):
        code, array = run_json("sensors", "--json")
        assert code == 0
        text = run("sensors").stdout
        for profile in array:
            assert profile["source"]
            assert f"\n{profile['name']}: " in text
        row = next(line for line in text.splitlines() if line.startswith("sdc500"))
        assert row.split()[1:3] == ["0.02", "1"]  # deg/sqrt(h), deg/h

    @pytest.mark.slow
    def test_allan_profile_is_accepted_by_heading(self, rec, tmp_path):
        profile, plot = tmp_path / "own.json", tmp_path / "allan.png"
        result = run("allan", rec, "-o", profile, "--plot", plot)
        assert (result.exit_code, result.stderr) == (0, f"wrote {profile}\nwrote {plot}\n")
        # hg9900 has 0.002 deg/sqrt(h); 3600 independent samples tell it to 1.2 %, 1 sigma
        found = re.search(r"angle random walk +deg/sqrt\(h\) .* (\S+) \((\S+) to (\S+)\)", result.stdout)
        assert float(found[1]) == pytest.approx(0.002, rel=0.05)
        assert float(found[2]) < float(found[1]) < float(found[3])
        assert plot.read_bytes().startswith(b"\x89PNG")
        assert read_sensor(profile).name == "own"
        assert run_json("heading", rec, "--sensor", profile, "--json")[1]["sensor"] == "own"

    @pytest.mark.slow
    def test_allan_json(self, rec):
        code, doc = run_json("allan", rec, "--json")
        assert code == 0
        assert doc["schema"] == "gyronorth.allan/1"

    def test_allan_refuses_a_short_record(self, rec):
        result = run("allan", rec, "--window", "0:20")
        assert result.exit_code == 2
        assert "60 s" in result.stderr

    @pytest.mark.slow
    def test_plan(self, tmp_path):
        plot = tmp_path / "plan.svg"
        result = run("plan", "--sensor", "sdc500", "--latitude", 32.11, "--plot", plot)
        assert (result.exit_code, result.stderr) == (0, f"wrote {plot}\n")
        assert plot.read_text().startswith("<?xml")
        code, doc = run_json("plan", "--sensor", "sdc500", "--latitude", 32.11, "--json")
        assert code == 0
        sigma = doc["sigma_deg"][doc["duration_s"].index(600)]
        assert re.search(rf"^10 min +{sigma:.2f} ", result.stdout, re.MULTILINE)

    def test_plan_of_a_sensor_that_cannot(self):
        result = run("plan", "--sensor", "bmi088", "--latitude", 32.11)
        assert result.exit_code == 0
        assert "never tells north from south" in result.stdout


class TestProcess:
    """In a process of its own; `python -m gyronorth` is the command."""

    def start(self, *arguments, **options):
        command = [sys.executable, "-m", "gyronorth", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, **options)

    @pytest.mark.slow
    def test_without_standard_output(self, rec):
        command = f"{sys.executable} -m gyronorth.cli heading {rec} --sensor hg9900 >&-"
        result = subprocess.run(["bash", "-c", command], capture_output=True, text=True)
        assert (result.returncode, result.stderr) == (0, "")

    def test_help_names_the_commands(self):
        result = self.start("--help")
        assert result.returncode == 0
        for command in ("heading", "simulate", "allan", "plan", "info", "convert", "sensors"):
            assert command in result.stdout

    def test_help_loads_neither_numpy_nor_pydantic(self):
        loaded = self.imported("--help")
        assert "gyronorth.cli" in loaded
        assert not loaded & {"numpy", "scipy", "pydantic", "matplotlib", "torch", "onnxruntime", "jinja2"}

    @pytest.mark.slow
    def test_heading_without_figures_loads_no_matplotlib(self, rec):
        loaded = self.imported("heading", rec, "--sensor", "hg9900", "--method", "mean", "--csv", os.devnull)
        assert "gyronorth.pipeline" in loaded
        assert not loaded & {"matplotlib", "jinja2", "torch", "onnxruntime"}

    def imported(self, *arguments):
        command = [sys.executable, "-X", "importtime", "-m", "gyronorth.cli", *map(str, arguments)]
        trace = subprocess.run(command, capture_output=True, text=True).stderr
        return {line.rpartition("|")[2].strip() for line in trace.splitlines() if line.startswith("import time:")}

    def test_usage_error_has_no_traceback(self):
        result = self.start("heading")
        assert result.returncode == 2
        assert "Traceback" not in result.stderr
        assert result.stderr.startswith("error: Missing argument")

    def test_a_reader_that_goes_away(self, rec):
        command = f"{sys.executable} -m gyronorth.cli sensors | head -1; exit ${{PIPESTATUS[0]}}"
        result = subprocess.run(["bash", "-c", command], capture_output=True, text=True)
        assert "Traceback" not in result.stderr
        assert "BrokenPipe" not in result.stderr

    def test_version(self):
        result = self.start("--version")
        assert re.fullmatch(r"gyronorth \d+\.\d+\.\d+\S*\n", result.stdout)
