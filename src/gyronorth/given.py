"""What a caller gives, checked in one way everywhere: a number, a latitude, an array, an object of a kind."""

from __future__ import annotations

import math
import os
from numbers import Real
from pathlib import Path
from types import UnionType
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.errors import InputError

#: What Python and numpy count among the numbers.
NO_NUMBERS = (bool, np.bool_, np.timedelta64)
#: What is to be above 0 is at least this: one over it is a number too.
SMALLEST = 1e-300


def number(what: str, value: Any) -> float:
    """A real number, alone or as an array without dimensions; NaN and infinity are left to the caller.

    Raises
    ------
    InputError
        If it is anything else: a text, true or false, a complex number, a time, several numbers, a masked one, more
        than a double holds.

    Examples
    --------
    >>> number("The rate", 10)
    10.0
    """
    single = value
    if isinstance(value, np.generic | np.ndarray):
        array = cast("NDArray[Any]", value)
        single = array.item() if array.ndim == 0 and array.dtype.kind in "fiuO" and not _masked(array) else None
    elif getattr(value, "ndim", None) == 0 and hasattr(value, "item"):  # of another library
        single = value.item()
    if not isinstance(single, NO_NUMBERS) and isinstance(single, Real):
        try:
            return float(single)
        except OverflowError:
            raise InputError(f"{what} is beyond 1.8e308; a number is expected.") from None
    raise InputError(f"{what} is {value!r:.80}; a number is expected.")


def finite(what: str, value: Any, unit: str, *, positive: bool = False) -> float:
    """A finite number, above 0 where it is to be `positive`; `unit` is for the message."""
    found = number(what, value)
    if not math.isfinite(found) or (positive and found < SMALLEST):
        raise InputError(f"{what} is {found:g} {unit}; a {'positive' if positive else 'finite'} number is expected.")
    return found


def checked_latitude(value: Any) -> float:
    """A geodetic latitude, rad."""
    found = number("The latitude", value)
    if not abs(found) <= math.pi / 2:
        raise InputError(
            f"The latitude is {found:g} rad, {found * (180 / math.pi):g} deg; a value in [-90, 90] deg, given in rad, "
            "is expected."
        )
    return found


def numbers(what: str, value: ArrayLike, shape: str) -> NDArray[np.float64]:
    """Real numbers of any type as doubles.

    Parameters
    ----------
    what, shape : str
        What they are, and the shape that is expected, for messages.
    value : array_like
        The numbers; their shape is left to the caller.

    Raises
    ------
    InputError
        If they are none: texts, times, true and false, complex numbers; or some are masked, in a list too.
    """
    try:
        masked = _masked(value)
        if masked:
            raise InputError(f"{what} has {masked} masked values; numbers are expected. Leave that part out.")
        found = np.asarray(value)
        if found.dtype.kind not in "fiuO":
            raise TypeError
        if found.dtype.kind == "O" and not all(
            isinstance(each, Real) and not isinstance(each, NO_NUMBERS) for each in found.ravel()
        ):
            raise TypeError
        return found.astype(np.float64, copy=False)
    except InputError:
        raise
    except (TypeError, ValueError, OverflowError, RuntimeError):  # RuntimeError: a tensor that keeps its gradient
        raise InputError(f"{what} is not an array of numbers; real ones of shape {shape} are expected.") from None


def _masked(value: Any) -> int:
    """How many values are masked, of an array or of those that a list holds; TypeError if one is no number."""
    if isinstance(value, list | tuple):
        return sum(_masked(each) for each in cast("list[Any]", value) if type(each) not in (float, int))
    if isinstance(value, NO_NUMBERS):
        raise TypeError
    mask = getattr(value, "mask", None)
    return int(mask.sum()) if isinstance(mask, np.ndarray | np.bool_) else 0


def of_kind(what: str, value: Any, kind: type | UnionType | tuple[type, ...], expected: str) -> None:
    """Refuse an object of another kind.

    Raises
    ------
    InputError
        If it is none.
    """
    if not isinstance(value, kind):
        raise InputError(f"{what} is {value!r:.80}; {expected} is expected.")


def checked_path(what: str, value: Any) -> Path:
    """A path that is given as a text or a path."""
    of_kind(what, value, (str, os.PathLike), "a path")
    path = os.fspath(value)
    if not isinstance(path, str) or "\0" in path:
        raise InputError(f"{what} is {path!r:.80}; a path is expected.")
    return Path(path)
