"""Time columns: jitter, gaps, repeats, resets; windows; reading in chunks."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from still import SI, csv_file, csv_rows, rows_of, still

from gyronorth.errors import InputError
from gyronorth.readers import read, read_chunks, text
from gyronorth.recording import Gap


def timed_file(folder, time, **kwargs):
    """A CSV with these times; sample k of the body at rest belongs to row k."""
    return csv_file(folder, rows_of([np.asarray(time, dtype=float), *still(len(time))]), **kwargs)


def lossy_file(folder, rows, lost, rate_hz=100.0, **kwargs):
    """A CSV of `rows` rows of which those numbered in `lost` are missing."""
    kept = np.setdiff1d(np.arange(rows), lost)
    text = csv_rows(rows, rate_hz=rate_hz)
    return csv_file(folder, [text[i] for i in kept], **kwargs), kept


@pytest.mark.parametrize(("rate_hz", "digits"), [(600, 3), (700, 3), (125, 3), (100, 6), (3, 3), (59.94, 4)])
def test_rate_survives_rounded_time_stamps(tmp_path, rate_hz, digits):
    # 3,000 stamps rounded to 10^-digits s: their ends fix the mean interval to 10^-digits / 3000 s.
    recording = read(timed_file(tmp_path, np.round(np.arange(3000) / rate_hz, digits)))
    assert recording.rate_hz == pytest.approx(rate_hz, rel=2 * rate_hz * 10.0**-digits / 3000 + 1e-6)
    assert recording.gaps == ()
    assert len(recording.gyro_b) == 3000


@pytest.mark.parametrize(("spread", "codes"), [(0.1, []), (0.3, []), (0.49, ["time_jitter"])])
def test_jitter_moves_no_sample_and_is_told_when_large(tmp_path, spread, codes):
    time = np.arange(2000) + np.random.default_rng(5).uniform(-spread, spread, 2000)
    recording = read(timed_file(tmp_path, time / 100))
    assert_array_equal(recording.gyro_b, still(2000)[0])
    assert recording.rate_hz == pytest.approx(100, rel=1e-3)
    assert [note.code for note in recording.notes] == codes


@pytest.mark.parametrize("shift", [0.0065, -0.0065])
def test_a_late_or_early_stamp_is_not_a_gap(tmp_path, shift):
    time = np.arange(500) / 100
    time[200] += shift
    assert read(timed_file(tmp_path, time)).gaps == ()


@pytest.mark.slow
def test_stamps_in_bursts(tmp_path):
    # Ten samples at a time, 10 us apart; then one burst is lost.
    time = np.repeat(np.arange(60) / 10, 10) + np.tile(np.arange(10) * 1e-5, 60)
    recording = read(timed_file(tmp_path, time))
    assert recording.gaps == ()
    assert recording.rate_hz == pytest.approx(100, rel=0.02)  # 9 of 10 samples of the last burst have no interval
    assert [note.code for note in recording.notes] == ["time_jitter"]
    lossy = read(timed_file(tmp_path, np.delete(time, np.arange(300, 310))))
    assert [gap.samples for gap in lossy.gaps] == [10]


@pytest.mark.parametrize("rate_hz", [600, 800, 952.38, 1000])
def test_gaps_are_seen_in_spite_of_coarse_stamps(tmp_path, rate_hz):
    # Stamps in whole milliseconds look at 800 Hz like 1 kHz with a fifth of the samples lost.
    time = np.round(np.arange(6000) / rate_hz, 3)
    whole = read(timed_file(tmp_path, time))
    assert whole.gaps == ()
    assert whole.rate_hz == pytest.approx(rate_hz, rel=1e-3)


def test_gaps_are_bridged_by_straight_lines(tmp_path):
    path, kept = lossy_file(tmp_path, 1000, [50, *range(300, 305), 700, 702])
    recording = read(path)
    gyro, accel = still(1000)
    assert recording.gaps == (Gap(0.5, 1), Gap(3.0, 5), Gap(7.0, 1), Gap(7.02, 1))
    assert len(recording.gyro_b) == 1000
    assert recording.rate_hz == 100
    assert_array_equal(recording.gyro_b[kept], gyro[kept])
    assert recording.accel_b is not None
    for i in range(300, 305):
        expected = accel[299] + (accel[305] - accel[299]) * (i - 299) / 6
        assert_allclose(recording.accel_b[i], expected, rtol=1e-12, atol=1e-15)
    assert [note.code for note in recording.notes] == ["gaps_bridged"]
    assert "8 of 1000 samples were missing in 4 gap(s)" in recording.notes[0].message


def test_too_much_missing_is_refused(tmp_path):
    rng = np.random.default_rng(3)
    path, _ = lossy_file(tmp_path, 30_000, np.sort(rng.choice(np.arange(1, 29_999), 4500, replace=False)))
    with pytest.raises(InputError, match=r"\d+ of \d+ samples of rec.csv are missing; up to 10% are bridged"):
        read(path)


@pytest.mark.slow
def test_a_long_gap_is_refused_and_a_window_avoids_it(tmp_path):
    path, _ = lossy_file(tmp_path, 30_000, np.arange(20_000, 21_100))
    with pytest.raises(InputError) as caught:
        read(path)
    # 1,100 lost samples lie between the one at 199.99 s and the one at 211 s.
    assert "Row 20005 of rec.csv: 11.01 s lie between this row and the one before" in str(caught.value)
    assert "ends 200 s of data" in str(caught.value)
    assert "--window" in str(caught.value)
    gyro = still(30_000)[0]
    assert_array_equal(read(path, window=(0, 200)).gyro_b, gyro[:20_000])
    assert_array_equal(read(path, window=(211, 300)).gyro_b, gyro[21_100:])
    with pytest.raises(InputError, match="lie between"):
        read(path, window=(190, 205))


def test_window_matches_the_window_of_the_whole(tmp_path):
    path, _ = lossy_file(tmp_path, 2000, [450, 800, 801], comments=[*SI, "# start_time_utc: 2024-05-01T12:00:00Z"])
    part, whole = read(path, window=(4.0, 8.01)), read(path).window(4.0, 8.01)
    assert_array_equal(part.gyro_b, whole.gyro_b)
    assert part.gaps == whole.gaps == (Gap(0.5, 1), Gap(4.0, 1))
    assert part.start_time_utc == whole.start_time_utc == "2024-05-01T12:00:04Z"


def test_bad_rows_outside_the_window_do_not_matter(tmp_path):
    rows = csv_rows(1000)
    rows[100] = rows[900] = "broken\n"
    path = csv_file(tmp_path, rows)
    assert read(path, window=(2, 8)).rows_dropped == 0
    with pytest.raises(InputError, match="Row 105 of"):
        read(path, window=(0, 8))


def test_bad_rows_of_a_window_are_described_where_there_are_many_before_it(tmp_path):
    rows = csv_rows(1000)
    for row in (*range(10, 80, 10), 300, 301):
        rows[row] = "broken\n"
    rows[302] = rows[302].rpartition(",")[0] + ",nan\n"
    path = csv_file(tmp_path, rows)
    with pytest.raises(InputError, match=r"Row 305 of .* Bad rows in all: 3; row 306: .*; row 307: f_z is nan"):
        read(path, window=(2, 8))
    assert read(path, window=(2, 8), drop_bad_rows=True).rows_dropped == 3


@pytest.mark.parametrize(("window", "message"), [((0, 11), "does not fit"), ((20, 30), "is beyond the end")])
def test_window_beyond_the_end(tmp_path, window, message):
    with pytest.raises(InputError, match=message):
        read(csv_file(tmp_path, csv_rows(1000)), window=window)


def test_a_clock_that_starts_again_is_refused_and_both_cures_work(tmp_path):
    time = np.concatenate([np.arange(500), np.arange(500)]) / 100 + 3
    path = timed_file(tmp_path, time)
    for drop in (False, True):
        with pytest.raises(InputError) as caught:
            read(path, drop_bad_rows=drop)
        message = str(caught.value)
        assert message.startswith("Row 505 of rec.csv: t is 3 after 7.99, and the rows behind it go on from there")
        assert "--window 0:5;" in message
        assert "--columns t=- --rate 100." in message
    assert_array_equal(read(path, window=(0, 5)).gyro_b, still(1000)[0][:500])
    assert_array_equal(read(path, columns={"t": "-"}, rate_hz=100).gyro_b, still(1000)[0])


def test_repeated_rows_can_be_dropped(tmp_path):
    rows = csv_rows(500)
    for i in (400, 200):
        rows.insert(i, rows[i])
    path = csv_file(tmp_path, rows)
    with pytest.raises(InputError, match=r"Row 206 of rec.csv: time repeats.*row 407"):
        read(path)
    recording = read(path, drop_bad_rows=True)
    assert (recording.rows_dropped, recording.gaps) == (2, ())
    assert_array_equal(recording.gyro_b, still(500)[0])


@pytest.mark.parametrize(
    ("scale", "options", "message"),
    [
        (1000, {"time_unit": "s"}, r"t of rec.csv steps by 10, a rate of 0.1 Hz if it is in seconds"),
        (1e-6, {}, "a rate of 1e\\+08 Hz"),
        (1, {"rate_hz": 99}, r"t of rec.csv gives a rate of 100 Hz, but 99 Hz is declared"),
        (1000, {"rate_hz": 10}, "gives a rate of 100 Hz, but 10 Hz is declared"),
        (100, {}, r"t counts in whole numbers, each 1 more than the last(?s:.*)Try: .* --time-unit ms$"),
        (0, {}, r"t of rec.csv is 0 in every row: no clock, or one too coarse.*--columns t=- --rate HZ"),
        (-1, {}, r"t of rec.csv runs backwards, from -?0 to -2.99: rows in reverse order"),
    ],
)
def test_time_in_another_unit_or_against_the_rate(tmp_path, scale, options, message):
    with pytest.raises(InputError, match=message):
        read(timed_file(tmp_path, np.arange(300) / 100 * scale), **options)


def test_rates_that_contradict_each_other(tmp_path):
    path = csv_file(tmp_path, csv_rows(300), comments=[*SI, "# rate_hz: 100"])
    assert read(path, rate_hz=100.0).rate_hz == 100
    with pytest.raises(InputError, match=r"states a rate of 100 Hz; 50 Hz is declared.*never resamples"):
        read(path, rate_hz=50)


def test_no_time_and_no_rate(tmp_path):
    path = csv_file(tmp_path, rows_of(still(10)), header="w_x,w_y,w_z,f_x,f_y,f_z")
    with pytest.raises(InputError, match=r"has no time column and does not state its rate.*--rate HZ.*t=NAME"):
        read(path)
    assert read(path, rate_hz=20).rate_hz == 20


def test_a_single_row_is_no_recording(tmp_path):
    with pytest.raises(InputError, match=r"single time, so its rate is unknown"):
        read(csv_file(tmp_path, csv_rows(1)))
    with pytest.raises(InputError, match=r"a single row of data"):
        read(csv_file(tmp_path, csv_rows(1)), rate_hz=100)


@pytest.mark.slow
@pytest.mark.parametrize("chunk_samples", [1, 61, 1000, 10_000_000])
def test_chunks_concatenated_are_the_whole(tmp_path, chunk_samples):
    rows = 300 if chunk_samples == 1 else 25_000  # more than one block of the file
    lost = [50, 51, 52, 99, 120] + ([14_000, *range(20_000, 20_050)] if rows > 300 else [])
    comments = [*SI, "# start_time_utc: 2024-05-01T12:00:00Z", "# latitude_deg: 32.11", "# session: s"]
    path, _ = lossy_file(tmp_path, rows, lost, comments=comments)
    text = path.read_text().split("\n")
    text[10] = "broken"
    path.write_text("\n".join(text))
    whole = read(path, drop_bad_rows=True)
    info, chunks = read_chunks(path, drop_bad_rows=True, chunk_samples=chunk_samples)
    start, gaps, dropped, lengths = 0, 0, 0, []
    for chunk in chunks:
        part = slice(start, start + len(chunk.gyro_b))
        assert_array_equal(chunk.gyro_b, whole.gyro_b[part])
        assert_array_equal(chunk.accel_b, whole.accel_b[part] if whole.accel_b is not None else None)
        assert (chunk.rate_hz, chunk.latitude, chunk.session) == (whole.rate_hz, whole.latitude, "s")
        assert chunk.start_time_utc == whole.window(start / 100, whole.duration).start_time_utc
        start, gaps, dropped = part.stop, gaps + sum(gap.samples for gap in chunk.gaps), dropped + chunk.rows_dropped
        lengths.append(len(chunk.gyro_b))
    assert start == len(whole.gyro_b)
    assert set(lengths[:-1]) <= {chunk_samples}
    assert dropped == whole.rows_dropped == 1
    assert gaps == sum(gap.samples for gap in whole.gaps) == len(lost) + 1
    assert (info.rate_hz, info.latitude, info.session) == (whole.rate_hz, whole.latitude, "s")
    assert (info.format, info.gyro_unit, info.accel_unit, info.axes) == ("csv", "rad/s", "m/s2", "frd")


@pytest.mark.slow
def test_a_bad_row_ends_the_chunks(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "BLOCK_BYTES", 1 << 20)
    rows = csv_rows(40_000)
    rows[30_000] = "broken\n"
    _, chunks = read_chunks(csv_file(tmp_path, rows), chunk_samples=5000)
    for _ in range(4):
        next(chunks)
    with pytest.raises(InputError, match="Row 30005"):
        list(chunks)


@pytest.mark.slow
def test_chunks_bound_the_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "BLOCK_BYTES", 1 << 20)
    # 120,000 rows are 17 MB of text and 5.8 MB of numbers. One block of a MiB is held as bytes, as text, as
    # lines and as numbers, with its predecessor's: some 8 MiB whatever the length of the file.
    path = csv_file(tmp_path, csv_rows(120_000), comments=[*SI, "# rate_hz: 100"])
    peaks = []
    for window in ((0.0, 200.0), None):
        _, chunks = read_chunks(path, window=window, chunk_samples=5000)
        tracemalloc.start()
        assert sum(len(chunk.gyro_b) for chunk in chunks) == (120_000 if window is None else 20_000)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 10 * 2**20
    assert peaks[1] < 1.3 * peaks[0]
