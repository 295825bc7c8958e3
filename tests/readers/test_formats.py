"""PSINS, MT Manager, .mat and .npz files; which reader opens which file."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from math import degrees, pi, radians

import numpy as np
import pytest
import scipy.io
from numpy.testing import assert_allclose, assert_array_equal
from still import csv_file, csv_rows, rows_of, still

from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.readers import read, recordings_in, write
from gyronorth.readers.mat5 import MatError, is_level5, matrix, variables
from gyronorth.recording import Recording

ARCSEC = pi / 180 / 3600
PSINS_HEAD = "% PSINS-format SIMU log file.\n\n1.5 0.5 -90.6 0 0 0\n34.25 108.9 380 0 10 9.780327\n"
PSINS_SCALE = "0.1 0.1 0.1 125 125 125\n"


def psins_file(folder, text, name="rec.imu"):
    path = folder / name
    path.write_text(text)
    return path


def test_psins_by_hand(tmp_path):
    # Counts (right, front, up); 0.1 arcsec and 125 ug s per count of 10 ms.
    path = psins_file(tmp_path, PSINS_HEAD + PSINS_SCALE + "1 2 -3 8 -16 80\n" * 4)
    recording = read(path)
    # Body axes: forward = front = y, right = x, down = -z.
    assert_allclose(recording.gyro_b[0], np.array([2, 1, 3]) * 0.1 * ARCSEC * 100, rtol=1e-12)
    assert_allclose(recording.accel_b[0], np.array([-16, 8, -80]) * 125e-6 * 9.780327 * 100, rtol=1e-12)
    assert recording.rate_hz == 100
    assert degrees(recording.latitude or 0) == pytest.approx(34.25)
    assert degrees(recording.heading_true or 0) == pytest.approx(90.6)  # yaw there is counter-clockwise
    assert recording.notes == ()


def test_psins_heading_belongs_to_the_front_axis(tmp_path):
    path = psins_file(tmp_path, PSINS_HEAD + PSINS_SCALE + "1 2 -3 8 -16 80\n" * 4)
    assert read(path, axes="+y+x-z").heading_true is not None  # the usual right-front-up, said otherwise
    assert read(path, axes="flu").heading_true is None
    unknown = PSINS_HEAD.replace("1.5 0.5 -90.6", "0 0 0") + PSINS_SCALE + "1 2 -3 8 -16 80\n" * 4
    assert read(psins_file(tmp_path, unknown)).heading_true is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("% only a comment\n", "ends within its header; a line of six numbers is expected: pitch roll yaw"),
        (PSINS_HEAD, "ends within its header; a line of six numbers is expected: three gyro scales in arcsec"),
        (PSINS_HEAD + "0 0 2 0 0 80\n" * 9, r"Row 5 of rec.imu: 0 0 2 0 0 80 are no scale factors. The third header"),
        (PSINS_HEAD + "2 1 7 1 2 80\n" * 9, r"Row 5 of rec.imu: 2 1 7 1 2 80 are no scale factors"),
        (PSINS_HEAD + PSINS_SCALE, "holds no rows of data"),
        (PSINS_HEAD.replace("34.25", "134.25") + PSINS_SCALE, "Row 4 of rec.imu: latitude is 134.25 deg"),
        (PSINS_HEAD.replace("9.780327", "1"), "and g 1 m/s|ends within its header"),
        (PSINS_HEAD.replace(" 10 ", " 0 ") + PSINS_SCALE, "Row 4 of rec.imu: the sampling interval is 0 ms"),
        (PSINS_HEAD.replace(" 380", "") + PSINS_SCALE, "Row 4 of rec.imu is '34.25 108.9 0 10 9.780327'"),
        (PSINS_HEAD + PSINS_SCALE + "1 2 3 4 5 80\n1 2 3 4\n1 2 3 4 5 80\n", "Row 7 of rec.imu: it has 4 fields; 6"),
        (PSINS_HEAD + PSINS_SCALE + "1 2 3 4 5 80\n1 2 3 4 5 x\n1 2 3 4 5 80\n", "Row 7 of rec.imu: az is 'x'"),
        (PSINS_HEAD + PSINS_SCALE + "1 2 3 4 5 80 7\n" * 3, "Row 6 of rec.imu: it has 7 fields; 6 are expected"),
    ],
)
def test_psins_files_that_are_wrong(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read(psins_file(tmp_path, text))


def test_psins_takes_no_columns(tmp_path):
    with pytest.raises(InputError, match=r"columns does not apply to rec.imu"):
        read(psins_file(tmp_path, PSINS_HEAD + PSINS_SCALE), columns={"w_x": 0})


def mt_file(folder, columns, titles, *, comments="// Update Rate: Various\n", tail=""):
    path = folder / "export.txt"
    rows = "".join(row.replace("\n", tail + "\n") for row in rows_of(columns, "\t"))
    path.write_text("// Start Time: Unknown\n" + comments + "\t".join(titles) + "\n" + rows)
    return path


MT_TITLES = ["PacketCounter", "Acc_X", "Acc_Y", "Acc_Z", "Gyr_X", "Gyr_Y", "Gyr_Z", "Yaw"]


def mt_columns(rows, counter=None):
    """An export of the body at rest in forward-left-up axes; the counter steps by 4 and wraps."""
    gyro, accel = still(rows)
    flu = np.array([1, -1, -1])
    counter = (np.arange(rows) * 4 + 65_000) % 65_536 if counter is None else counter
    return [counter.astype(int), accel * flu, gyro * flu, np.zeros(rows)]


def test_mt_manager_export(tmp_path):
    path = mt_file(tmp_path, mt_columns(400), MT_TITLES)
    with pytest.raises(InputError, match=r"counts samples in PacketCounter, not time, and does not state.*--rate"):
        read(path)
    recording = read(path, rate_hz=100)
    assert_array_equal(recording.gyro_b, still(400)[0])
    assert_array_equal(recording.accel_b, still(400)[1])
    assert (recording.rate_hz, recording.gaps) == (100, ())


def test_mt_manager_counter_shows_lost_packets(tmp_path):
    kept = np.setdiff1d(np.arange(600), [100, 140, 141])  # 134 and 135 are where the counter wraps
    columns = [part[kept] for part in mt_columns(600)]
    recording = read(mt_file(tmp_path, columns, MT_TITLES), rate_hz=100)
    assert [(gap.start, gap.samples) for gap in recording.gaps] == [(1.0, 1), (1.4, 2)]
    assert_array_equal(recording.gyro_b[kept], still(600)[0][kept])


def test_mt_manager_rate_from_header_or_fine_time(tmp_path):
    stated = mt_file(tmp_path, mt_columns(50), MT_TITLES, comments="// Update Rate: 100.0Hz\n", tail="\t")
    assert read(stated).rate_hz == 100
    # Ticks of 0.1 ms that start again from 0 after 2^32.
    ticks = (np.arange(50) * 25 + 2**32 - 500) % 2**32
    fine = mt_file(tmp_path, [ticks.astype(int), *mt_columns(50)], ["SampleTimeFine", *MT_TITLES])
    recording = read(fine)
    assert (recording.rate_hz, recording.gaps) == (400, ())
    with pytest.raises(InputError, match=r"SampleTimeFine of export.txt gives a rate of 400 Hz, but 100 Hz"):
        read(fine, rate_hz=100)


def test_mt_manager_gyro_only_and_wrong_files(tmp_path):
    columns = mt_columns(50)
    assert read(mt_file(tmp_path, columns[0::2], ["PacketCounter", *MT_TITLES[4:7]]), rate_hz=10).accel_b is None
    with pytest.raises(InputError, match=r"has no column w_x, w_y, w_z: its columns are PacketCounter, Acc_X"):
        read(mt_file(tmp_path, columns[:2], MT_TITLES[:4]), rate_hz=10)
    path = tmp_path / "export.txt"
    path.write_text("// Start Time: Unknown\nPacketCounter,Gyr_X,Gyr_Y\n1,2,3\n")
    with pytest.raises(InputError, match=r"Row 2 of export.txt, the header, has no tabs"):
        read(path)
    path.write_text("// Start Time: Unknown\n")
    with pytest.raises(InputError, match="ends before its header"):
        read(path)
    path.write_text("// Update Rate: 0Hz\nPacketCounter\n")
    with pytest.raises(InputError, match=r"Row 1 of export.txt: Update Rate is '0'"):
        read(path)


MAT_OPTIONS = {
    "columns": {"t": 0, "w_x": 2, "w_y": 3, "w_z": 4, "f_x": "6", "f_y": "7", "f_z": "8"},
    "gyro_unit": "deg/s",
    "accel_unit": "g",
}


def mat_bytes(arrays, **how):
    file = io.BytesIO()
    scipy.io.savemat(file, arrays, **how)
    return file.getvalue()


def imu_table(rows=300):
    gyro, accel = still(rows)
    time = np.arange(rows)[:, None] / 125
    ones = np.ones((rows, 1))
    return np.hstack([time, ones, np.degrees(gyro), ones, accel / STANDARD_GRAVITY])


@pytest.mark.parametrize("compressed", [True, False])
def test_mat_with_named_variable_and_columns(tmp_path, compressed):
    path = tmp_path / "rec.mat"
    path.write_bytes(mat_bytes({"info": "text", "data": imu_table(), "k": np.eye(3)}, do_compression=compressed))
    recording = read(path, variable="data", **MAT_OPTIONS)
    assert_allclose(recording.gyro_b, still(300)[0], rtol=1e-14)
    assert_allclose(recording.accel_b, still(300)[1], rtol=1e-14)
    assert recording.rate_hz == pytest.approx(125)


def test_mat_names_the_row_of_the_variable(tmp_path):
    table = imu_table()
    table[41, 3] = np.nan
    path = tmp_path / "rec.mat"
    path.write_bytes(mat_bytes({"data": table}))
    with pytest.raises(InputError, match=r"Row 42 of rec.mat: w_y is nan"):
        read(path, **MAT_OPTIONS)
    assert read(path, drop_bad_rows=True, **MAT_OPTIONS).rows_dropped == 1


@pytest.mark.parametrize(
    ("arrays", "options", "message"),
    [
        (
            {"a": imu_table(9), "b": imu_table(9)},
            {},
            r"holds a \(9x9 double\), b \(9x9 double\); say.*--variable",
        ),
        ({"a": imu_table(9)}, {"variable": "data"}, r"has no variable 'data'; it holds a \(9x9 double\)"),
        ({"a": "text"}, {"variable": "a"}, "Variable a of rec.mat is a 1x4 char; a matrix of numbers"),
        ({"a": {"b": "x"}}, {"variable": "a.b"}, "is a 1x1 char"),
        ({"a": imu_table(9) * 1j}, {"variable": "a"}, "is a 9x9 complex double"),
        ({"a": imu_table(9) > 0}, {"variable": "a"}, "is a 9x9 logical"),
        ({"a": np.zeros((4, 5, 6))}, {"variable": "a"}, "is a 4x5x6 double"),
        ({"a": imu_table()}, {"columns": None}, r"has 9 columns without names"),
        ({"a": imu_table()}, {"columns": {"w_x": 9, "w_y": 1, "w_z": 2}}, "columns are numbered 0 to 8"),
        ({"a": imu_table()}, {"columns": {"w_x": "gx"}}, r"columns says w_x=gx, but rec.mat has no such.* a\[0\]"),
    ],
)
def test_mat_files_that_do_not_fit(tmp_path, arrays, options, message):
    path = tmp_path / "rec.mat"
    path.write_bytes(mat_bytes(arrays))
    with pytest.raises(InputError, match=message):
        read(path, **(MAT_OPTIONS | options))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x89HDF\r\n\x1a\n" + bytes(200), "cannot be read .*: it is damaged, cut off, or no HDF5 file"),
        (mat_bytes({"a": imu_table(9)}, format="4"), r"not a MATLAB file of version 5 to 7.3.*'-v7'"),
        (b"MATLAB", "not a MATLAB file"),
        (mat_bytes({"a": imu_table()})[:-100], r"cannot be read, the element at byte 128 claims \d+ bytes"),
        (mat_bytes({"a": imu_table()}) + b"junk", "cannot be read, 4 bytes behind the last element"),
    ],
)
def test_mat_files_of_other_versions_or_cut_off(tmp_path, content, message):
    path = tmp_path / "rec.mat"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read(path, **MAT_OPTIONS)


@pytest.mark.parametrize("dtype", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"])
@pytest.mark.parametrize("compressed", [True, False])
def test_matrices_agree_with_scipy(dtype, compressed):
    rng = np.random.default_rng(4)
    arrays = {
        "long_name_of_a_matrix": rng.integers(0, 100, (37, 5)).astype(dtype),
        "x": rng.normal(0, 50, (3, 2)).astype(dtype) if dtype[0] != "u" else np.ones((3, 2), dtype),
        "small": np.array([[7]], dtype),
        "none": np.zeros((0, 4), dtype),
        "whole": np.arange(6.0).reshape(3, 2),  # MATLAB packs doubles that are whole into bytes
    }
    content = mat_bytes(arrays, do_compression=compressed)
    assert is_level5(content)
    expected = scipy.io.loadmat(io.BytesIO(content))
    found = variables(content)
    assert list(found) == list(arrays)
    for name in arrays:
        assert_array_equal(matrix(content, found[name]), expected[name].astype(float))
        assert found[name].shape == expected[name].shape


def test_matrix_packed_into_bytes_and_of_the_other_byte_order():
    """A big-endian file by hand: doubles stored as int8, as MATLAB does to save space."""
    body = struct.pack(">II4s4x", 6, 8, struct.pack(">I", 6)) + struct.pack(">IIii", 5, 8, 2, 3)
    body += struct.pack(">HH4s", 1, 1, b"m") + struct.pack(">II6b2x", 1, 6, 1, 2, 3, -4, 5, 6)
    content = b"by hand".ljust(124) + b"\x01\x00MI" + struct.pack(">II", 14, len(body)) + body
    assert_array_equal(scipy.io.loadmat(io.BytesIO(content))["m"], [[1, 3, 5], [2, -4, 6]])
    assert_array_equal(matrix(content, variables(content)["m"]), [[1, 3, 5], [2, -4, 6]])


@pytest.mark.parametrize("compressed", [True, False])
def test_a_matrix_that_claims_to_be_huge_allocates_nothing(compressed):
    content = bytearray(mat_bytes({"m": np.arange(12.0).reshape(4, 3) + 0.5}))
    place = content.find(struct.pack("<ii", 4, 3))
    content[place : place + 8] = struct.pack("<ii", 2**30, 2**30)
    element = bytes(content[128:])
    if compressed:
        packed = zlib.compress(element)
        content[128:] = struct.pack("<II", 15, len(packed)) + packed
    found = variables(bytes(content))
    with pytest.raises(MatError, match="more than the file can hold"):
        matrix(bytes(content), found["m"])


def npz_file(folder, **change):
    gyro, accel = still(300)
    arrays = {"schema": "gyronorth.recording/1", "gyro_b": gyro, "accel_b": accel, "rate_hz": 100.0} | change
    path = folder / "rec.npz"
    np.savez(path, **{key: value for key, value in arrays.items() if value is not None})
    return path


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": None}, "does not say in which unit w_x, w_y, w_z are"),
        ({"schema": "other/2"}, "is an .npz file whose schema is not 'gyronorth.recording/1'"),
        ({"schema": 3}, "schema is '3'; one text is expected"),
        ({"gyro_b": None}, "has no gyro_b or no rate_hz"),
        ({"rate_hz": None}, "has no gyro_b or no rate_hz"),
        ({"rate_hz": np.ones(3)}, "rate_hz is .*; one finite number is expected"),
        ({"rate_hz": -5.0}, "rate_hz is -5; a sample rate of"),
        ({"rate_hz": np.nan}, "one finite number is expected"),
        ({"latitude": 32.11}, "latitude is 32.11 rad, 1839.77 deg"),
        ({"gyro_b": np.zeros((300, 2))}, r"gyro_b has shape \(300, 2\)"),
        ({"gyro_b": np.zeros((300, 3), complex)}, "gyro_b has shape .* and type complex128"),
        ({"gyro_b": np.array([{}], dtype=object)}, "gyro_b of rec.npz holds pickled Python objects"),
        ({"accel_b": np.zeros((7, 3))}, "gyro_b has 300 samples, accel_b 7"),
        ({"gaps": np.zeros(3)}, r"gaps has shape \(3,\)"),
        ({"start_time_utc": "noon"}, "start_time_utc is 'noon'"),
    ],
)
def test_npz_files_that_do_not_fit(tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        read(npz_file(tmp_path, **change))


def test_npz_that_is_no_archive_or_claims_to_be_huge(tmp_path):
    path = npz_file(tmp_path)
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(InputError, match=r"rec.npz cannot be read \(File is not a zip file\)"):
        read(path)
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 3)})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("gyro_b.npy", header.getvalue() + bytes(800))
    with pytest.raises(InputError, match="gyro_b is not the array of numbers or text that its header claims"):
        read(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("gyro_b.npy", bytes(3_000_000))  # deflates to 3 kB: more than a file of numbers would
    content = bytearray(path.read_bytes())
    for place in (content.find(b"PK\x03\x04") + 22, content.find(b"PK\x01\x02") + 24):
        content[place : place + 4] = struct.pack("<I", 2**31)
    path.write_bytes(content)
    with pytest.raises(InputError, match="gyro_b claims 2147483648 bytes, which the file cannot hold"):
        read(path)


def test_npz_takes_neither_columns_nor_increments(tmp_path):
    with pytest.raises(InputError, match=r"columns does not apply to rec.npz"):
        read(npz_file(tmp_path), columns={"w_x": 0})
    with pytest.raises(InputError, match="was written by gyronorth and holds rates; leave --increments out"):
        read(npz_file(tmp_path), increments=True)


def test_format_by_content_where_the_suffix_does_not_say(tmp_path):
    gyro, accel = still(300)
    recording = Recording(gyro, accel, 100.0)
    write(recording, tmp_path / "rec.npz")
    write(recording, tmp_path / "rec.csv")
    mt_file(tmp_path, mt_columns(300), MT_TITLES, comments="// Update Rate: 100Hz\n")
    psins_file(tmp_path, PSINS_HEAD + PSINS_SCALE + "1 2 -3 8 -16 80\n" * 4)
    (tmp_path / "rec.mat").write_bytes(mat_bytes({"data": imu_table()}))
    lengths = {}
    for source in ("rec.npz", "rec.csv", "export.txt", "rec.imu", "rec.mat"):
        other = (tmp_path / source).rename(tmp_path / "recording.dat")
        lengths[source] = len(read(other, **(MAT_OPTIONS if source == "rec.mat" else {})).gyro_b)
    assert lengths == {"rec.npz": 300, "rec.csv": 300, "export.txt": 300, "rec.imu": 4, "rec.mat": 300}
    assert len(read(other, format="mat", **MAT_OPTIONS).gyro_b) == 300


def test_recordings_in_a_folder_in_natural_order(tmp_path):
    names = ["Train/x_100.0.csv", "Train/x_8.0.csv", "Train/x_15.0.csv", "Test/x_20.0.csv", "a.imu", "b.MAT"]
    others = ["README.md", "notes.txt", ".hidden.csv", ".git/x_1.0.csv", "plot.png"]
    for name in names + others:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("-")
    (tmp_path / "export.txt").write_text("// Start Time: Unknown\n")
    found = [str(path.relative_to(tmp_path)) for path in recordings_in(tmp_path)]
    assert found == [
        "Test/x_20.0.csv", "Train/x_8.0.csv", "Train/x_15.0.csv", "Train/x_100.0.csv", "a.imu", "b.MAT", "export.txt",
    ]  # fmt: skip


def test_folders_without_recordings(tmp_path):
    with pytest.raises(InputError, match="holds no recordings"):
        recordings_in(tmp_path)
    with pytest.raises(InputError, match="is not a folder"):
        recordings_in(csv_file(tmp_path, csv_rows(3)))


def test_latitude_of_the_header_against_the_given_one(tmp_path):
    path = psins_file(tmp_path, PSINS_HEAD + PSINS_SCALE + "1 2 -3 8 -16 80\n" * 4)
    assert read(path, latitude=radians(34.3)).latitude == radians(34.3)
    with pytest.raises(InputError, match=r"states latitude 34.2500 deg; 35.0000 deg is given"):
        read(path, latitude=radians(35))
