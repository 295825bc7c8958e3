"""CSV: our own files, files with any header mapped by `columns`, and the published recordings.

Ours: comment lines `# key: value`, a header `t,w_x,w_y,w_z,f_x,f_y,f_z`, rows of numbers.
The published recordings of arXiv 2312.12121: an unnamed index column, then w_x..w_z in
deg/s and f_x..f_z, 600 Hz, forward-right-down; the true heading in degrees is the file's
name, x_<heading>.csv. Their files do not say the unit of f: their own notebook levels with
"-g (-9.8)", so m/s^2 is usual here and a declaration overrules it.
"""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryFile

import numpy as np

from gyronorth.errors import InputError
from gyronorth.readers.asking import columns_text
from gyronorth.readers.columns import Chosen, by_numbers, by_numbers_of_titles, by_titles, is_bare, told
from gyronorth.readers.evidence import is_whole
from gyronorth.readers.facts import SIGNATURE, read_facts
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.kinds import first_unit, is_uneven, kinds_of, reject_kinds, rows_of
from gyronorth.readers.layout import TextLayout, sniff
from gyronorth.readers.options import ReadOptions, choose_columns
from gyronorth.readers.outgoing import RecordingStream
from gyronorth.readers.presets import Preset, matching
from gyronorth.readers.source import FLAGS, FORCES, NAMES, RATES, TIME, Block, Facts, Parts, Question, Source
from gyronorth.readers.text import Layout, text_blocks, text_parts
from gyronorth.readers.text_clock import FoundClock, find_clock, numbers
from gyronorth.readers.titles import Title, take_apart

#: What a live recording states of itself: its last line may be cut off, and marks stand between its rows.
LIVE_FORMAT = "gyronorth.live/1"
#: How a line begins that marks a moment in a live recording.
MARK = b"# mark: "
COMMENT = re.compile(r"#\s*([A-Za-z_]+)\s*:\s*+(.*)$")
#: How lines begin that are no rows.
COMMENT_BEGINS = (b"#", b"%", b"//")
_PUBLISHED_NAME = re.compile(r"x_(\d{1,3}(?:\.\d{1,4})?)\.csv", re.IGNORECASE)
_PUBLISHED_TITLES = ("", *RATES, *FORCES)
_PUBLISHED = Facts(rate_hz=600.0, gyro_unit="deg/s", accel_unit="m/s2", axes="frd")


def open_csv(path: Path, options: ReadOptions) -> Source:
    """Open a text file with columns."""
    return open_layout(path, options)[0]


def open_layout(path: Path, options: ReadOptions) -> tuple[Source, TextLayout, Layout]:
    """A text file with columns, how it is laid out, and how its rows are read."""
    layout = sniff(path)
    facts, ours = stated_facts(layout.comments, path.name)
    live = layout.comments.get(SIGNATURE[0], ("", 0))[0] == LIVE_FORMAT
    titles = layout.titles
    if titles and layout.rows == () and layout.cut is not None:
        raise InputError(
            f"Row {layout.row + 1} of {path.name}: it has {layout.cut} fields; {len(titles)} are expected, "
            "one for each title of the header."
        )
    if ours and not options.columns and titles not in (NAMES, (TIME, *RATES)):
        row = 1 + (layout.header_row if layout.header_row is not None else layout.row)
        raise InputError(f"Row {row} of {path.name} is not the header that gyronorth wrote: it is damaged.")
    heading = published_heading(path) if titles == _PUBLISHED_TITLES and not layout.comments else None
    if heading is not None:
        stated, usual, preset = Facts(heading_true=heading), _PUBLISHED, None
    else:
        preset = None if ours or not titles else matching(titles, _preamble(layout), path.name)
        stated, usual = facts, _usual(preset)
    only = _only(preset, titles) or kinds_of(layout, path.name)
    parts = [take_apart(title, unit) for title, unit in zip_longest(titles, layout.units[: len(titles)], fillvalue="")]
    only = only or first_unit(layout, parts)
    parts = _named(parts, "gyro") if only is not None and preset is None else _named_by_file(parts, path)
    of_rates = layout if only is None else rows_of(layout, only)
    chosen = _chosen(of_rates, parts, options, preset, path.name)
    positions = choose_columns(
        list(titles) if titles else layout.width, chosen.columns, {}, path.name, needed=options.needed
    )
    chosen = _counting(chosen, layout, positions, options)
    if only is None:
        reject_kinds(layout, positions, path.name)
    clock = None
    if TIME in positions:
        unit = options.time_unit or ("s" if ours or live else usual_time(preset))
        known = options.rate_hz or stated.rate_hz or usual.rate_hz
        clock = find_clock(of_rates, parts, positions[TIME], unit, known)
    elif options.time_unit is not None and TIME not in (options.columns or {}):
        raise InputError(f"{path.name} has no time column for --time-unit {options.time_unit}; leave it out.")
    stated = with_titles(stated, chosen, layout, clock, path.name)
    columns = tuple(name for name in NAMES if name in positions)
    names = titles or tuple(f"column {position}" for position in range(layout.width))
    composed = clock.columns if clock is not None else None
    flags = tuple(titles.index(name) for name in FLAGS if live and name in titles)
    use = (*(positions[name] for name in columns if name != TIME or composed is None), *flags)
    rows = Layout(
        names, use, layout.delimiter, layout.trailing, mark=MARK if live else None,
        comments=() if live else (*COMMENT_BEGINS, *_repeated_header(layout)),
        blank=layout.blank or (clock is not None and not ours and not live),
        sparse=layout.sparse, decimal=layout.decimal, encoding=layout.encoding, line_end=layout.line_end,
        end=None if ours or live else layout.end, clock=composed, texts=bool(layout.texts),
        only=None if only is None else only[:2],
    )  # fmt: skip
    units = {"gyro": options.gyro_unit or stated.gyro_unit or usual.gyro_unit or "unit open",
             "accel": options.accel_unit or stated.accel_unit or usual.accel_unit or "unit open"}  # fmt: skip
    as_preset = "" if preset is None else f"{preset.title}; "
    read_as = as_preset + told(positions, names, units, clock.told if clock else "")
    read_as += f"; the rows of {names[only[0]]} {only[1]} alone" if only is not None and not only[2] else ""
    read_as += f"; {', '.join(rows.turned)} with the sign turned" if rows.turned else ""
    words = f"; {layout.words()}" if layout.words() else ""
    # Lines begin at every other byte only, or some stand for no rows.
    whole = layout.encoding.startswith("utf-16") or layout.blank or layout.sparse or rows.only is not None
    source = Source(
        format="published" if heading is not None else "csv",
        name=path.name,
        columns=columns,
        blocks=partial(_blocks, path, layout, rows, len(columns)),
        stated=stated,
        usual=usual,
        clock=None if clock is None else clock.clock,
        ours=ours,
        axes_defined=heading is not None or (preset is not None and "axes" in preset.declared),
        parts=None if whole else _parts(path, layout, rows, len(columns)),
        questions=(*chosen.questions, *([clock.question] if clock is not None and clock.question else [])),
        read_as="" if ours or live or heading is not None else read_as + words,
    )
    if only is not None:
        return _of_two_kinds(source, only, layout, path, rows), layout, rows
    return (_of_two_rates(source, path, layout, rows) if is_uneven(layout, positions) else source), layout, rows


def _repeated_header(layout: TextLayout) -> tuple[bytes, ...]:
    """How the header begins, which stands again where logs were joined."""
    return (layout.header.encode(),) if layout.header else ()


def _of_two_kinds(source: Source, only: tuple[int, str, str], layout: TextLayout, path: Path, rows: Layout) -> Source:
    """Rows of rates joined with the rows of forces between them, which have the same columns."""
    if not any(row[only[0]] == only[2] for row in layout.rows):
        return source
    from gyronorth.readers.joining import joined

    forces = replace(rows, only=(only[0], only[2]))
    accel = replace(
        source,
        columns=(*(name for name in source.columns if name == TIME), *FORCES),
        blocks=partial(text_blocks, path, layout.offset, layout.row, forces),
        read_as="",
    )
    return joined(source, accel)


def _of_two_rates(source: Source, path: Path, layout: TextLayout, rows: Layout) -> Source:
    """Rows of which some hold rates and some forces, in columns of their own: each read alone, then joined."""
    from gyronorth.readers.joining import joined

    time = tuple(name for name in source.columns if name == TIME)

    def of(ours: tuple[str, ...]) -> Source:
        columns = (*time, *(name for name in source.columns if name in ours))
        use = tuple(rows.use[i] for i, name in enumerate(_used(source.columns, rows)) if name in columns)
        blocks = partial(_filled, path, layout, replace(rows, use=use))
        return replace(source, columns=columns, blocks=blocks, parts=None)

    return joined(of(RATES), replace(of(FORCES), read_as=""))


def _filled(path: Path, layout: TextLayout, rows: Layout) -> Iterator[Block]:
    """Blocks without the rows in which the sensor has no value."""
    for block in text_blocks(path, layout.offset, layout.row, rows):
        there = ~np.isnan(block.values[:, -3:]).all(axis=1)
        yield block if there.all() else replace(block, values=block.values[there], rows=block.rows[there])


def _used(columns: tuple[str, ...], rows: Layout) -> tuple[str, ...]:
    """The names of the fields that are read; a time put together of several is none of them."""
    return columns if rows.clock is None else tuple(name for name in columns if name != TIME)


def _chosen(layout: TextLayout, parts: list[Title], options: ReadOptions, preset: Preset | None, name: str) -> Chosen:
    """The columns: as declared, and for the rest by preset, titles or numbers."""
    declared = dict(options.columns or {})
    if layout.titles:
        chosen = by_titles(layout, parts, options, preset)
        chosen = replace(chosen, columns=chosen.columns | declared)
        open_ = not any(ours in chosen.columns for ours in options.needed) and layout.rows
        return (by_numbers_of_titles(layout, options, name) or chosen) if open_ else chosen
    if all(ours in declared for ours in options.needed):
        return Chosen(declared)
    lead = f"{name} has no header: its row {layout.row + 1} is already numbers."
    found = by_numbers(layout, options.needed)
    if found is None:
        raise InputError(
            f"{lead} Say which column is which by its number from 0, as in --columns t=0,w_x=1,w_y=2,w_z=3."
        )
    question = found.questions[0]
    columns = {**found.columns, **declared}
    return Chosen(
        columns,
        questions=(Question(f"{lead} By its first rows {question.says}", ("--columns", columns_text(columns))),),
    )


def _counting(chosen: Chosen, layout: TextLayout, positions: Mapping[str, int], options: ReadOptions) -> Chosen:
    """With the units of whole numbers of which the lines above the rows say what one count is, and a question."""
    units: dict[str, str | None] = {"gyro": chosen.gyro_unit, "accel": chosen.accel_unit}
    questions: list[Question] = []
    for sensor, ours, declared, scale in (
        ("gyro", RATES, options.gyro_unit, options.gyro_scale),
        ("accel", FORCES, options.accel_unit, options.accel_scale),
    ):
        if sensor not in layout.counts or units[sensor] or ours[0] not in positions:
            continue
        unit, one, words = layout.counts[sensor]
        values = np.column_stack([numbers(layout, positions[name]) for name in ours])
        if declared not in (None, unit) or not is_whole(values[np.isfinite(values).all(axis=1)]):
            continue
        units[sensor] = unit
        if scale is None:
            says = f"The lines above its rows say {words}, and its columns {ours[0]}, ... hold whole numbers."
            questions.append(Question(says, (f"--{sensor}-scale", f"{one:.10g}")))
    return replace(
        chosen, gyro_unit=units["gyro"], accel_unit=units["accel"], questions=(*questions, *chosen.questions)
    )


def with_titles(stated: Facts, chosen: Chosen, layout: TextLayout | None, clock: FoundClock | None, name: str) -> Facts:
    """What the file states, with the units and the increments of its titles."""
    for sensor, of_titles, of_comments in (
        ("gyro", chosen.gyro_unit, stated.gyro_unit),
        ("accel", chosen.accel_unit, stated.accel_unit),
    ):
        if of_titles and of_comments and of_titles != of_comments:
            raise InputError(
                f"{name} states {sensor}_unit {of_comments} in a comment and {of_titles} in its titles: correct one."
            )
    both = len(chosen.increments) == 2
    increments = "both" if both else next(iter(chosen.increments), stated.increments)
    rate_hz = stated.rate_hz
    if rate_hz is None and layout is not None and (clock is None or clock.clock.unit is None):
        rate_hz = layout.rate_hz
    return replace(
        stated,
        gyro_unit=stated.gyro_unit or chosen.gyro_unit,
        accel_unit=stated.accel_unit or chosen.accel_unit,
        increments=increments,
        rate_hz=rate_hz,
        gyro_scale=chosen.scales.get("gyro"),
        accel_scale=chosen.scales.get("accel"),
    )


def _usual(preset: Preset | None) -> Facts:
    """What a preset that applies unasked implies: a declaration overrules it."""
    if preset is None:
        return Facts()
    declared = preset.declared
    return Facts(
        rate_hz=declared.get("rate_hz"),
        gyro_unit=declared.get("gyro_unit"),
        accel_unit=declared.get("accel_unit"),
        gyro_scale=declared.get("gyro_scale"),
        accel_scale=declared.get("accel_scale"),
        axes=declared.get("axes"),
        increments=declared.get("increments", False),
    )


def usual_time(preset: Preset | None) -> str | None:
    """The unit of time of a preset."""
    return None if preset is None else preset.declared.get("time_unit")


def _only(preset: Preset | None, titles: tuple[str, ...]) -> tuple[int, str, str] | None:
    """Position of the column by which rows of two kinds are known, and their texts."""
    if preset is None or preset.only is None:
        return None
    return titles.index(preset.only[0]), preset.only[1], preset.only[2]


def _preamble(layout: TextLayout) -> str:
    return "\n".join(line for _, line in layout.preamble)


def _named_by_file(parts: list[Title], path: Path) -> list[Title]:
    """Columns x, y, z of a file that is named after one sensor."""
    if any(part.kind in ("gyro", "accel") for part in parts):
        return parts
    stem = path.stem.lower()
    kind = "gyro" if "gyr" in stem else "accel" if "acc" in stem else ""
    return _named(parts, kind) if kind else parts


def _named(parts: list[Title], kind: str) -> list[Title]:
    return [replace(part, kind=kind) if part.axis is not None and is_bare(part) else part for part in parts]


def _blocks(path: Path, layout: TextLayout, rows: Layout, columns: int) -> Iterator[Block]:
    return (_flags_apart(block, columns) for block in text_blocks(path, layout.offset, layout.row, rows))


def _parts(path: Path, layout: TextLayout, rows: Layout, columns: int) -> Parts:
    parts = text_parts(path, layout.offset, layout.row, rows)
    return replace(parts, read=lambda share: _flags_apart(parts.read(share), columns))


def _flags_apart(block: Block, columns: int) -> Block:
    """Of the recording of a unit's frames: what the unit says of its samples stands behind the columns."""
    if block.values.shape[1] == columns:
        return block
    return replace(block, values=block.values[:, :columns], flags=block.values[:, columns:] != 0)


def published_heading(path: Path) -> float | None:
    """The true heading, rad, in the name of a published recording; None for another name."""
    match = _PUBLISHED_NAME.fullmatch(path.name)
    return math.radians(float(match[1])) if match and float(match[1]) <= 360 else None


def stated_facts(texts: Mapping[str, tuple[str, int]], name: str) -> tuple[Facts, bool]:
    """The facts in the comment lines, key -> (value, row), and whether gyronorth wrote them.

    Raises
    ------
    InputError
        If a value is not what its key allows; it names the row and `name`.
    """
    return read_facts({key: text for key, (text, _) in texts.items()}, lambda key: f"Row {texts[key][1]} of {name}")


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
