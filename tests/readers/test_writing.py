"""Write and read back; describe."""

from __future__ import annotations

import json
import os
import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from still import HEADING, LATITUDE, SI, csv_file, csv_rows, still

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.catalogue import WRITTEN_SUFFIXES
from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.readers import describe, read, write
from gyronorth.recording import Gap, Recording


def awkward(rows: int = 500, *, accel: bool = True, **facts) -> Recording:
    """Samples with many digits, negative zero, the smallest and large numbers."""
    gyro, force = still(rows)
    gyro[3] = [-0.0, 5e-324, 1 / 3]
    gyro[4] = [np.pi, -34.999, 1e-300]
    return Recording(gyro, force if accel else None, 600.0000123, **facts)


FACTS = {
    "latitude": LATITUDE,
    "heading_true": HEADING,
    "session": "bench 3; unit 7, día 2",
    "start_time_utc": "2024-05-01T12:00:00.25Z",
    "rows_dropped": 3,
    "gaps": (Gap(0.05, 2), Gap(1 / 3, 1)),
}


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".npz", ".CSV", ".h5", ".hdf5", ".parquet", ".mcap", ".bag"])
@pytest.mark.parametrize("accel", [True, False])
@pytest.mark.parametrize("facts", [{}, FACTS])
def test_what_is_written_reads_back_bit_for_bit(tmp_path, suffix, accel, facts):
    recording = awkward(accel=accel, **facts)
    write(recording, tmp_path / f"rec{suffix}")
    back = read(tmp_path / f"rec{suffix}")
    assert back.gyro_b.tobytes() == recording.gyro_b.tobytes()
    if accel:
        assert back.accel_b is not None
        assert recording.accel_b is not None
        assert back.accel_b.tobytes() == recording.accel_b.tobytes()
    else:
        assert back.accel_b is None
    for name in ("rate_hz", "latitude", "heading_true", "session", "start_time_utc", "rows_dropped"):
        assert getattr(back, name) == getattr(recording, name), name
    assert [gap.samples for gap in back.gaps] == [gap.samples for gap in recording.gaps]
    starts = [[gap.start for gap in of.gaps] for of in (back, recording)]
    assert_allclose(starts[0], starts[1], atol=0.5 / recording.rate_hz)  # to the sample
    assert {note.code for note in back.notes} == ({"gaps_bridged", "rows_dropped"} if facts else set())
    assert os.listdir(tmp_path) == [f"rec{suffix}"]


def test_gaps_of_the_file_are_cut_by_a_window(tmp_path):
    gyro, force = still(600)
    write(Recording(gyro, force, 100.0, gaps=(Gap(1.0, 5), Gap(4.0, 7))), tmp_path / "rec.csv")
    assert read(tmp_path / "rec.csv", window=(3.0, 4.03)).gaps == (Gap(1.0, 3),)


def test_a_heading_of_a_written_file_lies_within_a_turn(tmp_path):
    write(awkward(heading_true=-0.1), tmp_path / "rec.csv")
    assert read(tmp_path / "rec.csv").heading_true == pytest.approx(2 * np.pi - 0.1)


def test_a_written_file_replaces_the_old_one_whole(tmp_path):
    path = tmp_path / "rec.npz"
    path.write_text("old")
    write(awkward(20), path)
    assert len(read(path).gyro_b) == 20


def test_a_failing_write_leaves_the_old_file_and_no_other(tmp_path):
    path = tmp_path / "rec.csv"
    path.write_text("old")
    with pytest.raises(InputError, match="session is 'two\\\\nlines'; one line of text"):
        write(awkward(session="two\nlines"), path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["rec.csv"]


def test_places_and_suffixes_that_cannot_be_written(tmp_path):
    with pytest.raises(InputError, match=r"rec.mat: a recording is written as .csv, .npz, .h5, .* or .mcap"):
        write(awkward(), tmp_path / "rec.mat")
    with pytest.raises(InputError, match="cannot be written: No such file or directory"):
        write(awkward(), tmp_path / "none" / "rec.csv")


def test_description_of_a_file(tmp_path):
    rows = csv_rows(1000)
    rows[10] = "broken\n"
    path = csv_file(tmp_path, rows, comments=[*SI, "# latitude_deg: 32.11", "# heading_true_deg: 40"])
    description = describe(path, drop_bad_rows=True, chunk_samples=300)
    whole = read(path, drop_bad_rows=True)
    assert (description.samples, description.duration, description.rows_dropped) == (1000, 10.0, 1)
    assert_allclose(description.rate_mean, whole.gyro_b.mean(0), rtol=1e-12)
    assert whole.accel_b is not None
    assert_allclose(description.force_mean, whole.accel_b.mean(0), rtol=1e-9, atol=1e-12)
    assert description.gaps == whole.gaps
    assert {note.code for note in description.notes} == {note.code for note in whole.notes}
    document = json.loads(json.dumps(description.to_json(), allow_nan=False))
    assert document["columns"] == ["t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z"]
    assert (document["format"], document["rate_hz"], document["axes"]) == ("csv", 100, "frd")
    assert (document["latitude_deg"], document["heading_true_deg"]) == (pytest.approx(32.11), pytest.approx(40))
    # The body at rest senses Earth rate, 15.04 deg/h; the mean of 1,000 samples scatters by 0.07 deg/h.
    assert document["rate_norm_deg_h"] == pytest.approx(EARTH_RATE / DEG_PER_HOUR, abs=0.3)
    assert document["rate_norm_earth_rates"] == pytest.approx(1, abs=0.02)


def test_description_without_an_accelerometer(tmp_path):
    write(awkward(accel=False), tmp_path / "rec.npz")
    description = describe(tmp_path / "rec.npz")
    assert description.force_mean is None
    assert description.info.accel_unit is None
    assert description.to_json()["force_mean_m_s2"] is None


def test_reading_does_not_change_what_was_read(tmp_path):
    """Two reads of one file give separate arrays."""
    write(awkward(), tmp_path / "rec.npz")
    first = read(tmp_path / "rec.npz")
    first.gyro_b[:] = 0
    assert_array_equal(read(tmp_path / "rec.npz").gyro_b, awkward().gyro_b)


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_a_file_whose_undeclared_axes_gravity_contradicts_is_not_rewritten(tmp_path: Path, suffix: str) -> None:
    source, target = tmp_path / "up.csv", tmp_path / f"out{suffix}"
    rows = "".join(f"{k / 100},1e-5,-2e-5,5e-5,0.01,0.02,9.807\n" for k in range(300))
    source.write_text("t,w_x,w_y,w_z,f_x,f_y,f_z\n" + rows)
    units = {"gyro_unit": "rad/s", "accel_unit": "m/s2"}
    with pytest.raises(InputError, match="Declare them: --axes"):
        write(read(source, **units), target)
    assert not target.exists()
    write(read(source, axes="rfu", **units), target)
    assert read(target).accel_b[:, 2].mean() == pytest.approx(-9.807)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".npz", ".h5", ".parquet", ".mcap", ".bag"])
def test_a_recording_slower_than_one_sample_a_second_reads_back(tmp_path: Path, suffix: str) -> None:
    gyro, force = still(100)
    write(Recording(gyro, force, 0.5), tmp_path / f"slow{suffix}")
    assert read(tmp_path / f"slow{suffix}").rate_hz == 0.5


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """No file may grow beyond so many bytes, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def writers() -> dict[str, Callable[[Path], object]]:
    """Everything of the API that writes a file, by what its name ends in."""
    from gyronorth import read_sensor, write_sensor
    from gyronorth.deviation import fit_deviation
    from gyronorth.learn.settings import paper, write_settings
    from gyronorth.many.table import write_table
    from gyronorth.report.tables import Outcome

    recording = Recording(np.full((600, 3), 5e-5), np.tile([0.0, 0.0, -9.8], (600, 1)), 1.0)
    angle = np.arange(7.0)
    curve = fit_deviation(angle + np.sin(angle) / 9, angle / 99, angle)
    rows = [Outcome("rec.csv", message="damaged")] * 9
    return {
        **{f"recording{suffix}": lambda path: write(recording, path) for suffix in WRITTEN_SUFFIXES},
        "sensor.json": lambda path: write_sensor(read_sensor("stim300"), path),
        "curve.json": curve.write,
        "settings.yaml": lambda path: write_settings(paper(), path),
        "table.csv": lambda path: write_table(path, "{}", rows),
        "table.parquet": lambda path: write_table(path, "{}", rows),
    }


#: Names of files that the API writes.
WRITTEN = (*(f"recording{suffix}" for suffix in WRITTEN_SUFFIXES), "sensor.json", "curve.json", "settings.yaml",
           "table.csv", "table.parquet")  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITTEN)
def test_on_a_full_disk_the_old_file_is_whole(tmp_path, name):
    path = tmp_path / name
    use = writers()[name]
    use(path)  # libraries are loaded, and it works
    path.write_text("before")
    with room_for(100), pytest.raises(InputError, match="cannot be written"):
        use(path)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]
