"""The former place of `gyronorth.alignment.networks.bundle`; it goes with version 0.4."""

from __future__ import annotations

import warnings
from typing import Any

from gyronorth.alignment.networks import bundle


def __getattr__(name: str) -> Any:
    warnings.warn(
        "gyronorth.alignment.bundle is now gyronorth.alignment.networks.bundle; the old name goes with version 0.4.",
        DeprecationWarning,
        stacklevel=2,
    )
    return getattr(bundle, name)
