"""The one error that bad input from a user raises."""

from __future__ import annotations


class InputError(ValueError):
    """Bad input from the user: one clear message, exit code 2.

    The message says what came in, what was expected, the likely cause and the cure.
    """
