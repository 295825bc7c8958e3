"""Texts that are no table but would be one: each line a JSON object, names with their values, or a list in brackets.

They are written anew as a table with titles, which is then read as any other text is. The native files of Android's
GnssLogger, which state the fields of each kind of row in comments, are among them.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from gyronorth.errors import InputError
from gyronorth.readers.sentences import rewriting_of
from gyronorth.readers.spool import Spooled, most_of
from gyronorth.readers.worded import rewriting_of_words

#: Bytes of whole lines, or characters of an array, that are written anew at a time, and most bytes of one object.
PIECE, WHOLE = 1 << 20, 1 << 25
#: Most names in JSON objects, and most cells of the table that a piece becomes: names that nearly no object has.
MOST_NAMES, MOST_CELLS = 400, 1 << 22
#: Lines that are looked at, fewest numbers in one, and bytes of the longest.
LOOKED_AT, FEWEST, LONGEST = 20, 3, 4096
#: Objects whose names make the titles, and the largest share of lines with other names than the first one.
COMPARED, MOST_OTHERS = 200, 0.1
_NUMBER = rb"[-+]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][-+]?\d++)?"  # a digit can be taken in one way only
_LABEL = rb"(?<![\w.])\"?([A-Za-z_][\w.]*(?:\[\w*\])?(?:[ \t]?\([\w/^.*-]{1,12}\))?)\"?[ \t]*[:=][ \t]*"
_BETWEEN = rb"[ \t,;|]+"
_LABELLED = re.compile(
    rb"[ \t{]*(?:%b%b(?:%b%b)*[ \t,;|}]*)+" % (_LABEL.replace(b"([A", b"(?:[A"), _NUMBER, _BETWEEN, _NUMBER)
)
_BRACKETED = re.compile(rb"[ \t]*[\[(][-+\d][^\[\](){}]*[\])],?[ \t]*")
_BLANKS, _SEPARATOR = re.compile(r"\s*+"), re.compile(r"\s*+([,\]])")
#: Kinds of GnssLogger's rows, the one that is taken where there are several coming first, and their names in the table.
_GYROS, _ACCELS = (b"UncalGyro", b"Gyro"), (b"UncalAccel", b"Accel")


def rewriter_of(head: bytes) -> Callable[[Path], Spooled] | None:
    """What writes a file that begins so as a table; None for tables and for what is no text."""
    body = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if b"\0" in body[:1024]:
        return None
    if re.match(rb"\[\s*\{", body):  # all of it may be one line
        return _of_array
    if _is_one_object(body):
        return _of_one_object
    lines = [line.strip() for line in body.split(b"\n")[: LOOKED_AT + 1]][:-1] or [body]
    lines = [line for line in lines if line]
    if not lines or max(map(len, lines)) > LONGEST:
        return None
    if any(_gnss_fields(line, _GYROS) for line in body.split(b"\n") if line.startswith(b"#")):
        return _of_gnss_logger
    if (rewriting := rewriting_of(lines, body)) is not None:
        return lambda path: _spooled(path, (piece for piece in rewriting(_pieces(path)) if piece))
    if body.startswith(b"{") and (b":" in lines[0]) and lines[0].endswith((b"}", b"},")):
        return _of_objects
    behind = lines[1:] or lines
    if all(_LABELLED.fullmatch(line) for line in behind) and len(re.findall(_LABEL, behind[0])) > 1:
        return _of_labels
    if all(_BRACKETED.fullmatch(line) for line in behind) and len(re.findall(_NUMBER, behind[0])) >= FEWEST:
        return _of_lists
    whole = body.split(b"\n") if body.endswith(b"\n") else body.split(b"\n")[:-1]
    if (worded := rewriting_of_words([line.rstrip(b"\r") for line in whole])) is not None:
        return lambda path: _spooled(path, worded(_pieces(path)))
    return None


def _is_one_object(body: bytes) -> bool:
    """Whether the file begins as one JSON object: in one line that does not end, or over lines of one name each."""
    first = body.split(b"\n", 1)[0].strip()
    return body.startswith(b"{") and (first == b"{" or (b"\n" not in body and len(body) > LONGEST))


def _spooled(path: Path, pieces: Iterable[bytes]) -> Spooled:
    """The pieces in a file."""
    spooled = Spooled(path.name)
    source = (piece for piece in pieces if piece)  # an empty one is no end
    most = most_of(path.stat().st_size)
    spooled.fill(
        lambda _: next(source, b""),
        most=most,
        too_large=f"{path.name} is more than {most >> 20} MiB as a table, which no recording of its size is.",
    )
    return spooled


def _pieces(path: Path) -> Iterator[bytes]:
    """Whole lines, many at a time, with LF."""
    with path.open("rb") as file:
        rest = file.read(3).removeprefix(b"\xef\xbb\xbf")
        while data := file.read(PIECE):
            whole, mark, rest_ = (rest + data).rpartition(b"\n")
            rest = rest_
            if len(rest) > PIECE:
                raise InputError(f"{path.name} has a line of more than {PIECE} characters: it is damaged.")
            if mark:
                yield whole.replace(b"\r\n", b"\n") + b"\n"
    if rest.strip():
        yield rest.replace(b"\r\n", b"\n").rstrip(b"\n") + b"\n"


def _of_objects(path: Path) -> Spooled:
    """Each line a JSON object."""

    def objects() -> Iterator[list[Any]]:
        for piece in _pieces(path):
            lines = [line.strip().rstrip(b",") for line in piece.split(b"\n")]
            yield _parsed(b"[%b]" % b",".join(line for line in lines if line), path.name)

    return _spooled(path, _of_rows(objects(), path.name))


def _of_array(path: Path) -> Spooled:
    """One JSON array of objects."""
    return _spooled(path, _of_rows(_parts(path), path.name))


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


def _of_one_object(path: Path) -> Spooled:
    """One JSON object that holds a list of objects, or lists of numbers."""
    if path.stat().st_size > WHOLE:
        raise InputError(
            f"{path.name} is one JSON object of more than {WHOLE >> 20} MiB. Write an object for each sample into a "
            "line of its own instead, or a list of them."
        )
    samples = _one_object(path)
    parts = (samples[first : first + LONGEST] for first in range(0, len(samples), LONGEST))
    return _spooled(path, _of_rows(parts, path.name))


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


def _lists(value: Any, place: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], list[Any]]]:
    for key, each in value.items():
        if isinstance(each, list):
            yield (*place, key), each
        elif isinstance(each, dict) and len(place) < 4:
            yield from _lists(each, (*place, key))


def _parsed(text: bytes, name: str) -> list[Any]:
    try:
        found: list[Any] = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(_no_json(name, error)) from None
    return found


def _of_rows(parts: Iterable[list[Any]], name: str) -> Iterator[bytes]:
    """A table of objects, whose titles are the names in the first ones."""
    places: dict[str, tuple[str | int, ...]] = {}
    for objects in parts:
        if not all(isinstance(each, dict) for each in objects):
            raise InputError(f"{name} holds JSON that is no list of objects; one object for each sample is expected.")
        objects = [sample for each in objects for sample in _unrolled(each)]
        if objects and not places:
            for each in objects[:COMPARED]:
                places |= dict(_leaves(each))
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


def _leaves(value: Any, place: tuple[str | int, ...] = ()) -> Iterator[tuple[str, tuple[str | int, ...]]]:
    """Title and place of every number and text in an object; of three in a list the titles end in x, y and z."""
    if isinstance(value, Mapping) and len(place) < 6:
        for key, each in value.items():
            yield from _leaves(each, (*place, key))
    elif isinstance(value, list) and len(value) <= 9:
        for i, each in enumerate(value):
            yield from _leaves(each, (*place, i))
    elif isinstance(value, int | float | str) and place:
        words = [str(word) for word in place]
        if isinstance(place[-1], int):
            words[-1] = "xyz"[place[-1]] if place[-1] < 3 else words[-1]
        yield re.sub(r'[",\r\n]', " ", ".".join(words)), place


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


def _of_labels(path: Path) -> Spooled:
    """Names with their values in each line: ts: 1.2 gx: 0.1 gy: 0.2, or Gyro: 0.1, 0.2, 0.3."""

    def pieces() -> Iterator[bytes]:
        titles: list[bytes] = []
        names: list[bytes] = []
        for piece in _pieces(path):
            lines = [line for line in piece.split(b"\n") if line.strip()]
            lines = [line for line in lines if titles or _LABELLED.fullmatch(line.strip())]
            if lines and not titles:
                titles = _titles(lines[0])
                yield b",".join(titles) + b"\n"
            names = re.findall(_LABEL, lines[0]) if lines and not names else names
            lines = _alike(lines, names, path.name)
            text = re.sub(_LABEL, b" ", b"\n".join(lines))
            rows = [re.sub(_BETWEEN, b",", line.strip(b" \t,;|{}")) for line in text.split(b"\n")]
            yield b"\n".join(rows) + b"\n"

    return _spooled(path, pieces())


def _alike(lines: list[bytes], names: list[bytes], file: str) -> list[bytes]:
    """The lines, those with other names than the first one as no row can be."""
    if re.findall(_LABEL, b"\n".join(lines)) == names * len(lines):
        return lines
    others = [i for i, line in enumerate(lines) if re.findall(_LABEL, line) != names]
    if len(others) > MOST_OTHERS * len(lines):
        kinds = [b" ".join(re.findall(_LABEL, line)).decode() for line in (lines[0], lines[others[0]])]
        raise InputError(
            f"{file} has lines of different names: {kinds[0]}; {kinds[1]}. Write those of each kind into a file of its "
            "own, and give the accelerometer's by --accel."
        )
    for i in others:
        lines[i] = b"'" + lines[i].split(b" ")[0][:40] + b"'"
    return lines


def _titles(line: bytes) -> list[bytes]:
    """The titles of a line of names with their values; three values behind one name are x, y and z."""
    parts = re.split(_LABEL, line)
    titles: list[bytes] = []
    for name, values in zip(parts[1::2], parts[2::2], strict=True):
        count = len(re.findall(_NUMBER, values))
        ends = [b""] if count == 1 else [b"_x", b"_y", b"_z"] if count == 3 else [b"_%d" % i for i in range(count)]
        titles += [name + end for end in ends]
    return titles


def _of_lists(path: Path) -> Spooled:
    """A list in brackets in each line."""
    return _spooled(path, (re.sub(rb"(?m)^[ \t]*[\[(](.*)[\])],?[ \t]*$", rb"\1", piece) for piece in _pieces(path)))


def _gnss_fields(line: bytes, kinds: tuple[bytes, ...]) -> tuple[bytes, list[bytes]] | None:
    """The kind and the fields that a comment of GnssLogger states."""
    fields = [field.strip() for field in line.lstrip(b"# \t").split(b",")]
    known = fields[0] in kinds and len(fields) >= 6 and any(field.endswith(b"Nanos") for field in fields)
    return (fields[0], fields) if known else None


def _of_gnss_logger(path: Path) -> Spooled:
    """The rows of the gyroscope and the accelerometer among all others, with the time of the sensors' events."""

    def pieces() -> Iterator[bytes]:
        stated: dict[bytes, list[bytes]] = {}
        yield b"MessageType,elapsedRealtimeNanos,MeasurementX,MeasurementY,MeasurementZ\n"
        for piece in _pieces(path):
            for line in re.findall(rb"(?m)^#.*$", piece):
                found = _gnss_fields(line, _GYROS + _ACCELS)
                stated |= {found[0]: found[1]} if found else {}
            taken = [next((kind for kind in kinds if kind in stated), b"") for kinds in (_GYROS, _ACCELS)]
            patterns = [rb"%b,[^\n]*" % kind for kind in taken if kind]
            out = io.BytesIO()
            for row in re.findall(rb"(?m)^(?:%b)$" % b"|".join(patterns), piece) if patterns else ():
                fields = row.split(b",")
                names = stated[fields[0]]
                time = next(i for i, name in enumerate(names) if name.endswith(b"Nanos"))
                kind = b"UncalGyro" if fields[0] in _GYROS else b"UncalAccel"
                out.write(b",".join([kind, *fields[time : time + 4]]) + b"\n")
            yield out.getvalue()

    # A piece without such rows is no end of the file.
    return _spooled(path, (piece for piece in pieces() if piece))
