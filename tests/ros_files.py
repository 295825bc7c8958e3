"""Bags and MCAP files as others make them: messages serialised by rosbags, files written by rosbags and mcap."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

IMU = "sensor_msgs/msg/Imu"
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
START = 1_714_564_800_000_000_000  # 2024-05-01T12:00:00Z, ns

#: (stamp, ns; angular velocity; linear acceleration or None)
Sample = tuple[int, Sequence[float], Sequence[float] | None]


def samples(gyro_flu: np.ndarray, accel_flu: np.ndarray | None, rate_hz: float, start: int = START) -> list[Sample]:
    stamps = [start + round(i / rate_hz * 1e9) for i in range(len(gyro_flu))]
    return [(stamps[i], gyro_flu[i], None if accel_flu is None else accel_flu[i]) for i in range(len(stamps))]


def message(store: Any, sample: Sample, *, seq: int = 0, frame_id: str = "imu_link", no_rate: bool = False) -> Any:
    stamp, rate, force = sample
    types = store.types
    time = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    more = {"seq": seq} if store is ROS1 else {}
    none, absent = np.zeros(9), np.array([-1.0, *[0.0] * 8])
    vector = types["geometry_msgs/msg/Vector3"]
    return types[IMU](
        header=types["std_msgs/msg/Header"](stamp=time, frame_id=frame_id, **more),
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=absent,
        angular_velocity=vector(*map(float, rate)),
        angular_velocity_covariance=absent if no_rate else none,
        linear_acceleration=vector(*map(float, (0, 0, 0) if force is None else force)),
        linear_acceleration_covariance=absent if force is None else none,
    )


def cdr(sample: Sample, **how: Any) -> bytes:
    return bytes(ROS2.serialize_cdr(message(ROS2, sample, **how), IMU))


def ros1(sample: Sample, **how: Any) -> bytes:
    return bytes(ROS1.serialize_ros1(message(ROS1, sample, **how), IMU))


def write_bag1(
    path: Path, topics: dict[str, list[tuple[int, bytes]]], *, compression: Any = None, chunk: int = 1 << 20
) -> Path:
    """A .bag of ROS 1 from topics with (log time, message), and another topic beside; chunks of so many bytes."""
    writer = Writer1(path)
    writer.chunk_threshold = chunk
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        text = writer.add_connection("/chatter", "std_msgs/msg/String", typestore=ROS1)
        for topic, messages in topics.items():
            connection = writer.add_connection(topic, IMU, typestore=ROS1)
            for time, content in messages:
                writer.write(connection, time, content)
                writer.write(text, time, b"\x02\x00\x00\x00hi")
    return path


def write_bag2(
    path: Path,
    topics: dict[str, list[tuple[int, bytes]]],
    storage: StoragePlugin = StoragePlugin.SQLITE3,
    compression: CompressionMode | None = None,
) -> Path:
    """A bag of ROS 2, a folder."""
    writer = Writer2(path, version=9, storage_plugin=storage)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        writer.add_connection("/chatter", "std_msgs/msg/String", typestore=ROS2)
        for topic, messages in topics.items():
            connection = writer.add_connection(topic, IMU, typestore=ROS2)
            for time, content in messages:
                writer.write(connection, time, content)
    return path


def write_mcap(
    path: Path,
    topics: dict[str, list[tuple[int, bytes]]],
    *,
    encoding: str = "cdr",
    **how: Any,
) -> Path:
    """An MCAP file made by mcap's own writer."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file, **how)
        writer.start(profile="ros2" if encoding == "cdr" else encoding)
        other = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        chatter = writer.register_channel("/chatter", encoding, other)
        schema = writer.register_schema(
            IMU if encoding == "cdr" else "sensor_msgs/Imu", "ros2msg", b"# sensor_msgs/Imu"
        )
        for topic, messages in topics.items():
            channel = writer.register_channel(topic, encoding, schema)
            for time, content in messages:
                writer.add_message(channel, log_time=time, data=content, publish_time=time)
                writer.add_message(chatter, log_time=time, data=b"hi", publish_time=time)
        writer.finish()
    return path
