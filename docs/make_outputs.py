"""What the commands of the pages print: run them, write their answers into the pages.

python docs/make_outputs.py     rewrite the pages

Blocks of a page are taken in order, in one empty folder. A `console` block holds commands behind `$ ` and,
below each, what it prints. A `json` block below a comment `<!-- gyronorth ... --json -->` is what that command
prints, one field a line, numbers with five figures. A block below `<!-- file: NAME -->` is written to that file.
`tests/test_docs.py` runs the same and compares.
"""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^(?:<!-- (gyronorth .*|file: .*) -->\n)?```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
#: Development commands, which do not run from inside themselves.
SKIPPED = ("make ", "git ", "cd ", "pip ", "python", "bash ", ". ")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    language: str
    text: str
    comment: str | None  # above the block: a command, or "file: NAME"
    start: int  # of `text` in the page
    end: int


def pages() -> list[Path]:
    """README and every page of the site that is written by hand."""
    written = (page for page in sorted((ROOT / "docs").rglob("*.md")) if "results" not in page.parts)
    return [ROOT / "README.md", *written]


def blocks(text: str) -> list[Block]:
    """The fenced blocks of a page, in order."""
    return [Block(found[2], found[3], found[1], found.start(3), found.end(3)) for found in BLOCK.finditer(text)]


def commands(block: Block) -> list[str]:
    """The commands of a block that run here."""
    if block.comment:
        return [] if block.comment.startswith("file: ") else [block.comment]
    text = block.text.replace("\\\n", " ")
    if block.language == "console":
        lines = [line[2:] for line in text.splitlines() if line.startswith("$ ")]
    else:
        lines = [line.partition(" #")[0].strip() for line in text.splitlines()] if block.language == "sh" else []
    return [line for line in lines if line and not line.startswith(SKIPPED)]


def run(command: str) -> tuple[int, str]:
    """Exit code and output of a `gyronorth` command, in this process; ` | head -N` and `tail` are understood."""
    from gyronorth.cli import main

    call, _, cut = command.partition(" | ")
    program, *arguments = shlex.split(call)
    found = re.fullmatch(r"(head|tail) -(\d+)|", cut)
    if program != "gyronorth" or not found:
        raise ValueError(f"{command!r} is no gyronorth command")
    output, before, code = io.StringIO(), sys.argv, 0
    sys.argv = [program, *arguments]
    try:
        with redirect_stdout(output), redirect_stderr(output):
            main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    finally:
        sys.argv = before
    lines = output.getvalue().replace("\r\n", "\n").splitlines(keepends=True)  # NMEA ends its lines with both
    part = {"head": slice(int(found[2])), "tail": slice(-int(found[2]), None)}[found[1]] if cut else slice(None)
    return code, "".join(lines[part])


def work(block: Block) -> list[tuple[int, str]]:
    """Do what a block says, in the current folder; exit code and output of each of its commands."""
    if block.comment and block.comment.startswith("file: "):
        Path(block.comment.removeprefix("file: ")).write_text(block.text)
    if block.language == "python":
        with redirect_stdout(io.StringIO()):
            exec(compile(block.text, "a page", "exec"), {"__name__": "__main__"})
    return [run(command) for command in commands(block)]


def answered(block: Block, answers: Iterator[str]) -> str:
    """The block's text with the answers of its commands."""
    if block.language == "json" and commands(block):
        return one_field_a_line(json.loads(next(answers)))
    if block.language == "console":
        asked = re.findall(r"^\$ (?:.*\\\n)*.*\n", block.text, re.MULTILINE)
        return "\n".join(line + next(answers) for line in asked)
    return block.text


def one_field_a_line(document: dict[str, Any]) -> str:
    """A JSON object for readers."""
    lines = (f"  {json.dumps(name)}: {json.dumps(rounded(value))}" for name, value in document.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def rounded(value: Any) -> Any:
    """Numbers with five significant figures."""
    if isinstance(value, dict):
        return {name: rounded(each) for name, each in value.items()}
    if isinstance(value, list):
        return [rounded(each) for each in value]
    return float(f"{value:.5g}") if isinstance(value, float) else value


def rewritten(text: str) -> str:
    """A page with the answers of its commands, which run in a folder of their own."""
    new, behind = "", 0
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        Path("examples").symlink_to(ROOT / "examples")
        Path("out").mkdir()
        for block in blocks(text):
            answers = iter([answer for _, answer in work(block)])
            new += text[behind : block.start] + answered(block, answers)
            behind = block.end
    return new + text[behind:]


def main() -> None:
    """Rewrite every page that holds an answer."""
    os.environ.update(COLUMNS="100", NO_COLOR="1", TERM="dumb", MPLBACKEND="agg")
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for page in pages():
        text = page.read_text()
        new = rewritten(text)
        if new != text:
            page.write_text(new)
            print(page.relative_to(ROOT))


if __name__ == "__main__":
    main()
