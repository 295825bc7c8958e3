"""CSV: our own files, files with any header mapped by `columns`, and the published recordings.

Ours: comment lines `# key: value`, a header `t,w_x,w_y,w_z,f_x,f_y,f_z`, rows of numbers.
The published recordings of arXiv 2312.12121: an unnamed index column, then w_x..w_z in
deg/s and f_x..f_z, 600 Hz, forward-right-down; the true heading in degrees is the file's
name, x_<heading>.csv. Their files do not say the unit of f: their own notebook levels with
"-g (-9.8)", so m/s^2 is usual here and a declaration overrules it.
"""

from __future__ import annotations

import csv
import math
import re
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryFile

import numpy as np

from gyronorth.errors import InputError
from gyronorth.readers.facts import SIGNATURE, is_number, read_facts
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.options import OUR_TITLES, ReadOptions, choose_columns
from gyronorth.readers.outgoing import RecordingStream
from gyronorth.readers.source import FLAGS, FORCES, NAMES, RATES, TIME, Block, Clock, Facts, Source
from gyronorth.readers.text import Layout, TextHead, text_blocks, text_parts

#: What a live recording states of itself: its last line may be cut off, and marks stand between its rows.
LIVE_FORMAT = "gyronorth.live/1"
#: How a line begins that marks a moment in a live recording.
MARK = b"# mark: "
COMMENT = re.compile(r"#\s*([A-Za-z_]+)\s*:\s*(.*?)\s*$")
_PUBLISHED_NAME = re.compile(r"x_(\d{1,3}(?:\.\d{1,4})?)\.csv", re.IGNORECASE)
_PUBLISHED_TITLES = ("", *RATES, *FORCES)
_PUBLISHED = Facts(rate_hz=600.0, gyro_unit="deg/s", accel_unit="m/s2", axes="frd")


def open_csv(path: Path, options: ReadOptions) -> Source:
    """Open a CSV file."""
    with TextHead(path) as head:
        texts = _comments(head)
        facts, ours = stated_facts(texts, head.name)
        live = texts.get(SIGNATURE[0], ("", 0))[0] == LIVE_FORMAT
        line = head.peek()
        if line is None or not line.strip():
            raise InputError(f"{path.name} ends before its header; a line such as {','.join(NAMES)} is expected.")
        titles = _fields(line, head)
        numeric = all(is_number(title) for title in titles if title) and any(titles)
        if numeric:
            header: list[str] | int = len(titles)
            if not options.columns:
                raise InputError(
                    f"{path.name} has no header: its row {head.row + 1} is already numbers. Say which column is "
                    "which by its number from 0, as in --columns t=0,w_x=1,w_y=2,w_z=3."
                )
            titles = [f"column {position}" for position in range(len(titles))]
        else:
            head.take()
            header = titles
            _reject_other_delimiter(line, titles, head)
        if ours and not options.columns and tuple(titles) not in (NAMES, (TIME, *RATES)):
            raise InputError(f"Row {head.row} of {path.name} is not the header that gyronorth wrote: it is damaged.")
        first_row = head.peek() or ""
        trailing, titles = _trailing(titles, first_row, numeric)
        found = choose_columns(header if not numeric else len(titles), options.columns, OUR_TITLES, path.name)
        offset, row = head.offset, head.row
    columns = tuple(name for name in NAMES if name in found)
    flags = tuple(titles.index(name) for name in FLAGS if live and name in titles)
    use = (*(found[name] for name in columns), *flags)
    layout = Layout(tuple(titles), use, ",", trailing, mark=MARK if live else None)
    parts = text_parts(path, offset, row, layout)
    heading = published_heading(path) if tuple(titles) == _PUBLISHED_TITLES else None
    published = heading is not None and facts == Facts()
    return Source(
        format="published" if published else "csv",
        name=path.name,
        columns=columns,
        blocks=lambda: (_flags_apart(block, len(columns)) for block in text_blocks(path, offset, row, layout)),
        stated=Facts(heading_true=heading) if published else facts,
        usual=_PUBLISHED if published else Facts(),
        clock=Clock(unit=1.0, name=titles[found[TIME]]) if TIME in found else None,
        ours=ours,
        parts=replace(parts, read=lambda share: _flags_apart(parts.read(share), len(columns))),
    )


def _flags_apart(block: Block, columns: int) -> Block:
    """Of the recording of a unit's frames: what the unit says of its samples stands behind the columns."""
    if block.values.shape[1] == columns:
        return block
    return replace(block, values=block.values[:, :columns], flags=block.values[:, columns:] != 0)


def published_heading(path: Path) -> float | None:
    """The true heading, rad, in the name of a published recording; None for another name."""
    match = _PUBLISHED_NAME.fullmatch(path.name)
    return math.radians(float(match[1])) if match and float(match[1]) <= 360 else None


def _comments(head: TextHead) -> dict[str, tuple[str, int]]:
    """The comment lines at the start: key -> (value, row)."""
    texts: dict[str, tuple[str, int]] = {}
    while (line := head.peek()) is not None and (line.startswith("#") or not line.strip()):
        head.take()
        match = COMMENT.match(line)
        if match is None:
            continue
        if match[1] in texts and texts[match[1]][0] != match[2]:
            raise InputError(f"Row {head.row} of {head.name} states {match[1]} again, with another value.")
        texts[match[1]] = (match[2], head.row)
    return texts


def stated_facts(texts: Mapping[str, tuple[str, int]], name: str) -> tuple[Facts, bool]:
    """The facts in the comment lines, key -> (value, row), and whether gyronorth wrote them.

    Raises
    ------
    InputError
        If a value is not what its key allows; it names the row and `name`.
    """
    return read_facts({key: text for key, (text, _) in texts.items()}, lambda key: f"Row {texts[key][1]} of {name}")


def _fields(line: str, head: TextHead) -> list[str]:
    try:
        return [field.strip() for field in next(csv.reader([line]))]
    except (csv.Error, StopIteration):
        raise InputError(f"Row {head.row + 1} of {head.name}: its quotation marks do not match.") from None


def _reject_other_delimiter(line: str, titles: list[str], head: TextHead) -> None:
    for delimiter, word in ((";", "semicolons"), ("\t", "tabs"), ("|", "bars")):
        if line.count(delimiter) > line.count(",") and len(titles) < 4:
            raise InputError(
                f"Row {head.row} of {head.name}, the header, has {word} between its fields; commas are expected. "
                "Save the file with commas between fields and points in numbers."
            )


def _trailing(titles: list[str], first_row: str, numeric: bool) -> tuple[bool, list[str]]:
    """Whether rows end in a comma with nothing behind it, and the titles without such an empty one."""
    if titles and not titles[-1] and not numeric:
        titles = titles[:-1]
    ends_in_comma = first_row.rstrip().endswith(",")
    if numeric:
        return ends_in_comma, titles[:-1] if ends_in_comma else titles
    return ends_in_comma and first_row.count(",") == len(titles), titles


def write_csv(outgoing: RecordingStream, path: Path) -> None:
    """Comment lines come first and are known last: the rows wait in a file of their own."""
    with TemporaryFile(dir=path.parent) as body, path.open("wb") as file:
        for rows in outgoing.rows():
            parts = [rows.gyro_b] + ([rows.accel_b] if rows.accel_b is not None else [])
            time = rows.numbers() / outgoing.rate_hz
            # repr is the shortest text that reads back to the same double.
            columns = [map(repr, column.tolist()) for column in (time, *np.hstack(parts).T)]
            body.write("".join(",".join(row) + "\n" for row in zip(*columns, strict=True)).encode())
        file.writelines(f"# {key}: {text}\n".encode() for key, text in outgoing.texts().items())
        file.write((",".join((TIME, *RATES, *(FORCES if outgoing.has_accel else ()))) + "\n").encode())
        body.seek(0)
        shutil.copyfileobj(body, file, 1 << 20)


FORMAT = Format(format_info("csv"), open_csv, write=write_csv)
