"""A hook of the documentation: an SVG of `docs/images/` is set into its page, beside its narrow version for phones.

Its colours are CSS variables (`docs/make_pictures.py`), which an `<img>` would not see.
The style sheet shows one of the two. A figure of the results keeps a readable size: a phone scrolls it in its box, and
its link opens it alone.
"""

from __future__ import annotations

import re
from pathlib import Path

IMAGES = Path(__file__).parent / "images"
IMAGE = re.compile(r'<p><img alt="([^"]*)" src="[^"]*images/(\w+)\.svg" ?/?></p>')
FIGURE = re.compile(r'(<p>)(<img alt="[^"]*" src="([\w./-]+\.png)[#\w-]*" ?/?>)(</p>)')


def on_page_content(content: str, **_: object) -> str:
    """Replace every SVG that stands alone in a paragraph, and link every figure to its file."""
    return FIGURE.sub(r'<p class="figure"><a href="\3">\2</a>\4', IMAGE.sub(_set_in, content))


def _set_in(found: re.Match[str]) -> str:
    alt, name = found.groups()
    if not (IMAGES / f"{name}.svg").is_file():  # of another folder
        return found[0]
    label = f'<svg role="img" aria-label="{alt}" '
    both = (
        (IMAGES / f"{file}.svg").read_text().replace("<svg ", f'{label}class="{kind}" ', 1)
        for file, kind in ((name, "wide"), (f"{name}_narrow", "narrow"))
    )
    return f'<figure class="picture">{"".join(both)}</figure>'
