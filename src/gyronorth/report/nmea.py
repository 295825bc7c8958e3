"""NMEA 0183 sentences of a heading, and sets of them for different receivers.

HETHS carries the heading and a mode: A it is valid, E it is carried on by the gyro since the unit moved, S it is
played back, V it is not valid, and the field is empty. HEHDT has no mode, and receivers read an empty field as north:
it is sent only with a valid heading that is being measured, never of a replay. HEROT is the rate of turn in degrees a
minute, negative to port, A, or V and an empty field. Heading has two decimals where sigma is below 0.1 deg, else one.

The status sentence is proprietary::

    $PGNRS,status,heading,sigma,low,high,method,count,reasons*hh

    status   A the heading is valid; V it is not, and there is no HEHDT
    heading  degrees true, xxx.x; empty when none could be computed
    sigma    one standard deviation, degrees; empty when unknown
    low,high the 95 % interval, degrees true, clockwise from low to high
    method   mean, inertial, ..., held
    count    number of reasons for which the heading is not valid
    reasons  their codes joined by ";", as many as fit in the 82 characters of a sentence
    hh       exclusive or of the characters between $ and *, hexadecimal

The set "octans" is HEHDT, PHTRO (pitch, M bow up or P bow down; roll, T port up or B port down), PHTRH (the same, and
heave) and the status word PHINF, bits 0 to 3: heading, roll, pitch, position not valid (Reson, SeaBat 8101 Operator's
Manual 3.02, p. 6-25). Heave is not measured here: its two fields are empty, and bit 3, which stands for the position
that heave is part of, is always set. Surge, sway and speed (PHLIN, PHSPD) are not sent. The order of the fields of
PHTRH is that of a recorded one of an Octans ($PHTRH,1.81,M,1.69,B,0.16,O).

Sentences end with carriage return and line feed.
"""

from __future__ import annotations

from functools import reduce
from math import degrees
from typing import TYPE_CHECKING, Literal

from gyronorth.report.wording import heading_text

if TYPE_CHECKING:
    from gyronorth.estimate import HeadingEstimate

#: Longest sentence, from $ to line feed: IEC 61162-1 (2010), 7.2.1.
LONGEST = 82
#: Below this sigma, deg, a heading has two decimals.
FINE = 0.1
#: Mode of HETHS.
Mode = Literal["A", "E", "S", "V"]
#: Status word of PHINF: bits of what is not valid.
_NO_HEADING, _NO_ROLL, _NO_PITCH, _NO_POSITION = 1, 2, 4, 8


def sentences(estimate: HeadingEstimate) -> tuple[str, ...]:
    """HETHS, HEHDT where the heading is valid, and the status sentence, each with checksum and line end."""
    heading = _heading(estimate)
    mode = "V" if heading is None else "A"
    return _ths(heading, mode), *_hdt(heading), _status(estimate)


def running_sentences(
    estimate: HeadingEstimate | None, *, kind: str, mode: Mode, rate_of_turn: float | None
) -> tuple[str, ...]:
    """The sentences of a running instrument.

    Parameters
    ----------
    estimate : HeadingEstimate or None
        What is given out now; None before the first.
    kind : str
        A set of `catalogue.NMEA_SETS`.
    mode : str
        How the heading came about, as HETHS says it; one that is not valid has "V" whatever this is.
    rate_of_turn : float or None
        rad/s, positive to starboard.
    """
    heading = None if estimate is None else _heading(estimate)
    measured = heading if mode in ("A", "E") else None
    if kind == "octans":
        return *_hdt(measured), *_octans(estimate, measured)
    turn = rate_of_turn if mode in ("A", "E") else None
    parts = (
        *([] if kind == "hdt" else [_ths(heading, "V" if heading is None else mode)]),
        *([] if kind == "ths" else _hdt(measured)),
        sentence("HEROT,,V" if turn is None else f"HEROT,{round(degrees(turn) * 60, 1) + 0.0:.1f},A"),
    )
    return *parts, _NOTHING_KNOWN if estimate is None else _status(estimate)


def _heading(estimate: HeadingEstimate) -> str | None:
    """The field of a valid heading."""
    heading, sigma = estimate.heading_deg, estimate.sigma_deg
    if not estimate.valid or heading is None:
        return None
    return _field(heading, sigma)


def _field(heading_deg: float, sigma_deg: float | None) -> str:
    fine = sigma_deg is not None and sigma_deg < FINE
    return heading_text(heading_deg, decimals=2, width=6) if fine else heading_text(heading_deg, decimals=1, width=5)


def _ths(heading: str | None, mode: Mode) -> str:
    return sentence(f"HETHS,{heading or ''},{mode}")


def _hdt(heading: str | None) -> tuple[str, ...]:
    return () if heading is None else (sentence(f"HEHDT,{heading},T"),)


def _octans(estimate: HeadingEstimate | None, measured: str | None) -> tuple[str, ...]:
    if measured is None or estimate is None or estimate.roll_deg is None or estimate.pitch_deg is None:
        missing = _NO_ROLL | _NO_PITCH | _NO_POSITION | (_NO_HEADING if measured is None else 0)
        return (sentence(f"PHINF,{missing:08X}"),)
    roll, pitch = estimate.roll_deg, estimate.pitch_deg
    tilt = f"{abs(pitch):.2f},{'M' if pitch >= 0 else 'P'},{abs(roll):.2f},{'T' if roll >= 0 else 'B'}"
    return sentence(f"PHTRO,{tilt}"), sentence(f"PHTRH,{tilt},,"), sentence(f"PHINF,{_NO_POSITION:08X}")


def _status(estimate: HeadingEstimate) -> str:
    doc = estimate.to_json()
    heading = "" if doc["heading_deg"] is None else _field(doc["heading_deg"], doc["sigma_deg"])
    low, high = (heading_text(limit, decimals=1, width=5, full_turn=True) for limit in doc["interval95_deg"])
    sigma = "" if doc["sigma_deg"] is None else f"{doc['sigma_deg']:.2f}"
    codes = [reason["code"] for reason in doc["reasons"]]
    status = ",".join(
        ["PGNRS", "A" if doc["valid"] else "V", heading, sigma, low, high, doc["method"], str(len(codes))]
    )
    return sentence(_with_reasons(status, codes))


def sentence(body: str) -> str:
    """`body` between $ and its checksum, with the line end."""
    checksum = reduce(lambda total, byte: total ^ byte, body.encode("ascii"), 0)
    return f"${body}*{checksum:02X}\r\n"


_NOTHING_KNOWN = sentence("PGNRS,V,,,000.0,360.0,,0,")


def _with_reasons(status: str, codes: list[str]) -> str:
    """The status and as many codes as the longest sentence allows."""
    while codes and len(sentence(f"{status},{';'.join(codes)}")) > LONGEST:
        codes = codes[:-1]
    return f"{status},{';'.join(codes)}"
