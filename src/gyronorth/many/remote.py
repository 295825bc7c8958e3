"""Recordings behind a URL: fetched whole into a temporary folder, since most formats seek."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote, urlsplit

from gyronorth.errors import InputError
from gyronorth.many.cache import private_folder, room_for

#: How often a file is fetched before its row says that it could not be, and the pause before the second time, s.
ATTEMPTS, PAUSE = 3, 0.5
#: How long a web server may say nothing, s, and states of its that may pass although they blame the request.
SILENCE, PASSING = 30.0, (408, 425, 429)
_URL = re.compile(r"[a-z][a-z0-9+.-]+://", re.IGNORECASE)


class NotFetched(InputError):
    """A file that did not come: another run may have it."""


def is_url(address: str) -> bool:
    """Whether an address is a URL and no path."""
    return _URL.match(address) is not None


def urls_of(url: str) -> list[str]:
    """The recordings that a URL names: itself, those of a folder, those that match a pattern with `*`.

    Raises
    ------
    InputError
        If fsspec or its part for this protocol is not installed, the place cannot be listed, or holds no recording.
    """
    from gyronorth.readers.registry import FORMATS

    if url.startswith("file://") or url.lower().startswith(("http://", "https://")):
        return [url]
    filesystem, path = _filesystem(url)
    try:
        if "*" in path:
            found = [filesystem.unstrip_protocol(name) for name in sorted(filesystem.glob(path))]
        elif filesystem.isdir(path):
            names = (name for name in sorted(filesystem.find(path)) if not _hidden(name[len(path) :]))
            known = (name for name in names if PurePosixPath(name).suffix.lower() in FORMATS.suffixes)
            found = [filesystem.unstrip_protocol(name) for name in known]
        else:
            return [url]
    except Exception as error:
        raise InputError(f"{url} cannot be listed ({_short(error)}). Check the address and the access to it.") from None
    if not found:
        raise InputError(f"{url} holds no recordings. Check the address.")
    return found


@contextmanager
def at_hand(address: str) -> Generator[Path]:
    """A path at which the file of a path or URL can be read while the block runs.

    Raises
    ------
    InputError
        If it cannot be fetched in `ATTEMPTS` attempts.
    """
    if not is_url(address):
        yield Path(address)
    elif address.startswith("file://"):
        yield Path(unquote(urlsplit(address).path))
    else:
        with private_folder() as folder:
            path = folder / (PurePosixPath(unquote(urlsplit(address).path)).name or "recording")
            _fetch(address, path)
            yield path


def state_of(address: str) -> str:
    """What the server says of the content of a URL without sending it, `etag:...`; empty where it says nothing."""
    if not is_url(address) or address.startswith("file://"):
        return ""
    filesystem, path = _filesystem(address)
    try:
        tag = filesystem.info(path).get("ETag")
    except Exception:  # fetching it will tell, and tries more than once
        return ""
    return f"etag:{str(tag).replace(chr(34), '')}" if tag else ""


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
            raise NotFetched(f"There is no file {url}.") from None
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
    if not url.lower().startswith(("http://", "https://")):
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
