"""Losses and late stamps: what was made is what is found, however the rows are cut into batches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from still import csv_file, rows_of, still

from gyronorth.errors import InputError
from gyronorth.readers import read
from gyronorth.readers.clock import Envelope, forward_minimum, measure, width_of
from gyronorth.readers.declared import resolve
from gyronorth.readers.grid import GridBuilder
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import NAMES, Clock, Facts, Source, rows_block

SI_FACTS = Facts(gyro_unit="rad/s", accel_unit="m/s2", axes="frd")


def losses(time, *, batch=None, unit=1.0):
    """The rate, Hz, and the samples lost before each row."""
    interval = measure(np.diff(time), unit=unit)
    assert interval is not None
    envelope = Envelope(interval, width_of(interval * unit))
    batches = [time] if batch is None else [time[i : i + batch] for i in range(0, len(time), batch)]
    parts = [envelope.take(part).lost for part in batches]
    return 1 / interval, np.concatenate([*parts, envelope.take(time[:0], last=True).lost])


def stalled(time, every, by, rows):
    """Stamps of a host that sleeps `by` s every so many rows and then reads `rows` of its queue at 1 ms each."""
    late = time.copy()
    for j in range(rows):
        at = np.arange(every, len(time) - j, every)
        late[at + j] = np.maximum(late[at + j], time[at] + by + j * 1e-3)
    return late


def timed_file(folder, time, values=None):
    return csv_file(folder, rows_of([np.asarray(time, dtype=float), *(values or still(len(time)))]))


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=60), st.integers(1, 70))
@settings(deadline=None, max_examples=50)
def test_forward_minimum_is_the_least_of_the_next_rows(values, width):
    expected = [min(values[i : i + width]) for i in range(len(values))]
    assert_array_equal(forward_minimum(np.array(values), width), expected)


@pytest.mark.slow
@given(
    seed=st.integers(0, 2**32 - 1),
    share=st.sampled_from([0.0, 0.001, 0.01, 0.08]),
    jitter=st.sampled_from([0.0, 0.05, 0.15]),
    stall=st.booleans(),
    batch=st.sampled_from([None, 7, 100, 1013]),
)
@settings(deadline=None, max_examples=25)
def test_what_was_lost_is_found_among_late_and_jittering_stamps(seed, share, jitter, stall, batch):
    rng = np.random.default_rng(seed)
    every = np.arange(6000)
    lost = np.sort(rng.choice(every[200:-300], round(share * 6000), replace=False))
    kept = np.setdiff1d(every, lost)
    time = every / 100 + rng.uniform(-jitter, jitter, 6000) / 100
    if stall:  # by up to 7 samples, never out of order
        time = np.maximum.accumulate(stalled(time, 40, rng.uniform(0.0, 0.07), 4))
    rate_hz, found = losses(time[kept], batch=batch)
    assert rate_hz == pytest.approx(100, rel=1e-4)
    assert found.sum() == len(lost)
    if jitter == 0 and not stall:
        assert_array_equal(found, np.diff(kept, prepend=-1) - 1)


@pytest.mark.slow
@pytest.mark.parametrize(("rows", "share"), [(300, 0.1), (1000, 0.05), (1500, 0.02), (3000, 0.01), (6000, 0.005)])
@pytest.mark.parametrize("jitter", [0.0, 0.05])
def test_some_thirty_samples_lost_at_random_leave_the_rate(rows, share, jitter):
    """So few lie near a straight line once in three times where the envelope is taken over seconds of rows."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        time = np.sort((np.arange(rows) + jitter * rng.standard_normal(rows)) / 600)
        interval = measure(np.diff(time[rng.random(rows) >= share]), unit=1.0)
        assert interval is not None
        assert abs(1 / interval / 600 - 1) < 1e-3


@pytest.mark.parametrize(("rate_hz", "tick"), [(125, 0.016), (62.5, 0.005), (125, 1 / 64), (104, 0.016)])
def test_how_rows_come_together_on_ticks_tells_the_rate_behind_losses(rate_hz, tick):
    rng = np.random.default_rng(3)
    for _ in range(5):
        time = (np.arange(4000) / rate_hz + rng.uniform(0, 1))[rng.random(4000) >= 0.08]
        interval = measure(np.diff(np.floor(time / tick + 1e-9) * tick), unit=1.0)
        assert interval == pytest.approx(1 / rate_hz, rel=1e-4)


@pytest.mark.parametrize("seed", range(8))
def test_losses_at_random_among_stamps_on_ticks_give_the_rate_or_a_refusal(seed):
    rng = np.random.default_rng(seed)
    rate_hz, tick = rng.choice([128, 125, 104, 64, 62.5]), rng.choice([0.016, 0.01, 1 / 64, 0.008, 0.005])
    rows = int(rng.choice([2000, 6000]))
    time = (np.arange(rows) / rate_hz + rng.uniform(0, tick))[rng.random(rows) >= rng.uniform(0.02, 0.08)]
    interval = measure(np.diff(np.floor(time / tick + 1e-9) * tick), unit=1.0)
    assert interval is not None
    assert np.isnan(interval) or abs(interval * rate_hz - 1) < 1e-3


@pytest.mark.parametrize("batch", [None, 1, 50, 999])
def test_batches_do_not_matter(batch):
    rng = np.random.default_rng(11)
    kept = np.flatnonzero(rng.random(3000) > 0.02)
    time = np.maximum.accumulate(stalled(np.arange(3000) / 100, 20, 0.02, 3))[kept] + rng.uniform(0, 1e-3, len(kept))
    assert_array_equal(losses(time, batch=batch)[1], losses(time)[1])


def test_a_host_that_stalls_loses_nothing(tmp_path):
    time = np.round(stalled(np.arange(4000) / 100, 20, 0.02, 3), 4)
    recording = read(timed_file(tmp_path, time))
    assert (len(recording.gyro_b), recording.rate_hz, recording.gaps) == (4000, 100, ())
    assert_array_equal(recording.gyro_b, still(4000)[0])


def test_a_stall_of_a_second_is_no_loss():
    # 100 rows wait in the queue of a host that sleeps 1 s, and come at 0.1 ms each.
    time = np.arange(3000) / 100
    time[1000:1100] = np.maximum(time[1000:1100], time[1100] + np.arange(100) * 1e-4)
    rate_hz, found = losses(np.maximum.accumulate(time))
    assert (round(rate_hz, 6), found.sum()) == (100, 0)


def test_a_gap_of_seconds_is_one_gap_of_its_length(tmp_path):
    kept = np.r_[0:1000, 1500:6000]
    recording = read(timed_file(tmp_path, kept / 100))
    assert [(gap.start, gap.samples) for gap in recording.gaps] == [(10.0, 500)]
    assert recording.duration == 60


def test_pairs_and_repeats_with_other_values_are_samples(tmp_path):
    time = np.arange(2000) / 100
    pairs = np.where((np.arange(2000) % 2 == 1) & (np.arange(2000) > 300), np.round(time - 0.01, 2), time)
    single = time.copy()
    single[2::25] = single[1::25]
    for stamps in (pairs, single):
        recording = read(timed_file(tmp_path, stamps))
        assert (len(recording.gyro_b), recording.gaps) == (2000, ())
        assert recording.rate_hz == pytest.approx(100, rel=1e-4)
        assert_array_equal(recording.gyro_b, still(2000)[0])


@pytest.mark.parametrize("wrap", [604800.0, 86400.0, 4294.967296])
def test_the_end_of_a_week_of_a_day_and_of_a_counter_is_followed(tmp_path, wrap):
    recording = read(timed_file(tmp_path, (np.arange(2000) / 100 + wrap - 9.99) % wrap))
    assert (len(recording.gyro_b), recording.rate_hz, recording.gaps) == (2000, 100, ())
    assert [note.code for note in recording.notes] == ["time_wraps"]


@pytest.mark.parametrize("step", [1, 2])
def test_whole_numbers_are_not_seconds_unless_one_says_so(step):
    time = 156496.0 + step * np.arange(500)
    block = rows_block(np.column_stack([time, *(part for triple in still(500) for part in triple.T)]), 0)

    def grid(**declared):
        source = Source("csv", "rec.csv", NAMES, lambda: iter(()), SI_FACTS, clock=Clock(unit=1.0))
        options = ReadOptions(**declared)
        return GridBuilder(source, resolve(source, options), options)

    with pytest.raises(InputError) as caught:
        grid().push(block)
    message = str(caught.value)
    for cure in ("--columns t=- --rate HZ", f"--columns t=- --rate {1000 / step:g}", f"--rate {1 / step:g}"):
        assert cure in message
    assert len(grid(rate_hz=1 / step).push(block)) == 500


def test_a_clock_too_coarse_is_refused_and_the_cure_works(tmp_path):
    time = np.floor(np.arange(2000) / 100 * 10) / 10
    path = timed_file(tmp_path, time)
    with pytest.raises(InputError, match=r"repeats the stamp before it in 90% of the rows.*--columns t=- --rate 100"):
        read(path)
    assert_array_equal(read(path, columns={"t": "-"}, rate_hz=100).gyro_b, still(2000)[0])


@pytest.mark.parametrize("factor", [0.5, 1.15])
def test_a_rate_that_changes_within_the_file_is_refused(factor):
    step = np.r_[np.full(4000, 0.01), np.full(12_000, 0.01 * factor)]
    values = np.column_stack([np.cumsum(step), *(part for triple in still(16_000) for part in triple.T)])
    source = Source("csv", "rec.csv", NAMES, lambda: iter(()), SI_FACTS, clock=Clock(unit=1.0))
    grid = GridBuilder(source, resolve(source, ReadOptions()), ReadOptions())
    blocks = (rows_block(values[start : start + 2000], start) for start in range(0, 16_000, 2000))
    with pytest.raises(InputError, match="the rate changes within the file"):
        list(map(grid.push, blocks))


@pytest.mark.parametrize(("rate_hz", "jitter"), [(100.01, 0.0), (100.0, 0.1), (2000.2, 0.05)])
@pytest.mark.parametrize("every", [12, 50])
def test_samples_lost_one_in_so_many_leave_the_rate_where_no_clock_ticks_so(rate_hz, jitter, every):
    time = (np.arange(4000) + jitter * np.random.default_rng(4).uniform(-0.5, 0.5, 4000)) / rate_hz
    kept = np.arange(4000) % every != every - 1
    found, lost = losses(time[kept])
    assert found == pytest.approx(rate_hz, rel=1e-4)
    assert lost.sum() == np.count_nonzero(~kept[:-1])


def test_samples_lost_one_in_so_many_are_told_from_ticks_of_10_ms_but_not_of_1_ms():
    kept = np.arange(4000) % 20 != 19
    assert losses(np.arange(4000)[kept] / 100)[0] == pytest.approx(100)
    assert losses(np.arange(4000)[kept] / 1000)[0] == pytest.approx(950, rel=1e-4)  # as 950 Hz in whole milliseconds


@pytest.mark.parametrize("late", [0.002, 0.01])
def test_one_gap_among_stamps_that_are_late_by_intervals_leaves_the_rate(late):
    rng = np.random.default_rng(6)
    kept = np.setdiff1d(np.arange(4000), np.arange(1500, 1560))
    time = np.maximum.accumulate(np.arange(4000) / 200 + rng.exponential(late, 4000))[kept]
    rate_hz, lost = losses(time)
    assert rate_hz == pytest.approx(200, rel=1e-3)
    assert abs(lost.sum() - 60) <= 2


def test_no_sample_is_invented_where_a_recording_ends_among_late_stamps():
    time = np.arange(3000) / 500
    time[2950:] = time[2950] + 0.2 + 1e-4 * np.arange(50)
    assert losses(time)[1].sum() == 0
    time[2950:] = 2950 / 500 + 0.2 + np.arange(50) / 500  # in step again: lost
    assert losses(time)[1].sum() == 100


def test_losses_that_late_stamps_hide_are_refused(tmp_path):
    rng = np.random.default_rng(7)
    time = np.maximum.accumulate(np.arange(6000) / 200 + rng.exponential(0.02, 6000))
    path = timed_file(tmp_path, time[rng.random(6000) > 0.06])
    with pytest.raises(InputError, match=r"late by more than a sample interval.*Declare the rate: --rate HZ"):
        read(path)
    assert len(read(path, rate_hz=200.0).gyro_b) == pytest.approx(6000, abs=5)
    with pytest.raises(InputError, match="missing"):
        read(path, rate_hz=210.0)
