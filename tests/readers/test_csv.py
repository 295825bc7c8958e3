"""CSV: what a file may look like, and what is said of one that is wrong."""

from __future__ import annotations

import bz2
import gzip
import lzma
from math import degrees, radians

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from still import LATITUDE, SI, TITLES, csv_file, csv_rows, rows_of, still

from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.readers import describe, parse_columns, read, text
from gyronorth.recording import Gap


def test_our_file_with_all_its_comments(tmp_path):
    comments = [
        *SI, "# rate_hz: 100", "# latitude_deg: 32.11", "# heading_true_deg: 40", "# session: bench 3",
        "# start_time_utc: 2024-05-01T12:00:00Z", "# remark: anything else is left alone", "#", "# : ",
    ]  # fmt: skip
    recording = read(csv_file(tmp_path, csv_rows(50), comments=comments))
    gyro, accel = still(50)
    assert_array_equal(recording.gyro_b, gyro)
    assert_array_equal(recording.accel_b, accel)
    assert recording.rate_hz == 100
    assert recording.latitude == radians(32.11)
    assert recording.heading_true == radians(40)
    assert (recording.session, recording.start_time_utc) == ("bench 3", "2024-05-01T12:00:00Z")
    assert (recording.source, recording.rows_dropped, recording.gaps, recording.notes) == ("rec.csv", 0, (), ())


def test_progress_is_told_the_share_of_the_file(tmp_path, monkeypatch):
    path = csv_file(tmp_path, csv_rows(1000))
    monkeypatch.setattr(text, "BLOCK_BYTES", path.stat().st_size // 10 + 1)
    shares: list[float] = []
    recording = read(path, progress=shares.append)
    assert len(recording.gyro_b) == 1000
    assert_allclose(shares, np.arange(1, 11) / 10, atol=1e-3)  # ten blocks of a tenth and a byte
    assert shares[-1] == 1.0
    shares.clear()
    assert describe(path, progress=shares.append).samples == 1000
    assert len(shares) == 10


def test_rate_comes_from_the_time_column(tmp_path):
    assert read(csv_file(tmp_path, csv_rows(50, rate_hz=3.0))).rate_hz == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "end"),
    [
        (lambda text: text, "\r\n"),
        (lambda text: "\ufeff" + text, "\n"),
        (lambda text: text.rstrip("\n"), "\n"),
        (lambda text: text + "\n\n  \n", "\n"),
        (lambda text: text.replace(",", " , "), "\n"),
    ],
    ids=["CRLF", "BOM", "no end of line", "blank lines behind", "spaces"],
)
def test_harmless_differences_of_writing(tmp_path, change, end):
    path = csv_file(tmp_path, [row.replace("\n", end) for row in csv_rows(50)], end=end)
    path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8", newline="" if end == "\n" else end)
    assert_array_equal(read(path).gyro_b, still(50)[0])


@pytest.mark.parametrize("tail", [",", ", ", ",\t"])
@pytest.mark.parametrize("in_header", [True, False])
def test_trailing_commas_with_and_without_one_in_the_header(tmp_path, tail, in_header):
    rows = [row.rstrip("\n") + tail + "\n" for row in csv_rows(50)]
    header = ",".join(TITLES) + ("," if in_header else "")
    assert_array_equal(read(csv_file(tmp_path, rows, header=header)).accel_b, still(50)[1])


def test_a_value_behind_the_trailing_comma_is_an_error(tmp_path):
    rows = [row.rstrip("\n") + ",\n" for row in csv_rows(50)]
    rows[7] = rows[7].rstrip("\n") + "5\n"
    with pytest.raises(InputError, match=r"Row 12 of rec.csv: it has 8 fields; 7 are expected"):
        read(csv_file(tmp_path, rows))


def test_one_field_more_than_the_header_is_not_shifted_into_place(tmp_path):
    rows = [f"{i}," + row for i, row in enumerate(csv_rows(50))]
    with pytest.raises(InputError, match="8 fields; 7 are expected"):
        read(csv_file(tmp_path, rows))


def test_quoted_fields_and_text_in_columns_that_are_not_used(tmp_path):
    rows = [
        '"2024-05-01, 12 h",' + ",".join(f'"{field}"' for field in row.strip().split(",")) + "\n" for row in csv_rows(9)
    ]
    assert_array_equal(read(csv_file(tmp_path, rows, header='"when, about",' + ",".join(TITLES))).gyro_b, still(9)[0])


def test_any_header_can_be_mapped(tmp_path):
    gyro, accel = still(60)
    columns = [np.arange(60) / 50, accel / STANDARD_GRAVITY, np.full(60, 7.0), np.degrees(gyro)]
    path = csv_file(tmp_path, rows_of(columns), comments=[], header="sec,ax,ay,az,temp,g x,g=y,gz,1")
    path.write_text(path.read_text().replace(",1\n", "\n", 1))
    mapped = parse_columns("t=sec,w_x=g x,w_y=g=y, w_z = gz ,f_x=ax,f_y=2,f_z=az")
    recording = read(path, columns=mapped, gyro_unit="deg/s", accel_unit="g")
    assert_allclose(recording.gyro_b, gyro, rtol=1e-14)
    assert_allclose(recording.accel_b, accel, rtol=1e-14)
    assert recording.rate_hz == pytest.approx(50)


def test_columns_of_a_file_without_header_go_by_number(tmp_path):
    path = tmp_path / "bare.csv"
    path.write_text("".join(csv_rows(30)))
    with pytest.raises(InputError, match=r"bare.csv has no header: its row 1 is already numbers"):
        read(path, gyro_unit="rad/s")
    numbers = {name: position for position, name in enumerate(TITLES)}
    recording = read(path, gyro_unit="rad/s", accel_unit="m/s2", columns=numbers)
    assert_array_equal(recording.accel_b, still(30)[1])


def test_columns_can_be_left_alone(tmp_path):
    path = csv_file(tmp_path, csv_rows(30))
    recording = read(path, rate_hz=25.0, columns=parse_columns("t=-,f_x=-,f_y=-,f_z=-"))
    assert recording.accel_b is None
    assert recording.rate_hz == 25.0  # the time column says 100 Hz, and is left alone


def test_gyro_only_file(tmp_path):
    gyro = still(30)[0]
    path = csv_file(tmp_path, rows_of([gyro]), comments=["# gyro_unit: rad/s", "# rate_hz: 10"], header="w_x,w_y,w_z")
    recording = read(path)
    assert recording.accel_b is None
    assert_array_equal(recording.gyro_b, gyro)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"w_q": "a"}, "columns names 'w_q'"),
        ({"w_x": "gx"}, "columns says w_x=gx, but rec.csv has no such column: its columns are t, w_x"),
        ({"w_x": 9}, "no such column"),
        ({"w_x": "w_y"}, "gives column 2 of rec.csv to w_x and to another"),
        ({"f_x": "-"}, "has no column f_x"),
        ({"w_x": "-"}, "has no column w_x"),
    ],
)
def test_wrong_maps_of_columns(tmp_path, columns, message):
    with pytest.raises(InputError, match=message):
        read(csv_file(tmp_path, csv_rows(9)), columns=columns)


@pytest.mark.parametrize("text", ["", "w_x", "q=1", "w_x=", "w_x=a,w_x=b", "gx=1,w_x=a", "w_x=,w_y=b"])
def test_wrong_texts_of_columns(text):
    with pytest.raises(InputError, match="columns is"):
        parse_columns(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "rec.csv is empty"),
        ("# gyro_unit: rad/s\n", "ends before its header"),
        (",".join(TITLES) + "\n", "holds no rows of data"),
        ("a,b,c\n1,2,3\n", r"has no column w_x, w_y, w_z: its columns are a, b, c. Say which ones.*--columns"),
        ("w_x,w_y,w_z,f_x\n1,2,3,4\n", "has no column f_y, f_z"),
        ("w_x,w_y,w_x,w_z\n1,2,3,4\n", "has 2 columns w_x; which one is meant"),
        ('w_x,"w_y,w_z\n1,2,3\n', "rec.csv"),
        ("x" * 70000, "Row 1 of rec.csv is longer than 65536 characters"),
        ("w_x,w_y\x00,w_z\n1,2,3\n", "Row 1 of rec.csv holds zero bytes"),
        ("# latitude_deg: 95\n" + ",".join(TITLES), "Row 1 of rec.csv: latitude_deg is '95'; a number of -90 to 90"),
        ("# rate_hz: fast\n" + ",".join(TITLES), "Row 1 of rec.csv: rate_hz is 'fast'"),
        ("# gyro_unit: deg\n" + ",".join(TITLES), "gyro_unit is 'deg'; one of rad/s, deg/s, deg/h"),
        ("# axes: xyz\n" + ",".join(TITLES), "axes is 'xyz'"),
        ("# rate_hz: 5\n# axes: fud\n" + ",".join(TITLES), "Row 2 of rec.csv: axes is 'fud'; each"),
        ("# rate_hz: 5\n# axes: rfd\n" + ",".join(TITLES), "Row 2 of rec.csv: axes is 'rfd', which is left-handed"),
        ("\n# start_time_utc: noon\n" + ",".join(TITLES), "Row 2 of rec.csv: start_time_utc is 'noon'; an ISO 8601"),
        ("# rate_hz: 5\n# rate_hz: 6\n" + ",".join(TITLES), "Row 2 of rec.csv states rate_hz again"),
        ("# gaps: 5\n" + ",".join(TITLES), "Row 1 of rec.csv: gaps is '5'"),
    ],
)
def test_files_that_cannot_be_read_at_all(tmp_path, text, message):
    path = tmp_path / "rec.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read(path, gyro_unit="rad/s", accel_unit="m/s2", rate_hz=10)


BAD_ROWS = {
    "word": ("0.2,abc,0,0,0,0,-9.8\n", "w_x is 'abc'; a number is expected"),
    "underscore": ("0.2,0,1_0,0,0,0,-9.8\n", "w_y is '1_0'; a number is expected"),
    "cut off": ("0.2,0,0\n", "it has 3 fields; 7 are expected (cut off?)"),
    "too many": ("0.2,0,0,0,0,0,-9.8,1\n", "it has 8 fields; 7 are expected"),
    "decimal commas": (
        "0,2,0,0,0,0,0,0,0,0,0,0,-9,8\n",
        "it has 14 fields; 7 are expected (decimal commas? decimal points are expected)",
    ),
    "semicolons": ("0.2;0;0;0;0;0;-9.8\n", "(semicolons between fields? commas are expected)"),
    "tabs": ("0.2\t0\t0\t0\t0\t0\t-9.8\n", "(tabs between fields? commas are expected)"),
    "empty field": ("0.2,0,,0,0,0,-9.8\n", "w_y is ''; a number is expected"),
    "nan": ("0.2,0,0,nan,0,0,-9.8\n", "w_z is nan; a finite number is expected"),
    "infinite": ("0.2,0,0,0,0,0,-1e999\n", "f_z is -inf; a finite number is expected"),
    "time nan": ("nan,0,0,0,0,0,-9.8\n", "t is nan; a finite number is expected"),
    "huge rate": ("0.2,0,-1.2e31,0,0,0,-9.8\n", "w_y is -1.2e+31 rad/s; the largest plausible rate is 35 rad/s"),
    "huge force": ("0.2,0,0,0,401,0,-9.8\n", "f_x is 401 m/s2; the largest plausible specific force is 400 m/s2"),
    "zeros": ("0.2,0,0,0,0,0,0\n", "f_x, f_y and f_z are all exactly 0, which no body at rest can feel"),
    "quotes": ('0.2,"0,0,0,0,0,-9.8\n', "fields; 7 are expected"),
    "zero byte": ("0.2,0,\x000,0,0,0,-9.8\n", "it holds zero bytes"),
    "time back": ("0.1,0,0,0,0,0,-9.8\n", "time runs backwards: t is 0.1 after 0.19"),
    "time leaps": ("77,0,0,0,0,0,-9.8\n", "time leaps: t is 77 after 0.19"),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", BAD_ROWS)
def test_a_bad_row_is_named_or_dropped_and_bridged(tmp_path, kind):
    row, reason = BAD_ROWS[kind]
    rows = csv_rows(60)
    rows[20] = row
    path = csv_file(tmp_path, rows)
    with pytest.raises(InputError) as caught:
        read(path)
    assert str(caught.value).startswith("Row 25 of rec.csv: ")  # 3 comments, the header, 20 rows before it
    assert reason in str(caught.value)
    assert "--drop-bad-rows" in str(caught.value)
    recording = read(path, drop_bad_rows=True)
    assert recording.rows_dropped == 1
    assert recording.gaps == (Gap(0.2, 1),)
    assert [note.code for note in recording.notes] == ["gaps_bridged", "rows_dropped"]
    gyro = still(60)[0]
    gyro[20] = (gyro[19] + gyro[21]) / 2  # a straight line across the one missing sample
    assert_allclose(recording.gyro_b, gyro, rtol=1e-12)


def test_a_byte_that_is_not_utf8_spoils_its_row_only(tmp_path):
    path = csv_file(tmp_path, csv_rows(60))
    lines = path.read_bytes().split(b"\n")
    lines[9] = lines[9].replace(b".", b"\xb7", 1)
    path.write_bytes(b"\n".join(lines))
    with pytest.raises(InputError, match=r"Row 10 of rec.csv: it holds the byte 0xb7, which is not UTF-8 text"):
        read(path)
    assert read(path, drop_bad_rows=True).rows_dropped == 1


def test_several_bad_rows_are_counted_and_the_first_ones_named(tmp_path):
    rows = csv_rows(200)
    for i in (3, 50, 90, 91, 92, 150, 151):
        rows[i] = rows[i].replace("e-05", "e+05", 1) if i == 50 else "x\n"
    with pytest.raises(InputError) as caught:
        read(csv_file(tmp_path, rows))
    message = str(caught.value)
    assert message.startswith("Row 8 of rec.csv: it has 1 fields")
    assert "Bad rows in all: 7; row 55: w_x is " in message
    assert "row 97" in message
    assert "row 156" not in message  # the sixth


def test_too_many_bad_rows_are_not_dropped(tmp_path):
    rows = csv_rows(100)
    rows[40:55] = ["x\n"] * 15
    with pytest.raises(InputError, match=r"15 of 100 rows of rec.csv are bad, beginning with row 45.*More than 10%"):
        read(csv_file(tmp_path, rows), drop_bad_rows=True)


def test_bad_rows_without_a_time_column_are_bridged_by_their_place(tmp_path):
    gyro = still(60)[0]
    rows = rows_of([gyro])
    rows[30] = rows[31] = "x\n"
    path = csv_file(tmp_path, rows, comments=["# gyro_unit: rad/s", "# rate_hz: 10"], header="w_x,w_y,w_z")
    recording = read(path, drop_bad_rows=True)
    assert recording.gaps == (Gap(3.0, 2),)
    assert len(recording.gyro_b) == 60
    assert_array_equal(recording.gyro_b[32:], gyro[32:])
    assert_allclose(recording.gyro_b[30], gyro[29] + (gyro[32] - gyro[29]) / 3, rtol=1e-12)


def test_bad_rows_at_the_start_move_the_start_time(tmp_path):
    rows = ["0,0,0,0,0,0,0\n", "0.01,0,0,0,0,0,0\n", *csv_rows(60)[2:]]
    comments = [*SI, "# start_time_utc: 2024-05-01T12:00:00Z"]
    recording = read(csv_file(tmp_path, rows, comments=comments), drop_bad_rows=True)
    assert len(recording.gyro_b) == 58
    assert recording.gaps == ()
    assert recording.start_time_utc == "2024-05-01T12:00:00.020000Z"


@pytest.mark.slow
def test_bad_rows_across_the_blocks_in_which_a_file_is_read(tmp_path):
    # 40,000 rows of over 100 bytes are four blocks of a MiB; a bad row in each, and one at the very end.
    rows = csv_rows(40_000)
    for i in (100, 12_000, 22_000, 39_999):
        rows[i] = "0,broken\n"
    path = csv_file(tmp_path, rows)
    recording = read(path, drop_bad_rows=True)
    assert recording.rows_dropped == 4
    assert [round(gap.start * 100) for gap in recording.gaps] == [100, 12_000, 22_000]
    good = np.ones(39_999, dtype=bool)
    good[[100, 12_000, 22_000]] = False
    assert_array_equal(recording.gyro_b[good], still(40_000)[0][:39_999][good])


def test_a_file_of_ours_that_is_cut_off_at_a_line_end_is_noticed(tmp_path):
    path = csv_file(tmp_path, csv_rows(50), comments=[*SI, "# samples: 60"])
    with pytest.raises(InputError, match=r"rec.csv states 60 samples but has 50 rows: it is cut off"):
        read(path)
    recording = read(path, drop_bad_rows=True)
    assert len(recording.gyro_b) == 50
    assert [note.code for note in recording.notes] == ["cut_off"]


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(InputError, match="There is no file"):
        read(tmp_path / "none.csv")
    with pytest.raises(InputError, match="is a folder; a file is expected"):
        read(tmp_path)


def test_published_recording_tells_its_heading_by_its_name(tmp_path):
    gyro, accel = still(1200)
    rows = rows_of([np.arange(1200.0), np.degrees(gyro), accel])
    path = csv_file(tmp_path, rows, comments=[], header=",w_x,w_y,w_z,f_x,f_y,f_z", name="x_40.0.csv")
    recording = read(path)
    assert recording.heading_true == radians(40.0)
    assert (recording.rate_hz, recording.duration) == (600, 2)
    assert_allclose(recording.gyro_b, gyro, rtol=1e-14)
    assert_array_equal(recording.accel_b, accel)
    assert read(path, latitude=LATITUDE).latitude == LATITUDE
    # Under another name the unit is not known.
    other = path.rename(tmp_path / "other.csv")
    with pytest.raises(InputError, match=r"does not say in which unit w_x.*--gyro-unit"):
        read(other)


def test_degrees_of_the_comments_are_degrees(tmp_path):
    comments = [*SI, "# latitude_deg: -45.5", "# heading_true_deg: 359.5"]
    recording = read(csv_file(tmp_path, csv_rows(9), comments=comments))
    assert degrees(recording.latitude or 0) == pytest.approx(-45.5)
    assert degrees(recording.heading_true or 0) == pytest.approx(359.5)


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress, lzma.compress])
def test_a_packed_file_is_read_whatever_its_suffix(tmp_path, pack):
    plain = csv_file(tmp_path, csv_rows(300))
    packed = tmp_path / "packed.csv"
    packed.write_bytes(pack(plain.read_bytes()))
    assert_array_equal(read(packed).gyro_b, read(plain).gyro_b)


def test_rows_of_two_kinds_that_no_preset_knows_are_told(tmp_path):
    rows = "".join(
        f"Turn,{10 * i},1e-5,2e-5,{3 + i % 2}e-5\nPush,{10 * i},0.1,0.2,{9.8 + i % 2 / 100}\n" for i in range(50)
    )
    path = tmp_path / "log.txt"
    path.write_text("what,time_ms,w_x,w_y,w_z\n" + rows)
    with pytest.raises(InputError, match="rows of 2 sensors in turn, told apart by what: Push, Turn"):
        read(path, gyro_unit="rad/s")
