"""Description of long files from some of their places."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ros_files import cdr, ros1, samples, write_bag1, write_bag2, write_mcap
from rosbags.rosbag2 import StoragePlugin
from scipy.stats import chi2
from still import HEADING, LATITUDE, SI, csv_file, csv_rows, rows_of, still

from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.readers import describe, outgoing, read, ros, text, write
from gyronorth.readers import probe as places
from gyronorth.readers.formats import hdf5, parquet
from gyronorth.recording import Gap, Recording
from gyronorth.report.recordings import print_description

RATE = 100.0
ROWS = 6000
FLU = np.array([1.0, -1.0, -1.0])
#: What `still` scatters about.
TRUTH = EARTH_RATE * np.array(
    [np.cos(LATITUDE) * np.cos(HEADING), -np.cos(LATITUDE) * np.sin(HEADING), -np.sin(LATITUDE)]
)


@pytest.fixture(autouse=True)
def long_at_once(monkeypatch):
    """Files of a few thousand rows count as long, and a place holds some hundred."""
    monkeypatch.setattr(places, "WHOLE", 0)
    monkeypatch.setattr(text, "PLACE_BYTES", 20_000)
    monkeypatch.setattr(hdf5, "BLOCK_ROWS", 150)
    monkeypatch.setattr(parquet, "BLOCK_ROWS", 150)
    monkeypatch.setattr(parquet, "GROUP_ROWS", 300)
    monkeypatch.setattr(outgoing, "BLOCK_ROWS", 150)  # a row group holds whole ones
    monkeypatch.setattr(ros, "PLACE_MESSAGES", 150)


def recording(rows: int = ROWS, **facts) -> Recording:
    return Recording(*still(rows), RATE, latitude=LATITUDE, **facts)


PLUGINS = {"folder": StoragePlugin.SQLITE3, "folder of mcap": StoragePlugin.MCAP}


def of_ros(folder, maker: str):
    rec = recording()
    assert rec.accel_b is not None
    of = samples(rec.gyro_b * FLU, rec.accel_b * FLU, RATE)
    serialise = ros1 if maker == "bag" else cdr
    topics = {"/imu": [(sample[0], serialise(sample)) for sample in of]}
    if maker == "bag":
        return write_bag1(folder / "rec.bag", topics)
    if maker == "mcap":
        return write_mcap(folder / "rec.mcap", topics, chunk_size=1 << 14)
    return write_bag2(
        folder / "rec", topics, StoragePlugin.MCAP if maker == "folder of mcap" else StoragePlugin.SQLITE3
    )


def path_of(folder, kind: str):
    if kind.startswith("."):
        write(recording(), folder / f"rec{kind}")
        return folder / f"rec{kind}"
    return of_ros(folder, kind)


KINDS = [".csv", ".h5", ".parquet", ".mcap", ".bag", "bag", "mcap", "folder", "folder of mcap"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind",
    # Files of ROS that we write and that others write, whole and split: one of each kind in every `make test`.
    [pytest.param(kind, marks=[pytest.mark.long] * (kind in (".bag", "mcap", "folder of mcap"))) for kind in KINDS],
)
def test_places_tell_what_the_whole_tells(tmp_path, monkeypatch, kind):
    path = path_of(tmp_path, kind)
    seen = describe(path)
    monkeypatch.setattr(places, "WHOLE", 10**9)
    whole = describe(path)
    assert whole.estimate is None
    assert seen.estimate is not None
    assert (seen.samples, seen.duration) == (whole.samples, whole.duration) == (ROWS, 60.0)
    assert replace(seen.info, rate_hz=0) == replace(whole.info, rate_hz=0)
    assert_allclose(seen.info.rate_hz, whole.info.rate_hz, rtol=1e-6)
    assert seen.gaps == ()
    assert seen.notes == whole.notes
    assert seen.estimate.places == 16
    assert seen.estimate.samples < ROWS / 2
    assert seen.estimate.missing == pytest.approx(0, abs=1e-3)
    # The means of the places scatter about the true one by the claimed sigma: chi-square, six axes, 99.9 %.
    sigma = 1e-5 / np.sqrt(seen.estimate.samples)
    deviation = (np.array(seen.rate_mean) - TRUTH) / sigma
    assert np.sum(deviation**2) < chi2.ppf(0.999, 3)
    # 15 degrees of freedom on each of three axes.
    ratio = np.sum(np.square(seen.estimate.rate_mean_sigma)) / sigma**2
    assert chi2.ppf(0.0005, 45) / 15 < ratio < chi2.ppf(0.9995, 45) / 15


@pytest.mark.slow
@pytest.mark.parametrize("kind", [".csv", ".h5", ".parquet", ".mcap"])
def test_gaps_that_our_files_state_are_told_of_anywhere(tmp_path, kind):
    gaps = (Gap(1.0, 3), Gap(31.7, 20), Gap(59.0, 2))
    write(recording(gaps=gaps, rows_dropped=2), tmp_path / f"rec{kind}")
    seen = describe(tmp_path / f"rec{kind}")
    assert seen.estimate is not None
    assert [(round(gap.start, 9), gap.samples) for gap in seen.gaps] == [(gap.start, gap.samples) for gap in gaps]
    assert seen.rows_dropped == 2
    assert {note.code for note in seen.notes} == {"gaps_bridged", "rows_dropped"}


def test_a_gap_between_the_places_shows_in_the_times(tmp_path):
    gyro, force = still(ROWS)
    time = np.arange(ROWS) / RATE
    time[3000:] += 0.9  # 90 samples, in no place that is read
    import h5py

    with h5py.File(tmp_path / "rec.h5", "w") as file:
        for name, column in zip(("t", "w_x", "w_y", "w_z"), (time, *gyro.T), strict=True):
            file[name] = column
    seen = describe(tmp_path / "rec.h5", gyro_unit="rad/s")
    assert seen.estimate is not None
    assert seen.estimate.samples_known
    assert seen.gaps == ()
    assert seen.estimate.missing == pytest.approx(90, abs=1e-3)
    assert seen.estimate.missing_sigma == pytest.approx(0, abs=1e-3)
    stream = io.StringIO()
    print_description(seen, stream)
    assert "none; by the first and the last time 90 ± 1 samples are missing in all" in stream.getvalue()
    assert len(read(tmp_path / "rec.h5", gyro_unit="rad/s").gyro_b) == ROWS + 90
    assert force.shape == gyro.shape


@pytest.mark.parametrize("timed", [True, False])
def test_a_csv_that_does_not_state_its_length_is_estimated(tmp_path, timed):
    gyro, force = still(ROWS)
    header = "t,w_x,w_y,w_z,f_x,f_y,f_z" if timed else "w_x,w_y,w_z,f_x,f_y,f_z"
    columns = [np.arange(ROWS) / RATE, *gyro.T, *force.T] if timed else [*gyro.T, *force.T]
    path = csv_file(tmp_path, rows_of(columns), header=header)
    seen = describe(path, rate_hz=None if timed else RATE)
    assert seen.estimate is not None
    assert not seen.estimate.samples_known
    assert seen.samples == ROWS if timed else abs(seen.samples / ROWS - 1) < 0.01
    stream = io.StringIO()
    print_description(seen, stream)
    printed = stream.getvalue()
    assert f"about {seen.samples} samples, about" in printed
    assert "16 places, " in printed
    assert "\nestimated from" in printed
    document = seen.to_json()["estimated_from"]
    assert (document["places"], document["missing"]) == (16, None)


@pytest.mark.slow
@pytest.mark.parametrize("row", [0, 2999, ROWS - 1])
def test_a_bad_row_where_one_looks_has_the_whole_file_read(tmp_path, row):
    rows = csv_rows(ROWS)
    rows[row] = rows[row].replace(",", ",x", 1)
    path = csv_file(tmp_path, rows)
    with pytest.raises(InputError, match=rf"Row {row + len(SI) + 2} of rec.csv: w_x is 'x"):
        describe(path) if row != 2999 else read(path)
    whole = describe(path, drop_bad_rows=True)
    if row != 2999:
        assert (whole.estimate, whole.rows_dropped) == (None, 1)


@pytest.mark.slow
def test_a_window_and_few_row_groups_are_read_whole(tmp_path, monkeypatch):
    write(recording(), tmp_path / "rec.parquet")
    assert describe(tmp_path / "rec.parquet", window=(0, 50)).samples == 5000
    monkeypatch.setattr(parquet, "GROUP_ROWS", 2000)
    write(recording(), tmp_path / "three.parquet")
    assert describe(tmp_path / "three.parquet").estimate is None


def test_jitter_where_one_looks_is_told(tmp_path):
    time = np.arange(ROWS) / RATE + np.random.default_rng(3).uniform(-0.0045, 0.0045, ROWS)
    path = csv_file(tmp_path, rows_of([time, *still(ROWS)[0].T]), header="t,w_x,w_y,w_z", comments=SI)
    seen = describe(path)
    assert seen.estimate is not None
    assert "time_jitter" in {note.code for note in seen.notes}
