"""One message for all that a file leaves open, which ends in a command line that works."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from gyronorth.errors import InputError
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import Question

#: How the last line of the message begins.
TRY = "Try: gyronorth "


class OpenQuestion(InputError):
    """What a file leaves open; `added` are the options that would settle it, `certain` whether physics tells so."""

    def __init__(self, text: str, path: str, kept: Sequence[str], added: Sequence[str], certain: bool = True) -> None:
        self.text = text
        self.certain = certain
        self.added = tuple(added)
        super().__init__(f"{text}\n{TRY}{shlex.join(['info', path, *merged(kept, added)])}")

    def for_command(self, arguments: Sequence[str]) -> str:
        """The same message with the command line that was given, as the user gave it."""
        return f"{self.text}\n{TRY}{shlex.join(merged(arguments, self.added))}"


def ask(path: Path | str, options: ReadOptions, questions: Sequence[Question], lead: str = "") -> OpenQuestion:
    """The message of several questions about a file."""
    text = " ".join([lead, *(question.says for question in questions)]).strip()
    added = [word for question in questions for word in question.options]
    certain = all(question.certain for question in questions)
    return OpenQuestion(text, str(path), declared_options(options), added, certain)


def merged(arguments: Sequence[str], added: Sequence[str]) -> list[str]:
    """Arguments with options added, each of which takes the place of one of the same name."""
    names = {word for word in added if word.startswith("--")}
    kept: list[str] = []
    skip = False
    for word in arguments:
        if skip and not word.startswith("--"):
            skip = False
            continue
        skip = False
        if word.split("=")[0] in names and word.startswith("--"):
            skip = "=" not in word
            continue
        kept.append(word)
    return [*kept, *added]


def columns_text(columns: dict[str, str | int]) -> str:
    """A map of columns as `--columns` takes it."""
    return ",".join(f"{ours}={theirs}" for ours, theirs in columns.items())


def declared_options(options: ReadOptions) -> list[str]:
    """The declarations as the command line takes them."""
    words: list[str] = []
    if options.columns:
        words += ["--columns", columns_text(dict(options.columns))]
    values = {
        "--gyro-unit": options.gyro_unit, "--accel-unit": options.accel_unit, "--axes": options.axes,
        "--time-unit": options.time_unit, "--variable": options.variable, "--topic": options.topic,
        "--preset": options.preset,
    }  # fmt: skip
    numbers = {
        "--rate": options.rate_hz, "--gyro-scale": options.gyro_scale, "--accel-scale": options.accel_scale,
        "--increment-interval": options.increment_interval,
    }  # fmt: skip
    for name, value in values.items():
        words += [name, value] if value is not None else []
    for name, number in numbers.items():
        words += [name, f"{number:.10g}"] if number is not None else []
    if options.increments:
        words += ["--increments", "both" if options.increments is True else str(options.increments)]
    return [*words, *(["--drop-bad-rows"] if options.drop_bad_rows else [])]
