"""What bags of ROS 1, bags of ROS 2 and MCAP files have in common: a topic of sensor_msgs/Imu as a `Source`.

Angular velocity is in rad/s, linear acceleration in m/s^2 and holds gravity's reaction, +g upwards at rest;
body axes are x forward, y left, z up (REP 103 and 145). A driver may do otherwise: declarations overrule. Time is
that of the messages' headers; where these are all zero, the time at which messages were logged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.facts import write_facts
from gyronorth.readers.imu_message import ImuBlock, decode, encode
from gyronorth.readers.outgoing import RecordingStream
from gyronorth.readers.source import DESCRIBED, FORCES, RATES, TIME, Bad, Block, Clock, Facts, Parts, Source
from gyronorth.recording import Note, ns_from_utc, utc_from_ns

#: Messages decoded at a time, and looked at in one place.
BLOCK_MESSAGES, PLACE_MESSAGES = 1 << 14, 1 << 10
#: Stamps before this, s since 1970 (September 2001), count from a start of their own (simulation, boot).
EARLIEST_DATE = 1_000_000_000
#: Seconds of ROS are 32-bit numbers: a recording that begins later is written as time from its start.
LATEST_START = 2_100_000_000
#: How zstd begins.
ZSTD = b"\x28\xb5\x2f\xfd"
#: The topic that is written.
TOPIC = "/imu/data_raw"
_USUAL = Facts(gyro_unit="rad/s", accel_unit="m/s2", axes="flu")
_STAMP, _LOG_TIME = "header.stamp", "log time"

#: Messages of the topic from a log time on (None: all), up to another: (log time, ns, serialised message).
Messages = Callable[[int | None, int | None], Iterable[tuple[int, bytes]]]


@dataclass(frozen=True)
class ImuTopic:
    """A topic of Imu messages in a file."""

    name: str
    count: int  # messages
    start: int  # log time of the file's first message, ns
    stop: int  # and of its last one
    cdr: bool  # serialised by ROS 2; else by ROS 1
    messages: Messages
    exact: bool = True  # `count` is that; else about


@dataclass(frozen=True)
class _Kind:
    """What the first messages show, which must hold for all."""

    cdr: bool
    logged: bool  # time is the log time
    accel: bool
    zero: int  # ns, the time of the first message


def imu_source(name: str, format: str, topic: ImuTopic, *, facts: Facts | None = None) -> Source:
    """The recording in a topic; with `facts`, gyronorth wrote the file.

    Parameters
    ----------
    name : str
        File name, for messages.
    format : str
        Name of the format.
    topic : ImuTopic
        What is read.
    facts : Facts, optional
        What the file states.
    """
    head = list(islice(topic.messages(None, None), 1000))
    if not head:
        raise InputError(f"{name}: topic {topic.name} holds no messages.")
    block, logged = _decode(head, cdr=topic.cdr)
    if bytes(head[0][1][:4]) == ZSTD:
        raise InputError(
            f"{name}: the messages of {topic.name} are compressed, each on its own, as metadata.yaml in the folder "
            "of the bag says. Give that folder."
        )
    if block.broken[0]:
        raise InputError(
            f"{name}: the first message of {topic.name} has {len(head[0][1])} bytes that are no sensor_msgs/Imu: the "
            "file is damaged, or another message has that name."
        )
    if block.rate_absent.all():
        raise InputError(
            f"{name}: topic {topic.name} holds no angular velocity (its covariance begins with -1). Give another topic."
        )
    unstamped = not block.stamp[~block.broken].any() and len(head) > 1
    time = logged if unstamped else block.stamp
    kind = _Kind(topic.cdr, unstamped, not block.force_absent.all(), int(time[0]))
    started = kind.zero >= EARLIEST_DATE * 1_000_000_000
    stated = facts or Facts(start_time_utc=utc_from_ns(kind.zero) if started else None)
    notes = ()
    if unstamped:
        message = f"All stamps in {topic.name} of {name} are 0; the times at which its messages were logged are used."
        notes = (Note("log_time_used", message),)
    return Source(
        format=format,
        name=name,
        columns=(TIME, *RATES, *FORCES) if kind.accel else (TIME, *RATES),
        blocks=partial(_blocks, topic, kind),
        stated=stated,
        usual=_USUAL,
        clock=Clock(unit=1.0, name=_LOG_TIME if unstamped else _STAMP),
        ours=facts is not None,
        topic=topic.name,
        notes=notes,
        parts=Parts(topic.count, exact=topic.exact, block=PLACE_MESSAGES, read=partial(_part, topic, kind)),
    )


def first_stamp(outgoing: RecordingStream) -> int:
    """Stamp of the first message, ns: the date where one is known and fits, else 0."""
    start = 0 if outgoing.start_time_utc is None else ns_from_utc(outgoing.start_time_utc)
    return start if 0 <= start < LATEST_START * 1_000_000_000 else 0


def ros_messages(outgoing: RecordingStream, start: int, *, cdr: bool) -> Iterator[tuple[list[int], list[memoryview]]]:
    """Stamps, ns, and serialised messages in forward-left-up axes, block by block."""
    flu = np.array([1.0, -1.0, -1.0]) if outgoing.axes_assumed is None else np.ones(3)
    for rows in outgoing.rows():
        numbers = rows.numbers()
        stamp = start + np.rint(numbers / outgoing.rate_hz * 1e9).astype(np.int64)
        force = None if rows.accel_b is None else rows.accel_b * flu
        yield stamp.tolist(), encode(stamp, rows.gyro_b * flu, force, first=rows.first, cdr=cdr)


def ros_texts(outgoing: RecordingStream) -> dict[str, str]:
    """The facts by key, as they hold for messages in forward-left-up axes."""
    return write_facts(replace(outgoing.facts, axes="flu" if outgoing.axes_assumed is None else None))


def _blocks(topic: ImuTopic, kind: _Kind) -> Iterator[Block]:
    messages = iter(topic.messages(None, None))
    row = 0
    while held := list(islice(messages, BLOCK_MESSAGES)):
        block = _block(held, row, kind)
        row += len(held)
        yield replace(block, share=min(1.0, row / max(topic.count, 1)))


def _part(topic: ImuTopic, kind: _Kind, share: float) -> Block:
    """A block of messages from where `share` of the time has passed; 1: the last ones."""
    length = topic.stop - topic.start
    long = round(length * min(1.0, PLACE_MESSAGES / max(topic.count, 1)))
    begin = topic.start + round(share * (length - long))
    held = list(topic.messages(begin, begin + long + 1))
    return _block(held, round(share * (topic.count - len(held))), kind)


def _decode(held: list[tuple[int, bytes]], *, cdr: bool) -> tuple[ImuBlock, NDArray[np.int64]]:
    logged = np.fromiter((time for time, _ in held), dtype=np.int64, count=len(held))
    return decode([message for _, message in held], cdr=cdr), logged


def _block(held: list[tuple[int, bytes]], row: int, kind: _Kind) -> Block:
    """Messages behind the first `row` ones as a block of rows."""
    block, logged = _decode(held, cdr=kind.cdr)
    time = ((logged if kind.logged else block.stamp) - kind.zero) * 1e-9
    columns = [time[:, None], block.rate] + ([block.force] if kind.accel else [])
    rows = np.arange(row + 1, row + 1 + len(held))
    wrong = [
        (block.broken, "it is no sensor_msgs/Imu"),
        (block.rate_absent, "its angular velocity is marked as absent"),
        (block.force_absent & kind.accel, "its linear acceleration is marked as absent"),
        (~block.broken & kind.logged & (block.stamp != 0), "its header has a time, those at the beginning have none"),
    ]
    bad = np.any([flags for flags, _ in wrong], axis=0)
    if not bad.any():
        return Block(np.hstack(columns), rows, Bad.none())
    reasons = [(int(rows[i]), why) for flags, why in wrong for i in np.flatnonzero(flags)[:DESCRIBED]]
    return Block(np.hstack(columns)[~bad], rows[~bad], Bad(rows[bad], tuple(sorted(reasons)[:DESCRIBED])))
