"""A hook of the documentation: tables that come from elsewhere when the pages are built.

`<!-- from README: NAME -->` stands for what lies between the marks of NAME in README.md,
`<!-- tests -->` for a table of the test files, counted in their source, `<!-- long -->` for the last results of
`make long`, and `<!-- changes -->` for CHANGELOG.md.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from long_runs import table as long

ROOT = Path(__file__).parents[1]
#: Packages whose results ours are held against -> what for.
ORACLES = {
    "advanced_navigation": "frames of ANPP units",
    "ahrs": "closed-form attitude",
    "allantools": "Allan deviation",
    "diffusers": "noise schedule and samplers",
    "mscl": "frames of MicroStrain units",
    "navtk": "closed-form heading of a pose",
    "novatel_edie": "frames of NovAtel receivers",
    "pyins": "Earth rate and gravity, sensor errors",
    "scipy": "laws of probability, rotations, quadrature",
}


def on_page_markdown(markdown: str, **_: object) -> str:
    """Put the tables into a page."""
    markdown = re.sub(r"<!-- from README: (\w+) -->", lambda found: of_readme(found[1]), markdown)
    for name, table in (("tests", tests), ("oracles", oracles), ("changes", changes), ("long", long)):
        if f"<!-- {name} -->" in markdown:
            markdown = markdown.replace(f"<!-- {name} -->", table())
    return markdown


def of_readme(name: str) -> str:
    """What README.md has between its marks."""
    found = re.search(rf"<!-- {name}: make readme -->\n(.*?)<!-- end -->", (ROOT / "README.md").read_text(), re.DOTALL)
    if not found:
        raise ValueError(f"README.md has no mark for {name}")
    # An interval is not broken at its hyphen.
    return re.sub(r"(?<=\d)-(?=\d)", "&#8209;", found[1])


def changes() -> str:
    """The changelog as it is."""
    return (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_files() -> list[Path]:
    """The files of tests, those in folders last."""
    return sorted((ROOT / "tests").rglob("test_*.py"), key=lambda path: (len(path.parts), path))


def test_functions(path: Path) -> Iterator[tuple[ast.FunctionDef, set[str]]]:
    """Each test of a file with the names of its decorators, `pytest.mark.slow` as slow."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            named = (each.func if isinstance(each, ast.Call) else each for each in node.decorator_list)
            yield node, {ast.unparse(each).rpartition(".")[2] for each in named}


def tests() -> str:
    """Tests by folder, and by file outside of folders, with their number."""
    lines = ["| folder or file | files | tests | with generated input | slow or long |", "|---|---|---|---|---|"]
    counts: dict[str, list[int]] = {}
    for path in test_files():
        marks = [marks for _, marks in test_functions(path)]
        whole = re.search(r"^pytestmark = .*\b(slow|long)\b", path.read_text(), re.MULTILINE)
        slow = sum(bool(whole or {"slow", "long"} & each) for each in marks)
        found = [1, len(marks), sum("given" in each for each in marks), slow]
        name = path.relative_to(ROOT / "tests").parts[0]
        counts[name] = [sum(pair) for pair in zip(counts.get(name, [0] * 4), found, strict=True)]
    lines += [f"| `{name}` | " + " | ".join(str(n or "") for n in found) + " |" for name, found in counts.items()]
    total = [sum(column) for column in zip(*counts.values(), strict=True)]
    return "\n".join([*lines, "| **all** | " + " | ".join(f"**{count}**" for count in total) + " |"])


def oracles() -> str:
    """Which tests use which other package."""
    lines = ["| package | held against it | in |", "|---|---|---|"]
    for package, purpose in ORACLES.items():
        use = re.compile(rf"\b(?:import|from) {package}\b|importorskip\(\s*\"{package}\b")
        users = [f"`{path.name}`" for path in test_files() if use.search(path.read_text())]
        lines.append(f"| {package} | {purpose} | {', '.join(users)} |")
    return "\n".join(lines)
