"""Bags of ROS 1 (.bag) and of ROS 2 (a folder with metadata.yaml, or a .db3 file alone): topics of sensor_msgs/Imu.

A .bag of ours has a second topic with one std_msgs/String: the keys of the CSV's comment lines as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
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
    for database in sorted(path.glob("*.db3")) if path.is_dir() else [path]:
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
        stamp = start
        for stamps, messages in ros_messages(outgoing, start, cdr=False):
            for stamp, message in zip(stamps, messages, strict=True):
                writer.write(imu, stamp, message)
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
                topics[connection.topic] = topics.get(connection.topic, 0) + connection.msgcount
            else:
                other.append(f"{connection.topic} ({connection.msgtype})")
        topic = choose_topic(topics, options.topic, path.name, other)
        times = int(reader.start_time), int(reader.end_time) - 1
        if format == "rosbag1":
            facts = _facts(reader, path.name)
    found = ImuTopic(topic, topics[topic], *times, format == "rosbag2", partial(_messages, path, format, topic))
    return imu_source(path.name, format, found, facts=facts)


def _facts(reader: Any, name: str) -> Facts | None:
    """What a bag of ours states about itself."""
    connections = [connection for connection in reader.connections if connection.topic == _FACTS_TOPIC]
    for _, _, message in reader.messages(connections) if connections else ():
        texts = json.loads(bytes(message[4:]))
        if not (isinstance(texts, dict) and all(isinstance(text, str) for text in texts.values())):
            raise ValueError(f"{_FACTS_TOPIC} holds no texts")
        return read_facts(texts, lambda key: f"Topic {_FACTS_TOPIC} of {name}")[0]
    return None


@contextmanager
def _opened(path: Path, format: str) -> Iterator[Any]:
    """A reader of the bag, its errors told."""
    library_of_format = library(f"rosbags.{format}", path.name, "a bag of ROS")
    with damage_told(path.name, "bag of ROS", _CURES[format]), library_of_format.Reader(path) as reader:
        yield reader


def _messages(path: Path, format: str, topic: str, start: int | None, stop: int | None) -> Iterator[tuple[int, bytes]]:
    """Log times and messages of a topic, in order of log time."""
    with _opened(path, format) as reader:
        chosen = [connection for connection in reader.connections if connection.topic == topic]
        for _, time, message in reader.messages(chosen, start, stop):
            yield time, message
