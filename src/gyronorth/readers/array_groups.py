"""A group for each sensor in files of named arrays, with a clock of its own: gyroscope/data, gyroscope/timestamps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from gyronorth.readers.array_names import TIME_ARRAYS
from gyronorth.readers.arrays import Column
from gyronorth.readers.joining import joined
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import FORCES, RATES, TIME, Source
from gyronorth.readers.titles import take_apart


def of_groups(
    there: Mapping[str, Column], options: ReadOptions, mark: str, read: Callable[[ReadOptions], Source]
) -> Source | None:
    """The groups of a gyroscope and of an accelerometer joined on time; None where there are no such two.

    Parameters
    ----------
    there : mapping
        Every column by title.
    options : ReadOptions
        Declarations.
    mark : str
        What stands between a group and what is in it.
    read : callable
        Reads the columns that options declare.
    """
    if options.columns or options.variable or options.needed != RATES:
        return None
    found: dict[str, list[dict[str, str]]] = {"gyro": [], "accel": []}
    groups = dict.fromkeys(column.array.rpartition(mark)[0] for column in there.values())
    for group in groups:
        kind = take_apart(f"{group.rpartition(mark)[2]} x").kind
        inside = {title: column for title, column in there.items() if column.array.rpartition(mark)[0] == group}
        if kind in found and (columns := _triad(inside, RATES if kind == "gyro" else FORCES, mark)):
            found[kind].append(columns)
    if not len(found["gyro"]) == len(found["accel"]) == 1:
        return None
    # What is not of a group is declared as not there: a title may say that it is.
    gyro = read(replace(options, columns=found["gyro"][0] | dict.fromkeys(FORCES, "-")))
    accel = read(replace(options, columns=found["accel"][0] | dict.fromkeys(RATES, "-"), needed=FORCES))
    return joined(gyro, accel, drop_bad_rows=options.drop_bad_rows)


def _triad(inside: Mapping[str, Column], ours: tuple[str, ...], mark: str) -> dict[str, str] | None:
    """The three axes and the clock of a group by title; None where it has not just one of either."""
    last = {title: title.rpartition(mark)[2] for title in inside}
    times = [title for title, column in inside.items() if _is_time(column, last[title])]
    axes = [[t for t in inside if t not in times and take_apart(last[t]).axis == axis] for axis in range(3)]
    matrices = [column.array for column in inside.values()]
    whole = [array for array in dict.fromkeys(matrices) if matrices.count(array) == len(ours)]
    if len(whole) == 1:
        titles = [title for title, column in inside.items() if column.array == whole[0]]
    elif all(len(each) == 1 for each in axes):
        titles = [each[0] for each in axes]
    else:
        return None
    return {TIME: times[0], **dict(zip(ours, titles, strict=True))} if len(times) == 1 else None


def _is_time(column: Column, name: str) -> bool:
    part = take_apart(name, column.unit)
    return part.axis is None and (name.lower() in TIME_ARRAYS or part.kind == "time")
