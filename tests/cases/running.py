"""`info` of a file, and the line `Try:` of its refusal."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from typer.testing import CliRunner

from gyronorth.cli import app

RUN = CliRunner()


def info(arguments: Sequence[str]) -> Any:
    return RUN.invoke(app, ["info", *arguments, "--json"], catch_exceptions=False)


def followed(result: Any, fill: Mapping[str, str], *more: str) -> Any:
    """Run the last line of a refusal, with what only the user knows and `more` options."""
    assert result.exit_code == 2
    last = result.stderr.rstrip("\n").split("\n")[-1]
    assert last.startswith("Try: gyronorth info ")
    assert result.stderr.count("\n") == 2  # one message of two lines
    words = shlex.split(last.removeprefix("Try: gyronorth "))
    return RUN.invoke(app, [*(fill.get(word, word) for word in words), *more], catch_exceptions=False)
