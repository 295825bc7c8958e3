"""Write the table of docs/guide/good_enough.md from `plan`: python docs/make_good_enough.py [--check]."""

from __future__ import annotations

import sys
from math import degrees, radians
from pathlib import Path

import numpy as np

from gyronorth.planning import plan
from gyronorth.sensor import sensor_names

PAGE = Path(__file__).parent / "guide" / "good_enough.md"
LATITUDES_DEG = (0.0, 35.0, 50.0, 65.0)
DURATION = 300.0
START, END = "<!-- table: python docs/make_good_enough.py -->", "<!-- end -->"


def table() -> str:
    """Sigma of each profile after five minutes, best first; beyond 50 deg there is no heading."""
    rows = []
    for name in sensor_names():
        sigmas = [
            degrees(float(plan(name, latitude=radians(at), durations=np.array([DURATION])).sigma[0]))
            for at in LATITUDES_DEG
        ]
        rows.append((sigmas[2], name, sigmas))
    lines = [
        "| profile | " + " | ".join(f"at {at:g} deg" for at in LATITUDES_DEG) + " |",
        "|---" * (1 + len(LATITUDES_DEG)) + "|",
    ]
    lines += [f"| `{name}` | " + " | ".join(map(_cell, sigmas)) + " |" for _, name, sigmas in sorted(rows)]
    return "\n".join(lines)


def _cell(sigma_deg: float) -> str:
    return "no heading" if sigma_deg > 50 else f"{sigma_deg:#.2g}".rstrip(".")


def main() -> int:
    """Rewrite the page, or compare it."""
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(START)
    new = f"{before}{START}\n{table()}\n{END}{rest.split(END)[1]}"
    if "--check" in sys.argv:
        return int(new != text)
    PAGE.write_text(new, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
