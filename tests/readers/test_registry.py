"""A format from outside: one file and one row, and it goes every way that the others go."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from gyronorth.catalogue import FORMATS as ROWS
from gyronorth.errors import InputError
from gyronorth.readers import read, registry

ROOT = Path(__file__).parents[2]
#: What somebody else's module would hold, then a command line that takes it.
TOY = """
import sys

import numpy as np

from gyronorth.catalogue import FormatInfo
from gyronorth.readers import registry
from gyronorth.readers.format import Format
from gyronorth.readers.source import FORCES, RATES, Facts, Source, blocks_of

MARK = b"TOY1"


def opened(path, options):
    values = np.frombuffer(path.read_bytes()[len(MARK):], dtype="<f8").reshape(-1, 6)
    return Source(
        format="toy", name=path.name, columns=(*RATES, *FORCES), blocks=lambda: blocks_of([values], len(values)),
        stated=Facts(rate_hz=10.0, gyro_unit="rad/s", accel_unit="m/s2", axes="frd", latitude=0.56),
    )


def written(stream, path):
    with path.open("wb") as file:
        file.write(MARK)
        for rows in stream.rows():
            file.write(np.hstack([rows.gyro_b, rows.accel_b]).astype("<f8").tobytes())


registry.register(
    Format(
        FormatInfo("toy", "toy", __name__, (".toy",), (".toy",)),
        opened,
        recognises=lambda head: head.startswith(MARK),
        write=written,
    )
)
"""


def run(tmp_path, body, *arguments):
    script = tmp_path / "toy.py"
    script.write_text(TOY + body)
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    return subprocess.run(
        [sys.executable, script, *map(str, arguments)], capture_output=True, text=True, env=environment, check=False
    )


@pytest.mark.slow
def test_a_toy_format_is_written_recognised_and_read_at_the_command_line(tmp_path):
    body = """
import gyronorth as gn
from pathlib import Path
from gyronorth.cli import main
from gyronorth.report import html
html.svg_text = lambda figure, salt: ""  # drawn in tests/report
recording = gn.simulate("sdc500", latitude=0.56, heading=1.0, duration=60, rate_hz=10, rng=np.random.default_rng(0))
gn.write(recording, sys.argv[1])
back = gn.read(sys.argv[1])
print((back.gyro_b == recording.gyro_b).all(), back.rate_hz)
path, unnamed = map(Path, sys.argv[1:3])
path.rename(unnamed)  # its suffix says nothing: the content does
sys.argv[1:3] = ["heading", str(unnamed)]
main()
"""
    page = tmp_path / "toy.html"
    names = (tmp_path / "rec.toy", tmp_path / "rec.bin")
    done = run(tmp_path, body, *names, "--sensor", "sdc500", "--json", "--report", page)
    assert (done.returncode, done.stderr) == (0, f"wrote {page}\n")
    same, _, answer = done.stdout.partition("\n")
    assert same == "True 10.0"
    assert json.loads(answer)["duration_s"] == 60.0
    assert "rec.bin" in page.read_text()


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_every_row_has_a_format_that_agrees_with_it(row):
    try:
        known = registry.FORMATS[row.name]
    except ImportError as error:  # pragma: no cover
        pytest.skip(f"extra {row.extra}: {error}")
    assert known.info is row
    assert (known.write is not None) == bool(row.written) or row.name == "rosbag2"


def test_signatures_tell_the_formats_apart(tmp_path):
    heads = {
        "npz": b"PK\x03\x04",
        "mat": b"MATLAB 5.0",
        "hdf5": b"\x89HDF\r\n\x1a\n",
        "parquet": b"PAR1",
        "rosbag1": b"#ROSBAG V2.0",
        "mcap": b"\x89MCAP0",
        "psins": b"% PSINS",
        "mt-manager": b"// Start Time: Unknown",
        "csv": b"t,w_x,w_y,w_z",
    }
    for name, head in heads.items():
        path = tmp_path / "file.bin"
        path.write_bytes(head + b"\n1,2,3,4\n")
        assert registry.recognised(path) == name


def test_an_unknown_format_lists_those_there_are(tmp_path):
    path = tmp_path / "rec.csv"
    path.write_text("t,w_x\n")
    with pytest.raises(InputError, match="csv, psins"):
        read(path, format="word")


@pytest.mark.parametrize(
    ("name", "head", "says"),
    [
        ("a.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "libreoffice --headless --convert-to xlsx a.xls"),
        ("a.tdms", b"TDSm\x0e\0\0\0", "npTDMS"),
        ("a.nc", b"CDF\x01\0\0\0\0", "nccopy -k nc4 a.nc imu.nc"),
        ("a.db", b"SQLite format 3\0", "sqlite3 -header -csv a.db"),
        ("a.ulg", b"ULog\x01\x12\x35", "ulog2csv -m sensor_combined a.ulg"),
        ("a.bin", b"\xa3\x95\x80\x80", "mavlogdump.py --types IMU"),
        ("a.csv", b"%PDF-1.7", "a PDF"),
        ("a.tar", b"a".ljust(257, b"\0") + b"ustar", "tar xf a.tar"),
    ],
)
def test_formats_that_are_known_and_not_read_are_named_with_a_cure(tmp_path, name, head, says):
    (tmp_path / name).write_bytes(head + bytes(600))
    with pytest.raises(InputError) as refused:
        read(tmp_path / name)
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)
