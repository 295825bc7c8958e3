"""MATLAB files as people have them: structs, separate variables, transposed and text."""

from __future__ import annotations

import io
import struct

import h5py
import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from gyronorth.errors import InputError
from gyronorth.readers import ReadOptions, describe, read
from gyronorth.readers.mat5 import fields, matrix, variables
from gyronorth.readers.registry import open_source

ROWS, RATE = 400, 100.0
SI = {"gyro_unit": "rad/s", "accel_unit": "m/s2"}
RNG = np.random.default_rng(5)
TIME = np.arange(ROWS) / RATE
GYRO = RNG.normal([3e-5, -4e-5, -5e-5], 1e-6, (ROWS, 3))
ACCEL = RNG.normal([0.0, 0.0, -9.80665], 1e-3, (ROWS, 3))


def saved(path, arrays, **how):
    scipy.io.savemat(path, arrays, **how)
    return path


def check(recording, *, gyro=GYRO, accel=ACCEL):
    assert recording.rate_hz == pytest.approx(RATE)
    assert_allclose(recording.gyro_b, gyro, rtol=1e-9, atol=1e-15)
    assert_allclose(recording.accel_b, accel, rtol=1e-9, atol=1e-12)


NAVEGO = {"t": TIME[:, None], "fb": ACCEL, "wb": GYRO, "freq": RATE, "arw": np.zeros((1, 3)), "note": "static"}


@pytest.mark.parametrize("compressed", [True, False])
def test_a_struct_of_navego_needs_no_declaration(tmp_path, compressed):
    path = saved(tmp_path / "rec.mat", {"imu1": NAVEGO, "about": "text"}, do_compression=compressed)
    recording = read(path)
    check(recording)
    assert describe(path).info.axes == "frd"


def test_one_of_two_structs_is_asked_for_and_a_nested_one_is_found(tmp_path):
    path = saved(tmp_path / "rec.mat", {"imu1": NAVEGO, "imu2": NAVEGO | {"wb": 2 * GYRO}})
    with pytest.raises(InputError, match=r"2 arrays of angular rates: imu1.wb, imu2.wb.*--variable imu1"):
        read(path)
    check(read(path, variable="imu2"), gyro=2 * GYRO)
    check(read(saved(tmp_path / "deep.mat", {"s": {"run": {"imu": NAVEGO, "n": 3.0}}}), variable="s.run"))


def test_the_rate_beside_the_arrays_stands_where_no_time_does(tmp_path):
    gyro_only = {name: NAVEGO[name] for name in ("fb", "wb", "freq")}
    check(read(saved(tmp_path / "rec.mat", {"imu": gyro_only})))
    check(read(saved(tmp_path / "ts.mat", {"imu": {"fb": ACCEL, "wb": GYRO, "ts": 1 / RATE}})))


def test_a_matrix_of_psins_holds_increments_and_ends_in_time(tmp_path):
    flip = np.array([1, 1, -1])
    imu = np.column_stack([GYRO[:, [1, 0, 2]] * flip / RATE, ACCEL[:, [1, 0, 2]] * flip / RATE, TIME + 1 / RATE])
    path = saved(tmp_path / "rec.mat", {"trj": {"imu": imu, "ts": 0.01, "avp0": np.zeros((9, 1))}})
    check(read(path))
    assert "read as PSINS: trj.imu holds increments" in open_source(path, ReadOptions()).read_as
    # Seven columns called imu that begin with the time are another layout.
    other = saved(tmp_path / "other.mat", {"imu": np.column_stack([TIME, GYRO, ACCEL])})
    with pytest.raises(InputError, match="has 7 columns without names"):
        read(other)


@pytest.mark.parametrize(
    "names", [("t", "gyro", "acc"), ("time", "omega_ib_b", "f_ib_b"), ("Time", "Gyroscope", "Accel1")]
)
def test_separate_variables_go_by_their_names_but_their_units_are_asked_for(tmp_path, names):
    path = saved(tmp_path / "rec.mat", dict(zip(names, (TIME[:, None], GYRO, ACCEL), strict=True)))
    with pytest.raises(InputError, match="does not say in which unit w_x, w_y, w_z are"):
        read(path)
    check(read(path, **SI))


def test_samples_in_columns_are_turned_and_told(tmp_path):
    path = saved(tmp_path / "rec.mat", {"data": np.column_stack([TIME, GYRO, ACCEL]).T})
    columns = dict(zip(("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z"), range(7), strict=True))
    check(read(path, columns=columns, **SI))
    told = open_source(path, ReadOptions(columns=columns)).read_as
    assert told.startswith("gyro: 1 to 3; acceleration: 4 to 6; clock: 0; samples stand in the columns of data")
    separate = saved(tmp_path / "two.mat", {"t": TIME[None, :], "gyro": GYRO.T, "acc": ACCEL.T})
    check(read(separate, **SI))


def test_structs_of_version_7_3_are_read_like_those_of_version_7(tmp_path):
    with h5py.File(tmp_path / "rec.mat", "w", userblock_size=512) as file:
        for name, values in (("t", TIME[:, None]), ("fb", ACCEL), ("wb", GYRO), ("freq", np.array([[RATE]]))):
            file[f"imu1/{name}"] = values.T
            file[f"imu1/{name}"].attrs["MATLAB_class"] = np.bytes_("double")
    with (tmp_path / "rec.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    check(read(tmp_path / "rec.mat"))
    told = open_source(tmp_path / "rec.mat", ReadOptions()).read_as
    assert told.startswith("read as NaveGo: rad/s, m/s2, forward-right-down; gyro: imu1/wb[0] to imu1/wb[2]")
    assert "samples stand" not in told


def test_a_text_with_that_suffix_goes_to_the_reader_of_texts(tmp_path):
    np.savetxt(tmp_path / "rec.mat", np.column_stack([TIME, GYRO, ACCEL]), fmt="%.17g", delimiter=",")
    columns = dict(zip(("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z"), range(7), strict=True))
    check(read(tmp_path / "rec.mat", columns=columns, **SI))


NAMES = st.text("abcdefgh_", min_size=1, max_size=20).filter(lambda name: name[0] != "_")
MEMBERS = st.recursive(
    st.integers(0, 4).map(lambda n: np.arange(3.0 * n).reshape(n, 3)) | st.just("text") | st.just(np.ones((2, 2)) > 0),
    lambda inner: st.dictionaries(NAMES, inner, min_size=1, max_size=4),
    max_leaves=6,
)


@pytest.mark.slow
@given(st.dictionaries(NAMES, MEMBERS, min_size=1, max_size=3), st.booleans())
def test_structs_agree_with_scipy(tree, compressed):
    """Every matrix of numbers in any tree of structs, by its path."""
    file = io.BytesIO()
    scipy.io.savemat(file, tree, do_compression=compressed)
    content = file.getvalue()
    found = variables(content)
    for variable in list(found.values()):
        if variable.kind == "struct":
            found |= fields(content, variable, most=1 << 20)

    def walk(path, node):
        if isinstance(node, dict):
            for name, inner in node.items():
                walk(f"{path}.{name}" if path else name, inner)
        elif isinstance(node, np.ndarray) and node.dtype == float:
            assert_array_equal(matrix(content, found[path]), node)
        else:
            assert not found[path].numeric

    walk("", tree)


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def mcos(name, kind):
    """An object as MATLAB saves it: flags, name, system and class; what is in it stands elsewhere."""
    parts = element(6, struct.pack("<II", 17, 0)) + element(1, name) + element(1, b"MCOS") + element(1, kind)
    return element(
        14, parts + element(14, element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 0, 0)))
    )


@pytest.mark.parametrize(
    ("kinds", "cure"),
    [
        ((b"timetable",), "writetimetable(gyro, 'imu.csv')"),
        ((b"timetable", b"timetable"), "writetimetable(synchronize(gyro, accel, 'first', 'linear'), 'imu.csv')"),
        ((b"table",), "writetable(gyro, 'imu.csv')"),
        ((b"timeseries",), "data = gyro.Data"),
        ((b"Odometry",), "put what is in it into matrices"),
    ],
)
def test_objects_of_matlab_are_named_with_what_to_do_there(tmp_path, kinds, cure):
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path = tmp_path / "rec.mat"
    path.write_bytes(head + b"".join(mcos(name, kind) for name, kind in zip((b"gyro", b"accel"), kinds, strict=False)))
    with pytest.raises(InputError) as refused:
        read(path)
    assert f"rec.mat holds gyro ({kinds[0].decode()})" in str(refused.value)
    assert cure in str(refused.value)


def test_what_version_7_3_keeps_of_objects_without_names_is_never_read(tmp_path):
    with h5py.File(tmp_path / "rec.mat", "w", userblock_size=512) as file:
        table = file.create_dataset("imu", data=np.zeros((1, 6), dtype=np.uint32))
        table.attrs["MATLAB_class"], table.attrs["MATLAB_object_decode"] = np.bytes_(b"table"), np.int32(3)
        file["#refs#/a"], file["#refs#/b"] = GYRO, TIME
    with pytest.raises(InputError, match=r"writetable\(imu, 'imu.csv'\)"):
        read(tmp_path / "rec.mat")


def test_units_in_attributes_of_hdf5_are_stated(tmp_path):
    with h5py.File(tmp_path / "rec.h5", "w") as file:
        arrays = (
            ("time", TIME, "seconds since 1970-01-01"),
            ("gyro", np.degrees(GYRO), "deg/s"),
            ("acc", ACCEL, "m s-2"),
        )
        for name, values, unit in arrays:
            file.create_dataset(f"imu/{name}", data=values).attrs["units"] = unit
    check(read(tmp_path / "rec.h5", axes="frd"))
