"""The facts of a recording as texts by key: comment lines of a CSV, attributes and metadata of other formats."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal, localcontext

from gyronorth import catalogue
from gyronorth.errors import InputError
from gyronorth.readers.axes import mat_bf
from gyronorth.readers.options import ACCEL_UNITS, GYRO_UNITS
from gyronorth.readers.source import Facts
from gyronorth.recording import Gap, shift_utc

#: Key and value that say that `write` made the file: units, axes and rate are SI and stated.
SIGNATURE = ("format", "gyronorth.recording/1")
#: All keys, in the order in which they are written.
KEYS = (
    SIGNATURE[0], "rate_hz", "gyro_unit", "accel_unit", "axes", "axes_assumed", "latitude_deg", "heading_true_deg",
    "start_time_utc", "session", "samples", "rows_dropped", "gaps", "warnings",
)  # fmt: skip
_CODES = frozenset(each.code for each in catalogue.FINDINGS)
_PI = Decimal("3.14159265358979323846264338327950288")
#: Significant digits that tell any two doubles apart after a change of unit.
_DIGITS = range(15, 22)


def read_facts(texts: Mapping[str, str], where: Callable[[str], str]) -> tuple[Facts, bool]:
    """The facts in `texts`, and whether gyronorth wrote them; `where(key)` says for messages where a text stands.

    Raises
    ------
    InputError
        If a text is not what its key promises.
    """

    def value(key: str, low: float, high: float) -> str | None:
        text = texts.get(key)
        if text is not None and not (is_number(text) and low <= float(text) <= high):
            raise InputError(f"{where(key)}: {key} is {text[:60]!r}; a number of {low:g} to {high:g} is expected.")
        return text

    def gaps() -> tuple[Gap, ...]:
        text = texts.get("gaps", "")
        entries = [entry.partition(":")[::2] for entry in text.split()]
        if not all(is_number(start) and re.fullmatch("[0-9]{1,12}", count) for start, count in entries):
            raise InputError(f"{where('gaps')}: gaps is {text[:60]!r}; START:SAMPLES ... is expected.")
        return tuple(Gap(float(start), int(count)) for start, count in entries)

    def choice(key: str, choices: Mapping[str, float]) -> str | None:
        text = texts.get(key)
        if text is not None and text not in choices:
            raise InputError(f"{where(key)}: {key} is {text[:60]!r}; one of {', '.join(choices)} is expected.")
        return text

    def understood(key: str, take: Callable[[str], object]) -> str | None:
        text = texts.get(key)
        try:
            if text is not None:
                take(text)
        except InputError as error:
            raise InputError(f"{where(key)}: {error}") from None
        return text

    increments = texts.get("increments") or False
    if increments not in (False, "gyro", "accel", "both"):
        raise InputError(f"{where('increments')}: increments is {increments!r:.60}; gyro, accel or both is expected.")
    assumed = understood("axes_assumed", mat_bf)
    axes, start = understood("axes", mat_bf), understood("start_time_utc", lambda text: shift_utc(text, 0.0))
    latitude_deg, heading_deg = value("latitude_deg", -90, 90), value("heading_true_deg", -360, 360)
    rate_hz, samples, dropped = value("rate_hz", 1e-3, 1e6), value("samples", 1, 1e12), value("rows_dropped", 0, 1e12)
    facts = Facts(
        rate_hz=None if rate_hz is None else float(rate_hz),
        gyro_unit=choice("gyro_unit", GYRO_UNITS),
        accel_unit=choice("accel_unit", ACCEL_UNITS),
        axes=axes,
        axes_assumed=assumed,
        latitude=None if latitude_deg is None else _radians(latitude_deg),
        heading_true=None if heading_deg is None else _radians(heading_deg),
        increments=increments,
        session=texts.get("session"),
        start_time_utc=start,
        samples=None if samples is None else int(float(samples)),
        rows_dropped=int(float(dropped or 0)),
        gaps=gaps(),
        warnings=_warnings(texts, where),
    )
    return facts, texts.get(SIGNATURE[0]) == SIGNATURE[1] and facts.gyro_unit == "rad/s"


def _warnings(texts: Mapping[str, str], where: Callable[[str], str]) -> tuple[tuple[str, float | None], ...]:
    """Codes with their values: "time_jitter=0.43 cut_off"."""
    entries = [entry.partition("=")[::2] for entry in texts.get("warnings", "").split()]
    if not all(code in _CODES and (not value or is_number(value)) for code, value in entries):
        raise InputError(f"{where('warnings')}: warnings is {texts['warnings'][:60]!r}; CODE=VALUE ... is expected.")
    return tuple((code, float(value) if value else None) for code, value in entries)


def write_facts(facts: Facts) -> dict[str, str]:
    """The texts of `facts`, in SI and as `read_facts` takes them.

    Raises
    ------
    InputError
        If a text would not read back: it has line breaks or spaces around it.
    """
    values = {
        SIGNATURE[0]: SIGNATURE[1],
        "rate_hz": repr(facts.rate_hz),
        "gyro_unit": facts.gyro_unit,
        "accel_unit": facts.accel_unit,
        "axes": facts.axes,
        "axes_assumed": facts.axes_assumed,
        "latitude_deg": None if facts.latitude is None else _degrees(facts.latitude),
        "heading_true_deg": None if facts.heading_true is None else _degrees(facts.heading_true, turns=True),
        "start_time_utc": facts.start_time_utc,
        "session": facts.session,
        "samples": str(facts.samples),
        "rows_dropped": str(facts.rows_dropped) if facts.rows_dropped else None,
        "gaps": " ".join(f"{gap.start!r}:{gap.samples}" for gap in facts.gaps) or None,
        "warnings": warnings_text(facts.warnings) or None,
    }
    texts = {key: text for key, text in values.items() if text is not None}
    for key, text in texts.items():
        if text != text.strip() or len(text.splitlines()) != 1 or "\x00" in text:
            raise InputError(f"{key} is {text!r}; one line of text without spaces around it is expected.")
    return texts


def warnings_text(warnings: Iterable[tuple[str, float | None]]) -> str:
    """What was said of a recording, as `read_facts` takes it."""
    return " ".join(code if value is None else f"{code}={value!r}" for code, value in warnings)


def is_number(text: str) -> bool:
    """Whether `float` takes it, and no underscore is in it."""
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def _radians(degrees: str) -> float:
    return float(Decimal(degrees) * _PI / 180)


def _degrees(angle: float, *, turns: bool = False) -> str:
    """The shortest degrees that `_radians` turns into the same double; with `turns`, within [0, 360)."""
    exact = Decimal(angle) * 180 / _PI
    if turns and not 0 <= exact < 360:
        exact = (exact % 360 + 360) % 360
    text = ""
    for digits in _DIGITS:
        with localcontext() as context:
            context.prec = digits
            text = f"{exact.normalize():f}"
        if _radians(text) == angle:
            break
    return text
