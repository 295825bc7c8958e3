"""The page in each of its states, on a tablet and a phone, light and dark: one server and one browser page for all."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from math import degrees, radians
from threading import Event
from types import SimpleNamespace
from typing import Any

import pytest
from live_stream import HEAD, seconds, session_of, timed_rows

from gyronorth.findings import Finding
from gyronorth.live.holding import Held
from gyronorth.live.session import LiveSettings
from gyronorth.live.status import Mark, Status
from gyronorth.readers import ReadOptions

pytestmark = pytest.mark.slow
SIZES = {"tablet": (1024, 768), "phone": (390, 844)}


@pytest.fixture(scope="module")
def states() -> dict[str, Status]:
    """What the page is shown, in the order in which a bridge sees it."""
    done = session_of(HEAD, timed_rows(seconds(0, 40))).status
    valid = replace(done, state="running", unattended=0.0, age=0.6, rate_of_turn=radians(0.1), saving=True)
    valid = replace(valid, marks=(Mark(3.2, "by the <quay>"),), last_garbage="<b>x</b>", message="connected")
    assert valid.estimate is not None
    assert valid.estimate.sigma is not None
    turning = replace(valid, rate_of_turn=radians(-1.5))
    held = Held(heading=radians(77), sigma=radians(0.4), roll=radians(1), pitch=radians(-2), since=95.0)
    return {
        "aligning": Status("running", "tcp:unit:4001", connected=True, seconds=4.0, saving=True),
        "valid": valid,
        "held": replace(turning, held=held),
        "degraded": replace(valid, require_sigma=valid.estimate.sigma / 2),
        "invalid": replace(
            valid, connected=False, trouble="stalled", silent=12.0, findings=(Finding("stalled", "No data for 12 s."),)
        ),
    }


class Shown:
    """In place of a session: the status that the test sets."""

    def __init__(self, status: Status) -> None:
        self.status, self.settings, self.ended = status, LiveSettings(ReadOptions(), require_sigma=0.01), Event()


@pytest.fixture(scope="module")
def shown(states) -> Iterator[tuple[Shown, str]]:
    """A served page, and what it shows."""
    from gyronorth.live.serving import Server

    session: Any = Shown(states["aligning"])
    listener = socket.create_server(("127.0.0.1", 0))
    server = Server(session, listener, host="127.0.0.1", token=None)
    server.start()
    yield session, server.url
    session.ended.set()
    server.close()


@pytest.fixture(scope="module")
def page(shown, new_page) -> Iterator[SimpleNamespace]:
    """A browser's page, with all that it complains of."""
    problems: list[str] = []
    page = new_page(viewport={"width": 1024, "height": 768}, reduced_motion="reduce")
    page.on("console", lambda message: problems.append(message.text) if message.type in ("error", "warning") else 0)
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(shown[1])
    page.locator("section.verdict").wait_for()
    yield SimpleNamespace(page=page, problems=problems)
    page.close()


def grave(page) -> list[tuple[str, list[str]]]:
    """What axe finds that is serious: contrast, names of controls, order, languages."""
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(page).response["violations"]
    rules = [rule for rule in found if rule["impact"] in ("serious", "critical")]
    return [(rule["id"], [node["html"] for node in rule["nodes"]]) for rule in rules]


def colour(page, *, dark: bool) -> None:
    """Press D until it is: a page that lost its server for a moment is back in the colours of the device."""
    from playwright.sync_api import Error

    wanted = f"document.body.classList.contains('body--dark') === {str(dark).lower()}"
    for _ in range(10):
        with suppress(Error):  # it is not so yet, or the page is just loaded anew
            if page.evaluate(wanted):
                return
            page.evaluate("document.activeElement.blur()")
            page.keyboard.press("d")
            page.wait_for_function(wanted, timeout=20_000)
    pytest.fail(f"the page does not become {'dark' if dark else 'light'}")


def too_small(page) -> list[str]:
    """Buttons that a finger misses: lower or narrower than 40 px."""
    return page.evaluate(
        "[...document.querySelectorAll('.gn button')].filter(b => {const r = b.getBoundingClientRect();"
        "return r.width && (r.width < 40 || r.height < 40)}).map(b => b.textContent)"
    )


def show(session: Shown, page, name: str, status: Status) -> None:
    """Wait until the page shows a status."""
    from playwright.sync_api import expect

    session.status = status
    expect(page.locator("section.verdict")).to_have_attribute("data-fitness", name)


def test_every_state_on_tablet_and_phone(states, shown, page, tmp_path):
    """The first screen holds verdict and heading, the alarm tells when it is lost; nothing is wider than the screen."""
    from playwright.sync_api import expect

    session, page, problems = shown[0], page.page, page.problems
    alarm, lights = page.locator("[data-alarm]"), page.locator(".lights")
    for name, status in states.items():
        show(session, page, name, status)
        estimate = status.estimate
        big = "---.-°" if estimate is None else f"{degrees(estimate.heading):05.1f}°"
        expect(page.locator("[data-heading]")).to_have_text(big)
        line = page.evaluate("getComputedStyle(document.querySelector('[data-heading]')).textDecorationLine")
        assert (line == "line-through") is (name in ("degraded", "invalid"))
        if name in ("valid", "held"):
            expect(lights).to_contain_text(f"Heading: {name}")
            expect(lights).to_contain_text("Motion: still" if name == "valid" else "Motion: moved")
        if name in ("degraded", "invalid"):
            expect(alarm).to_have_text(f"Heading lost: {name}. Do not steer by it.")
            expect(page.get_by_role("alert")).to_have_text(f"Heading lost: {name}. Do not steer by it.")
        else:
            expect(alarm).to_be_empty()
        for device, (width, height) in SIZES.items():
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate("document.documentElement.scrollWidth") <= width, (name, device)
            box = page.locator("[data-heading]").bounding_box()
            assert box["y"] + box["height"] < height, (name, device)
            assert too_small(page) == [], (name, device)
            page.screenshot(path=tmp_path / f"{name}-{device}.png")
        page.wait_for_timeout(600)  # the script has seen this state
    show(session, page, "valid", states["valid"])
    expect(alarm).to_be_empty()
    assert problems == []


@pytest.mark.parametrize("name", ["aligning", "valid", "held", "degraded", "invalid"])
def test_nothing_serious_stands_in_the_way_of_anybody(states, shown, page, name):
    """By axe: on the tablet in light colours, on the phone in dark ones."""
    session, page = shown[0], page.page
    show(session, page, name, states[name])
    for dark, (width, height) in enumerate(SIZES.values()):
        page.set_viewport_size({"width": width, "height": height})
        colour(page, dark=bool(dark))
        assert grave(page) == []


def test_all_is_reached_with_the_keyboard(states, shown, page):
    session, page = shown[0], page.page
    session.status = states["valid"]
    page.evaluate("document.activeElement.blur()")
    reached, rings = set(), set()
    for _ in range(12):
        page.keyboard.press("Tab")
        label, ring = page.evaluate(
            "(() => {const e = document.activeElement, s = getComputedStyle(e);"
            "return [e.getAttribute('aria-label') ?? e.textContent.trim(), s.outlineStyle + s.boxShadow]})()"
        )
        reached.add(label)
        rings.add((label, ring))
    wanted = {
        "Watch",
        "Dark or light",
        "Mark (key m)",
        "Stop (key t)",
        "Set the alignment offset",
        "Input statistics",
    }
    assert wanted <= reached
    assert not [label for label, ring in rings if label in wanted and ring == "nonenone"]
    page.locator("summary").click()
    assert grave(page) == []
