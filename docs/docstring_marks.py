"""An extension of the API pages: marks of references in numpydoc, and the parameters of frozen classes.

Markdown does not know the marks: `[1]_` becomes [1], and `.. [1] A book` an item of a list. The pages show what a
dataclass takes, and a class that is `gyronorth.frozen.frozen` takes the same.
"""

from __future__ import annotations

import re
from typing import Any

from griffe import Class, ExprName, Extension, Object


class DocstringMarks(Extension):
    """Rewrites every docstring before it is parsed."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """The marks of one docstring."""
        if obj.docstring:
            text = re.sub(r"(\[\d+\])_(?!\w)", r"\1", obj.docstring.value)
            obj.docstring.value = re.sub(r"^( *)\.\. (\[\d+\]) ", r"\1- \2 ", text, flags=re.MULTILINE)

    def on_class_instance(self, *, cls: Class, **_: Any) -> None:
        """What decorates one class."""
        for decorator in cls.decorators:
            if str(decorator.value) == "frozen":
                decorator.value = ExprName("dataclasses.dataclass")
