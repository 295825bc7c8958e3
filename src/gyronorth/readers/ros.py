"""What bags of ROS 1, bags of ROS 2 and MCAP files have in common: a topic of sensor_msgs/Imu as a `Source`.

Angular velocity is in rad/s, linear acceleration in m/s^2 and holds gravity's reaction, +g upwards at rest;
body axes are x forward, y left, z up (REP 103 and 145). A driver may do otherwise: declarations overrule. Time is
that of the messages' headers; where these are all zero, the time at which messages were logged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.facts import write_facts
from gyronorth.readers.imu_message import ImuBlock, choose_topic, decode, encode
from gyronorth.readers.joining import joined
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.outgoing import RecordingStream
from gyronorth.readers.source import DESCRIBED, FORCES, RATES, TIME, Bad, Block, Clock, Facts, Parts, Source
from gyronorth.recording import Note, ns_from_utc, utc_from_ns

#: Messages decoded at a time, and looked at in one place.
BLOCK_MESSAGES, PLACE_MESSAGES = 1 << 14, 1 << 10
#: Messages at the beginning that show what a topic holds, topics that are looked into, and the least share of messages
#: with one sensor where each message holds one.
LOOKED_AT, MOST_SPLIT, FEWEST_OF_A_KIND = 1000, 8, 0.05
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
    rate: bool
    accel: bool
    zero: int  # ns, the time of the first message
    only: str = ""  # of messages that hold one sensor each: "gyro" or "accel", those of it


def topics_source(
    name: str,
    format: str,
    topics: dict[str, int],
    other: Sequence[str],
    make: Callable[[str], ImuTopic],
    options: ReadOptions,
    *,
    facts: Facts | None = None,
) -> Source:
    """The recording in a file with topics: the one chosen, or two of which one holds each sensor.

    Parameters
    ----------
    name, format : str
        File name, for messages, and name of the format.
    topics : dict
        Topics of Imu messages with the number of messages of each.
    other : sequence of str
        The other topics with their types, for messages.
    make : callable
        The topic of a name.
    options : ReadOptions
        Declarations.
    facts : Facts, optional
        What the file states; then gyronorth wrote it.
    """
    if options.columns and topics:
        raise InputError(f"columns does not apply to {name}: its messages name their own fields.")
    gyro, accel = options.topic, options.accel_topic
    if accel is None and gyro is None and len(topics) > 1:
        gyro, accel = _split(topics, make)
    if accel is not None:
        choose_topic(topics, accel, name, other)
        rest = {topic: count for topic, count in topics.items() if topic != accel}
        gyro = choose_topic(rest if gyro is None else topics, gyro, name, other)
        sources = (
            imu_source(name, format, make(gyro)),
            imu_source(name, format, make(accel), sensor="accel"),
        )
        return joined(*sources, drop_bad_rows=options.drop_bad_rows)
    topic = choose_topic(topics, gyro, name, other)
    if options.needed == FORCES:
        return imu_source(name, format, make(topic), sensor="accel")
    return imu_source(name, format, make(topic), facts=facts, drop_bad_rows=options.drop_bad_rows)


def _split(topics: dict[str, int], make: Callable[[str], ImuTopic]) -> tuple[str | None, str | None]:
    """The topics of the gyroscope and of the accelerometer, where one each holds that sensor alone."""
    held: dict[str, list[str]] = {"gyro": [], "accel": [], "both": []}
    for topic in list(topics)[:MOST_SPLIT]:
        head = list(islice(make(topic).messages(None, None), LOOKED_AT))
        if head and topics[topic]:
            block, _ = _decode(head, cdr=make(topic).cdr)
            rate, force = _holds(block.rate, block.rate_absent), _holds(block.force, block.force_absent)
            held["both" if rate.any() and force.any() else "gyro" if rate.any() else "accel"].append(topic)
    if len(held["gyro"]) == len(held["accel"]) == 1 and not held["both"]:
        return held["gyro"][0], held["accel"][0]
    return None, None


def _holds(values: NDArray[np.float64], absent: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which messages hold a quantity (n, 3): drivers leave zeros where they have none."""
    return ~absent & (values != 0).any(axis=1)


def imu_source(
    name: str,
    format: str,
    topic: ImuTopic,
    *,
    facts: Facts | None = None,
    sensor: str = "both",
    drop_bad_rows: bool = False,
) -> Source:
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
    sensor : str, optional
        "accel": only that, for a gyroscope's topic to be joined with.
    drop_bad_rows : bool, optional
        Where messages of two kinds are joined.
    """
    head = list(islice(topic.messages(None, None), LOOKED_AT))
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
    rate, force = _holds(block.rate, block.rate_absent), _holds(block.force, block.force_absent)
    if sensor == "accel" and not force.any():
        raise InputError(f"{name}: topic {topic.name} holds no linear acceleration. Give another one: --accel-topic.")
    if sensor != "accel" and (block.rate_absent.all() or (facts is None and not rate.any())):
        why = "its covariance begins with -1" if block.rate_absent.all() else "it is zero in all messages"
        raise InputError(f"{name}: topic {topic.name} holds no angular velocity ({why}). Give another topic.")
    unstamped = not block.stamp[~block.broken].any() and len(head) > 1
    time = logged if unstamped else block.stamp
    has_accel = bool(force.any()) if facts is None else not block.force_absent.all()
    kind = _Kind(topic.cdr, unstamped, True, has_accel, int(time[0]))
    make = partial(_topic_source, name, format, topic, facts)
    if sensor == "accel":
        return make(replace(kind, rate=False, accel=True))
    if facts is None and _alternate(rate, force):
        gyro = make(replace(kind, accel=False, only="gyro"))
        accel = make(replace(kind, rate=False, accel=True, only="accel"))
        told = f"each message of {topic.name} holds one of the sensors; they are joined on time"
        return replace(joined(gyro, accel, drop_bad_rows=drop_bad_rows), read_as=told)
    return make(kind)


def _alternate(rate: NDArray[np.bool_], force: NDArray[np.bool_]) -> bool:
    """Whether every message holds one of the two quantities, and each of them a share of the messages."""
    return bool((rate ^ force).all()) and min(rate.mean(), force.mean()) > FEWEST_OF_A_KIND


def _topic_source(name: str, format: str, topic: ImuTopic, facts: Facts | None, kind: _Kind) -> Source:
    started = kind.zero >= EARLIEST_DATE * 1_000_000_000
    stated = facts or Facts(start_time_utc=utc_from_ns(kind.zero) if started else None)
    notes = ()
    if kind.logged:
        message = f"All stamps in {topic.name} of {name} are 0; the times at which its messages were logged are used."
        notes = (Note("log_time_used", message),)
    parts = Parts(topic.count, exact=topic.exact, block=PLACE_MESSAGES, read=partial(_part, topic, kind))
    return Source(
        format=format,
        name=name,
        columns=(TIME, *(RATES if kind.rate else ()), *(FORCES if kind.accel else ())),
        blocks=partial(_blocks, topic, kind),
        stated=stated,
        usual=_USUAL,
        clock=Clock(unit=1.0, name=_LOG_TIME if kind.logged else _STAMP, zero=kind.zero * 1e-9),
        ours=facts is not None,
        topic=topic.name,
        notes=notes,
        parts=None if kind.only else parts,
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
    columns = [time[:, None], *([block.rate] if kind.rate else []), *([block.force] if kind.accel else [])]
    rows = np.arange(row + 1, row + 1 + len(held))
    wrong = [
        (block.broken, "it is no sensor_msgs/Imu"),
        (block.rate_absent & kind.rate, "its angular velocity is marked as absent"),
        (block.force_absent & kind.accel, "its linear acceleration is marked as absent"),
        (~block.broken & kind.logged & (block.stamp != 0), "its header has a time, those at the beginning have none"),
    ]
    ours = np.ones(len(held), dtype=bool)
    if kind.only:
        ours = _holds(block.rate, block.rate_absent) if kind.only == "gyro" else _holds(block.force, block.force_absent)
        ours |= block.broken
    bad = ours & np.any([flags for flags, _ in wrong], axis=0)
    values = np.hstack(columns)
    if not bad.any():
        return Block(values[ours], rows[ours], Bad.none())
    reasons = [(int(rows[i]), why) for flags, why in wrong for i in np.flatnonzero(flags & ours)[:DESCRIBED]]
    return Block(values[ours & ~bad], rows[ours & ~bad], Bad(rows[bad], tuple(sorted(reasons)[:DESCRIBED])))
