"""An extension of the API pages: the marks of references in numpydoc, which Markdown does not know.

`[1]_` becomes [1], and `.. [1] A book` an item of a list.
"""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension, Object


class DocstringMarks(Extension):
    """Rewrites every docstring before it is parsed."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """The marks of one docstring."""
        if obj.docstring:
            text = re.sub(r"(\[\d+\])_(?!\w)", r"\1", obj.docstring.value)
            obj.docstring.value = re.sub(r"^( *)\.\. (\[\d+\]) ", r"\1- \2 ", text, flags=re.MULTILINE)
