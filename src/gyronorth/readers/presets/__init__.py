"""Presets: the declarations of a program's files as small JSON files, applied by name, by file, or by the titles."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any

from gyronorth.errors import InputError, did_you_mean
from gyronorth.files import read_bounded
from gyronorth.frozen import frozen
from gyronorth.readers.options import ReadOptions

#: Bytes of a preset.
LARGEST = 1_000_000
#: Keys that say when a preset applies, and what it is.
_ABOUT = ("title", "source", "titles", "preamble", "file", "only")
#: Keys that are declarations, by the names of `ReadOptions`.
DECLARES = (
    "columns", "time_unit", "gyro_unit", "accel_unit", "gyro_scale", "accel_scale", "increments",
    "increment_interval", "axes", "rate_hz",
)  # fmt: skip


@frozen
class Preset:
    """How the files of one program are read."""

    name: str
    title: str  # for people
    declared: Mapping[str, Any]  # fields of ReadOptions
    titles: tuple[str, ...] = ()  # all of which a file must have for the preset to apply unasked; "*" stands for any
    preamble: str = ""  # that must stand above the titles
    file: str = ""  # that must stand in the name of the file, in lower case
    only: tuple[str, str, str] | None = None  # of rows of several kinds: title, text in rates' rows, text in forces'

    def fits(self, titles: Sequence[str], preamble: str, name: str) -> bool:
        """Whether it applies to a file with these titles."""
        if not self.titles or self.preamble not in preamble or self.file not in name.lower():
            return False
        return all(title_of(wanted, titles) is not None for wanted in self.titles)

    def columns(self, titles: Sequence[str]) -> dict[str, str | int]:
        """Our name -> title in a file, of those the file has."""
        found: dict[str, str | int] = {}
        for ours, wanted in self.declared.get("columns", {}).items():
            theirs = wanted if isinstance(wanted, int) else title_of(wanted, titles)
            if theirs is not None:
                found[ours] = theirs
        return found

    def onto(self, options: ReadOptions) -> ReadOptions:
        """The options with what they leave open taken from here, for a preset that was asked for."""
        columns = dict(self.declared.get("columns", {})) | dict(options.columns or {})
        values = {key: value for key, value in self.declared.items() if key != "columns" and not getattr(options, key)}
        return replace(options, columns=columns or None, **values)


def title_of(wanted: str, titles: Sequence[str]) -> str | None:
    """The title that a name in a preset means: itself, or with "*" before it the one that ends so."""
    if not wanted.startswith("*"):
        return wanted if wanted in titles else None
    ending = [title for title in titles if title.endswith(wanted[1:])]
    return ending[0] if len(ending) == 1 else None


@cache
def shipped() -> tuple[Preset, ...]:
    """All presets of the package, by name."""
    files = sorted(Path(__file__).parent.glob("*.json"))
    return tuple(_preset(file.stem, json.loads(file.read_text(encoding="utf-8"))) for file in files)


def load(name: str) -> Preset:
    """A preset by its name, or from a file.

    Raises
    ------
    InputError
        If there is none, or the file is none.
    """
    for preset in shipped():
        if preset.name == name:
            return preset
    path = Path(name)
    if not path.is_file():
        known = [preset.name for preset in shipped()]
        raise InputError(
            f"There is no preset {name!r}; shipped are {', '.join(known)}; a file of your own ends in .json."
            f"{did_you_mean(name, known)}"
        )
    try:
        document = json.loads(read_bounded(path, LARGEST).decode("utf-8-sig"))
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(f"{name} is no preset: {error}.") from None
    if not isinstance(document, dict):
        raise InputError(f"{name} is no preset: a JSON object is expected.")
    unknown = set(document) - {*_ABOUT, *DECLARES}
    if unknown:
        raise InputError(
            f"{name} holds {', '.join(sorted(unknown))}; the keys of a preset are {', '.join((*_ABOUT, *DECLARES))}."
        )
    try:
        return _preset(path.stem, document)
    except (TypeError, LookupError, AttributeError, OverflowError) as error:
        raise InputError(f"{name} is no preset: {error}.") from None


def matching(titles: Sequence[str], preamble: str, name: str) -> Preset | None:
    """The shipped preset whose titles a file has; the one with the most of them."""
    found = [preset for preset in shipped() if preset.fits(titles, preamble, name)]
    return max(found, key=lambda preset: len(preset.titles)) if found else None


def document(options: ReadOptions, title: str) -> str:
    """A preset as JSON, from declarations."""
    declared = {item.name: getattr(options, item.name) for item in fields(options) if item.name in DECLARES}
    declared = {key: value for key, value in declared.items() if value not in (None, False)}
    if "columns" in declared:
        declared["columns"] = dict(declared["columns"])
    return json.dumps({"title": title} | declared, indent=2, ensure_ascii=False) + "\n"


def _preset(name: str, content: Mapping[str, Any]) -> Preset:
    declared = {key: content[key] for key in DECLARES if key in content}
    columns = declared.get("columns", {})
    if not isinstance(columns, dict) or not all(isinstance(each, str | int) for each in columns.values()):
        raise TypeError("columns is an object that names the file's column of each of ours")
    ReadOptions(**declared)  # its checks
    only = content.get("only")
    return Preset(
        name, str(content.get("title", name)), declared, tuple(content.get("titles", ())),
        content.get("preamble", ""), content.get("file", ""), (only[0], only[1], only[2]) if only else None,
    )  # fmt: skip
