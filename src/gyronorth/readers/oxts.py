"""Folders `oxts` of KITTI's raw data [1]_: a file for each sample, named by `dataformat.txt`, and their times.

They are written as one table, in the units and axes that the dataset states: rad/s, m/s^2, forward-left-up.

References
----------
.. [1] A. Geiger, P. Lenz, C. Stiller, R. Urtasun, "Vision meets robotics: the KITTI dataset", 2013: ax, ay, az and
   wx, wy, wz in vehicle axes, specific force and angular rate of an OXTS RT3003.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from gyronorth.errors import InputError
from gyronorth.readers.lines import spooled
from gyronorth.readers.spool import Spooled

#: The names of what is read, and files that are written as rows at a time.
NAMES, BATCH = ("wx", "wy", "wz", "ax", "ay", "az"), 4096
HEAD = "# gyro_unit: rad/s\n# accel_unit: m/s2\n# axes: flu\ntime,w_x,w_y,w_z,f_x,f_y,f_z\n"
#: Bytes of a file of one sample, or of names: more is neither.
LARGEST = 1 << 16


def of_oxts(folder: Path) -> Spooled:
    """The samples of such a folder as a table.

    Raises
    ------
    InputError
        If a name is missing, or there are not as many stamps as files.
    """
    named = [line.partition(":")[0].strip() for line in _text(folder / "dataformat.txt").splitlines() if line.strip()]
    missing = [name for name in NAMES if name not in named]
    if missing:
        raise InputError(f"dataformat.txt of {folder} does not name {', '.join(missing)}; it names {', '.join(named)}.")
    at = [named.index(name) for name in NAMES]
    files = sorted((folder / "data").glob("*.txt"))
    stamps = (folder / "timestamps.txt").read_text(encoding="utf-8", errors="replace").split("\n")
    stamps = [stamp.strip() for stamp in stamps if stamp.strip()]
    if len(files) != len(stamps):
        raise InputError(
            f"{folder} has {len(files)} files of samples and {len(stamps)} stamps in timestamps.txt; as many of each "
            "are expected: samples are missing. Copy the folder again."
        )

    def pieces() -> Iterator[bytes]:
        yield HEAD.encode()
        rows = (f"{stamp},{_row(file, at)}\n" for stamp, file in zip(stamps, files, strict=True))
        while some := "".join(islice(rows, BATCH)):
            yield some.encode()

    return spooled(folder / "data", pieces())


def _row(file: Path, at: list[int]) -> str:
    values = _text(file).split()
    return ",".join(values[i] for i in at) if len(values) > max(at) else f"'{file.name} is cut off'"


def _text(file: Path) -> str:
    with file.open(encoding="utf-8", errors="replace") as opened:
        return opened.read(LARGEST)
