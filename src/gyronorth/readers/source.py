"""What a format reader hands over: the facts of a file and its rows in blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gyronorth.frozen import frozen
from gyronorth.recording import Gap, Note

#: The columns of a recording by our names: time, angular rate, specific force.
TIME = "t"
RATES = ("w_x", "w_y", "w_z")
FORCES = ("f_x", "f_y", "f_z")
NAMES = (TIME, *RATES, *FORCES)
#: What a unit says of its own samples: an output is at the end of its range, is not to be trusted.
FLAGS = ("saturated", "sensor_fault")


@frozen
class Facts:
    """What is known of a file: stated in it, or usual for its format. Angles in rad."""

    rate_hz: float | None = None  # Hz
    gyro_unit: str | None = None  # of `options.GYRO_UNITS`
    accel_unit: str | None = None  # of `options.ACCEL_UNITS`
    gyro_scale: float | None = None  # units in one number of the file
    accel_scale: float | None = None
    axes: str | None = None  # as in `axes.mat_bf`
    axes_assumed: str | None = None  # the same, where nobody had said so before the file was written
    increments: bool | str = False  # values are per sample, not per second; "gyro" or "accel": of that sensor alone
    latitude: float | None = None  # rad
    heading_true: float | None = None  # rad
    session: str | None = None
    start_time_utc: str | None = None
    samples: int | None = None  # number of rows the file should hold
    rows_dropped: int = 0  # rows that were left out before the file was written
    gaps: tuple[Gap, ...] = ()  # gaps that were bridged before the file was written
    warnings: tuple[tuple[str, float | None], ...] = ()  # code and value of what was said of it before it was written


@frozen
class Bad:
    """Rows that cannot be used: their numbers, and the reasons of the first few."""

    rows: NDArray[np.int64]  # (k,) row numbers as the user counts them
    reasons: tuple[tuple[int, str], ...] = ()  # (row, reason)

    @classmethod
    def none(cls) -> Bad:
        """No bad row."""
        return cls(np.zeros(0, dtype=np.int64))


#: How many bad rows are described one by one.
DESCRIBED = 5


@frozen
class Block:
    """Consecutive rows of a file."""

    values: NDArray[np.float64]  # (m, k) numbers, columns as `Source.columns`
    rows: NDArray[np.int64]  # (m,) row numbers as the user counts them
    bad: Bad  # rows between these that do not hold the right number of numbers
    share: float = 0.0  # of the file that is read with this block; 0 where it cannot be told
    flags: NDArray[np.bool_] | None = None  # (m, 2) what the unit says of the rows, as `FLAGS`
    cut_off: bool = False  # the file of a live recording ends in the middle of a line, which is left out


@frozen
class Clock:
    """How the column `t` counts time."""

    unit: float | None  # s per unit; None: it counts samples, the rate must come from elsewhere
    wrap: float | None = None  # the value at which it starts again from 0
    name: str = TIME  # its name in the file, for messages
    zero: float = 0.0  # s, added to its times before they are compared with another clock's
    known: bool = False  # whether the unit is declared or stated, not assumed
    step: float | None = None  # from sample to sample, where what counts them gives it; None: to be measured


@frozen
class Parts:
    """A file that can be looked into without reading all of it."""

    rows: int  # in the whole file
    exact: bool  # whether that many; else about
    block: int  # rows, about, that one look takes
    read: Callable[[float], Block]  # the rows at a share of the file, 0: the first ones, 1: the last ones


@frozen
class Question:
    """Something that a file leaves open: what is seen of it, and the options that would settle it."""

    says: str  # a sentence
    options: tuple[str, ...]  # as the command line takes them
    certain: bool = True  # whether physics tells so; else they are the likeliest


@frozen
class Source:
    """An opened recording, before any check of its values."""

    format: str  # name of the format
    name: str  # of the file, for messages
    columns: tuple[str, ...]  # names (of NAMES) of the columns of each block
    blocks: Callable[[], Iterator[Block]]  # starts reading; each block of bounded size
    stated: Facts  # what the file says: a contradiction with a declaration is an error
    usual: Facts = Facts()  # what its format implies: a declaration overrules it
    clock: Clock | None = None  # meaning of column t; None when there is none
    ours: bool = False  # written by gyronorth, in SI
    decoded: bool = False  # from frames, in SI: declared units and increments belong to their decoding
    axes_defined: bool = False  # the usual axes are those that the format defines, not a mere habit
    truth_follows_axes: bool = False  # the true heading belongs to the usual axes alone
    topic: str | None = None  # where the messages come from, in a bag or an MCAP file
    notes: tuple[Note, ...] = ()  # remarks on how the file is read
    remarks: Callable[[], tuple[Note, ...]] = tuple  # further ones, on the blocks that are read up to now
    parts: Parts | None = None  # None: it can only be read as a whole
    questions: tuple[Question, ...] = ()  # what must be declared before it can be read
    read_as: str = ""  # what each column was taken for, for people
    held: object = None  # what must live for as long as it is read


def rows_block(values: NDArray[np.float64], before: int, *, share: float = 0.0) -> Block:
    """Good rows (m, k) behind the first `before` ones of a file, counted from 1."""
    return Block(values, np.arange(before + 1, before + 1 + len(values)), Bad.none(), share)


def blocks_of(parts: Iterable[NDArray[np.float64]], count: int) -> Iterator[Block]:
    """Consecutive good rows of a file of about `count` rows as blocks, each with the share that has been read."""
    row = 0
    for values in parts:
        yield rows_block(values, row, share=min(1.0, (row + len(values)) / max(count, 1)))
        row += len(values)
