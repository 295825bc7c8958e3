"""Gyroscope and accelerometer from two files or two topics, as one recording on the gyroscope's clock.

The force at each of its times is a straight line between the accelerometer's samples, at the ends the nearest one;
where no sample is within `NEAR` the row is bad. Without clocks the rows belong together one by one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.options import ReadOptions, increments_of
from gyronorth.readers.source import DESCRIBED, FORCES, RATES, TIME, Bad, Block, Source

#: Longest time from a gyroscope's sample to an accelerometer's, s: a unit at rest feels the same until then.
NEAR = 0.5
#: What a gyroscope's file and an accelerometer's have in their names.
_GYRO = re.compile(r"gyr(?:o(?:scope)?)?(?![a-z])", re.IGNORECASE)
_ACCEL = ("acc", "accel", "acceleration", "accelerometer")


def accelerometer_beside(gyro: Path) -> Path | None:
    """The file in the same folder that is named as a gyroscope's is, but for an accelerometer; None without just one.

    gyro-0.csv has accel-0.csv beside it, Gyroscope.csv Accelerometer.csv.
    """
    match = _GYRO.search(gyro.stem)
    if match is None or not gyro.is_file():
        return None
    before, after = gyro.name[: match.start()], gyro.name[match.end() :]
    words = {form(word) for word in _ACCEL for form in (str.lower, str.capitalize, str.upper)}
    found = [path for word in sorted(words) if (path := gyro.with_name(before + word + after)).is_file()]
    same = {path.stat().st_ino for path in found}  # on file systems that do not tell capitals apart
    return found[0] if len(same) == 1 else None


def options_of_two(options: ReadOptions) -> tuple[ReadOptions, ReadOptions]:
    """What is declared of a gyroscope's file, and of the accelerometer's that is joined with it."""
    columns = dict(options.columns or {})
    rates = {name: column for name, column in columns.items() if name not in FORCES}
    forces = {name: column for name, column in columns.items() if name in FORCES}
    if str(columns.get(TIME, "")) == "-" or str(columns.get(TIME, "")).isdigit():
        forces[TIME] = columns[TIME]
    alone = replace(options, accel_file=None)
    others = replace(alone, columns=forces or None, needed=FORCES, variable=None, topic=None, format=None)
    return replace(alone, columns=rates or None), others


def joined(gyro: Source, accel: Source, *, drop_bad_rows: bool = False) -> Source:
    """One recording of a gyroscope's source and an accelerometer's.

    Parameters
    ----------
    gyro : Source
        Angular rates; forces in it are left out.
    accel : Source
        Forces.
    drop_bad_rows : bool, optional
        Leave out rows of the accelerometer that cannot be used.

    Raises
    ------
    InputError
        If they contradict each other; while reading also if their times have nothing in common.
    """
    ours, theirs = gyro.stated.axes or gyro.usual.axes, accel.stated.axes or accel.usual.axes
    if ours and theirs and ours != theirs:
        raise InputError(
            f"{gyro.name} has axes {ours} and {accel.name} {theirs}: bring them to the same first, with gyronorth "
            "convert for each that holds a gyro, or in the program that wrote them."
        )
    timed = all(source.clock is not None and source.clock.unit is not None for source in (gyro, accel))
    if not timed and (gyro.clock is None) != (accel.clock is None):
        without = gyro if gyro.clock is None else accel
        raise InputError(
            f"{without.name} has no clock, but the other file has: they cannot be joined on time. Leave the clock out "
            "of both, --columns t=- with --rate HZ, if their rows belong together one by one."
        )
    if accel.stated.rate_hz and gyro.stated.rate_hz and not timed and accel.stated.rate_hz != gyro.stated.rate_hz:
        raise InputError(
            f"{gyro.name} states {gyro.stated.rate_hz:g} Hz and {accel.name} {accel.stated.rate_hz:g} Hz, and they "
            "have no clock in common: their rows do not belong together."
        )
    how = "on time, by straight lines between its samples" if timed else "row by row"
    return replace(
        gyro,
        columns=(*(name for name in (TIME, *RATES) if name in gyro.columns), *FORCES),
        blocks=lambda: _blocks(gyro, accel, timed=timed, drop_bad_rows=drop_bad_rows),
        stated=replace(
            gyro.stated,
            accel_unit=accel.stated.accel_unit,
            accel_scale=accel.stated.accel_scale,
            axes=gyro.stated.axes or accel.stated.axes,
            increments=_increments(gyro, accel),
        ),
        usual=replace(
            gyro.usual,
            accel_unit=accel.usual.accel_unit,
            accel_scale=accel.usual.accel_scale,
            axes=gyro.usual.axes or accel.usual.axes,
            increments=False,
        ),
        notes=gyro.notes + accel.notes,
        parts=None,
        questions=(*gyro.questions, *(each for each in accel.questions if each not in gyro.questions)),
        read_as=f"{gyro.read_as}; acceleration of {accel.topic or accel.name} joined {how}".removeprefix("; "),
        held=(gyro.held, accel.held),
    )


def _increments(gyro: Source, accel: Source) -> str | bool:
    """Which of the two hold increments, as `Facts` says it."""
    held = [
        sensor
        for sensor, source in (("gyro", gyro), ("accel", accel))
        if sensor in increments_of(source.stated.increments) | increments_of(source.usual.increments)
    ]
    return "both" if len(held) == 2 else held[0] if held else False


def _blocks(gyro: Source, accel: Source, *, timed: bool, drop_bad_rows: bool) -> Iterator[Block]:
    zeros = [source.clock.zero if source.clock is not None else 0.0 for source in (gyro, accel)]
    forces = _Forces(accel, zeros[1] - zeros[0], drop_bad_rows=drop_bad_rows)
    unit = gyro.clock.unit if gyro.clock is not None and gyro.clock.unit is not None else 1.0
    keep = [gyro.columns.index(name) for name in (TIME, *RATES) if name in gyro.columns]
    matched = 0
    for block in gyro.blocks():
        if timed:
            force, near = forces.at(block.values[:, gyro.columns.index(TIME)] * unit)
        else:
            force = forces.next(len(block.values), gyro.name)
            near = np.ones(len(force), dtype=bool)
        matched += int(near.sum())
        values = np.hstack([block.values[:, keep], force])
        if near.all():
            yield replace(block, values=values)
            continue
        reasons = [
            (int(row), f"{accel.name} has no sample within {NEAR:g} s of it") for row in block.rows[~near][:DESCRIBED]
        ]
        bad = np.sort(np.concatenate([block.bad.rows, block.rows[~near]]))
        described = tuple(sorted([*block.bad.reasons, *reasons])[:DESCRIBED])
        yield replace(block, values=values[near], rows=block.rows[near], bad=Bad(bad, described))
    if timed and not matched:
        raise InputError(
            f"The times of {gyro.name} and {accel.name} have nothing in common ({forces.span}): they are not of one "
            "recording, or their clocks begin apart."
        )
    if not timed:
        forces.end(gyro.name)


class _Forces:
    """The accelerometer's rows, read as far as they are needed."""

    def __init__(self, accel: Source, offset: float, *, drop_bad_rows: bool) -> None:
        self._source, self._offset, self._drop = accel, offset, drop_bad_rows
        self._blocks = accel.blocks()
        self._columns = [accel.columns.index(name) for name in FORCES]
        self._time = np.zeros(0)  # (k,) s, of the rows held
        self._force = np.zeros((0, 3))
        self._first: float | None = None
        self._ended = False

    @property
    def span(self) -> str:
        """The times read, for a message."""
        return "it holds none" if self._first is None else f"those of {self._source.name} begin at {self._first:.10g} s"

    def at(self, time: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Forces (n, 3) at times (n,), and which of these have a sample near."""
        finite = time[np.isfinite(time)]
        if len(finite) == 0:
            return np.zeros((len(time), 3)), np.ones(len(time), dtype=bool)
        while not self._ended and (len(self._time) == 0 or self._time[-1] < finite.max()):
            self._read()
        if len(self._time) == 0:
            return np.full((len(time), 3), np.nan), np.zeros(len(time), dtype=bool)
        force = np.stack([np.interp(time, self._time, column) for column in self._force.T], axis=1)
        after = np.searchsorted(self._time, time).clip(0, len(self._time) - 1)
        distance = np.minimum(abs(self._time[after] - time), abs(self._time[np.maximum(after - 1, 0)] - time))
        old = max(int(np.searchsorted(self._time, finite.min() - 2 * NEAR)) - 1, 0)
        self._time, self._force = self._time[old:], self._force[old:]
        return force, ~(distance > NEAR)  # a time that is not finite is another one's complaint

    def next(self, count: int, gyro: str) -> NDArray[np.float64]:
        """The next `count` forces, shape (count, 3)."""
        while not self._ended and len(self._force) < count:
            self._read()
        if len(self._force) < count:
            raise InputError(self._uneven(gyro))
        force, self._force = self._force[:count], self._force[count:]
        return force

    def end(self, gyro: str) -> None:
        """Complain of rows that are left over."""
        if not self._ended and len(self._force) == 0:
            self._read()
        if len(self._force):
            raise InputError(self._uneven(gyro))

    def _uneven(self, gyro: str) -> str:
        return (
            f"{self._source.name} and {gyro} have no clock and differ in the number of their rows, which therefore do "
            "not belong together one by one. Name their time columns: --columns t=NAME."
        )

    def _read(self) -> None:
        block = next(self._blocks, None)
        if block is None:
            self._ended = True
            return
        if len(block.bad.rows) and not self._drop:
            row, why = block.bad.reasons[0]
            raise InputError(
                f"Row {row} of {self._source.name}: {why}. Repair the file, or pass --drop-bad-rows to leave such "
                "rows out."
            )
        values = block.values
        clock = self._source.clock
        if clock is not None and clock.unit is not None:
            time = values[:, self._source.columns.index(TIME)] * clock.unit + self._offset
            usable = np.isfinite(time)
            time, values = time[usable], values[usable]
            before = np.concatenate([self._time[-1:], time])
            if (np.diff(before) < 0).any():
                i = int(np.argmax(np.diff(before) < 0))
                raise InputError(
                    f"{clock.name} of {self._source.name} runs backwards, from {before[i]:.10g} to "
                    f"{before[i + 1]:.10g} s; a clock that runs on is needed to join it. Put its rows in order of time."
                )
            self._time = np.concatenate([self._time, time])
            self._first = float(time[0]) if self._first is None and len(time) else self._first
        self._force = np.concatenate([self._force, values[:, self._columns]])
