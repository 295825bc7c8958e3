"""A hook of the documentation: where lines may end.

Commands and their messages are wrapped at the end of the page; other blocks scroll: code, whose indentation counts, and
rows of tables. An option is never broken, nor a number from its percent sign; a long name is, behind `_`, `.` and `(`,
and a choice behind its bars.
"""

from __future__ import annotations

import html
import re

BLOCK = re.compile(r'<div class="language-(console|sh|text) highlight">(.*?)</code>', re.DOTALL)
#: Two gaps or more between words make a row of a table; a label before its text has one.
ROW = re.compile(r"\S {2,}\S.*\S {2,}\S")


CODE = re.compile(r"(<code\b.*?</code>)", re.DOTALL)
TAG = re.compile(r"(<[^>]*>)")
OPTION = re.compile(r"(?<![\w-])--[a-z][\w-]*")
LONG_NAME = re.compile(r"[\w.(]{28,}")
#: A bar between choices, as in tcp|udp.
CHOICE = re.compile(r"(?<=\w)\|(?=\w)")


def on_page_content(content: str, **_: object) -> str:
    """Mark every such block, option and name for the style sheet."""
    pieces = CODE.split(BLOCK.sub(_marked, content))
    return "".join((_code if number % 2 else _text)(piece) for number, piece in enumerate(pieces))


def _marked(found: re.Match[str]) -> str:
    lines = html.unescape(re.sub(r"<[^>]*>", "", found[2])).splitlines()
    scrolls = any(line.startswith(" ") or ROW.search(line) for line in lines)
    return found[0] if scrolls else found[0].replace(" highlight", " highlight wrapped", 1)


def _code(piece: str) -> str:
    """A piece of code, whose options stay whole and whose long names may be broken."""
    texts = TAG.split(piece)
    for number in range(0, len(texts), 2):
        whole = OPTION.sub(r'<span class="option">\g<0></span>', texts[number])
        texts[number] = CHOICE.sub(r"|<wbr>", _breakable(whole))
    return "".join(texts)


def _text(piece: str) -> str:
    """Text in which a number keeps its percent sign, and the names of modules in headings may be broken."""
    texts = TAG.split(piece)
    texts[::2] = [_breakable(re.sub(r"(?<=\d) %", "\N{NO-BREAK SPACE}%", text)) for text in texts[::2]]
    return "".join(texts)


def _breakable(text: str) -> str:
    """Text whose long names may be broken."""
    return LONG_NAME.sub(lambda name: re.sub(r"[_.(]", r"\g<0><wbr>", name[0]), text)
