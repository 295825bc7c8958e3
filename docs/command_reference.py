"""A hook of the documentation: the command reference, from the program itself at build time.

Nothing is committed, so that it cannot go stale.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from enum import Enum
from typing import Any

from mkdocs.structure.files import File, Files

from gyronorth.cli.app import PANEL, commands
from gyronorth.cli.options import FILE
from gyronorth.cli.tasks import ABOUT

FOLDER = "reference/commands"
INTRODUCTION = """# Commands

`gyronorth COMMAND --help` prints what these pages say; they are made from the program itself.

Every command ends with exit code 0 when the work is done. It ends with 2 when something is wrong with the input or
the options: one message on standard error, nothing half-written. `heading` and `live` have one more:
[3, no valid heading](../guide/output.md#exit-codes).
"""
#: What stands behind an option without a panel of its own.
OTHERS = "Options"


def on_files(files: Files, config: Any) -> Files:
    """Add the pages to those of the site."""
    for name, text in pages().items():
        files.append(File.generated(config, name, content=text))
    return files


def pages() -> dict[str, str]:
    """File name -> Markdown: one page for each task, and one with the options that commands share."""
    found = commands()
    shared: dict[str, Any] = {}
    tasks: dict[str, list[str]] = {}
    rows = []
    for name in sorted(found, key=order):
        task = ABOUT[name][0]
        tasks.setdefault(task, []).extend(command(name, found[name], shared))
        about = " ".join(found[name].help.strip().partition("\n\n")[0].split()).rstrip(".")
        rows.append(f"| [`{name}`](commands/{slug(task)}.md#gyronorth-{name}) | {about} |")
    every = [option for option in found["heading"].params if getattr(option, "rich_help_panel", "") == PANEL]
    overview = [INTRODUCTION, "| command | what it does |\n|---|---|", *rows, "",
                f"## {PANEL}\n", "These belong to every command.\n", *table(PANEL, every),
                f"## {FILE}\n", "These belong to every command that reads recordings.\n",
                *table(FILE, list(shared.values()))]  # fmt: skip
    written = {f"{FOLDER}/{slug(task)}.md": "\n".join([f"# {task}\n", *lines]) for task, lines in tasks.items()}
    return {f"{FOLDER}.md": "\n".join(overview), **written}


def order(name: str) -> int:
    """Place of a command in the help."""
    return list(ABOUT).index(name)


def slug(title: str) -> str:
    """A title as it stands in an address."""
    return title.lower().replace(" ", "_")


def command(name: str, found: Any, shared: dict[str, Any]) -> Iterator[str]:
    """Heading, usage, description and options of one command; those about its file go to `shared`."""
    arguments = [parameter for parameter in found.params if parameter.param_type_name == "argument"]
    options = [parameter for parameter in found.params if parameter.param_type_name == "option"]
    required = [f"{switches(option)[-1]} {value(option)}" for option in options if option.required]
    words = ["gyronorth", name, *(argument.metavar or argument.name.upper() for argument in arguments), *required]
    yield f"## gyronorth {name}\n"
    yield "```text\n" + " ".join([*words, "[OPTIONS]"]) + "\n```\n"
    yield re.sub(r"(?<=\S)\n(?=\S)", " ", found.help.strip()) + "\n"
    _, examples = ABOUT[name]
    if examples:
        yield "```text\n" + "\n".join(examples) + "\n```\n"
    panels: dict[str, list[Any]] = {"Arguments": arguments} if arguments else {}
    for option in options:
        panels.setdefault(option.rich_help_panel or OTHERS, []).append(option)
    about_file = panels.pop(FILE, [])
    panels.pop(PANEL, None)
    shared.update({option.name: option for option in about_file})
    for panel, parameters in panels.items():
        yield from table(panel, parameters)
    if about_file:
        yield f"Also the options of [how the file is read](../commands.md#{FILE.lower().replace(' ', '-')}).\n"


def table(title: str, parameters: list[Any]) -> Iterator[str]:
    """One panel of options."""
    yield f"| {title} | value | meaning |\n|---|---|---|"
    for parameter in parameters:
        yield f"| {named(parameter)} | {cell(value(parameter))} | {meaning(parameter)} |"
    yield ""


def switches(option: Any) -> list[str]:
    """Short and long name of an option."""
    return sorted(option.opts, key=len)


def named(parameter: Any) -> str:
    """Name of an argument, or of an option with its short form."""
    if parameter.param_type_name == "argument":
        return cell(parameter.metavar or parameter.name.upper())
    return ", ".join(f"`{switch}`" for switch in switches(parameter))


def value(parameter: Any) -> str:
    """What is written behind an option; empty for a flag."""
    kind = parameter.type_descriptor.annotation
    if isinstance(kind, type) and issubclass(kind, Enum):
        return " | ".join(str(choice.value) for choice in kind)
    if parameter.param_type_name == "argument" or parameter.is_flag:
        return ""
    return " | ".join(parameter.metavar.split("|")) if parameter.metavar.islower() else parameter.metavar


def meaning(parameter: Any) -> str:
    """Help text, with what is required, repeatable or the default."""
    notes = []
    if parameter.required:
        notes.append("**Required.**")
    if parameter.min is not None:
        notes.append(f"At least {parameter.min:g}.")
    default = getattr(parameter.default, "value", parameter.default)
    if isinstance(default, str | int | float) and not isinstance(default, bool):
        notes.append(f"Default: `{default}`.")
    return " ".join([cell(parameter.help or "", code=False), *notes]).strip()


def cell(text: str, *, code: bool = True) -> str:
    """Text that may stand in a table; within code a bar divides no cells."""
    text = "<br>".join(" ".join(paragraph.split()) for paragraph in text.split("\n\n"))
    return f"`{text}`" if code and text else text.replace("|", "\\|")
