"""What README and pages say is so: commands, outputs, code, files, codes, pictures; the examples run."""

from __future__ import annotations

import ast
import importlib.util
import os
import pkgutil
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import yaml

import gyronorth as gn
from gyronorth.sensor import read_sensor

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))
DEMO = ROOT / "examples/data/demo.npz"
TESTING = ROOT / "docs/testing.md"
#: The shortest form of a study with networks.
QUICK = (
    "gyronorth benchmark paper --study table_2 --network-splits 1 --splits 1 --seeds 1 --epochs 1 --workers 1 "
    "-o out/quick"
)
#: Languages under which a command or code would be shown without being run.
UNCHECKED = {"bash", "shell", "zsh", "py", "pycon", "ipython"}


def script(name: str) -> ModuleType:
    """A script of docs/ as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / f"docs/{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # its dataclasses look themselves up
    spec.loader.exec_module(module)
    return module


OUTPUTS = script("make_outputs")
PAGES = OUTPUTS.pages()


def pin(package: str) -> str:
    """The version of a package in constraints.txt."""
    return re.search(rf"^{package}==(.*)$", (ROOT / "constraints.txt").read_text(), re.MULTILINE)[1]


SAME_STREAMS = np.__version__ == pin("numpy")
same_streams = pytest.mark.skipif(
    not SAME_STREAMS, reason="NumPy keeps a seed's stream only within a version (NEP 19): needs the pin"
)


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A folder where the paths of the documentation are valid and output stays out of the tree."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path)
    for name, value in (("COLUMNS", "100"), ("NO_COLOR", "1"), ("TERM", "dumb"), ("MPLBACKEND", "agg")):
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "src"))
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    return tmp_path


def run(arguments: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=3600, check=False)


def need_extras(path: Path) -> None:
    """Skip where the page or the example needs an extra that is not installed."""
    text = path.read_text()
    if "gyronorth train" in text or "gyronorth.learn" in text:
        pytest.importorskip("torch", reason="PyTorch comes with the extra train")
    if "--method paper" in text or "by learned" in text:
        pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra learned")


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_runs_and_shows_what_comes_out(page, clone, monkeypatch):
    need_extras(page)
    if (
        page.stem != "README"
    ):  # what a page shows is text: the pictures of one page are drawn, and those of tests/report
        monkeypatch.setattr("gyronorth.report.html.svg_text", lambda figure, salt: "<svg></svg>")
        monkeypatch.setattr("gyronorth.report.figures.write", lambda figure, path: path.write_bytes(b""))
    for block in OUTPUTS.blocks(page.read_text()):
        done = OUTPUTS.work(block)
        for command, (code, output) in zip(OUTPUTS.commands(block), done, strict=True):
            assert code == 0 or block.language == "console", f"{command}\n{output}"
            assert code in (0, 2, 3), f"{command}\n{output}"
        if SAME_STREAMS:
            answers = iter([output for _, output in done])
            assert OUTPUTS.answered(block, answers) == block.text, f"run `make outputs`: {page.name}"
        check_file(block)


def check_file(block) -> None:
    """A file that a page shows is one that the program takes."""
    if not (block.comment and block.comment.startswith("file: ")):
        return
    path = Path(block.comment.removeprefix("file: "))
    if path.suffix == ".yaml":
        settings = pytest.importorskip("gyronorth.learn.settings")
        settings.read_settings(path)
    else:
        assert {".json": read_sensor, ".csv": gn.read}[path.suffix](path)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_no_block_escapes(page):
    text = page.read_text()
    found = OUTPUTS.blocks(text)
    assert not {block.language for block in found} & UNCHECKED
    assert len(re.findall(r"^```", text, re.MULTILINE)) == 2 * len(found)


def exceptions() -> dict[str, str]:
    """Commands that are only shown, by the table of docs/testing.md, and what runs in the place of each."""
    rows = re.findall(r"^\|[^`|]*\| `(gyronorth .*?)` \|.*?`([^`]+)`[^`]*\|$", TESTING.read_text(), re.MULTILINE)
    return dict(rows)


def test_what_is_only_shown_is_listed_with_what_runs_instead():
    shown = [
        line
        for page in PAGES
        for block in OUTPUTS.blocks(page.read_text())
        for line in block.text.splitlines()
        if line.startswith("gyronorth ") and block.language not in ("sh", "console")
    ]
    assert sorted(shown) == sorted(exceptions())
    text = "\n".join(path.read_text() for path in [*PAGES, *sorted((ROOT / "tests").rglob("test_*.py"))])
    for instead in exceptions().values():
        pattern = rf"^{re.escape(instead)}$|def {re.escape(instead)}\("
        assert instead == QUICK or re.search(pattern, text, re.MULTILINE), instead


@pytest.mark.long
def test_a_study_of_networks_in_its_shortest_form(clone):
    pytest.importorskip("torch", reason="PyTorch comes with the extra train")
    assert QUICK in exceptions().values()
    code, output = OUTPUTS.run(QUICK)
    assert code == 0, output
    assert "CRMSE" in Path("out/quick/table_2.md").read_text()


def test_commands_in_sentences_exist():
    from gyronorth.cli.app import commands

    known = commands()
    called = {call for page in PAGES for call in re.findall(r"`gyronorth ([^`]+)`", page.read_text())}
    assert len(called) > 10
    for call in called | {shown.removeprefix("gyronorth ") for shown in exceptions()}:
        name, *words = shlex.split(call)
        options = {each for parameter in known[name].params for each in (*parameter.opts, *parameter.secondary_opts)}
        assert {word for word in words if word.startswith("-")} - {"-"} <= options, call  # "-" is standard input


def test_a_wrong_output_is_found(clone):
    page = "```console\n$ gyronorth heading examples/data/demo.npz --sensor sdc500 | head -2\nheading  46 deg\n```\n"
    new = OUTPUTS.rewritten(page)
    assert "verdict            valid\nheading            45.71 deg\n```" in new
    assert OUTPUTS.rewritten(new) == new


def codes() -> set[str]:
    """The codes of reasons and warnings in the source."""
    found = set()
    for path in (ROOT / "src").rglob("*.py"):
        text = path.read_text()
        if not re.search(r"\b(Gate|Finding|Note)\(", text):
            continue
        for node in ast.walk(ast.parse(text)):
            name = getattr(getattr(node, "func", None), "id", "")
            if name in ("Gate", "Finding", "Note") and node.args and isinstance(node.args[0], ast.Constant):
                found.add(node.args[0].value)
    return found


def test_every_code_has_its_entry():
    entries = re.findall(r"^### `(\w+)`$", (ROOT / "docs/guide/refusals.md").read_text(), re.MULTILINE)
    found = codes()
    assert len(found) > 10
    assert sorted(entries) == sorted(found)


def test_every_equation_of_the_paper_is_placed():
    """All 25 labels, each with code that exists."""
    pytest.importorskip("torch", reason="PyTorch comes with the extra train")
    rows = re.findall(r"^\| (eq:.*?) \|.*\| (.*?) \|$", (ROOT / "docs/theory/paper.md").read_text(), re.MULTILINE)
    labels = set()
    for label, _ in rows:
        named = [int(number) for number in re.findall(r"eq:(\d+)", label)]
        labels |= set(range(named[0], named[1] + 1)) | set(named) if " to " in label else set(named)
    assert labels == set(range(1, 26)) - {10}  # no equation has the label 10
    for name in re.findall(r"`([\w.]+)`", " ".join(ours for _, ours in rows)):
        assert pkgutil.resolve_name(f"gyronorth.{name}")


def test_every_json_field_is_explained():
    text = (ROOT / "docs/guide/output.md").read_text()
    fields = gn.heading(gn.read(DEMO), sensor="sdc500").to_json()
    assert not [name for name in fields if f"`{name}`" not in text]


def test_every_public_name_is_in_the_reference():
    text = (ROOT / "docs/api.md").read_text()
    pages = "\n".join(page.read_text() for page in (ROOT / "docs/reference/python").glob("*.md"))
    modules = re.findall(r"^::: (.*)$", pages, re.M)
    for name in set(gn.__all__) - {"__version__"}:
        assert f"[`gn.{name}`][gyronorth." in text
        home = getattr(gn, name).__module__
        assert any(home == module or home.startswith(f"{module}.") for module in modules)


def test_command_reference_has_every_option():
    from gyronorth.cli.app import commands

    text = "\n".join(script("command_reference").pages().values())
    assert "\x1b" not in text
    assert "`OUT.csv|.parquet`" in text  # no bar is escaped within code
    for name, command in commands().items():
        assert f"## gyronorth {name}\n" in text
        for parameter in command.params:
            assert parameter.help, f"{name} {parameter.name} has no help text"
            names = parameter.opts if parameter.param_type_name == "option" else []
            assert not [each for each in names if f"`{each}`" not in text]


def test_pictures_are_those_of_the_pages():
    shown = {name for page in PAGES for name in re.findall(r"images/(\w+)\.svg", page.read_text())}
    made = script("make_pictures").PICTURES
    files = {path.stem: path for path in (ROOT / "docs/images").glob("*.svg")}
    assert shown == set(made)
    assert set(files) == {*made, *(f"{name}_narrow" for name in made)}
    assert all(path.stat().st_size < 150_000 for path in files.values())


#: Pictures that show no figures of a simulation are drawn in no time.
SCHEMATIC = ("attitude", "axes", "latitude", "mounting")


@pytest.mark.slow
@pytest.mark.parametrize("names", [SCHEMATIC, pytest.param(None, marks=pytest.mark.long)], ids=["schematic", "all"])
@same_streams
def test_figures_in_the_pictures_are_current(names):
    pictures = script("make_pictures")
    for name in names or pictures.PICTURES:
        for file, narrow in ((name, False), (f"{name}_narrow", True)):
            drawn, kept = pictures.picture(name, narrow=narrow), (ROOT / f"docs/images/{file}.svg").read_text()
            labels = [re.findall(r">([^<>]+)</text>", text) for text in (drawn, kept)]
            assert labels[0] == labels[1], f"run `make pictures`: {file}"


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.stem)
def test_example_runs(example, clone, capsys, monkeypatch):
    need_extras(example)
    monkeypatch.setattr("gyronorth.sensor.sensor_names", lambda: ("hg9900", "sdc500", "stim300"))  # for all there are
    runpy.run_path(str(example), run_name="__main__")
    assert capsys.readouterr().out.strip()


def test_every_example_is_in_the_index():
    index = (ROOT / "examples/README.md").read_text()
    assert re.findall(r"^\| `(\d\d_\w+\.py)`", index, re.MULTILINE) == [path.name for path in EXAMPLES]


@pytest.mark.long
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
    code, output = OUTPUTS.run(shlex.join([program, *arguments]))
    assert code == 0, output
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
    assert missing <= {"gyronorth", "gyronorth-bundles"}  # made here


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name.strip()).lower()
