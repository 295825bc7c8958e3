"""sensor_msgs/Imu as bytes: blocks of serialised messages to numbers and back, without a loop over messages.

The layout is fixed but for the length of `frame_id`: a header of 12 bytes (ROS 1: seq, seconds,
nanoseconds; CDR of ROS 2: encapsulation, seconds, nanoseconds), the length of the text and the text,
in CDR padded to 8 bytes, then 37 doubles: orientation, angular velocity, linear acceleration,
each with its covariance behind it. A covariance that begins with -1 says that the quantity is absent
(comment in the message's definition).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError

#: Name of the message, as ROS 1 and as ROS 2 write it.
IMU_TYPES = ("sensor_msgs/Imu", "sensor_msgs/msg/Imu")
_DOUBLES = 37
_RATE, _RATE_ABSENT, _FORCE, _FORCE_ABSENT, _ORIENTATION_ABSENT = slice(13, 16), 16, slice(25, 28), 28, 4
_LONGEST_FRAME_ID = 4096
#: What is written: frame_id "imu".
_FRAME_ID = b"imu"


@dataclass(frozen=True)
class ImuBlock:
    """Consecutive messages."""

    stamp: NDArray[np.int64]  # (n,) of the header, ns
    rate: NDArray[np.float64]  # (n, 3) angular velocity, rad/s
    force: NDArray[np.float64]  # (n, 3) linear acceleration, m/s^2
    rate_absent: NDArray[np.bool_]  # (n,) by the covariance
    force_absent: NDArray[np.bool_]
    broken: NDArray[np.bool_]  # (n,) no such message


def decode(messages: Sequence[bytes], *, cdr: bool) -> ImuBlock:
    """Numbers of serialised messages, CDR of ROS 2 or the serialisation of ROS 1."""
    stamp, doubles = np.zeros(len(messages), dtype=np.int64), np.full((len(messages), _DOUBLES), np.nan)
    broken = np.ones(len(messages), dtype=bool)
    sizes = np.fromiter(map(len, messages), dtype=np.int64, count=len(messages))
    for size in np.unique(sizes).tolist():
        these = np.flatnonzero(sizes == size)
        if not 16 + 8 * _DOUBLES <= size <= 32 + 8 * _DOUBLES + _LONGEST_FRAME_ID:
            continue
        alike = messages if len(these) == len(messages) else [messages[i] for i in these.tolist()]
        raw = np.frombuffer(b"".join(alike), dtype=np.uint8).reshape(-1, size)
        for big_endian in (False, True):
            lead = (raw[:, 0] == 0) & (raw[:, 1] == (0 if big_endian else 1))
            part = lead if cdr else np.full(len(raw), not big_endian)
            if part.any():
                ours = these[part]
                stamp[ours], doubles[ours], good = _decoded(raw[part], cdr=cdr, order=">" if big_endian else "<")
                broken[ours] = ~good
    doubles[broken] = np.nan
    return ImuBlock(
        stamp=stamp,
        rate=doubles[:, _RATE],
        force=doubles[:, _FORCE],
        rate_absent=doubles[:, _RATE_ABSENT] == -1,
        force_absent=doubles[:, _FORCE_ABSENT] == -1,
        broken=broken,
    )


def _decoded(
    raw: NDArray[np.uint8], *, cdr: bool, order: str
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
    """Stamps, doubles and whether the sizes agree, of messages of one size (n, size)."""

    def field(start: int, stop: int, kind: str) -> NDArray[np.int64]:
        return np.ascontiguousarray(raw[:, start:stop]).view(order + kind)[:, 0].astype(np.int64)

    seconds, nanoseconds, length = field(4, 8, "i4" if cdr else "u4"), field(8, 12, "u4"), field(12, 16, "u4")
    start = 4 + -(-(12 + length) // 8) * 8 if cdr else 16 + length
    good = (start + 8 * _DOUBLES == raw.shape[1]) & (nanoseconds < 1_000_000_000)
    doubles = np.ascontiguousarray(raw[:, -8 * _DOUBLES :]).view(order + "f8").astype(np.float64)
    return seconds * 1_000_000_000 + nanoseconds, doubles, good


def encode(
    stamp: NDArray[np.int64], rate: NDArray[np.float64], force: NDArray[np.float64] | None, *, first: int, cdr: bool
) -> list[memoryview]:
    """Serialised messages of stamps (n,), ns, rates and forces (n, 3); `first` counts messages from the first one."""
    text = _FRAME_ID + b"\x00" if cdr else _FRAME_ID
    start = 4 + -(-(12 + len(text)) // 8) * 8 if cdr else 16 + len(text)
    size = start + 8 * _DOUBLES
    layout = np.dtype(
        {
            "names": ["lead", "seconds", "nanoseconds", "length", "text", "doubles"],
            "formats": ["<u4", "<u4", "<u4", "<u4", f"V{len(text)}", ("<f8", (_DOUBLES,))],
            "offsets": [0, 4, 8, 12, 16, start],
            "itemsize": size,
        }
    )
    raw = np.zeros(len(stamp) * size, dtype=np.uint8)
    messages = raw.view(layout)
    # The lead is the encapsulation of little-endian CDR, bytes 00 01 00 00, or the sequence number of ROS 1.
    messages["lead"] = 0x0100 if cdr else (first + np.arange(len(stamp))) % 2**32
    messages["seconds"], messages["nanoseconds"] = np.divmod(stamp, 1_000_000_000)
    messages["length"], messages["text"] = len(text), np.void(text)
    doubles = messages["doubles"]
    doubles[:, _ORIENTATION_ABSENT] = -1
    doubles[:, _RATE] = rate
    if force is None:
        doubles[:, _FORCE_ABSENT] = -1
    else:
        doubles[:, _FORCE] = force
    content = memoryview(raw.tobytes())
    return [content[i : i + size] for i in range(0, len(content), size)]


def _custom(other: Sequence[str]) -> str:
    """What there is to say of topics that seem to hold an IMU in a message of somebody's own."""
    own = [text for text in other if re.search(r"imu|ins|gyro|inertial", text.rsplit("(", 1)[-1], re.IGNORECASE)]
    if not own:
        return ""
    return (
        f" {' and '.join(own[:4])}: an IMU perhaps, in messages of the driver's own. The file holds no definition of "
        "them, or their names show no triple of angular rates and one of forces: then name the "
        f"topic, --topic {own[0].split(' ')[0]}. Else record its {IMU_TYPES[0]} (often /imu or /imu/data), or write "
        f"the topic as text, rostopic echo -b BAG -p {own[0].split(' ')[0]} > imu.csv, and declare its columns."
    )


def choose_topic(topics: dict[str, int], wanted: str | None, name: str, other: Sequence[str]) -> str:
    """The topic that is read: the one declared, or the only one of Imu messages.

    Parameters
    ----------
    topics : dict
        Topics of Imu messages with the number of messages of each.
    wanted : str or None
        What the user declared.
    name : str
        File name, for messages.
    other : sequence of str
        The file's other topics with their types, for messages.
    """
    listed = ", ".join(f"{topic} ({count} messages)" for topic, count in list(topics.items())[:12])
    if wanted is not None:
        if wanted in topics:
            return wanted
        is_other = next((text for text in other if text.split(" ")[0] == wanted), None)
        holds = f"its topics of {IMU_TYPES[0]} are {listed}" if topics else f"it has no topic of {IMU_TYPES[0]}"
        raise InputError(
            f"{name}: topic {is_other} holds no {IMU_TYPES[0]}; {holds}."
            if is_other
            else f"{name} has no topic {wanted!r}; {holds}."
        )
    if not topics:
        there = ", ".join(other[:12]) + (f" and {len(other) - 12} more" if len(other) > 12 else "")
        raise InputError(f"{name} has no topic of {IMU_TYPES[0]}; it holds {there or 'no topic'}.{_custom(other)}")
    if len(topics) > 1:
        first = next(iter(topics))
        raise InputError(
            f"{name} has {len(topics)} topics of {IMU_TYPES[0]}: {listed}. Say which one: --topic NAME, as in --topic "
            f"{first}."
        )
    return next(iter(topics))
