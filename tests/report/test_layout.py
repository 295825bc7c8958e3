"""The report in a browser: on a phone nothing is wider than the screen, in print no table is cut."""

import pytest
from typer.testing import CliRunner

from gyronorth.cli import app

#: What is cut or pushes the page: elements whose right edge lies beyond that of the box around them or of the page.
BEYOND = """() => {
  const wide = document.documentElement.scrollWidth - window.innerWidth;
  const cut = [...document.querySelectorAll('section table, section figure, section .bars, section p')].filter(
    e => e.getBoundingClientRect().right > e.closest('section').getBoundingClientRect().right + 0.5);
  const cells = [...document.querySelectorAll('td, th')].filter(e => e.scrollWidth > e.clientWidth + 1);
  return [Math.max(wide, 0), cut.length, cells.map(e => e.textContent)];
}"""
#: Texts of a figure of which a part lies outside it, with its own fonts: a legend that is cut off.
OUTSIDE = """() => [...document.querySelectorAll('figure svg')].flatMap(svg => {
  const box = svg.getBoundingClientRect();
  return [...svg.querySelectorAll('text')].filter(e => {
    const own = e.getBoundingClientRect();
    return own.right > box.right + 1 || own.left < box.left - 1 || own.top < box.top - 1 || own.bottom > box.bottom + 1;
  }).map(e => e.textContent);
})"""


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """A refused heading, with checks of the sensor's ranges, and a valid one of turns; file names that are long."""
    folder = tmp_path_factory.mktemp("a_folder_with_a_name_that_is_longer_than_a_line_of_a_phone")
    turned = folder / "turned.npz"
    site = ("--latitude", "32", "--heading", "40", "--duration", "120", "--rate", "3", "--seed", "3")
    gyronorth("simulate", "--sensor", "sdc500", *site, "--turn", "36:5:90", "--turn", "78:5:90", "-o", turned)
    pages = {}
    for name, file, sensor in (
        ("refused", "examples/data/demo.npz", "bmi088"),
        ("turned", turned, "sdc500"),
    ):
        pages[name] = folder / f"{name}.html"
        with pytest.MonkeyPatch.context() as patch:
            if name == "turned":  # the same figures again
                patch.setattr("gyronorth.report.html.svg_text", lambda figure, salt: "<svg></svg>")
            gyronorth("heading", file, "--sensor", sensor, "--report", pages[name])
    return pages


def gyronorth(*words):
    done = CliRunner().invoke(app, [*map(str, words)])
    assert done.exit_code in (0, 3), done.stderr


@pytest.mark.slow
def test_nothing_is_cut_on_a_phone_and_in_print(reports, new_page):
    page = new_page()
    for name, path in reports.items():
        page.goto(path.as_uri())
        for media, width in (("screen", 390), ("screen", 1100), ("print", 680)):
            page.emulate_media(media=media)
            page.set_viewport_size({"width": width, "height": 800})
            assert page.evaluate(BEYOND) == [0, 0, []], f"{name} at {width} px, {media}"
            assert page.evaluate(OUTSIDE) == [], f"{name} at {width} px, {media}"
            assert page.locator("h2", has_text="Checks").is_visible()
    assert page.pdf(format="A4").startswith(b"%PDF")
