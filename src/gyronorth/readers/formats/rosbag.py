"""Bags of ROS 1 (.bag) and of ROS 2 (a folder with metadata.yaml, or a .db3 file alone): topics of sensor_msgs/Imu.

A .bag of ours has a second topic with one std_msgs/String: the keys of the CSV's comment lines as JSON.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gyronorth.errors import InputError
from gyronorth.readers.facts import read_facts
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.imu_message import IMU_TYPES
from gyronorth.readers.library import errors_translated, library
from gyronorth.readers.message_table import OwnTopic, choose_own, own_source
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.outgoing import RecordingStream
from gyronorth.readers.ros import TOPIC, ImuTopic, Messages, first_stamp, ros_messages, ros_texts, topics_source
from gyronorth.readers.source import Facts, Source

if TYPE_CHECKING:
    import sqlite3

#: Messages of a database alone that are counted topic by topic, a quarter of a second; of more, some are drawn.
MOST_COUNTED = 1 << 19
_FACTS_TOPIC, _STRING = "/gyronorth/recording", "std_msgs/msg/String"
_CURES = {
    "rosbag1": "If it was recorded until power was lost: rosbag reindex FILE.bag",
    "rosbag2": "If it was recorded until power was lost: ros2 bag reindex FOLDER",
}


def open_rosbag1(path: Path, options: ReadOptions) -> Source:
    """Open a bag of ROS 1."""
    with path.open("rb") as file:
        if not file.read(8) == b"#ROSBAG ":
            raise InputError(f"{path.name} is no bag of ROS 1: it does not begin as one.")
    with _opened(path, "rosbag1") as reader:
        counts: dict[int, int] = defaultdict(int)
        for chunk in reader.chunk_infos:
            for number, count in chunk.connection_counts.items():
                counts[number] += count
        found = [(each.topic, each.msgtype, counts[each.id]) for each in reader.connections]
        times = int(reader.start_time), int(reader.end_time) - 1
        facts = _facts(reader, path.name)
        definitions = {each.topic: each.msgdef.data for each in reader.connections}
    topics, other = _counted_topics(found)
    own = [
        OwnTopic(topic, kind, definitions[topic], False, partial(_messages, path, "rosbag1", topic, None, None))
        for topic, kind, _ in found
        if kind not in (*IMU_TYPES, _STRING)
    ]
    if (chosen := choose_own(own, options, path.name, of_imu=bool(topics))) is not None:
        return own_source(path, "rosbag1", chosen, options)

    def make(topic: str) -> ImuTopic:
        return ImuTopic(topic, topics[topic], *times, False, partial(_messages, path, "rosbag1", topic))

    return topics_source(path.name, "rosbag1", topics, other, make, options, facts=facts)


def open_rosbag2(path: Path, options: ReadOptions) -> Source:
    """Open a bag of ROS 2."""
    return _open_folder(path, options) if path.is_dir() else _open_database(path, options)


def write_rosbag1(outgoing: RecordingStream, path: Path) -> None:
    """Write a recording as a bag of ROS 1: one topic of sensor_msgs/Imu, axes forward-left-up, and the facts."""
    writing, typesys = library("rosbags.rosbag1", path.name, "ROS 1"), library("rosbags.typesys", path.name, "ROS 1")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    start = first_stamp(outgoing)
    path.unlink(missing_ok=True)  # the library makes the file itself
    with writing.Writer(path) as writer:
        imu = writer.add_connection(TOPIC, IMU_TYPES[1], typestore=store)
        text = writer.add_connection(_FACTS_TOPIC, _STRING, typestore=store)
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
    log = path.with_name(f"{path.name}-wal")
    if log.is_file() and log.stat().st_size:
        raise InputError(
            f"{path.name} is still being recorded, or its recorder was killed: its last messages are in {log.name}. "
            f"End the recording, or bring them in: sqlite3 {path.name} 'PRAGMA wal_checkpoint(TRUNCATE)'"
        )
    if is_stated and path.stat().st_size < pages * (page if page > 1 else 1 << 16):
        raise InputError(f"{path.name} is cut off: it is shorter than its header states. {_CURES['rosbag2']}")


def _open_folder(path: Path, options: ReadOptions) -> Source:
    """Topics, numbers and times are those of metadata.yaml; the library would count all messages, a second for 1 GB."""
    with _opened(path, "rosbag2", counted=False) as reader:
        found = [(str(each.topic), str(each.msgtype), int(each.msgcount)) for each in reader.connections]
        times = int(reader.start_time), int(reader.end_time) - 1
        # Those that metadata.yaml lists; another one in the folder is none of the recording.
        listed = [storage.path for storage in reader.storage.storages if isinstance(storage, _Unopened)]
        databases = [] if reader.compression_format else listed
        for database in databases:
            _check_whole(database)
        stated = {each.msgtype: each.msgdef.data for each in reader.connections if each.msgdef.format.name == "MSG"}
    topics, other = _counted_topics(found)

    def messages(topic: str) -> Messages:
        stored = partial(_from_databases, path.name, databases, topic)
        return stored if databases else partial(_messages, path, "rosbag2", topic)

    own = _own(found, stated | _definitions(path.name, databases), messages)
    if (chosen := choose_own(own, options, path.name, of_imu=bool(topics))) is not None:
        return own_source(path, "rosbag2", chosen, options)

    def make(topic: str) -> ImuTopic:
        return ImuTopic(topic, topics[topic], *times, True, messages(topic))

    return topics_source(path.name, "rosbag2", topics, other, make, options)


def _open_database(path: Path, options: ReadOptions) -> Source:
    """A database alone: the messages of many are not counted one by one, topics are drawn."""
    _check_whole(path)
    with _connected(path.name, [path]) as (database,):
        _check_tables(database, path.name)
        names = list(_rows(database, path.name, (int, str, str), "SELECT id, name, type FROM topics ORDER BY id"))
        (total,) = database.execute("SELECT COUNT(*) FROM messages").fetchone()
        start, stop = (_end(database, path.name, which) for which in ("MIN", "MAX"))
        exact = total <= MOST_COUNTED or len(names) == 1
        counts = _counted(database) if total <= MOST_COUNTED else _drawn(database, total)
    found = [(name, kind, counts.get(number, 0)) for number, name, kind in names]
    topics, other = _counted_topics(found)

    def messages(topic: str) -> Messages:
        return partial(_from_databases, path.name, [path], topic)

    own = _own(found, _definitions(path.name, [path]), messages)
    if (chosen := choose_own(own, options, path.name, of_imu=bool(topics))) is not None:
        return own_source(path, "rosbag2", chosen, options)

    def make(topic: str) -> ImuTopic:
        return ImuTopic(topic, topics[topic], start or 0, stop or 0, True, messages(topic), exact=exact)

    return topics_source(path.name, "rosbag2", topics, other, make, options)


def _counted_topics(found: list[tuple[str, str, int]]) -> tuple[dict[str, int], list[str]]:
    """Topics of Imu messages with the number of messages, and the others as text, from (topic, type, messages)."""
    topics: dict[str, int] = {}
    for topic, kind, count in found:
        if kind in IMU_TYPES:
            topics[topic] = topics.get(topic, 0) + count
    return topics, [f"{topic} ({kind})" for topic, kind, _ in found if kind not in IMU_TYPES]


def _own(
    found: list[tuple[str, str, int]], definitions: dict[str, str], messages: Callable[[str], Messages]
) -> list[OwnTopic]:
    """The topics of messages of a driver's own, from (topic, type, messages) and the definitions of types."""
    return [
        OwnTopic(topic, kind, definitions.get(kind, ""), True, partial(messages(topic), None, None))
        for topic, kind, _ in found
        if kind not in IMU_TYPES
    ]


def _definitions(name: str, databases: list[Path]) -> dict[str, str]:
    """The definitions in .msg form that databases hold by type; bags of ROS 2 Humble and before have none."""
    found: dict[str, str] = {}
    query = "SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg'"
    with _connected(name, databases) as opened:
        for database in opened:
            table = "SELECT type FROM sqlite_master WHERE name = 'message_definitions'"
            if database.execute(table).fetchone() == ("table",):
                found |= dict(_rows(database, name, (str, str), query))
    return found


def _facts(reader: Any, name: str) -> Facts | None:
    """What a bag of ours states about itself."""
    connections = [connection for connection in reader.connections if connection.topic == _FACTS_TOPIC]
    for _, _, message in _chunk_by_chunk(reader, connections, None, None):
        texts = json.loads(bytes(message[4:]))
        if not (isinstance(texts, dict) and all(isinstance(text, str) for text in texts.values())):
            raise ValueError(f"{_FACTS_TOPIC} holds no texts")
        return read_facts(texts, lambda _key: f"Topic {_FACTS_TOPIC} of {name}")[0]
    return None


class _Unopened:
    """Stands for a database in the library's reader of a folder, which opens and counts all of them."""

    def __init__(self, path: Path) -> None:
        self.path, self.connections = path, list[Any]()

    def open(self) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""


@contextmanager
def _opened(path: Path, format: str, *, counted: bool = True) -> Iterator[Any]:
    """A reader of the bag, its errors reported; not `counted`: databases of ROS 2 stay unopened."""
    library_of_format = library(f"rosbags.{format}", path.name, "a bag of ROS")
    with errors_translated(path.name, "bag of ROS", _CURES[format]):
        reader = library_of_format.Reader(path)
        if format == "rosbag1":
            # It would read the time of every message at once; `_chunk_by_chunk` reads them when they are needed.
            reader.read_index_data = lambda *_: None
        if not counted:
            reader.storage.STORAGE_PLUGINS = reader.storage.STORAGE_PLUGINS | {"sqlite3": _Unopened}
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


def _from_databases(
    name: str, databases: list[Path], topic: str, start: int | None, stop: int | None
) -> Iterator[tuple[int, bytes]]:
    """What `_messages` gives."""
    with _connected(name, databases) as opened:
        for database in opened:
            _check_tables(database, name)
        first = [_end(database, name, "MIN") for database in opened]
        for i in sorted(range(len(opened)), key=lambda i: first[i] or 0):
            yield from _rows(
                opened[i],
                name,
                (int, bytes),
                "SELECT timestamp, data FROM messages WHERE topic_id IN (SELECT id FROM topics WHERE name = ?) "
                "AND timestamp >= ? AND timestamp < ? ORDER BY timestamp",
                (topic, -(1 << 63) if start is None else start, (1 << 63) - 1 if stop is None else stop),
            )


@contextmanager
def _connected(name: str, databases: list[Path]) -> Iterator[list[sqlite3.Connection]]:
    """Databases of a bag, their errors reported."""
    import sqlite3

    with errors_translated(name, "bag of ROS", _CURES["rosbag2"]), ExitStack() as stack:
        opened = []
        for path in databases:
            uri = f"{path.resolve().as_uri()}?immutable=1"
            opened.append(stack.enter_context(closing(sqlite3.connect(uri, uri=True))))
        yield opened


def _check_tables(database: sqlite3.Connection, name: str) -> None:
    """Only tables are read: a view is a program, which need not end."""
    kinds = dict(database.execute("SELECT name, type FROM sqlite_master WHERE name IN ('topics', 'messages')"))
    if set(kinds.values()) != {"table"} or len(kinds) != 2:
        found = ", ".join(f"{key} is a {kind}" for key, kind in kinds.items()) or "neither is there"
        raise InputError(f"{name} is no bag of ROS 2: the tables topics and messages are expected; {found}.")


def _end(database: sqlite3.Connection, name: str, which: str) -> int | None:
    """The first (MIN) or the last (MAX) time of all messages; None where there are none."""
    found = _rows(database, name, (int | None,), f"SELECT {which}(timestamp) FROM messages")
    return next(found)[0]


def _rows(
    database: sqlite3.Connection, name: str, kinds: tuple[Any, ...], query: str, given: tuple[Any, ...] = ()
) -> Iterator[tuple[Any, ...]]:
    """Rows of a query; SQLite keeps a value of any type in any column, so the type of each is checked."""
    for row in database.execute(query, given):
        for value, kind in zip(row, kinds, strict=True):
            if not isinstance(value, kind):
                wanted = getattr(kind, "__name__", "int")
                raise InputError(
                    f"{name} is no bag of ROS 2: it holds {value!r:.60}, a {type(value).__name__}, where {wanted} is "
                    "expected. It is damaged."
                )
        yield row


def _counted(database: sqlite3.Connection) -> dict[int, int]:
    """Messages of each topic by its number."""
    return dict(database.execute("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id"))


def _drawn(database: sqlite3.Connection, total: int) -> dict[int, int]:
    """About how many messages each topic has, by the topics of some drawn evenly from all numbers of messages."""
    (first,) = database.execute("SELECT MIN(id) FROM messages").fetchone()
    (last,) = database.execute("SELECT MAX(id) FROM messages").fetchone()
    numbers = np.random.default_rng(0).integers(first, last, size=1000, endpoint=True)
    drawn = Counter(
        database.execute("SELECT topic_id FROM messages WHERE id >= ? ORDER BY id LIMIT 1", (number,)).fetchone()[0]
        for number in numbers.tolist()
    )
    return {topic: round(total * count / drawn.total()) for topic, count in drawn.items()}


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


FORMATS = {
    "rosbag1": Format(
        format_info("rosbag1"),
        open_rosbag1,
        recognises=lambda head: head.startswith(b"#ROSBAG "),
        write=write_rosbag1,
        foreign=("rosbags.rosbag1",),
    ),
    "rosbag2": Format(format_info("rosbag2"), open_rosbag2, foreign=("rosbags.rosbag2",)),
}
