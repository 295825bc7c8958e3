"""10,000 damaged files over all formats: each ends in a heading, a refusal or one clear error.

Every format has one or two small base files. A mutation flips bits, cuts, swaps or repeats
fields, writes huge or odd numbers, or copies a piece elsewhere; it is drawn from the seed
and the file's number alone, so that a failure can be run again by itself.
"""

from __future__ import annotations

import gzip
import io
import lzma
import resource
import signal
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pymseed
import pytest
import rdata
import scipy.io
import zstandard

from gyronorth import Recording, heading
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.readers import read, write

SEED = 20240501
#: Damaged files, in every `make test` and in `make long`.
FILES, MANY_FILES = 120, 10_000
#: Longest processor time for one file, s: a thousand times what one takes.
PATIENCE = 60
#: Growth of the process that no damaged size field may cause, KiB.
MEMORY = 1 << 20
ROWS = 120
RATE_HZ = 1.0  # so that few rows last long enough for a valid heading
LATITUDE = radians(32.11)
ODD_NUMBERS = (
    "nan", "inf", "-inf", "1e308", "-1e400", "1e-320", "0", "-0", "9" * 40, "1e30", "99999999999", "", " ", "-", "0x10",
    "1_000", "1,5", "1;5", "--1", "1e", "NaN", "null", "#", "%", "//", "\t", '"', "'", "\r", "\n", "\x00", "\ufeff",
    "°", "１",
)  # fmt: skip

Options = dict[str, Any]


def samples() -> tuple[np.ndarray, np.ndarray]:
    """Angular rate, rad/s, and specific force, m/s^2, of a level body at rest, heading 40 deg."""
    rng = np.random.default_rng(SEED)
    north, down = EARTH_RATE * np.cos(LATITUDE), -EARTH_RATE * np.sin(LATITUDE)
    rate = [north * np.cos(radians(40)), -north * np.sin(radians(40)), down]
    force = [0.0, 0.0, -STANDARD_GRAVITY]
    return rng.normal(rate, 1e-5, (ROWS, 3)), rng.normal(force, 1e-3, (ROWS, 3))


def rows_of(columns: list[np.ndarray], delimiter: str, end: str = "\n") -> str:
    return "".join(delimiter.join(f"{value:.9g}" for value in row) + end for row in np.column_stack(columns))


def base_files(folder: Path) -> list[tuple[str, bytes, Options]]:
    """File name, content and the declarations it needs, for every format."""
    gyro, accel = samples()
    time = np.arange(ROWS) / RATE_HZ
    flu = np.array([1, -1, -1])
    recording = Recording(gyro, accel, RATE_HZ, latitude=LATITUDE, session="one", start_time_utc="2024-05-01T12:00:00Z")
    bases: list[tuple[str, bytes, Options]] = []
    for suffix in (".csv", ".npz"):
        write(recording, folder / f"base{suffix}")
        bases.append((f"ours{suffix}", (folder / f"base{suffix}").read_bytes(), {}))
    mapped = "Time,gx,gy,gz,ax,ay,az,\r\n" + rows_of([time, np.degrees(gyro), accel / STANDARD_GRAVITY], ",", ",\r\n")
    columns = dict(zip(("w_x", "w_y", "w_z", "f_x", "f_y", "f_z"), ("gx", "gy", "gz", "ax", "ay", "az"), strict=True))
    units = {"gyro_unit": "deg/s", "accel_unit": "g", "latitude": LATITUDE}
    bases.append(("mapped.csv", mapped.encode(), {"columns": columns, "time_unit": "s", **units}))
    # The published layout implies 600 Hz: at the declared rate they are as long as the others.
    published = ",w_x,w_y,w_z,f_x,f_y,f_z\n" + rows_of([np.arange(ROWS), np.degrees(gyro), accel], ",")
    bases.append(("x_40.0.csv", published.encode(), {"latitude": LATITUDE, "rate_hz": RATE_HZ}))
    titles = "Time (s);Gyro X (deg/s);Gyro Y (deg/s);Gyro Z (deg/s);Acc X (g);Acc Y (g);Acc Z (g)"
    logger = f"LOGGER 3.2\n\n{titles}\n" + rows_of([time, np.degrees(gyro), accel / STANDARD_GRAVITY], ";")
    axes = {"axes": "frd", "latitude": LATITUDE}
    bases.append(("logger.csv", f"{logger}End of log\n".replace(".", ",").encode(), axes))
    bases.append(("logger16.csv", logger.encode("utf-16"), axes))
    # Right-front-up from forward-right-down, and counts of 0.01 arcsec and 1 ug s.
    turn, push = gyro[:, [1, 0, 2]] * [1, 1, -1], accel[:, [1, 0, 2]] * [1, 1, -1]
    counts = np.hstack([turn / RATE_HZ / (radians(0.01) / 3600), push / RATE_HZ / 9.78e-6])
    psins = "% PSINS-format SIMU log file.\n\n0 0 -40 0 0 0\n32.11 34.8 20 0 1000 9.78\n0.01 0.01 0.01 1 1 1\n"
    psins += rows_of([np.round(counts)], " ")
    bases.append(("psins.imu", psins.encode(), {}))
    counter = (np.arange(ROWS) * 4 + 65500) % 65536
    export = f"// Start Time: Unknown\n// Update Rate: {RATE_HZ}Hz\n"
    export += "PacketCounter\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\n" + rows_of(
        [counter, accel * flu, gyro * flu], "\t"
    )
    bases.append(("export.txt", export.encode(), {"latitude": LATITUDE}))
    table = np.column_stack([time, np.degrees(gyro), accel / STANDARD_GRAVITY])
    matlab: list[dict[str, Any]] = [{"do_compression": True}, {"do_compression": False}]
    for number, how in enumerate(matlab):
        file = io.BytesIO()
        scipy.io.savemat(file, {"note": "text", "data": table}, **how)
        numbers = dict(zip(("t", *columns), range(7), strict=True))
        bases.append(
            (
                f"matlab{number}.mat",
                file.getvalue(),
                {"variable": "data", "columns": numbers, "time_unit": "s", **units},
            )
        )
        file = io.BytesIO()
        structs = {"imu1": {"t": time[:, None], "fb": accel, "wb": gyro, "freq": RATE_HZ, "note": "text"}}
        scipy.io.savemat(file, structs, **how)
        bases.append((f"navego{number}.mat", file.getvalue(), {"latitude": LATITUDE, "axes": "frd"}))
    return bases + boxes(time, gyro, accel, table, units, bases[0][1]) + foreign(folder, time, gyro, accel)


def boxes(
    time: np.ndarray, gyro: np.ndarray, accel: np.ndarray, table: np.ndarray, units: Options, ours: bytes
) -> list[tuple[str, bytes, Options]]:
    """Arrays of NumPy, binary rows, a workbook, packed files and archives."""
    si = {"gyro_unit": "rad/s", "accel_unit": "m/s2", "axes": "frd", "latitude": LATITUDE, "time_unit": "s"}
    names = ("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z")
    found: list[tuple[str, bytes, Options]] = []
    file = io.BytesIO()
    np.save(file, table)
    found.append(
        ("array.npy", file.getvalue(), {"columns": dict(zip(names, range(7), strict=True)), "time_unit": "s", **units})
    )
    file = io.BytesIO()
    np.savez_compressed(file, t=time, gyro=gyro, accel=accel)
    found.append(("foreign.npz", file.getvalue(), si))
    increments = np.column_stack([time + 388800, gyro / RATE_HZ, accel / RATE_HZ])
    found.append(("kfgins.bin", increments.astype("<f8").tobytes(), {"latitude": LATITUDE, "axes": "frd"}))
    book = openpyxl.Workbook()
    book.active.append(names)
    for row in np.column_stack([time, gyro, accel]).tolist():
        book.active.append(row)
    file = io.BytesIO()
    book.save(file)
    found.append(("sheet.xlsx", file.getvalue(), si))
    for suffix, pack in ((".gz", gzip.compress), (".xz", lzma.compress), (".zst", zstandard.compress)):
        found.append((f"packed.csv{suffix}", pack(ours), {}))
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, letter, values in (("Gyroscope.csv", "w", gyro), ("Accelerometer.csv", "f", accel)):
            header = f"t,{letter}_x,{letter}_y,{letter}_z\n"
            archive.writestr(name, header + rows_of([time, values], ","))
    found.append(("phone.zip", file.getvalue(), si))
    return found


def foreign(folder: Path, time: np.ndarray, gyro: np.ndarray, accel: np.ndarray) -> list[tuple[str, bytes, Options]]:
    """What libraries of others decode: records of miniSEED, packed and not, and data of R."""
    found: list[tuple[str, bytes, Options]] = []
    si = {"gyro_unit": "rad/s", "accel_unit": "m/s2", "axes": "frd", "latitude": LATITUDE}
    codes = ("J_1", "J_2", "J_3", "N_1", "N_2", "N_3")
    for version, encoding in ((2, pymseed.DataEncoding.STEIM2), (3, pymseed.DataEncoding.INT32)):
        traces = pymseed.MS3TraceList()
        for code, values in zip(codes, (*gyro.T / 1e-9, *accel.T / 1e-6), strict=True):
            counts = np.round(values).astype(np.int32)
            traces.add_data(f"FDSN:XX_ROT_00_L_{code}", counts, "i", RATE_HZ, starttime_str="2024-03-01T12:00:00Z")
        content = b"".join(traces.generate(max_record_length=512, encoding=encoding, format_version=version))
        found.append((f"station{version}.mseed", content, {"gyro_scale": 1e-9, "accel_scale": 1e-6, **si}))
    rdata.write_rds(folder / "list.rds", {"t": time, "gyro": gyro, "accel": accel}, compression=None)
    found.append(("list.rds", (folder / "list.rds").read_bytes(), {"time_unit": "s", **si}))
    return found


def flip_bits(content: bytearray, rng: np.random.Generator) -> bytearray:
    for place in rng.integers(0, len(content), rng.integers(1, 9)):
        content[place] ^= 1 << int(rng.integers(8))
    return content


def flip_head(content: bytearray, rng: np.random.Generator) -> bytearray:
    """Damage where headers and size fields are: the first and the last 400 bytes."""
    for place in rng.integers(0, min(400, len(content)), rng.integers(1, 5)):
        content[place if rng.random() < 0.5 else -1 - place] = int(rng.integers(256))
    return content


def truncate(content: bytearray, rng: np.random.Generator) -> bytearray:
    cut = int(rng.integers(0, len(content)))
    return content[:cut] if rng.random() < 0.8 else content[cut:]


def move_piece(content: bytearray, rng: np.random.Generator) -> bytearray:
    """Copy, remove or repeat a piece."""
    start, length = int(rng.integers(0, len(content))), int(rng.integers(1, 400))
    piece = content[start : start + length]
    if rng.random() < 0.3:
        return content[:start] + content[start + length :]
    place = int(rng.integers(0, len(content)))
    return content[:place] + piece * int(rng.integers(1, 4)) + content[place:]


def shuffle_fields(content: bytearray, rng: np.random.Generator) -> bytearray:
    """Fields of some lines, or the lines themselves, in another order."""
    lines = bytes(content).split(b"\n")
    if rng.random() < 0.3:
        first = int(rng.integers(0, len(lines)))
        part = lines[first : first + 20]
        lines[first : first + 20] = [part[i] for i in rng.permutation(len(part))]
    else:
        delimiter = next((mark for mark in (b",", b"\t", b" ") if lines[len(lines) // 2].count(mark) > 2), b"\x00")
        for place in rng.integers(0, len(lines), rng.integers(1, 4)):
            fields = lines[place].split(delimiter)
            lines[place] = delimiter.join(fields[i] for i in rng.permutation(len(fields)))
    return bytearray(b"\n".join(lines))


def odd_numbers(content: bytearray, rng: np.random.Generator) -> bytearray:
    """Odd texts in place of words: numbers in text, anything in a binary file."""
    for _ in range(int(rng.integers(1, 4))):
        place = int(rng.integers(0, len(content) + 1))
        end = place + int(rng.integers(0, 12))
        content[place:end] = ODD_NUMBERS[rng.integers(len(ODD_NUMBERS))].encode()
    return content


def huge_bytes(content: bytearray, rng: np.random.Generator) -> bytearray:
    """A 32-bit field, of a size perhaps, near its largest value."""
    place = int(rng.integers(0, max(1, len(content) - 4)))
    content[place : place + 4] = rng.choice([b"\xff\xff\xff\x7f", b"\xff\xff\xff\xff", b"\x00\x00\x00\x40"])
    return content


MUTATIONS: tuple[Callable[[bytearray, np.random.Generator], bytearray], ...] = (
    flip_bits, flip_head, truncate, move_piece, shuffle_fields, odd_numbers, huge_bytes,
)  # fmt: skip


@contextmanager
def limited_time(what: str) -> Iterator[None]:
    def stop(*_: object) -> None:
        raise TimeoutError(f"{what} took more than {PATIENCE} s")

    previous = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, previous)


def outcome(path: Path, options: Options, rng: np.random.Generator) -> str:
    """What comes of a file, as the heading command would use it."""
    try:
        recording = read(path, drop_bad_rows=bool(rng.random() < 0.5), **options)
        estimate = heading(recording, method="mean", latitude=None if recording.latitude is not None else LATITUDE)
    except InputError as error:
        message = str(error)
    else:
        assert estimate.valid == (not estimate.reasons)
        assert estimate.heading is not None
        assert 0 <= estimate.heading < 2 * np.pi
        return "valid" if estimate.valid else "refused"
    assert message
    assert "\x00" not in message
    assert len(message) < 2000, "an error that quotes the file"
    return "error"


@pytest.mark.slow
@pytest.mark.parametrize("files", [FILES, pytest.param(MANY_FILES, marks=pytest.mark.long)])
def test_every_mutated_file_ends_in_a_result_a_refusal_or_one_clear_error(tmp_path: Path, files: int):
    bases = base_files(tmp_path)
    for name, content, options in bases:
        (tmp_path / name).write_bytes(content)
        # The base itself is good: what follows is the mutations' doing.
        assert heading(read(tmp_path / name, **options), latitude=LATITUDE, method="mean").valid, name
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    outcomes = {"error": 0, "valid": 0, "refused": 0}
    for number in range(files):
        name, content, options = bases[number % len(bases)]
        rng = np.random.default_rng([SEED, number])
        mutated = bytearray(content)
        for _ in range(int(rng.integers(1, 3))):
            if mutated:
                mutated = MUTATIONS[rng.integers(len(MUTATIONS))](mutated, rng)
        path = tmp_path / name
        path.write_bytes(mutated)
        try:
            with limited_time(f"mutation {number} of {name}"):
                outcomes[outcome(path, options, rng)] += 1
        except Exception as error:
            raise AssertionError(f"mutation {number} of {name}: {type(error).__name__}: {error}") from error
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown < MEMORY, f"the process grew by {grown >> 10} MiB"
    # All three ends occur: neither are the mutations harmless, nor is everything thrown out at the door.
    assert outcomes["error"] > files / 4, outcomes
    assert outcomes["valid"] > files / 10, outcomes
    # Of the bases nearly half carry checksums, where damage is an error and no heading to refuse.
    assert outcomes["refused"] > files / 200, outcomes
