"""JSON as a table: each line an object, one array of objects, or one object that holds the samples."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from gyronorth.errors import InputError
from gyronorth.readers.lines import NUMBER, PIECE, pieces_of, spooled
from gyronorth.readers.spellings import is_unit
from gyronorth.readers.spool import Spooled

#: Most bytes of one object.
WHOLE = 1 << 25
#: Most names in objects, and most cells of the table that a piece becomes: names that nearly no object has.
MOST_NAMES, MOST_CELLS = 400, 1 << 22
#: Fewest numbers of a sample, objects whose names make the titles, and rows of one object that are written at a time.
FEWEST, COMPARED, ROWS = 3, 200, 4096
#: Keys of a unit.
UNITS = ("unit", "units")
_BLANKS, _SEPARATOR = re.compile(r"\s*+"), re.compile(r"\s*+([,\]])")


def of_objects(path: Path) -> Spooled:
    """Each line a JSON object."""

    def objects() -> Iterator[list[Any]]:
        for piece in pieces_of(path):
            lines = [line.strip().rstrip(b",") for line in piece.split(b"\n")]
            yield parsed(b"[%b]" % b",".join(line for line in lines if line), path.name)

    return spooled(path, table_of(objects(), path.name))


def of_array(path: Path) -> Spooled:
    """One JSON array of objects."""
    return spooled(path, table_of(_parts(path), path.name))


def _parts(path: Path) -> Iterator[list[Any]]:
    """The objects of one JSON array, those of a piece at a time."""
    decode = json.JSONDecoder().raw_decode
    with path.open(encoding="utf-8-sig") as file:
        try:
            text = file.read(PIECE)
            at, objects = text.index("[") + 1, []
            while True:
                try:
                    found, end = decode(text, _end(_BLANKS, text, at))
                    at = _end(_SEPARATOR, text, end)
                except (ValueError, RecursionError):
                    more = file.read(PIECE) if len(text) - at <= PIECE else ""
                    if not more:
                        raise
                    yield objects
                    text, at, objects = text[at:] + more, 0, []
                    continue
                objects.append(found)
                if text[at - 1] == "]":
                    break
        except (ValueError, RecursionError) as error:
            raise InputError(_no_json(path.name, error)) from None
    yield objects


def _end(pattern: re.Pattern[str], text: str, at: int) -> int:
    match = pattern.match(text, at)
    if match is None:
        raise ValueError("Expecting ',' or ']' behind an object")
    return match.end()


def _no_json(name: str, error: Exception) -> str:
    return f"{name} is not the JSON that it begins as: {error}. It is damaged or cut off."


def of_one_object(path: Path) -> Spooled:
    """One JSON object that holds a list of objects, or lists of numbers."""
    if path.stat().st_size > WHOLE:
        raise InputError(
            f"{path.name} is one JSON object of more than {WHOLE >> 20} MiB. Write an object for each sample into a "
            "line of its own instead, or a list of them."
        )
    samples = _one_object(path)
    parts = (samples[first : first + ROWS] for first in range(0, len(samples), ROWS))
    return spooled(path, table_of(parts, path.name))


def _one_object(path: Path) -> list[Any]:
    try:
        whole = json.loads(path.read_bytes().decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InputError(_no_json(path.name, error)) from None
    samples = _samples(whole)
    if samples is None or not all(isinstance(each, dict) for each in samples):
        raise InputError(f"{path.name} holds JSON that is no list of objects; one object for each sample is expected.")
    return samples


def _samples(value: Any, depth: int = 0) -> list[Any] | None:
    """The samples in one object: its longest list of objects, or its lists of one length put side by side."""
    if not isinstance(value, dict) or depth > 3:
        return None
    if (table := _of_pandas(value)) is not None:
        return table
    lists = [each for each in value.values() if isinstance(each, list) and each and isinstance(each[0], dict)]
    if lists:
        return max(lists, key=len)
    columns = {".".join(place): each for place, each in _lists(value)}
    longest = max((len(each) for each in columns.values()), default=0)
    columns = {title: each for title, each in columns.items() if len(each) == longest}
    if longest < FEWEST or not columns:
        inner = (_samples(each, depth + 1) for each in value.values())
        return next((found for found in inner if found), None)
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _of_pandas(value: dict[str, Any]) -> list[Any] | None:
    """The rows of a table that pandas wrote: an object of columns by row, or columns and data; None of another."""
    columns, data = value.get("columns"), value.get("data")
    if isinstance(columns, list) and isinstance(data, list) and data and isinstance(data[0], list):
        return [dict(zip(map(str, columns), row, strict=False)) for row in data]
    by_row = list(value.values())
    if len(by_row) < FEWEST or not all(isinstance(each, dict) and len(each) >= FEWEST for each in by_row):
        return None
    keys = list(by_row[0])
    if any(list(each) != keys for each in by_row[1:]) or any(isinstance(x, dict | list) for x in by_row[0].values()):
        return None
    if all(str(key).isdigit() for key in keys):  # {"gx": {"0": 0.1, ...}, ...}
        return [dict(zip(value, row, strict=True)) for row in zip(*(each.values() for each in by_row), strict=True)]
    return by_row  # {"0": {"gx": 0.1, ...}, ...}


def _lists(value: Any, place: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], list[Any]]]:
    """Place and content of every list, with the unit that stands beside it in its own object."""
    unit = _unit(value) if place else ""
    for key, each in value.items():
        if isinstance(each, list):
            yield (*place, f"{key}{unit}"), each
        elif isinstance(each, dict) and len(place) < 4:
            yield from _lists(each, (*place, key))


def _unit(value: Mapping[str, Any]) -> str:
    """The unit that an object states of its values, as " (unit)"; "" where it states none."""
    stated = [each for key, each in value.items() if key.lower() in UNITS and isinstance(each, str) and is_unit(each)]
    return f" ({stated[0]})" if len(stated) == 1 else ""


def parsed(text: bytes, name: str) -> list[Any]:
    """A text of JSON; `name` is that of the file, for the message."""
    try:
        found: list[Any] = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(_no_json(name, error)) from None
    return found


def table_of(parts: Iterable[list[Any]], name: str) -> Iterator[bytes]:
    """A table of objects, whose titles are the names in the first ones."""
    places: dict[str, tuple[str | int, ...]] = {}
    for objects in parts:
        if objects and not places and all(isinstance(each, list) for each in objects):  # rows without titles
            yield "".join(",".join(_cell(each, (i,)) for i in range(len(each))) + "\n" for each in objects).encode()
            continue
        if not all(isinstance(each, dict) for each in objects):
            raise InputError(f"{name} holds JSON that is no list of objects; one object for each sample is expected.")
        objects = [sample for each in objects for sample in _unrolled(each)]
        if objects and not places:
            begin = next((i for i, each in enumerate(objects) if _count(each) >= FEWEST), 0)
            objects = objects[begin:]  # what describes the device holds no sample
            for each in objects[:COMPARED]:
                places |= dict(leaves_of(each))
            places = _without_number(places)
            if len(places) < FEWEST:
                raise InputError(
                    f"{name} holds JSON objects of {', '.join(places) or 'no numbers'}; three rates are expected."
                )
            yield (",".join(f'"{title}"' for title in places) + "\n").encode()
        if len(places) > MOST_NAMES or len(places) * len(objects) > MOST_CELLS:
            raise InputError(
                f"{name} holds JSON objects of {len(places)} names, {len(objects)} objects in {PIECE >> 20} MiB; "
                f"objects with the same names, at most {MOST_NAMES}, are expected, one for each sample."
            )
        columns = [[_cell(each, place) for each in objects] for place in places.values()]
        yield "".join(",".join(row) + "\n" for row in zip(*columns, strict=True)).encode()


def _count(value: dict[str, Any]) -> int:
    """How many numbers an object holds, written as such or as texts."""
    cells = [_cell(value, place).strip('"') for _, place in leaves_of(value)]
    return sum(re.fullmatch(NUMBER, cell.encode()) is not None for cell in cells)


def _unrolled(value: dict[str, Any]) -> list[dict[str, Any]]:
    """The samples of an object that holds several of them: lists of objects of one length, one sensor each."""
    lists = [each for _, each in _lists(value) if len(each) > 1 and all(isinstance(one, dict) for one in each)]
    if not lists or len({len(each) for each in lists}) > 1:
        return [value]

    def one(part: Any, i: int) -> Any:
        if any(part is each for each in lists):
            return part[i]
        return {key: one(each, i) for key, each in part.items()} if isinstance(part, dict) else part

    return [one(value, i) for i in range(len(lists[0]))]


def _without_number(places: dict[str, tuple[str | int, ...]]) -> dict[str, tuple[str | int, ...]]:
    """Titles without a number at their beginning that all of them share, as that of a device."""
    first = {title.partition(".")[0] for title in places}
    if len(first) != 1 or not first.pop().isdigit() or not all("." in title for title in places):
        return places
    return {title.partition(".")[2]: place for title, place in places.items()}


def leaves_of(
    value: Any, place: tuple[str | int, ...] = (), unit: str = ""
) -> Iterator[tuple[str, tuple[str | int, ...]]]:
    """Title and place of every number and text in an object; of three in a list the titles end in x, y and z.

    A unit that stands beside numbers in an object of their own, {"x": 0.1, "unit": "deg/s"}, is in their titles.
    """
    if isinstance(value, Mapping) and len(place) < 6:
        unit = (_unit(value) if place else "") or unit
        for key, each in value.items():
            yield from leaves_of(each, (*place, key), unit)
    elif isinstance(value, list) and len(value) <= 9:
        for i, each in enumerate(value):
            yield from leaves_of(each, (*place, i), unit)
    elif isinstance(value, int | float | str) and place:
        words = [str(word) for word in place]
        if isinstance(place[-1], int):
            words[-1] = "xyz"[place[-1]] if place[-1] < 3 else words[-1]
        yield re.sub(r'[",\r\n]', " ", ".".join(words)) + (unit if not isinstance(value, str) else ""), place


def _cell(value: Any, place: tuple[str | int, ...]) -> str:
    """One value of an object as it stands in a table; "" where it has none."""
    for key in place:
        if isinstance(value, dict):
            value = value.get(key)
        else:
            value = value[key] if isinstance(value, list) and isinstance(key, int) and key < len(value) else None
    if isinstance(value, bool) or value is None or isinstance(value, dict | list):
        return ""
    return '"' + re.sub(r'["\r\n]', " ", value) + '"' if isinstance(value, str) else repr(value)
