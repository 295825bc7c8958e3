"""How people write units: the spellings of titles, unit rows and preambles, as data.

Published in the guide "Files and declarations"; a test reads every line of that table.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import inf

#: Unit -> its spellings, in lower case, without blanks, dots and brackets, "°" as deg, "^" left out.
GYRO_SPELLINGS: dict[str, tuple[str, ...]] = {
    "rad/s": ("rad/s", "rad/sec", "rads", "radps", "rad_s", "rads-1", "radian/s", "radians/s", "radpersec",
              "radian/sec", "radians/sec", "rad/second", "radians/second", "rad_per_s", "radians_per_second", "рад/с",
              "рад/сек", "rad/seg", "rad/sek", "rad/秒", "弧度/秒", "弧度/s", "ラジアン/秒"),
    "deg/s": ("deg/s", "deg/sec", "degs", "degps", "dps", "deg_s", "degs-1", "degree/s", "degrees/s", "degree/sec",
              "degrees/sec", "deg/second", "degrees/second", "deg_per_s", "degrees_per_second", "degpersec", "dps_",
              "d/s", "deg/с", "град/с", "град/сек", "гр/с", "graus/s", "grados/s", "grados/seg", "gradi/s", "gradi/sec",
              "graden/s", "grader/s", "stopni/s", "stopnie/s", "derece/s", "degrés/s", "degrés/sec", "deg/seg",
              "度/秒", "度/s", "도/초", "도/s"),
    "deg/h": ("deg/h", "deg/hr", "deg/hour", "degh", "degph", "dph", "deg_h", "degh-1", "degree/h", "degrees/h",
              "degrees/hour", "deg_hr", "deg/ч", "deg/час", "град/ч", "град/час",
              "graus/h", "grados/h", "gradi/h", "graden/h", "grader/h", "degrés/h", "度/小时", "度/h"),
    "mdeg/s": ("mdeg/s", "mdps", "millideg/s", "mdeg/sec", "mdegs", "mdeg_s"),
    "mrad/s": ("mrad/s", "mrad/sec", "mrads", "mradps", "mrad_s"),
    "arcsec/s": ("arcsec/s", "as/s", "asec/s", "arcsec/sec", "arcsecond/s", "arcseconds/s", '"/s', "''/s", "arcsec_s"),
    "urad/s": ("urad/s", "urad/sec", "microrad/s", "uradps"),
    "deg/min": ("deg/min", "degree/min", "degrees/min", "deg/minute", "dpm"),
    "rpm": ("rpm", "rev/min", "r/min"),
}  # fmt: skip
ACCEL_SPELLINGS: dict[str, tuple[str, ...]] = {
    "m/s2": ("m/s2", "m/s/s", "m/s**2", "ms2", "mps2", "ms-2", "m_s2", "m_s_2", "mss", "m/ss", "m/sec2",
             "mpss", "m/s²", "meters/second2", "m/second2", "mps_2", "meterpersec2",
             "м/с2", "м/с/с", "м/сек2", "m/sec/sec", "m/seg2", "m/sek2", "米/秒2"),
    "g": ("g", "gn", "g0", "gs", "gee", "standard_gravity"),
    "mg": ("mg", "millig", "milli-g", "mgee"),
    "ug": ("ug", "microg", "micro-g"),
    "cm/s2": ("cm/s2", "gal", "cms-2"),
    "mm/s2": ("mm/s2", "mms-2", "mm/s/s"),
    "ft/s2": ("ft/s2", "ft/sec2", "fps2"),
}  # fmt: skip
#: Angle and velocity a sample, by the unit that their sum over a second has.
ANGLE_SPELLINGS: dict[str, tuple[str, ...]] = {
    "rad/s": ("rad", "radian", "radians", "rad/sample"),
    "deg/s": ("deg", "degree", "degrees", "deg/sample"),
    "mrad/s": ("mrad",),
    "urad/s": ("urad", "microrad"),
    "mdeg/s": ("mdeg",),
    "arcsec/s": ("arcsec", "arcs", "arcsecond", "arcseconds", "asec", "arcsec/sample"),
}
VELOCITY_SPELLINGS: dict[str, tuple[str, ...]] = {
    "m/s2": ("m/s", "mps", "ms-1", "m/sec", "m_s", "m/s/sample"),
    "cm/s2": ("cm/s",),
    "mm/s2": ("mm/s",),
    "g": ("gs", "g*s", "g·s", "gsec"),
}
TIME_SPELLINGS: dict[str, tuple[str, ...]] = {
    "s": (
        "s",
        "sec",
        "secs",
        "second",
        "seconds",
        "с",
        "сек",
        "秒",
        "초",
        "seg",
        "segs",
        "segundo",
        "segundos",
        "sek",
        "sekunde",
        "sekunden",
        "seconde",
        "secondes",
        "secondi",
        "saniye",
    ),
    "ms": (
        "ms",
        "мс",
        "毫秒",
        "ミリ秒",
        "밀리초",
        "msec",
        "msecs",
        "millis",
        "millisecond",
        "milliseconds",
        "millisec",
    ),
    "us": ("us", "мкс", "微秒", "usec", "usecs", "micros", "microsecond", "microseconds", "microsec"),
    "ns": ("ns", "нс", "nsec", "nsecs", "nanos", "nanosecond", "nanoseconds", "nanosec"),
}
#: s in longer units of time, which stand in brackets only.
LONG_TIMES = (
    (60.0, ("min", "mins", "minute", "minutes")),
    (3600.0, ("h", "hr", "hrs", "hour", "hours")),
    (86400.0, ("d", "day", "days")),
)
#: Units that are a multiple of one of ours, and their spellings.
MULTIPLES: dict[tuple[float, str], tuple[str, ...]] = {
    (1e-3, "urad/s"): ("nrad/s", "nanorad/s", "nradps"),
    (1e-3, "arcsec/s"): ("mas/s", "marcsec/s"),
    (360.0, "deg/s"): ("rev/s", "rev/sec", "turn/s"),
    (0.9, "deg/s"): ("gon/s",),  # grad/s is that, or German for deg/s: it is asked
    (1e-3, "cm/s2"): ("mgal",),
    (1e-3, "ug"): ("ng",),
}
#: Longest text that can be a unit.
LONGEST = 80
_SCALED = re.compile(
    r"\s*[x*×]?\s*(?:10\^?(-\d+)|(\d+(?:\.\d*)?(?:e[+-]?\d+)?))\s*[x*×·]?\s*([^\d\s^.,].*)", re.IGNORECASE
)
_POWER = re.compile(r"(?<=[a-z])(s|h|hr|min)-([12])$")
#: Characters of a line that may say what a count is.
LONGEST_STATEMENT = 200
_COUNT = r"(?:LSBs?|counts?|digits?|bits?)"
_STATED = r"(\d{1,9}(?:\.\d{1,12})?(?:e[+-]?\d{1,2})?)\s*"
_PER_UNIT = re.compile(rf"{_STATED}{_COUNT}\s*(?:/|per)\s*(\([^()\s]{{1,12}}\)|[^()\s,;]{{1,12}})", re.IGNORECASE)
_PER_COUNT = re.compile(rf"{_STATED}(\([^()\s]{{1,12}}\)|[^()\s,;]{{1,12}}?)\s*(?:/|per)\s*{_COUNT}\b", re.IGNORECASE)
_PLAIN = str.maketrans(
    {"°": "deg", "º": "deg", "˚": "deg", "µ": "u", "μ": "u", "²": "2", "⁻": "-", "¹": "1", "−": "-", "·": "",
     "⋅": "", "*": "", "(": "", ")": "", "[": "", "]": "", "{": "", "}": "", "\ufffd": "deg"}
)  # fmt: skip


def spelled(text: str, spellings: dict[str, tuple[str, ...]]) -> str | None:
    """The unit that a text spells; None if it spells none of them.

    Examples
    --------
    >>> spelled("deg.s-1", GYRO_SPELLINGS), spelled("m.s-2", ACCEL_SPELLINGS)
    ('deg/s', 'm/s2')
    >>> spelled("[rad s^-1]", GYRO_SPELLINGS), spelled("°/s", GYRO_SPELLINGS), spelled("m/s²", ACCEL_SPELLINGS)
    ('rad/s', 'deg/s', 'm/s2')
    """
    plain = re.sub(r"\s+", "", text.strip().translate(_PLAIN)).lower()
    plain = plain.replace("^-", "-").replace("^", "").replace(".", "")
    divided = _POWER.sub(lambda match: f"/{match[1]}{match[2].replace('1', '')}", plain)  # mrads-1 is mrad/s
    for unit, known in spellings.items():
        if plain in known or divided in known:
            return unit
    return None


def scaled(text: str) -> tuple[float, str]:
    """How many of a unit one number counts, and that unit.

    Examples
    --------
    >>> scaled("0.01 deg/s"), scaled("100us"), scaled("10^-3 g"), scaled("deg/s"), scaled("min"), scaled("nrad/s")
    ((0.01, 'deg/s'), (100.0, 'us'), (0.001, 'g'), (1.0, 'deg/s'), (60.0, 's'), (0.001, 'urad/s'))
    """
    for (scale, unit), names in MULTIPLES.items():
        if spelled(text, {unit: names}):
            return scale, unit
    for seconds, names in LONG_TIMES:
        if text.strip().lower() in names:
            return seconds, "s"
    match = _SCALED.fullmatch(text) if len(text) <= LONGEST else None
    if match is None:
        return 1.0, text
    scale = float(f"1e{match[1]}" if match[1] else match[2])
    return (scale, match[3]) if 0 < scale < inf else (1.0, text)


def counts_in(lines: Iterable[str]) -> dict[str, tuple[str, float, str]]:
    """What lines say of counts: gyro or accel -> unit, units in one count, and the words that say so.

    Examples
    --------
    >>> counts_in(["# gyro: 125 LSB/(deg/s), accel: 16384 LSB/g", "# temperature: 340 LSB/degC"])
    {'gyro': ('deg/s', 0.008, '125 LSB/(deg/s)'), 'accel': ('g', 6.103515625e-05, '16384 LSB/g')}
    >>> counts_in(["gyro 8.75 mdps/digit"])
    {'gyro': ('mdeg/s', 8.75, '8.75 mdps/digit')}
    """
    found: dict[str, tuple[str, float, str]] = {}
    for line in lines:
        for pattern, power in ((_PER_UNIT, -1), (_PER_COUNT, 1)):
            for match in pattern.finditer(line[:LONGEST_STATEMENT]):
                number = float(match[1])
                for sensor, table in (("gyro", GYRO_SPELLINGS), ("accel", ACCEL_SPELLINGS)):
                    if number > 0 and (unit := spelled(match[2], table)):
                        found.setdefault(sensor, (unit, number**power, match[0].strip()))
    return found


def is_unit(text: str) -> bool:
    """Whether a cell of a row below the titles holds nothing but a unit."""
    tables = (GYRO_SPELLINGS, ACCEL_SPELLINGS, ANGLE_SPELLINGS, VELOCITY_SPELLINGS, TIME_SPELLINGS, _OTHERS)
    return any(spelled(each, table) is not None for table in tables for each in (text, scaled(text)[1]))


#: Units of other columns, which a row of units holds too.
_OTHERS: dict[str, tuple[str, ...]] = {
    "other": ("", "-", "--", "n/a", "none", "1", "degc", "c", "celsius", "degf", "k", "pa", "hpa", "mbar", "kpa", "ut",
              "nt", "t", "gauss", "mgauss", "m", "v", "mv", "ma", "mah", "hz", "%", "bool", "count", "counts", "lsb",
              "#", "unitless", "km/h", "utc", "week", "weeks", "h", "min", "ft", "days"),
}  # fmt: skip
