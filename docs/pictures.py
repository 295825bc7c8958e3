"""A hook of the documentation: an SVG of `docs/images/` is set into its page.

Its colours are CSS variables (`docs/make_pictures.py`), which an `<img>` would not see.
"""

from __future__ import annotations

import re
from pathlib import Path

IMAGES = Path(__file__).parent / "images"
IMAGE = re.compile(r'<p><img alt="([^"]*)" src="[^"]*images/(\w+)\.svg" ?/?></p>')


def on_page_content(content: str, **_: object) -> str:
    """Replace every SVG that stands alone in a paragraph."""
    return IMAGE.sub(_set_in, content)


def _set_in(found: re.Match[str]) -> str:
    alt, name = found.groups()
    path = IMAGES / f"{name}.svg"
    if not path.is_file():  # of another folder
        return found[0]
    svg = path.read_text()
    svg = svg.replace("<svg ", f'<svg role="img" aria-label="{alt}" ', 1)
    return f'<figure class="picture">{svg}</figure>'
