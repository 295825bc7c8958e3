"""Write examples/notebooks/*.ipynb from the scripts beside them, with what their cells print and draw.

python docs/make_notebooks.py            run the scripts and write the notebooks
python docs/make_notebooks.py --check    exit code 1 if the cells of a notebook are not those of its script

A script is cut at lines `# %%` (code) and `# %% [markdown]` (text in comments): it can be read, compared and run
without Jupyter, and a notebook is never edited by hand.
"""

from __future__ import annotations

import base64
import contextlib
import io
import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[1] / "examples/notebooks"
CELL = re.compile(r"^# %%( \[markdown\])?\n", re.MULTILINE)


def cells(script: str) -> list[tuple[str, str]]:
    """Kind (markdown or code) and source of each cell."""
    pieces = CELL.split(script)[1:]
    found = []
    for mark, body in zip(pieces[::2], pieces[1::2], strict=True):
        text = re.sub(r"^# ?", "", body, flags=re.MULTILINE) if mark else body
        found.append(("markdown" if mark else "code", text.strip()))
    return found


def run(sources: Sequence[str]) -> list[list[dict[str, Any]]]:
    """Outputs of code cells that share their names, one after the other: text and figures."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    names: dict[str, Any] = {"__name__": "__main__"}
    made = []
    for source in sources:
        printed, outputs = io.StringIO(), []
        with contextlib.redirect_stdout(printed):
            exec(compile(source, "<cell>", "exec"), names)
        if printed.getvalue():
            outputs.append({"output_type": "stream", "name": "stdout", "text": lines(printed.getvalue())})
        for number in pyplot.get_fignums():
            image = io.BytesIO()
            pyplot.figure(number).savefig(image, format="png", dpi=80, metadata={"Software": None})
            data = {"image/png": base64.b64encode(image.getvalue()).decode()}
            outputs.append({"output_type": "display_data", "data": data, "metadata": {}})
        pyplot.close("all")
        made.append(outputs)
    return made


def notebook(script: str) -> dict[str, Any]:
    """The notebook of a script, format 4.5."""
    parts = cells(script)
    outputs = iter(run([text for kind, text in parts if kind == "code"]))
    made = []
    for number, (kind, text) in enumerate(parts):
        cell: dict[str, Any] = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}, "source": lines(text)}
        if kind == "code":
            cell |= {"execution_count": None, "outputs": next(outputs)}
        made.append(cell)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {"cells": made, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}


def lines(text: str) -> list[str]:
    """Text as a notebook stores it."""
    return text.splitlines(keepends=True)


def stale(script: Path) -> bool:
    """Whether the cells of the notebook beside a script are not the script's."""
    path = script.with_suffix(".ipynb")
    if not path.is_file():
        return True
    stored = json.loads(path.read_text(encoding="utf-8"))["cells"]
    wanted = cells(script.read_text(encoding="utf-8"))
    return [(cell["cell_type"], "".join(cell["source"])) for cell in stored] != wanted


def main(arguments: Sequence[str]) -> int:
    """Write, or compare."""
    scripts = sorted(FOLDER.glob("*.py"))
    if list(arguments) == ["--check"]:
        old = [script.stem for script in scripts if stale(script)]
        if old:
            print(f"{', '.join(old)}: not the script's cells; run python docs/make_notebooks.py", file=sys.stderr)
        return int(bool(old))
    for script in scripts:
        made = json.dumps(notebook(script.read_text(encoding="utf-8")), indent=1, ensure_ascii=False)
        script.with_suffix(".ipynb").write_text(made + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
