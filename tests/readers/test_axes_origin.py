"""How axes are known: stated, declared, defined by the format or assumed; no chain of commands makes it more."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from still import SI, csv_file, rows_of, still

import gyronorth as gn
from gyronorth.errors import InputError
from gyronorth.readers import read, write
from gyronorth.readers.axes import about_vertical, in_axes, mat_bf
from gyronorth.recording import Recording

NO_AXES = tuple(line for line in SI if "axes" not in line)


def file_in(folder, axes, **kwargs):
    """A CSV in these axes that does not say so."""
    gyro, accel = (in_axes(part, mat_bf(axes).T) for part in still(1500))
    return csv_file(folder, rows_of([np.arange(1500) / 100, gyro, accel]), **kwargs)


def codes(recording):
    return [note.code for note in recording.notes]


def test_recordings_from_arrays_state_their_axes():
    recording = Recording(*still(10), 100.0)
    assert (recording.axes, recording.axes_origin) == ("frd", "stated")


def test_stated_and_declared_axes_do_not_warn(tmp_path):
    stated = read(file_in(tmp_path, "frd", comments=(*NO_AXES, "# axes: frd")))
    assert (stated.axes_origin, codes(stated)) == ("stated", [])
    declared = read(file_in(tmp_path, "rfu", comments=NO_AXES), axes="rfu")
    assert (declared.axes, declared.axes_origin, codes(declared)) == ("rfu", "declared", [])


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".npz", ".h5", ".parquet", ".mcap", ".bag"])
def test_assumed_axes_stay_assumed_whatever_they_are_written_to(tmp_path, suffix):
    first = read(file_in(tmp_path, "frd", comments=NO_AXES))
    assert (first.axes_origin, codes(first)) == ("assumed", ["axes_assumed"])
    for turn in range(2):
        write(first, path := tmp_path / f"copy{turn}{suffix}")
        again = read(path)
        assert (again.axes, again.axes_origin, codes(again)) == ("frd", "assumed", ["axes_assumed"])
        assert_array_equal(again.gyro_b, first.gyro_b)
        first = again
    # The numbers are those of the source: what is declared of it may be declared of the copy.
    assert_allclose(read(path, axes="rbd").gyro_b, read(file_in(tmp_path, "frd", comments=NO_AXES), axes="rbd").gyro_b)


@pytest.mark.slow
@pytest.mark.parametrize("axes", ["frd", "flu", "rfu", "dfr"])
def test_the_headings_of_the_other_axes_are_those_that_they_give(tmp_path, axes):
    path = file_in(tmp_path, axes, comments=NO_AXES)
    true = gn.heading(read(path, axes=axes), latitude=0.6).heading
    assert true is not None
    for other, added in about_vertical(axes):
        found = gn.heading(read(path, axes=other), latitude=0.6).heading
        assert found is not None
        assert np.cos(found - true - added) == pytest.approx(1, abs=1e-9)


def test_the_warning_names_the_other_headings(tmp_path):
    path = file_in(tmp_path, "frd", comments=NO_AXES)
    estimate = gn.heading(read(path), latitude=0.6)
    (warning,) = [finding for finding in estimate.warnings if finding.code == "axes_assumed"]
    assert estimate.heading is not None
    other = np.degrees(estimate.heading + np.pi / 2) % 360
    assert f"{other:.2f} deg with --axes lfd" in warning.message


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".npz", ".h5", ".parquet", ".mcap", ".bag"])
def test_a_warning_stays_whatever_a_recording_is_written_to(tmp_path, suffix):
    noisy = np.arange(1500) / 100 + 0.008 * np.abs(np.random.default_rng(1).standard_normal(1500))
    comments = (*NO_AXES, "# axes: frd")
    first = read(csv_file(tmp_path, rows_of([np.maximum.accumulate(noisy), *still(1500)]), comments=comments))
    assert "time_jitter" in codes(first)
    write(first, tmp_path / f"copy{suffix}")
    write(read(tmp_path / f"copy{suffix}"), path := tmp_path / f"again{suffix}")
    warned = next(note for note in read(path).notes if note.code == "time_jitter")
    assert warned.value == next(note.value for note in first.notes if note.code == "time_jitter")
    assert "was written from a recording of which is known" in warned.message


def test_a_damaged_warning_is_refused(tmp_path):
    with pytest.raises(InputError, match="warnings is 'nonsense=1'; CODE=VALUE"):
        read(csv_file(tmp_path, rows_of([np.arange(50) / 100, *still(50)]), comments=(*SI, "# warnings: nonsense=1")))
