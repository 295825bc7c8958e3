"""What an import loads, which way imports go, and the sizes of the house."""

from __future__ import annotations

import ast
import importlib
import os
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted((ROOT / "src").rglob("*.py"))
HEAVY = {"torch", "scipy", "onnxruntime", "matplotlib", "pandas"}
#: Lines of a file and parameters of a public function: where the house rules say stop.
FILE_LIMIT, PARAMETER_LIMIT = 400, 8
#: `simulate` has one parameter for each fact about the scene, `heading` one for each thing that may be known, `judge`
#: one for each thing that a unit of its study says.
LONG_SIGNATURES = {"heading": 12, "judge": 9, "heading_many": 11, "simulate": 10, "simulate_batch": 11}

HELP = """
import sys
from gyronorth.cli import main
sys.argv = ["gyronorth", "--help"]
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
"""


def loaded_by(code: str) -> set[str]:
    """Top-level modules that a fresh interpreter holds after `code`."""
    code += "\nimport sys; print('MODULES', *{name.partition('.')[0] for name in sys.modules})"
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    return set(run.stdout.rpartition("MODULES")[2].split())


@pytest.mark.parametrize("code", ["import gyronorth", HELP], ids=["import", "help"])
def test_start_up_loads_nothing_heavy(code):
    modules = loaded_by(code)
    assert "gyronorth" in modules
    assert not modules & HEAVY


@pytest.mark.slow
def test_the_probe_sees_a_heavy_import():
    assert "scipy" in loaded_by("import scipy.linalg")


def test_every_public_name_resolves_and_none_is_a_submodule():
    import gyronorth

    submodules = {path.stem for path in (ROOT / "src/gyronorth").iterdir()} - {"__init__", "__pycache__"}
    assert not submodules & set(gyronorth.__all__)
    for name in gyronorth.__all__:
        assert getattr(gyronorth, name) is not None
    assert set(gyronorth.__all__) <= set(dir(gyronorth))


@pytest.mark.parametrize("name", ["", ".readers", ".simulation", ".allan", ".sensor", ".frames", ".many"])
def test_a_public_package_shows_its_names_and_nothing_else(name):
    package = importlib.import_module(f"gyronorth{name}")
    assert dir(package) == sorted(package.__all__)
    assert all(getattr(package, each) is not None for each in package.__all__)


def test_imports_go_one_way(monkeypatch):
    from importlinter.cli import lint_imports

    monkeypatch.chdir(ROOT)
    assert lint_imports(config_filename="pyproject.toml") == 0


#: Of other packages.
PRIVATE_NAMES = {"_exit", "_state", "_gather", "_get_variance"}


@pytest.mark.slow
def test_tests_reach_for_no_private_name():
    found = set()
    for path in (ROOT / "tests").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gyronorth"):
                found |= {(path.name, alias.name) for alias in node.names}
            elif isinstance(node, ast.Attribute) and getattr(node.value, "id", "") not in ("self", "cls"):
                found.add((path.name, node.attr))
    private = {(file, name) for file, name in found if name.startswith("_") and not name.endswith("__")}
    assert {name for _, name in private} <= PRIVATE_NAMES, private


#: What the head of a longer file says, and then why.
LONG = f"Longer than {FILE_LIMIT} lines:"


def test_floors_are_ten_at_most():
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"][0]
    assert contract["type"] == "layers"
    assert len(contract["layers"]) <= 10


@pytest.mark.slow
def test_no_class_shares_its_name_with_another():
    names = Counter(
        node.name
        for path in SOURCES
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert not {name for name, count in names.items() if count > 1}


@pytest.mark.slow
def test_sizes():
    """Lines of every file, parameters of every public function."""
    assert len(SOURCES) > 100
    beyond = []
    for path in SOURCES:
        text, where = path.read_text(), path.relative_to(ROOT)
        tree = ast.parse(text)
        reasoned = LONG in (ast.get_docstring(tree) or "")
        if (lines := len(text.splitlines())) > FILE_LIMIT and not reasoned:
            beyond.append(f"{where} has {lines} lines")
        if path.parent.name == "cli":  # a command of the command line has one parameter for each option
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                arguments = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
                count = len({argument.arg for argument in arguments} - {"self", "cls"})
                if count > LONG_SIGNATURES.get(node.name, PARAMETER_LIMIT):
                    beyond.append(f"{where}: {node.name} has {count} parameters")
    assert not beyond
