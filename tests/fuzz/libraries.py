"""What libraries of others write: seismic records, data of R, MATLAB 7.3, Arrow, bags and MCAP as ROS makes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.feather
import pymseed
import rdata
from ros_files import Writer1, cdr, ros1, samples, write_bag1, write_bag2, write_mcap

Options = dict[str, Any]
Bases = list[tuple[str, bytes, Options]]

FLU = np.array([1, -1, -1])
START = "2024-03-01T12:00:00Z"


def foreign(folder: Path, gyro: np.ndarray, accel: np.ndarray, si: Options) -> Bases:
    """File name, content and declarations of each; one sample a second."""
    return [*_seismic(gyro, accel, si), *_of_r(folder, gyro, accel, si), *_hdf5(folder, gyro, accel, si),
            *_arrow(folder, gyro, accel, si), *_ros(folder, gyro, accel, si)]  # fmt: skip


def _seismic(gyro: np.ndarray, accel: np.ndarray, si: Options) -> Bases:
    """Records of miniSEED, packed and not."""
    found: Bases = []
    codes = ("J_1", "J_2", "J_3", "N_1", "N_2", "N_3")
    for version, encoding in ((2, pymseed.DataEncoding.STEIM2), (3, pymseed.DataEncoding.INT32)):
        traces = pymseed.MS3TraceList()
        for code, values in zip(codes, (*gyro.T / 1e-9, *accel.T / 1e-6), strict=True):
            counts = np.round(values).astype(np.int32)
            traces.add_data(f"FDSN:XX_ROT_00_L_{code}", counts, "i", 1.0, starttime_str=START)
        content = b"".join(traces.generate(max_record_length=512, encoding=encoding, format_version=version))
        found.append((f"station{version}.mseed", content, {"gyro_scale": 1e-9, "accel_scale": 1e-6, **si}))
    return found


def _of_r(folder: Path, gyro: np.ndarray, accel: np.ndarray, si: Options) -> Bases:
    """One object and several, in the binary form and in that of text, packed and not."""
    timed = {**si, "time_unit": "s"}
    held = {"t": np.arange(len(gyro), dtype=float), "gyro": gyro, "accel": accel}
    rdata.write_rds(folder / "list.rds", held, compression=None)
    rdata.write_rds(folder / "text.rds", held, compression=None, file_format="ascii")
    rdata.write_rda(folder / "plain.rda", {**held, "note": "text"}, compression=None)
    rdata.write_rda(folder / "packed.rda", held, compression="gzip")
    return [(name, (folder / name).read_bytes(), timed) for name in ("list.rds", "text.rds", "plain.rda", "packed.rda")]


def _hdf5(folder: Path, gyro: np.ndarray, accel: np.ndarray, si: Options) -> Bases:
    """Groups and packed chunks; and a struct of MATLAB 7.3: transposed, below 512 bytes of text."""
    timed = {**si, "time_unit": "s"}
    time = np.arange(len(gyro), dtype=float)
    with h5py.File(folder / "groups.h5", "w", libver="latest") as file:
        group = file.create_group("imu")
        for name, values in {"t": time, "gyro": gyro, "accel": accel}.items():
            group.create_dataset(name, data=values, chunks=True, compression="gzip", shuffle=True, fletcher32=True)
            group[name].attrs["note"] = "text"
    with h5py.File(folder / "matlab73.mat", "w", userblock_size=512) as file:
        for name, values in {
            "imu/t": time[:, None],
            "imu/wb": gyro,
            "imu/fb": accel,
            "imu/freq": np.ones((1, 1)),
        }.items():
            file[name] = values.T
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    with (folder / "matlab73.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    return [
        ("groups.h5", (folder / "groups.h5").read_bytes(), timed),
        ("matlab73.mat", (folder / "matlab73.mat").read_bytes(), si),
    ]


def _arrow(folder: Path, gyro: np.ndarray, accel: np.ndarray, si: Options) -> Bases:
    """A table of Feather, packed and not."""
    names = ("t", "gx", "gy", "gz", "ax", "ay", "az")
    table = pa.table(dict(zip(names, [np.arange(len(gyro), dtype=float), *gyro.T, *accel.T], strict=True)))
    found: Bases = []
    for name, packed in (("plain.feather", "uncompressed"), ("packed.feather", "zstd")):
        pyarrow.feather.write_feather(table, folder / name, compression=packed)
        found.append((name, (folder / name).read_bytes(), {**si, "time_unit": "s"}))
    return found


def _ros(folder: Path, gyro: np.ndarray, accel: np.ndarray, si: Options) -> Bases:
    """Bags of both versions, packed and not, and MCAP in and without chunks."""
    taken = samples(gyro * FLU, accel * FLU, 1.0)
    one, two = ([(sample[0], write(sample)) for sample in taken] for write in (ros1, cdr))
    latitude = {"latitude": si["latitude"]}
    for packed in Writer1.CompressionFormat:
        write_bag1(folder / f"{packed.name.lower()}.bag", {"/imu": one}, compression=packed, chunk=4096)
    write_bag2(folder / "bag2", {"/imu": two})
    next((folder / "bag2").glob("*.db3")).rename(folder / "alone.db3")
    write_mcap(folder / "chunks.mcap", {"/imu": two}, chunk_size=4096)
    write_mcap(folder / "bare.mcap", {"/imu": one}, encoding="ros1", use_chunking=False)
    names = [f"{packed.name.lower()}.bag" for packed in Writer1.CompressionFormat]
    return [
        (name, (folder / name).read_bytes(), latitude) for name in (*names, "alone.db3", "chunks.mcap", "bare.mcap")
    ]
