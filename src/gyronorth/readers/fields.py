"""Lines of text cut into fields, and which of these are numbers."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator

_NUMBER = re.compile(r"[+-]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][+-]?\d++)?|[+-]?(?:nan|inf(?:inity)?)", re.IGNORECASE)
_COMMA_NUMBER = re.compile(r"[+-]?\d*+,\d++(?:[eE][+-]?\d+)?|[+-]?\d+(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf)", re.IGNORECASE)


def split(line: str, delimiter: str | None) -> list[str]:
    """A line cut into fields, without the blanks around them; [] where quotation marks do not match."""
    if delimiter is None:
        if '"' not in line:
            return line.split()
        delimiter, line = " ", " ".join(line.split())
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, strict=True))] if line else []
    except (csv.Error, StopIteration):
        return []


def is_number(cell: str, decimal: str = ".") -> bool:
    """Whether a field is a number with this decimal sign."""
    return bool((_NUMBER if decimal == "." else _COMMA_NUMBER).fullmatch(cell.strip()))


def lines_below_titles(pieces: Iterable[bytes]) -> Iterator[list[str]]:
    """The lines of each piece of a table that are not blank, without the first of all."""
    titles = True
    for piece in pieces:
        lines = piece.decode(errors="replace").split("\n")
        yield [line for line in lines[titles:] if line.strip()]
        titles = False
