"""What a package index shows, and the recipe beside pyproject.toml."""

import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tomllib
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread

import jinja2
import pytest
import yaml

ROOT = Path(__file__).parents[2]
SPEC = importlib.util.spec_from_file_location("metadata_hook", ROOT / "packaging/metadata.py")
metadata = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(metadata)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
TEXT = (
    "![A picture](docs/a.png)\n\nSee [the guide](docs/index.md), [a site](https://arxiv.org/abs/1) and [below](#x).\n"
)


def test_links_point_to_the_tag_of_the_version():
    made = metadata.absolute_links(TEXT, "https://example.org/us/it", "v1.2.3")
    assert "![A picture](https://example.org/us/it/raw/v1.2.3/docs/a.png)" in made
    assert "[the guide](https://example.org/us/it/blob/v1.2.3/docs/index.md)" in made
    assert "[a site](https://arxiv.org/abs/1) and [below](#x)" in made


def test_without_an_address_no_link_is_broken():
    assert (
        metadata.absolute_links(TEXT, None, "v1")
        == "See the guide, [a site](https://arxiv.org/abs/1) and [below](#x).\n"
    )


@pytest.mark.parametrize(
    ("line", "address"),
    [("repository-code: https://example.org/a/", "https://example.org/a"), ("title: https://example.org", None)],
)
def test_the_address_that_a_citation_states(line, address):
    assert metadata.cited(f"version: 1\n{line}\n") == address


@pytest.mark.parametrize(
    ("source", "address"),
    [("https://example.org/a/", "https://example.org/a"), ("https://repository.invalid/gyronorth", None), ("", None)],
)
def test_a_placeholder_is_no_address(source, address):
    assert metadata.repository({"Source": source}) == address


def test_packages_carry_no_link_built_on_a_placeholder():
    hook = metadata.Metadata(str(ROOT), {})
    built = {"version": "1", "urls": {"Source": "https://a.invalid/x", "Paper": "https://arxiv.org/abs/1"}}
    hook.update(built)
    assert built["urls"] == {"Paper": "https://arxiv.org/abs/1"}
    assert "](docs/" not in built["readme"]["text"]
    built = {"version": "1", "urls": {"Source": "https://example.org/x"}}
    hook.update(built)
    assert built["urls"]["Changelog"] == "https://example.org/x/blob/v1/CHANGELOG.md"


def test_the_address_stands_in_one_place():
    listed = subprocess.run(["git", "ls-files"], capture_output=True, text=True, cwd=ROOT).stdout.split()
    if not listed:
        pytest.skip("not a checkout of git")
    hosts = r"(?:github|gitlab|codeberg|readthedocs|pypi|invalid)"
    address = re.compile(rf"https?://[\w./-]*{hosts}[\w./-]*/gyronorth")
    ends = (".md", ".toml", ".cff", ".yml", ".yaml", ".py", ".bib", ".service", "Containerfile", "Makefile")
    places = [
        name
        for name in listed
        if name.endswith(ends) and not name.startswith("tests/") and address.search((ROOT / name).read_text("utf-8"))
    ]
    known = metadata.repository(PROJECT["urls"])
    assert places == (["pyproject.toml"] if known is None else ["CITATION.cff", "pyproject.toml"])


def test_a_release_is_refused_while_the_address_is_a_placeholder():
    if metadata.repository(PROJECT["urls"]):
        pytest.skip("the address is known")
    command = [sys.executable, "packaging/release_check.py", "address"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 1
    assert done.stdout.startswith("FAILED  address: pyproject.toml: the address is a placeholder")


def test_the_conda_recipe_asks_for_what_the_project_needs():
    rendered = jinja2.Template((ROOT / "packaging/conda/meta.yaml").read_text()).render(PYTHON="python")
    recipe = yaml.safe_load(rendered)
    normal = lambda line: re.sub(r"\s*>=", ">=", line)  # noqa: E731
    run = {normal(line) for line in recipe["requirements"]["run"]}
    assert run == {*PROJECT["dependencies"], f"python{PROJECT['requires-python']}"}
    assert str(recipe["package"]["version"]) == PROJECT["version"]
    report = {normal(line).replace("-base", "") for line in recipe["requirements"]["run_constrained"]}
    assert report == set(PROJECT["optional-dependencies"]["report"])


def test_bundles_are_of_the_same_version():
    bundles = tomllib.loads((ROOT / "packaging/bundles/pyproject.toml").read_text())["project"]
    assert bundles["version"] == PROJECT["version"]
    assert PROJECT["optional-dependencies"]["bundles"] == [f"gyronorth-bundles=={PROJECT['version']}"]


def test_the_image_copies_all_that_the_build_reads(tmp_path):
    for line in re.findall(r"^COPY (.+)$", (ROOT / "deploy/Containerfile").read_text(), re.MULTILINE):
        *names, target = line.split()
        folder = tmp_path / target.removeprefix("/src/")
        folder.mkdir(parents=True, exist_ok=True)
        for name in names:
            if (ROOT / name).is_file():
                shutil.copy(ROOT / name, folder)
    command = [sys.executable, "-m", "hatchling", "metadata", "version"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout.strip() == PROJECT["version"], done.stderr


@pytest.mark.parametrize(("status", "well"), [(200, True), (401, False), (503, False)])
def test_the_image_asks_for_its_health_with_the_token(status, well, monkeypatch):
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            known = self.headers["Authorization"] == "Bearer of the run" and self.path == "/healthz"
            self.send_response(status if known else 401)
            self.end_headers()

    text = (ROOT / "deploy/Containerfile").read_text()
    _, option, program = json.loads(re.search(r"^HEALTHCHECK .*CMD (\[.+\])$", text, re.MULTILINE)[1])
    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        Thread(target=server.handle_request, daemon=True).start()
        monkeypatch.setenv("GYRONORTH_TOKEN", "of the run")
        command = [sys.executable, option, program.replace("8080", str(server.server_port))]
        assert (subprocess.run(command, capture_output=True).returncode == 0) is well


def test_the_image_installs_an_extra_that_there_is_and_a_python_that_is_tested():
    text = (ROOT / "deploy/Containerfile").read_text()
    assert set(re.findall(r'"/src\[(\w+)\]"', text)) <= set(PROJECT["optional-dependencies"])
    python = re.search(r"^FROM .*python:(3\.\d+)", text, re.MULTILINE)[1]
    assert f"Programming Language :: Python :: {python}" in PROJECT["classifiers"]


def test_the_oldest_packages_tested_are_the_lower_bounds():
    text = (ROOT / "Makefile").read_text()
    tested = dict(pin.split("==") for pin in re.search(r"^OLDEST := (.+)$", text, re.MULTILINE)[1].split())
    extras = PROJECT["optional-dependencies"]
    bounds = dict(
        line.split(">=")
        for line in (*PROJECT["dependencies"], *extras["report"], *extras["io"], *extras["learned"], *extras["r"])
    )
    del bounds["typing-extensions"]  # of the standard library's own makers, and pydantic asks for a later one
    assert tested.keys() == bounds.keys()
    for name, bound in bounds.items():
        assert re.fullmatch(rf"{re.escape(bound)}(\.0)*", tested[name]), name


def test_every_extra_for_users_is_in_the_table_of_the_guide():
    table = re.findall(r"^\| `(\w+)` \|", (ROOT / "docs/guide/first_heading.md").read_text(), re.MULTILINE)
    assert sorted(table) == sorted(set(PROJECT["optional-dependencies"]) - {"dev"})


def test_what_the_paper_cites_is_in_its_bibliography():
    cited = set(re.findall(r"@(\w+)", (ROOT / "paper.md").read_text()))
    assert cited == set(re.findall(r"^@\w+\{(\w+),", (ROOT / "paper.bib").read_text(), re.MULTILINE))


def test_the_paper_has_the_form_that_joss_asks_for():
    """Metadata, sections in order and 750 to 1750 words: docs/paper.md of openjournals/joss, November 2026."""
    _, front, body = (ROOT / "paper.md").read_text(encoding="utf-8").split("---\n", 2)
    fields = yaml.safe_load(front)
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= fields.keys()
    assert {str(one["affiliation"]) for one in fields["authors"]} == {
        str(one["index"]) for one in fields["affiliations"]
    }
    assert re.fullmatch(r"\d{1,2} [A-Z][a-z]+ \d{4}", str(fields["date"]))
    assert (ROOT / fields["bibliography"]).exists()
    assert re.findall(r"^# (.+)$", body, re.MULTILINE) == [
        "Summary",
        "Statement of need",
        "State of the field",
        "Software design",
        "Research impact statement",
        "AI usage disclosure",
        "Acknowledgements",
        "References",
    ]
    assert 750 <= len(re.sub(r"^#.*$", "", body, flags=re.MULTILINE).split()) <= 1750


def test_the_changelog_keeps_its_form():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    versions = re.findall(r"^## (.+)$", text, re.MULTILINE)
    assert all(re.fullmatch(r"\d+\.\d+\.\d+ - (Unreleased|\d{4}-\d\d-\d\d)", name) for name in versions), versions
    assert versions[0].startswith(f"{PROJECT['version']} - ")
    assert not any(name.endswith("Unreleased") for name in versions[1:])
    for version in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        groups = re.findall(r"^### (.+)$", version, re.MULTILINE)
        assert len(set(groups)) == len(groups)
        assert set(groups) <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    entries = re.findall(r"^- (.{40})", text, re.MULTILINE)
    assert len(set(entries)) == len(entries), "an entry stands twice"


def test_what_the_oldest_packages_leave_out_exists():
    text = (ROOT / "Makefile").read_text().replace("\\\n", "")
    names = " ".join(re.findall(r"^(?:WITH_TORCH|WITH_PINS) := (.+)$", text, re.MULTILINE)).split()
    assert len(names) > 8
    for path, _, test in (name.partition("::") for name in names):
        assert (ROOT / path).exists(), path
        assert not test or f"def {test}(" in (ROOT / path).read_text(), test
