"""Lines that wrap their numbers: sentences with a checksum, the stamps of terminals, exponents of Fortran, ArduPilot.

Each is written anew as a plain table. `$PIMU,1.0,...*5A` loses its name and its checksum, which must hold;
`[2024-03-01 11:58:00.010] 0.1,0.2` and `11:58:00.010 -> 0.1,0.2` keep the stamp as a column of their own; of the text
log of an ArduPilot the rows of its first IMU are taken, by the columns that its line FMT states, rad/s and m/s^2 [1]_.

References
----------
.. [1] ArduPilot, Onboard Message Log Messages: IMU (TimeUS us, GyrX..Z rad/s, AccX..Z m/s/s, I instance).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial

import numpy as np

#: Writes pieces of whole lines anew.
Rewriting = Callable[[Iterable[bytes]], Iterator[bytes]]
#: Share of the lines looked at that must be alike, and fewest numbers in a sentence.
MOST, FEWEST = 0.9, 3
_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_SENTENCE = re.compile(rb"\$([A-Za-z][A-Za-z0-9]*),([^*$\n]*)\*([0-9A-Fa-f]{2})\s*")
_STAMP = rb"(?:\d{4}-\d\d-\d\d[ T])?\d\d:\d\d:\d\d[.,]\d+"
_STAMPED = re.compile(rb"(?:\[(%b)\]|(%b)[ \t]*->)[ \t]*(\S.*)" % (_STAMP, _STAMP))
_FORTRAN = re.compile(rb"(?<=[0-9.])[dD](?=[-+]\d{1,3}(?!\d))")
#: Numbers with a mark between thousands, which shows as such beside a decimal one: "-1,000.5"; 1.000,5 behind ; or tab.
_GROUPED = re.compile(rb'"[-+]?\d{1,3}(?:,\d{3})+(?:\.\d+)?"')
_GROUPED_POINT = re.compile(rb'"[-+]?\d{1,3}(?:,\d{3})+\.\d+"')
_GROUPED_COMMA = re.compile(rb"(?<=[;\t])[-+]?\d{1,3}(?:\.\d{3})+,\d+(?=[;\t\r\n])")
_FMT = re.compile(rb"(?m)^FMT,\s*\d+,\s*\d+,\s*(\w+),\s*\w+,\s*([^\n]*\bGyrX\b[^\n]*?)\s*$")
#: What stands behind the titles of an ArduPilot.
_ARDUPILOT = {b"TimeUS": b"TimeUS (us)", b"TimeMS": b"TimeMS (ms)"}
_ARDUPILOT |= {b"Gyr%c" % axis: b"Gyr%c (rad/s)" % axis for axis in b"XYZ"}
_ARDUPILOT |= {b"Acc%c" % axis: b"Acc%c (m/s2)" % axis for axis in b"XYZ"}


def rewriting_of(lines: Sequence[bytes], head: bytes) -> Rewriting | None:
    """What writes such lines as a table; None where they need nothing.

    Parameters
    ----------
    lines : sequence of bytes
        The first lines, not blank, without white space around them.
    head : bytes
        The start of the file.
    """
    stated = _FMT.search(head)
    if stated is not None and head.lstrip().startswith(b"FMT,"):
        return partial(_of_ardupilot, kind=stated[1], titles=[title.strip() for title in stated[2].split(b",")])
    if kinds := _sentences(lines):
        from gyronorth.frames import recognise

        return None if recognise(head) is not None else partial(_of_sentences, kinds=kinds)
    if sum(_STAMPED.fullmatch(line) is not None for line in lines) >= MOST * len(lines):
        return _of_stamped
    if _GROUPED_POINT.search(head) or _GROUPED_COMMA.search(head):
        grouped = _GROUPED_POINT if _GROUPED_POINT.search(head) else _GROUPED_COMMA
        every = _GROUPED if grouped is _GROUPED_POINT else grouped
        mark = b"," if grouped is _GROUPED_POINT else b"."
        return lambda pieces: (every.sub(lambda match: match[0].replace(mark, b""), piece) for piece in pieces)
    if sum(_FORTRAN.search(line) is not None for line in lines[1:] or lines) >= MOST * len(lines[1:] or lines):
        return lambda pieces: (_FORTRAN.sub(b"E", piece) for piece in pieces)
    return None


def _sentences(lines: Sequence[bytes]) -> tuple[bytes, ...]:
    """The kind of sentence that comes most often and holds numbers enough, or a gyroscope's and an accelerometer's.

    () where two others are as frequent.
    """
    found = [match for line in lines if (match := _SENTENCE.fullmatch(line))]
    if not lines or len(found) < MOST * len(lines):
        return ()
    kinds = Counter(match[1] for match in found if len(re.findall(rb"(?:^|,)%b(?=,|$)" % _NUMBER, match[2])) >= FEWEST)
    first, second = [*kinds.most_common(2), (b"", 0), (b"", 0)][:2]
    if first[1] > 2 * second[1]:
        return (first[0],)
    both = sorted((first[0], second[0]), key=lambda kind: b"ACC" in kind.upper())
    return tuple(both) if b"GYR" in both[0].upper() and b"ACC" in both[1].upper() else ()


def _of_sentences(pieces: Iterable[bytes], *, kinds: Sequence[bytes]) -> Iterator[bytes]:
    """The rows of one kind of sentence, or of two with their names; a wrong checksum makes a row that says so."""
    pattern = re.compile(rb"(?m)^\s*\$(?:%b),[^*$\n]*\*[0-9A-Fa-f]{2}\s*$" % b"|".join(kinds))
    begin = 1 if len(kinds) > 1 else len(kinds[0]) + 2
    for piece in pieces:
        lines = [line.strip() for line in pattern.findall(piece)]
        if not lines:
            continue
        symbols = np.frombuffer(b"".join(lines), dtype=np.uint8)
        edges = np.stack([np.flatnonzero(symbols == ord("$")) + 1, np.flatnonzero(symbols == ord("*"))], axis=1)
        sums = np.bitwise_xor.reduceat(symbols, edges.ravel())[::2]
        rows = [
            line[begin:-3] if int(line[-2:], 16) == found else b"'checksum of %b'" % line.split(b",")[0]
            for line, found in zip(lines, sums.tolist(), strict=True)
        ]
        yield b"\n".join(rows) + b"\n"


def _of_stamped(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The stamp as a column before the others."""
    for piece in pieces:
        rows = []
        for line in piece.split(b"\n"):
            match = _STAMPED.fullmatch(line.strip())
            if match is None:
                rows.append(line)
                continue
            rest = match[3].rstrip()
            delimiter = next((mark for mark in (b"\t", b";", b",") if mark in rest), b",")
            rest = rest if delimiter in rest else b",".join(rest.split())
            is_row = re.match(_NUMBER, rest) is not None
            stamp = (match[1] or match[2]).replace(b",", b".").strip()
            rows.append((stamp if is_row else b"time") + delimiter + rest)
        yield b"\n".join(rows)


def _of_ardupilot(pieces: Iterable[bytes], *, kind: bytes, titles: list[bytes]) -> Iterator[bytes]:
    """The rows of the first inertial sensor, with units behind the titles."""
    instance: bytes | None = None
    at = titles.index(b"I") if b"I" in titles else None
    for piece in pieces:
        rows = [row.split(b",")[1:] for row in re.findall(rb"(?m)^%b,[^\n]*$" % kind, piece)]
        rows = [[field.strip() for field in row] for row in rows]
        if rows and instance is None:
            instance = rows[0][at] if at is not None and len(rows[0]) > at else b""
            name = kind + (b"[%b]" % instance if instance else b"")
            named = [_ARDUPILOT.get(title, title) for title in titles]
            yield b",".join(b"%b %b" % (name, t) if t[:3] in (b"Gyr", b"Acc") else t for t in named) + b"\n"
        if at is not None:
            rows = [row for row in rows if len(row) <= at or row[at] == instance]
        if rows:
            yield b"\n".join(map(b",".join, rows)) + b"\n"
