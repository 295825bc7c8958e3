"""The documentation in a browser: the search works from a folder, no request leaves the machine, nothing is cut off."""

from __future__ import annotations

import html
import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
import yaml

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow


def build(folder: Path, settings: dict) -> Path:
    """A site by these settings."""
    file = folder / "mkdocs.yml"
    file.write_text(yaml.dump(settings))
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "-f", str(file), "-d", str(folder / "site")]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return folder / "site"


@pytest.fixture(scope="module")
def small_site(tmp_path_factory):
    """Four pages with the theme, the hook and the search of the whole documentation."""
    pytest.importorskip("material", reason="mkdocs-material comes with the extra dev")
    folder = tmp_path_factory.mktemp("small")
    settings = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
    (folder / "docs").mkdir()
    for name in ("index.md", "glossary.md"):
        shutil.copy(ROOT / "docs" / name, folder / "docs" / name)
    del settings["nav"], settings["exclude_docs"], settings["validation"]
    settings["plugins"] = ["search", "offline"]
    settings["hooks"] = [str(ROOT / "docs/offline.py")]
    settings["markdown_extensions"] = ["admonition", "attr_list", "tables"]
    return build(folder, settings)


def test_search_from_a_folder_asks_nobody(small_site, new_page):
    page = new_page(viewport={"width": 1100, "height": 800})
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto((small_site / "index.html").as_uri())
    field = page.locator(".md-search__input").first
    result = page.locator(".md-search-result__item", has_text="Glossary").first
    for _ in range(60):  # a field that is entered before the script listens must be entered again
        field.blur()
        field.fill("angle random walk")
        page.wait_for_timeout(1000)
        if result.is_visible():
            break
    assert result.is_visible()
    page.close()
    assert len(asked) > 5
    assert not [address for address in asked if not address.startswith(("file:", "blob:", "data:"))]


#: What pushes the page or is cut: elements beyond the screen that no box around them lets scroll.
BEYOND = """() => {
  const width = document.documentElement.clientWidth;
  const scrolls = e => e && e !== document.body
    && (getComputedStyle(e).overflowX !== "visible" || scrolls(e.parentElement));
  const cut = [...document.querySelectorAll("article *")].filter(
    e => e.getBoundingClientRect().width && e.getBoundingClientRect().right > width + 1 && !scrolls(e.parentElement));
  return [document.documentElement.scrollWidth - width, cut.map(e => e.textContent.slice(0, 40))];
}"""
#: What paper cuts: boxes that would scroll, and elements beyond the sheet.
CUT_IN_PRINT = """() => {
  const width = document.documentElement.clientWidth;
  const shown = e => e.getBoundingClientRect().width && !e.closest("annotation, .md-clipboard");
  const scrolls = e => !["visible", "clip"].includes(getComputedStyle(e).overflowX)
    && e.scrollWidth > e.clientWidth + 1;
  return [...document.querySelectorAll("article *")].filter(
    e => shown(e) && (scrolls(e) || e.getBoundingClientRect().right > width + 1)).map(e => e.textContent.slice(0, 40));
}"""
#: Tables that a phone shows in part: one has to scroll within their box.
IN_PART = """() => [...document.querySelectorAll(".md-typeset__scrollwrap")].filter(
  e => e.clientWidth && e.scrollWidth > e.clientWidth + 1).map(e => e.textContent.trim().slice(0, 40))"""
#: Figures that a phone shrinks until their labels cannot be read; one with a width of its own is meant to be small.
SHRUNK = """() => [...document.querySelectorAll("article img:not([width])")].filter(
  e => e.clientWidth && e.clientWidth < Math.min(e.naturalWidth, 480)).map(e => e.alt.slice(0, 40))"""
#: Blocks of wrapped lines that are not copied as they were written; the theme marks what it copies.
COPIED_WRONGLY = """() => [...document.querySelectorAll(".wrapped code")].filter(e => {
  e.setAttribute("data-md-copying", "");
  const copied = e.innerText;
  e.removeAttribute("data-md-copying");
  return copied.trimEnd() !== e.textContent.trimEnd();
}).map(e => e.textContent.slice(0, 40))"""
#: Pictures drawn on white that a dark page shows as they are.
GLARING = """() => {
  document.body.dataset.mdColorScheme = "slate";
  const found = [...document.querySelectorAll("article img")].filter(
    e => e.clientWidth && getComputedStyle(e).filter === "none" && !e.src.includes("_dark"));
  document.body.dataset.mdColorScheme = "default";
  return found.map(e => e.alt.slice(0, 40));
}"""
#: Width of the text on A4 with the margins of docs/stylesheets/pages.css, px.
PAPER = 680
#: Nobody scrolls further, px: a phone's screen is 844 high.
LONGEST = 16_000


def dead_links(site: Path) -> list[tuple[str, str]]:
    """Links within the site that lead to no file, or to no place in it."""
    texts = {
        path.resolve(): path.read_text(encoding="utf-8") for path in site.rglob("*.html") if path.name != "404.html"
    }
    places = {path: set(re.findall(r'\b(?:id|name)="([^"]+)"', text)) for path, text in texts.items()}
    dead = []
    for path, text in texts.items():
        for link in map(html.unescape, re.findall(r'(?:href|src)="([^"]+)"', text)):
            parts = urlsplit(link)
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            place = unquote(parts.fragment)
            missing = place and not place.startswith("__") and place not in places.get(target, {place})
            if not parts.scheme and (missing or not target.exists()):
                dead.append((path.name, link))
    return dead


def test_a_dead_link_is_found(tmp_path):
    (tmp_path / "a.html").write_text(
        '<p id="here"><a href="#here"></a><a href="b.html#there"></a><a href="c.html"></a>'
    )
    (tmp_path / "b.html").write_text('<a href="a.html#here"></a><a href="https://example.org/x"></a>')
    assert dead_links(tmp_path) == [("a.html", "b.html#there"), ("a.html", "c.html")]


@pytest.mark.long
def test_every_page_fits_a_phone_and_paper_and_asks_nobody(tmp_path, new_page):
    site = tmp_path / "site"
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", str(site)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert dead_links(site) == []
    page = new_page(viewport={"width": 390, "height": 844})
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 40
    for path in pages:
        page.goto(path.as_uri())
        assert page.evaluate(BEYOND) == [0, []], path.name
        assert page.evaluate("document.documentElement.scrollHeight") < LONGEST, path.name
        assert page.evaluate(SHRUNK) == [], path.name
        assert page.evaluate(COPIED_WRONGLY) == [], path.name
        assert page.evaluate(GLARING) == [], path.name
        assert "][gyronorth" not in page.inner_text("body"), f"{path.name}: a reference without a target"
        if path.parent.name == "guide":  # results have wide tables of figures
            assert page.evaluate(IN_PART) == [], path.name
        page.emulate_media(media="print")
        page.set_viewport_size({"width": PAPER, "height": 1000})
        assert page.evaluate(CUT_IN_PRINT) == [], path.name
        page.emulate_media(media="screen")
        page.set_viewport_size({"width": 390, "height": 844})
    page.close()
    assert not [address for address in asked if address.startswith("http")]
