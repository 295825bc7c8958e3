"""Last results of `make long`, by test file: read from pytest's XML, kept in `docs/long_runs.json`, told on a page.

`python docs/long_runs.py FILE.xml` replaces the rows of the files that were run, so that a run may be made in parts.
"""

from __future__ import annotations

import json
import subprocess
import sys
from datetime import date
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "docs/long_runs.json"


def rows_of(xml: str) -> dict[str, dict[str, Any]]:
    """Cases passed, skipped and failed, and seconds, of each test file of a run."""
    rows: dict[str, dict[str, Any]] = {}
    for case in ElementTree.fromstring(xml).iter("testcase"):
        name = case.attrib["classname"].replace(".", "/") + ".py"
        row = rows.setdefault(name, {"passed": 0, "skipped": 0, "failed": 0, "seconds": 0.0})
        kinds = {child.tag for child in case}
        kind = "failed" if kinds & {"failure", "error"} else "skipped" if "skipped" in kinds else "passed"
        row[kind] += 1
        row["seconds"] = round(row["seconds"] + float(case.attrib["time"]), 1)
    return rows


def table(kept: dict[str, dict[str, Any]] | None = None) -> str:
    """The rows as a table, folder by folder, with their sum."""
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if kept is None else kept
    lines = ["| file | passed | skipped | failed | seconds | commit | on |", "|---|---|---|---|---|---|---|"]
    counts = ("passed", "skipped", "failed", "seconds")
    for name, row in sorted(kept.items()):
        cells = (*(f"{row[count] or ''}" for count in counts), f"`{row['commit']}`", row["date"])
        lines.append(f"| `{name.removeprefix('tests/')}` | " + " | ".join(cells) + " |")
    total = [round(sum(row[count] for row in kept.values())) for count in counts]
    return "\n".join([*lines, "| **all** | " + " | ".join(f"**{count}**" for count in total) + " | | |"])


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def main(path: Path) -> None:
    """Keep the rows of one run."""
    changed = _git("status", "--porcelain", "--", "src", "tests")  # this file's own rows are no change
    commit = _git("rev-parse", "--short=7", "HEAD") + ("-dirty" if changed else "")
    kept: dict[str, dict[str, Any]] = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    told = {"commit": commit, "date": date.today().isoformat()}
    kept |= {name: row | told for name, row in rows_of(path.read_text(encoding="utf-8")).items()}
    kept = {name: row for name, row in sorted(kept.items()) if (ROOT / name).exists()}
    KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    print(table(kept))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
