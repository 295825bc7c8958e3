"""The notebooks of examples/: their cells are those of the scripts beside them, and they run."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "examples/notebooks").glob("*.py"))


@pytest.fixture(scope="module")
def maker():
    """docs/make_notebooks.py as a module."""
    spec = importlib.util.spec_from_file_location("make_notebooks", ROOT / "docs/make_notebooks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def outputs(cells, kind):
    return [output for cell in cells for output in cell.get("outputs", ()) if output["output_type"] == kind]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_notebook_has_the_cells_of_its_script_and_their_outputs(script, maker):
    assert not maker.stale(script), "run python docs/make_notebooks.py"
    cells = json.loads(script.with_suffix(".ipynb").read_text())["cells"]
    assert outputs(cells, "stream")
    assert outputs(cells, "display_data")
    assert script.with_suffix(".ipynb").stat().st_size < 200_000


def test_a_changed_script_is_noticed(maker, tmp_path):
    script = tmp_path / "small.py"
    script.write_text("# %% [markdown]\n# # Title\n# Text.\n\n# %%\nx = 2\nprint(x + 1)\n\n# %%\nprint(x)\n")
    made = maker.notebook(script.read_text())
    assert [cell["cell_type"] for cell in made["cells"]] == ["markdown", "code", "code"]
    assert made["cells"][0]["source"] == ["# Title\n", "Text."]
    assert [output["text"] for output in outputs(made["cells"], "stream")] == [["3\n"], ["2\n"]]
    script.with_suffix(".ipynb").write_text(json.dumps(made))
    assert not maker.stale(script)
    script.write_text(script.read_text().replace("x = 2", "x = 3"))
    assert maker.stale(script)


@pytest.mark.long
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_notebook_prints_what_is_stored(script, maker, monkeypatch):
    monkeypatch.chdir(ROOT)
    cells = maker.notebook(script.read_text())["cells"]
    stored = json.loads(script.with_suffix(".ipynb").read_text())["cells"]
    assert outputs(cells, "stream") == outputs(stored, "stream"), "run `make notebooks`"
    assert len(outputs(cells, "display_data")) == len(outputs(stored, "display_data"))
