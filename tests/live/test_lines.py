"""Bytes to rows, rows in order of time, rows to samples: whatever is between them, and however it is cut."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from live_stream import HEAD, RATE_HZ, rows_in, seconds, timed_rows
from numpy.testing import assert_allclose, assert_array_equal
from still import SI, TITLES, csv_file

from gyronorth import read
from gyronorth.errors import InputError
from gyronorth.live.lines import MOST_KEYS, LineReader, LiveRows
from gyronorth.live.stretch import Stretch
from gyronorth.live.timeline import Timeline
from gyronorth.readers import ReadOptions
from gyronorth.readers.formats.csv import stated_facts
from gyronorth.readers.text_head import LONGEST_LINE

ROWS = timed_rows(seconds(0, 2))
GARBAGE = [
    b"\xff\xfe\x00\x81",
    b"0.5,nan,0,0,0,0,0",
    b"0.5,1e999,0,0,0,0,0",
    b"1,2,3",
    b"1,2,3,4,5,6,7,8",
    b"1,2,,4,5,6,7",
    b"1;2;3;4;5;6;7",
    b"1,2,3,4,5,6,--7",
    b"t,w_x,w_y",
    b"$GPHDT,,T*1B",
    b"# rate_hz: 7\x00",
    b"0.5 1e-5 0 0 0 0 -9.8",
]


def read_all(data: bytes, *cuts: int, **options) -> tuple[LineReader, list[bytes]]:
    """A reader that got `data` in pieces, and the lines of its rows."""
    reader = LineReader("stream", ReadOptions(**options))
    batches = []
    for start, end in zip([0, *cuts], [*cuts, len(data)], strict=True):
        batches += reader.push(data[start:end])
    batches += reader.end()
    for batch in batches:
        assert batch.form == reader.form
        expected = [[float(field) for field in line.split(b",")] for line in batch.rows.lines]
        assert_array_equal(batch.rows.values, np.array(expected)[:, list(batch.form.use)])
    return reader, [line for batch in batches for line in batch.rows.lines]


def encoded(rows: list[str]) -> list[bytes]:
    return [row.strip().encode() for row in rows]


@settings(max_examples=30)
@given(st.data())
def test_rows_are_the_same_however_the_bytes_are_cut(data):
    lines = encoded(ROWS[:40])
    for place, noise in data.draw(st.lists(st.tuples(st.integers(0, 40), st.sampled_from(GARBAGE)), max_size=6)):
        lines.insert(place, noise)
    stream = HEAD.encode() + b"\n".join(lines) + b"\n"
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    reader, rows = read_all(stream, *cuts)
    assert rows == encoded(ROWS[:40])
    assert reader.lines == 40 + reader.garbage
    assert reader.garbage == len(lines) - 40


@pytest.mark.parametrize("noise", GARBAGE)
def test_garbage_is_counted_and_the_next_row_is_read(noise):
    reader, rows = read_all(b"\n".join([HEAD.encode().strip(), *encoded(ROWS[:3]), noise, *encoded(ROWS[3:6])]) + b"\n")
    assert rows == encoded(ROWS[:6])
    assert (reader.lines, reader.garbage) == (7, 1)
    assert reader.last_garbage.isprintable()


def test_a_line_without_end_does_not_grow():
    reader, _ = read_all((HEAD + ROWS[0]).encode())
    for _ in range(3):
        assert reader.push(b"7" * LONGEST_LINE) == []
    reader.push(b"\n")
    (batch,) = reader.push(ROWS[1].encode())
    assert batch.rows.lines == encoded(ROWS[1:2])
    assert reader.garbage >= 1
    assert len(reader.last_garbage) < 100


def test_windows_line_ends_and_blank_lines_are_no_garbage():
    reader, rows = read_all((HEAD + "".join(ROWS[:5]) + "\n\n").replace("\n", "\r\n").encode())
    assert rows == encoded(ROWS[:5])
    assert reader.garbage == 0


@pytest.mark.parametrize(("width", "titles"), [(7, TITLES), (6, TITLES[1:]), (4, TITLES[:4]), (3, TITLES[1:4])])
def test_without_a_header_the_number_of_fields_tells(width, titles):
    lines = [b",".join(row.split(b",")[7 - width if width in (6, 7) else 0 :][:width]) for row in encoded(ROWS[:5])]
    reader, rows = read_all(b"\n".join([b"5,1", *lines]) + b"\n")  # the first is the rest of a row
    assert reader.form is not None
    assert reader.form.columns == titles
    assert rows == lines
    assert reader.garbage == 1


def test_the_rest_of_a_row_does_not_pass_for_another_form():
    rest = ROWS[0].partition(",")[2].encode()  # six fields: a row without its time
    reader, rows = read_all(rest + "".join(ROWS[1:4]).encode())
    assert reader.form is not None
    assert reader.form.columns == TITLES
    assert rows == encoded(ROWS[1:4])
    assert reader.garbage == 1


def test_comments_count_right_before_a_header_only():
    reader, _ = read_all((HEAD + ROWS[0] + "# latitude_deg: 80\n" + ROWS[1] + "# latitude_deg: 81\n").encode())
    assert stated_facts(reader.stated, "stream")[0].latitude == pytest.approx(radians(32.11))
    reader.push(("# latitude_deg: 40\n" + ",".join(TITLES) + "\n").encode())  # the next connection
    assert stated_facts(reader.stated, "stream")[0].latitude == pytest.approx(radians(40))


def test_comments_are_remembered_by_their_row_in_the_stream():
    reader = LineReader("stream", ReadOptions())
    for text in (HEAD, "".join(ROWS[:3]), "\n#\n# session: b\n" + ",".join(TITLES) + "\n"):
        reader.push(text.encode())
    assert reader.stated["latitude_deg"][1] == HEAD.splitlines().index("# latitude_deg: 32.11") + 1
    assert reader.stated["session"] == ("b", len(HEAD.splitlines()) + 3 + 3)


def test_only_so_many_comments_are_remembered():
    flood = "".join(f"# k{'a' * number}: 1\n" for number in range(4 * MOST_KEYS))
    reader, _ = read_all((flood + ",".join(TITLES) + "\n" + flood + ",".join(TITLES) + "\n").encode())
    assert len(reader.stated) <= MOST_KEYS


def test_a_connection_that_breaks_within_a_row_leaves_no_row():
    reader = LineReader("stream", ReadOptions())
    reader.push((HEAD + ROWS[0] + ROWS[1][:-3]).encode())
    reader.cut()
    (batch,) = reader.push(ROWS[2].encode())
    assert batch.rows.lines == encoded(ROWS[2:3])
    assert reader.garbage == 1


def test_columns_of_another_name_are_mapped_and_named_as_ours():
    header = "stamp,gx,gy,gz,temperature,ax,ay,az\n"
    rows = [row.strip().split(",") for row in ROWS[:4]]
    text = header + "".join(",".join([*row[:4], "21.5", *row[4:]]) + "\n" for row in rows)
    names = dict(zip(TITLES, ("stamp", "gx", "gy", "gz", "ax", "ay", "az"), strict=True))
    reader, lines = read_all(text.encode(), columns=names)
    assert reader.form is not None
    assert reader.form.titles == (*TITLES[:4], "temperature", *TITLES[4:])
    assert len(lines) == 4


@pytest.mark.parametrize("header", ["time,gy,gx,gz,ay,ax,az", "T,W_Y,W_X,W_Z,F_Y,F_X,F_Z"])
def test_a_header_in_other_words_is_not_passed_over(header):
    rows = "".join(f"{i},1,2,3,4,5,6\n" for i in range(3))
    with pytest.raises(InputError, match=r"has no column w_x, w_y, w_z: its columns are"):
        read_all(f"{header}\n{rows}".encode())
    _, lines = read_all(f"Boot, version 2\nready\n{rows}".encode())  # a greeting is no header
    assert len(lines) == 3


def test_the_mark_that_some_programs_begin_with_is_no_part_of_the_first_line():
    reader, lines = read_all(b"\xef\xbb\xbf# axes: rbd\nt,w_x,w_y,w_z\n0,1,2,3\n1,1,2,3\n", 1, 2, 5)
    assert reader.stated["axes"] == ("rbd", 1)
    assert (len(lines), reader.garbage) == (2, 0)


def test_a_head_that_contradicts_itself_is_refused():
    with pytest.raises(InputError, match=r"Row 2 of .* states axes again, with another value"):
        read_all(b"# axes: frd\n# axes: rbd\nt,w_x,w_y,w_z\n0,1,2,3\n1,1,2,3\n")


def test_a_header_that_lacks_a_column_is_refused_at_once():
    with pytest.raises(InputError, match="w_z"):
        read_all(b"t,w_x,w_y\n0,1,2\n")


def rows_at(times: list[float]) -> LiveRows:
    return LiveRows(np.array(times)[:, None], [repr(time).encode() for time in times])


def sorted_times(times: list[float], *cuts: int) -> tuple[list[list[float]], Timeline]:
    """The stretches that a time line makes of times that come in batches."""
    timeline = Timeline(RATE_HZ)
    stretches: list[list[float]] = [[]]
    for start, end in zip([0, *cuts], [*cuts, len(times)], strict=True):
        first, *others = timeline.push(rows_at(times[start:end])) if end > start else [rows_at([])]
        stretches[-1] += first.values[:, 0].tolist() if len(first) else []
        stretches += [rows.values[:, 0].tolist() for rows in others]
    last = timeline.end()
    stretches[-1] += last.values[:, 0].tolist() if last is not None else []
    return stretches, timeline


T = seconds(0, 2).tolist()


def test_repeated_and_late_rows_are_left_out_and_counted():
    stretches, timeline = sorted_times([*T[:50], T[49], T[40], *T[50:]])
    assert stretches == [T]
    assert timeline.strays == 2


def test_a_stray_stamp_is_left_out():
    for stray in (1e6, 5.0, -3.0):
        stretches, timeline = sorted_times([*T[:50], stray, *T[51:]])
        assert stretches == [[*T[:50], *T[51:]]]
        assert (timeline.strays, timeline.jumps) == (1, 0)


def test_a_gap_is_no_jump():
    times = [*T[:50], *(time + 9.0 for time in T[50:])]
    stretches, timeline = sorted_times(times)
    assert stretches == [times]
    assert (timeline.strays, timeline.jumps) == (0, 0)


@pytest.mark.parametrize("jump", [3600.0, 13.0, -1.5, -1e6])
def test_a_clock_that_was_set_begins_a_new_stretch_and_loses_no_row(jump):
    after = [time + jump for time in T]
    stretches, timeline = sorted_times([*T, *after])
    assert stretches == [T, after]
    assert (timeline.strays, timeline.jumps) == (0, 1)


EVENTS = st.sampled_from([0.01] * 12 + [0.0, -0.01, -0.5, 0.05, 4.0, 9.0, -100.0, 1e4])


@settings(max_examples=60)
@given(st.lists(EVENTS, min_size=1, max_size=60), st.data())
def test_no_row_is_lost_or_made_up_and_time_rises(steps, data):
    times = np.round(np.cumsum(steps), 6).tolist()
    cuts = sorted(data.draw(st.lists(st.integers(0, len(times)), max_size=6)))
    stretches, timeline = sorted_times(times, *cuts)
    assert sum(map(len, stretches)) + timeline.strays == len(times)
    assert len(stretches) == 1 + timeline.jumps
    for stretch in stretches:
        steps_within = np.diff(stretch)
        assert ((steps_within > 0) & (steps_within <= 10)).all()


def test_samples_are_those_of_the_file_reader(tmp_path):
    """Jittering stamps, 3 % of the rows lost: the same grid in batches and from the file."""
    rng = np.random.default_rng(20240501)
    times = seconds(0, 40)
    times = (times + rng.uniform(-1e-3, 1e-3, len(times)))[rng.random(len(times)) > 0.03]
    path = csv_file(tmp_path, timed_rows(times), comments=(*SI, "# rate_hz: 100", "# latitude_deg: 32.11"))
    reader = LineReader("stream", ReadOptions())
    (batch,) = reader.push(path.read_bytes())
    stretch = Stretch("stream", batch.form, stated_facts(reader.stated, "stream")[0], ReadOptions())
    pieces = [stretch.push(batch.rows.take(part)) for part in np.array_split(np.arange(len(times)), 300)]
    pieces.append(stretch.end())
    recording = read(path)
    assert stretch.rate_hz == recording.rate_hz
    assert stretch.missing == sum(gap.samples for gap in recording.gaps)
    assert recording.accel_b is not None
    assert_allclose(np.concatenate([gyro for gyro, _ in pieces]), recording.gyro_b, rtol=0, atol=1e-15)
    assert_allclose(np.concatenate([accel for _, accel in pieces if accel is not None]), recording.accel_b, atol=1e-12)
    assert len(rows_in(path)) == len(times)


def test_what_comes_first_midway_may_be_the_rest_of_a_line():
    reader = LineReader("stream", ReadOptions())
    reader.midway()
    batches = [*reader.push(b"8"), *reader.push(b",9,7\n1,2,3\n4,5,"), *reader.push(b"6\n")]
    assert np.concatenate([batch.rows.values for batch in batches]).tolist() == [[1, 2, 3], [4, 5, 6]]
