"""What lies within a recording or beside it: a sheet, the list of a bag, tables that are gone on with, sentences."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Iterator
from functools import partial, reduce
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from fuzz.oracle import Target

import gyronorth
from gyronorth.estimate import HeadingEstimate
from gyronorth.live.position import latitude_of
from gyronorth.many.table import HEADINGS, table

LATITUDE = 0.5604


def beside(bases: list[tuple[str, bytes, Any]], folder: Path) -> Iterator[Target]:
    """The targets; they write to `folder`."""
    if bases:
        yield from _members(
            bases, folder, "sheet.xlsx", ("xl/worksheets/sheet1.xml", "xl/workbook.xml", "xl/styles.xml")
        )
        yield from _members(bases, folder, "foreign.npz", ("gyro.npy", "t.npy"))
        yield _bag_folder(folder)
    yield from _tables(folder)
    yield _position()


def _members(
    bases: list[tuple[str, bytes, Any]], folder: Path, name: str, members: tuple[str, ...]
) -> Iterator[Target]:
    """Files in an archive, whose checksums are those of the damaged ones."""
    content, declared = next((content, declared) for each, content, declared in bases if each == name)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        honest = {member: archive.read(member) for member in archive.namelist()}
    for member in members:

        def heading(changed: bytes, member: str = member) -> HeadingEstimate:
            path = folder / f"within-{name}"
            with zipfile.ZipFile(path, "w") as archive:
                for each, content in {**honest, member: changed}.items():
                    archive.writestr(each, content)
            return gyronorth.heading(gyronorth.read(path, **declared), latitude=LATITUDE, method="mean")

        kind = "text" if member.endswith(".xml") else "binary"
        yield Target(f"within-{Path(member).name}".replace(".", "-"), kind, partial(bytes, honest[member]), heading)


def _bag_folder(folder: Path) -> Target:
    """The list that a bag of ROS 2 keeps of itself, in YAML."""
    from ros_files import cdr, samples, write_bag2

    gyro, accel = np.full((64, 3), 5e-5), np.tile([0.0, 0.0, 9.8], (64, 1))
    bag = write_bag2(folder / "listed", {"/imu": [(each[0], cdr(each)) for each in samples(gyro, accel, 1.0)]})
    path = bag / "metadata.yaml"

    def use(content: bytes) -> HeadingEstimate:
        path.write_bytes(content)
        return gyronorth.heading(gyronorth.read(bag, latitude=LATITUDE), method="mean")

    return Target("bag-list", "text", partial(bytes, path.read_bytes()), use)


def _tables(folder: Path) -> Iterator[Target]:
    """A table that was finished, and one that was not, with which another run goes on."""
    recording = folder / "of-table.csv"
    gyronorth.write(gyronorth.simulate("sdc500", latitude=LATITUDE, heading=0.7, duration=64.0, rate_hz=1.0,
                                       rng=np.random.default_rng(1)), recording)  # fmt: skip
    found = [*gyronorth.heading_many(recording, method="mean"), *gyronorth.heading_many(folder / "none.csv")]
    settings = found[0].settings

    def goes_on(path: Path, given: Path) -> Callable[[bytes], None]:
        def use(content: bytes) -> None:
            given.write_bytes(content)
            try:
                with table(path, settings, resume=True, columns=HEADINGS) as made:
                    made.done()
                    made.finish([found[0].file])
            finally:
                for each in (path, path.with_name(f"{path.name}.partial")):
                    each.unlink(missing_ok=True)

        return use

    for suffix in (".csv", *((".parquet",) if find_spec("pyarrow") else ())):
        path = folder / f"table{suffix}"
        partial_path = path.with_name(f"{path.name}.partial")
        with table(path, settings) as made:
            made.add(found[:1])
            begun = partial_path.read_bytes()
            made.finish([each.file for each in found])
        kind = "text" if suffix == ".csv" else "binary"
        yield Target(f"table-{suffix[1:]}", kind, partial(bytes, path.read_bytes()), goes_on(path, path))
        yield Target(f"partial-{suffix[1:]}", "text", partial(bytes, begun), goes_on(path, partial_path))


def _position() -> Target:
    """Sentences of a receiver."""

    def take(content: bytes) -> None:
        for line in content.split(b"\n"):
            # The sum of a damaged sentence is made right: what is in it is then looked at.
            body = line.strip().removeprefix(b"$").split(b"*")[0]
            told = reduce(lambda total, byte: total ^ byte, body, 0)
            latitude = latitude_of(b"$%b*%02X" % (body, told))
            assert latitude is None or abs(latitude) <= np.pi / 2

    gga = b"GPGGA,120000.00,5224.5512,N,01305.0000,E,4,12,0.6,40.0,M,45.0,M,1.0,0123"
    rmc = b"GNRMC,120000.00,A,5224.5512,S,01305.0000,E,0.0,0.0,010524,,,R,V"
    return Target("position", "text", partial(bytes, b"$%b*00\r\n$%b*00\r\n" % (gga, rmc)), take)
