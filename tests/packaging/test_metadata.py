"""What a package index shows, and the recipe beside pyproject.toml."""

import importlib.util
import re
import tomllib
from pathlib import Path

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
def test_the_address_is_that_of_the_citation(line, address):
    assert metadata.repository(f"version: 1\n{line}\n") == address


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
