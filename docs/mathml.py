"""A hook of the documentation: equations become MathML at build time.

The pages then need no script and no network to show them. latex2mathml is a pure Python
package of 0.3 MB; MathJax or KaTeX would have to be fetched by the reader or vendored.
"""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert

# What pymdownx.arithmatex leaves in generic mode: \( ... \) in a span, \[ ... \] in a div.
EQUATION = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(content: str, **_: object) -> str:
    """Replace every equation of a page's HTML."""
    return EQUATION.sub(_converted, content)


def _converted(found: re.Match[str]) -> str:
    # A bar without \left or \right would be neither an opening nor a closing one.
    latex = re.sub(r"(?<!\\left)\\lvert", r"\\left\\lvert", html.unescape(found[2]))
    latex = re.sub(r"(?<!\\right)\\rvert", r"\\right\\rvert", latex)
    made = convert(latex, display="block" if found[1] == "div" else "inline")
    unknown = re.search(r">(\\\w+)<", made)
    if unknown:  # latex2mathml passes on what it does not know
        raise ValueError(f"{unknown[1]} is unknown to latex2mathml, in {found[2]}")
    return made
