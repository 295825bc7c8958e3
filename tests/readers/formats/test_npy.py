"""NumPy arrays of others; pickled objects are never loaded."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.readers import describe, read

ROWS, RATE = 400, 100.0
SI = {"gyro_unit": "rad/s", "accel_unit": "m/s2"}
RNG = np.random.default_rng(6)
TIME = np.arange(ROWS) / RATE
GYRO = RNG.normal([3e-5, -4e-5, -5e-5], 1e-6, (ROWS, 3))
ACCEL = RNG.normal([0.0, 0.0, -9.80665], 1e-3, (ROWS, 3))
TABLE = np.column_stack([TIME, GYRO, ACCEL])
NAMES = ("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z")
COLUMNS = dict(zip(NAMES, range(7), strict=True))


def check(recording):
    assert recording.rate_hz == pytest.approx(RATE)
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-12)
    assert_allclose(recording.accel_b, ACCEL, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("order", ["C", "F"])
def test_a_matrix_by_the_numbers_of_its_columns(tmp_path, order):
    np.save(tmp_path / "rec.npy", np.asarray(TABLE, order=order))
    with pytest.raises(InputError, match=r"array of rec.npy has 7 columns without names"):
        read(tmp_path / "rec.npy", **SI)
    check(read(tmp_path / "rec.npy", columns=COLUMNS, **SI))
    np.save(tmp_path / "turned.npy", np.asarray(TABLE.T, order=order))
    check(read(tmp_path / "turned.npy", columns=COLUMNS, **SI))


def test_records_by_the_names_of_their_fields(tmp_path):
    records = np.zeros(ROWS, [(name, float) for name in NAMES] + [("state", "U4")])
    for name, column in zip(NAMES, TABLE.T, strict=True):
        records[name] = column
    np.save(tmp_path / "rec.npy", records)
    check(read(tmp_path / "rec.npy", **SI))
    triples = np.zeros(ROWS, [("stamp", "M8[ns]"), ("gyro", "f8", 3), ("accel", "f8", 3)])
    triples["gyro"], triples["accel"] = GYRO, ACCEL
    triples["stamp"] = np.datetime64("2024-03-01T12:00", "ns") + np.rint(TIME * 1e9).astype("m8[ns]")
    np.save(tmp_path / "triples.npy", triples)
    check(read(tmp_path / "triples.npy", **SI))


def test_an_archive_of_named_arrays(tmp_path):
    np.savez_compressed(tmp_path / "rec.npz", t=TIME, gyro=GYRO, accel=ACCEL, note="text")
    with pytest.raises(InputError, match="does not say in which unit w_x, w_y, w_z are"):
        read(tmp_path / "rec.npz")
    check(read(tmp_path / "rec.npz", **SI))
    np.savez(tmp_path / "wide.npz", imu=TABLE, gps=np.zeros((9, 3)))
    check(read(tmp_path / "wide.npz", columns=COLUMNS, **SI))
    check(read(tmp_path / "wide.npz", variable="imu", columns=COLUMNS, **SI))
    np.savez(tmp_path / "two.npz", a=TABLE, b=TABLE)
    with pytest.raises(InputError, match=r"two.npz holds a \(400, 7\), b \(400, 7\); say which one with --variable"):
        read(tmp_path / "two.npz", columns=COLUMNS, **SI)


class Trap:
    def __reduce__(self):
        return pytest.fail, ("a pickle was loaded",)


def test_pickled_objects_are_refused_and_never_loaded(tmp_path):
    objects = np.array([Trap()], dtype=object)
    np.save(tmp_path / "rec.npy", objects, allow_pickle=True)
    np.savez(tmp_path / "rec.npz", t=TIME, gyro=objects)
    (tmp_path / "rec.pkl").write_bytes(pickle.dumps({"gyro": Trap()}))
    (tmp_path / "rec.dat").write_bytes(pickle.dumps({"gyro": Trap()}, protocol=2))
    (tmp_path / "old.pickle").write_bytes(pickle.dumps({"gyro": Trap()}, protocol=0))
    for name in ("rec.npy", "rec.npz", "rec.pkl", "rec.dat", "old.pickle"):
        with pytest.raises(InputError, match="holds pickled Python objects, which may run any program"):
            read(tmp_path / name, **SI)


def test_cut_off_files_and_places_of_a_long_one(tmp_path):
    rows = 2_000_000
    table = np.zeros((rows, 7), "f4")
    table[:, 3], table[:, 6] = -5e-5, -9.8
    table[:, 1] = np.arange(rows) % 7 * 1e-6
    np.save(tmp_path / "long.npy", table)
    how = SI | {"columns": COLUMNS | {"t": "-"}, "rate_hz": RATE}
    described = describe(tmp_path / "long.npy", **how)
    assert described.samples == rows
    assert described.estimate is not None
    assert described.rate_mean == pytest.approx([3e-6, 0.0, -5e-5], rel=1e-3)
    content = (tmp_path / "long.npy").read_bytes()
    (tmp_path / "cut.npy").write_bytes(content[:100_000])
    with pytest.raises(InputError, match=r"claims an array \(2000000, 7\) of 4 bytes each but holds \d+ bytes: it"):
        read(tmp_path / "cut.npy", **how)
    (tmp_path / "head.npy").write_bytes(content[:40])
    with pytest.raises(InputError, match=r"head.npy cannot be read .*no .npy file"):
        read(tmp_path / "head.npy", **how)


def test_titles_with_units_need_no_declaration_and_numbers_are_asked_about(tmp_path):
    titles = ["time_ms", "gx_dps", "gy_dps", "gz_dps", "acc_x_g", "acc_y_g", "acc_z_g"]
    records = np.zeros(ROWS, [(title, float) for title in titles])
    for title, column in zip(titles, (TIME * 1e3, *np.degrees(GYRO).T, *ACCEL.T / 9.80665), strict=True):
        records[title] = column
    np.save(tmp_path / "rec.npy", records)
    check(read(tmp_path / "rec.npy"))
    np.save(tmp_path / "bare.npy", TABLE)
    with pytest.raises(InputError, match=r"column 0 is like a clock, columns 1 to 3 like angular rate") as caught:
        read(tmp_path / "bare.npy")
    assert "--columns t=0,w_x=1,w_y=2,w_z=3,f_x=4,f_y=5,f_z=6" in str(caught.value).splitlines()[-1]


def test_a_clock_in_another_unit_is_told_by_its_steps(tmp_path):
    stamps = 1_700_000_000_000_000_000 + np.rint(TIME * 1e9).astype(np.int64)
    np.savez(tmp_path / "rec.npz", timestamp=stamps, gyro=GYRO, accel=ACCEL)
    recording = read(tmp_path / "rec.npz", **SI)
    assert recording.rate_hz == pytest.approx(RATE, rel=1e-3)


def test_units_behind_the_names_of_arrays_count_as_stated(tmp_path):
    path = tmp_path / "units.npz"
    np.savez(path, time_us=np.rint(1e6 * TIME), gyro_dps=np.degrees(GYRO), acc_g=ACCEL / 9.80665)
    recording = read(path, axes="frd")
    assert recording.rate_hz == pytest.approx(100)
    assert_allclose(recording.gyro_b, GYRO, atol=1e-12)
    assert_allclose(recording.accel_b, ACCEL, atol=1e-9)


@pytest.mark.parametrize("kind", ["S0", "V0", "U0"])
def test_an_array_of_nothing_takes_no_memory(tmp_path, kind):
    """A million million texts of no character are no byte of a file; NumPy would give each one."""
    header = f"{{'descr': '|{kind}', 'fortran_order': False, 'shape': (1000000000000,), }}\n".encode()
    (tmp_path / "rec.npy").write_bytes(b"\x93NUMPY\x01\0" + len(header).to_bytes(2, "little") + header)
    with pytest.raises(InputError, match=r"rec.npy holds an array \(1000000000000,\) of .[SVU]0; an array of numbers"):
        read(tmp_path / "rec.npy", **SI)
