"""The former place of `gyronorth.alignment.networks.runtime`; it goes with version 0.4."""

from __future__ import annotations

import warnings
from typing import Any

from gyronorth.alignment.networks import runtime


def __getattr__(name: str) -> Any:
    warnings.warn(
        "gyronorth.alignment.learned is now gyronorth.alignment.networks.runtime; the old name goes with version 0.4.",
        DeprecationWarning,
        stacklevel=2,
    )
    return getattr(runtime, name)
