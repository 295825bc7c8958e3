"""Zip archives: which of the files in one are the recording.

The only file that may be one, or a gyroscope's and an accelerometer's, or a bag of ROS 2 with all its files; of
several the message names them. ARCHIVE.zip/FILE is a path too, and so is ARCHIVE.zip/FOLDER of a phone or a bag.
"""

from __future__ import annotations

import shlex
import zipfile
from collections.abc import Collection, Iterable
from pathlib import Path, PurePath, PurePosixPath

from gyronorth.errors import InputError
from gyronorth.readers.bag_folder import METADATA
from gyronorth.readers.library import errors_translated, pickled
from gyronorth.readers.spool import SUFFIXES, Spooled, most_of

#: Suffixes of what lies beside recordings in archives.
_BESIDE = frozenset(
    (".pdf", ".png", ".jpg", ".jpeg", ".svg", ".md", ".html", ".xml", ".json", ".yaml", ".yml", ".ini", ".cfg", ".mp4",
     ".avi", ".py", ".m", ".docx", ".kml", ".gpx", ".nmea", ".ubx")
)  # fmt: skip
#: Files of an archive that are looked at, and listed in a message.
MOST_MEMBERS, _LISTED = 10_000, 12
#: What stands in the names of files of accelerometers that hold no gravity, or are not corrected.
OTHER_KINDS = ("linear", "linacc", "uncal", "gravity", "userac")


def state_of_member(path: Path) -> str:
    """Digest of names, sizes and CRC of a file or folder ARCHIVE.zip/FILE, `zip:...`; empty for another path."""
    from hashlib import sha256

    if (inside := split_path(path)) is None:
        return ""
    archive, member = inside
    with errors_translated(archive.name, "zip archive"), zipfile.ZipFile(archive) as opened:
        every = [each for each in opened.infolist() if f"{each.filename}/".startswith(f"{member}/")]
    state = "\n".join(f"{each.filename} {each.file_size} {each.CRC:08x}" for each in every)
    return f"zip:{sha256(state.encode('utf-8', 'backslashreplace')).hexdigest()}" if every else ""


def split_path(path: Path) -> tuple[Path, str] | None:
    """The archive and the file in it of a path ARCHIVE.zip/FILE; None for another path."""
    for above in path.parents:
        if above.is_file():
            return above, path.relative_to(above).as_posix()
        if above.is_dir():
            return None
    return None


def is_npz(path: Path) -> bool:
    """Whether an archive holds nothing but NumPy arrays."""
    names = _names(path)
    return bool(names) and all(name.endswith(".npy") for name in names)


def is_workbook(path: Path) -> bool:
    """Whether an archive is a workbook of spreadsheets."""
    return "xl/workbook.xml" in _names(path)


def unzipped(path: Path, member: str | None = None) -> tuple[Spooled, Path | None]:
    """The recording in an archive: a file or a folder that is one, and perhaps the accelerometer's file.

    Parameters
    ----------
    path : Path
        The archive.
    member : str, optional
        The file or folder in it, where one was named.

    Raises
    ------
    InputError
        If there is none, or several; the message lists them.
    """
    names = _names(path)
    if any(name.rsplit("/", 1)[-1] in ("data.pkl", "object.pkl") for name in names):
        raise InputError(pickled(path.name))
    if member is not None and member not in names:
        within = [name for name in names if name.startswith(f"{member}/")]
        if not within:
            raise InputError(f"{path.name} holds no file {member}; it holds {_listed(names)}.")
        names, member = within, None
    metadata = [name for name in names if PurePosixPath(name).name == METADATA]
    if member is None and len(metadata) == 1:
        return _folder(path, PurePosixPath(metadata[0]).parent, names), None
    accel = None
    if member is None:
        member, accel = _chosen(path, names)
    spooled = Spooled(member)
    _extract(path, member, spooled, spooled.path)
    if accel is None:
        return spooled, None
    beside = spooled.folder / PurePosixPath(accel).name
    _extract(path, accel, spooled, beside)
    return spooled, beside


def members_of(path: Path, suffixes: Collection[str], *, others: bool) -> list[str]:
    """The recordings in an archive: files, folders of a phone's two files or of a bag, or `.` for all of it together.

    Parameters
    ----------
    path : Path
        The archive.
    suffixes : collection of str
        Those of recordings.
    others : bool
        Whether other files count where none has such a suffix.

    Raises
    ------
    InputError
        If the archive is damaged.
    """
    names = _names(path)
    likely = [name for name in names if _may_be_recording(name)]
    known = [name for name in likely if inner_suffix(PurePosixPath(name)) in suffixes]
    likely = known or (likely if others else [])
    bags = {str(PurePosixPath(name).parent) for name in names if PurePosixPath(name).name == METADATA}
    folders: dict[str, list[str]] = {}
    for name in sorted(likely):
        folders.setdefault(str(PurePosixPath(name).parent), []).append(name)
    found = sorted(bags)
    for folder, inside in folders.items():
        if folder not in bags:
            together = _of_a_phone(inside) is not None and (folder != "." or len(folders) == 1)
            found += [folder] if together else inside
    return found


def _of_a_phone(names: list[str]) -> tuple[str, str | None] | None:
    """The gyroscope's file among several of one folder and the accelerometer's; None where they are not so named."""
    gyros, accels = _of_sensor(names, ("gyr",)), _of_sensor(names, ("acc",))
    total = [name for name in accels if "total" in name.lower()]
    accels = total if len(total) == 1 else accels
    if len(names) < 2 or len(gyros) != 1 or len(accels) > 1:
        return None
    if PurePosixPath(gyros[0]).parent != PurePosixPath((accels or gyros)[0]).parent:
        return None
    return gyros[0], accels[0] if accels else None


def _chosen(path: Path, names: list[str]) -> tuple[str, str | None]:
    likely = [name for name in names if _may_be_recording(name)]
    if not likely:
        raise InputError(f"{path.name} holds no recording; it holds {_listed(names) or 'no file'}.")
    if len(likely) == 1:
        return likely[0], None
    if (two := _of_a_phone(likely)) is not None:
        return two
    raise InputError(
        f"{path.name} holds {len(likely)} files that may be recordings: {_listed(likely)}. Say which one.\n"
        f"Try: gyronorth info {shlex.quote(f'{path}/{likely[0]}')}"
    )


def _of_sensor(names: list[str], words: Iterable[str]) -> list[str]:
    """Files named after a sensor, those of its other kinds left out."""
    found = [name for name in names if any(word in PurePosixPath(name).name.lower() for word in words)]
    return [name for name in found if not any(word in PurePosixPath(name).name.lower() for word in OTHER_KINDS)]


def _may_be_recording(name: str) -> bool:
    path = PurePosixPath(name)
    if path.suffix.lower() in _BESIDE or path.stem.lower().startswith(("readme", "license", "meta")):
        return False
    return "meta" not in (part.lower() for part in path.parts[:-1])


def _folder(path: Path, folder: PurePosixPath, names: list[str]) -> Spooled:
    """A bag of ROS 2 with all its files."""
    spooled = Spooled(path.stem)
    spooled.path.mkdir()
    for name in names:
        if PurePosixPath(name).parent == folder:
            _extract(path, name, spooled, spooled.path / PurePosixPath(name).name)
    return spooled


def _names(path: Path) -> list[str]:
    """The files of an archive, without what systems add to it."""
    with errors_translated(path.name, "zip archive"), zipfile.ZipFile(path) as archive:
        if len(archive.infolist()) > MOST_MEMBERS:
            raise InputError(f"{path.name} holds more than {MOST_MEMBERS} files. Unpack it, and give one of them.")
        names = [info.filename for info in archive.infolist() if not info.is_dir()]
    return [
        name
        for name in names
        if not any(part.startswith((".", "__MACOSX")) for part in PurePosixPath(name).parts)
        and PurePosixPath(name).name
    ]


def _extract(path: Path, name: str, spooled: Spooled, to: Path) -> None:
    with errors_translated(path.name, "zip archive"), zipfile.ZipFile(path) as archive:
        info = archive.getinfo(name)
        if info.flag_bits & 1:
            raise InputError(f"{name} of {path.name} is encrypted. Unpack it first, and give the file.")
        most = most_of(info.compress_size)
        with archive.open(info) as member:
            spooled.fill(
                member.read,
                most=most,
                too_large=f"{name} of {path.name} unpacks into more than {most >> 20} MiB, which no recording of its "
                "size does. If it is one: unpack the archive first.",
                path=to,
            )
    if not to.stat().st_size:
        raise InputError(f"{name} of {path.name} is empty.")


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(name[:80] for name in names[:_LISTED]) + more


def inner_suffix(path: PurePath) -> str:
    """The suffix of a file, of a packed one that before the packing's."""
    suffix = path.suffix.lower()
    return PurePath(path.stem).suffix.lower() if suffix in SUFFIXES else suffix
