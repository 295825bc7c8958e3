"""Text exports of Xsens MT Manager (.txt): comment lines `// key: value`, a header, tabs between fields.

Gyr_* is in rad/s, Acc_* in m/s^2, and the sensor's axes are forward-left-up as it lies on its
base. The packet counter says which samples are missing but not the rate: "an incremental
number that comes with each packet" (MTi User Manual MT0605P, 4.12.1), whose step differs from
model to model. SampleTimeFine counts tenths of a millisecond (4.12.3) and does give the rate.
"""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

from gyronorth.errors import InputError
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.options import ReadOptions, choose_columns
from gyronorth.readers.source import FORCES, NAMES, RATES, TIME, Clock, Facts, Source
from gyronorth.readers.text import Layout, text_blocks, text_parts
from gyronorth.readers.text_head import TextHead

_TIME_FINE, _COUNTER = "SampleTimeFine", "PacketCounter"
_ALIASES = (
    {TIME: (_TIME_FINE, _COUNTER)}
    | {name: (f"Gyr_{name[-1].upper()}",) for name in RATES}
    | {name: (f"Acc_{name[-1].upper()}",) for name in FORCES}
)
_CLOCKS = {
    _TIME_FINE: Clock(unit=1e-4, wrap=2.0**32, name=_TIME_FINE),
    _COUNTER: Clock(unit=None, wrap=2.0**16, name=_COUNTER),
}
_UPDATE_RATE = re.compile(r"//\s*Update Rate:\s*([0-9.]+)\s*Hz", re.IGNORECASE)


def open_mt_manager(path: Path, options: ReadOptions) -> Source:
    """Open a text export of MT Manager."""
    rate_hz = None
    with TextHead(path) as head:
        while (line := head.take()) is not None and (line.startswith("//") or not line.strip()):
            match = _UPDATE_RATE.match(line)
            if match:
                rate_hz = _rate(match[1], head)
        if line is None:
            raise InputError(f"{path.name} ends before its header; a line with Gyr_X, Gyr_Y, Gyr_Z is expected.")
        titles = [title.strip() for title in line.rstrip("\t ").split("\t")]
        if len(titles) == 1 and any(delimiter in line for delimiter in ",; "):
            raise InputError(
                f"Row {head.row} of {path.name}, the header, has no tabs between its fields; an export of MT Manager "
                "has. Export it again with tabs, or rename the file to .csv and declare its columns."
            )
        trailing = (head.peek() or "").rstrip(" ").endswith("\t")
        offset, row = head.offset, head.row
    found = choose_columns(titles, options.columns, _ALIASES, path.name)
    columns = tuple(name for name in NAMES if name in found)
    layout = Layout(tuple(titles), tuple(found[name] for name in columns), "\t", trailing)
    clock = None
    if TIME in found:
        title = titles[found[TIME]]
        clock = _CLOCKS.get(title, Clock(unit=1.0, name=title))
    return Source(
        format="mt-manager",
        name=path.name,
        columns=columns,
        blocks=partial(text_blocks, path, offset, row, layout),
        stated=Facts(rate_hz=rate_hz),
        usual=Facts(gyro_unit="rad/s", accel_unit="m/s2", axes="flu"),
        axes_defined=True,
        clock=clock,
        parts=text_parts(path, offset, row, layout),
    )


def _rate(text: str, head: TextHead) -> float:
    try:
        rate_hz = float(text)
    except ValueError:
        rate_hz = 0.0
    if not 1e-3 <= rate_hz <= 1e6:
        raise InputError(f"Row {head.row} of {head.name}: Update Rate is {text!r}; a rate in Hz is expected.")
    return rate_hz


def _recognises(head: bytes) -> bool:
    """Whether comments of MT Manager, or its columns, are at the start of a file."""
    own = (b"Start Time", b"Update Rate", b"PacketCounter")
    return b"PacketCounter\t" in head or (head.startswith(b"//") and any(word in head for word in own))


FORMAT = Format(
    format_info("mt-manager"),
    open_mt_manager,
    recognises=_recognises,
)
