from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from gyronorth.errors import InputError
from gyronorth.recording import Gap, Note, Recording, clip_gaps, gap_notes, shift_utc
from gyronorth.simulation import simulate


def ramp(samples: int = 100, rate_hz: float = 10.0, **facts) -> Recording:
    """Sample i holds i, -i and 2 i, so that a shifted window shows."""
    gyro = np.outer(np.arange(samples), [1.0, -1.0, 2.0]) * 1e-6
    return Recording(gyro, gyro - [0, 0, 9.8], rate_hz, **facts)


def test_duration_is_samples_over_rate():
    assert ramp(100, 10.0).duration == 10.0


def test_window_takes_its_samples_and_moves_the_start_time():
    part = ramp(start_time_utc="2024-05-01T12:00:00Z", heading_true=1.0).window(2.0, 3.5)
    assert_array_equal(part.gyro_b[:, 0], np.arange(20, 35) * 1e-6)
    assert part.accel_b is not None
    assert_allclose(part.accel_b[0], [20e-6, -20e-6, 40e-6 - 9.8], rtol=1e-15)
    assert part.start_time_utc == "2024-05-01T12:00:02Z"
    assert part.heading_true == 1.0


@pytest.mark.parametrize(("start", "end"), [(-1, 5), (5, 5), (6, 5), (0, 10.2), (0, np.nan), (np.inf, np.inf)])
def test_window_outside_the_recording_is_an_error_that_names_both(start, end):
    with pytest.raises(InputError, match=r"Window .* does not fit a recording of 10 s"):
        ramp().window(start, end)


def test_window_keeps_the_part_of_a_gap_that_is_inside():
    # Samples 18..22 and 90..92 are bridged; the window is samples 20..39.
    recording = ramp(gaps=(Gap(1.8, 5), Gap(9.0, 3)), notes=(Note("axes_suspect", "z is up"),))
    part = recording.window(2.0, 4.0)
    assert part.gaps == (Gap(0.0, 3),)
    assert [note.code for note in part.notes] == ["axes_suspect", "gaps_bridged"]
    assert "3 of 20 samples" in part.notes[1].message
    assert recording.window(3.0, 4.0).gaps == ()
    assert [note.code for note in recording.window(3.0, 4.0).notes] == ["axes_suspect"]


def test_clipped_gaps_of_neighbouring_parts_add_up():
    gaps = (Gap(0.5, 10), Gap(2.0, 25))
    parts = [clip_gaps(gaps, first, first + 10, rate_hz=10.0) for first in range(0, 60, 10)]
    assert sum(gap.samples for part in parts for gap in part) == 35


def test_no_gap_no_note():
    assert gap_notes((), samples=5) == ()


def test_rotated_turns_both_sensors():
    mat = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # a right turn of the axes: new x is old y
    turned = ramp().rotated(mat)
    assert_array_equal(turned.gyro_b[:, 0], ramp().gyro_b[:, 1])
    assert turned.accel_b is not None
    assert_allclose(turned.accel_b[:, 2], ramp().accel_b[:, 2])


def test_without_bias_subtracts_it():
    assert_allclose(ramp().without_bias([1e-6, 0, 0]).gyro_b[:, 0], (np.arange(100) - 1) * 1e-6, atol=1e-18)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gyro_b": np.zeros((4, 2))}, r"gyro_b has shape \(4, 2\)"),
        ({"gyro_b": np.zeros((0, 3))}, r"gyro_b has shape \(0, 3\)"),
        ({"gyro_b": [["a", "b", "c"]]}, "gyro_b is not an array of numbers"),
        ({"gyro_b": np.full((3, 3), np.nan)}, "gyro_b is not finite at sample 0"),
        ({"accel_b": np.zeros((5, 3))}, "accel_b has 5 samples, gyro_b 3"),
        ({"rate_hz": 0.0}, "rate_hz is 0"),
        ({"rate_hz": np.nan}, "rate_hz is nan"),
        ({"rate_hz": 1e9}, "rate_hz is 1e"),
        ({"latitude": 32.11}, "latitude is 32.11 rad, 1839.77 deg"),
        ({"latitude": np.nan}, "latitude is nan"),
        ({"heading_true": np.inf}, "heading_true is inf"),
        ({"start_time_utc": "yesterday"}, "start_time_utc is 'yesterday'"),
    ],
)
def test_what_makes_no_sense_is_an_input_error(change, message):
    fields = {"gyro_b": np.zeros((3, 3)), "accel_b": None, "rate_hz": 1.0} | change
    with pytest.raises(InputError, match=message):
        Recording(**fields)


def test_lists_become_arrays():
    assert Recording([[1, 2, 3]], None, 1.0).gyro_b.dtype == np.float64  # type: ignore[arg-type]


def test_times_without_a_zone_and_in_another_zone_are_utc_afterwards():
    assert shift_utc("2024-05-01T12:00:00", 0.5) == "2024-05-01T12:00:00.500000Z"
    assert shift_utc("2024-05-01T14:00:00+02:00", 0) == "2024-05-01T12:00:00Z"
    assert shift_utc(None, 3) is None
    with pytest.raises(InputError, match="leaves the calendar"):
        shift_utc("9999-12-31T23:59:59Z", 1e9)


@pytest.mark.slow
def test_every_command_chooses_the_latitude_alike():
    """Once `heading` refused a conflict that `calibrate` and `allan` passed over, each with a latitude of its own."""
    from gyronorth.allan import characterise
    from gyronorth.calibration import observe
    from gyronorth.pipeline import heading

    still = simulate("isa100c", latitude=0.56, heading=1.0, duration=70, rate_hz=10, rng=np.random.default_rng(0))
    for use in (
        lambda latitude: heading(still, latitude=latitude),
        lambda latitude: characterise(still, latitude=latitude),
        lambda latitude: observe(still, latitude),
    ):
        use(0.5601)  # within 0.1 deg: the given one counts
        with pytest.raises(InputError, match=r"may differ by 0\.1 deg"):
            use(0.6)
