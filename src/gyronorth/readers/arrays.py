"""Arrays with names, as .mat, .npy, .npz and HDF5 files hold them: which of them are angular rate, force and time.

Every column of numbers has a title for `--columns`: that of an array (n,), NAME[k] of column k of an array (n, m),
NAME.FIELD of a field of records. `--variable` takes one array, whose columns are then called k or FIELD, or one
group of arrays (a struct, a group of HDF5). Without `--columns` these layouts are known:

- one array of angular rates (n, 3) in a group, by its name, with force and time beside it. A struct with `fb`, `wb`
  and `t` is NaveGo's [1]_: rad/s, m/s^2, forward-right-down.
- a matrix `imu` (n, 7) whose last column is time: PSINS [2]_, increments in rad and m/s, right-front-up; or one
  column for each axis, by our names.

References
----------
.. [1] R. Gonzalez, NaveGo, `navego_allan` and `ins_gnss`: structure `imu` (fb m/s^2, wb rad/s, t s, freq Hz).
.. [2] G. Yan, PSINS toolbox: "imu = [wm; vm; t]", increments of angle (rad) and of velocity (m/s), time (s).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.array_names import (
    ACCEL_ARRAYS,
    GYRO_ARRAYS,
    INTERVAL_SCALARS,
    RATE_SCALARS,
    TIME_ARRAYS,
)
from gyronorth.readers.columns import Chosen, by_numbers, by_numbers_of_titles, by_titles, without_sign
from gyronorth.readers.layout import COMPARED, TextLayout
from gyronorth.readers.options import OUR_TITLES, ReadOptions, choose_columns
from gyronorth.readers.source import FORCES, NAMES, RATES, TIME, Clock, Facts, Question
from gyronorth.readers.spellings import ACCEL_SPELLINGS, GYRO_SPELLINGS, TIME_SPELLINGS, spelled
from gyronorth.readers.text_clock import find_clock
from gyronorth.readers.titles import Title, last_part, take_apart

#: More columns in one array: it is no recording. Times more columns than rows: the samples are in the columns.
MOST_COLUMNS, WIDE = 256, 4
#: Columns whose titles are looked at, and fewest rows whose numbers are.
MOST_NAMED, FEWEST_ROWS = 128, 20
_NAVEGO = Facts(gyro_unit="rad/s", accel_unit="m/s2", axes="frd")
_PSINS = Facts(gyro_unit="rad/s", accel_unit="m/s2", axes="rfu")


@dataclass(frozen=True)
class Column:
    """Where a column of numbers stands."""

    array: str  # its path
    rows: int
    part: int | str | None = None  # column of a matrix, field of a record, None: the array itself
    transposed: bool = False  # rows and columns stand the other way round
    unit: str = ""  # that the file states of it, as it stands there


@dataclass(frozen=True)
class ChosenArrays:
    """The columns that are read, and what follows from how they were found."""

    columns: dict[str, Column]  # our name -> column
    titles: dict[str, str]  # our name -> its title in the file
    stated: Facts = field(default_factory=Facts)
    usual: Facts = field(default_factory=Facts)
    read_as: str = ""  # as what the file is read, for people
    clock: Clock | None = None  # of the column t
    questions: tuple[Question, ...] = ()  # what must be declared


def columns_of(
    name: str, shape: Sequence[int], fields: Sequence[str] = (), *, turned: bool = False
) -> dict[str, Column]:
    """The columns of numbers of one array by title; none where it is no table.

    Parameters
    ----------
    name : str
        Path of the array.
    shape : sequence of int
        Its shape: (n,), or samples x columns, or, with four times as many columns as rows, columns x samples.
    fields : sequence of str, optional
        Its fields, where it holds records.
    turned : bool, optional
        The file stores the array the other way round, as MATLAB does in HDF5.
    """
    if fields:
        return {f"{name}.{title}": Column(name, shape[0], title) for title in fields[:MOST_COLUMNS]}
    if len(shape) == 1:
        return {name: Column(name, shape[0])}
    if len(shape) != 2 or 0 in shape:
        return {}
    rows, width = shape[::-1] if turned else shape
    wide = width >= WIDE * rows and (rows == 1 or width > MOST_COLUMNS or width >= WIDE * len(NAMES))
    rows, width = (width, rows) if wide else (rows, width)
    if width == 1:
        return {name: Column(name, rows, 0, turned != wide)}
    if width > MOST_COLUMNS:  # of a damaged file 2^31
        return {}
    return {f"{name}[{k}]": Column(name, rows, k, turned != wide) for k in range(width)}


def under(there: Mapping[str, Column], variable: str | None, name: str, *, mark: str) -> dict[str, Column]:
    """The columns of one array or group, by the names that they have in it; all without `variable`.

    Parameters
    ----------
    there : mapping
        Every column by title.
    variable : str or None
        Declared by the user.
    name : str
        File name, for messages.
    mark : str
        What stands between a group and what is in it.
    """
    if variable is None:
        return dict(there)
    wanted = variable.strip(mark)
    found = {}
    for title, column in there.items():
        if column.array == wanted:
            found[title.removeprefix(wanted).strip("[].") or wanted] = column
        elif column.array.startswith(f"{wanted}{mark}"):
            found[title.removeprefix(f"{wanted}{mark}")] = column
    if not found:
        arrays = list(dict.fromkeys(f"{column.array} ({column.rows} rows)" for column in there.values()))
        more = f" and {len(arrays) - 12} more" if len(arrays) > 12 else ""
        raise InputError(f"{name} has no variable {variable!r}; it holds {', '.join(arrays[:12])}{more}.")
    return found


def choose(
    there: Mapping[str, Column],
    scalars: Mapping[str, float],
    look: Callable[[Column], NDArray[np.float64]],
    options: ReadOptions,
    name: str,
    *,
    holds: str,
    mark: str = ".",
    aliases: Mapping[str, tuple[str, ...]] = OUR_TITLES,
) -> ChosenArrays:
    """The columns of a recording among named arrays.

    Parameters
    ----------
    there : mapping
        Every column by title.
    scalars : mapping
        Single numbers by name.
    look : callable
        The first rows of a column.
    options : ReadOptions
        Declarations.
    name : str
        File name, for messages.
    holds : str
        What the file holds, for messages.
    mark : str
        What stands between a group and what is in it.
    aliases : mapping
        Our name -> titles that the format uses.

    Raises
    ------
    InputError
        If the columns cannot be told, or differ in length.
    """
    titles = under(there, options.variable, name, mark=mark)
    declared = dict(options.columns or {})
    found = None if declared else _by_arrays(titles, scalars, name, mark) or _psins(titles, look)
    if found is None:
        where = name if options.variable is None else f"variable {options.variable} of {name}"
        numbered = all(re.fullmatch(r"\d+|-", str(column)) for column in (options.columns or {}).values())
        if options.variable is None and numbered and (matrix := _only_matrix(titles, name, holds)) is not None:
            titles, where = under(there, matrix, name, mark=mark), f"variable {matrix} of {name}"
        listed = list(titles)
        bare = all(title.isdigit() for title in listed)
        by = Chosen() if declared and bare else _by_columns(titles, look, options, where, mark, bare=bare)
        wanted = by.columns | declared or None
        positions = choose_columns(len(listed) if bare else listed, wanted, aliases, where, needed=options.needed)
        named = {ours: listed[positions[ours]] for ours in NAMES if ours in positions}
        increments = "both" if len(by.increments) == 2 else next(iter(by.increments), False)
        stated = Facts(gyro_unit=by.gyro_unit, accel_unit=by.accel_unit, increments=increments)
        found = ChosenArrays({ours: titles[named[ours]] for ours in named}, named, stated, questions=by.questions)
    rows = {title: column.rows for title, column in found.columns.items()}
    if len(set(rows.values())) > 1:
        lengths = ", ".join(f"{title} {count}" for title, count in rows.items())
        raise InputError(f"The columns of {name} differ in length: {lengths} rows.")
    return found if TIME not in found.columns else _with_clock(found, look, options, mark)


def _with_clock(
    chosen: ChosenArrays, look: Callable[[Column], NDArray[np.float64]], options: ReadOptions, mark: str
) -> ChosenArrays:
    """The clock by title, steps and what is declared; that of a known layout is in seconds."""
    title = chosen.titles[TIME]
    layout = first_rows((title,), [look(chosen.columns[TIME])])
    known = options.rate_hz or chosen.stated.rate_hz
    unit = options.time_unit or ("s" if chosen.usual != Facts() else None)
    part = take_apart(last_part(title, mark), chosen.columns[TIME].unit)
    parts = [Title("time", ()) if title.isdigit() else part]
    clock = find_clock(layout, parts, 0, unit, known)
    questions = (*chosen.questions, *([clock.question] if clock.question else []))
    return replace(chosen, clock=clock.clock, questions=questions)


def _by_columns(
    titles: Mapping[str, Column],
    look: Callable[[Column], NDArray[np.float64]],
    options: ReadOptions,
    where: str,
    mark: str,
    *,
    bare: bool,
) -> Chosen:
    """The columns by the words of their titles, or by what their numbers do where they have none."""
    rows = max(column.rows for column in titles.values())
    if len(titles) > MOST_NAMED or (bare and rows < FEWEST_ROWS):
        return Chosen() if not bare else _numbered(where, len(titles))
    listed = list(titles)
    values = [look(titles[title]) if titles[title].rows == rows else np.full(1, np.nan) for title in listed]
    layout = first_rows(() if bare else tuple(listed), values)
    if not bare:
        parts = [_taken_apart(title, titles[title].unit, mark) for title in listed]
        chosen = without_sign(by_titles(layout, parts, options, None), where)
        open_ = not any(ours in chosen.columns or ours in (options.columns or ()) for ours in options.needed)
        return (by_numbers_of_titles(layout, options, where) or chosen) if open_ else chosen
    found = by_numbers(layout)
    if found is None:
        return _numbered(where, len(titles))
    says = f"{where[0].upper()}{where[1:]} has {len(titles)} columns without names. {found.questions[0].says}"
    says = says.replace("names. column", "names. By its first rows column")
    return replace(found, questions=(replace(found.questions[0], says=says),))


def _taken_apart(title: str, unit: str, mark: str) -> Title:
    """A title by its last part, or by all of them where that is an axis alone: AngularVelocity.X."""
    last = take_apart(last_part(title, mark), unit)
    bare = last.axis is not None and not (last.kind or last.words)
    return take_apart(re.sub(r"[./]" if mark in "./" else re.escape(mark), " ", title), unit) if bare else last


def _numbered(where: str, width: int) -> Chosen:
    raise InputError(
        f"{where[0].upper()}{where[1:]} has {width} columns without names. Say which one is which by its number from "
        "0, as in --columns w_x=4,w_y=5,w_z=6,f_x=8,f_y=9,f_z=10."
    )


def first_rows(titles: tuple[str, ...], values: Sequence[NDArray[np.float64]]) -> TextLayout:
    """The first rows of columns as those of a text, which are looked at in the same way."""
    columns = [[repr(number) for number in column[:COMPARED].tolist()] for column in values]
    rows = tuple(zip_longest(*columns, fillvalue="nan"))
    return TextLayout(
        encoding="utf-8", line_end="\n", delimiter=",", decimal=".", titles=titles, units=(), width=len(values),
        trailing=False, offset=0, row=0, header_row=None, end=None, footer=0, preamble=(), rows=rows,
    )  # fmt: skip


def told_of(chosen: ChosenArrays, *, turned: bool = True) -> str:
    """What each column was taken for, for people; with `turned`, also where samples stand in columns."""
    arrays = {ours: column.array for ours, column in chosen.columns.items()}
    titles = chosen.titles
    parts = [chosen.read_as] if chosen.read_as else []
    for word, names in (("gyro", RATES), ("acceleration", FORCES)):
        if names[0] in titles:
            whole = len({arrays[ours] for ours in names}) == 1 and "[" not in titles[names[0]].split("]")[-1]
            first, last = titles[names[0]], titles[names[2]]
            parts.append(f"{word}: {first} to {last}" if whole else f"{word}: {first}, {titles[names[1]]}, {last}")
    parts.append(f"clock: {titles[TIME]}" if TIME in titles else "no clock")
    wide = list(dict.fromkeys(column.array for column in chosen.columns.values() if column.transposed and column.part))
    if wide and turned:
        parts.append(f"samples stand in the columns of {' and '.join(wide)}")
    return "; ".join(parts)


def _plain(title: str, mark: str) -> str:
    """The last part of a name, letters and digits only, without digits at its end."""
    last = re.sub(r"[^a-z0-9]", "", title.rsplit(mark, 1)[-1].lower())
    return re.sub(r"\d+$", "", last)


def _group(array: str, mark: str) -> str:
    return array.rsplit(mark, 1)[0] if mark in array else ""


def _by_arrays(titles: Mapping[str, Column], scalars: Mapping[str, float], name: str, mark: str) -> ChosenArrays | None:
    """Angular rates, forces and time by the names of whole arrays; None where no array is called so."""
    arrays: dict[str, dict[str, Column]] = {}
    for title, column in titles.items():
        arrays.setdefault(column.array, {})[title] = column
    triples = {array: columns for array, columns in arrays.items() if len(columns) == 3}
    gyros = [array for array in triples if _plain(array, mark) in GYRO_ARRAYS]
    gyros = gyros or [array for array in triples if _unit_behind(array, mark, GYRO_ARRAYS, GYRO_SPELLINGS)]
    if not gyros:
        return None
    if len(gyros) > 1:
        groups = [_group(array, mark) or array for array in gyros]
        raise InputError(
            f"{name} holds {len(gyros)} arrays of angular rates: {', '.join(gyros[:8])}. Say which one: "
            f"--variable {groups[0]}."
        )
    gyro, group = gyros[0], _group(gyros[0], mark)
    beside = [array for array in triples if _group(array, mark) == group]
    accels = [array for array in beside if _plain(array, mark) in ACCEL_ARRAYS]
    accels = accels or [array for array in beside if _unit_behind(array, mark, ACCEL_ARRAYS, ACCEL_SPELLINGS)]
    times = [
        array
        for array, columns in arrays.items()
        if len(columns) == 1
        and _group(array, mark) in (group, "")
        and (_plain(array, mark) in TIME_ARRAYS or _unit_behind(array, mark, TIME_ARRAYS, TIME_SPELLINGS))
    ]
    if len(accels) > 1:
        raise InputError(f"{name} holds {' and '.join(accels)}; say which one with --columns f_x={accels[0]}[0],...")
    columns, named = {}, {}
    times.sort(key=lambda array: _group(array, mark) != group)
    for ours, array in ((RATES, gyro), (FORCES, accels[0] if accels else None), ((TIME,), times[0] if times else None)):
        for our, (title, column) in zip(ours, arrays[array].items() if array else (), strict=False):
            columns[our], named[our] = column, title
    for ours, title in named.items():
        if ours != TIME and any(alias in titles for alias in OUR_TITLES[ours]):
            raise InputError(
                f"{name} has {ours} and {title}, and each of them may be {ours}: which one is meant? Say so: "
                f"--columns {ours}={ours}, and likewise for the other axes."
            )
    navego = {_plain(array, mark) for array in (gyro, *accels)} == {"wb", "fb"}
    rate_hz = None if times else _rate(scalars, group, mark)
    ordered = {ours: columns[ours] for ours in NAMES if ours in columns}
    if navego:
        return ChosenArrays(
            ordered, named, Facts(rate_hz=rate_hz), _NAVEGO, "read as NaveGo: rad/s, m/s2, forward-right-down"
        )
    gyro_unit = spelled(columns[RATES[0]].unit, GYRO_SPELLINGS)
    gyro_unit = gyro_unit or _unit_behind(gyro, mark, GYRO_ARRAYS, GYRO_SPELLINGS)
    accel_unit = spelled(columns[FORCES[0]].unit, ACCEL_SPELLINGS) if accels else None
    accel_unit = accel_unit or (_unit_behind(accels[0], mark, ACCEL_ARRAYS, ACCEL_SPELLINGS) if accels else None)
    return ChosenArrays(ordered, named, Facts(rate_hz=rate_hz, gyro_unit=gyro_unit, accel_unit=accel_unit))


def _unit_behind(array: str, mark: str, names: Collection[str], spellings: dict[str, tuple[str, ...]]) -> str | None:
    """The unit behind the name of an array that is one of `names`: gyro_dps, acc_m_s2, time_ms; None without one."""
    words = array.rsplit(mark, 1)[-1].split("_")
    for end in range(len(words) - 1, 0, -1):
        unit = spelled("_".join(words[end:]), spellings) or spelled("".join(words[end:]), spellings)
        if unit and _plain("_".join(words[:end]), mark) in names:
            return unit
    return None


def _rate(scalars: Mapping[str, float], group: str, mark: str) -> float | None:
    """The sample rate that a single number beside the arrays states, Hz."""
    for names, power in ((RATE_SCALARS, 1), (INTERVAL_SCALARS, -1)):
        beside = {
            number for title, number in scalars.items() if _group(title, mark) == group and _plain(title, mark) in names
        }
        if len(beside) == 1 and (number := beside.pop()) > 0:
            return number**power
    return None


def _psins(titles: Mapping[str, Column], look: Callable[[Column], NDArray[np.float64]]) -> ChosenArrays | None:
    """A matrix of PSINS: three increments of angle, three of velocity, time."""
    arrays: dict[str, list[tuple[str, Column]]] = {}
    for title, column in titles.items():
        arrays.setdefault(column.array, []).append((title, column))
    found = [
        columns for array, columns in arrays.items() if re.split(r"[./]", array)[-1] == "imu" and len(columns) == 7
    ]
    if len(found) != 1:
        return None
    times, first = look(found[0][6][1]), look(found[0][0][1])
    if len(times) < 2 or not (np.diff(times) > 0).all() or (np.diff(first) > 0).all():
        return None
    order = (*RATES, *FORCES, TIME)
    columns = {ours: column for ours, (_, column) in zip(order, found[0], strict=True)}
    named = {ours: title for ours, (title, _) in zip(order, found[0], strict=True)}
    array = found[0][0][1].array
    told = (
        f"read as PSINS: {array} holds increments of angle (rad) and velocity (m/s), right-front-up, and ends in time"
    )
    ordered = {ours: columns[ours] for ours in NAMES}
    return ChosenArrays(ordered, named, Facts(increments=True), _PSINS, told)


def _only_matrix(titles: Mapping[str, Column], name: str, holds: str) -> str | None:
    """The matrix that numbers of columns speak of: the only one that is longest; None without one."""
    rows = {column.array: column.rows for column in titles.values() if isinstance(column.part, int)}
    wide = {array for array in rows if sum(column.array == array for column in titles.values()) >= len(RATES)}
    longest = [array for array in wide if rows[array] == max(rows[each] for each in wide)]
    if len(longest) > 1:
        raise InputError(f"{name} holds {holds}; say which one with --variable NAME.")
    return longest[0] if longest else None
