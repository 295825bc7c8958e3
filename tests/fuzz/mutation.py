"""Damage: seeded changes of bytes, of numbers in a text, and of values in a JSON document."""

from __future__ import annotations

import copy
import json
import random
import re
from typing import Any

#: What a number or a value is replaced by.
NUMBERS = (
    "nan", "inf", "-inf", "1e308", "-1", "0", "1e-320", "9" * 400, "", "x", "4294967296", "-9223372036854775809",
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, "", [], {}, [[]], -1, 0, 1e308, -1e-320, 10**30, float("nan"), float("inf"), "nan",
    [1, 2], "../x", "\x1b[2J",
)  # fmt: skip
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


def mutated(content: bytes, rng: random.Random, *, kind: str) -> bytes:
    """One of a few damages of a `json`, `text` or `binary` file."""
    if kind == "json" and rng.random() < 0.8:
        return _in_document(content, rng)
    if kind in ("json", "text") and rng.random() < 0.6:
        return _in_text(content, rng)
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 2, 4, 16))):
        place = rng.randrange(len(data) + 1)
        size = rng.choice((1, 2, 4, 8, 64, 1024))
        match rng.randrange(7):
            case 0 if place < len(data):
                data[place] ^= 1 << rng.randrange(8)
            case 1:
                data[place : place + size] = rng.randbytes(min(size, 8))
            case 2:
                data[place : place + size] = rng.choice((b"\x00", b"\xff", b"\x7f")) * min(size, 8)
            case 3:
                del data[place : place + size]
            case 4:
                other = rng.randrange(len(data) + 1)
                data[place:place] = data[other : other + size]
            case 5:
                del data[place if rng.random() < 0.3 else len(data) :]
            case _:  # a length or an offset, near the head or the foot
                near = rng.randrange(min(512, len(data) + 1))
                at = near if rng.random() < 0.5 else max(len(data) - near - 4, 0)
                data[at : at + 4] = rng.choice((1, 0x7FFFFFFF, 0xFFFFFFFF, 0x10000, len(data))).to_bytes(4, "little")
    return bytes(data)


def _in_text(content: bytes, rng: random.Random) -> bytes:
    found = list(_NUMBER.finditer(content))
    for number in sorted(rng.sample(found, min(len(found), rng.choice((1, 1, 3)))), key=lambda m: -m.start()):
        content = content[: number.start()] + rng.choice(NUMBERS).encode() + content[number.end() :]
    return content


def _in_document(content: bytes, rng: random.Random) -> bytes:
    document = json.loads(content)
    for _ in range(rng.choice((1, 1, 2))):
        place: Any = document
        while True:
            keys = list(place) if isinstance(place, dict) else list(range(len(place)))
            if not keys:
                break
            key = rng.choice(keys)
            if isinstance(place[key], dict | list) and place[key] and rng.random() < 0.8:
                place = place[key]
                continue
            match rng.randrange(4):
                case 0:
                    del place[key]
                case 1 if isinstance(place[key], int | float) and not isinstance(place[key], bool):
                    place[key] *= rng.choice((-1, 0, 1e9, 1e-9, 1e300))
                case _:
                    place[key] = copy.deepcopy(rng.choice(VALUES))  # the next change may be within it
            break
    return json.dumps(document).encode()
