"""Outputs appear whole or not at all: written beside their place under a name nobody can guess, then renamed into it.

What stood there stays until the new one is whole, and its permissions go over to it. If the
writing fails, is interrupted or is ended by SIGTERM or SIGHUP, nothing is left beside it. What the
operating system refuses becomes one `InputError` that names the place and the cause.
"""

from __future__ import annotations

import errno
import gc
import os
import signal
import threading
import traceback
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn

from gyronorth.errors import InputError

#: What helps, by the cause that the operating system gives.
_CURES = {
    errno.ENOSPC: "Free some space there, or choose a place on another disk",
    errno.EDQUOT: "Free some of your quota, or choose a place on another disk",
    errno.ENOENT: "Make the folder {parent} first, or choose another place",
    errno.ENOTDIR: "{parent} is a file; choose a place in a folder",
    errno.EACCES: "Choose a folder that you may write in",
    errno.EPERM: "Choose a folder that you may write in",
    errno.EROFS: "Choose a folder that you may write in",
    errno.EISDIR: "Choose another name",
}


@contextmanager
def written_beside(path: str | os.PathLike[str], *, durable: bool = False) -> Generator[Path]:
    """An empty file in the folder of `path` to write into, renamed to `path` when the block ends well.

    A symbolic link keeps pointing where it did, and its target is replaced. Devices and pipes
    (/dev/stdout) cannot be renamed over and are written directly.

    Parameters
    ----------
    path : str or os.PathLike
        Where the file shall be.
    durable : bool, optional
        Force it to the disk before the old one goes: for what cannot be made again.

    Raises
    ------
    InputError
        If the file cannot be made, written or renamed.
    """
    path = Path(path)
    with _errors_told(path, beside := _beside(path)):
        if path.exists() and not path.is_file():
            if path.is_dir():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            yield path
            return
        mode = path.stat().st_mode & 0o7777 if path.exists() else None
        with unwound_by_signals():
            try:
                # Exclusively: whatever is there already, a link too, is not written through. Never wider than the old.
                os.close(os.open(beside, _NEW_FILE, 0o666 if mode is None else mode & 0o666 | 0o600))
                yield beside
                _finish_file(beside, mode, durable=durable)
                beside.replace(os.path.realpath(path))
            finally:
                beside.unlink(missing_ok=True)
        if durable:
            _sync_folder(beside.parent)


@contextmanager
def folder_beside(folder: str | os.PathLike[str]) -> Generator[Path]:
    """An empty folder beside `folder` to write into, which takes its place when the block ends well.

    Folders that lead there are made. Its files are forced to the disk first. An old folder
    goes, with all that is in it, only when the new one is in its place.

    Raises
    ------
    InputError
        If the folder cannot be made, filled or renamed, or if `folder` is a file.
    """
    folder = Path(folder)
    target, beside = Path(os.path.realpath(folder)), _beside(folder)
    old = beside.with_suffix(".old")
    with _errors_told(folder, beside), unwound_by_signals(), no_empty_folder(target.parent):
        try:
            if target.exists() and not target.is_dir():
                raise NotADirectoryError(errno.EEXIST, "a file of that name is there")
            target.parent.mkdir(parents=True, exist_ok=True)
            beside.mkdir()
            yield beside
            if target.is_dir():
                beside.chmod(target.stat().st_mode & 0o7777)
            for place, _, names in os.walk(beside):
                for name in names:
                    _finish_file(Path(place, name), None, durable=True)
                _sync_folder(Path(place))
            if target.is_dir():
                target.rename(old)
            beside.rename(target)
            _sync_folder(target.parent)
        finally:
            if old.is_dir() and not target.exists():
                old.rename(target)  # the new one did not get there
            _remove_tree(beside)
            _remove_tree(old)


def write_text(path: str | os.PathLike[str], text: str, *, errors: str = "strict") -> None:
    """Write a text as UTF-8 with `written_beside`; `errors` is that of `str.encode`.

    Raises
    ------
    InputError
        If the file cannot be made, written or renamed.
    """
    with written_beside(path) as beside:
        beside.write_text(text, encoding="utf-8", errors=errors, newline="\n")


def read_bounded(path: Path, most: int) -> bytes:
    """The bytes of a small file, which may be a device that never ends.

    Raises
    ------
    InputError
        If there are more than `most`, or it cannot be read.
    """
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None
    if len(content) > most:
        raise InputError(f"{path} has more than {most} bytes, more than any such file needs: it is another one.")
    return content


@contextmanager
def temporary_files_told() -> Generator[None]:
    """Turn what the operating system says of the folder of temporary files into one message."""
    try:
        yield
    except OSError as error:
        import tempfile

        where = "" if tempfile.tempdir is None else f" in {tempfile.tempdir}"
        raise InputError(
            f"A temporary file cannot be written{where}: {error.strerror or error}. Free some space there, or set "
            "TMPDIR to a folder that you may write in, on a disk with room."
        ) from error


@contextmanager
def no_empty_folder(folder: Path) -> Generator[None]:
    """If the block fails and `folder` was made within it and is still empty, it goes, with its parents made for it."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        yield
    except BaseException:
        with suppress(OSError):  # the first that holds something, or was not made, ends it
            for path in missing:
                path.rmdir()
        raise


#: Windows has no links to follow here, and no such flag.
_NEW_FILE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)


def _beside(path: Path) -> Path:
    """A name in the folder where `path` really is: hidden, not to be guessed, of a length that every disk takes."""
    real = Path(os.path.realpath(path))  # of links in a circle: the first
    return real.with_name(f".{real.name[:40]}.{os.urandom(8).hex()}.part")


def _finish_file(file: Path, mode: int | None, *, durable: bool) -> None:
    """Give a written file its permissions, and force it to the disk."""
    if durable:
        with file.open("rb+") as handle:
            os.fsync(handle.fileno())
    if mode is not None:
        file.chmod(mode)


def _sync_folder(folder: Path) -> None:
    """Force the names in a folder to the disk, where the system can."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _remove_tree(folder: Path) -> None:
    import shutil

    shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _errors_told(path: Path, beside: Path) -> Generator[None]:
    """Turn what the operating system says of this place into one message; errors of other files pass."""
    try:
        yield
    except OSError as error:
        if isinstance(error.filename, str | bytes):  # none where a write failed
            file = Path(os.fsdecode(error.filename))
            if not file.is_relative_to(beside) and os.path.realpath(file) != os.path.realpath(path):
                raise
        cure = _CURES.get(error.errno or 0, "").format(parent=path.parent)
        message = f"{path} cannot be written: {error.strerror or error}."
        raise InputError(f"{message} {cure}." if cure else message) from error


#: What ends a process from outside: a service manager, `timeout`, a terminal that is closed.
_ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


class _Ended(BaseException):
    """A signal came: what is half written goes, then the process ends as it was told to."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


@contextmanager
def unwound_by_signals() -> Generator[None]:
    """Let SIGTERM and SIGHUP unwind the block before they end the process, where nothing else waits for them.

    A second one ends it at once.
    """
    in_main = threading.current_thread() is threading.main_thread()
    ours = [each for each in _ENDING if in_main and signal.getsignal(each) is signal.SIG_DFL]

    def unwind(number: int, _: object) -> NoReturn:
        usual()
        raise _Ended(number)

    def usual() -> None:
        for each in ours:
            signal.signal(each, signal.SIG_DFL)

    for each in ours:
        signal.signal(each, unwind)
    try:
        yield
    except _Ended as end:
        if ours:
            traceback.clear_frames(end.__traceback__)  # what they held goes: temporary files
            gc.collect()
            signal.raise_signal(end.number)
        raise
    finally:
        usual()
