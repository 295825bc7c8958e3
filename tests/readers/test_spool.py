"""Packed files, archives, pipes and standard input are read like the file in them."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import os
import pickle
import sys
import threading
import zipfile
import zlib

import numpy as np
import pytest
import zstandard
from numpy.testing import assert_array_equal
from still import csv_file, csv_rows, still

from gyronorth.cli import main
from gyronorth.errors import InputError
from gyronorth.readers import describe, read, recordings_in
from gyronorth.readers import spool as spooling
from gyronorth.readers.registry import open_source

GYRO, ACCEL = still(300)
PACKERS = {".gz": gzip.compress, ".bz2": bz2.compress, ".xz": lzma.compress, ".zst": zstandard.compress}


def plain(folder):
    return csv_file(folder, csv_rows(300))


@pytest.fixture(autouse=True)
def _temporary(tmp_path, monkeypatch):
    """Private folders of the reader go where the test can see them."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    yield
    assert not list((tmp_path / "tmp").iterdir()), "a private folder was left behind"


@pytest.mark.parametrize("suffix", PACKERS)
def test_packed_files_of_any_format_are_read_whole_and_in_windows(tmp_path, suffix):
    content = plain(tmp_path).read_bytes()
    path = tmp_path / f"rec.csv{suffix}"
    path.write_bytes(PACKERS[suffix](content[:5000]) + PACKERS[suffix](content[5000:]))  # two streams, as pigz writes
    recording = read(path)
    assert_array_equal(recording.gyro_b, GYRO)
    assert recording.source == f"rec.csv{suffix}"
    assert len(read(path, window=(0.5, 1.0)).gyro_b) == round(0.5 * recording.rate_hz)
    assert describe(path).samples == 300
    np.savez(tmp_path / "rec.npz", gyro=GYRO, accel=ACCEL, rate=recording.rate_hz)
    (tmp_path / f"x.npz{suffix}").write_bytes(PACKERS[suffix]((tmp_path / "rec.npz").read_bytes()))
    assert_array_equal(read(tmp_path / f"x.npz{suffix}", gyro_unit="rad/s", accel_unit="m/s2").gyro_b, GYRO)
    del recording
    names = [found.name for found in recordings_in(tmp_path)]
    assert f"rec.csv{suffix}" in names


@pytest.mark.parametrize("suffix", PACKERS)
def test_cut_off_and_damaged_ones_end_in_one_message(tmp_path, suffix):
    content = PACKERS[suffix](plain(tmp_path).read_bytes())
    path = tmp_path / f"cut.csv{suffix}"
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(InputError):
        read(path)
    path.write_bytes(PACKERS[suffix](b""))
    with pytest.raises(InputError, match="is empty once it is unpacked"):
        read(path)


def test_a_bomb_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(spooling, "FREE", 1 << 20)
    monkeypatch.setattr(spooling, "RATIO", 10)
    zeros = b"0,0,0,0,0,0,0\n" * (1 << 18)
    (tmp_path / "bomb.csv.gz").write_bytes(gzip.compress(zeros))
    with pytest.raises(InputError, match=r"unpacks into more than 1 MiB, which no recording of its size does"):
        read(tmp_path / "bomb.csv.gz")
    with zipfile.ZipFile(tmp_path / "bomb.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("bomb.csv", zeros)
    with pytest.raises(InputError, match=r"bomb.csv of bomb.zip unpacks into more than 1 MiB"):
        read(tmp_path / "bomb.zip")
    nested = plain(tmp_path).read_bytes()
    for _ in range(6):
        nested = gzip.compress(nested)
    (tmp_path / "deep.csv.gz").write_bytes(nested)
    with pytest.raises(InputError, match="packed within packed files"):
        read(tmp_path / "deep.csv.gz")


def zipped(path, members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def one_sensor(names, values, *, step=0.01, start=0.0):
    time = start + step * np.arange(len(values))
    rows = "".join(",".join(repr(float(value)) for value in row) + "\n" for row in np.column_stack([time, values]))
    return f"Time (s),{names}\n{rows}"


GYRO_FILE = one_sensor("Gyroscope x (rad/s),Gyroscope y (rad/s),Gyroscope z (rad/s)", GYRO)
ACCEL_FILE = one_sensor("Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2)", ACCEL)


def test_the_only_recording_of_an_archive_and_a_phones_two(tmp_path):
    content = plain(tmp_path).read_bytes()
    one = zipped(tmp_path / "one.zip", {"readme.md": "text", "__MACOSX/._rec.csv": "x", "data/rec.csv": content})
    assert_array_equal(read(one).gyro_b, GYRO)
    phone = {"Gyroscope.csv": GYRO_FILE, "Accelerometer.csv": ACCEL_FILE, "meta/time.csv": "a,b\n1,2\n",
             "Linear Accelerometer.csv": ACCEL_FILE, "Magnetometer.csv": "x"}  # fmt: skip
    recording = read(zipped(tmp_path / "phone.zip", phone), axes="frd")
    assert_array_equal(recording.gyro_b, GYRO)
    np.testing.assert_allclose(recording.accel_b, ACCEL, rtol=1e-12)
    assert "joined on time" in open_source(tmp_path / "phone.zip", read_options()).read_as
    two = zipped(tmp_path / "two.zip", {f"{n}/{name}": text for n in "ab" for name, text in phone.items()})
    assert_array_equal(read(two / "b", axes="frd").accel_b, recording.accel_b)


def read_options(**declared):
    from gyronorth.readers import ReadOptions

    return ReadOptions(**declared)


def test_several_recordings_are_listed_and_one_is_named_as_a_path(tmp_path):
    content = plain(tmp_path).read_bytes()
    two = zipped(tmp_path / "two.zip", {"a/run1.csv": content, "a/run 2.csv": content})
    with pytest.raises(InputError, match=r"holds 2 files that may be recordings: a/run1.csv, a/run 2.csv") as caught:
        read(two)
    command = str(caught.value).splitlines()[-1]
    assert command == f"Try: gyronorth info {two}/a/run1.csv"
    assert_array_equal(read(tmp_path / "two.zip" / "a" / "run 2.csv").gyro_b, GYRO)
    with pytest.raises(InputError, match=r"two.zip holds no file a/x.csv; it holds a/run1.csv"):
        read(two / "a" / "x.csv")
    with pytest.raises(InputError, match="is a file and no zip archive"):
        read(plain(tmp_path) / "x.csv")
    with pytest.raises(InputError, match=r"holds no recording; it holds doc.pdf"):
        read(zipped(tmp_path / "none.zip", {"doc.pdf": "x"}))
    with pytest.raises(InputError, match="holds pickled Python objects"):
        read(zipped(tmp_path / "net.zip", {"net/data.pkl": pickle.dumps({})}))


def test_a_damaged_archive_is_one_message(tmp_path):
    path = zipped(tmp_path / "rec.zip", {"rec.csv": plain(tmp_path).read_bytes()})
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"rec.zip cannot be read .*damaged, cut off, or no zip archive"):
        read(path)
    path.write_bytes(content[:1000])
    with pytest.raises(InputError, match=r"rec.zip cannot be read"):
        read(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes are of POSIX")
def test_a_named_pipe_is_read_once(tmp_path):
    content = gzip.compress(plain(tmp_path).read_bytes())
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for reader in (lambda: read(pipe).gyro_b.shape[0], lambda: describe(pipe).samples):
        writer = threading.Thread(target=pipe.write_bytes, args=(content,))
        writer.start()
        assert reader() == 300
        writer.join()


class Piped:
    """Standard input with these bytes."""

    def __init__(self, content):
        self.buffer = io.BytesIO(content)

    def isatty(self):
        return False


@pytest.mark.parametrize("pack", [bytes, zlib.compress, gzip.compress])
def test_standard_input_at_the_command_line(tmp_path, monkeypatch, capsys, pack):
    monkeypatch.setattr(sys, "stdin", Piped(pack(plain(tmp_path).read_bytes())))
    monkeypatch.setattr(sys, "argv", ["gyronorth", "info", "-", "--json"])
    if pack is zlib.compress:
        with pytest.raises(SystemExit, match="2"):
            main()
        assert capsys.readouterr().err.startswith("error: ")
    else:
        with pytest.raises(SystemExit, match="0"):
            main()
        assert '"samples": 300' in capsys.readouterr().out


def test_standard_input_that_is_empty_or_a_terminal(monkeypatch):
    monkeypatch.setattr(sys, "stdin", Piped(b""))
    with pytest.raises(InputError, match="standard input gave nothing"):
        read("-")
    terminal = Piped(b"")
    terminal.isatty = lambda: True
    monkeypatch.setattr(sys, "stdin", terminal)
    with pytest.raises(InputError, match="Standard input is a terminal"):
        read("-")
