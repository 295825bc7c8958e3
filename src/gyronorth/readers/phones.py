"""Tables of phones in which the acceleration stands in two parts, without gravity and gravity alone.

Apple's `userAcceleration` and `gravity` [1]_ are in g and point the way that the phone is pulled, `gravity` down at
rest: the specific force is the sum with its sign turned. So is the raw acceleration of Apple's accelerometer, as
SensorLog writes it. Android's linear acceleration and gravity [2]_ are in m/s^2, and their sum is the specific force.

References
----------
.. [1] Apple, "CMDeviceMotion": gravity, userAcceleration; "CMAccelerometerData".
.. [2] Android, "Motion sensors": acceleration = gravity + linear acceleration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence, Set
from functools import partial

import numpy as np

from gyronorth.readers.fields import is_number, lines_below_titles, split
from gyronorth.readers.sentences import Rewriting
from gyronorth.readers.titles import Title, take_apart

#: Words of the part without gravity -> sign of the sum; Apple's raw acceleration in files of SensorLog.
PARTS = (("user", -1.0), ("linear", 1.0), ("lin", 1.0))
SENSOR_LOG = "accelerometerAcceleration"
#: With both, the preset of SensorLog applies, which turns the sign itself.
OF_A_PRESET = (SENSOR_LOG, "gyroRotation")
_ACCELERATION = frozenset(("acceleration", "accel", "acc"))
#: g of a gravity in g, rows that are looked at at least.
ONE_G, FEWEST = (0.9, 1.1), 3


def rewriting_of_parts(lines: Sequence[bytes]) -> Rewriting | None:
    """What writes such a table with a specific force; None of another.

    Parameters
    ----------
    lines : sequence of bytes
        The first lines, not blank: titles and rows.
    """
    texts = [line.decode(errors="replace") for line in lines]
    delimiter = max((",", ";", "\t"), key=texts[0].count)
    titles, *rows = (split(text, delimiter) for text in texts)
    rows = [row for row in rows if len(row) == len(titles)]
    if len(titles) < 6 or len(rows) < FEWEST or all(any(title.startswith(s) for title in titles) for s in OF_A_PRESET):
        return None
    parts = [take_apart(title) for title in titles]
    raw = [i for i, title in enumerate(titles) if title.startswith(SENSOR_LOG) and parts[i].unit == "g"]
    found = _in_parts(parts, rows) or ([(-1.0, (i,)) for i in raw] if len(raw) == 3 else None)
    if found is None:
        return None
    unit = "g" if found[0][0] < 0 else parts[found[0][1][0]].unit or ""
    kept = [i for i, part in enumerate(parts) if part.kind != "accel" and not any(i in at for _, at in found)]
    named = [*(titles[i] for i in kept), *(f"specific force {axis} ({unit})".removesuffix(" ()") for axis in "XYZ")]
    return partial(_summed, titles=named, width=len(titles), kept=kept, found=found, delimiter=delimiter)


def _in_parts(parts: Sequence[Title], rows: Sequence[Sequence[str]]) -> list[tuple[float, tuple[int, ...]]] | None:
    """Sign and columns of the sum of each axis; None where there are no such parts."""
    gravity = _triple(parts, lambda words: "gravity" in words)
    for word, sign in PARTS:
        rest = _triple(parts, lambda words, word=word: word in words and not _ACCELERATION.isdisjoint(words))
        if gravity is None or rest is None:
            continue
        cells = [[row[i] for i in gravity] for row in rows if all(is_number(row[i]) for i in gravity)]
        norm = np.median(np.linalg.norm(np.array(cells, dtype=float), axis=1)) if cells else 0.0
        others = [i for i, part in enumerate(parts) if part.kind == "accel" and i not in rest]
        if sign > 0 and others:  # the sum stands there too
            continue
        if sign > 0 or ONE_G[0] < norm < ONE_G[1]:
            return [(sign, pair) for pair in zip(rest, gravity, strict=True)]
    return None


def _triple(parts: Sequence[Title], wanted: Callable[[Set[str]], bool]) -> tuple[int, int, int] | None:
    """The only columns x, y, z whose words are wanted."""
    at = [[i for i, part in enumerate(parts) if part.axis == axis and wanted(set(part.words))] for axis in range(3)]
    return (at[0][0], at[1][0], at[2][0]) if all(len(each) == 1 for each in at) else None


def _summed(
    pieces: Iterable[bytes], *, titles: Sequence[str], width: int, kept: Sequence[int],
    found: Sequence[tuple[float, tuple[int, ...]]], delimiter: str,
) -> Iterator[bytes]:  # fmt: skip
    """The table with the sums behind its other columns; a row that is not whole stays as it is."""
    yield (delimiter.join(f'"{title}"' for title in titles) + "\n").encode()
    for lines in lines_below_titles(pieces):
        out = []
        for line in lines:
            row = split(line, delimiter)
            try:
                sums = [repr(sign * sum(float(row[i]) for i in at)) for sign, at in found] if len(row) == width else []
            except ValueError:
                sums = []
            out.append(delimiter.join([*(f'"{row[i]}"' for i in kept), *sums]) if sums else line)
        if out:
            yield ("\n".join(out) + "\n").encode()
