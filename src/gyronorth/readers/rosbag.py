"""Bags of ROS 1 (.bag) and of ROS 2 (a folder with metadata.yaml, or a .db3 file alone): topics of sensor_msgs/Imu.

A .bag of ours has a second topic with one std_msgs/String: the keys of the CSV's comment lines as JSON.
"""

from __future__ import annotations

import json
import sqlite3
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from gyronorth.readers.facts import read_facts
from gyronorth.readers.imu_message import IMU_TYPES, choose_topic
from gyronorth.readers.library import damage_told, library
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.outgoing import Outgoing
from gyronorth.readers.ros import TOPIC, ImuTopic, first_stamp, imu_source, ros_messages, ros_texts
from gyronorth.readers.source import Facts, Source
from gyronorth.recording import InputError

#: What tells a folder that is a recording of ROS 2.
METADATA = "metadata.yaml"
_FACTS_TOPIC = "/gyronorth/recording"
_CURES = {
    "rosbag1": "If it was recorded until power was lost: rosbag reindex FILE.bag",
    "rosbag2": "If it was recorded until power was lost: ros2 bag reindex FOLDER",
}


def open_rosbag1(path: Path, options: ReadOptions) -> Source:
    """Open a bag of ROS 1."""
    with path.open("rb") as file:
        if not file.read(8) == b"#ROSBAG ":
            raise InputError(f"{path.name} is no bag of ROS 1: it does not begin as one.")
    return _open(path, options, "rosbag1")


def open_rosbag2(path: Path, options: ReadOptions) -> Source:
    """Open a bag of ROS 2."""
    for database in _databases(path):
        _check_whole(database)
    return _open(path, options, "rosbag2")


def is_bag_folder(path: Path) -> bool:
    """Whether a folder is a bag of ROS 2, one recording."""
    return (path / METADATA).is_file()


def write_rosbag1(outgoing: Outgoing, path: Path) -> None:
    """Write a recording as a bag of ROS 1: one topic of sensor_msgs/Imu, axes forward-left-up, and the facts."""
    writing, typesys = library("rosbags.rosbag1", path.name, "ROS 1"), library("rosbags.typesys", path.name, "ROS 1")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    start = first_stamp(outgoing)
    path.unlink(missing_ok=True)  # the library makes the file itself
    with writing.Writer(path) as writer:
        imu = writer.add_connection(TOPIC, IMU_TYPES[1], typestore=store)
        text = writer.add_connection(_FACTS_TOPIC, "std_msgs/msg/String", typestore=store)
        stamp, counted = start, 0
        for stamps, messages in ros_messages(outgoing, start, cdr=False):
            for stamp, message in zip(stamps, messages, strict=True):
                writer.write(imu, stamp, message)
            # Of a chunk that is written the library keeps every time but needs their number alone.
            for chunk in writer.chunks[counted:-1]:
                chunk.connections = {number: range(len(times)) for number, times in chunk.connections.items()}
            counted = len(writer.chunks) - 1
        content = json.dumps(ros_texts(outgoing)).encode()
        writer.write(text, stamp, len(content).to_bytes(4, "little") + content)


def _check_whole(path: Path) -> None:
    """SQLite reads the lost end of a page as zeros: the size that its header states is compared instead.

    The header is that of https://www.sqlite.org/fileformat.html, section 1.3.
    """
    with path.open("rb") as file:
        head = file.read(100)
    if not (head.startswith(b"SQLite format 3\x00") and len(head) == 100):
        return  # the library says so
    page, pages = int.from_bytes(head[16:18]), int.from_bytes(head[28:32])
    is_stated = head[24:28] == head[92:96]
    if is_stated and path.stat().st_size < pages * (page if page > 1 else 1 << 16):
        raise InputError(f"{path.name} is cut off: it is shorter than its header states. {_CURES['rosbag2']}")


def _open(path: Path, options: ReadOptions, format: str) -> Source:
    facts = None
    with _opened(path, format) as reader:
        topics: dict[str, int] = {}
        other = []
        for connection in reader.connections:
            if connection.msgtype in IMU_TYPES:
                topics[connection.topic] = topics.get(connection.topic, 0) + _count(reader, connection, format)
            else:
                other.append(f"{connection.topic} ({connection.msgtype})")
        topic = choose_topic(topics, options.topic, path.name, other)
        times = int(reader.start_time), int(reader.end_time) - 1
        if format == "rosbag1":
            facts = _facts(reader, path.name)
        databases = [] if format == "rosbag1" or reader.compression_format else _databases(path)
    messages = partial(_from_databases, path.name, databases, topic) if databases else None
    messages = messages or partial(_messages, path, format, topic)
    found = ImuTopic(topic, topics[topic], *times, format == "rosbag2", messages)
    return imu_source(path.name, format, found, facts=facts)


def _facts(reader: Any, name: str) -> Facts | None:
    """What a bag of ours states about itself."""
    connections = [connection for connection in reader.connections if connection.topic == _FACTS_TOPIC]
    for _, _, message in _chunk_by_chunk(reader, connections, None, None):
        texts = json.loads(bytes(message[4:]))
        if not (isinstance(texts, dict) and all(isinstance(text, str) for text in texts.values())):
            raise ValueError(f"{_FACTS_TOPIC} holds no texts")
        return read_facts(texts, lambda key: f"Topic {_FACTS_TOPIC} of {name}")[0]
    return None


@contextmanager
def _opened(path: Path, format: str) -> Iterator[Any]:
    """A reader of the bag, its errors told."""
    library_of_format = library(f"rosbags.{format}", path.name, "a bag of ROS")
    with damage_told(path.name, "bag of ROS", _CURES[format]):
        reader = library_of_format.Reader(path)
        if format == "rosbag1":
            # It would read the time of every message at once; `_chunk_by_chunk` reads them when they are needed.
            reader.read_index_data = lambda *_: None
        with reader:
            yield reader


def _messages(path: Path, format: str, topic: str, start: int | None, stop: int | None) -> Iterator[tuple[int, bytes]]:
    """Log times and messages of a topic, in order of log time."""
    with _opened(path, format) as reader:
        chosen = [connection for connection in reader.connections if connection.topic == topic]
        chunked = format == "rosbag1"
        found = _chunk_by_chunk(reader, chosen, start, stop) if chunked else reader.messages(chosen, start, stop)
        for _, time, message in found:
            yield time, message


def _databases(path: Path) -> list[Path]:
    """The SQLite files of a bag of ROS 2, often one."""
    return sorted(path.glob("*.db3")) if path.is_dir() else [path] if path.suffix.lower() == ".db3" else []


def _from_databases(
    name: str, databases: list[Path], topic: str, start: int | None, stop: int | None
) -> Iterator[tuple[int, bytes]]:
    """What `_messages` gives; the library counts all messages each time, a second for a gigabyte."""
    with damage_told(name, "bag of ROS", _CURES["rosbag2"]), ExitStack() as stack:
        opened = []
        for path in databases:
            uri = f"{path.resolve().as_uri()}?immutable=1"
            opened.append(stack.enter_context(closing(sqlite3.connect(uri, uri=True))))
        first = [database.execute("SELECT MIN(timestamp) FROM messages").fetchone()[0] for database in opened]
        for i in sorted((i for i, time in enumerate(first) if time is not None), key=lambda i: first[i]):
            yield from opened[i].execute(
                "SELECT timestamp, data FROM messages WHERE topic_id IN (SELECT id FROM topics WHERE name = ?) "
                "AND timestamp >= ? AND timestamp < ? ORDER BY timestamp",
                (topic, -(1 << 63) if start is None else start, (1 << 63) - 1 if stop is None else stop),
            )


def _count(reader: Any, connection: Any, format: str) -> int:
    if format == "rosbag2":
        return connection.msgcount
    return sum(chunk.connection_counts.get(connection.id, 0) for chunk in reader.chunk_infos)


def _chunk_by_chunk(reader: Any, connections: list[Any], start: int | None, stop: int | None) -> Iterator[Any]:
    """What the reader of a bag of ROS 1 gives, with the index of one chunk at a time, or of some that overlap."""
    wanted = {connection.id for connection in connections}
    held = [chunk for chunk in reader.chunk_infos if wanted & chunk.connection_counts.keys()]
    for together in _overlapping(held):
        late = stop is not None and together[0].start_time >= stop
        if late or (start is not None and max(chunk.end_time for chunk in together) <= start):
            continue
        indexes: dict[int, list[Any]] = defaultdict(list)
        for chunk in together:
            reader.bio.seek(chunk.pos)
            reader.read_chunk()
            for _ in chunk.connection_counts:
                type(reader).read_index_data(reader, chunk.pos, indexes)
        reader.indexes = {number: sorted(indexes[number]) for number in wanted}
        yield from reader.messages(connections, start, stop)


def _overlapping(chunks: list[Any]) -> Iterator[list[Any]]:
    """Chunks in order of time, those together whose times overlap."""
    together: list[Any] = []
    end = 0
    for chunk in sorted(chunks, key=lambda chunk: (chunk.start_time, chunk.pos)):
        if together and chunk.start_time >= end:
            yield together
            together = []
        together.append(chunk)
        end = max(end, chunk.end_time)
    if together:
        yield together
