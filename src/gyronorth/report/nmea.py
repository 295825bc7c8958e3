"""NMEA 0183 sentences of a heading: HETHS and HEHDT, and a status sentence that says whether it may be used.

HETHS carries the heading and a mode: A it is valid, S it is valid and played back, V it is not, and the
field is empty. HEHDT has no mode, and receivers read an empty field as north: it is sent only with a
valid heading. Both have two decimals where sigma is below 0.1 deg, else one.

The status sentence is proprietary::

    $PGNRS,status,heading,sigma,low,high,method,count,reasons*hh

    status   A the heading is valid; V it is not, and there is no HEHDT
    heading  degrees true, xxx.x; empty when none could be computed
    sigma    one standard deviation, degrees; empty when unknown
    low,high the 95 % interval, degrees true, clockwise from low to high
    method   mean, inertial, ...
    count    number of reasons for which the heading is not valid
    reasons  their codes joined by ";", as many as fit in the 82 characters of a sentence
    hh       exclusive or of the characters between $ and *, hexadecimal

Sentences end with carriage return and line feed.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

from gyronorth.report.wording import heading_text

if TYPE_CHECKING:
    from gyronorth.estimate import HeadingEstimate

#: Longest sentence, from $ to line feed: IEC 61162-1 (2010), 7.2.1.
LONGEST = 82


#: Below this sigma, deg, a heading has two decimals.
FINE = 0.1


def sentences(estimate: HeadingEstimate, *, replay: bool = False) -> tuple[str, ...]:
    """HETHS, HEHDT where the heading is valid, and the status sentence, each with checksum and line end."""
    doc = estimate.to_json()
    fine = doc["sigma_deg"] is not None and doc["sigma_deg"] < FINE
    decimals, width = (2, 6) if fine else (1, 5)
    heading = "" if doc["heading_deg"] is None else heading_text(doc["heading_deg"], decimals=decimals, width=width)
    low, high = (heading_text(limit, decimals=1, width=5, full_turn=True) for limit in doc["interval95_deg"])
    sigma = "" if doc["sigma_deg"] is None else f"{doc['sigma_deg']:.2f}"
    codes = [reason["code"] for reason in doc["reasons"]]
    verdict = "A" if doc["valid"] else "V"
    status = ",".join(["PGNRS", verdict, heading, sigma, low, high, doc["method"], str(len(codes))])
    verdict = sentence(_with_reasons(status, codes))
    if not doc["valid"]:
        return NOT_VALID, verdict
    return sentence(f"HETHS,{heading},{'S' if replay else 'A'}"), sentence(f"HEHDT,{heading},T"), verdict


def no_heading() -> tuple[str, str]:
    """The sentences while nothing is known of the heading."""
    return NOT_VALID, sentence("PGNRS,V,,,000.0,360.0,,0,")


def sentence(body: str) -> str:
    """`body` between $ and its checksum, with the line end."""
    checksum = reduce(lambda total, byte: total ^ byte, body.encode("ascii"), 0)
    return f"${body}*{checksum:02X}\r\n"


NOT_VALID = sentence("HETHS,,V")


def _with_reasons(status: str, codes: list[str]) -> str:
    """The status and as many codes as the longest sentence allows."""
    while codes and len(sentence(f"{status},{';'.join(codes)}")) > LONGEST:
        codes = codes[:-1]
    return f"{status},{';'.join(codes)}"
