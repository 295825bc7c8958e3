"""Texts that are no tables: JSON, names with their values, lists in brackets, GnssLogger's own files."""

from __future__ import annotations

import json
from datetime import datetime, timedelta

import numpy as np
import pytest
from cases.layouts import ACCEL, DPS, FLU, GYRO, TIME
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.readers import ReadOptions, read

SAID = ReadOptions(axes="frd", gyro_unit="deg/s", accel_unit="m/s2")
ROWS = np.column_stack([TIME, DPS, ACCEL]).tolist()
START = datetime(2024, 3, 1, 11, 58)


def xyz(values):
    return dict(zip("xyz", values, strict=True))


def lines(of_row):
    return "\n".join(of_row(*row) for row in ROWS) + "\n"


def labelled(form):
    return lines(lambda *row: form.format(*row))


def objects(of_row):
    return lines(lambda *row: json.dumps(of_row(*row)))


FILES = {
    "nested.jsonl": objects(lambda t, *v: {"ts": t, "gyro": xyz(v[:3]), "acc": xyz(v[3:]), "ok": True}),
    "flat.log": objects(lambda t, *v: {"time": t, **{f"g{a}": w for a, w in xyz(v[:3]).items()},
                                       **{f"a{a}": f for a, f in xyz(v[3:]).items()}, "note": 'a, "b"'}),
    "lists.ndjson": objects(lambda t, *v: {"timestamp": (START + timedelta(seconds=t)).isoformat(
        timespec="milliseconds") + "Z", "gyro": v[:3], "accel": v[3:]}),
    "array.json": json.dumps([{"t": row[0], "w": xyz(row[1:4]), "f": xyz(row[4:])} for row in ROWS], indent=1),
    "one_line.json": json.dumps([{"t": row[0], "w": row[1:4], "f": row[4:]} for row in ROWS]),
    "blanks.txt": labelled("ts: {} gx: {} gy: {} gz: {} ax: {} ay: {} az: {}"),
    "equals.txt": "boot\n" + labelled("t={}; gx={:.9e}; gy={:.9e}; gz={:.9e}; ax={}; ay={}; az={}"),
    "triples.txt": labelled("t: {} Gyro: {}, {}, {} Acc: {}, {}, {}"),
    "brackets.txt": "t,gx,gy,gz,ax,ay,az\n" + lines(lambda *v: f"[{', '.join(map(repr, v))}],"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_what_is_no_table_is_read_as_one(tmp_path, name):
    path = tmp_path / name
    path.write_text(FILES[name])
    recording = read(path, SAID)
    assert recording.rate_hz == pytest.approx(100)
    assert_allclose(np.degrees(recording.gyro_b), DPS, rtol=0, atol=1e-9)
    assert_allclose(recording.accel_b, ACCEL, rtol=0, atol=1e-6)
    assert recording.source == name


@pytest.mark.parametrize("name", ["array.json", "one_line.json", "nested.jsonl", "blanks.txt"])
def test_what_is_taken_piece_by_piece_is_the_same(tmp_path, name, monkeypatch):
    path = tmp_path / name
    path.write_text(FILES[name].replace("\n", "\n" * 3000, 2) if name == "nested.jsonl" else FILES[name])
    for module in ("lines", "json_table"):
        monkeypatch.setattr(
            f"gyronorth.readers.{module}.PIECE", 1009
        )  # characters, so that objects are cut wherever they may be
    assert_allclose(np.degrees(read(path, SAID).gyro_b), DPS, rtol=0, atol=1e-9)


def test_objects_of_other_kinds_give_no_numbers(tmp_path):
    path = tmp_path / "mixed.jsonl"
    odd = {"ts": ROWS[50][0], "gyro": "123", "acc": [1, 2, 3]}
    rows = [json.dumps({"ts": row[0], "gyro": row[1:4], "acc": row[4:]}) for row in ROWS]
    path.write_text("\n".join([*rows[:50], json.dumps(odd), *rows[51:]]) + "\n")
    with pytest.raises(InputError, match="Row 52"):
        read(path, SAID)


def test_the_own_files_of_gnss_logger(tmp_path):
    header = ["# Header Description:", "# Raw,utcTimeMillis,TimeNanos"]
    for kind, unit in (("Accel", "Mps2"), ("Gyro", "RadPerSec")):
        fields = ",".join(f"Uncal{kind}{axis}{unit}" for axis in "XYZ")
        header.append(f"# Uncal{kind},utcTimeMillis,elapsedRealtimeNanos,{fields},BiasX,BiasY,BiasZ")
    rows = []
    for i, (gyro, accel) in enumerate(zip((GYRO * FLU).tolist(), (ACCEL * FLU).tolist(), strict=True)):
        stamp = f"{17 * 10**11 + 10 * i + i % 7},{10**14 + i * 10**7}"  # the host is late, the sensor is not
        rows += [f"UncalAccel,{stamp},{accel[0]!r},{accel[1]!r},{accel[2]!r},0,0,0"]
        rows += [f"UncalGyro,{stamp},{gyro[0]!r},{gyro[1]!r},{gyro[2]!r},0,0,0", f"Raw,{stamp}"]
    path = tmp_path / "gnss_log.txt"
    path.write_text("\n".join([*header, *rows]) + "\n")
    recording = read(path, ReadOptions(axes="flu"))
    assert recording.rate_hz == pytest.approx(100)
    assert_allclose(recording.gyro_b, GYRO, rtol=0, atol=1e-15)
    assert_allclose(recording.accel_b, ACCEL, rtol=0, atol=1e-9)


def test_lines_of_two_sensors_in_turn_are_refused(tmp_path):
    path = tmp_path / "turns.txt"
    path.write_text(labelled("t: {} gx: {} gy: {} gz: {}\nax: {} ay: {} az: {}"))
    with pytest.raises(InputError, match="lines of different names: t gx gy gz; ax ay az"):
        read(path, SAID)


@pytest.mark.parametrize(
    ("name", "cut"), [("nested.jsonl", 9), ("array.json", 9), ("one_line.json", 9), ("blanks.txt", 20)]
)
def test_a_file_that_is_cut_off_is_refused_in_one_message(tmp_path, name, cut):
    path = tmp_path / name
    path.write_text(FILES[name][:-cut])
    with pytest.raises(InputError, match="cut off"):
        read(path, SAID)


def test_rows_of_a_tidy_table_that_are_not_whole_are_bad_rows(tmp_path):
    rows = [f"{t:.2f},{axis},{x:.6f}\n" for t in np.arange(100) / 10 for axis, x in zip(
        ("gx_dps", "gy_dps", "gz_dps"), (0.1, 0.2, 0.3), strict=True)]  # fmt: skip
    path = tmp_path / "tidy.csv"
    path.write_text("time_s,channel,value\n" + "".join(rows))
    assert read(path, axes="frd").gyro_b.shape == (100, 3)
    del rows[151]
    path.write_text("time_s,channel,value\n" + "".join(rows))
    with pytest.raises(InputError, match="--drop-bad-rows"):
        read(path, axes="frd")
    recording = read(path, axes="frd", drop_bad_rows=True)
    assert (len(recording.gyro_b), recording.rows_dropped, recording.gaps[0].samples) == (100, 1, 1)
    assert_allclose(np.degrees(recording.gyro_b), np.tile([0.1, 0.2, 0.3], (100, 1)))
