"""Which columns of a text file are angular rate, specific force and time: by declaration, preset, titles or numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from gyronorth.errors import InputError
from gyronorth.frozen import frozen
from gyronorth.readers.asking import columns_text
from gyronorth.readers.axes import mat_bf
from gyronorth.readers.evidence import accel_fits, gyro_fits
from gyronorth.readers.layout import TextLayout
from gyronorth.readers.options import OUR_TITLES, ReadOptions
from gyronorth.readers.presets import Preset
from gyronorth.readers.source import FORCES, RATES, TIME, Question
from gyronorth.readers.text_clock import choose_clock, is_whole_second, numbers
from gyronorth.readers.titles import OTHER_WORDS, Title, Triple, label, take_apart, triples

#: Words of columns that stand beside those that are meant.
_BESIDE = ("linear", "lin", "raw", "uncal", "uncalibrated", "uncomp", "uncompensated", "adc", "lsb", "delta",
           "increment", "incremental")  # fmt: skip
_VALUES = frozenset(("value", "values", "val", "vals", "data", "reading", "readings", "measurement", "sample"))
#: Fewest steps that tell a clock.
FEWEST_STEPS = 20
_WORDS = {"gyro": "angular rate", "accel": "specific force"}


@frozen
class Chosen:
    """What was found: our name -> title or position, as `options.columns` has it."""

    columns: dict[str, str | int] = field(default_factory=dict)
    gyro_unit: str | None = None  # that the titles state
    accel_unit: str | None = None
    increments: frozenset[str] = frozenset()  # sensors whose titles say so
    scales: Mapping[str, float] = field(default_factory=dict)  # sensor -> units in one number, where not one
    questions: tuple[Question, ...] = ()


def by_titles(layout: TextLayout, parts: Sequence[Title], options: ReadOptions, preset: Preset | None) -> Chosen:
    """The columns of a file with a header that are not declared.

    Raises
    ------
    InputError
        If the three titles of a sensor state different units.
    """
    titles, declared = layout.titles, dict(options.columns or {})
    columns: dict[str, str | int] = {} if preset is None else preset.columns(titles)
    questions: list[Question] = []
    found = triples(titles, parts)
    units: dict[str, str | None] = {"gyro": None, "accel": None}
    increments: set[str] = set()
    scales: dict[str, float] = {}
    for kind, ours in (("gyro", RATES), ("accel", FORCES)):
        if any(name in declared for name in ours):
            given = [_position(declared.get(name), titles) for name in ours]
            triple = next((each for each in found if list(each.positions) == given), None)
            units[kind] = _agreed([parts[i].unit for i in given if i is not None])
            columns |= {name: name for name in ours if name not in declared and name in titles}
        elif any(name in columns for name in ours):
            continue
        elif any(name in titles for name in ours):
            there = [name for name in ours if name in titles]
            triple = None
            units[kind] = _agreed([parts[titles.index(name)].unit for name in there])
            columns |= {name: name for name in there}
        else:
            candidates = [_along(each, options.axes) for each in plain_triples(found, kind)]
            triple = candidates[0] if candidates else None
            needed = ours == options.needed
            questions += _doubts(kind, candidates, parts, layout, columns if needed else None)
            if triple is not None:
                columns |= {name: column_name(i, titles) for name, i in zip(ours, triple.positions, strict=True)}
                units[kind] = triple.unit
                _check_agreed([(titles[i], parts[i].unit, parts[i].scale) for i in triple.positions])
        if triple is not None and triple.increments:
            increments.add(kind)
        if triple is not None and triple.unit is not None and triple.scale != 1:
            scales[kind] = triple.scale
        if triple is not None and getattr(options, f"{kind}_unit") is None:
            questions += _strange_unit(triple, ours, parts, titles)
    if (
        options.needed == RATES
        and options.accel_file is None
        and not any(name in {**columns, **declared} for name in FORCES)
    ):
        named, asked = _unnamed_force(layout, parts, columns | declared)
        columns, questions = columns | named, questions + asked
    if TIME not in declared and TIME not in columns:
        named, asked = _clock(layout, parts, columns | declared, options)
        columns, questions = columns | named, questions + asked
    if any(not question.options for question in questions):  # one --columns for all
        text = columns_text({**{k: v for k, v in columns.items() if k != TIME}, **declared})
        questions[-1] = Question(questions[-1].says, ("--columns", text), certain=False)
    return Chosen(columns, units["gyro"], units["accel"], frozenset(increments), scales, tuple(questions))


def plain_triples(found: Sequence[Triple], kind: str) -> list[Triple]:
    """The triples of a kind that may be meant."""
    candidates = [each for each in found if each.kind == kind]
    # Phones call linear what has gravity taken out; what is raw stands beside what is calibrated.
    return [each for each in candidates if not set(each.words) & set(_BESIDE)] or candidates


def without_sign(chosen: Chosen, name: str) -> Chosen:
    """The same, of arrays, whose columns are read as they are.

    Raises
    ------
    InputError
        If a title has a minus sign before its axis.
    """
    minus = [str(title) for title in chosen.columns.values() if take_apart(str(title)).minus]
    if minus:
        raise InputError(
            f"{', '.join(minus)} in {name}: a title with a minus sign says that the values have the other sign. Write "
            "the file with these columns turned, and without the sign."
        )
    return chosen


def by_numbers(layout: TextLayout, needed: tuple[str, ...] = RATES) -> Chosen | None:
    """The columns of a file without titles, by what their numbers do; None where these do not tell what is needed."""
    values = _values(layout, range(layout.width))
    usable = np.asarray(np.isfinite(values).all(axis=0))
    time, interval = _time_column(layout, values, usable)
    rate_hz = None if interval is None else 1 / interval
    free = [i for i in range(layout.width) if usable[i] and i != time]
    starts = [i for i in range(layout.width - 2) if all(k in free for k in (i, i + 1, i + 2))]
    vertical = [i for i in starts if accel_fits(values[:, i : i + 3], rate_hz) and _steady(values[:, i : i + 3])]
    vertical = [i for i in vertical if i - 1 not in vertical or i - 2 in vertical] or vertical
    # Columns that never change are no sensor, though a quaternion at rest has the norm 1 as gravity in g.
    vertical = [i for i in vertical if (np.ptp(values[:, i : i + 3], axis=0) > 0).any()] or vertical
    near = [i for i in starts if any(fit.certain for fit in gyro_fits(values[:, i : i + 3], rate_hz))]
    beside = [i for i in vertical if i - 3 in near or i + 3 in near]
    accel = (beside or vertical)[0] if vertical else None
    if needed == FORCES and accel is None and len(starts) == 1:
        accel = starts[0]
    rates = [i for i in starts if accel is None or abs(i - accel) >= 3]
    near = [i for i in rates if any(fit.certain for fit in gyro_fits(values[:, i : i + 3], rate_hz))]
    beside = [i for i in rates if accel is not None and abs(i - accel) == 3]
    gyro = (near or beside or (rates if len(rates) == 1 else []))[:1]
    if needed == FORCES:
        gyro = []
    if accel is None if needed == FORCES else (not gyro or (accel is None and len(rates) != 1 and not near)):
        return None
    columns: dict[str, str | int] = {} if time is None else {TIME: time}
    columns |= dict(zip(RATES, range(gyro[0], gyro[0] + 3), strict=True)) if gyro else {}
    if accel is not None:
        columns |= dict(zip(FORCES, range(accel, accel + 3), strict=True))
    described = [] if time is None else [f"column {time} is like a clock"]
    described += [f"columns {gyro[0]} to {gyro[0] + 2} like angular rate"] if gyro else []
    described += [f"columns {accel} to {accel + 2} like specific force" if accel is not None else "none like gravity"]
    return Chosen(columns, questions=(Question(f"{', '.join(described)}.", ("--columns", columns_text(columns))),))


def by_numbers_of_titles(layout: TextLayout, options: ReadOptions, name: str) -> Chosen | None:
    """What the numbers of a file say whose titles say nothing of a sensor; the user must agree."""
    found = by_numbers(layout, options.needed) if layout.width >= len(RATES) else None
    if found is None or not set(found.columns) - set(RATES):  # three columns alone, of anything
        return None
    proposed = {ours: column_name(int(at), layout.titles) for ours, at in found.columns.items()}
    columns = {**proposed, **(options.columns or {})}
    titles = ", ".join(title[:20] for title in layout.titles[:8]) + (", ..." if len(layout.titles) > 8 else "")
    says = f"No title of {name} is known: {titles}. By its first rows {found.questions[0].says}"
    return Chosen(columns, questions=(Question(says, ("--columns", columns_text(columns)), certain=False),))


def told(columns: Mapping[str, int], titles: Sequence[str], units: Mapping[str, str], clock: str) -> str:
    """What each column was taken for, for people."""
    parts = []
    for word, ours, kind in (("gyro", RATES, "gyro"), ("acceleration", FORCES, "accel")):
        if ours[0] in columns:
            name = label(titles[columns[ours[0]]], titles[columns[ours[2]]])
            unit = units.get(kind, "")
            parts.append(f"{word}: {name}" + (f" ({unit})" if unit and not name.endswith((")", "]")) else ""))
    return ", ".join([*parts, f"clock: {clock}" if clock else "no clock"])


def _unnamed_force(
    layout: TextLayout, parts: Sequence[Title], columns: Mapping[str, str | int]
) -> tuple[dict[str, str | int], list[Question]]:
    """Three columns side by side that feel gravity, though no title says so; none where no or several ones do."""
    titles = layout.titles
    taken = _taken(columns, titles)
    free = [i for i, part in enumerate(parts) if i not in taken and not part.kind and not set(part.words) & OTHER_WORDS]
    found = []
    for i in (i for i in free if i + 1 in free and i + 2 in free):
        if is_gravity(_values(layout, (i, i + 1, i + 2))):
            found.append(i)
    if len(found) != 1:
        return {}, []
    named: dict[str, str | int] = {ours: column_name(found[0] + k, titles) for k, ours in enumerate(FORCES)}
    says = f"{label(titles[found[0]], titles[found[0] + 2])} are like the specific force, and no title says so."
    return named, [Question(says, ("--columns", columns_text({**columns, **named})), certain=False)]


def _values(layout: TextLayout, positions: Sequence[int]) -> np.ndarray:
    """Columns of the first rows, shape (n, k)."""
    return np.column_stack([numbers(layout, position) for position in positions])


def _strange_unit(
    triple: Triple, ours: tuple[str, ...], parts: Sequence[Title], titles: Sequence[str]
) -> list[Question]:
    """Units in titles that are not known: what physics proposes instead, the user must agree to."""
    strange = [parts[i].strange for i in triple.positions]
    if not all(strange):
        return []
    text = columns_text({name: column_name(i, titles) for name, i in zip(ours, triple.positions, strict=True)})
    says = f"The titles of {triple.label} state {strange[0]}, a unit that is not known here."
    return [Question(says, ("--columns", text), certain=False)]


def _clock(
    layout: TextLayout, parts: Sequence[Title], columns: Mapping[str, str | int], options: ReadOptions
) -> tuple[dict[str, str | int], list[Question]]:
    """The column of the time by its title, or by what its numbers do."""
    titles, questions = layout.titles, list[Question]()
    exact = [title for title in OUR_TITLES[TIME] if titles.count(title) == 1]
    position = titles.index(exact[0]) if exact and titles.index(exact[0]) not in _taken(columns, titles) else None
    position = choose_clock(layout, parts) if position is None else position
    if position is None and options.rate_hz is None:
        position, questions = _unnamed_clock(layout, parts, columns)
    return ({} if position is None else {TIME: column_name(position, titles)}), questions


def _unnamed_clock(
    layout: TextLayout, parts: Sequence[Title], columns: Mapping[str, str | int]
) -> tuple[int | None, list[Question]]:
    """A column that runs on as a clock does, though its title does not say so, and no row counter."""
    taken = _taken(columns, layout.titles)
    for position, part in enumerate(parts):
        if part.kind or position in taken or set(part.words) & OTHER_WORDS:
            continue
        step = np.diff(numbers(layout, position))
        uneven = len(step) < FEWEST_STEPS or (step == step[0]).all() or step.std() > 0.9 * step.mean()
        if uneven or not (step > 0).all():
            continue
        name = column_name(position, layout.titles)
        return position, [Question(f"{name} is like a clock.", ("--columns", f"{TIME}={name}"), certain=False)]
    return None, []


def _along(triple: Triple, axes: str | None) -> Triple:
    """Columns named after directions of the body, in the order x, y, z of the declared axes: in rfu, x is lateral."""
    if axes is None or not triple.worded:
        return triple
    along = np.argmax(np.abs(mat_bf(axes)), axis=0)
    x, y, z = (triple.positions[body] for body in along)
    return replace(triple, positions=(x, y, z))


def _which(kind: str, ours: tuple[str, ...], candidates: Sequence[Triple], titles: Sequence[str]) -> Question:
    word = _WORDS[kind]
    listed = "; ".join(
        columns_text({name: column_name(i, titles) for name, i in zip(ours, each.positions, strict=True)})
        for each in candidates
    )
    return Question(f"{len(candidates)} triples may be the {word}: {listed}. Which one is meant?", (), certain=False)


def _doubts(
    kind: str,
    candidates: Sequence[Triple],
    parts: Sequence[Title],
    layout: TextLayout,
    columns: dict[str, str | int] | None,
) -> list[Question]:
    """Which of several triples is meant; of none, the columns x, y, z are put into `columns` where there is one."""
    ours, titles = RATES if kind == "gyro" else FORCES, layout.titles
    if len(candidates) > 1:
        return [_which(kind, ours, candidates, titles)]
    bare = None if candidates or columns is None else bare_triple(parts)
    if bare is None or columns is None or (kind == "gyro" and is_gravity(_values(layout, bare))):
        return []
    columns |= {name: column_name(i, titles) for name, i in zip(ours, bare, strict=True)}
    says = f"Only {', '.join(titles[i] for i in bare)} may be the {_WORDS[kind]}, and no title says so."
    return [Question(says, ("--columns", columns_text(columns)), certain=False)]


def bare_triple(parts: Sequence[Title]) -> tuple[int, int, int] | None:
    """The only three columns x, y, z, where their titles say no more than that they are values."""
    bare = [(i, part.axis) for i, part in enumerate(parts) if is_bare(part)]
    at = [[i for i, its in bare if its == axis] for axis in range(3)]
    return (at[0][0], at[1][0], at[2][0]) if all(len(each) == 1 for each in at) else None


def is_bare(part: Title) -> bool:
    """Whether a title says of a sensor no more than an axis."""
    return not part.kind and set(part.words) <= _VALUES


def _check_agreed(units: Sequence[tuple[str, str | None, float]]) -> None:
    """Refuse three titles of a sensor that state different units."""
    stated = {(unit, scale) for _, unit, scale in units if unit}
    if len(stated) > 1:
        raise InputError(
            f"The titles {', '.join(title for title, *_ in units)} belong to one sensor and state different units: "
            "correct them."
        )


def column_name(position: int, titles: Sequence[str]) -> str | int:
    """A title, or its position where it is there twice or would not read back."""
    title = titles[position]
    plain = title and titles.count(title) == 1 and title != "-" and "," not in title
    # A title that is a number goes before the position of that number.
    return title if plain and (not title.isdigit() or str(position) in titles) else position


def _position(wanted: str | int | None, titles: Sequence[str]) -> int | None:
    if wanted is None or str(wanted) == "-":
        return None
    if wanted in titles:
        return list(titles).index(str(wanted))
    return int(wanted) if str(wanted).isdigit() and int(wanted) < len(titles) else None


def _taken(columns: Mapping[str, str | int], titles: Sequence[str]) -> list[int | None]:
    return [_position(wanted, titles) for wanted in columns.values()]


def _agreed(units: Sequence[str | None]) -> str | None:
    return units[0] if units and len(set(units)) == 1 else None


def is_gravity(values: np.ndarray) -> bool:
    """Whether three columns, shape (n, 3), feel gravity at rest: of a steady norm that is gravity in some unit."""
    moves = len(values) > 1 and np.isfinite(values).all() and (np.ptp(values, axis=0) > 0).any()
    return bool(moves and accel_fits(values, None) and _steady(values))


def _steady(values: np.ndarray) -> bool:
    """Whether the norm hardly changes, as that of gravity at rest."""
    norm = np.linalg.norm(values, axis=1)
    return bool(norm.std() < 0.2 * norm.mean())


def _time_column(layout: TextLayout, values: np.ndarray, usable: np.ndarray) -> tuple[int | None, float | None]:
    """The first column that runs on as a clock does, and its mean step."""
    for position in range(layout.width):
        if is_whole_second(layout, position):
            return position, None
        if position in layout.texts and len(layout.rows) and ":" in layout.rows[0][position]:
            return position, None
        if not usable[position] or len(values) < 3:
            continue
        step = np.diff(values[:, position])
        positive = step > 0
        if positive.mean() > 0.9 and step[positive].std() < 0.9 * step[positive].mean():
            return position, float(step[positive].mean())
    return None, None
