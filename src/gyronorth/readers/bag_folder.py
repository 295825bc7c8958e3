"""What tells a folder that is a recording; apart from the formats, which take longer to load."""

from __future__ import annotations

from pathlib import Path

METADATA = "metadata.yaml"
#: What a folder `oxts` of KITTI holds.
OXTS = ("dataformat.txt", "timestamps.txt", "data")


def is_bag_folder(path: Path) -> bool:
    """Whether a folder is a bag of ROS 2, one recording."""
    return (path / METADATA).is_file()


def is_oxts_folder(path: Path) -> bool:
    """Whether a folder is a recording of KITTI's raw data."""
    return all((path / part).exists() for part in OXTS)


def is_recording_folder(path: Path) -> bool:
    """Whether a folder is one recording."""
    return is_bag_folder(path) or is_oxts_folder(path)
