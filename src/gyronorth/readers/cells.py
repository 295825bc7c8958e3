"""Tables whose cells hold more than a number: three in brackets, a unit behind each, or hexadecimal counts.

`1.0,"[0.1, 0.2, 0.3]"` has one title for the three, and becomes three columns x, y, z; the unit of `0.12 deg/s` goes
into the title. Each is written anew as a plain table.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from functools import partial

from gyronorth.readers.fields import split
from gyronorth.readers.lines import NUMBER
from gyronorth.readers.sentences import Rewriting
from gyronorth.readers.spellings import is_unit

#: Share of the rows looked at that must be alike, and fewest cells with a unit.
MOST, FEWEST = 0.9, 3
_BETWEEN = rb"[ \t,;]+"
_VECTOR = re.compile(rb"\"?[\[(][ \t]*(%b(?:%b%b){2})[ \t]*[\])]\"?" % (NUMBER, _BETWEEN, NUMBER))
_HEX = re.compile(rb"(?<![\w.])0[xX]([0-9A-Fa-f]{16}|[0-9A-Fa-f]{8}|[0-9A-Fa-f]{6}|[0-9A-Fa-f]{4})(?![\w.])")
_CELL = re.compile(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*([^\d\s.,+-].*)")


def rewriting_of_cells(lines: Sequence[bytes]) -> Rewriting | None:
    """What writes such a table as a plain one; None where cells are numbers or texts.

    Parameters
    ----------
    lines : sequence of bytes
        The first lines, not blank: titles and rows.
    """
    rows = lines[1:]
    if len(rows) < FEWEST:
        return None
    if all(len(_HEX.findall(row)) >= FEWEST for row in rows):
        return lambda pieces: (_HEX.sub(_signed, piece) for piece in pieces)
    delimiter = max((b",", b";", b"\t"), key=lines[0].count)
    if not _VECTOR.search(lines[0]) and sum(bool(_VECTOR.search(row)) for row in rows) >= MOST * len(rows):
        return _of_vectors(lines[0], rows[-1], delimiter)
    if delimiter not in lines[0]:
        return None
    cut = [split(row.decode(errors="replace"), delimiter.decode()) for row in rows]
    titles = split(lines[0].decode(errors="replace"), delimiter.decode())
    units = _units([cells for cells in cut if len(cells) == len(titles)])
    if sum(map(bool, units)) < FEWEST:
        return None
    return partial(_without_units, titles=titles, units=units, delimiter=delimiter)


def _signed(match: re.Match[bytes]) -> bytes:
    """A hexadecimal number of 4, 6, 8 or 16 digits as the two's complement that it is."""
    bits = 4 * len(match[1])
    number = int(match[1], 16)
    return b"%d" % (number - (1 << bits) if number >> (bits - 1) else number)


def _of_vectors(header: bytes, row: bytes, delimiter: bytes) -> Rewriting | None:
    """Three columns for each title above three numbers in brackets."""
    titles = split(header.decode(errors="replace"), delimiter.decode())
    cells = split(_VECTOR.sub(b"[]", row).decode(errors="replace"), delimiter.decode())
    if len(cells) != len(titles):
        return None
    named = [
        f"{title} {axis}".strip() for title, cell in zip(titles, cells, strict=True)
        for axis in ("xyz" if cell == "[]" else ("",))
    ]  # fmt: skip

    def rewritten(pieces: Iterable[bytes]) -> Iterator[bytes]:
        yield _written(named, delimiter)
        for piece in _behind(pieces):
            yield _VECTOR.sub(lambda match: delimiter.join(re.split(_BETWEEN, match[1])), piece)

    return rewritten


def _units(rows: Sequence[Sequence[str]]) -> list[str]:
    """The unit behind the number in each column, where it is the same in all rows; "" in the others."""
    units = []
    for column in zip(*rows, strict=True):
        found = {match[2] if (match := _CELL.fullmatch(cell)) else "" for cell in column}
        unit = found.pop() if len(found) == 1 else ""
        units.append(unit if unit and is_unit(unit) else "")
    return units


def _without_units(
    pieces: Iterable[bytes], *, titles: Sequence[str], units: Sequence[str], delimiter: bytes
) -> Iterator[bytes]:
    """The table with the units in its titles; a cell with another unit stays as it is, and is no number."""
    named = [f"{title} ({unit})" if unit else title for title, unit in zip(titles, units, strict=True)]
    yield _written(named, delimiter)
    known = b"|".join(re.escape(unit.encode()) for unit in sorted(set(units) - {""}, key=len, reverse=True))
    behind = re.compile(rb"(?<=[\d.])[ \t]*(?:%b)[ \t]*(?=%b|\n)" % (known, re.escape(delimiter)))
    for piece in _behind(pieces):
        yield behind.sub(b"", piece)


def _behind(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The pieces without the line of the titles, which comes first."""
    first = True
    for piece in pieces:
        yield piece.lstrip().split(b"\n", 1)[1] if first else piece
        first = False


def _written(titles: Sequence[str], delimiter: bytes) -> bytes:
    return delimiter.join(f'"{title}"'.encode() for title in titles) + b"\n"
