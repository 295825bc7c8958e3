"""What the titles of columns say: which are angular rate, specific force and time, and in which units.

A title is cut into words, an axis and a unit: "scaledGyroX [deg/s]", "angular_velocity.x", "gx_dps" and "Gyr_X" are
all words of a gyro, an axis x and perhaps a unit. Three titles that differ in their axis alone are a triple. The table
of words is published in the guide "Files and declarations".
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

from gyronorth.frozen import frozen
from gyronorth.readers import labview
from gyronorth.readers.spellings import (
    ACCEL_SPELLINGS,
    ANGLE_SPELLINGS,
    GYRO_SPELLINGS,
    TIME_SPELLINGS,
    VELOCITY_SPELLINGS,
    scaled,
    spelled,
)

#: Words by which a triple is known, in lower case; a title needs all words of one of the groups.
GYRO_WORDS = (
    ("gyro",), ("gyr",), ("gyros",), ("gyroscope",), ("gyrometer",), ("gyrorate",), ("omega",), ("angvel",),
    ("angrate",), ("angular", "velocity"), ("angular", "rate"), ("angular", "vel"), ("angular", "speed"),
    ("ang", "vel"), ("ang", "rate"), ("rotation", "rate"), ("rot", "rate"), ("turn", "rate"), ("angularvelocity",),
    ("angularrate",), ("rotationrate",), ("rate",), ("wb",), ("wib",), ("wibb",),
    ("drehrate",), ("winkelgeschwindigkeit",), ("vitesse", "angulaire"), ("velocidad", "angular"),
    ("velocidade", "angular"), ("velocita", "angolare"), ("hoeksnelheid",), ("predkosc", "katowa"), ("giroscopio",),
    ("gyroskop",), ("угловая", "скорость"), ("гироскоп",), ("дус",), ("vinkelhastighet",), ("giro",),
    ("ジャイロ",), ("角速度",), ("陀螺仪",), ("각속도",),
)  # fmt: skip
ANGLE_WORDS = (
    ("dtheta",), ("delta", "theta"), ("deltatheta",), ("delta", "angle"), ("deltaangle",), ("dang",), ("delta", "ang"),
    ("delta", "th"), ("d", "th"),
    ("delang",), ("dth",), ("delta", "gyro"), ("angle", "increment"), ("dangle",),
    ("d", "ang"), ("d", "theta"), ("incremental", "angle"),
)  # fmt: skip
ACCEL_WORDS = (
    ("accel",), ("acc",), ("accelerometer",), ("acceleration",), ("accelero",), ("specific", "force"), ("specforce",),
    ("sf",), ("acce",), ("fb",), ("fib",), ("fibb",), ("force",), ("accelerations",), ("linear", "acceleration"),
    ("linearacceleration",), ("specificforce",), ("accl",), ("accs",), ("proper", "acceleration"),
    ("beschleunigung",), ("aceleracion",), ("aceleracao",), ("accelerazione",), ("versnelling",), ("przyspieszenie",),
    ("acel",), ("acelerometro",), ("ускорение",), ("акселерометр",), ("加速度",), ("加速度计",), ("가속도",),
)  # fmt: skip
VELOCITY_WORDS = (
    ("dvel",), ("delta", "v"), ("deltav",), ("delta", "velocity"), ("deltavelocity",), ("delta", "vel"), ("delvel",),
    ("dv",), ("velocity", "increment"), ("delta", "accel"), ("incremental", "velocity"), ("dvelocity",),
    ("d", "vel"), ("d", "v"),
)  # fmt: skip
#: Letters that stand for a sensor where they are all there is before the axis, or come first: w_x, gx, a_RS_S_x.
GYRO_LETTERS, ACCEL_LETTERS = ("w", "g", "om"), ("a", "f")
#: Words that make of a title something else.
OTHER_WORDS = frozenset(
    """
    cov covariance bias biases std sigma var variance valid status flag temp temperature mag magnetometer
    magnetic quat quaternion orientation euler roll pitch yaw attitude gravity user free offset drift scale
    random walk error saturation clip clipping norm total magnitude abs range id baro pressure fog dcm max min
    filt filtered position pos lat lon heading correction corrected
    """.split()  # noqa: SIM905
)
TIME_WORDS = frozenset(
    """
    tv tout datenum filetime mjd jd cts gpstow itow gpssec gpsseconds millisecond microsecond nanosecond
    ts ss uptime time timestamp timestamps t stamp sec secs second seconds utc tow sow gpstime epoch clock ms us ns nsec
    nsecs nanos millis micros nanosec nanoseconds milliseconds microseconds timems timeus timens timesec
    datetime date tod gps towms week gpsweek elapsed since start boot msec usec sod zeit zeitstempel temps tiempo tempo
    czas tijd tid zaman messzeit datum uhrzeit horodatage unixtime hhmmss hms year decyear doy время 时间 時間 시간
    """.split()  # noqa: SIM905
)
COUNTER_WORDS = frozenset(
    """
    counter count seq sequence packetcounter index idx frame frames sample samples n no number num packet line
    row cycle i
    """.split()  # noqa: SIM905
)
#: Words of columns in a unit of time that are no clock.
SPAN_WORDS = frozenset(
    ("dt", "delta", "exposure", "latency", "duration", "delay", "age", "period", "interval", "lag", "rtt")
)
_AXES = {"x": 0, "y": 1, "z": 2}
#: Rates about the body axes, by the words of flight mechanics.
_BODY_RATES = {
    f"{name}{rate}": axis for axis, name in enumerate(("roll", "pitch", "yaw")) for rate in ("rate", "rates")
}
_BODY_RATES |= {"p": 0, "q": 1, "r": 2}
#: Body axes in words, of a title that has no x, y or z. Which way each points, the title need not say.
_DIRECTIONS = {"forward": 0, "front": 0, "fwd": 0, "longitudinal": 0, "long": 0, "right": 1, "left": 1, "lateral": 1,
               "lat": 1, "transverse": 1, "down": 2, "up": 2, "vertical": 2, "vert": 2}  # fmt: skip
#: Characters of a title that are looked at: the patterns take the square of them.
LONGEST = 200
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[^\W\d_A-Za-z]+")
#: What units have in them.
_STRANGE = re.compile(r"[^/\s]/s|/h|/min|\^?[-⁻\u2212][12¹²]$| per ")
#: Numbers of devices, as Shimmer's 9D1A: no axis.
_HEXADECIMAL = re.compile(r"(?<![A-Za-z0-9])(?=[A-F]*\d+[A-F])[0-9A-F]{4,}(?![A-Za-z0-9])")
#: A sign before an axis, alone or behind the word of its sensor; "Gyro-X" and "- x" have a hyphen.
_MINUS = re.compile(r"(?:^|[\s(\[])[-\u2212](?=\(?[A-Za-z])")
_BRACKETS = re.compile(r"[\[({]([^\])}]*)[\])}]")
_GLUED = re.compile(r"(.*[a-z])([xyz])")
_GLUED_BEFORE = re.compile(r"([xyz])([a-z]{3,})")
#: Letters of other scripts that look like an axis, where they stand alone.
_LOOKALIKES = (("[Хх]", "X"), ("[Уу]", "Y"))
_STEMS = frozenset(word for group in (*GYRO_WORDS, *ACCEL_WORDS, *ANGLE_WORDS, *VELOCITY_WORDS) for word in group)


@frozen
class Title:
    """A title taken apart."""

    kind: str  # gyro, accel, time, week, date, counter or ""
    words: tuple[str, ...]  # in lower case, without axis and unit
    axis: int | None = None  # 0, 1, 2 for x, y, z
    unit: str | None = None
    increments: bool = False  # angle or velocity a sample
    scale: float = 1.0  # of its unit in one number
    worded: bool = False  # the axis is one of the body, by its name: roll, lateral, up
    minus: bool = False  # the values are those of the axis with the other sign: -Y Gyro
    strange: str = ""  # what stands in the place of its unit, looks like one and is not known


@frozen
class Triple:
    """Three columns of one sensor."""

    kind: str  # gyro or accel
    positions: tuple[int, int, int]  # of x, y, z
    label: str  # for people: "Gyro X..Z"
    unit: str | None
    increments: bool | None  # None: not known
    scale: float = 1.0  # of its unit in one number
    words: tuple[str, ...] = ()  # of their titles, without axis and unit
    worded: bool = False  # x, y, z are forward, right and down by the names of the columns


def last_part(title: str, mark: str) -> str:
    """What the title of an array says of its column; names of R, parted by a mark of their own, have points in them."""
    return re.split(r"[./]" if mark in "./" else re.escape(mark), title)[-1]


def take_apart(title: str, unit: str = "") -> Title:
    """Words, axis and unit of a title; `unit` is what a row of units holds below it.

    Examples
    --------
    >>> title = take_apart("Gyro X (deg/s)")
    >>> title.kind, title.words, title.axis, title.unit
    ('gyro', ('gyro',), 0, 'deg/s')
    >>> take_apart("a_RS_S_y [m s^-2]").kind, take_apart("time_us").unit
    ('accel', 'us')
    """
    return _taken_apart(title[:LONGEST], unit[:LONGEST])


@lru_cache(maxsize=1000)  # the columns of a file are asked for several times
def _taken_apart(title: str, unit: str) -> Title:
    if title.strip().lower() == labview.TIME.lower():
        return Title("time", ("time",), unit="s")
    name, candidates = title, [unit] if unit else []
    for match in _BRACKETS.finditer(title):
        if not match[1].strip().isdigit() and match[1].strip().lower() not in _AXES:
            candidates.append(match[1])
            name = name.replace(match[0], " ")
    if not candidates:
        head, mark, behind = re.sub(r"[,:]\s", "\0", title, count=1).partition("\0")
        parts = (head, mark, behind) if mark else _behind_slash(title)
        if parts[1]:
            name, candidates = parts[0], [parts[2]]
    for letter, latin in _LOOKALIKES:
        name = re.sub(rf"\b{letter}\b", latin, name)
    name = _HEXADECIMAL.sub(" ", name)
    words = [word.lower() for word in _WORD.findall(_without_accents(re.sub("[ωΩ]", "w", name)))]
    axis, rest = _axis(words)
    worded, minus = axis is not None and _is_worded(words), axis is not None and bool(_MINUS.search(name))
    found = _title(rest, axis, candidates)
    if not found.kind and (parts := re.split(r"[./]", name)) and len(parts) > 1 and not set(rest) & OTHER_WORDS:
        last = take_apart(parts[-1], candidates[0] if candidates else "")  # data.gx: the place says nothing
        place = (word.lower() for word in _WORD.findall(" ".join(parts[:-1])))
        found = replace(last, words=(*place, *last.words)) if last.kind else found
    return replace(found, worded=worded, minus=minus)


def _without_accents(text: str) -> str:
    """Latin letters alone: Accélération is Acceleration; letters of other scripts stay as they are."""
    if text.isascii():
        return text
    return re.sub("[\u0300-\u036f]", "", unicodedata.normalize("NFD", text))


def _is_worded(words: Sequence[str]) -> bool:
    """Whether a title names its axis by a word for a direction of the body."""
    return "".join(words) in _BODY_RATES or not any(
        word in _AXES or word.isdigit() or _GLUED.fullmatch(word) or _GLUED_BEFORE.fullmatch(word) for word in words
    )


def _behind_slash(title: str) -> tuple[str, str, str]:
    """Acc_X/g, Gyr_X/(deg/s), gyro x rad/s: the name and the unit behind it."""
    last = re.fullmatch(r"(.*[^\s_])[\s_]+([^\s_/]+/[^_]+)", title)
    head, mark, behind = (last[1], " ", last[2]) if last else title.partition("/")
    known = (GYRO_SPELLINGS, ACCEL_SPELLINGS, TIME_SPELLINGS, ANGLE_SPELLINGS)
    return (head, mark, behind) if mark and any(spelled(behind, table) for table in known) else (title, "", "")


def _title(words: list[str], axis: int | None, candidates: list[str]) -> Title:
    found, scale = _unit_of(candidates), 1.0
    named = words
    for text in candidates if not found else ():
        scale, text = scaled(text)
        if scale != 1 and (found := _unit_of([text])):
            break
        scale = 1.0
    if not found:
        for length in (3, 2, 1):  # a unit among the words: gx_dps, gyro_rad_s, accel_m_s2_x
            for start in range(len(words) - length, 0 if length == 1 else -1, -1):
                part = words[start : start + length]
                suffix = _unit_of(["_".join(part)]) or _unit_of(["".join(part)])
                if suffix and start > 0 and not (length == 1 and part[0] in ("g", "s", "a", "c") and axis is None):
                    found, named = suffix, words[:start] + words[start + length :]
                    break
            if found:
                break
    if axis is None and "".join(named) in _BODY_RATES:  # p_dps
        axis, named = _BODY_RATES["".join(named)], ["rate"]
    kind, increments = _kind(named, axis, found, stated=bool(candidates))
    unit = _unit_for(kind, found, increments)
    if kind == "time" and unit is None and len(named) == 1 and (bare := spelled(named[0], TIME_SPELLINGS)):
        unit, named = bare, []  # sec, nanosec
    if kind in ("gyro", "accel") and unit is None and found and not increments:
        angle = found.get("angle" if kind == "gyro" else "velocity")
        increments = bool(angle and any(word in ("increment", "increments", "inc", "delta") for word in named))
        unit = angle if increments else None
    strange = next((text.strip() for text in candidates if _STRANGE.search(text)), "") if unit is None else ""
    return Title(kind, tuple(named), axis, unit, increments, scale if unit else 1.0, strange=strange)


def _unit_of(candidates: Sequence[str]) -> dict[str, str]:
    """Which unit each kind of column would have."""
    tables = {
        "gyro": GYRO_SPELLINGS, "accel": ACCEL_SPELLINGS, "angle": ANGLE_SPELLINGS, "velocity": VELOCITY_SPELLINGS,
        "time": TIME_SPELLINGS,
    }  # fmt: skip
    for text in candidates:
        found = {kind: unit for kind, table in tables.items() if text and (unit := spelled(text, table)) is not None}
        if found:
            return found
    return {}


def _unit_for(kind: str, found: dict[str, str], increments: bool) -> str | None:
    if kind == "gyro":
        return found.get("angle" if increments else "gyro")
    if kind == "accel":
        return found.get("velocity" if increments else "accel")
    return found.get("time") if kind == "time" else None


def _axis(words: list[str]) -> tuple[int | None, list[str]]:
    """The axis in the words and the words without it: a word of its own, or the end of one."""
    at = [i for i, word in enumerate(words) if word in _AXES]
    if at:
        return _AXES[words[at[-1]]], words[: at[-1]] + words[at[-1] + 1 :]
    if "".join(words) in _BODY_RATES:
        return _BODY_RATES["".join(words)], ["rate"]
    for i in range(len(words) - 1, -1, -1):
        match = _GLUED.fullmatch(words[i])
        if match and (match[1] in _STEMS or (i == 0 and match[1] in (*GYRO_LETTERS, *ACCEL_LETTERS, "d"))):
            return _AXES[match[2]], [*words[:i], match[1], *words[i + 1 :]]
    out = [i for i, word in enumerate(words) if word in ("xout", "yout", "zout")]
    if len(out) == 1 and _STEMS & set(words):  # GYRO_XOUT
        return _AXES[words[out[0]][0]], words[: out[0]] + words[out[0] + 1 :]
    before = _GLUED_BEFORE.fullmatch(words[0]) if words else None
    if before and before[2] in _STEMS:  # xgyro_out
        return _AXES[before[1]], [before[2], *words[1:]]
    at = [i for i, word in enumerate(words) if word in _DIRECTIONS]
    if len(at) == 1 and _STEMS & set(words):
        return _DIRECTIONS[words[at[0]]], words[: at[0]] + words[at[0] + 1 :]
    digits = [i for i, word in enumerate(words) if word in ("0", "1", "2", "3")]
    if digits and digits[-1] == len(words) - 1:
        return int(words[-1]), words[:-1]  # put right by `triples`, which knows whether they count from 0 or 1
    if len(digits) == 1 and _STEMS & set(words):  # XV1 rotation rate
        return int(words[digits[0]]), words[: digits[0]] + words[digits[0] + 1 :]
    return None, words


def _kind(words: list[str], axis: int | None, found: dict[str, str], *, stated: bool) -> tuple[str, bool]:
    """The kind of a column by its words, its axis and its unit, and whether it holds increments.

    A unit of time that is `stated` behind the title, or parts of a second at its end, make a time of words that are
    not known.
    """
    if axis is not None and words and set(words) & OTHER_WORDS:
        return "", False
    kind, increments = ("", False) if axis is None else _sensor(words, found)
    other = kind or (_other(words) if axis is None or not words else "")
    timed = (stated or found.get("time") in ("ms", "us", "ns")) and "time" in found and (axis is None or not words)
    if not other and timed and not set(words) & (OTHER_WORDS | SPAN_WORDS):
        other = "time"
    return other, increments


def _sensor(words: list[str], found: dict[str, str]) -> tuple[str, bool]:
    have = set(words)
    tables = (("gyro", True, ANGLE_WORDS), ("accel", True, VELOCITY_WORDS), ("gyro", False, GYRO_WORDS),
              ("accel", False, ACCEL_WORDS))  # fmt: skip
    for kind, increments, table in tables:
        if any(set(group) <= have for group in table):
            return kind, increments
    for kind, letters, other in (("gyro", GYRO_LETTERS, "accel"), ("accel", ACCEL_LETTERS, "gyro")):
        if words and words[0] in letters and not (other in found and kind not in found):
            return kind, False
    # A unit tells too: X (deg/s), alpha_x [m/s^2].
    return ("gyro" if "gyro" in found else "accel" if "accel" in found else ""), False


def _other(words: list[str]) -> str:
    """Time, a part of it, or a counter."""
    have = set(words)
    if have & {"week", "gpsweek", "wn"} and not have & {"seconds", "second", "sec", "time"}:
        return "week"
    for kind, names in (("hour", ("hour", "hours", "hh", "hr")), ("minute", ("minute", "minutes", "min", "mm"))):
        if len(words) == 1 and words[0] in names:
            return kind
    if "date" in have and have <= {"date", "day", "utc", "gps"}:
        return "date"
    if have == {"offset", "time"} or (have & TIME_WORDS and not have & (OTHER_WORDS - {"gps"})):
        return "time"
    return "counter" if have & COUNTER_WORDS else ""


def triples(titles: Sequence[str], parts: Sequence[Title]) -> list[Triple]:
    """The triples among the titles of a file, in their order."""
    families: dict[tuple[str, tuple[str, ...], bool], dict[int, list[int]]] = {}
    for position, part in enumerate(parts):
        if part.kind in ("gyro", "accel") and part.axis is not None:
            families.setdefault((part.kind, part.words, part.increments), {}).setdefault(part.axis, []).append(position)
    found = []
    for (kind, words, increments), family in families.items():
        axes = sorted(family)
        if axes not in ([0, 1, 2], [1, 2, 3]):
            continue
        for x, y, z in _by_unit([family[axis] for axis in axes], parts):
            units = {parts[position].unit for position in (x, y, z)}
            unit = units.pop() if len(units) == 1 else None
            scale = parts[x].scale if len({parts[position].scale for position in (x, y, z)}) == 1 else float("nan")
            worded = all(parts[position].worded for position in (x, y, z))
            text = label(titles[x], titles[z])
            found.append(Triple(kind, (x, y, z), text, unit, True if increments else None, scale, words, worded))
    return found


def _by_unit(family: Sequence[Sequence[int]], parts: Sequence[Title]) -> list[tuple[int, int, int]]:
    """The triples of one sensor: one, or where it is there twice those of one unit each."""
    found: list[tuple[int, int, int]] = []
    for unit in dict.fromkeys(parts[position].unit for position in family[0]) if len(family[0]) > 1 else (None,):
        alike = [[i for i in axis if len(family[0]) == 1 or parts[i].unit == unit] for axis in family]
        if all(len(axis) == 1 for axis in alike):
            found.append((alike[0][0], alike[1][0], alike[2][0]))
    return found


def label(first: str, last: str) -> str:
    """Two titles of a triple as one text.

    Examples
    --------
    >>> label("Gyro X (deg/s)", "Gyro Z (deg/s)"), label("gyro[0]", "gyro[2]"), label("column 17", "column 19")
    ('Gyro X..Z (deg/s)', 'gyro[0..2]', 'column 17..19')
    """
    same = 0
    while same < min(len(first), len(last)) and first[same] == last[same]:
        same += 1
    while 0 < same < len(last) and first[same - 1].isdigit() and last[same].isdigit():  # 17..19, not 17..9
        same -= 1
    if same < len(first) and not first[same].isdigit() and first[same + 1 :] != last[same + 1 :]:
        return f"{first}..{last}"  # RollRate..YawRate
    end = same + 1
    while end < len(first) and first[end].isdigit():
        end += 1
    return f"{first[:end]}..{last[same:]}" if same < len(last) else f"{first}..{last}"
