"""Write the results pages from the studies that `gyronorth benchmark` leaves.

python docs/make_results.py FOLDER...   take the studies in these folders over into docs/results, then write the pages
python docs/make_results.py             write the pages and figures again from what is there
python docs/make_results.py --check     exit code 1 if a page is not what its data give

A page is docs/results/<benchmark>.md. Its beginning is written by hand in docs/results/<benchmark>.intro.md, which
holds no result; everything else comes from docs/results/data/<benchmark>/<study>.json: for each study its figure and,
folded, its tables, which are also written as <study>.csv beside the JSON. In the introduction

    {{study | table | row | column}}

becomes a cell of a study: `table` is the table's title or its beginning, `row` its first cell, or its first two with
` & ` between them. A block

    ```claims
    what is claimed | study | table | row | column | <= 0.45
    ```

becomes a table with the result and whether the claim holds. A limit is `<= x`, `>= x` or `x to y`, without a unit.
A claim may end in ` | study | table | row | column` of the same figure without the tests that are lost, which then
stands beside it. What stands between

    ```with study
    ```

is left out where there is no such study yet.
"""

from __future__ import annotations

import csv
import io
import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gyronorth.evaluation import Interval
from gyronorth.report.figures import write
from gyronorth.report.study_figures import FIGURES, study_figure
from gyronorth.studies.benchmark import STUDIES
from gyronorth.studies.study import StudyPlan
from gyronorth.studies.tables import SHARES, Table, cell_text, rows_markdown
from gyronorth.studies.tables import verdict as within

PAGES = Path(__file__).parent / "results"
NAMED = {study.name: study for study in STUDIES}
ORDER = list(NAMED)
WRITTEN = "<!-- Written by docs/make_results.py from docs/results/data; do not edit. -->"

Study = dict[str, Any]


def take_over(folder: Path) -> None:
    """Copy the studies in a benchmark's folder to docs/results/data; the results of single units stay there."""
    found = [path for path in sorted(folder.glob("*.json")) if path.stem in NAMED]
    if not found:
        sys.exit(f"{folder} holds no study; give the folder that was -o of `gyronorth benchmark`.")
    for path in found:
        target = PAGES / "data" / NAMED[path.stem].benchmark / path.name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(path.read_text(encoding="utf-8"), encoding="utf-8")


def studies_of(benchmark: str) -> dict[str, Study]:
    """The studies of a page by name, in the order of the command."""
    paths = sorted((PAGES / "data" / benchmark).glob("*.json"), key=lambda path: ORDER.index(path.stem))
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in paths}


def page(benchmark: str, studies: dict[str, Study]) -> str:
    """The whole page as Markdown."""
    intro = (PAGES / f"{benchmark}.intro.md").read_text(encoding="utf-8").strip()
    there = re.compile(r"^```with (\S+)\n(.*?)^```(?:\n+|$)", re.M | re.S)
    intro = there.sub(lambda found: f"{found[2]}\n" if found[1] in studies else "", intro)
    intro = re.sub(r"^```claims\n(.*?)^```", lambda found: claims(found[1], studies), intro, flags=re.M | re.S)
    intro = re.sub(r"\{\{(.*?)\}\}", lambda found: shown_cell(studies, *parts(found[1])), intro)
    sections = [
        section(study, benchmark, shown=f"({benchmark}-{study['study']}.png)" in intro) for study in studies.values()
    ]
    return "\n\n".join([WRITTEN, intro, *sections]) + "\n"


def section(study: Study, benchmark: str, *, shown: bool) -> str:
    """One study: what was done, its figure unless the introduction has shown it, tables, and how to make them again."""
    name = study["study"]
    lines = [f"## {study['title']}"]
    if name in FIGURES and not shown:
        lines.append(f"![{study['title']}]({benchmark}-{name}.png)")
    plan = StudyPlan(**study["plan"])
    tables = [NAMED[name].markdown(table_of(table), plan).strip() for table in study["tables"]]
    lines += [folded("How it was made", [study["text"]]), folded(f"Tables ({len(tables)})", tables)]
    if NAMED[name].described is None and study["recordings"] != "published reconstruction":
        raise SystemExit(f"{name} was run on recordings of somebody's own; pages are made from the shipped data.")
    command = re.sub(r"--data \S+", "--data FOLDER", study["command"])  # wherever it lay
    lines.append(
        f"Made by `{command}`: seed {study['seed']}, commit `{study['commit'][:12]}`, "
        f"[CSV](data/{benchmark}/{name}.csv), [JSON](data/{benchmark}/{name}.json)."
    )
    return "\n\n".join(lines)


def folded(title: str, blocks: Sequence[str]) -> str:
    """Blocks of Markdown that a click opens."""
    return "\n\n".join(['<details markdown="1">', f"<summary>{title}</summary>", *blocks, "</details>"])


def tidy(study: Study) -> str:
    """All tables of a study as one CSV: a line for each cell, an interval in three columns."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("table", "line", "row", "column", "value", "low", "high"))
    for table in study["tables"]:
        for number, row in enumerate(table["rows"], 1):
            for column, value in zip(table["columns"][1:], row[1:], strict=True):
                cells = (value["value"], value["low"], value["high"]) if isinstance(value, dict) else (value, "", "")
                writer.writerow((table["title"], number, row[0], column, *cells))
    return text.getvalue()


def table_of(table: dict) -> Table:
    """A table of a JSON file."""
    rows = tuple(tuple(Interval(**c) if isinstance(c, dict) else c for c in row) for row in table["rows"])
    return Table(table["title"], tuple(table["columns"]), rows, table["note"])


def cell(studies: dict[str, Study], study: str, title: str, row: str, column: str) -> Any:
    """One cell; whatever is not there exactly once is an error."""
    named = [t for t in studies[study]["tables"] if t["title"].startswith(title)]
    tables = [table_of(t) for t in [t for t in named if t["title"] == title] or named]
    found = [r for t in tables for r in t.rows if row in (r[0], f"{r[0]} & {r[1]}")]
    if len(tables) != 1 or len(found) != 1 or column not in tables[0].columns:
        sys.exit(f"{study} has {len(tables)} tables {title!r} and {len(found)} rows {row!r}, column {column!r}.")
    return found[0][tables[0].columns.index(column)]


def shown_cell(studies: dict[str, Study], study: str, title: str, row: str, column: str) -> str:
    """One cell as a reader sees it."""
    return cell_text(cell(studies, study, title, row, column), column)


def parts(text: str) -> list[str]:
    """The pieces between bars."""
    return [piece.strip() for piece in text.split("|")]


def claims(text: str, studies: dict[str, Study]) -> str:
    """A table of claims and verdicts, with a column for tests that are not lost if any claim has it."""
    rows = []
    for line in text.splitlines():
        claim, study, table, row, column, limit, *kept = parts(line)
        found = cell(studies, study, table, row, column)
        beside = cell(studies, *kept) if kept else None
        if beside is not None:
            beside = f"{cell_text(beside, kept[-1])}: {verdict(beside, limit)}"
        rows.append((claim, limit_text(limit, column), cell_text(found, column), verdict(found, limit), beside))
    columns = ("claim", "required", "result", "verdict", "of tests not lost")
    shown = len(columns) if any(row[-1] is not None for row in rows) else len(columns) - 1
    return rows_markdown(columns[:shown], [row[:shown] for row in rows])


def bounds(limit: str) -> tuple[float, float]:
    """Lowest and highest value that a limit allows."""
    if " to " in limit:
        low, high = limit.split(" to ")
        return float(low), float(high)
    sign, value = limit.split()
    return (float("-inf"), float(value)) if sign == "<=" else (float(value), float("inf"))


def limit_text(limit: str, column: str) -> str:
    """A limit in words; of a share in percent."""
    if column in SHARES:
        limit = re.sub(r"[\d.]+", lambda found: f"{100 * float(found[0]):g}", limit) + " %"
    return limit.replace("<=", "at most").replace(">=", "at least")


def verdict(found: Any, limit: str) -> str:
    """Whether a figure with its interval is within its limit, in three words."""
    low, high = bounds(limit)
    return within(found, low=low, high=high)


def draw(benchmark: str, studies: dict[str, Study]) -> None:
    """The figures beside the page."""
    for name, study in studies.items():
        if name in FIGURES:
            write(study_figure(study), PAGES / f"{benchmark}-{name}.png")


def main(arguments: Sequence[str]) -> int:
    """Take over, write, or compare."""
    check = list(arguments) == ["--check"]
    for folder in [] if check else arguments:
        take_over(Path(folder))
    stale = []
    for folder in sorted(PAGES.glob("data/*")):
        studies, target = studies_of(folder.name), PAGES / f"{folder.name}.md"
        written = {target: page(folder.name, studies)}
        written |= {folder / f"{name}.csv": tidy(study) for name, study in studies.items()}
        if check:
            stale += [
                path.name
                for path, text in written.items()
                if not path.is_file() or path.read_text(encoding="utf-8") != text
            ]
            continue
        for path, text in written.items():
            path.write_text(text, encoding="utf-8")
        draw(folder.name, studies)
    if stale:
        print(f"{', '.join(stale)}: not what the data give; run python docs/make_results.py", file=sys.stderr)
    return int(bool(stale))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
