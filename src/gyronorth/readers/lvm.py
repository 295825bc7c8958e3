"""What stands above the titles of LabVIEW's measurement files (.lvm): the units of the channels and their time step."""

from __future__ import annotations

from collections.abc import Sequence

#: How the last line of a header begins; a file may have two.
END_OF_HEADER = "***End_of_Header***"
#: Titles of the time and of the remarks, which are no channels.
TIME, COMMENT = "X_Value", "Comment"


def stated(header: Sequence[Sequence[str]], titles: Sequence[str]) -> tuple[tuple[str, ...], float | None]:
    """The units of the columns, "" for none, or () without any; and the rate, Hz, of a file without a time."""
    lines = {fields[0]: fields[1:] for fields in header if fields}
    units = lines.get("Y_Unit_Label", ())
    channels = [i for i, title in enumerate(titles) if title not in (TIME, COMMENT)]
    found = dict(zip(channels, units, strict=False))
    named = tuple(found.get(i, "") for i in range(len(titles))) if any(units) and len(channels) <= len(units) else ()
    try:
        step = 0.0 if TIME in titles else float(lines.get("Delta_X", ("0",))[0].replace(",", "."))
    except ValueError:
        step = 0.0
    return named, 1 / step if step > 0 else None
