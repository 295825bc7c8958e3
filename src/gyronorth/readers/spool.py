"""Files that are not there as they are read: packed ones, members of archives, pipes and standard input.

Their content goes into a file of its own in a private folder, with a bound on its size, and is gone with the object
that holds it.
"""

from __future__ import annotations

import shutil
import sys
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from gyronorth.errors import InputError
from gyronorth.files import temporary_files_told
from gyronorth.readers.library import errors_translated, library

#: Most bytes of one file, and how many times larger than the packed one it may be from `FREE` bytes on. Recordings
#: pack into a tenth; what packs into a five-hundredth is made to fill disks, or holds no noise.
MOST, RATIO, FREE = 1 << 34, 500, 1 << 26
#: Bytes on the disk that are left alone.
RESERVE = 1 << 28
_PIECE = 1 << 20
#: In place of a file's name.
STANDARD_INPUT = "-"
#: How packed files begin, their suffix, and what unpacks them by hand.
PACKED = {
    b"\x1f\x8b": (".gz", "gunzip"),
    b"\x28\xb5\x2f\xfd": (".zst", "unzstd"),
    b"\xfd7zXZ\x00": (".xz", "unxz"),
    b"BZh": (".bz2", "bunzip2"),
}
#: How zip archives begin, which may hold several files (`archive`).
ZIP = b"PK\x03\x04"
#: Other suffixes of theirs.
SUFFIXES = (".gz", ".gzip", ".zst", ".zstd", ".xz", ".bz2")


class Spooled:
    """A file in a private folder, which goes when this object does."""

    def __init__(self, name: str) -> None:
        import tempfile

        with temporary_files_told():
            folder = tempfile.mkdtemp(prefix="gyronorth-")
        self.folder = Path(folder)
        self.path = self.folder / (Path(name).name or "stream")
        self._discard = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)

    def fill(self, read: Callable[[int], bytes], *, most: int, too_large: str, path: Path | None = None) -> None:
        """Write what `read` gives into the file, or another one of the folder.

        Raises
        ------
        InputError
            If it is more than `most` bytes, with `too_large`, or more than the disk has left.
        """
        try:
            self._fill(read, most, too_large, path or self.path)
        except BaseException:
            self._discard()  # whoever holds the exception holds this object too
            raise

    def _fill(self, read: Callable[[int], bytes], most: int, too_large: str, path: Path) -> None:
        total = 0
        with temporary_files_told():
            file = path.open("wb", buffering=0)
        with file:
            while piece := read(_PIECE):
                total += len(piece)
                if total > most:
                    raise InputError(too_large)
                if total > FREE and shutil.disk_usage(self.folder).free < RESERVE:
                    raise InputError(
                        f"{path.name} does not fit on the disk: {total >> 20} MiB of it filled {self.folder.parent}. "
                        "Free some space there, or set TMPDIR to a folder on another disk."
                    )
                with temporary_files_told():
                    while piece:
                        piece = piece[file.write(piece) :]


def packed_as(head: bytes) -> str | None:
    """The usual suffix of a packed file that begins so; None for another."""
    return next((suffix for lead, (suffix, _) in PACKED.items() if head.startswith(lead)), None)


def unpacked(path: Path, suffix: str) -> Spooled:
    """The content of a packed file.

    Raises
    ------
    InputError
        If it is damaged, cut off or larger than is plausible.
    """
    size = path.stat().st_size
    tool = next(tool for each, tool in PACKED.values() if each == suffix)
    spooled = Spooled(path.stem if path.suffix.lower() in SUFFIXES else path.name)
    with errors_translated(path.name, f"{suffix} file"), _opened(path, suffix) as file:
        spooled.fill(
            file.read,
            most=most_of(size),
            too_large=f"{path.name} unpacks into more than {most_of(size) >> 20} MiB, which no recording of its size "
            f"does. If it is one: unpack it first, {tool} {path.name}.",
        )
    if not spooled.path.stat().st_size:
        raise InputError(f"{path.name} is empty once it is unpacked.")
    return spooled


def most_of(size: int) -> int:
    """Most bytes that a packed file of `size` bytes may unpack into."""
    return min(MOST, max(FREE, RATIO * size))


def piped(path: Path) -> Spooled:
    """The content of a pipe, or of standard input, to its end.

    Raises
    ------
    InputError
        If it is empty or does not end, or if nothing is piped into standard input.
    """
    if str(path) != STANDARD_INPUT:
        if path.is_char_device():
            raise InputError(
                f"{path} is a device; a file, a pipe or - for standard input is expected. For a unit on a serial port: "
                f"gyronorth live serial:{path}."
            )
        with path.open("rb") as stream:
            return _drained(stream, path.name)
    if sys.stdin.isatty():
        raise InputError(
            "Standard input is a terminal; a recording is expected in it, as in: zcat rec.csv.gz | gyronorth heading -."
        )
    return _drained(sys.stdin.buffer, "standard input")


def _drained(stream: IO[bytes], name: str) -> Spooled:
    spooled = Spooled(name)
    spooled.fill(
        stream.read,
        most=MOST,
        too_large=f"{name} gave more than {MOST >> 30} GiB; a recording that ends is expected. For a stream: gyronorth "
        "live.",
    )
    if not spooled.path.stat().st_size:
        raise InputError(f"{name} gave nothing; a recording is expected.")
    return spooled


def is_stream(path: Path) -> bool:
    """Whether it is standard input or a pipe, which can be read once."""
    return str(path) == STANDARD_INPUT or (path.exists() and not path.is_file() and not path.is_dir())


def _opened(path: Path, suffix: str) -> Any:
    if suffix == ".gz":
        import gzip

        return gzip.open(path, "rb")
    if suffix == ".xz":
        import lzma

        return lzma.open(path, "rb")
    if suffix == ".bz2":
        import bz2

        return bz2.open(path, "rb")
    zstandard = library("zstandard", path.name, "Zstandard")
    return zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(
        path.open("rb"), read_across_frames=True, closefd=True
    )
