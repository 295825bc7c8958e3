"""A hook of the documentation: blocks with messages or commands of more than 110 characters are wrapped.

Others scroll, as tables must.
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
    if max(map(len, lines), default=0) <= LONGEST:
        return found[0]
    return found[0].replace(" highlight", " highlight wrapped", 1)
