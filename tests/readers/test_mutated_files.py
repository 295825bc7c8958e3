"""10,000 damaged files over all formats: each ends in a heading, a refusal or one clear error.

Every format has one or two small base files. A mutation flips bits, cuts, swaps or repeats
fields, writes huge or odd numbers, or copies a piece elsewhere; it is drawn from the seed
and the file's number alone, so that a failure can be run again by itself.
"""

from __future__ import annotations

import json
import resource
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from fuzz.recordings import LATITUDE, SEED, Options, base_files
from fuzz.running import limited

from gyronorth import heading
from gyronorth.errors import InputError
from gyronorth.readers import read

#: Growth of the process that no damaged size field may cause, KiB.
MEMORY = 1 << 20
ODD_NUMBERS = (
    "nan", "inf", "-inf", "1e308", "-1e400", "1e-320", "0", "-0", "9" * 40, "1e30", "99999999999", "", " ", "-", "0x10",
    "1_000", "1,5", "1;5", "--1", "1e", "NaN", "null", "#", "%", "//", "\t", '"', "'", "\r", "\n", "\x00", "\ufeff",
    "°", "１",
)  # fmt: skip


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


BLANKS, TITLES, SEVEN = " " * 30_000, "t,w_x,w_y,w_z,f_x,f_y,f_z\n", ",1,2,3,4,5,6\n"
ROWS = "".join(f"{k / 10:.1f},1e-5,-2e-5,-3e-5,0.01,0.02,-9.8\n" for k in range(60))
#: Lines on which a pattern that can take a text in many ways tries them all.
ENDLESS = {
    "comment": f"# a: {BLANKS}x{BLANKS}y\n{TITLES}{ROWS}",
    "rate": f"rate 1{BLANKS}a\n{TITLES}{ROWS}",
    "quotes": "# Rate: 1" + '"' * 30_000 + f"a\n{TITLES}{ROWS}",
    "title": TITLES.strip() + "," + "_ " * 30_000 + "\n" + ROWS.replace("-9.8", "-9.8,0"),
    "unit": f"time,gyro x [{BLANKS}x{BLANKS}1.],b,c,d,e,f\n{ROWS}",
    "digits": "time" + TITLES[1:] + f"{'1' * 20_000} days , ,1:00:00{SEVEN}" * 3 + ROWS,
    "clock": "time" + TITLES[1:] + f"1:00:00{BLANKS}x{SEVEN}" * 2 + ROWS,
    "labels": f"a: {'123456 ' * 400}!\n{ROWS}",
    "names": "".join(json.dumps({f"k{i}_{k}": 1 for i in range(90)}) + "\n" for k in range(200)) + "{}\n" * 300_000,
    "nested": '[{"a":' * 100_000,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ENDLESS)
def test_a_line_that_is_made_to_take_for_ever_does_not(name, tmp_path):
    path = tmp_path / "made.txt"
    path.write_text(ENDLESS[name])
    with limited(name), suppress(InputError):
        read(path, gyro_unit="rad/s", accel_unit="m/s2", axes="frd")


@pytest.mark.long
@pytest.mark.parametrize("files", [10_000])
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
            with limited(f"mutation {number} of {name}"):
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
