"""Rows of the catalogue, codes in the source and sections of the guide are the same."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from gyronorth.alignment.judging import GATES, OF_EVERY_RECORDING
from gyronorth.catalogue import FINDINGS, METHODS, method_info

ROOT = Path(__file__).parents[1]
#: Codes that are spelled where a finding or a gate is made.
MAKERS = {"Finding", "Gate", "Note", "_off"}


def codes_in_the_source() -> set[str]:
    """First arguments of what makes a finding or a gate."""
    found = set()
    for path in (ROOT / "src").rglob("*.py"):
        text = path.read_text()
        if not any(f"{maker}(" in text for maker in MAKERS):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in MAKERS and node.args:
                first = node.args[0]
                if isinstance(first, ast.Constant) and re.fullmatch(r"[a-z_]+", str(first.value)):
                    found.add(str(first.value))
    return found


def test_every_code_has_a_row_and_every_row_a_code():
    assert codes_in_the_source() == {row.code for row in FINDINGS}


def test_every_code_has_a_section_of_the_guide():
    page = (ROOT / "docs/guide/refusals.md").read_text()
    assert set(re.findall(r"^### `([a-z_]+)`", page, re.MULTILINE)) == {row.code for row in FINDINGS}


def test_names_are_unique_and_gates_exist():
    assert len({info.name for info in METHODS}) == len(METHODS)
    assert len({row.code for row in FINDINGS}) == len(FINDINGS)
    assert {gate for info in METHODS for gate in info.gates} | set(OF_EVERY_RECORDING) == set(GATES)
    assert method_info("turned").takes_turn_angles
