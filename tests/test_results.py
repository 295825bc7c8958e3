"""The results pages: filled from the studies' files, never by hand."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path

import pytest

from gyronorth.report.study_figures import study_figure

ROOT = Path(__file__).parents[1]


def script():
    """docs/make_results.py as a module."""
    spec = importlib.util.spec_from_file_location("make_results", ROOT / "docs/make_results.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def results(tmp_path, monkeypatch):
    """docs/make_results.py, working in a folder of the test's."""
    module = script()
    monkeypatch.setattr(module, "PAGES", tmp_path / "results")
    (tmp_path / "results").mkdir()
    return module


@pytest.mark.slow
def test_the_pages_are_what_their_data_give():
    assert sorted(folder.name for folder in (ROOT / "docs/results/data").iterdir()) == [
        "disturbed",
        "paper",
        "published",
        "real",
        "stress",
        "turned",
    ]
    assert script().main(["--check"]) == 0


def study(folder, **changes):
    """The file that a benchmark leaves of a study."""
    folder.mkdir()
    row = ["learned", {"value": 0.326, "low": 0.31, "high": 0.34}, 0.94]
    content = {
        "study": "t_back",
        "title": "A sweep",
        "seed": 3,
        "commit": "0123456789abcdef",
        "command": "gyronorth benchmark paper --study t_back -o FOLDER",
        "plan": {"seed": 3},
        "recordings": "published reconstruction",
        "text": "What was done.",
        "tables": [{"title": "mixed: 100 s", "columns": ["method", "ratio", "inside"], "rows": [row], "note": "n"}],
        "curves": {
            "sweep": [{"t_back": t, "train": 1.0, "validation": 2.0, "test": 3.0} for t in (900, 950)],
            "training": {"950": [{"loss": 2.0, "validation": 3.0}]},
        },
        **changes,
    }
    (folder / "t_back.json").write_text(json.dumps(content))
    (folder / "units").mkdir()


INTRO = """# Page

The ratio is {{t_back | mixed | learned | ratio}}.

```claims
it gains | t_back | mixed | learned | ratio | <= 0.45
it gains more | t_back | mixed | learned | ratio | <= 0.33
it gains most | t_back | mixed | learned | ratio | <= 0.2
it is calibrated | t_back | mixed | learned | inside | 0.93 to 0.97
it covers all | t_back | mixed | learned | inside | >= 0.99
```

```with t_back
there is
```
```with flow
not yet
```
"""


@pytest.mark.slow
def test_page_is_filled_from_the_files(results, tmp_path):
    study(tmp_path / "run")
    (tmp_path / "results/paper.intro.md").write_text(INTRO)
    assert results.main([str(tmp_path / "run")]) == 0
    text = (tmp_path / "results/paper.md").read_text()
    assert "there is\n" in text
    assert "not yet" not in text
    assert "of tests not lost" not in text
    assert "The ratio is 0.326 (0.310 to 0.340)." in text
    verdicts = [line.split(" | ")[3].rstrip(" |") for line in text.splitlines() if line.startswith("| it ")]
    assert verdicts == [
        "holds",
        "cannot be told",
        "**does not hold**",
        "holds",
        "**does not hold**",
    ]
    assert "| learned | 0.326 (0.310 to 0.340) | 0.940 |\n\nn\n\nFloor (Cramér-Rao, white noise alone): 1.09" in text
    assert "seed 3, commit `0123456789ab`, [CSV](data/paper/t_back.csv), [JSON](data/paper/t_back.json)" in text
    assert (tmp_path / "results/paper-t_back.png").stat().st_size > 5000
    assert results.main(["--check"]) == 0
    (tmp_path / "results/paper.md").write_text(text.replace("0.326", "0.226", 1))
    assert results.main(["--check"]) == 1


@pytest.mark.parametrize("where", ["t_back | mixed | bayes | ratio", "t_back | quiet | learned | ratio"])
def test_a_cell_that_is_not_there_is_told(results, tmp_path, where):
    study(tmp_path / "run")
    (tmp_path / "results/paper.intro.md").write_text(f"{{{{{where}}}}}")
    with pytest.raises(SystemExit, match=r"t_back has \d tables"):
        results.main([str(tmp_path / "run")])


def test_a_claim_may_have_the_tests_that_are_not_lost_beside_it(results):
    rows = [["learned", {"value": 0.326, "low": 0.31, "high": 0.34}, 0.5]]
    table = {"title": "mixed", "columns": ["method", "ratio", "kept"], "rows": rows, "note": ""}
    where = "t_back | mixed | learned |"
    text = f"a | {where} ratio | <= 1 | {where} kept\nb | {where} ratio | <= 0.1"
    found = results.claims(text, {"t_back": {"tables": [table]}}).splitlines()
    assert found[0] == "| claim | required | result | verdict | of tests not lost |"
    assert found[2:] == [
        "| a | at most 1 | 0.326 (0.310 to 0.340) | holds | 0.500: holds |",
        "| b | at most 0.1 | 0.326 (0.310 to 0.340) | **does not hold** |  |",
    ]


def test_shares_and_their_limits_are_in_percent(results):
    rows = [["auto", {"value": 0.143, "low": 0.087, "high": 0.226}, 0.02]]
    columns = ["method", "missed of valid", "refused"]
    studies = {"stress": {"tables": [{"title": "Beyond", "columns": columns, "rows": rows, "note": ""}]}}
    where = "stress | Beyond | auto |"
    text = f"a | {where} missed of valid | 0.02 to 0.07\nb | {where} refused | <= 0.15"
    assert results.claims(text, studies).splitlines()[2:] == [
        "| a | 2 to 7 % | 14.3 % (8.7 to 22.6 %) | **does not hold** |",
        "| b | at most 15 % | 2.0 % | holds |",
    ]
    assert results.shown_cell(studies, "stress", "Beyond", "auto", "refused") == "2.0 %"
    table = results.table_of(studies["stress"]["tables"][0])
    assert "| auto | 14.3 % (8.7 to 22.6 %) | 2.0 % |" in table.to_markdown()


def test_a_folder_without_studies_is_told(results, tmp_path):
    with pytest.raises(SystemExit, match="holds no study"):
        results.main([str(tmp_path)])


@pytest.mark.parametrize("name", ["disturbed", "paper", "published", "turned"])
def test_every_table_of_heading_errors_has_a_floor(name):
    page = (ROOT / f"docs/results/{name}.md").read_text()
    tables = {}
    for section in page.split("\n### ")[1:]:
        title, _, body = re.split("\n## |\nMade by ", section)[0].partition("\n")
        if re.search(r"\bdeg\b", body.strip().splitlines()[0]):
            tables[title] = body
    assert len(tables) >= {"disturbed": 20, "paper": 23, "published": 12, "turned": 1}[name]
    assert [title for title, body in tables.items() if not re.search(r"\b[Ff]loor\b|\| bound, deg", body)] == []


@pytest.mark.slow
def test_pages_of_the_documentation_are_what_their_data_give(results, monkeypatch):
    monkeypatch.setattr(results, "PAGES", ROOT / "docs/results")
    assert results.main(["--check"]) == 0


@pytest.mark.parametrize("name", ["paper", "published", "turned", "disturbed", "stress", "real", "league"])
def test_a_page_shows_its_picture_before_its_first_section(name):
    head = (ROOT / f"docs/results/{name}.md").read_text(encoding="utf-8").split("\n## ")[0]
    (shown,) = re.findall(r"^!\[.+\]\((.+\.png)\)$", head, re.MULTILINE)
    assert (ROOT / "docs/results" / shown).exists()


def cell(sensor, situation, value, low, refused=0.0):
    return [f"{sensor}: {situation}", "auto", 100, {"value": value, "low": low, "high": 1.0}, refused]


def test_the_map_of_stress_frames_what_chance_does_not_explain():
    columns = ["cell", "method", "recordings", "missed of valid", "refused"]
    rows = [cell("a 100 s", "honest", 0.05, 0.02), cell("b 300 s", "bias 3, no profile", 0.4, 0.3, 0.25)]
    study = {"study": "stress", "tables": [{"columns": columns, "rows": rows}]}
    axes = study_figure(study).axes[0]
    assert {text.get_text() for text in axes.texts} == {"5", "40\n25 refused"}
    assert [patch.get_xy()[0] > 0.5 for patch in axes.patches] == [True]
    assert [label.get_text() for label in axes.get_yticklabels()] == [
        "like its profile",
        "turn-on bias × 3, no profile given",
    ]


def test_the_picture_of_real_recordings_counts_headings_outside_their_interval():
    columns = [
        "recording",
        "method and profile",
        "valid",
        "of these covered",
        "largest error, deg",
        "half-width, deg",
        "reasons",
    ]
    rows = [
        ["one", "auto, no profile", 2, 2, 1.0, 2.0, ""],
        ["two", "auto, hg9900", 3, 1, 4.0, 2.0, ""],
        ["two", "mean, hg9900", 3, 0, 4.0, 2.0, ""],
        ["three", "auto, hg9900", 0, None, None, None, "rate_norm"],
    ]
    figure = study_figure({"study": "real", "tables": [{"columns": columns, "rows": rows}]})
    assert "2 of 5 valid headings outside" in figure.get_suptitle()
    assert [text.get_text() for text in figure.axes[0].texts] == ["refused: rate_norm"]
