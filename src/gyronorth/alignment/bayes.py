"""The former place of `gyronorth.alignment.tones.search`; it goes with version 0.4."""

from __future__ import annotations

import warnings
from typing import Any

from gyronorth.alignment.tones import search


def __getattr__(name: str) -> Any:
    warnings.warn(
        "gyronorth.alignment.bayes is now gyronorth.alignment.tones.search; the old name goes with version 0.4.",
        DeprecationWarning,
        stacklevel=2,
    )
    return getattr(search, name)
