"""What was named on the command line, or given to the API, as a list of recordings."""

from __future__ import annotations

import glob
import os
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from gyronorth.errors import InputError
from gyronorth.frozen import frozen
from gyronorth.sources.remote import is_local, is_url, local_path, urls_of
from gyronorth.sources.tables import is_table


@frozen
class Item:
    """A recording of many."""

    name: str  # in the table; no two of a list have the same
    address: str  # path or URL


def recordings(sources: Iterable[str | os.PathLike[str]]) -> list[Item]:
    """The recordings that sources name, in the order of these, each once.

    Parameters
    ----------
    sources : iterable of str or path
        Files; folders, with the recordings in them and below; zip archives, with those in them, named
        ARCHIVE.zip/FILE where there are several, behind a URL too; patterns such as `data/**/*.csv`; URLs; lists, as
        `@files.txt`, or `@-` for standard input, one source a line, paths counted from the working folder, or from
        that of the list where nothing is there, empty lines and those that begin with # left out.

    Returns
    -------
    list of Item
        Recordings of a single folder are named from that folder on, others as they were given. A file that is not
        there is one of them: reading it says so.

    Raises
    ------
    InputError
        If a folder holds no recording, nothing matches a pattern, or a list cannot be read.
    """
    from gyronorth.readers import is_recording_folder

    given = [text for source in sources for text in _listed(os.fspath(source))]
    alone = Path(given[0]) if len(given) == 1 else None
    base = alone if alone is not None and alone.is_dir() and not is_recording_folder(alone) else None
    found: dict[str, Item] = {}
    for address in (address for text in given for address in _found(text)):
        name = address if base is None else str(Path(address).relative_to(base))
        item = Item(name.encode("utf-8", "backslashreplace").decode(), address)  # a file name may be no UTF-8
        remote = is_url(address) and not is_local(address)
        found.setdefault(address if remote else os.path.abspath(local_path(address)), item)
    return list(found.values())


def names_one(source: str) -> bool:
    """Whether a source can be one recording only: neither folder nor pattern nor list."""
    from gyronorth.readers import is_recording_folder, recordings_inside

    if is_url(source):
        return _found(source) == [source]
    if os.path.exists(source):
        path = Path(source)
        return is_recording_folder(path) if path.is_dir() else recordings_inside(path) == [path]
    return not (source.startswith("@") or glob.has_magic(source))


def _listed(source: str) -> Iterator[str]:
    """A source itself, or those of a list."""
    if not source.startswith("@") or os.path.exists(source):
        yield source
        return
    try:
        content = sys.stdin.buffer.read() if source == "@-" else Path(source[1:]).read_bytes()
        lines = re.split("\r\n|\n|\r", content.decode("utf-8-sig"))
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(
            f"The list {source[1:]} cannot be read: {reason}. A text file with one source a line is expected behind @."
        ) from None
    named = [text for line in lines if (text := line.strip()) and not text.startswith("#")]
    if not named:
        raise InputError(f"The list {source[1:]} names no recordings; one a line is expected.")
    yield from named if source == "@-" else (_beside(text, os.path.dirname(source[1:])) for text in named)


def _beside(text: str, folder: str) -> str:
    """A line of a list that lies in a folder: counted from there where nothing is there from the working folder."""
    if is_url(text) or _is_there(text) or not _is_there(beside := os.path.join(folder, text)):
        return text
    return beside


def _is_there(source: str) -> bool:
    if os.path.exists(source):
        return True
    inside = source.lower().find(".zip/")
    if inside >= 0:
        return os.path.isfile(source[: inside + 4])
    return glob.has_magic(source) and any(glob.iglob(source, recursive=True))


def _found(source: str) -> list[str]:
    """Addresses of the recordings of one source."""
    from gyronorth.readers import is_recording_folder, recordings_in, recordings_inside
    from gyronorth.readers.registry import natural_order

    if is_local(source):
        path = str(local_path(source))
        found = _found(path)
        return [source] if found == [path] else [Path(os.path.abspath(each)).as_uri() for each in found]
    if is_url(source):
        return urls_of(source)
    if os.path.isdir(source) and not is_recording_folder(Path(source)):
        found = [str(path) for path in recordings_in(source) if not _is_ours(path)]
        if not found:
            raise InputError(f"{source} holds no recordings, only tables that were made of such. Check the path.")
        return found
    if os.path.exists(source) or not glob.has_magic(source):
        return [str(path) for path in recordings_inside(Path(source))] if os.path.isfile(source) else [source]
    matching = sorted(map(Path, glob.glob(source, recursive=True)), key=natural_order)
    files = [path for path in matching if (not path.is_dir() or is_recording_folder(path)) and not _is_ours(path)]
    if not files:
        raise InputError(f"No file matches {source}. Check the pattern; ** stands for folders of any depth.")
    return [str(each) for path in files for each in recordings_inside(path)]


def _is_ours(path: Path) -> bool:
    """Whether a file among recordings is a table that was made of such."""
    return path.suffix.lower() in (".csv", ".parquet", ".pq") and path.is_file() and is_table(path)
