"""A hook of the documentation: commands are wrapped, and output that has lines of more than 110 characters.

Other blocks scroll, as tables must.
"""

from __future__ import annotations

import html
import re

BLOCK = re.compile(r'<div class="language-(console|sh|text) highlight">(.*?)</code>', re.DOTALL)
LONGEST = 110


def on_page_content(content: str, **_: object) -> str:
    """Mark every such block for the style sheet."""
    return BLOCK.sub(_marked, content)


def _marked(found: re.Match[str]) -> str:
    lines = html.unescape(re.sub(r"<[^>]*>", "", found[2])).splitlines()
    long = found[1] == "sh" or max(map(len, lines), default=0) > LONGEST
    return found[0].replace(" highlight", " highlight wrapped", 1) if long else found[0]
