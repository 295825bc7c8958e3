"""gyronorth import: shows how a file is read, asks what physics cannot tell, writes what states all of it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.cli.app import app
from gyronorth.cli.outputs import check_outputs
from gyronorth.cli.progress import reading_file
from gyronorth.cli.reading_options import CHUNK_SAMPLES, READING, with_reading
from gyronorth.cli.recording_commands import RECORDING_SUFFIXES

if TYPE_CHECKING:
    from gyronorth.readers import Description, ReadOptions
    from gyronorth.readers.asking import OpenQuestion

#: What is put behind the name of a file that is imported without -o.
IMPORTED = "-imported.csv"


@app.command(name="import")
@with_reading
def import_file(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="A recording as it is.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="OUT", help=f"Recording to write; by default FILE{IMPORTED}."),
    ] = None,
    save_preset: Annotated[
        str | None, typer.Option(metavar="NAME", help="Write the declarations to NAME.json, for --preset.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Accept what physics determines, and ask nothing.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite existing files.")] = False,
    *,
    reading: ReadOptions,
) -> None:
    """Show how a file is read and why, ask what physics cannot tell, and write a recording that states everything."""
    from gyronorth import readers
    from gyronorth.files import write_text
    from gyronorth.readers import presets
    from gyronorth.report.importing import print_evidence

    output = output or source.with_name(f"{source.stem}{IMPORTED}")
    preset = None if save_preset is None else Path(save_preset).with_suffix(".json")
    outputs = {"-o": (output, RECORDING_SUFFIXES), "--save-preset": (preset, (".json",))}
    check_outputs(outputs, source=source, kept=() if force else outputs)
    asks = not yes and _can_ask()
    options, description = _described(source, reading, yes=yes, asks=asks)
    print_evidence(description, options.latitude, sys.stdout)
    if not description.info.axes_declared:
        options = replace(options, axes=_axes(description, source, asks=asks))
    with reading_file(source, doing="importing") as progress:
        _, chunks = readers.read_chunks(source, options, chunk_samples=CHUNK_SAMPLES, progress=progress)
        readers.write_chunks(chunks, output)
    typer.echo(f"wrote {output}: it states units, axes and rate. Next: gyronorth heading {output}{_latitude(options)}")
    if preset is not None:
        info = description.info
        kept = replace(options, gyro_unit=info.gyro_unit, accel_unit=info.accel_unit, axes=options.axes or info.axes)
        write_text(preset, presets.document(kept, f"files like {source.name}"))
        typer.echo(f"wrote {preset}: read the next such file with --preset {preset}")


def _can_ask() -> bool:
    """Whether somebody sits at a terminal."""
    return sys.stdin is not None and sys.stdin.isatty() and sys.stdout.isatty()


def _described(source: Path, options: ReadOptions, *, yes: bool, asks: bool) -> tuple[ReadOptions, Description]:
    """The file by these declarations and, where they do not suffice, by what physics proposes."""
    from gyronorth import readers
    from gyronorth.readers.asking import OpenQuestion

    while True:
        try:
            with reading_file(source) as progress:
                return options, readers.describe(source, options, progress=progress)
        except OpenQuestion as question:
            if not (asks or yes):
                raise
            answers = _answers(question, asks=asks)
            typer.echo(question.text)
            typer.echo("taken: " + " ".join(f"{name} {value}" for name, value in answers.items()))
            options = _with(options, answers)


def _answers(question: OpenQuestion, *, asks: bool) -> dict[str, str]:
    """Option -> value: as proposed, or as the user says; placeholders can only be answered by the user."""
    from gyronorth.readers.asking import in_pairs

    proposed = in_pairs(question.added)
    if not asks:
        if not question.certain or any(value.isupper() for value in proposed.values()):
            raise question
        return proposed
    typer.echo(question.text)
    return {
        name: typer.prompt(f"{name}", default=None if value.isupper() else value) for name, value in proposed.items()
    }


def _with(options: ReadOptions, answers: dict[str, str]) -> ReadOptions:
    """The options with more declarations, parsed as the command line parses them."""
    names = {"rate": "rate_hz"}
    values: dict[str, Any] = {}
    for option, text in answers.items():
        name = option.removeprefix("--").replace("-", "_")
        parser = READING[name][0].__metadata__[0].parser
        given = text or True  # an option without a value
        values[names.get(name, name)] = given if parser is None else parser(text)
    if options.columns and "columns" in values:
        values["columns"] = {**options.columns, **values["columns"]}
    return replace(options, **values)


def _axes(description: Description, source: Path, *, asks: bool) -> str:
    """Where the file's axes point: what gravity allows is shown, the user says which."""
    from gyronorth.errors import InputError
    from gyronorth.readers.axes import mat_bf
    from gyronorth.readers.mountings import mountings
    from gyronorth.report.importing import print_mountings

    found = []
    if description.force_mean is not None:
        mat = mat_bf(description.info.axes)  # what was assumed so far
        found = mountings(description.rate_mean @ mat, description.force_mean @ mat)
        typer.echo("Nothing in the file says where its axes point. Gravity allows:")
        print_mountings(found, sys.stdout)
    if not asks:
        choices = " or ".join(each.axes for each in found) or "three letters such as frd"
        raise InputError(
            f"Nothing in {source.name} says where its axes point, and the heading depends on it: --axes {choices}. Add "
            "it to the command."
        )
    default = found[0].axes if found else "frd"
    return str(typer.prompt("--axes", default=None if len(found) != 1 else default))


def _latitude(options: ReadOptions) -> str:
    return "" if options.latitude is not None else " --latitude DEG"
