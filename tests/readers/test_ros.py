"""Bags of ROS and MCAP files made by rosbags and mcap: read, chosen from, refused."""

from __future__ import annotations

import json
import re
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ros_files import IMU, ROS1, ROS2, START, cdr, ros1, samples, write_bag1, write_bag2, write_mcap
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from ruamel.yaml import YAML
from still import LATITUDE, still

from gyronorth.errors import InputError
from gyronorth.readers import describe, read, recordings_in
from gyronorth.readers.imu_message import decode, encode

RATE = 100.0
FLU = np.array([1.0, -1.0, -1.0])
GYRO, ACCEL = still(400)
#: The same in forward-left-up, as a driver of ROS publishes it.
SAMPLES = samples(GYRO * FLU, ACCEL * FLU, RATE)
LATER = 5_000_000  # ns from stamp to log


def logged(messages: list[bytes]) -> list[tuple[int, bytes]]:
    return [(stamp + LATER, content) for (stamp, *_), content in zip(SAMPLES, messages, strict=True)]


CDR, NOETIC = logged([cdr(sample) for sample in SAMPLES]), logged([ros1(sample) for sample in SAMPLES])


def bag1(folder: Path, **topics) -> Path:
    return write_bag1(
        folder / "rec.bag", {f"/{name}": messages for name, messages in (topics or {"imu": NOETIC}).items()}
    )


def bag2(folder: Path, **topics) -> Path:
    return write_bag2(folder / "rec", {f"/{name}": messages for name, messages in (topics or {"imu": CDR}).items()})


def mcap2(folder: Path, **topics) -> Path:
    return write_mcap(
        folder / "rec.mcap", {f"/{name}": messages for name, messages in (topics or {"imu": CDR}).items()}
    )


MAKERS = {
    "rosbag1": bag1,
    "rosbag1-bz2": lambda folder: write_bag1(
        folder / "r.bag", {"/imu": NOETIC}, compression=Writer1.CompressionFormat.BZ2
    ),
    "rosbag1-lz4": lambda folder: write_bag1(
        folder / "r.bag", {"/imu": NOETIC}, compression=Writer1.CompressionFormat.LZ4
    ),
    "rosbag2-sqlite3": bag2,
    "rosbag2-mcap": lambda folder: write_bag2(folder / "rec", {"/imu": CDR}, StoragePlugin.MCAP),
    "rosbag2-zstd-file": lambda folder: write_bag2(folder / "rec", {"/imu": CDR}, compression=CompressionMode.FILE),
    "rosbag2-zstd-message": lambda folder: write_bag2(
        folder / "rec", {"/imu": CDR}, compression=CompressionMode.MESSAGE
    ),
    "db3": lambda folder: next(bag2(folder).glob("*.db3")),
    "mcap": mcap2,
    "mcap-ros1": lambda folder: write_mcap(folder / "rec.mcap", {"/imu": NOETIC}, encoding="ros1"),
    "mcap-small-chunks": lambda folder: write_mcap(folder / "rec.mcap", {"/imu": CDR}, chunk_size=2000),
    "mcap-without-chunks": lambda folder: write_mcap(folder / "rec.mcap", {"/imu": CDR}, use_chunking=False),
    "mcap-without-summary": lambda folder: write_mcap(
        folder / "rec.mcap", {"/imu": CDR}, use_statistics=False, repeat_channels=False, repeat_schemas=False
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("maker", MAKERS)
def test_what_others_wrote_is_read_in_body_axes(tmp_path, maker):
    recording = read(MAKERS[maker](tmp_path), latitude=LATITUDE)
    # Forward-left-up to forward-right-down is two signs: bit for bit.
    assert_array_equal(recording.gyro_b, GYRO)
    assert recording.accel_b is not None
    assert_array_equal(recording.accel_b, ACCEL)
    assert recording.rate_hz == RATE
    assert recording.start_time_utc == "2024-05-01T12:00:00Z"
    assert [note.code for note in recording.notes] == ["axes_assumed"]


def test_a_bag_folder_is_one_recording_among_others(tmp_path):
    bag2(tmp_path)
    bag1(tmp_path)
    (tmp_path / "deeper").mkdir()
    mcap2(tmp_path / "deeper")
    assert [str(path.relative_to(tmp_path)) for path in recordings_in(tmp_path)] == [
        "deeper/rec.mcap",
        "rec",
        "rec.bag",
    ]


@pytest.mark.slow
@pytest.mark.parametrize("make", [bag1, bag2, mcap2], ids=["rosbag1", "rosbag2", "mcap"])
def test_two_topics_are_told_and_one_is_chosen(tmp_path, make):
    both = NOETIC if make is bag1 else CDR
    path = make(tmp_path, imu=both, spare=both[:200])
    with pytest.raises(InputError, match=r"has 2 topics.*/imu \(400 messages\), /spare \(200 messages\).*--topic NAME"):
        read(path)
    assert len(read(path, topic="/spare").gyro_b) == 200
    with pytest.raises(InputError, match=r"has no topic '/x'; its topics of sensor_msgs/Imu are /imu"):
        read(path, topic="/x")
    with pytest.raises(InputError, match=r"topic /chatter \(std_msgs.* holds no sensor_msgs/Imu; its topics"):
        read(path, topic="/chatter")
    with pytest.raises(InputError, match=r"columns does not apply"):
        read(path, topic="/imu", columns={"t": "time"})


@pytest.mark.parametrize("make", [bag1, bag2, mcap2], ids=["rosbag1", "rosbag2", "mcap"])
def test_no_topic_of_imu_and_no_message(tmp_path, make):
    path = make(tmp_path, imu=[])
    with pytest.raises(InputError, match=r"holds no messages|has no topic of sensor_msgs/Imu"):
        read(path)


def test_a_covariance_that_begins_with_minus_one_says_absent(tmp_path):
    gyro_only = [cdr(sample) for sample in samples(GYRO * FLU, None, RATE)]
    recording = read(mcap2(tmp_path, imu=logged(gyro_only)))
    assert recording.accel_b is None
    assert_array_equal(recording.gyro_b, GYRO)
    no_rate = [cdr(sample, no_rate=True) for sample in SAMPLES]
    with pytest.raises(InputError, match=r"/imu holds no angular velocity"):
        read(mcap2(tmp_path, imu=logged(no_rate)))
    mixed = [*(content for _, content in CDR[:390]), *gyro_only[390:]]
    with pytest.raises(InputError, match=r"Row 391 of rec.mcap: its linear acceleration is marked as absent"):
        read(mcap2(tmp_path, imu=logged(mixed)))
    assert read(mcap2(tmp_path, imu=logged(mixed)), drop_bad_rows=True).rows_dropped == 10


def test_the_first_message_does_not_speak_for_all(tmp_path):
    first = cdr(samples(GYRO[:1] * FLU, None, RATE)[0])
    path = mcap2(tmp_path, imu=logged([first, *(content for _, content in CDR[1:])]))
    with pytest.raises(InputError, match=r"Row 1 of rec.mcap: its linear acceleration is marked as absent"):
        read(path)
    late = [content if i >= 1200 else cdr((0, *sample[1:])) for i, (content, sample) in enumerate(LONG)]
    path = mcap2(tmp_path, imu=[(sample[0] + LATER, content) for content, (_, sample) in zip(late, LONG, strict=True)])
    with pytest.raises(
        InputError, match=r"Row 1201 of rec.mcap: its header has a time, those at the beginning have none"
    ):
        read(path)


LONG = [(cdr(sample), sample) for sample in samples(np.tile(GYRO * FLU, (4, 1)), np.tile(ACCEL * FLU, (4, 1)), RATE)]


@pytest.mark.parametrize("maker", ["rosbag1", "rosbag2-sqlite3", "mcap"])
def test_log_times_stand_in_for_stamps_that_are_zero(tmp_path, maker):
    serialise = ros1 if maker == "rosbag1" else cdr
    messages = logged([serialise((0, rate, force)) for _, rate, force in SAMPLES])
    make = {"rosbag1": bag1, "rosbag2-sqlite3": bag2, "mcap": mcap2}[maker]
    recording = read(make(tmp_path, imu=messages))
    assert recording.rate_hz == RATE
    assert recording.start_time_utc == "2024-05-01T12:00:00.005000Z"
    assert [note.code for note in recording.notes] == ["axes_assumed", "log_time_used"]
    assert "/imu of rec" in recording.notes[1].message
    assert_array_equal(recording.gyro_b, GYRO)


def test_stamps_from_zero_are_no_date(tmp_path):
    boot = samples(GYRO * FLU, ACCEL * FLU, RATE, start=0)
    recording = read(mcap2(tmp_path, imu=logged([cdr(sample) for sample in boot])))
    assert recording.start_time_utc is None
    assert recording.rate_hz == RATE


def test_gaps_reversals_and_numbers_that_are_none_are_told_by_message(tmp_path):
    gap = CDR[:100] + CDR[105:]
    recording = read(mcap2(tmp_path, imu=gap))
    assert [(gap.start, gap.samples) for gap in recording.gaps] == [(1.0, 5)]
    swapped = [content for _, content in CDR]
    swapped[50], swapped[51] = swapped[51], swapped[50]
    with pytest.raises(InputError, match=r"of rec.mcap: time (leaps|runs backwards): header.stamp is"):
        read(mcap2(tmp_path, imu=logged(swapped)))
    nan = [content for _, content in CDR]
    nan[7] = cdr((SAMPLES[7][0], [np.nan, 0, 0], SAMPLES[7][2]))
    with pytest.raises(InputError, match=r"Row 8 of rec.mcap: w_x is nan; a finite number"):
        read(mcap2(tmp_path, imu=logged(nan)))


@pytest.mark.parametrize("order", [[*range(200, 400), *range(200)], [*range(0, 400, 2), *range(1, 400, 2)]])
@pytest.mark.parametrize("make", ["rosbag1", "mcap"])
def test_messages_in_the_order_of_their_log_times(tmp_path, make, order):
    # A recorder may store late what it received early; the file's index puts it in order.
    if make == "mcap":
        path = write_mcap(tmp_path / "rec.mcap", {"/imu": [CDR[i] for i in order]}, chunk_size=5000)
    else:
        path = write_bag1(tmp_path / "rec.bag", {"/imu": [NOETIC[i] for i in order]}, chunk=5000)
    assert_array_equal(read(path).gyro_b, GYRO)


def test_other_encodings_are_refused_by_name(tmp_path):
    path = write_mcap(tmp_path / "rec.mcap", {"/imu": [(START, json.dumps({"x": 1}).encode())]}, encoding="json")
    with pytest.raises(InputError, match=r"holds JSON objects of log_time \(ns\), x; three rates are expected"):
        read(path)
    path = write_mcap(tmp_path / "other.mcap", {"/imu": [(START, b"\x08\x01")]}, encoding="protobuf")
    with pytest.raises(InputError, match=r"messages of /imu are encoded as protobuf.* is expected"):
        read(path)


def test_a_message_of_another_size_is_a_bad_row(tmp_path):
    messages = [*CDR[:30], (CDR[30][0], CDR[30][1][:-8]), *CDR[31:]]
    with pytest.raises(InputError, match=r"Row 31 of rec.mcap: it is no sensor_msgs/Imu"):
        read(mcap2(tmp_path, imu=messages))
    with pytest.raises(InputError, match=r"first message of /imu has 4 bytes that are no sensor_msgs/Imu"):
        read(mcap2(tmp_path, imu=[(START, b"\x00\x01\x00\x00")]))


@pytest.mark.parametrize("frame_id", ["", "a", "imu", "imu_link", "x" * 57, "ö"])
@pytest.mark.parametrize("is_cdr", [True, False])
def test_our_decoder_agrees_with_the_library_for_any_frame_id(frame_id, is_cdr):
    serialise = cdr if is_cdr else ros1
    messages = [serialise(sample, frame_id=frame_id) for sample in SAMPLES[:20]]
    block = decode([*messages, *(serialise(sample, frame_id="other") for sample in SAMPLES[20:25])], cdr=is_cdr)
    assert not block.broken.any()
    assert_array_equal(block.rate, (GYRO * FLU)[:25])
    assert_array_equal(block.force, (ACCEL * FLU)[:25])
    assert block.stamp.tolist() == [stamp for stamp, *_ in SAMPLES[:25]]


def test_big_endian_cdr():
    from ros_files import message

    content = bytes(ROS2.serialize_cdr(message(ROS2, SAMPLES[3]), IMU, little_endian=False))
    block = decode([CDR[2][1], content], cdr=True)
    assert_array_equal(block.rate, (GYRO * FLU)[2:4])
    assert block.stamp.tolist() == [SAMPLES[2][0], SAMPLES[3][0]]


@pytest.mark.parametrize("is_cdr", [True, False])
@pytest.mark.parametrize("accel", [True, False])
def test_what_we_encode_the_library_understands(is_cdr, accel):
    stamp = np.array([START, START + 10_000_001])
    force = ACCEL[:2] if accel else None
    for i, content in enumerate(encode(stamp, GYRO[:2], force, first=7, cdr=is_cdr)):
        back = ROS2.deserialize_cdr(content, IMU) if is_cdr else ROS1.deserialize_ros1(content, IMU)
        assert back.header.stamp.sec * 10**9 + back.header.stamp.nanosec == stamp[i]
        assert back.header.frame_id == "imu"
        if not is_cdr:
            assert back.header.seq == 7 + i
        rate = back.angular_velocity
        assert [rate.x, rate.y, rate.z] == GYRO[i].tolist()
        assert back.orientation_covariance[0] == -1
        assert back.linear_acceleration_covariance[0] == (0 if accel else -1)
        if accel:
            assert back.linear_acceleration.z == ACCEL[i, 2]


@pytest.mark.slow
@pytest.mark.parametrize("maker", ["rosbag1", "rosbag2-sqlite3", "mcap"])
def test_describe_names_the_topic_and_the_convention(tmp_path, maker):
    description = describe(MAKERS[maker](tmp_path))
    info = description.info
    assert (info.topic, info.axes, info.axes_declared) == ("/imu", "flu", False)
    assert (info.gyro_unit, info.accel_unit, description.samples) == ("rad/s", "m/s2", 400)
    assert_allclose(description.rate_mean, GYRO.mean(axis=0), rtol=1e-12)


CUTS = np.random.default_rng(5).integers(1, 10**6, 3)


@pytest.mark.slow
@pytest.mark.parametrize("maker", ["rosbag1", "rosbag1-lz4", "db3", "mcap", "mcap-small-chunks", "mcap-without-chunks"])
def test_cut_off_anywhere_is_refused_with_one_message(tmp_path, maker):
    path = MAKERS[maker](tmp_path)
    content = path.read_bytes()
    # A writer that was killed leaves most of the file; a copy may end anywhere.
    for cut in {len(content) - 1, len(content) - 40, *(CUTS % len(content)).tolist()}:
        path.write_bytes(content[:cut])
        with pytest.raises(InputError) as caught:
            read(path)
        text = str(caught.value)
        assert "\n" not in text
        assert len(text) < 700
        assert any(word in text for word in ("cut off", "damaged", "is no", "is empty")), text
        if cut > 4096:
            assert any(cure in text for cure in ("mcap recover", "rosbag reindex", "ros2 bag reindex")), text


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".bag", ".db3", ".mcap", ".h5", ".parquet"])
@pytest.mark.parametrize("content", [b"", b"w_x,w_y,w_z\n1,2,3\n", bytes(5000), b"PK\x03\x04" + bytes(300)])
def test_foreign_content_is_refused_with_one_message(tmp_path, suffix, content):
    path = tmp_path / f"día{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"día\.\w+ (is no|is empty|cannot be read)"):
        read(path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rec", "a#b?c%20d", "día 1"])
def test_a_split_bag_is_one_recording(tmp_path, name):
    # As `ros2 bag record --max-bag-duration` leaves it: several databases, one metadata.yaml.
    first, second = (write_bag2(tmp_path / part, {"/imu": CDR[rows]}) for part, rows in PARTS.items())
    folder = first.rename(tmp_path / name)
    one, two = folder / "first.db3", next(second.glob("*.db3")).rename(folder / "second.db3")
    metadata = folder / "metadata.yaml"
    content = YAML(typ="safe").load(metadata.read_text())
    about = content["rosbag2_bagfile_information"]
    about |= {"relative_file_paths": [two.name, one.name], "message_count": 2 * len(GYRO), "files": []}
    about["duration"]["nanoseconds"] = CDR[-1][0] - CDR[0][0]
    for topic in about["topics_with_message_count"]:
        topic["message_count"] = len(GYRO)
    YAML(typ="safe").dump(content, metadata)
    write_bag2(tmp_path / "stray", {"/imu": CDR})
    next((tmp_path / "stray").glob("*.db3")).rename(folder / "stray.db3")  # metadata.yaml does not list it
    assert_array_equal(read(folder).gyro_b, GYRO)
    two.write_bytes(two.read_bytes()[:9000])
    with pytest.raises(InputError, match=r"second.db3 is cut off: it is shorter than its header states. .*reindex"):
        read(folder)


PARTS = {"first": slice(0, 250), "second": slice(250, 400)}


def test_messages_of_a_large_database_alone_are_drawn_not_counted(tmp_path, monkeypatch):
    monkeypatch.setattr("gyronorth.readers.formats.rosbag.MOST_COUNTED", 500)
    path = next(bag2(tmp_path, imu=CDR, spare=CDR[:200]).glob("*.db3"))
    with pytest.raises(InputError, match=r"has 2 topics") as caught:
        read(path)
    counts = [int(count) for count in re.findall(r"\((\d+) messages\)", str(caught.value))]
    # 1000 drawn of 400, 200 and 600 (/chatter) messages: 1200 p +- 4 standard deviations.
    for count, share in zip(counts, (1 / 3, 1 / 6), strict=True):
        assert abs(count - 1200 * share) < 4 * 1200 * np.sqrt(share * (1 - share) / 1000)
    assert len(read(path, topic="/imu").gyro_b) == 400


def test_a_compressed_database_alone_is_unpacked_or_points_to_its_folder(tmp_path):
    folder = write_bag2(tmp_path / "file", {"/imu": CDR}, compression=CompressionMode.FILE)
    assert_array_equal(read(next(folder.glob("*.db3*"))).gyro_b, GYRO)
    folder = write_bag2(tmp_path / "message", {"/imu": CDR}, compression=CompressionMode.MESSAGE)
    path = next(folder.glob("*.db3*"))
    with pytest.raises(InputError, match=rf"{path.name}: the messages of /imu are compressed.* folder"):
        read(path)


def test_a_bag_still_being_recorded_is_refused(tmp_path):
    path = next(bag2(tmp_path).glob("*.db3"))
    database = sqlite3.connect(path)
    database.execute("PRAGMA journal_mode = WAL")
    database.execute("UPDATE messages SET timestamp = timestamp + 1 WHERE id = 1")
    database.commit()
    with pytest.raises(InputError, match=r"rec.db3 is still being recorded.* are in rec.db3-wal.*wal_checkpoint"):
        read(path)
    database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    database.close()
    assert_array_equal(read(path).gyro_b, GYRO)


def test_a_bag_folder_with_damaged_or_missing_parts(tmp_path):
    path = bag2(tmp_path)
    metadata = path / "metadata.yaml"
    good = metadata.read_text()
    for text in ("", "a: [", "rosbag2_bagfile_information:\n  version: 99\n", good.replace("sqlite3", "other")):
        metadata.write_text(text)
        with pytest.raises(InputError, match=r"rec cannot be read .*no bag of ROS.*ros2 bag reindex"):
            read(path)
    metadata.write_text(good)
    next(path.glob("*.db3")).unlink()
    with pytest.raises(InputError, match=r"rec cannot be read .*missing"):
        read(path)
    metadata.unlink()
    with pytest.raises(InputError, match=r"is a folder; a file is expected \(or a bag of ROS 2"):
        read(path)


NO_RATE = logged([ros1(sample) for sample in samples(0 * GYRO, ACCEL * FLU, RATE)])
NO_FORCE = logged([ros1(sample) for sample in samples(GYRO * FLU, 0 * ACCEL, RATE)])


def test_topics_of_one_sensor_each_are_joined_unasked(tmp_path):
    """Drivers of depth cameras publish the other quantity as zeros, with a covariance like any other."""
    path = bag1(tmp_path, gyro=NO_FORCE, accel=NO_RATE)
    recording = read(path)
    assert_array_equal(recording.gyro_b, GYRO)
    assert_allclose(recording.accel_b, ACCEL, rtol=1e-12)
    assert "acceleration of /accel joined on time" in describe(path).info.read_as
    assert read(path, topic="/gyro").accel_b is None
    with pytest.raises(InputError, match=r"topic /accel holds no angular velocity \(it is zero in all messages\)"):
        read(path, topic="/accel")
    with pytest.raises(InputError, match=r"topic /gyro holds no linear acceleration"):
        read(path, topic="/gyro", accel_topic="/gyro")


def test_the_accelerometer_of_another_topic_is_declared(tmp_path):
    path = bag1(tmp_path, gyro=NO_FORCE, accel=NO_RATE, other=NOETIC)
    with pytest.raises(InputError, match="has 3 topics"):
        read(path)
    recording = read(path, topic="/gyro", accel_topic="/other")
    assert_array_equal(recording.gyro_b, GYRO)
    assert_allclose(recording.accel_b, ACCEL, rtol=1e-12)
    with pytest.raises(InputError, match="has no topic '/x'"):
        read(path, topic="/gyro", accel_topic="/x")


@pytest.mark.parametrize("make", [bag1, mcap2], ids=["rosbag1", "mcap"])
def test_messages_that_hold_one_sensor_each_are_joined(tmp_path, make):
    message = ros1 if make is bag1 else cdr
    mixed = [gyro if i % 3 else accel for i, (gyro, accel) in enumerate(
        zip(samples(GYRO * FLU, 0 * ACCEL, RATE), samples(0 * GYRO, ACCEL * FLU, RATE), strict=True))]  # fmt: skip
    recording = read(make(tmp_path, imu=logged([message(sample) for sample in mixed])), rate_hz=None)
    kept = np.arange(len(GYRO)) % 3 > 0
    assert set(map(tuple, GYRO[kept])) <= set(map(tuple, recording.gyro_b))
    assert_allclose(recording.accel_b.mean(axis=0), ACCEL.mean(axis=0), atol=0.01)


def test_messages_of_a_drivers_own_are_named(tmp_path):
    path = bag1(tmp_path, imu=NOETIC)
    content = path.read_bytes().replace(b"sensor_msgs/Imu", b"driver_msg/MyImu")
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"has no topic of sensor_msgs/Imu|cannot be read"):
        read(path)


@pytest.mark.slow
@pytest.mark.parametrize("value", ["'text'", "NULL", "5", "1.5"])
@pytest.mark.parametrize("column", ["data", "timestamp", "name", "type"])
def test_a_database_that_holds_other_types_is_refused(tmp_path, column, value):
    """SQLite keeps a value of any type in any column."""
    cells = {"name": "'/imu'", "type": "'sensor_msgs/msg/Imu'", "timestamp": "1", "data": "zeroblob(324)"}
    cells[column] = value
    with closing(sqlite3.connect(tmp_path / "typed.db3")) as database:
        database.executescript(
            "CREATE TABLE topics (id INTEGER PRIMARY KEY, name, type);"
            "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp, data);"
            f"INSERT INTO topics VALUES (1, {cells['name']}, {cells['type']});"
            f"INSERT INTO messages VALUES (1, 1, {cells['timestamp']}, {cells['data']}), (2, 1, 2, zeroblob(324));"
        )
    with pytest.raises(InputError, match=r"typed\.db3"):
        read(tmp_path / "typed.db3", latitude=0.5)
