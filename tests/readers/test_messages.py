"""Messages of a driver's own: those that rosbags serialises by a definition, read by the definition in the file."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from cases.layouts import ACCEL, GYRO, ROWS, TIME
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.readers import read
from gyronorth.readers.ros_definition import DefinitionError, decoder

rosbags = pytest.importorskip("rosbags")

from rosbags.rosbag1 import Writer as Writer1  # noqa: E402
from rosbags.rosbag2 import StoragePlugin  # noqa: E402
from rosbags.rosbag2 import Writer as Writer2  # noqa: E402
from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402

START = 1_709_294_280 * 10**9
KIND = "vendor_msgs/msg/Raw"
FIELDS = """
std_msgs/Header header
uint8 OK=1            # a constant
string<=20 name
bool valid
float64[3] q          # before the sensors, so that they are aligned anew
{vector} gyro
uint16[] flags
{vector} accel
{vector} delta_angle
int8[3] spare
float32 temperature
"""
UNITS = {"gyro_unit": "rad/s", "accel_unit": "m/s2", "axes": "frd"}


def sample(store, i: int, *, stamped: bool = True, **more):
    types = store.types
    vector, time = types["geometry_msgs/msg/Vector3"], types["builtin_interfaces/msg/Time"]
    stamp = START + round(1e9 * TIME[i]) if stamped else 0
    header = types["std_msgs/msg/Header"](stamp=time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="f", **more)
    return types[KIND](
        header=header, name="ab"[: i % 3], valid=True, q=np.zeros(3), gyro=vector(*GYRO[i].tolist()),
        flags=np.arange(i % 4, dtype=np.uint16), accel=vector(*ACCEL[i].tolist()), delta_angle=vector(0.0, 0.0, 0.0),
        spare=np.zeros(3, dtype=np.int8), temperature=20.5,
    )  # fmt: skip


def bag1(path: Path, *, topics: int = 1, stamped: bool = True) -> Path:
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(FIELDS.format(vector="geometry_msgs/Vector3"), KIND))
    with Writer1(path / "own.bag") as writer:
        there = [writer.add_connection(f"/raw{k}", KIND, typestore=store) for k in range(topics)]
        for i in range(ROWS):
            content = bytes(store.serialize_ros1(sample(store, i, stamped=stamped, seq=i), KIND))
            for connection in there:
                writer.write(connection, START + round(1e9 * TIME[i]), content)
    return path / "own.bag"


def bag2(path: Path, *, topics: int = 1, stamped: bool = True, storage=StoragePlugin.SQLITE3) -> Path:
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(FIELDS.format(vector="geometry_msgs/Vector3"), KIND))
    with Writer2(path / "own", version=9, storage_plugin=storage) as writer:
        there = [writer.add_connection(f"/raw{k}", KIND, typestore=store) for k in range(topics)]
        for i in range(ROWS):
            content = bytes(store.serialize_cdr(sample(store, i, stamped=stamped), KIND, little_endian=i % 2 == 0))
            for connection in there:
                writer.write(connection, START + round(1e9 * TIME[i]), content)
    return path / "own"


def mcap(path: Path, **how) -> Path:
    return next(bag2(path, storage=StoragePlugin.MCAP, **how).glob("*.mcap"))


def database(path: Path, **how) -> Path:
    return next(bag2(path, **how).glob("*.db3"))


@pytest.mark.slow
@pytest.mark.parametrize("make", [bag1, bag2, mcap, database])
def test_a_topic_with_one_triple_of_each_kind_is_taken(tmp_path, make):
    recording = read(make(tmp_path), **UNITS)
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-12)
    assert_allclose(recording.accel_b, ACCEL, rtol=1e-12)
    assert recording.rate_hz == pytest.approx(100.0, rel=1e-6)
    assert recording.read_as.startswith("/raw0 (vendor_msgs/")
    assert not recording.notes


@pytest.mark.slow
@pytest.mark.parametrize("make", [bag1, bag2])
def test_neither_units_nor_axes_are_those_of_another_message(tmp_path, make):
    with pytest.raises(InputError, match=r"does not say in which unit w_x.*\nTry: .*--gyro-unit rad/s --accel-unit"):
        read(make(tmp_path))


@pytest.mark.slow
def test_of_two_topics_one_is_asked_for(tmp_path):
    path = bag2(tmp_path, topics=2)
    with pytest.raises(InputError, match=r"/raw0 \(vendor_msgs/msg/Raw\), /raw1 .*\nTry: .*--topic /raw0 --gyro-unit"):
        read(path)
    assert read(path, topic="/raw1", **UNITS).read_as.startswith("/raw1")


@pytest.mark.slow
def test_without_stamps_the_recorders_time_is_used(tmp_path):
    recording = read(bag1(tmp_path, stamped=False), **UNITS)
    assert [note.code for note in recording.notes] == ["log_time_used"]
    assert recording.rate_hz == pytest.approx(100.0, rel=1e-6)


def test_units_in_comments_are_those_of_the_fields():
    text = (
        "float64 gx # rad/s\nV a # [m/s^2], as measured\nfloat64 b # of nothing\n" + "=" * 80 + "\nMSG: p/V\nbool c\n"
    )
    found = decoder("p/M", text, cdr=False)(struct.pack("<d?d", 1.5, True, 2.5))
    assert found == {"gx (rad/s)": 1.5, "a (m/s^2)": {"c": True}, "b": 2.5}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("float64 x\nx = y()", "holds"),
        ("Unknown u", "lacks that of Unknown"),
        ("M m", "without end"),
        ("float64 x\n" + "=" * 80 + "\nfloat64 y", "begin with MSG"),
    ],
)
def test_a_definition_that_is_not_understood_is_refused(text, says):
    with pytest.raises(DefinitionError, match=says):
        decoder("p/M", text, cdr=True)


@pytest.mark.parametrize("message", [b"", b"\0\7\0\0abcd", b"\0\1\0\0\xff\xff\xff\x7f", b"\0\1\0\0\2\0\0\0abcd"])
def test_a_message_that_does_not_follow_its_definition_is_refused(message):
    with pytest.raises(DefinitionError):
        decoder("p/M", "float64[] x", cdr=True)(message)
