"""The instrument without a page: options from a file, and what programs ask of it."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import tomllib
import urllib.error
import urllib.request
from dataclasses import replace
from math import radians
from pathlib import Path

import pytest
from live_stream import HEAD, rows_in, seconds, session_of, timed_rows
from typer.testing import CliRunner
from unit_at_rest import unit
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from gyronorth.cli import app
from gyronorth.live.metrics import metrics_text
from gyronorth.live.status import Status

ROOT = Path(__file__).parents[2]


def run_live(folder: Path, *arguments: str, given: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "gyronorth.cli", "live", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    return subprocess.run(command, cwd=folder, env=environment, input=given, capture_output=True, check=False)


@pytest.mark.slow
def test_frames_on_standard_input_with_options_of_a_file(tmp_path, monkeypatch):
    """The file says all but the method; the command line beats it. NiceGUI is not needed. Two targets get sentences."""
    case, _ = unit("stim", monkeypatch)
    listeners = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for listener in listeners:
        listener.bind(("127.0.0.1", 0))
    targets = [f"udp:127.0.0.1:{listener.getsockname()[1]}" for listener in listeners]
    (tmp_path / "live.toml").write_text(
        f'source = "-"\nlatitude = {round(48.0, 3)}\naxes = "frd"\npage = false\njson = true\nsave = "rec.csv"\n'
        'output_rate = 0.5\nmethod = "inertial"\nlog-level = "warning"\n'
        f"nmea-out = {json.dumps(targets)}\n"
    )
    (tmp_path / "nicegui.py").write_text("raise SystemExit('the page is not wanted')\n")
    run = run_live(tmp_path, "--config", "live.toml", "--method", "mean", given=case.preamble + b"".join(case.frames))
    document = json.loads(run.stdout.splitlines()[-1])
    assert (run.returncode, document["method"], document["live"]["protocol"]) == (0, "mean", "stim")
    assert document["live"]["raw_recording"] == "rec.bin"
    assert b"recognised" not in run.stderr  # a message of the level "info"
    assert len(rows_in(tmp_path / "rec.csv")) == len(case.frames)
    for listener in listeners:
        with listener:
            assert listener.recv(1000).startswith(b"$HETHS,,V*14\r\n")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sensr = 'stim300'", "has the key sensr, which is no option; one of"),
        ("sensor = ", "is no TOML"),
        ("latitude = 100", "is not a latitude of -90 to 90 degrees"),
        ("latitude = 'here'", "GGA or RMC"),
        ("port = 1979-05-27", "a text, a number, true or false is expected"),
        ("nmea-set = 'loud'", "is not one of standard"),
        ("log-level = 'loud'", "is not one of debug"),
    ],
)
def test_a_file_of_options_that_cannot_be(text, words, tmp_path):
    (tmp_path / "live.toml").write_text(text)
    result = CliRunner().invoke(app, ["live", "--config", str(tmp_path / "live.toml"), "-"])
    assert result.exit_code == 2
    assert words in " ".join(re.sub(r"[│╭╮╰╯─]", " ", result.output).split())


def test_the_example_file_has_options_only():
    help_text = CliRunner().invoke(app, ["live", "--help"], env={"COLUMNS": "200"}).output
    for key in tomllib.loads((ROOT / "deploy/live.toml").read_text()):
        assert key == "source" or f"--{key} " in help_text


@pytest.mark.slow
def test_programs_are_served_without_a_page(tmp_path):
    (tmp_path / "played.csv").write_text(HEAD + "".join(timed_rows(seconds(0, 60))))
    command = [
        sys.executable,
        "-m",
        "gyronorth.cli",
        "live",
        "played.csv",
        "--no-page",
        "--method",
        "mean",
        "--api",
        "--port",
        "0",
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    process = subprocess.Popen(
        [*command, "--speed", "4"], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stderr is not None
    try:
        word, address = process.stderr.readline().decode().split()
        assert word == "api:"
        with urllib.request.urlopen(f"{address}api/stream?hz=20", timeout=300) as stream:
            lines = (line.decode() for line in stream)
            documents = (json.loads(line.removeprefix("data: ")) for line in lines if line.startswith("data: "))
            before = next(document for document in documents if document.get("heading_deg"))
        asked = urllib.request.Request(f"{address}api/alignment?deg=90", method="POST")
        with urllib.request.urlopen(asked, timeout=300) as answer:
            assert json.load(answer) == {"alignment_deg": 90.0}
        for wrong in ("200", "nan"):
            with pytest.raises(urllib.error.HTTPError, match="422"):
                urllib.request.urlopen(f"{address}api/alignment?deg={wrong}", data=b"", timeout=300)
        with connect(f"{address.replace('http', 'ws')}api/socket?hz=20", origin=Origin(address.rstrip("/"))) as heard:
            received = (json.loads(text) for text in heard)
            after = next(document for document in received if document["live"]["alignment_deg"] == 90.0)
        assert "alignment_offset" in {warning["code"] for warning in after["warnings"]}
        off = (after["heading_deg"] - before["heading_deg"] - 90 + 180) % 360 - 180
        assert abs(off) < 4 * (before["sigma_deg"] + after["sigma_deg"])
        with pytest.raises(InvalidStatus):
            connect(f"{address.replace('http', 'ws')}api/socket", origin=Origin("http://elsewhere.example"))
        with urllib.request.urlopen(f"{address}metrics", timeout=300) as answer:
            assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
            assert b"\ngyronorth_heading_degrees " in answer.read()
        with urllib.request.urlopen(f"{address}healthz", timeout=300) as answer:
            assert json.load(answer)["ok"]
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(address, timeout=300)
    finally:
        process.terminate()
        process.communicate(timeout=300)


def test_programs_are_answered_while_a_fix_of_the_latitude_is_waited_for(tmp_path):
    """Alive, not ready, and why; the heading follows the first fix."""
    placeless = "".join(line for line in HEAD.splitlines(keepends=True) if "latitude" not in line)
    (tmp_path / "unit.csv").write_text(placeless + "".join(timed_rows(seconds(0, 20))))
    with socket.create_server(("127.0.0.1", 0)) as receiver:
        place = f"tcp:127.0.0.1:{receiver.getsockname()[1]}"
        command = [sys.executable, "-m", "gyronorth.cli", "live", "unit.csv", "--latitude", place, "--no-page", "--api"]
        environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
        process = subprocess.Popen(
            [*command, "--port", "0", "--json", "--method", "mean", "--speed", "100"],
            cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        assert process.stderr is not None
        try:
            lines = (line.decode() for line in process.stderr)
            address = next(line for line in lines if line.startswith("api: ")).split()[1]
            next(line for line in lines if f"waiting for a fix of the latitude from {place}" in line)
            with pytest.raises(urllib.error.HTTPError, match="503") as answer:
                urllib.request.urlopen(f"{address}healthz", timeout=300)
            troubles = json.load(answer.value)["troubles"]
            assert len(troubles) == 1
            assert troubles[0].startswith(f"waiting for a fix of the latitude from {place}")
            with urllib.request.urlopen(f"{address}api/heading", timeout=300) as shown:
                live = json.load(shown)["live"]
            assert (live["state"], live["fitness"], live["connected"]) == ("waiting", "aligning", False)
            connection, _ = receiver.accept()
            with connection:
                connection.sendall(b"$GPGGA,092204.999,4800.0000,N,01118.5084,E,1,04,24.4,19.7,M,,,,0000*0E\r\n")
                output, _ = process.communicate(timeout=300)
        finally:
            process.kill()
            process.wait()
    last = json.loads(output.splitlines()[-1])
    assert last["latitude_deg"] == pytest.approx(48.0)
    assert last["live"]["good"] == 2000


def test_metrics_are_lines_that_prometheus_reads():
    status = replace(session_of(HEAD, timed_rows(seconds(0, 20))).status, state="running", rate_of_turn=radians(1))
    for shown in (status, Status("waiting", "here")):
        lines = metrics_text(shown).splitlines()
        values = dict(line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
        assert all(re.fullmatch(r"gyronorth_[a-z_]+(\{state=\"[a-z]+\"\})?", name) for name in values)
        assert sum(float(values[f'gyronorth_fitness{{state="{name}"}}']) for name in ("valid", "aligning")) == 1
        types = [line.split()[2] for line in lines if line.startswith("# TYPE")]
        assert len(types) == len(set(types))
    assert metrics_text(status).count("\ngyronorth_rate_of_turn_degrees_per_minute 60\n") == 1
