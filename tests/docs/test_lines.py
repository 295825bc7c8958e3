"""Where lines of the documentation may end: docs/long_lines.py; the marks of docstrings: docs/docstring_marks.py."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import SimpleNamespace

import pytest

DOCS = Path(__file__).parents[2] / "docs"


def module(name: str):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("<p>in 95 % of <b>100 %</b></p>", "<p>in 95\u00a0% of <b>100\u00a0%</b></p>"),
        ("<code>a % b 5 %</code>", "<code>a % b 5 %</code>"),
        (
            '<code class="a--b">x --gyro-unit g</code>',
            '<code class="a--b">x <span class="option">--gyro-unit</span> g</code>',
        ),
        ("<p>not here: --out</p>", "<p>not here: --out</p>"),
        (f"<code>{'test_' * 6}</code>", f"<code>{'test_<wbr>' * 6}</code>"),
        (f"<code>{'of.names.' * 4}x</code>", f"<code>{'of.<wbr>names.<wbr>' * 4}x</code>"),
        (
            "<code>a_name.of(something.or_other)</code>",
            "<code>a_<wbr>name.<wbr>of(<wbr>something.<wbr>or_<wbr>other)</code>",
        ),
        ("<code>tcp|udp:HOST | x</code>", "<code>tcp|<wbr>udp:HOST | x</code>"),
        (f"<h3>{'of.names.' * 4}x</h3>", f"<h3>{'of.<wbr>names.<wbr>' * 4}x</h3>"),
    ],
)
def test_options_and_percentages_stay_whole_and_long_names_break(given, expected):
    assert module("long_lines").on_page_content(given) == expected


def test_marks_of_numpydoc_become_markdown():
    value = "By [1]_, eq. 11; a[0]_b stays.\n\n.. [1] A. Author,\n       a book."
    assert read(value) == "By [1], eq. 11; a[0]_b stays.\n\n- [1] A. Author,\n       a book."
    assert read("A capture::\n\n    decode(data)") == "A capture:\n\n    decode(data)"


def test_parameters_on_one_line_have_types_of_their_own():
    value = "Parameters\n----------\nsensor, *names\n    As in `heading`.\nlow, high : float\n    Limits."
    expected = "sensor\n    As in `heading`.\n*names\n    As in `heading`.\nlow, high : float\n    Limits."
    assert read(value) == f"Parameters\n----------\n{expected}"


def read(value: str) -> str:
    """A docstring as the API pages read it."""
    pytest.importorskip("griffe", reason="griffe comes with the extra dev")
    documented = SimpleNamespace(docstring=SimpleNamespace(value=value))
    module("docstring_marks").DocstringMarks().on_object(obj=documented)
    return documented.docstring.value


def test_the_pages_show_what_a_frozen_class_takes(tmp_path):
    griffe = pytest.importorskip("griffe", reason="griffe comes with the extra dev")
    (tmp_path / "thing.py").write_text(
        "from gyronorth.frozen import frozen\n\n\n@frozen\nclass Pair:\n    first: float\n    second: int = 2\n"
    )
    marks = griffe.load_extensions(module("docstring_marks").DocstringMarks())
    found = griffe.load("thing", search_paths=[tmp_path], extensions=marks)["Pair"]
    assert [each.name for each in found.parameters] == ["self", "first", "second"]
