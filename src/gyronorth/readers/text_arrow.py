"""Rows of text by pyarrow, several times as fast as by numpy; both round numbers correctly, so bits are equal.

It takes only what is plain beyond doubt. A block with anything else in it is left to the own parser, which knows more
spellings and says which row is bad and why.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Bytes of text from which pyarrow is faster: where it is loaded, and where it must be loaded first.
WORTHWHILE, WORTH_LOADING = 1 << 14, 1 << 21
#: Bytes in a block for which the two parsers may differ: quotes, lone carriage returns, zeros and "nan(...)".
_UNLIKE = (b'"', b"\r", b"\x00", b"(")


def is_worthwhile(size: int) -> bool:
    """Whether pyarrow is loaded and faster for so many bytes."""
    return size >= WORTHWHILE and "pyarrow.csv" in sys.modules


def load_for(size: int) -> None:
    """Load pyarrow where it is there, and worth its loading for a text of so many bytes."""
    if size >= WORTH_LOADING and find_spec("pyarrow") is not None:
        import_module("pyarrow.csv")


def arrow_columns(
    data: bytes, delimiter: str | None, width: int, numbers: Sequence[int], texts: Sequence[int]
) -> tuple[NDArray[np.float64], list[list[str]]] | None:
    """Fields of regular rows by position, or None where any of them is not plain.

    Parameters
    ----------
    data : bytes
        Whole lines that end in LF.
    delimiter : str or None
        One ASCII character; None: any white space.
    width : int
        Fields of a row.
    numbers, texts : sequence of int
        Positions of the fields that are read as numbers, and as texts.

    Returns
    -------
    values : ndarray, shape (n, len(numbers))
    columns : list of list of str
        For each of `texts`.
    """
    if any(symbol in data for symbol in _UNLIKE) or not (data.isascii() or _is_text(data)):
        return None
    if delimiter is None:
        data, delimiter = _single_blanks(data), " "
    from pyarrow import ArrowInvalid, csv, float64, py_buffer, string

    names = [str(position) for position in range(width)]
    types: dict[str, Any] = {names[position]: string() for position in texts}
    types |= {names[position]: float64() for position in numbers}
    if len(types) < len(set(numbers)) + len(texts):  # a field that is read both ways
        return None
    try:
        table = csv.read_csv(
            py_buffer(data),
            csv.ReadOptions(use_threads=False, block_size=len(data) + 1, column_names=names),
            csv.ParseOptions(delimiter=delimiter, quote_char=False, ignore_empty_lines=False),
            csv.ConvertOptions(column_types=types, include_columns=list(types), null_values=[], check_utf8=False),
        )
    except ArrowInvalid:
        return None
    values = np.empty((table.num_rows, len(numbers)))
    for k, position in enumerate(numbers):
        start = 0
        for chunk in table[names[position]].chunks:
            values[start : start + len(chunk), k] = np.from_dlpack(chunk)  # `to_numpy` loads pandas
            start += len(chunk)
    return values, [table[names[position]].to_pylist() for position in texts]


def _is_text(data: bytes) -> bool:
    """Whether it is UTF-8, and begins with no byte order mark, which pyarrow would leave out."""
    if data.startswith(b"\xef\xbb\xbf"):
        return False
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True


def _single_blanks(data: bytes) -> bytes:
    """Lines whose fields stand one blank apart, from those with any number of blanks and tabs."""
    data = data.replace(b"\t", b" ")
    while b"  " in data:
        data = data.replace(b"  ", b" ")
    return data.replace(b" \n", b"\n").replace(b"\n ", b"\n").removeprefix(b" ")
