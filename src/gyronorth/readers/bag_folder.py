"""What tells a folder that is a recording of ROS 2; apart from the format, which takes longer to load."""

from __future__ import annotations

from pathlib import Path

METADATA = "metadata.yaml"


def is_bag_folder(path: Path) -> bool:
    """Whether a folder is a bag of ROS 2, one recording."""
    return (path / METADATA).is_file()
