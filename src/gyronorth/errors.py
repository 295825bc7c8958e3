"""The error that bad input from a user raises, what tells the lack of memory, and texts as a terminal may show them."""

from __future__ import annotations

import re
from collections.abc import Iterable


class InputError(ValueError):
    """Bad input from the user: one clear message, exit code 2.

    The message says what came in, what was expected, the likely cause and the cure.
    """


#: Control characters but the line feed, and those that turn the direction of a text.
_STEERING = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
#: Bytes without which a library can hardly be loaded.
_ROOM = 1 << 26


def is_of_memory(error: Exception) -> bool:
    """Whether an error says that memory is short; where it is, libraries in C raise whatever they like."""
    if isinstance(error, MemoryError | InputError | OSError):
        return isinstance(error, MemoryError)
    try:
        bytearray(_ROOM)
    except MemoryError:
        return True
    return False


def printable(text: str) -> str:
    """A text from outside, for a terminal: what would steer it (escape sequences, text from right to left) is shown."""
    return _STEERING.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def one_line(text: str) -> str:
    """A name from outside, for a terminal, in one line whatever is in it."""
    return printable(text).replace("\n", "\\n")


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Text " Did you mean 'sdc500'?" where one of the names is close to what was given, else nothing."""
    from difflib import get_close_matches

    close = get_close_matches(name.lower(), names, n=1, cutoff=0.6)
    return f" Did you mean {close[0]!r}?" if close else ""
