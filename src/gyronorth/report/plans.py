"""A plan as text: heading sigma against time and latitude, and how long waiting helps."""

from __future__ import annotations

from typing import TYPE_CHECKING, TextIO

from gyronorth.report.terminal import print_lines, print_table
from gyronorth.report.wording import angle_text, duration_text, number_text, part_name

if TYPE_CHECKING:
    from gyronorth.planning import Plan, TurnPlan

#: Durations of a plan for people, s, and those of them that the two tables show.
DURATIONS = (10, 15, 20, 30, 45, 60, 90, 120, 180, 300, 450, 600, 900, 1200, 1800, 2700, 3600)
DURATIONS += (5400, 7200, 10800, 14400, 21600, 28800, 43200, 57600, 86400)
IN_TABLE = (10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 43200, 86400)
BY_LATITUDE = (30, 120, 600, 3600, 14400)


def print_plan(plan: Plan, stream: TextIO) -> None:
    """Print what to expect, then sigma with its parts against time, then sigma against latitude.

    `plan` is made for `DURATIONS`.
    """
    doc = plan.to_json()
    shortest, useful = doc["shortest_duration_s"], doc["useful_duration_s"]
    lines = [
        ("sensor", doc["sensor"]),
        ("latitude", number_text(doc["latitude_deg"], decimals=4, unit="deg")),
        ("method", doc["method"]),
    ]
    if shortest is None:
        lines.append(("expect", "no heading: within a day the 95 % interval never tells north from south"))
    else:
        gain = "waiting longer lowers sigma by less than 5 %"
        level = "not within half a day" if useful is None else f"after {duration_text(useful)}: {gain}"
        lines += [
            ("a heading", f"after {duration_text(shortest)}: the 95 % interval then tells north from south"),
            ("levels off", level),
            ("least sigma", number_text(min(doc["sigma_deg"]), unit="deg")),
        ]
    print_lines(lines, stream)

    position = {round(time): index for index, time in enumerate(doc["duration_s"])}
    columns = [doc["sigma_deg"], doc["half_width95_deg"], *doc["sigma_parts_deg"].values()]
    stream.write("\nHeading sigma, half of the 95 % interval, and the error budget, deg\n")
    header = ("time", "sigma", "95 % +-", *(part_name(part) for part in doc["sigma_parts_deg"]))
    rows = [(duration_text(time), *(angle_text(column[position[time]]) for column in columns)) for time in IN_TABLE]
    print_table(header, rows, stream)
    rows = [
        (f"{latitude:g}", *(angle_text(sigmas[position[time]]) for time in BY_LATITUDE))
        for latitude, sigmas in zip(doc["latitudes_deg"], doc["sigma_by_latitude_deg"], strict=True)
    ]
    stream.write("\nHeading sigma against latitude, north or south, deg\n")
    print_table(("latitude", *map(duration_text, BY_LATITUDE)), rows, stream)


def print_turns(plan: TurnPlan, stream: TextIO) -> None:
    """Print sigma against the number of turns, one column for each angle."""
    stream.write(
        f"\nHeading sigma with turns, deg: {plan.still_duration:g} s of standing still in all, "
        f"{plan.turn_duration:g} s for a turn\n"
    )
    doc = plan.to_json()
    angles = sorted({row["angle_deg"] for row in doc}, reverse=True)
    by_place = {(row["turns"], row["angle_deg"]): row["sigma_deg"] for row in doc}
    rows = [
        (str(number), *(angle_text(by_place[number, angle]) for angle in angles))
        for number in sorted({row["turns"] for row in doc})
    ]
    print_table(("turns", *(f"by {angle:g} deg" for angle in angles)), rows, stream)
