"""One message for all that a file leaves open, which ends in a command line that works."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from gyronorth.errors import InputError
from gyronorth.readers.options import ReadOptions, parse_columns
from gyronorth.readers.source import Question

#: How the last line of the message begins.
TRY = "Try: gyronorth "


class OpenQuestion(InputError):
    """What a file leaves open; `added` are the options that would settle it, `certain` whether physics tells so."""

    def __init__(self, text: str, path: str, kept: Sequence[str], added: Sequence[str], certain: bool = True) -> None:
        self.text = text
        self.certain = certain
        self.added = tuple(added)
        self._made_of = (text, path, tuple(kept), self.added, certain)
        super().__init__(f"{text}\n{TRY}{shlex.join(['info', path, *merged(kept, added)])}")

    def __reduce__(self) -> tuple[type[OpenQuestion], tuple[object, ...]]:
        """So that it can be sent from the process that opened the file."""
        return type(self), self._made_of

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
    """Arguments with options added, each of which takes the place of one of the same name; columns are put together."""
    new = in_pairs(added)
    kept: list[str] = []
    skip = ""
    for word in arguments:
        name, mark, value = word.partition("=")
        if skip and not word.startswith("--"):
            value, name, skip = word, skip, ""
        elif name in new:
            skip = "" if mark or not new[name] else name
        else:
            skip = ""
            kept.append(word)
            continue
        if name == "--columns" and value:
            with suppress(InputError):  # what was not understood before is not said again
                new[name] = columns_text({**parse_columns(value), **parse_columns(new[name])})
    return [*kept, *(word for pair in new.items() for word in pair if word)]


def in_pairs(words: Sequence[str]) -> dict[str, str]:
    """Options with their values, "" for those that take none; of two of the same name the last one."""
    follow = [*words[1:], "--"]
    pairs = zip(words, follow, strict=True)
    return {name: "" if value.startswith("--") else value for name, value in pairs if name.startswith("--")}


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
    if options.window is not None:
        words += ["--window", "{:g}:{:g}".format(*options.window)]
    if options.increments:
        words += ["--increments", "both" if options.increments is True else str(options.increments)]
    return [*words, *(["--drop-bad-rows"] if options.drop_bad_rows else [])]
