"""Which reader opens which file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gyronorth.errors import InputError
from gyronorth.frames import recognise
from gyronorth.frames.recognition import LOOK
from gyronorth.readers.delimited import open_csv
from gyronorth.readers.frames import open_frames
from gyronorth.readers.hdf5 import SIGNATURE as HDF5_SIGNATURE
from gyronorth.readers.hdf5 import open_hdf5
from gyronorth.readers.mat import open_mat
from gyronorth.readers.mcap import open_mcap
from gyronorth.readers.mt_manager import open_mt_manager
from gyronorth.readers.npz import open_npz
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.parquet import open_parquet
from gyronorth.readers.psins import open_psins
from gyronorth.readers.rosbag import METADATA, is_bag_folder, open_rosbag1, open_rosbag2
from gyronorth.readers.source import Source

#: Every format by name: what opens it.
FORMATS: dict[str, Callable[[Path, ReadOptions], Source]] = {
    "csv": open_csv,
    "psins": open_psins,
    "mt-manager": open_mt_manager,
    "mat": open_mat,
    "npz": open_npz,
    "hdf5": open_hdf5,
    "parquet": open_parquet,
    "rosbag1": open_rosbag1,
    "rosbag2": open_rosbag2,
    "mcap": open_mcap,
    "frames": open_frames,
}
#: Suffixes that say the format; .txt and others are looked into.
SUFFIXES = {
    ".csv": "csv",
    ".imu": "psins",
    ".mat": "mat",
    ".npz": "npz",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".parquet": "parquet",
    ".bag": "rosbag1",
    ".db3": "rosbag2",
    ".mcap": "mcap",
}
#: How packed files begin, and what unpacks them.
PACKED = {b"\x1f\x8b": "gunzip", b"\x28\xb5\x2f\xfd": "zstd -d", b"\xfd7zXZ\x00": "unxz", b"BZh": "bunzip2"}
#: What a declaration of one of these is good for.
_VARIABLES, _TOPICS = ("mat", "hdf5"), ("rosbag1", "rosbag2", "mcap")


def open_source(path: str | Path, options: ReadOptions) -> Source:
    """Open a recording with the reader of its format.

    Raises
    ------
    InputError
        If there is no such file, or its content is not what its format promises.
    """
    path = Path(path)
    try:
        if path.is_dir() and not is_bag_folder(path):
            raise InputError(f"{path} is a folder; a file is expected (or a bag of ROS 2, which holds a {METADATA}).")
        if path.is_file() and path.stat().st_size == 0:
            raise InputError(f"{path.name} is empty.")
        if path.is_file():
            _check_unpacked(path)
        name = (
            "rosbag2"
            if path.is_dir()
            else options.format or _by_protocol(options) or SUFFIXES.get(path.suffix.lower()) or _sniffed(path)
        )
        if name not in FORMATS:
            raise InputError(f"format is {name!r}; one of {', '.join(FORMATS)} is expected.")
        if options.variable is not None and name not in _VARIABLES:
            raise InputError(
                f"variable {options.variable!r} is declared, but {path.name} is neither a .mat nor an HDF5 file."
            )
        if options.topic is not None and name not in _TOPICS:
            raise InputError(f"topic {options.topic!r} is declared, but {path.name} is neither a bag nor an MCAP file.")
        if options.columns and name in _TOPICS:
            raise InputError(f"columns does not apply to {path.name}: its messages name their own fields.")
        return FORMATS[name](path, options)
    except FileNotFoundError:
        raise InputError(f"There is no file {path}.") from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} cannot be read: {error}.") from None


def _by_protocol(options: ReadOptions) -> str | None:
    return "frames" if options.protocol else None


def _check_unpacked(path: Path) -> None:
    head = _head(path)
    tool = next((PACKED[lead] for lead in PACKED if head.startswith(lead)), None)
    if tool is not None:
        bag = ", or give the folder of the bag, which is read as it is" if ".db3" in path.name else ""
        raise InputError(f"{path.name} is packed. Unpack it first: {tool} {path.name}{bag}.")


def recordings_in(folder: str | Path) -> list[Path]:
    """The recordings in a folder and the folders below it, by name.

    Everything with a known suffix counts, each .txt that is an export of MT Manager, and each
    folder that is a bag of ROS 2, as one; hidden files and folders do not.

    Raises
    ------
    InputError
        If it is no folder, or holds no recording.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder.")
    found = []
    for path in folder.rglob("*"):
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if hidden or any(is_bag_folder(above) for above in path.parents if above.is_relative_to(folder)):
            continue
        if path.is_dir() and is_bag_folder(path):
            found.append(path)
        if not path.is_file():
            continue
        known = path.suffix.lower() in SUFFIXES
        if known or (path.suffix.lower() == ".txt" and _head(path).startswith(b"//")):
            found.append(path)
    if not found:
        state = "holds no recordings" if any(folder.iterdir()) else "is empty and holds no recordings"
        raise InputError(
            f"{folder} {state}: files in {', '.join(SUFFIXES)}, MT Manager .txt or bags of ROS 2 are expected in it or "
            "in the folders below it (hidden ones do not count). Check the path, or `gyronorth convert` yours first."
        )
    return sorted(found, key=_natural)


def _natural(path: Path) -> tuple[object, ...]:
    """x_8.0.csv before x_15.0.csv: runs of digits count as numbers."""
    import re

    return tuple((int(part), part) if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", str(path)) if part)


def _sniffed(path: Path) -> str:
    """The format that the content of a file shows; CSV if it shows none."""
    head = _head(path)
    if head.startswith(b"PK\x03\x04"):
        return "npz"
    if head.startswith(b"MATLAB "):
        return "mat"
    if head.startswith(HDF5_SIGNATURE):
        return "hdf5"
    if head.startswith(b"PAR1"):
        return "parquet"
    if head.startswith(b"#ROSBAG "):
        return "rosbag1"
    if head.startswith(b"\x89MCAP"):
        return "mcap"
    if b"PSINS" in head:
        return "psins"
    if head.startswith(b"//") or b"PacketCounter\t" in head:
        return "mt-manager"
    return "frames" if recognise(_head(path, LOOK)) else "csv"


def _head(path: Path, size: int = 4096) -> bytes:
    with path.open("rb") as file:
        return file.read(size)
