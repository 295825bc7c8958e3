"""The former place of `gyronorth.published`; it goes with version 0.4."""

from __future__ import annotations

import warnings
from typing import Any

from gyronorth import published


def __getattr__(name: str) -> Any:
    warnings.warn(
        "gyronorth.twin is now gyronorth.published; the old name goes with version 0.4.",
        DeprecationWarning,
        stacklevel=2,
    )
    return getattr(published, name)
