"""Recordings behind a URL: fetched whole into a temporary folder, since most formats seek.

Of a zip archive of several, each is one, as ARCHIVE.zip/FILE; an archive is fetched once for all that follow one
another, as long as the server says that it is the same.
"""

from __future__ import annotations

import os
import re
import threading
import time
import weakref
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import quote, unquote, urlsplit

from gyronorth.errors import InputError
from gyronorth.sources.cache import private_folder, room_for

#: How often a file is fetched before its row says that it could not be, and the pause before the second time, s.
ATTEMPTS, PAUSE = 3, 0.5
#: How long a web server may say nothing, s, and states of its that may pass although they blame the request.
SILENCE, PASSING = 30.0, (408, 425, 429)
_URL = re.compile(r"[a-z][a-z0-9+.-]+://", re.IGNORECASE)
_IN_ARCHIVE = re.compile(r"(.+?\.zip)/(.+)", re.IGNORECASE | re.DOTALL)


class NotFetched(InputError):
    """A file that did not come: another run may have it."""


class Absent(NotFetched):
    """A file that is not there."""


def is_url(address: str) -> bool:
    """Whether an address is a URL and no path."""
    return _URL.match(address) is not None


def urls_of(url: str) -> list[str]:
    """The recordings that a URL names: itself, those of a folder or an archive, those that match a pattern with `*`.

    Raises
    ------
    InputError
        If fsspec or its part for this protocol is not installed, the place cannot be listed, or holds no recording.
    """
    files = _files_of(url)
    return [each for file in files for each in _inside(file, others=files == [url])]


def _files_of(url: str) -> list[str]:
    """The files that a URL names, archives among them."""
    from gyronorth.readers.archive import inner_suffix
    from gyronorth.readers.registry import FORMATS

    if _is_web(url) or _split(url) is not None:
        return [url]
    filesystem, path = _filesystem(url)
    known = (*FORMATS.suffixes, ".zip")
    try:
        if "*" in path:
            found = [filesystem.unstrip_protocol(name) for name in sorted(filesystem.glob(path))]
        elif filesystem.isdir(path):
            names = (name for name in sorted(filesystem.find(path)) if not _hidden(name[len(path) :]))
            found = [filesystem.unstrip_protocol(name) for name in names if inner_suffix(PurePosixPath(name)) in known]
        else:
            return [url]
    except Exception as error:
        raise InputError(f"{url} cannot be listed ({_short(error)}). Check the address and the access to it.") from None
    if not found:
        raise InputError(f"{url} holds no recordings. Check the address.")
    return found


def _inside(url: str, *, others: bool) -> list[str]:
    """A file itself, or each recording of a zip archive of several, see `recordings_inside`."""
    from gyronorth.readers import recordings_inside

    if not _is_archive(url):
        return [url]
    try:
        path = _archive(url)
    except NotFetched:  # reading it will tell
        return [url]
    found = recordings_inside(path, others=others)
    return [url] if found == [path] else [_joined(url, each.relative_to(path).as_posix()) for each in found]


@contextmanager
def at_hand(address: str) -> Generator[Path]:
    """A path at which the file of a path or URL can be read while the block runs.

    Raises
    ------
    InputError
        If it cannot be fetched in `ATTEMPTS` attempts.
    """
    if not is_url(address) or is_local(address):
        yield local_path(address)
        return
    if (place := _in_archive(address)) is not None:
        yield place
        return
    with private_folder() as folder:
        path = folder / _name_of(address)
        _fetch(address, path)
        yield path


def is_local(address: str) -> bool:
    """Whether a URL is of a file of this machine."""
    return address.lower().startswith("file://")


def local_path(address: str) -> Path:
    """The path of a path or a URL `file://`."""
    return Path(unquote(urlsplit(address).path)) if is_local(address) else Path(address)


def state_of(address: str) -> str:
    """What the server says of the content of a URL without sending it, `etag:...`; empty where it says nothing."""
    if not is_url(address) or is_local(address):
        return ""
    archive, member = _split(address) or (address, "")
    filesystem, path = _filesystem(archive)
    try:
        tag = filesystem.info(path).get("ETag")
    except Exception:  # fetching it will tell, and tries more than once
        return ""
    return f"etag:{str(tag).replace(chr(34), '')}{f' {member}' if member else ''}" if tag else ""


class _Held:
    """The archive that a thread fetched last, in its private folder until it fetches another or ends."""

    def __init__(self, url: str, state: str) -> None:
        self.url, self.state, folder = url, state, ExitStack()
        weakref.finalize(self, folder.close)
        self.path = folder.enter_context(private_folder()) / _name_of(url)
        _fetch(url, self.path)


_HELD = threading.local()


def _archive(url: str) -> Path:
    """An archive, fetched if it is not the one that is here; without a state of the server it is never."""
    held, state = getattr(_HELD, "last", None), state_of(url)
    if held is None or held.url != url or not state or held.state != state:
        _HELD.last = held = None  # its folder goes first
        held = _HELD.last = _Held(url, state)
    return held.path


def _in_archive(address: str) -> Path | None:
    """The path of an archive, or of a file in one, that is behind a URL; None for another file."""
    if _is_archive(address):
        return _archive(address)
    if (inside := _split(address)) is None:
        return None
    try:
        return _archive(inside[0]) / inside[1]
    except Absent:  # a folder by such a name
        return None


def _is_archive(url: str) -> bool:
    return _name_of(url).lower().endswith(".zip")


def _name_of(url: str) -> str:
    """The name of the file behind a URL."""
    path = unquote(urlsplit(url).path) if _is_web(url) else url.split("://", 1)[1]
    return PurePosixPath(path).name or "recording"


def _is_web(url: str) -> bool:
    return url.lower().startswith(("http://", "https://"))


def _split(url: str) -> tuple[str, str] | None:
    """The URL of the archive and the file in it of ARCHIVE.zip/FILE; a query belongs to the archive."""
    place, mark, query = url.partition("?") if _is_web(url) else (url, "", "")
    inside = _IN_ARCHIVE.fullmatch(place)
    if inside is None:
        return None
    return inside[1] + mark + query, unquote(inside[2]) if _is_web(url) else inside[2]


def _joined(url: str, member: str) -> str:
    """The reverse of `_split`."""
    if not _is_web(url):
        return f"{url}/{member}"
    place, mark, query = url.partition("?")
    return f"{place}/{quote(member)}{mark}{query}"


def checksum_of(path: Path) -> str:
    """SHA-256 of a file, or of the names and contents of the files of a folder (a bag of ROS 2).

    Of a file in a zip archive, which need not be unpacked for it, sizes and CRC that stand in the archive.
    """
    import hashlib

    if not path.exists():
        from gyronorth.readers.archive import state_of_member

        return state_of_member(path)
    if path.is_dir():
        digest = hashlib.sha256()
        for file in sorted(file for file in path.rglob("*") if file.is_file()):
            digest.update(os.fsencode(file.relative_to(path)) + b"\0" + checksum_of(file).encode())
        return f"sha256:{digest.hexdigest()}"
    with path.open("rb") as file:
        return f"sha256:{hashlib.file_digest(file, 'sha256').hexdigest()}"


def _filesystem(url: str) -> tuple[Any, str]:
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise InputError(
            f"{url} needs fsspec, which is not installed. Install it with: pip install 'gyronorth[cloud]'."
        ) from None
    try:
        return url_to_fs(url, **_patience(url))
    except ImportError as error:
        raise InputError(
            f"{url} needs a package that is not installed ({_short(error)}). Install it beside 'gyronorth[cloud]'."
        ) from None
    except ValueError as error:
        raise InputError(f"{url} cannot be opened: {_short(error)}. Check how it begins, as in s3://.") from None


def _fetch(url: str, path: Path) -> None:
    """Bring a file here, whole."""
    filesystem, there = _filesystem(url)
    for attempt in range(1, ATTEMPTS + 1):
        try:
            filesystem.get_file(there, str(path), callback=_bounded(url, path.parent))
            size = filesystem.info(there).get("size")
            if size is not None and path.stat().st_size != size:
                raise ConnectionError(f"{path.stat().st_size} of {size} bytes came")
            return
        except FileNotFoundError:
            raise Absent(f"There is no file {url}.") from None
        except PermissionError as error:
            raise NotFetched(f"{url} may not be read ({_short(error)}). Check the access to it.") from None
        except InputError as error:
            raise NotFetched(str(error)) from None
        except Exception as error:  # each protocol has its own
            filesystem.invalidate_cache()
            status = getattr(error, "status", 0)
            if 400 <= status < 500 and status not in PASSING:
                raise NotFetched(f"{url} may not be read ({_short(error)}). Check the access to it.") from None
            if attempt == ATTEMPTS:
                raise NotFetched(
                    f"{url} could not be fetched in {ATTEMPTS} attempts ({_short(error)}). If the connection was "
                    "broken, give the command again, with --resume where there is a table."
                ) from None
            time.sleep(PAUSE * 2 ** (attempt - 1))


def _patience(url: str) -> dict[str, Any]:
    """Options of a web server: one that says nothing for long is given up, a file may take as long as it comes."""
    if not _is_web(url):
        return {}
    import aiohttp

    timeout = aiohttp.ClientTimeout(total=None, sock_connect=SILENCE, sock_read=SILENCE)
    return {"client_kwargs": {"timeout": timeout, "trust_env": True}}  # proxies of the environment


def _bounded(url: str, folder: Path) -> Any:
    """What fsspec tells of a download, to end one that is too large."""
    from fsspec.callbacks import Callback

    class Bounded(Callback):
        def set_size(self, size: Any) -> None:
            super().set_size(size)
            room_for(size or 0, folder, url)

        def relative_update(self, inc: int = 1) -> None:
            super().relative_update(inc)
            room_for(self.value, folder, url)

    return Bounded()


def _hidden(path: str) -> bool:
    return any(part.startswith(".") for part in PurePosixPath(path).parts)


def _short(error: Exception) -> str:
    name, text = type(error).__name__, " ".join(str(error).split())
    if status := getattr(error, "status", 0):
        return f"{status} {getattr(error, 'message', '') or name}"
    if "Timeout" in name and not text:
        return f"nothing came for {SILENCE:g} s"
    if not text or "message=''" in text:  # of redirects in a circle
        return " ".join(re.sub(r"([A-Z])", r" \1", name).lower().split())
    return text[:160].rstrip(".")
