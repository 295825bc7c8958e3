"""Results on the terminal: a panel or table for people, plain lines when the output is piped."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from typing import Any, TextIO

from gyronorth.errors import one_line, printable
from gyronorth.report.tables import Outcome
from gyronorth.report.wording import heading_lines, heading_text, number_text

#: Style of the terminal for the labels of `heading_lines` that stand out.
STYLES = {"reason": "red", "warning": "yellow", "heading": "bold", "verdict": "bold"}


def print_heading(outcome: Outcome, stream: TextIO) -> None:
    """Print one estimate: a panel on a terminal, else plain `label  text` lines."""
    lines = heading_lines(outcome)
    if not stream.isatty():
        print_lines(lines, stream)
        return
    from rich.console import Console
    from rich.panel import Panel
    from rich.table import Table
    from rich.text import Text

    valid = outcome.estimate is not None and outcome.estimate.valid
    colour = "green" if valid else "red"
    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="dim", no_wrap=True)
    grid.add_column(overflow="fold")
    for label, text in ((label, printable(text)) for label, text in lines):
        style = STYLES.get(label, "")
        grid.add_row(label, Text(text, style=f"bold {colour}" if label == "verdict" else style))
    Console(file=stream).print(Panel(grid, title="true north", border_style=colour, expand=False))


def print_lines(lines: Sequence[tuple[str, str]], stream: TextIO) -> None:
    """Print (label, text) pairs as aligned plain text."""
    width = max(len(label) for label, _ in lines)
    stream.writelines(f"{label:<{width}}  {printable(text)}".rstrip() + "\n" for label, text in lines)


def print_files(columns: Sequence[str], outcomes: Sequence[Any], stream: TextIO) -> None:
    """Print one row per file: cells of its table, or that it failed; why, as numbered notes below."""
    notes: dict[str, int] = {}
    rows = []
    for outcome in outcomes:
        cells, message = outcome.row(), outcome.message
        error = f"error [{notes.setdefault(message, len(notes) + 1)}]" if message else ""
        texts = [cell_text(cells.get(column)) for column in columns]
        rows.append((outcome.file, *(texts if not message else [error, *texts[1:]])))
    print_table(("file", *columns), rows, stream)
    stream.writelines(f"[{number}] error: {printable(note)}\n" for note, number in notes.items())


def cell_text(value: Any) -> str:
    """A cell for people: numbers to six digits."""
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def print_table(
    header: Sequence[str], rows: Sequence[Sequence[str]], stream: TextIO, *, unwrapped: Container[int] | None = None
) -> None:
    """Print rows of text as columns: ruled on a terminal, else aligned plain text.

    On a terminal the columns at the positions `unwrapped` (all but the last by default) keep to one line.
    """
    rows = [[one_line(cell) for cell in row] for row in rows]
    if stream.isatty():
        from rich.box import SIMPLE_HEAD
        from rich.console import Console
        from rich.table import Table
        from rich.text import Text

        table = Table(box=SIMPLE_HEAD, pad_edge=False)
        kept = range(len(header) - 1) if unwrapped is None else unwrapped
        for position, name in enumerate(header):
            table.add_column(name, no_wrap=position in kept, overflow="fold")
        for row in rows:
            table.add_row(*(Text(cell) for cell in row))
        Console(file=stream).print(table)
        return
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    for row in (header, *rows):
        cells = (f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True))
        stream.write("  ".join(cells).rstrip() + "\n")


def print_folder(outcomes: Sequence[Outcome], stream: TextIO) -> None:
    """Print one row per file: heading, sigma, interval and verdict; warnings and errors as numbered notes below."""
    notes: dict[str, int] = {}

    def numbers(texts: Iterable[str]) -> str:
        """The numbers of notes behind a verdict, new ones where they are needed."""
        found = sorted({notes.setdefault(text, len(notes) + 1) for text in texts})
        return f" [{' '.join(map(str, found))}]" if found else ""

    rows = []
    for outcome in outcomes:
        if outcome.estimate is None:
            rows.append((outcome.label(), "", "", "", "error" + numbers([f"error: {outcome.message}"])))
            continue
        doc = outcome.document()
        low, high = doc["interval95_deg"]
        codes = ", ".join(finding["code"] for finding in doc["reasons"])
        verdict = "valid" if doc["valid"] else f"refused ({codes})"
        rows.append(
            (
                outcome.label(),
                "" if doc["heading_deg"] is None else heading_text(doc["heading_deg"]),
                number_text(doc["sigma_deg"]),
                f"{heading_text(low)} to {heading_text(high, full_turn=True)}",
                verdict + numbers(f"warning: {finding['code']}" for finding in doc["warnings"]),
            )
        )
    header = ("file", "heading/deg", "sigma/deg", "95 % interval/deg", "verdict")
    print_table(header, rows, stream, unwrapped=(1, 2, 3))
    stream.writelines(f"[{number}] {printable(note)}\n" for note, number in notes.items())
