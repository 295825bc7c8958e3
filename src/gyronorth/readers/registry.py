"""Which reader opens which file.

What only some files need (archives, rows that are no table, two files as one) is loaded when such a file comes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from gyronorth import catalogue
from gyronorth.catalogue import FormatInfo
from gyronorth.errors import InputError, did_you_mean
from gyronorth.readers.bag_folder import METADATA, is_bag_folder, is_oxts_folder, is_recording_folder
from gyronorth.readers.budget import counted, open_apart, size_of
from gyronorth.readers.format import LOOK, Format
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.plain_table import is_plain_table
from gyronorth.readers.source import Source
from gyronorth.readers.spool import ZIP, Spooled, is_stream, packed_as, piped, unpacked

if TYPE_CHECKING:
    from gyronorth.readers.outgoing import RecordingStream

#: Entry points of installed packages that name a format of their own.
ENTRY_POINTS = "gyronorth.formats"


class _Formats(Mapping[str, Format]):
    """Every known format, imported when it is first asked for."""

    def __init__(self) -> None:
        self._rows = {info.name: info for info in catalogue.FORMATS}
        self._loaded: dict[str, Format] = {}

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, name: str) -> Format:
        if name not in self._rows:
            from importlib.metadata import entry_points  # slow to load

            for entry in entry_points(group=ENTRY_POINTS, name=name):
                self.add(entry.load())
        if name not in self._loaded:
            module = import_module(self._rows[name].module)
            self._loaded[name] = module.FORMATS[name] if hasattr(module, "FORMATS") else module.FORMAT
        return self._loaded[name]

    @property
    def suffixes(self) -> dict[str, str]:
        """Suffix -> name of the format that it says; .txt and others are looked into."""
        return {suffix: info.name for info in self._rows.values() for suffix in info.suffixes}

    @property
    def written(self) -> dict[str, str]:
        """Suffix -> name of the format in which a recording is written under it."""
        return {suffix: info.name for info in self._rows.values() for suffix in info.written}

    def info(self, name: str) -> FormatInfo:
        """The row of a format, without importing it."""
        return self._rows[name]

    def add(self, added: Format) -> None:
        """Register a format; see `register`."""
        self._rows[added.info.name] = added.info
        self._loaded[added.info.name] = added


#: Every format by name.
FORMATS = _Formats()


def register(added: Format) -> None:
    """Add a format from outside the package, or replace one.

    Parameters
    ----------
    added : Format
        Its row, and what recognises, opens and writes it. An installed package can name it as an entry point of the
        group `ENTRY_POINTS` instead; it is then found by `format` alone.
    """
    FORMATS.add(added)


def writer_of(suffix: str) -> Callable[[RecordingStream, Path], None] | None:
    """What writes a recording under a suffix; None where nothing does."""
    name = FORMATS.written.get(suffix)
    return None if name is None else FORMATS[name].write


#: Suffixes of pickled objects of Python, and the protocols in their second byte.
PICKLES, PICKLE_PROTOCOLS = (".pkl", ".pickle", ".joblib"), (b"\x02", b"\x03", b"\x04", b"\x05")
#: Packed files within packed files.
DEEPEST = 3


def open_source(path: str | Path, options: ReadOptions) -> Source:
    """Open a recording with the reader of its format.

    Raises
    ------
    InputError
        If there is no such file, or its content is not what its format promises.
    """
    path = Path(path)
    try:
        return _opened(path, options) if options.accel_file is None else _of_two(path, options)
    except FileNotFoundError:
        raise InputError(f"There is no file {path}.{_near(path)}") from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} cannot be read: {error}.") from None


def _near(path: Path) -> str:
    """The file of the same folder whose name is nearest, as a question."""
    try:
        others = [each.name for each in islice(path.parent.iterdir(), 1000) if each.name != path.name]
        return did_you_mean(path.name, others)
    except OSError:
        return ""


def _opened(path: Path, options: ReadOptions, depth: int = 0, packed: int | None = None) -> Source:
    """A recording; `packed` are the bytes of the file that it was unpacked from, which bound the time it may take."""
    if depth > DEEPEST:
        raise InputError(f"{path.name} is packed within packed files; unpack it first.")
    if is_stream(path):
        spooled = piped(path)
        return _held(spooled, spooled.path.name, options, depth)
    inside = None if path.exists() else _split(path)
    if inside is not None:
        archive, member = inside
        if not _head(archive).startswith(ZIP):
            raise InputError(f"There is no file {path}: {archive} is a file and no zip archive.")
        return _unzipped(archive, member, options, depth)
    if not path.exists():
        raise FileNotFoundError(path)
    if path.is_dir():
        return _of_folder(path, options, depth)
    if path.is_file() and path.stat().st_size == 0:
        raise InputError(f"{path.name} is empty.")
    if path.is_file():
        head = _head(path)
        if (suffix := packed_as(head)) is not None:
            return _held(unpacked(path, suffix), path.name, options, depth, packed or path.stat().st_size)
        if head.startswith(ZIP) and _is_archive(path, options):
            return _unzipped(path, None, options, depth, packed)
        _refuse_unread(path, head, options)
        if (rewritten := _rewriter(path, options)) is not None:
            return _held(rewritten(path), path.name, options, depth, packed)
    return _by_format(path, options, packed)


def _of_folder(path: Path, options: ReadOptions, depth: int) -> Source:
    """A folder that is one recording."""
    if is_oxts_folder(path):
        from gyronorth.readers.oxts import of_oxts

        return _held(of_oxts(path), path.name, options, depth)
    if not is_bag_folder(path):
        raise InputError(
            f"{path} is a folder; a file is expected (or a bag of ROS 2, which holds a {METADATA}, or a folder oxts of "
            "KITTI)."
        )
    return _by_format(path, options)


def _refuse_unread(path: Path, head: bytes, options: ReadOptions) -> None:
    """Refuse pickles, formats of which it is known that they are not read, and sentences without raw rates."""
    undeclared = options.format is None and FORMATS.suffixes.get(path.suffix.lower(), "csv") == "csv"
    if undeclared and not is_plain_table(head):
        from gyronorth.readers.foreign import foreign

        if says := foreign(head, path.name):
            raise InputError(says)
    if path.suffix.lower() in PICKLES or (head[:1] == b"\x80" and head[1:2] in PICKLE_PROTOCOLS):
        from gyronorth.readers.library import pickled

        raise InputError(pickled(path.name))
    if _may_be_text(path, options) and not options.columns and head.startswith((b"$VN", b"#AP")):
        from gyronorth.readers.formats.frames import refuse_others

        refuse_others(path)


def _may_be_text(path: Path, options: ReadOptions) -> bool:
    """Whether neither declaration nor suffix says that a file is no text."""
    by_suffix = FORMATS.suffixes.get(path.suffix.lower(), "csv")
    return options.protocol is None and (options.format or by_suffix) == "csv"


def _rewriter(path: Path, options: ReadOptions) -> Callable[[Path], Spooled] | None:
    """What writes a text as a table that is none; None for all other files."""
    if not _may_be_text(path, options) or is_plain_table(head := _head(path, LOOK)):
        return None
    from gyronorth.readers.records import rewriter_of

    return rewriter_of(head)


def _of_two(path: Path, options: ReadOptions) -> Source:
    """A gyroscope's file joined with an accelerometer's."""
    from gyronorth.readers.joining import joined, options_of_two

    of_gyro, of_accel = options_of_two(options)
    gyro = _opened(path, of_gyro)
    accel_file = Path(options.accel_file or "")
    if not accel_file.exists() and _split(accel_file) is None:
        raise InputError(f"There is no file {accel_file}.")
    accel = _opened(accel_file, of_accel)
    return joined(gyro, accel, drop_bad_rows=options.drop_bad_rows)


def _by_format(path: Path, options: ReadOptions, packed: int | None = None) -> Source:
    by_suffix = FORMATS.suffixes.get(path.suffix.lower())
    declared = options.format or ("frames" if options.protocol is not None else None)
    name = "rosbag2" if path.is_dir() else declared or by_suffix or recognised(path)
    if name not in FORMATS:
        raise InputError(f"format is {name!r}; one of {', '.join(FORMATS)} is expected.")
    info = FORMATS.info(name)
    if options.variable is not None and not info.takes_variable:
        raise InputError(
            f"variable {options.variable!r} is declared, but {path.name} is no file of several tables or arrays."
        )
    if options.topic is not None and not info.takes_topic:
        raise InputError(f"topic {options.topic!r} is declared, but {path.name} is neither a bag nor an MCAP file.")
    if options.columns and not info.takes_columns:
        raise InputError(f"columns does not apply to {path.name}: its messages name their own fields.")
    return _read(FORMATS[name], path, options, packed)


def _read(chosen: Format, path: Path, options: ReadOptions, packed: int | None) -> Source:
    """A recording within its budget, decoded in a process of its own where foreign code does it."""
    size = size_of(path) if path.exists() else 0
    if not chosen.foreign:
        return counted(chosen.open(path, options), size)
    with suppress(ImportError):  # the reader says what is missing
        for module in chosen.foreign:  # once, not in each child
            import_module(module)
    source = open_apart(lambda: chosen.open(path, options), name=path.name, size=size, packed=packed)
    return counted(source, size)


def _held(spooled: Spooled, name: str, options: ReadOptions, depth: int, packed: int | None = None) -> Source:
    """The recording in a file that was made to be read once."""
    source = _opened(spooled.path, options, depth + 1, packed)
    return replace(source, name=name, held=(spooled, source.held))


def _is_archive(path: Path, options: ReadOptions) -> bool:
    """Whether a file that begins as a zip archive is one of files, and no format of its own."""
    if options.format not in (None, "csv") or path.suffix.lower() in FORMATS.suffixes:
        return False
    from gyronorth.readers.archive import is_npz, is_workbook

    return not (is_npz(path) or is_workbook(path))


def _split(path: Path) -> tuple[Path, str] | None:
    """The archive and the file in it of a path ARCHIVE.zip/FILE."""
    from gyronorth.readers.archive import split_path

    return split_path(path)


def recordings_inside(path: Path, *, others: bool = True) -> list[Path]:
    """A file itself, or each recording of a zip archive of several, as ARCHIVE.zip/FILE.

    An archive that cannot be read is one: reading it says so. Without `others` only files with the suffix of a
    recording count, and an archive of none is left out.
    """
    try:
        if not path.is_file() or not _head(path).startswith(ZIP) or not _is_archive(path, ReadOptions()):
            return [path]
        from gyronorth.readers.archive import members_of

        members = members_of(path, FORMATS.suffixes, others=others)
    except (InputError, OSError):
        return [path]
    if len(members) > 1:
        return [path / member for member in members]
    return [path] if members or others else []


def _unzipped(path: Path, member: str | None, options: ReadOptions, depth: int, packed: int | None = None) -> Source:
    from gyronorth.readers.archive import unzipped

    spooled, accel = unzipped(path, member)
    if accel is not None:
        source = _of_two(spooled.path, replace(options, accel_file=accel))
        return replace(source, name=path.name, held=(spooled, source.held))
    name = path.name if member is None else f"{path.name}/{member}"
    return _held(spooled, name, options, depth, packed or path.stat().st_size)


def recordings_in(folder: str | Path) -> list[Path]:
    """The recordings in a folder and the folders below it, by name.

    Everything with a known suffix counts, packed or not, each such file of a zip archive, each .txt that is an export
    of MT Manager, and each folder that is a bag of ROS 2 or of KITTI, as one; hidden files and folders do not. A link
    whose file is gone and a folder that may not be looked into are among them: reading them says so.

    Raises
    ------
    InputError
        If it is no folder, or holds no recording.
    """
    from gyronorth.readers.archive import inner_suffix

    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder.")
    found: list[Path] = []
    closed = partial(_note_closed, found)
    for place, folders, names in os.walk(folder, onerror=closed):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in [name for name in folders if _is_recording(Path(place, name))]:
            folders.remove(name)
            found.append(Path(place, name))
        for path in (Path(place, name) for name in names if not name.startswith(".")):
            # A link whose file is gone tells so; what is there and no file, as a pipe or a device, may never end.
            known = inner_suffix(path) in FORMATS.suffixes and (path.is_file() or not path.exists())
            if known or (path.suffix.lower() == ".txt" and path.is_file() and _head(path).startswith(b"//")):
                found.append(path)
            elif path.suffix.lower() == ".zip":
                found += recordings_inside(path, others=False)
    if not found:
        state = "holds no recordings" if any(folder.iterdir()) else "is empty and holds no recordings"
        raise InputError(
            f"{folder} {state}: files in {', '.join(FORMATS.suffixes)}, MT Manager .txt or bags of ROS 2 are expected "
            "in it or in the folders below it (hidden ones do not count). Check the path, or `gyronorth convert` yours "
            "first."
        )
    return sorted(found, key=natural_order)


def _is_recording(folder: Path) -> bool:
    """Whether a folder is one recording; one that may not be looked into is none."""
    try:
        return is_recording_folder(folder)
    except PermissionError:
        return False


def _note_closed(found: list[Path], error: OSError) -> None:
    """Put a folder that cannot be listed among the recordings, where its row tells of it."""
    found.append(Path(str(error.filename)))


def natural_order(path: Path) -> tuple[object, ...]:
    """x_8.0.csv before x_15.0.csv: runs of digits count as numbers."""
    import re

    return tuple((int(part), part) if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", str(path)) if part)


def recognised(path: Path) -> str:
    """The format that the content of a file shows; CSV if it shows none."""
    head = _head(path, LOOK)
    # Files with a signature of their own come first: a text may hold any word, and frames any bytes.
    last = ("psins", "mt-manager", "doubles", "frames")
    signed = (name for name in FORMATS if name not in last)
    return next((name for name in (*signed, *last) if FORMATS[name].recognises(head)), "csv")


def _head(path: Path, size: int = 4096) -> bytes:
    with path.open("rb") as file:
        return file.read(size)
