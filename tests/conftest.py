"""Fixtures that several test modules use."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of recorded data: GYRONORTH_REAL_DATA, or ../shared/data beside the project."""
    folder = Path(os.environ.get("GYRONORTH_REAL_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no recorded data: {folder} is not a folder (set GYRONORTH_REAL_DATA)")
    return folder
