"""Poses that are files of their own: joined into one recording whose turns nobody measured.

Between two files stands a turn of `TURN` s that leads from the attitude of one to that of the next. Roll and pitch come
from the accelerometer (level without one), the change of heading is given. The turn only brings the model near: the
fit lets its attitude free and takes the given angle with its sigma.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gyronorth.alignment.turned.segments import Segments, find_segments
from gyronorth.arrays import Array
from gyronorth.attitude import level, mat_bn, rotation_vector
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.recording import Recording

#: Length of the turn that stands between two files, s.
TURN = 1.0


def one_recording(recordings: Sequence[Recording], turn_angles: Sequence[float] | None) -> tuple[Recording, Segments]:
    """One recording of all poses, with its segments.

    Parameters
    ----------
    recordings : sequence of Recording
        One still pose each, of one unit and one power-up, in order of time.
    turn_angles : sequence of float
        Change of the heading from each to the next, rad, clockwise from above; 0 where it was kept.

    Raises
    ------
    InputError
        If there are fewer than two, the angles are missing or not one fewer, or the recordings do not fit together or
        hold a turn themselves.
    """
    _check(recordings, turn_angles)
    assert turn_angles is not None
    first = recordings[0]
    rate_hz, heading = first.rate_hz, 0.0
    gyro, accel, stretches, start = list[Array](), list[Array](), list[tuple[int, int]](), 0
    before: Array | None = None
    for recording, turn in zip(recordings, (0.0, *turn_angles), strict=True):
        heading += turn
        down = np.array([0.0, 0.0, -STANDARD_GRAVITY]) if recording.accel_b is None else recording.accel_b.mean(axis=0)
        roll, pitch = level(down)
        attitude = mat_bn(float(roll), float(pitch), heading).T
        if before is not None:
            count = max(2, round(TURN * rate_hz))
            rate = rotation_vector(before.T @ attitude) * rate_hz / count
            gyro.append(np.tile(rate, (count, 1)))
            accel.append(np.tile(down, (count, 1)))
            start += count
        gyro.append(recording.gyro_b)
        accel.append(recording.accel_b if recording.accel_b is not None else np.tile(down, (len(recording.gyro_b), 1)))
        stretches.append((start, start + len(recording.gyro_b)))
        start, before = start + len(recording.gyro_b), attitude
    whole = replace(
        first,
        gyro_b=np.concatenate(gyro),
        accel_b=None if first.accel_b is None else np.concatenate(accel),
        heading_true=recordings[-1].heading_true,
        gaps=(),
        notes=tuple(note for recording in recordings for note in recording.notes),
    )
    return whole, Segments(tuple(stretches), tuple(range(len(stretches))), (), measured=False)


def _check(recordings: Sequence[Recording], turn_angles: Sequence[float] | None) -> None:
    count, first = len(recordings), recordings[0] if recordings else None
    if first is None or count < 2:
        raise InputError(f"{count} recordings were given as poses; two or more are expected.")
    if turn_angles is None or len(turn_angles) != count - 1:
        given = "no turn angles" if turn_angles is None else f"{len(turn_angles)} turn angles"
        raise InputError(
            f"{count} files are {count} poses, and {given} came with them. The accelerometer shows roll and pitch of "
            f"each file, and nothing shows how far its heading turned: give {count - 1} by --turn-angles, 0 where the "
            "heading was kept, or record poses and turns in one file."
        )
    if not np.isfinite(turn_angles).all():
        raise InputError(f"Turn angles of {turn_angles} rad were given; finite angles are expected.")
    for number, recording in enumerate(recordings):
        name = recording.source or f"Recording {number + 1}"
        if recording.rate_hz != first.rate_hz:
            raise InputError(
                f"{name} has {recording.rate_hz:g} Hz, the first file {first.rate_hz:g} Hz; poses of one rate are "
                "expected. Bring them to one by gyronorth convert --decimate-to."
            )
        if (recording.accel_b is None) != (first.accel_b is None):
            raise InputError(f"{name} and the first file differ in having an accelerometer; all or none are expected.")
        found = find_segments(recording.gyro_b, recording.accel_b, rate_hz=recording.rate_hz)
        if found.poses > 1:
            raise InputError(
                f"{name} holds {found.poses} poses; one still pose in each file is expected. Cut it with --window, or "
                "give it alone."
            )
