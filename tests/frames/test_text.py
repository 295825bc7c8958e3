"""Numbers of lines are those that `float` reads."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyronorth.frames.protocols.text import columns_from_end

#: As units write them, and as no unit does.
NUMBER = st.one_of(
    st.floats(-1e6, 1e6).map(lambda value: f"{value:+.9f}"),
    st.integers(-(10**12), 10**12).map(str),
    st.floats(allow_nan=False).map(repr),
    st.text("0123456789.+-eE x", max_size=20),
)


def expected(text: str) -> float:
    try:
        return float(text.encode())
    except ValueError:
        return np.nan


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.lists(st.lists(NUMBER, min_size=4, max_size=4), min_size=1, max_size=6))
def test_numbers_are_those_of_float(table):
    lines = [f"#NAME,{','.join(fields)}*A5" for fields in table]
    width = max(map(len, lines))
    rows = np.frombuffer("".join(line.rjust(width, ",") for line in lines).encode(), np.uint8).reshape(-1, width)
    found = columns_from_end(rows, -3, (-4, -2, -1))
    sought = np.array([[expected(fields[i]) for i in (0, 2, 3)] for fields in table])
    assert np.array_equal(found, sought, equal_nan=True)
