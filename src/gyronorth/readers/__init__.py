"""Recordings in: one reader per format, one registry, units and axes declared at this edge.

What a file does not say and its format does not imply is declared in `ReadOptions`; nothing
is guessed. `read` gives a whole recording, `read_chunks` a stream of bounded memory,
`describe` a summary, `write` and `write_chunks` a file that reads back bit for bit.
"""

from __future__ import annotations

from gyronorth.readers.describing import Description, describe
from gyronorth.readers.formats.rosbag import is_bag_folder
from gyronorth.readers.options import ReadOptions, parse_columns
from gyronorth.readers.reading import RecordingInfo, read, read_chunks
from gyronorth.readers.registry import FORMATS, recordings_in
from gyronorth.readers.writing import write, write_chunks

__all__ = [
    "FORMATS",
    "Description",
    "ReadOptions",
    "RecordingInfo",
    "describe",
    "is_bag_folder",
    "parse_columns",
    "read",
    "read_chunks",
    "recordings_in",
    "write",
    "write_chunks",
]
