"""An extension of the API pages: marks of numpydoc that Markdown and the parser do not know, and frozen classes.

`[1]_` becomes [1], `.. [1] A book` an item of a list, and `::` before code a colon. Parameters on one line without a
type get a line each, so that each shows a type of its own. A class that is `gyronorth.frozen.frozen` takes what a
dataclass takes.
"""

from __future__ import annotations

import re
from typing import Any

from griffe import Class, ExprName, Extension, Object

#: Names on one line without a type, and the indented lines that explain them.
SHARED = re.compile(r"^( *)(\*{0,2}\w+(?:, \*{0,2}\w+)+)\n((?:\1 +\S.*\n?)+)", re.MULTILINE)


class DocstringMarks(Extension):
    """Rewrites every docstring before it is parsed."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """The marks of one docstring."""
        if obj.docstring:
            text = re.sub(r"(\[\d+\])_(?!\w)", r"\1", obj.docstring.value)
            text = re.sub(r"^( *)\.\. (\[\d+\]) ", r"\1- \2 ", text, flags=re.MULTILINE)
            text = re.sub(r"::\n\n(?= +\S)", ":\n\n", text)
            obj.docstring.value = SHARED.sub(_apart, text)

    def on_class_instance(self, *, cls: Class, **_: Any) -> None:
        """What decorates one class."""
        for decorator in cls.decorators:
            if str(decorator.value) == "frozen":
                decorator.value = ExprName("dataclasses.dataclass")


def _apart(found: re.Match[str]) -> str:
    """Each of several parameters with the explanation that they share."""
    indent, names, explained = found.groups()
    explained = explained.rstrip("\n")
    return "\n".join(f"{indent}{name}\n{explained}" for name in names.split(", ")) + "\n" * found[0].endswith("\n")
