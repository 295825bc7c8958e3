"""Data of R (.rds, .rda, .RData): data frames, matrices, vectors, and lists of such, by the names that R gives them.

A column is called FRAME$NAME, as in R; of a file with one data frame its NAME alone. The library parses the file into
its parts and no more: no object of R is built, and no code in it is run.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.asking import ask
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.held import held_source
from gyronorth.readers.library import errors_translated, library
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import Question, Source

#: How files of save() and of saveRDS() begin once they are unpacked, in their binary and text forms.
_BEGINS = re.compile(rb"(?:RD[XA][23]\n)?(?:X\n\x00\x00\x00[\x02\x03]|A\n[23]\n[0-9]+\n)")
#: Largest file, bytes: an 8 h recording at 200 Hz with 16 columns has 0.7e9.
LARGEST = 1 << 30
#: What stands between a list and its part; lists within lists, and parts of one, at most.
MARK, DEEPEST, MOST_PARTS = "$", 4, 1000
#: Texts of R that a column of dates and times has among its classes.
_TIMES = ("POSIXct", "Date", "difftime")
_MISSING = np.iinfo(np.int32).min


def open_r_data(path: Path, options: ReadOptions) -> Source:
    """Open a file of R."""
    parser = library("rdata.parser", path.name, "data of R", extra="r")
    size = path.stat().st_size
    if size > LARGEST:
        raise InputError(f"{path.name} is larger than {LARGEST >> 20} MiB; split it.")
    with errors_translated(path.name, "file of R"):
        content = path.read_bytes()
        held = parser.parse_data(content, extension=".rda" if content.startswith(b"RD") else ".rds")
        arrays = dict(_tables(parser.RObjectType, held.object, ""))
    frames = {title.split(MARK)[0] for title in arrays if MARK in title}
    if len(frames) == 1 and options.variable is None and all(MARK in title for title in arrays):
        frame = f"{next(iter(frames))}{MARK}"
        arrays = {title.removeprefix(frame): array for title, array in arrays.items()}
    elif len(frames) > 1 and options.variable is None and not options.columns:
        says = f"{path.name} holds {len(frames)} tables: {', '.join(sorted(frames)[:12])}. Which one is the recording?"
        largest = max(sorted(frames), key=lambda frame: sum(title.startswith(f"{frame}{MARK}") for title in arrays))
        raise ask(path.name, options, [Question(says, ("--variable", largest), certain=False)])
    arrays = {title: array for title, array in arrays.items() if array.size}
    shapes = {title: array.shape for title, array in arrays.items()}
    return held_source("r", path.name, arrays, shapes, options, mark=MARK)


def _tables(types: Any, item: Any, name: str, depth: int = 0) -> Iterator[tuple[str, NDArray[Any]]]:
    """Every array of numbers by name."""
    kind = item.info.type
    if kind in (types.REAL, types.INT):
        attributes = _attributes(types, item)
        if "levels" not in attributes:  # those of a factor are no numbers
            yield from _array(types, item, attributes, name or "data")
    elif kind == types.VEC and depth < DEEPEST:
        names = _texts(types, _attributes(types, item).get("names"))
        for k, part in enumerate(item.value[:MOST_PARTS]):
            title = names[k] if k < len(names) and names[k] else str(k + 1)
            yield from _tables(types, part, f"{name}{MARK}{title}" if name else title, depth + 1)
    elif kind == types.LIST and depth < DEEPEST:
        for title, part in _pairs(types, item):
            yield from _tables(types, part, f"{name}{MARK}{title}" if name else title, depth + 1)


def _array(types: Any, item: Any, attributes: dict[str, Any], name: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """A vector, or a matrix; one whose columns have names as one vector each."""
    values = np.ma.filled(np.ma.asarray(item.value), _MISSING) if item.info.type == types.INT else item.value
    values = np.asarray(values)
    if values.dtype.kind == "i":
        values = np.where(values == _MISSING, np.nan, values)
    shape = tuple(int(n) for n in attributes["dim"].value) if "dim" in attributes else values.shape
    if int(np.prod(shape)) != values.size:
        raise ValueError(f"{name} has {values.size} values for the shape {shape}")
    values = values.reshape(shape, order="F")
    parts = attributes.get("dimnames")
    titles = _texts(types, parts.value[1]) if parts is not None and len(shape) == 2 and len(parts.value) == 2 else []
    if titles:
        for k, title in enumerate(titles[: shape[1]]):
            yield f"{name}{MARK}{title}", values[:, k]
        return
    if any(word in _TIMES for word in _texts(types, attributes.get("class"))) and values.ndim == 1:
        values = _seconds(types, values, attributes)
    yield name, values


def _seconds(types: Any, values: NDArray[Any], attributes: dict[str, Any]) -> NDArray[np.float64]:
    """Times of R in seconds: of POSIXct they are, of others as the attribute says."""
    unit = (_texts(types, attributes.get("units")) or ["secs"])[0]
    factor = {"secs": 1.0, "mins": 60.0, "hours": 3600.0, "days": 86400.0}
    return np.asarray(values * factor.get(unit, 1.0))


def _attributes(types: Any, item: Any) -> dict[str, Any]:
    return dict(_pairs(types, item.attributes)) if item.attributes is not None else {}


def _pairs(types: Any, item: Any) -> Iterator[tuple[str, Any]]:
    """Names and values of a list of pairs, each of which holds the next one."""
    while item is not None and item.info.type == types.LIST:
        tag = item.tag
        while tag is not None and tag.info.type == types.REF:
            tag = tag.referenced_object
        yield _text(tag.value) if tag is not None else "", item.value[0]
        item = item.value[1]


def _texts(types: Any, item: Any) -> list[str]:
    return [_text(each) for each in item.value] if item is not None and item.info.type == types.STR else []


def _text(item: Any) -> str:
    """The text of a symbol or a string, which may lie some layers down."""
    while hasattr(item, "value"):
        item = item.value
    return item.decode("utf-8", errors="replace") if isinstance(item, bytes) else str(item or "")


FORMAT = Format(
    format_info("r"), open_r_data, recognises=lambda head: bool(_BEGINS.match(head)), foreign=("rdata.parser",)
)
