"""docs/results/performance.md from measurements: `python -m benchmarks page [--check]`.

The introduction and the reckoning on paper are written by hand in performance.intro.md. The measurements stand in
docs/results/performance/*.json, each written by `python -m benchmarks NAME --json FILE`; `samples.json` also gives the
figure.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
from pathlib import Path
from typing import Any

from benchmarks.samples import draw

PAGES = Path(__file__).parents[1] / "docs/results"
DATA = PAGES / "performance"
WRITTEN = "<!-- Written by `python -m benchmarks page` from docs/results/performance; do not edit. -->"
#: What in the introduction is replaced by the tables.
RATIOS, SAMPLES, STAGES = "{{ratios}}", "{{samples}}", "{{stages}}"


def main(arguments: list[str]) -> int:
    """Write page and figure, or tell whether the page is what its data give."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks page")
    parser.add_argument("--check", action="store_true", help="exit code 1 if the page is not what its data give")
    given = parser.parse_args(arguments)
    text, target = page(), PAGES / "performance.md"
    if given.check:
        return int(target.read_text(encoding="utf-8") != text)
    target.write_text(text, encoding="utf-8")
    draw(_read("samples"), PAGES / "performance-samples.png")
    return 0


def page() -> str:
    """The page as Markdown."""
    intro = (PAGES / "performance.intro.md").read_text(encoding="utf-8").strip()
    named = sorted(path.stem for path in DATA.glob("*.json") if path.stem not in ("samples", "stages"))
    comparisons = [each for name in named for each in _read(name)]
    tables = {RATIOS: ratios(comparisons), SAMPLES: samples(_read("samples")), STAGES: stages(_read("stages"))}
    for place, table in tables.items():
        intro = intro.replace(place, table)
    return f"{WRITTEN}\n\n{intro}\n"


def ratios(comparisons: list[dict[str, Any]]) -> str:
    """One row for each way to do the same work: how much CPU time ours takes over it, round by round."""
    rows = ["| work | beside | CPU time over it: median (least to most) | rounds | promised |", "|---|---|---|---|---|"]
    for each in comparisons:
        ours = each["cpu_s"][each["ours"]]
        for name, seconds in each["cpu_s"].items():
            if name == each["ours"]:
                continue
            found = [mine / theirs for mine, theirs in zip(ours, seconds, strict=True)]
            target = each["promised"].get(name)
            shown = f"{statistics.median(found):.2f} ({min(found):.2f} to {max(found):.2f})"
            rows.append(
                f"| {each['title']} | {name} | {shown} | {len(found)} | {f'{1 / target:.2f}' if target else ''} |"
            )
    return "\n".join(rows)


def samples(found: list[dict[str, Any]]) -> str:
    """Cost and memory against the number of samples."""
    rows = [
        "| samples | `heading`, CPU-s | loading, CPU-s | ratio | `heading`, peak MB | loading, peak MB "
        "| the two arrays, MB |",
        "|---|---|---|---|---|---|---|",
    ]
    for each in found:
        ours, loads = each["heading"], each["loads"]
        ratio = ours["cpu_s"] / loads["cpu_s"]
        rows.append(
            f"| {each['samples']:,} | {ours['cpu_s']:.2f} | {loads['cpu_s']:.2f} | {ratio:.2f} "
            f"| {ours['peak_mb']:.0f} | {loads['peak_mb']:.0f} | {each['arrays_mb']:.1f} |"
        )
    return "\n".join(rows)


def stages(found: list[dict[str, Any]]) -> str:
    """CPU seconds of each stage of `heading`, and of the script that only loads the file, for each format."""
    names = list(dict.fromkeys(name for each in found for name in each["cpu_s"]))
    heads = [f"{each['format']}, {each['program']}" for each in found]
    rows = [f"| stage, CPU-s | {' | '.join(heads)} |", f"|---|{'---|' * len(found)}"]
    for name in names:
        times = [each["cpu_s"].get(name) for each in found]
        rows.append(f"| {name} | {' | '.join('' if time is None else f'{time:.2f}' for time in times)} |")
    totals = (sum(each["cpu_s"].values()) for each in found)
    return "\n".join([*rows, f"| together | {' | '.join(f'{total:.2f}' for total in totals)} |"])


def _read(name: str) -> Any:
    return json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
