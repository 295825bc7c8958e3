"""The one error that bad input from a user raises."""

from __future__ import annotations

from collections.abc import Iterable


class InputError(ValueError):
    """Bad input from the user: one clear message, exit code 2.

    The message says what came in, what was expected, the likely cause and the cure.
    """


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Text " Did you mean 'sdc500'?" where one of the names is close to what was given, else nothing."""
    from difflib import get_close_matches

    close = get_close_matches(name.lower(), names, n=1, cutoff=0.6)
    return f" Did you mean {close[0]!r}?" if close else ""
