"""The commands and the code of README and guide run; the examples run; the README's figures are current."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import yaml

import gyronorth as gn

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))
DEMO = ROOT / "examples/data/demo.npz"
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```", re.MULTILINE | re.DOTALL)
#: Development commands, which the tests cannot run from inside themselves.
SKIPPED = ("make ", "git ", "cd ", "pip ", "python")


def pin(package: str) -> str:
    """The version of a package in constraints.txt."""
    return re.search(rf"^{package}==(.*)$", (ROOT / "constraints.txt").read_text(), re.MULTILINE)[1]


same_streams = pytest.mark.skipif(
    np.__version__ != pin("numpy"), reason="NumPy keeps a seed's stream only within a version (NEP 19): needs the pin"
)


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A folder where the paths of the documentation are valid and output stays out of the tree."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "src"))
    monkeypatch.setenv("MPLBACKEND", "agg")
    return tmp_path


def blocks(page: Path, language: str) -> list[str]:
    return [text for kind, text in BLOCK.findall(page.read_text()) if kind == language]


def commands(page: Path) -> list[str]:
    joined = "".join(blocks(page, "sh")).replace("\\\n", " ")
    lines = (line.partition(" #")[0].strip() for line in joined.splitlines())
    return [line for line in lines if line and not line.startswith(SKIPPED)]


def run(arguments: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)], ids=lambda page: page.stem)
def test_commands_run(page, clone):
    for command in commands(page):
        program, *arguments = shlex.split(command)
        assert program == "gyronorth", command
        done = run(["-c", "from gyronorth.cli import main; main()", *arguments])
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")], ids=lambda page: page.stem)
def test_code_runs(page, clone):
    for code in blocks(page, "python"):
        done = run(["-W", "error", "-c", code])
        assert done.returncode == 0, f"{code}\n{done.stderr}"


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.stem)
def test_example_runs(example, clone):
    done = run(["-W", "error", str(example)])
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


@pytest.mark.slow
@same_streams
def test_figures_of_the_readme_are_what_their_seeds_give():
    done = run([str(ROOT / "docs/make_readme.py"), "--check"])
    assert done.returncode == 0, done.stderr


@same_streams
def test_demo_recording_is_what_its_command_gives(clone):
    """`make demo-recording`, whose command stands in the Makefile."""
    rule = re.search(r"^demo-recording:.*\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(), re.MULTILINE)
    command = rule[1].replace("\\\n", " ").replace("$(BIN)/", "").replace("$(DEMO)", "out/again.npz")
    program, *arguments = shlex.split(command)
    assert program == "gyronorth"
    done = run(["-c", "from gyronorth.cli import main; main()", *arguments])
    assert done.returncode == 0, done.stderr
    shipped, again = gn.read(DEMO), gn.read("out/again.npz")
    np.testing.assert_allclose(again.gyro_b, shipped.gyro_b, rtol=0, atol=1e-12)
    np.testing.assert_allclose(again.accel_b, shipped.accel_b, rtol=0, atol=1e-9)
    assert (again.heading_true, again.latitude) == (shipped.heading_true, shipped.latitude)
    assert DEMO.stat().st_size < 1e6


def test_versions_agree():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == project["version"]
    assert citation["license"] == project["license"] == "MIT"


def test_every_requirement_is_pinned():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pinned = {normal(line.partition("==")[0]) for line in lines if "==" in line}
    wanted = [
        *project["dependencies"],
        *(name for extra in project["optional-dependencies"].values() for name in extra),
    ]
    missing = {name for line in wanted if (name := normal(re.split(r"[\[<>=;]", line)[0])) not in pinned}
    assert not missing


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name.strip()).lower()
