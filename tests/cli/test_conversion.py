"""Values of options that are converted directly are those that typer gives."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer

from gyronorth.cli.conversion import convert_directly
from gyronorth.cli.options import number


def made() -> tuple[Any, dict[str, Any]]:
    seen: dict[str, Any] = {}
    app = typer.Typer(add_completion=False)

    @app.command()
    def _all(
        sources: list[str],
        name: str | None = None,
        path: Path | None = None,
        rate: Annotated[Any, typer.Option(parser=number("a rate", "100", above=0))] = None,
        preset: Annotated[Any, typer.Option(parser=str.upper)] = "as is",
        count: int | None = None,
        there: Annotated[Path | None, typer.Option(exists=True)] = None,
        several: Annotated[list[str] | None, typer.Option()] = None,
        switch: bool = False,
        called: Annotated[str | None, typer.Option(callback=lambda value: f"<{value}>")] = None,
    ) -> None:
        seen.update(locals())

    return typer.main.get_command(app), seen


@pytest.mark.parametrize(
    "words",
    [
        ["a"],
        ["a", "b [1].csv", "-"],
        ["a", "--name", "", "--path", "x/y.csv", "--rate", "2.5", "--preset", "mixed", "--count", "3", "--switch"],
        ["a", "--there", "/", "--several", "1", "--several", "2", "--called", "me"],
    ],
)
def test_the_short_way_gives_what_typer_gives(words):
    (plain, expected), (short, found) = made(), made()
    for parameter in short.params:
        convert_directly(parameter)
        convert_directly(parameter)  # once more changes nothing
    plain.main(list(words), standalone_mode=False)
    short.main(list(words), standalone_mode=False)
    del expected["seen"], found["seen"]
    assert found == expected
    assert {name: type(value) for name, value in found.items()} == {
        name: type(value) for name, value in expected.items()
    }


@pytest.mark.parametrize(
    "words", [[], ["a", "--rate", "-1"], ["a", "--rate", "x"], ["a", "--count", "x"], ["a", "--there", "/no/such"]]
)
def test_the_short_way_refuses_what_typer_refuses_in_the_same_words(words):
    (plain, _), (short, _) = made(), made()
    for parameter in short.params:
        convert_directly(parameter)
    told = []
    for command in (plain, short):
        with pytest.raises(Exception) as caught:  # noqa: PT011  # a usage error, wherever this version keeps it
            command.main(list(words), standalone_mode=False)
        told.append(caught.value.format_message())
    assert told[0] == told[1]


@pytest.mark.slow
def test_a_heading_loads_neither_models_nor_formats_it_does_not_need(tmp_path):
    code = (
        "import sys, gyronorth.cli as cli\ntry:\n    cli.main()\nexcept SystemExit:\n    pass\n"
        "print(sorted({'pydantic.main', 'importlib.metadata', 'gyronorth.readers.formats.rosbag', 'scipy', 'rich'} & "
        "set(sys.modules)))"
    )
    path = tmp_path / "rec.csv"
    path.write_text("t,w_x,w_y,w_z\n" + "".join(f"{i / 10},1e-5,2e-5,-5e-5\n" for i in range(600)))
    words = [str(path), "--sensor", "sdc500", "--method", "mean", "--latitude", "48", "--axes", "frd"]
    words += ["--gyro-unit", "rad/s"]
    run = subprocess.run([sys.executable, "-c", code, "heading", *words], capture_output=True, text=True, check=True)
    assert "heading " in run.stdout, run.stderr
    assert run.stdout.splitlines()[-1] == "[]"
