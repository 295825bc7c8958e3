"""Topics whose messages are not sensor_msgs/Imu, read as tables: JSON, and messages of a driver's own.

What a driver's own messages hold is known by the definition that the file has of them. A topic is taken where its
names show exactly one triple of angular rates and one of forces, and no other topic does.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

from gyronorth.errors import InputError
from gyronorth.readers.columns import plain_triples
from gyronorth.readers.formats.csv import open_csv
from gyronorth.readers.json_table import leaves_of, table_of
from gyronorth.readers.lines import spooled
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.ros_definition import DefinitionError, decoder
from gyronorth.readers.source import Question, Source
from gyronorth.readers.titles import take_apart, triples
from gyronorth.recording import Note

#: Messages that are written as a table at a time, topics that are looked into, and fewest values of a sample.
BATCH, MOST_TOPICS, FEWEST = 4096, 200, 3

#: Log times, ns, and serialised messages of a topic.
Logged = Callable[[], Iterable[tuple[int, bytes]]]


@dataclass(frozen=True)
class OwnTopic:
    """A topic of messages whose definition the file holds."""

    name: str
    kind: str  # type of its messages
    definition: str  # in .msg form; "" where there is none
    cdr: bool
    messages: Logged
    questions: tuple[Question, ...] = ()  # where others may be meant as well

    def objects(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Log times and decoded messages.

        Raises
        ------
        DefinitionError
            If the definition is not understood, or a message does not follow it.
        """
        decode = decoder(self.kind, self.definition, cdr=self.cdr)
        for time, message in self.messages():
            yield time, decode(message)


def choose_own(topics: Sequence[OwnTopic], options: ReadOptions, name: str, *, of_imu: bool) -> OwnTopic | None:
    """The topic that is read of those that are not sensor_msgs/Imu; None where none is declared or shows an IMU.

    Parameters
    ----------
    topics : sequence of OwnTopic
        The other topics.
    options : ReadOptions
        Declarations.
    name : str
        File name, for messages.
    of_imu : bool
        Whether the file has topics of sensor_msgs/Imu, which come first.
    """
    if options.topic is not None:
        declared = (topic for topic in topics if topic.name == options.topic and topic.definition)
        return next((topic for topic in declared if options.columns or len(_titles(topic)) >= FEWEST), None)
    if of_imu or options.accel_topic is not None:
        return None
    found = [topic for topic in topics[:MOST_TOPICS] if topic.definition and _is_imu(topic)]
    if len(found) > 1:
        listed = ", ".join(f"{topic.name} ({topic.kind})" for topic in found[:12])
        says = f"{name} has {len(found)} topics that may be an IMU: {listed}. Which one is meant?"
        question = Question(says, ("--topic", found[0].name), certain=False)
        return replace(found[0], questions=(question,))
    return found[0] if found else None


def _titles(topic: OwnTopic) -> list[str]:
    """The names in the first message; none where it cannot be decoded."""
    try:
        _, first = next(iter(topic.objects()), (0, {}))
    except DefinitionError:
        return []
    return [title for title, _ in leaves_of(first)]


def _is_imu(topic: OwnTopic) -> bool:
    """Whether the names in the first message show one triple of angular rates and one of forces."""
    titles = _titles(topic)
    found = triples(titles, [take_apart(title) for title in titles])
    return all(len(plain_triples(found, kind)) == 1 for kind in ("gyro", "accel"))


def own_source(path: Path, format: str, topic: OwnTopic, options: ReadOptions) -> Source:
    """The recording in a topic of messages of a driver's own."""

    def objects() -> Iterator[tuple[int, Any]]:
        row = 0
        try:
            for found in topic.objects():
                row += 1
                yield found
        except DefinitionError as error:
            raise InputError(
                f"{path.name}: message {row + 1} of {topic.name} ({topic.kind}) cannot be read: {error}. Write the "
                f"topic as text and declare its columns: rostopic echo -b BAG -p {topic.name} > imu.csv."
            ) from None

    source = table_source(path, format, topic.name, topic.kind, objects, options)
    return replace(source, questions=(*topic.questions, *source.questions))


def table_source(
    path: Path,
    format: str,
    topic: str,
    kind: str,
    objects: Callable[[], Iterator[tuple[int, Any]]],
    options: ReadOptions,
) -> Source:
    """The recording in a topic as a table, with the recorder's time where its messages carry none of their own.

    Parameters
    ----------
    path, format : Path, str
        The file, and the name of its format.
    topic, kind : str
        Name of the topic and of what its messages are, for people.
    objects : callable
        Log times, ns, and decoded messages.
    options : ReadOptions
        Declarations.
    """
    first = [each for _, each in islice(objects(), 2)]
    timed = any(take_apart(title).kind == "time" for title, _ in leaves_of(first[0] if first else {}))
    timed = timed and not _is_stopped(first)

    def parts() -> Iterator[list[Any]]:
        there = objects()
        while batch := list(islice(there, BATCH)):
            yield [one if timed or not isinstance(one, dict) else {"log_time (ns)": at} | one for at, one in batch]

    table = spooled(path, table_of(parts(), path.name))
    source = open_csv(table.path, replace(options, topic=None, variable=None))
    notes = () if timed else (Note("log_time_used", f"The messages of {topic} carry no time: the recorder's is used."),)
    return replace(
        source, format=format, name=path.name, topic=topic, ours=False, parts=None, held=table,
        notes=(*source.notes, *notes), read_as=f"{topic} ({kind}); {source.read_as}".removesuffix("; "),
    )  # fmt: skip


def _is_stopped(objects: Sequence[Any]) -> bool:
    """Whether all times in the first messages are 0, as a driver leaves them that does not set them."""
    times = [value for each in objects for value in _times(each)]
    return bool(times) and not any(times)


def _times(value: Any) -> Iterator[float]:
    for title, place in leaves_of(value):
        if take_apart(title).kind == "time":
            found: Any = value
            for key in place:
                found = found[key]
            yield float(found) if isinstance(found, int | float) else 1.0


def json_objects(messages: Logged, name: str) -> Iterator[tuple[int, Any]]:
    """Log times and objects of messages of JSON."""
    for time, message in messages():
        try:
            yield time, json.loads(bytes(message))
        except (ValueError, RecursionError) as error:
            raise InputError(f"{name} holds a message that is not the JSON that it should be: {error}.") from None
