"""HDF5 and Parquet files as others make them: read, chosen from, refused."""

from __future__ import annotations

import inspect
import os
import re
import sys

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.io import savemat
from still import LATITUDE, still
from typer.testing import CliRunner

from gyronorth.cli import app
from gyronorth.errors import InputError
from gyronorth.readers import read, read_chunks, write
from gyronorth.recording import Recording

ROWS, RATE = 400, 100.0
GYRO, ACCEL = still(ROWS)
TIME = np.arange(ROWS) / RATE
NAMES = ("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z")
COLUMNS = dict(zip(NAMES, (TIME, *GYRO.T, *ACCEL.T), strict=True))
SI = {"gyro_unit": "rad/s", "accel_unit": "m/s2"}
PNG = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + bytes(600)


def check(recording: Recording) -> None:
    assert_array_equal(recording.gyro_b, GYRO)
    assert recording.accel_b is not None
    assert_array_equal(recording.accel_b, ACCEL)
    assert recording.rate_hz == RATE


def hdf5_columns(path):
    with h5py.File(path, "w") as file:
        for name, column in COLUMNS.items():
            file[name] = column


def hdf5_matrices(path):
    with h5py.File(path, "w") as file:
        file["imu/gyro"], file["imu/accel"], file["imu/t"] = GYRO, ACCEL, TIME
        file["notes"] = "text beside"


def hdf5_records(path):
    records = np.rec.fromarrays(list(COLUMNS.values()), names=",".join(NAMES))
    with h5py.File(path, "w") as file:
        file.create_dataset("imu/table", data=records, compression="gzip")


def hdf5_wide(path):
    with h5py.File(path, "w") as file:
        file["data"] = np.column_stack(list(COLUMNS.values()))


WIDE = {name: f"data[{i}]" for i, name in enumerate(NAMES)}


@pytest.mark.parametrize(
    ("make", "how"),
    [
        (hdf5_columns, {}),
        (hdf5_matrices, {"variable": "imu"}),
        (hdf5_matrices, {"variable": "/imu/"}),
        (hdf5_records, {"variable": "imu/table"}),
        (hdf5_wide, {"columns": WIDE}),
        (hdf5_wide, {"variable": "data", "columns": {name: str(i) for i, name in enumerate(NAMES)}}),
    ],
)
def test_hdf5_of_any_arrangement(tmp_path, make, how):
    make(tmp_path / "rec.h5")
    check(read(tmp_path / "rec.h5", **SI, **how))


def test_hdf5_columns_that_are_not_there_are_listed(tmp_path):
    with h5py.File(tmp_path / "odd.h5", "w") as file:
        file["imu/a"], file["imu/b"] = np.zeros((400, 2)), np.zeros(400)
    with pytest.raises(InputError, match=r"no column w_x, w_y, w_z: its columns are imu/a\[0\], .* imu/b"):
        read(tmp_path / "odd.h5", **SI)
    hdf5_matrices(tmp_path / "rec.h5")
    check(read(tmp_path / "rec.h5", **SI))
    with pytest.raises(InputError, match=r"no variable 'gps'; it holds imu/accel \(400 rows\), imu/gyro"):
        read(tmp_path / "rec.h5", variable="gps")
    with h5py.File(tmp_path / "two.h5", "w") as file:
        for name, column in COLUMNS.items():
            file[name] = column[:399] if name == "f_z" else column
    with pytest.raises(InputError, match=r"The columns of two.h5 differ in length: t 400, .*, f_z 399 rows"):
        read(tmp_path / "two.h5", **SI)


def test_hdf5_without_numbers_and_with_odd_attributes(tmp_path):
    with h5py.File(tmp_path / "none.h5", "w") as file:
        file["a"], file["b"] = h5py.SoftLink("/b"), h5py.SoftLink("/a")
        file["text"] = "no numbers"
    with pytest.raises(InputError, match=r"none.h5 holds no dataset of numbers"):
        read(tmp_path / "none.h5")
    hdf5_columns(tmp_path / "rec.h5")
    with h5py.File(tmp_path / "rec.h5", "a") as file:
        file.attrs["rate_hz"] = np.array([RATE])
        file.attrs["gyro_unit"], file.attrs["accel_unit"] = np.bytes_("rad/s"), "m/s2"
    check(read(tmp_path / "rec.h5"))
    with h5py.File(tmp_path / "rec.h5", "a") as file:
        file.attrs["rate_hz"] = np.array([1, 2])
    with pytest.raises(InputError, match=r"Attribute rate_hz of rec.h5: rate_hz is '\[1 2\]'; a number"):
        read(tmp_path / "rec.h5")


def test_parquet_without_columns(tmp_path):
    pq.write_table(pa.table({}), tmp_path / "rec.parquet")
    with pytest.raises(InputError, match=r"rec.parquet has no column w_x, w_y, w_z: it has 0 columns"):
        read(tmp_path / "rec.parquet")


def test_a_mat_file_of_version_7_3_is_hdf5(tmp_path):
    # As MATLAB writes it: 512 bytes of text, the matrices transposed, their class beside them.
    with h5py.File(tmp_path / "rec.mat", "w", userblock_size=512) as file:
        file["imu"] = np.column_stack(list(COLUMNS.values())).T
        file["imu"].attrs["MATLAB_class"] = np.bytes_("double")
    with (tmp_path / "rec.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    columns = {name: str(i) for i, name in enumerate(NAMES)}
    check(read(tmp_path / "rec.mat", variable="imu", columns=columns, **SI))
    savemat(tmp_path / "old.mat", {"imu": np.column_stack(list(COLUMNS.values()))})
    check(read(tmp_path / "old.mat", variable="imu", columns=columns, **SI))


@pytest.mark.parametrize(
    "how", [{"compression": "snappy"}, {"compression": "zstd", "version": "1.0"}, {"row_group_size": 37}]
)
def test_parquet_of_any_writer(tmp_path, how):
    pq.write_table(pa.table(COLUMNS | {"name": ["text"] * ROWS}), tmp_path / "rec.parquet", **how)
    check(read(tmp_path / "rec.parquet", **SI))


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
@pytest.mark.parametrize("kind", [pa.timestamp, pa.duration])
def test_parquet_times_and_dates_are_seconds_from_the_first(tmp_path, unit, kind):
    per_second = {"ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    counts = 1_714_564_800 * per_second + np.arange(ROWS) * (per_second // 100)
    columns = COLUMNS | {"t": pa.array(counts).cast(kind(unit))}
    pq.write_table(pa.table(columns), tmp_path / "rec.parquet")
    check(read(tmp_path / "rec.parquet", **SI))


def test_parquet_types_and_nulls(tmp_path):
    single = {name: column.astype(np.float32) for name, column in COLUMNS.items() if name != "t"}
    pq.write_table(pa.table({"t": TIME} | single), tmp_path / "rec.parquet")
    assert_array_equal(read(tmp_path / "rec.parquet", **SI).gyro_b, GYRO.astype(np.float32).astype(float))
    gyro = [None if i == 7 else value for i, value in enumerate(GYRO[:, 0].tolist())]
    pq.write_table(pa.table(COLUMNS | {"w_x": gyro}), tmp_path / "null.parquet")
    with pytest.raises(InputError, match=r"Row 8 of null.parquet: w_x is nan; a finite number"):
        read(tmp_path / "null.parquet", **SI)
    assert read(tmp_path / "null.parquet", drop_bad_rows=True, **SI).rows_dropped == 1
    pq.write_table(pa.table(COLUMNS | {"w_x": ["text"] * ROWS}), tmp_path / "text.parquet")
    with pytest.raises(InputError, match=r"Column w_x of text.parquet holds string; numbers are expected"):
        read(tmp_path / "text.parquet", **SI)
    pq.write_table(pa.table({"lat": TIME, "lon": TIME}), tmp_path / "gps.parquet")
    with pytest.raises(
        InputError, match=r"gps.parquet has no column w_x, w_y, w_z: its columns are lat, lon. Say which"
    ):
        read(tmp_path / "gps.parquet")


def test_units_must_be_declared_and_are_honoured(tmp_path):
    write_deg = COLUMNS | {f"w_{axis}": np.degrees(GYRO[:, i]) for i, axis in enumerate("xyz")}
    pq.write_table(pa.table(write_deg), tmp_path / "rec.parquet")
    with pytest.raises(InputError, match=r"rec.parquet does not say in which unit w_x, w_y, w_z are.*--gyro-unit"):
        read(tmp_path / "rec.parquet", accel_unit="m/s2")
    recording = read(tmp_path / "rec.parquet", gyro_unit="deg/s", accel_unit="m/s2", axes="flu")
    assert_allclose(recording.gyro_b, GYRO * [1, -1, -1], rtol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".h5", ".parquet", ".mcap", ".bag", ".npz", ".csv"])
@pytest.mark.parametrize("rows", [2, 16384, 16385])
def test_any_length_reads_back_bit_for_bit_and_in_chunks(tmp_path, suffix, rows):
    recording = Recording(*still(rows, seed=rows), RATE, latitude=LATITUDE)
    write(recording, tmp_path / f"rec{suffix}")
    _, chunks = read_chunks(tmp_path / f"rec{suffix}", chunk_samples=9999)
    back = list(chunks)
    assert np.concatenate([chunk.gyro_b for chunk in back]).tobytes() == recording.gyro_b.tobytes()
    assert recording.accel_b is not None
    forces = [chunk.accel_b for chunk in back if chunk.accel_b is not None]
    assert np.concatenate(forces).tobytes() == recording.accel_b.tobytes()


CUTS = np.random.default_rng(6).integers(1, 10**6, 4)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".h5", ".parquet"])
def test_cut_off_anywhere_is_refused_with_one_message(tmp_path, suffix):
    path = tmp_path / f"rec{suffix}"
    write(Recording(GYRO, ACCEL, RATE), path)
    content = path.read_bytes()
    for cut in {len(content) - 1, *(CUTS % len(content)).tolist()}:
        path.write_bytes(content[:cut])
        with pytest.raises(InputError, match=r"^rec\.\w+ (is cut off|is no|is empty|cannot be read).*[^\n]*$"):
            read(path)


@pytest.mark.parametrize("suffix", [".h5", ".parquet"])
def test_a_flipped_byte_in_the_samples_is_noticed(tmp_path, suffix):
    path = tmp_path / f"rec{suffix}"
    write(Recording(GYRO, ACCEL, RATE), path)
    content = bytearray(path.read_bytes())
    where = bytes(content).index(GYRO[:1].tobytes() if suffix == ".h5" else GYRO[:2, 0].tobytes())
    content[where + 6] ^= 4
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"rec\.\w+ cannot be read .*damaged"):
        read(path)


LIBRARIES = {".h5": "h5py", ".parquet": "pyarrow", ".bag": "rosbags", ".mcap": "mcap"}


@pytest.mark.parametrize("suffix", LIBRARIES)
def test_without_the_extra_one_message_names_it(tmp_path, monkeypatch, capsys, suffix):
    write(Recording(GYRO, ACCEL, RATE), tmp_path / "rec.csv")
    write(Recording(GYRO, ACCEL, RATE), tmp_path / f"rec{suffix}")
    for name in list(sys.modules):
        if name.split(".")[0] == LIBRARIES[suffix]:
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, LIBRARIES[suffix], None)
    needs = rf"needs {LIBRARIES[suffix]}, which is not installed.*pip install 'gyronorth\[io\]'"
    with pytest.raises(InputError, match=needs):
        read(tmp_path / f"rec{suffix}")
    with pytest.raises(InputError, match=needs):
        write(Recording(GYRO, ACCEL, RATE), tmp_path / f"new{suffix}")
    assert sorted(os.listdir(tmp_path)) == sorted(["rec.csv", f"rec{suffix}"])


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".h5", ".parquet", ".bag", ".db3", ".mcap"])
def test_the_command_line_refuses_a_picture_in_one_message(tmp_path, suffix):
    path = tmp_path / f"photo{suffix}"
    path.write_bytes(PNG)
    for command in (["info"], ["heading", "--json"], ["allan"], ["convert", "-o", str(tmp_path / "out.h5")]):
        result = run(*command, path)
        assert (result.exit_code, result.stdout) == (2, "")
        assert re.search(rf"photo{suffix} (is no|cannot be read)", result.stderr)
        assert "Traceback" not in result.stderr
    assert os.listdir(tmp_path) == [f"photo{suffix}"]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".npz", ".h5", ".parquet", ".bag", ".mcap"])
def test_a_conversion_that_fails_midway_leaves_nothing(tmp_path, monkeypatch, suffix):
    monkeypatch.setattr("gyronorth.cli.recording_commands.CHUNK_SAMPLES", 2000)
    rows = "".join(f"{i / 100},1e-4,1e-4,1e-4\n" for i in range(6_000))
    (tmp_path / "rec.csv").write_text(f"# gyro_unit: rad/s\n# axes: frd\nt,w_x,w_y,w_z\n{rows}0,broken\n")
    (tmp_path / f"out{suffix}").write_text("old")
    result = run("convert", tmp_path / "rec.csv", "-o", tmp_path / f"out{suffix}", "--force")
    assert result.exit_code == 2
    assert "Row 6004 of rec.csv" in result.stderr
    assert sorted(os.listdir(tmp_path)) == sorted({"rec.csv", f"out{suffix}"})
    assert (tmp_path / f"out{suffix}").read_text() == "old"


def run(*arguments: object):
    """Run the command line in process."""
    apart = {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}
    return CliRunner(**apart).invoke(app, [str(argument) for argument in arguments])


def test_two_datasets_that_may_be_one_axis_are_not_mixed(tmp_path):
    path = tmp_path / "rec.h5"
    gyro, accel = still(300)
    with h5py.File(path, "w") as file:
        file["gyro"], file["accel"], file["w_y"] = gyro, accel, gyro[:, 1]
        file.attrs["gyro_unit"], file.attrs["accel_unit"], file.attrs["rate_hz"] = "rad/s", "m/s2", "100"
    with pytest.raises(
        InputError, match=r"rec.h5 has w_y and gyro\[1\], and each of them may be w_y: which one is meant"
    ):
        read(path)
