"""A hook of the documentation: commands and their messages are wrapped where the page ends.

Other blocks scroll: code, whose indentation counts, and rows of tables.
"""

from __future__ import annotations

import html
import re

BLOCK = re.compile(r'<div class="language-(console|sh|text) highlight">(.*?)</code>', re.DOTALL)
#: Two gaps or more between words make a row of a table; a label before its text has one.
ROW = re.compile(r"\S {2,}\S.*\S {2,}\S")


def on_page_content(content: str, **_: object) -> str:
    """Mark every such block for the style sheet."""
    return BLOCK.sub(_marked, content)


def _marked(found: re.Match[str]) -> str:
    lines = html.unescape(re.sub(r"<[^>]*>", "", found[2])).splitlines()
    scrolls = any(line.startswith(" ") or ROW.search(line) for line in lines)
    return found[0] if scrolls else found[0].replace(" highlight", " highlight wrapped", 1)
