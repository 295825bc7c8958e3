"""Samples written in words: lines of one wording, one or several a sample, and what `rostopic echo` prints.

A line such as "Gyro X: 0.1 Y: 0.2 Z: 0.3 rad/s" is the same in every sample but for its numbers. The wording is found
in the first lines, the words before a number become the title of its column and the words behind it its unit. Sketches
of Arduino, consoles of microcontrollers and the line protocol of InfluxDB [1]_ are such texts.

References
----------
.. [1] InfluxData, Line protocol reference: measurement,tags fields timestamp; time in ns since 1970 by default.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from gyronorth.readers.sentences import Rewriting
from gyronorth.readers.spellings import is_unit
from gyronorth.readers.titles import take_apart

#: Lines at the start that are looked at, most lines of one sample, and times that its wording must come again.
LOOKED_AT, MOST_LINES, REPEATS = 100, 24, 3
#: Fewest numbers of a sample that have a name: three rates.
FEWEST = 3
_STAMP = rb"(?:\d{4}-\d\d-\d\d[T ]|(?:\d{4}[-/])?\d{3}[T: ])?\d\d:\d\d:\d\d[.,]\d+Z?"
_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_VALUE = re.compile(rb"(?<![\w.^/-])(?:%b|%b)" % (_STAMP, _NUMBER))
_AXIS = re.compile(r"[xyz]", re.IGNORECASE)
_BEHIND_AXIS = re.compile(r"[\s_.:=]*[xyz]$", re.IGNORECASE)
#: A line of what `rostopic echo` and `ros2 topic echo` print: name and value, and what stands between two messages.
_NAMED = re.compile(rb"( *)(\w+):[ \t]*(.*)")
_END = b"---"


def rewriting_of_words(lines: Sequence[bytes]) -> Rewriting | None:
    """What writes such lines as a table; None where they have no common wording.

    Parameters
    ----------
    lines : sequence of bytes
        The first lines, without their ends.
    """
    lines = lines[:LOOKED_AT]
    if _END in lines and any(line.startswith(b"angular_velocity:") for line in lines):
        return _of_messages
    wording = _wording([line.strip() for line in lines])
    return None if wording is None else wording.rows


@dataclass(frozen=True)
class Wording:
    """The lines of one sample."""

    lines: tuple[re.Pattern[bytes], ...]  # each with a group for every number
    titles: tuple[str, ...]

    def rows(self, pieces: Iterable[bytes]) -> Iterator[bytes]:
        """The samples as rows; a line that belongs to no whole sample becomes a row that says so."""
        yield ",".join(f'"{title}"' for title in self.titles).encode() + b"\n"
        begun = False  # whether a sample has been: what stands before the first one is no row
        values: list[bytes] = []
        at = 0
        for piece in pieces:
            rows = []
            for raw in piece.split(b"\n"):
                line = raw.strip()
                if not line:
                    continue
                match = self.lines[at].fullmatch(line)
                if match is None and at:
                    rows.append(b"'sample cut off'")
                    at, values = 0, []
                    match = self.lines[0].fullmatch(line)
                if match is None:
                    if begun:
                        rows.append(b"'" + line[:40].replace(b",", b" ") + b"'")
                    continue
                values += match.groups()
                at += 1
                if at == len(self.lines):
                    rows.append(b",".join(value.replace(b",", b".") for value in values))
                    at, values, begun = 0, [], True
            if rows:
                yield b"\n".join(rows) + b"\n"
        if at:
            yield b"'sample cut off'\n"


def _wording(lines: list[bytes]) -> Wording | None:
    """The wording that comes again and again up to the last lines."""
    blank = [i for i, line in enumerate(lines) if not line]
    shapes = [_VALUE.sub(b"#", line) for line in lines if line]
    behind_blank = {i - k for k, i in enumerate(blank)}  # places, among the lines that are not blank, behind a blank
    period = next((p for p in range(1, MOST_LINES + 1) if _comes_again(shapes, p)), None)
    if period is None:
        return None
    first = len(shapes) - REPEATS * period
    while first > 0 and shapes[first - 1] == shapes[first - 1 + period]:
        first -= 1
    first = next((i for i in range(first, first + period) if i in behind_blank), first)
    plain = [line for line in lines if line]
    sample = plain[first : first + period]
    titles, named = _titles(sample, [plain[first + k :: period] for k in range(period)])
    if named < FEWEST:
        return None
    return Wording(tuple(_pattern(line) for line in sample), tuple(titles))


def _comes_again(shapes: Sequence[bytes], period: int) -> bool:
    last = shapes[-REPEATS * period :]
    return len(last) == REPEATS * period and b"#" in b"".join(last) and last[:-period] == last[period:]


def _pattern(line: bytes) -> re.Pattern[bytes]:
    """A line with any numbers and any blanks."""
    fixed = [rb"\s*".join(re.escape(word) for word in re.split(rb"\s+", part)) for part in _VALUE.split(line)]
    return re.compile((rb"(%b|%b|nan|inf)" % (_STAMP, _NUMBER)).join(fixed))


def _titles(sample: Sequence[bytes], columns: Sequence[Sequence[bytes]]) -> tuple[list[str], int]:
    """A title for each number, and how many of them have a name before them with a colon or an equal sign."""
    titles: list[str] = []
    named = 0
    for line, alike in zip(sample, columns, strict=True):
        parts = [part.decode(errors="replace") for part in _VALUE.split(line)]
        values = [list(each) for each in zip(*(_VALUE.findall(one) for one in alike), strict=True)]
        names, units, runs = [""] * len(values), [""] * len(values), [0] * len(values)
        sensor, marked = "", False
        for i, text in enumerate(parts[:-1]):
            if i:
                units[i - 1], text = _unit(text)
            name, colon = _name(text), bool(re.search(r"[:=]\s*[(\[{]?\s*$", text))
            if text == ":" and i == 1 and len(values) == 2:  # gx:12.5:0.1, the time before the value
                names[0], name, runs[0] = "", names[0], 0
            elif name and not colon and take_apart(name).kind not in ("gyro", "accel", "time"):
                name = ""
            if name:
                marked = colon
                name = f"{sensor} {name}" if _AXIS.fullmatch(name) and sensor else name
                sensor = _BEHIND_AXIS.sub("", name)
            names[i], runs[i] = name, 0 if name or not i else runs[i - 1] + 1
            named += marked and runs[i] < FEWEST
        if values:
            units[-1] = _unit(parts[-1])[0]
        titles += _spelled_out(names, units, runs, values, len(titles))
    return titles, named


def _spelled_out(
    names: list[str], units: list[str], runs: list[int], values: Sequence[Sequence[bytes]], before: int
) -> list[str]:
    """Three numbers behind one name are x, y, z; a number without a name that runs on is the time."""
    titles = []
    for i, name in enumerate(names):
        head = i - runs[i]
        three = runs[head : head + 3] == [0, 1, 2] and bool(names[head])
        if three and runs[i] < FEWEST:
            name, unit = f"{names[head]} {'xyz'[runs[i]]}", units[head + 2]
        else:
            unit = units[i]
            if not name:
                name = "time" if _runs_on(values[i]) and "time" not in titles else f"column {before + i}"
            axis = _BEHIND_AXIS.search(name)
            if not unit and axis:  # X: 0.1 Y: 0.2 Z: 0.3 rad/s
                same = [k for k in range(i + 1, min(i + 3, len(names))) if _stem(names[k]) == _stem(name)]
                unit = next((units[k] for k in same if units[k]), "")
        titles.append(f"{name} ({unit})" if unit else name)
    return [title.replace('"', " ") for title in titles]


def _stem(name: str) -> str:
    return _BEHIND_AXIS.sub("", name).lower()


def _unit(text: str) -> tuple[str, str]:
    """The unit at the start of the words behind a number, and the rest."""
    match = re.match(r"\s*[)\]}]?\s*([^\s,;|:=\])]+)(?=[\s,;|\])]|$)(.*)", text, re.DOTALL)
    return (match[1], match[2]) if match and is_unit(match[1]) and match[1] not in "-#" else ("", text)


def _name(text: str) -> str:
    """The words before a number that name it: those behind the last mark, with what an axis alone belongs to."""
    text = re.split(r"[\])>|;,\t]", text.rstrip(" \t:=>([{"))[-1]
    parts = [part.strip() for part in re.split(r"[:=]", text)]
    words = f"{parts[-2]} {parts[-1]}" if len(parts) > 1 and _AXIS.fullmatch(parts[-1]) else parts[-1]
    words = words.strip(" ([{<'\"*#-")
    last = take_apart(words.split(" ")[-1])
    if last.kind in ("gyro", "accel") and last.axis is not None:  # behind tags: host=pi gx
        words = words.split(" ")[-1]
    return words if re.search(r"[A-Za-z]", words) else ""


def _runs_on(values: Sequence[bytes]) -> bool:
    try:
        numbers = [float(value) for value in values]
    except ValueError:
        return bool(values) and b":" in values[0]
    return len(numbers) > 1 and all(a < b for a, b in pairwise(numbers))


def _of_messages(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Messages between lines `---`, whose names are those of the fields, indented; lists are left out."""
    titles: list[str] = []
    lines: list[bytes] = []
    for piece in pieces:
        rows = []
        for line in piece.split(b"\n"):
            if line.strip() != _END:
                lines.append(line)
                continue
            rows += _message(lines, titles)
            lines = []
        if rows:
            yield b"\n".join(rows) + b"\n"
    if any(line.strip() for line in lines) and (rows := _message(lines, titles)):
        yield b"\n".join(rows) + b"\n"


def _message(lines: Sequence[bytes], titles: list[str]) -> list[bytes]:
    """The row of a message, with the titles before the first one; one with other fields becomes a row that says so."""
    found: dict[str, bytes] = {}
    place: list[tuple[int, str]] = []
    for line in lines:
        match = _NAMED.fullmatch(line.rstrip())
        if match is None:
            continue
        indent, value = len(match[1]), match[3].strip(b"\"' ")
        place = [each for each in place if each[0] < indent] + [(indent, match[2].decode())]
        if value and not value.startswith((b"[", b"-\n")):
            found[".".join(name for _, name in place)] = value.replace(b",", b" ")
    head: list[bytes] = []
    if not titles:
        if not any(title.startswith("angular_velocity.") for title in found):
            return []
        titles += found
        head = [",".join(titles).encode()]
    return [*head, b",".join(found.values()) if list(found) == titles else b"'message of other fields'"]
