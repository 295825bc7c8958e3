"""MCAP files (.mcap): topics of sensor_msgs/Imu recorded by ROS 2 or ROS 1, or written by gyronorth.

A file of ours has one topic in CDR, axes forward-left-up, and a metadata record named like the
signature with the keys of the CSV's comment lines.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from gyronorth.errors import InputError
from gyronorth.readers.facts import SIGNATURE, read_facts
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.imu_message import IMU_TYPES
from gyronorth.readers.library import check_whole, errors_translated, library
from gyronorth.readers.message_table import OwnTopic, choose_own, json_objects, own_source, table_source
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.outgoing import RecordingStream
from gyronorth.readers.ros import TOPIC, ImuTopic, first_stamp, ros_messages, ros_texts, topics_source
from gyronorth.readers.source import Question, Source

_CURE = "If it was recorded until power was lost: mcap recover IN.mcap -o OUT.mcap"
_MAGIC = b"\x89MCAP0\r\n"


def open_mcap(path: Path, options: ReadOptions) -> Source:
    """Open an MCAP file."""
    check_whole(path, _MAGIC, what="MCAP", cut_off=f"an MCAP file ends as it begins, this one does not. {_CURE}")
    with _opened(path) as reader:
        header = reader.get_header()
        summary = reader.get_summary()
        texts = next((dict(record.metadata) for record in _metadata(reader, summary)), None)
        indexed = _is_indexed(summary)
        if not indexed or summary.statistics is None:
            channels, counts, times = _scanned(path)
        else:
            channels = {
                number: (item, summary.schemas.get(item.schema_id)) for number, item in summary.channels.items()
            }
            counts = summary.statistics.channel_message_counts
            times = summary.statistics.message_start_time, summary.statistics.message_end_time
    topic, questions = _json_topic(channels, options, path.name)
    if topic is not None:
        of_json = partial(json_objects, partial(_messages, path, topic, indexed, None, None), path.name)
        source = table_source(path, "mcap", topic, "JSON", of_json, options)
        return replace(source, questions=(*questions, *source.questions))
    topics, encodings, other = _topics(channels, counts)
    if (own := choose_own(_own(channels, path, indexed), options, path.name, of_imu=bool(topics))) is not None:
        return own_source(path, "mcap", own, options)
    facts = None
    if texts is not None:
        facts, _ = read_facts(texts, lambda _key: f"Metadata record {SIGNATURE[1]} of {path.name}")

    def make(topic: str) -> ImuTopic:
        cdr = _is_cdr(encodings[topic], topic, header.profile, path.name)
        return ImuTopic(topic, topics[topic], *times, cdr, partial(_messages, path, topic, indexed))

    return topics_source(path.name, "mcap", topics, other, make, options, facts=facts)


def write_mcap(outgoing: RecordingStream, path: Path) -> None:
    """Write a recording as an MCAP file of ROS 2: one topic of sensor_msgs/msg/Imu, axes forward-left-up."""
    writer_of, typesys = library("mcap.writer", path.name, "MCAP"), library("rosbags.typesys", path.name, "MCAP")
    definition, _ = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE).generate_msgdef(IMU_TYPES[1], ros_version=2)
    start = first_stamp(outgoing)
    with path.open("wb") as file:
        writer = writer_of.Writer(file, compression=writer_of.CompressionType.ZSTD)
        writer.start(profile="ros2", library="gyronorth")
        schema = writer.register_schema(IMU_TYPES[1], "ros2msg", definition.encode())
        channel = writer.register_channel(TOPIC, "cdr", schema)
        for stamps, messages in ros_messages(outgoing, start, cdr=True):
            for stamp, message in zip(stamps, messages, strict=True):
                writer.add_message(channel, stamp, message, stamp)  # type: ignore[arg-type]
        writer.add_metadata(SIGNATURE[1], ros_texts(outgoing))
        writer.finish()


@contextmanager
def _opened(path: Path, *, seeking: bool = True) -> Iterator[Any]:
    """A reader of the file, its errors reported; one that does not seek reads the messages in the file's order."""
    reading = library("mcap.reader", path.name, "MCAP")
    kind = reading.SeekingReader if seeking else reading.NonSeekingReader
    with errors_translated(path.name, "MCAP file", _CURE), path.open("rb") as file:
        yield kind(file, validate_crcs=True, record_size_limit=path.stat().st_size)


def _metadata(reader: Any, summary: Any) -> Iterator[Any]:
    """Our metadata record, where there is one."""
    if summary is not None and any(index.name == SIGNATURE[1] for index in summary.metadata_indexes):
        yield from (record for record in reader.iter_metadata() if record.name == SIGNATURE[1])


def _is_indexed(summary: Any) -> bool:
    """Whether the summary, which is optional in every part, says where which channel's messages are."""
    return summary is not None and len(summary.channels) > 0 and len(summary.chunk_indexes) > 0


def _scanned(path: Path) -> tuple[dict[int, tuple[Any, Any]], dict[int, int], tuple[int, int]]:
    """Channels with their schemas, message counts and the range of log times of a file whose summary lacks them."""
    channels: dict[int, tuple[Any, Any]] = {}
    counts: dict[int, int] = {}
    start, stop = 2**63, 0
    with _opened(path, seeking=False) as reader:
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            channels[channel.id] = channel, schema
            counts[channel.id] = counts.get(channel.id, 0) + 1
            start, stop = min(start, message.log_time), max(stop, message.log_time)
    return channels, counts, (start, stop)


def _topics(
    channels: dict[int, tuple[Any, Any]], counts: dict[int, int]
) -> tuple[dict[str, int], dict[str, set[str]], list[str]]:
    """Message counts and encodings of the topics of Imu messages, and the others with their types."""
    topics: dict[str, int] = {}
    encodings: dict[str, set[str]] = {}
    other = []
    for number, (channel, schema) in channels.items():
        kind = "" if schema is None else schema.name
        if kind in IMU_TYPES:
            topics[channel.topic] = topics.get(channel.topic, 0) + counts.get(number, 0)
            encodings.setdefault(channel.topic, set()).add(channel.message_encoding)
        else:
            other.append(f"{channel.topic} ({kind or channel.message_encoding or 'no type'})")
    return topics, encodings, other


def _own(channels: dict[int, tuple[Any, Any]], path: Path, indexed: bool) -> list[OwnTopic]:
    """The topics of messages of a driver's own whose definitions the file holds."""
    found = {}
    for channel, schema in channels.values():
        if schema is None or schema.name in IMU_TYPES or channel.message_encoding not in ("cdr", "ros1"):
            continue
        text = schema.data.decode("utf-8", "replace") if schema.encoding in ("ros2msg", "ros1msg") else ""
        messages = partial(_messages, path, channel.topic, indexed, None, None)
        found[channel.topic] = OwnTopic(channel.topic, schema.name, text, channel.message_encoding == "cdr", messages)
    return list(found.values())


def _json_topic(
    channels: dict[int, tuple[Any, Any]], options: ReadOptions, name: str
) -> tuple[str | None, tuple[Question, ...]]:
    """The topic of JSON messages that is read: the one declared, or the likeliest where no Imu message is of ROS."""
    kinds = {channel.topic: schema.name if schema else "" for channel, schema in channels.values()}
    texts = [channel.topic for channel, _ in channels.values() if channel.message_encoding == "json"]
    if options.topic is not None:
        return options.topic if options.topic in texts else None, ()
    if not texts or any(kind in IMU_TYPES for topic, kind in kinds.items() if topic not in texts):
        return None, ()
    found = [topic for topic in texts if kinds[topic] in IMU_TYPES]
    found = (
        found or [topic for topic in texts if re.search("imu|inertial", topic + kinds[topic], re.IGNORECASE)] or texts
    )
    if len(found) == 1:
        return found[0], ()
    says = f"{name} has {len(found)} topics of JSON that may be an IMU: {', '.join(found[:12])}. Which one is meant?"
    return found[0], (Question(says, ("--topic", found[0]), certain=False),)


def _is_cdr(encodings: set[str], topic: str, profile: str, name: str) -> bool:
    """Whether messages are CDR; else they are serialised as in ROS 1."""
    if encodings not in ({"cdr"}, {"ros1"}):
        raise InputError(
            f"{name}: messages of {topic} are encoded as {' and '.join(sorted(encodings))} (profile {profile!r}); cdr "
            "(ROS 2) or ros1 is expected. Record the topic with ros2 bag record, or convert it to CSV and declare "
            "its columns."
        )
    return encodings == {"cdr"}


def _messages(
    path: Path, topic: str, indexed: bool, start: int | None, stop: int | None
) -> Iterator[tuple[int, bytes]]:
    """Log times and messages of a topic, in order of log time where the file has an index of chunks."""
    with _opened(path, seeking=indexed) as reader:
        found = reader.iter_messages(topic, log_time_order=indexed, starting_at=start, ending_before=stop)
        for _, _, message in found:
            yield message.log_time, message.data


FORMAT = Format(
    format_info("mcap"),
    open_mcap,
    recognises=lambda head: head.startswith(b"\x89MCAP"),
    write=write_mcap,
    foreign=("mcap.reader",),
)
