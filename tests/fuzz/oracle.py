"""What takes a stranger's bytes, with an honest example, and the one oracle over all of them.

Whatever comes in ends in `InputError`, in a refused heading with its reason, or in a valid one whose
numbers are finite.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from gyronorth.errors import InputError
from gyronorth.estimate import HeadingEstimate


@dataclass(frozen=True)
class Target:
    """One kind of input."""

    name: str
    kind: str  # json, text or binary
    make: Callable[[], bytes]  # the honest example
    take: Callable[[bytes], HeadingEstimate | None]

    @cached_property
    def honest(self) -> bytes:
        """Made when it is first asked for: what needs a large library is made last, after all that fork."""
        return self.make()


def judge(target: Target, content: bytes) -> str:
    """What became of an input: refused, invalid, valid or taken; anything else raises."""
    try:
        with np.errstate(all="ignore"):
            found = target.take(content)
    except InputError as error:
        if not str(error):
            raise AssertionError("an error without a message") from None
        return "refused"
    if found is None:
        return "taken"
    json.dumps(found.to_json(), allow_nan=False)
    if not found.valid:
        return "invalid"
    assert found.heading is not None
    assert found.sigma is not None
    assert np.isfinite([found.heading, found.sigma, *found.interval95]).all(), "valid, but not finite"
    assert found.sigma > 0, "valid, but sigma is not above 0"
    return "valid"


def of_file(
    folder: Path, name: str, use: Callable[[Path], HeadingEstimate | None]
) -> Callable[[bytes], HeadingEstimate | None]:
    """What takes a content as a file of that name."""
    path = folder / name

    def take(content: bytes) -> HeadingEstimate | None:
        path.write_bytes(content)
        return use(path)

    return take
