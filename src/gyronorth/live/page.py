"""The page: one for every browser that opens it, redrawn about once a second."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from functools import partial
from html import escape
from math import degrees, radians
from pathlib import Path

from fastapi import FastAPI
from nicegui import events, ui

from gyronorth.errors import InputError
from gyronorth.live import drawing, wording
from gyronorth.live.countdown import Countdown
from gyronorth.live.reporting import write_report
from gyronorth.live.serving import RECORDING_URL, REPORT_URL
from gyronorth.live.session import Session

#: Redrawn so often, s.
REDRAWN = 1.0
#: What a button did is shown after so long, s.
SHOWN_AFTER = 0.3
#: Key -> what it does, as the page says it.
KEYS = {"s": "start", "t": "stop", "m": "mark", "v": "save", "d": "light or dark"}
#: The button of the officer: full screen, a screen that stays on, and the sound of the alarm. The script does it.
WATCH = '<button type="button" data-watch aria-pressed="false" title="Full screen, screen on, sound">Watch</button>'
#: How long the server waits for a browser, s; that nothing comes the page itself says after 3 s.
RECONNECT_S = 30.0
STYLE, SCRIPT = (Path(__file__).with_name(name) for name in ("page.css", "page.js"))


def attach(app: FastAPI, session: Session) -> None:
    """Serve the page from an application."""
    ui.run_with(
        app,
        root=lambda: build(session),
        title="gyronorth live",
        dark=None,
        language="en-GB",
        favicon="🧭",
        tailwind=False,
        show_welcome_message=False,
        # After less, behind a busy machine or a weak radio link, a browser goes on without loading the page anew.
        reconnect_timeout=RECONNECT_S,
    )


def build(session: Session) -> None:
    """The content of the page, in the present client."""
    ui.add_css(STYLE.read_text(encoding="utf-8"))
    dark = ui.dark_mode(value=None)
    with ui.element("div").classes("gn"):
        with ui.element("div").classes("top"):
            ui.html("<h1>gyronorth live</h1>", sanitize=False)
            ui.html(WATCH, sanitize=False).style("width: auto; margin-left: auto")
            ui.button("Dark / light", on_click=lambda: _toggle(dark), color=None).props(
                'flat dense no-caps aria-label="Dark or light"'
            )
        settings = session.settings
        countdown = Countdown(settings.sensor, settings.require_sigma)
        ui.html('<p data-alarm role="alert"></p>', sanitize=False)
        pictures = [_Picture(lambda status: wording.verdict(status, countdown.text(status)), session)]
        said = ui.html(sanitize=False).classes("unseen").props('role="status" aria-live="polite"')
        actions = _buttons(session, dark)
        saved = ui.html(sanitize=False)
        with ui.element("div").classes("lights"):
            pictures.append(_Picture(wording.lights, session, style="display: contents"))
        with ui.element("div").classes("pair"):
            for title, draw in (
                ("Heading against time, with its 95 % band", drawing.heading_chart),
                ("Rate norm against time, deg/h (dashed: Earth rate)", lambda status: drawing.rate_chart(status.found)),
            ):
                pictures.append(_Picture(_titled(title, draw), session))
        with ui.element("div").classes("pair"):
            pictures.append(_Picture(_titled("Turning", wording.turning), session))
            with ui.element("div"):
                _alignment(session)
                pictures.append(_Picture(wording.marks, session))
                pictures.append(_Picture(wording.targets, session))
        with ui.element("details").classes("fold"):
            with ui.element("summary"):
                ui.html("Input statistics", sanitize=False, tag="span")
            pictures.append(_Picture(_titled("Input statistics", wording.counters), session))
        keys = ", ".join(f"<kbd>{key}</kbd> {name}" for key, name in KEYS.items())
        ui.html(f'<p class="faint">Keys: {keys}.</p>', sanitize=False)
    beat = ui.html(sanitize=False).classes("unseen").props("data-beat aria-hidden=true")
    ui.add_body_html(f"<script>{SCRIPT.read_text(encoding='utf-8')}</script>")
    ui.keyboard(on_key=actions.key, ignore=["input", "textarea"], repeating=False)

    def redraw() -> None:
        for picture in pictures:
            picture.redraw()
        beat.set_content(f"{time.monotonic():.1f}")
        text = escape(wording.verdict_short(session.status))
        if said.content != text:
            said.set_content(text)
        actions.enable()

    actions.saved, actions.redraw = saved, redraw
    redraw()
    ui.timer(REDRAWN, redraw)


def _alignment(session: Session) -> None:
    """Where the alignment offset is seen and set."""

    def set_offset() -> None:
        try:
            session.align(radians(float("nan" if field.value is None else field.value)))
        except InputError as error:
            ui.notify(str(error), type="negative", position="top")
            return
        ui.notify(f"Alignment offset {field.value:+.2f}°.", position="top")

    with ui.element("section").classes("offset"):
        ui.html("<h2>Alignment offset</h2>", sanitize=False)
        field = ui.number(
            label="Bow to starboard of the unit's x, deg",
            value=round(degrees(session.status.alignment), 4), min=-180, max=180, format="%.2f",
        )  # fmt: skip
        field.on("keydown.enter", set_offset)
        ui.button("Set", on_click=set_offset, color=None).props('no-caps aria-label="Set the alignment offset"')


class _Picture:
    """A piece of HTML that is sent again only when it has changed."""

    def __init__(self, draw: Callable, session: Session, *, style: str = "") -> None:
        self._draw, self._session = draw, session
        self._html = ui.html(sanitize=False).style(style)

    def redraw(self) -> None:
        content = self._draw(self._session.status)
        if content != self._html.content:
            self._html.set_content(content)


class _Actions:
    """What the buttons and the keys do."""

    saved: ui.html
    redraw: Callable[[], None]

    def __init__(self, session: Session, dark: ui.dark_mode) -> None:
        self._session, self._dark = session, dark
        self.buttons: dict[str, ui.button] = {}

    def enable(self) -> None:
        """Only what makes sense now."""
        state = self._session.status.state
        allowed = {
            "start": state in ("running", "stopped"),
            "stop": state in ("waiting", "running"),
            "mark": state == "running",
            "save": self._session.status.found is not None,
        }
        for name, button in self.buttons.items():
            button.set_enabled(allowed[name])

    async def do(self, name: str) -> None:
        if not self.buttons[name].enabled:
            return
        if name == "save":
            await self._save()
            return
        await asyncio.to_thread(self._session.command, name)
        ui.notify({"start": "Restarted.", "stop": "Stopped.", "mark": "Marked."}[name], position="top")
        await asyncio.sleep(SHOWN_AFTER)
        self.redraw()

    async def key(self, event: events.KeyEventArguments) -> None:
        modified = event.modifiers.ctrl or event.modifiers.alt or event.modifiers.meta
        name = KEYS.get(event.key.name.lower() if len(event.key.name) == 1 else "")
        if not event.action.keydown or modified or name is None:
            return
        if name == KEYS["d"]:
            _toggle(self._dark)
        else:
            await self.do(name)

    async def _save(self) -> None:
        session = self._session
        await asyncio.to_thread(session.saved)
        status = session.status
        try:
            report = await asyncio.to_thread(write_report, status, session.settings)
        except InputError as error:
            ui.notify(f"The report is not written. {error}", type="negative", position="top")
            return
        links = [f'<a href="{REPORT_URL}" target="_blank">{escape(report.name if report else "report")}</a>']
        if status.recording is not None and status.recording_bytes:
            links.insert(0, f'<a href="{RECORDING_URL}" download>{escape(status.recording.name)}</a>')
        where = f" in {escape(str(status.recording.resolve().parent))}" if status.recording else ""
        self.saved.set_content(f"<section data-saved>Saved{where}: {' and '.join(links)}</section>")


def _buttons(session: Session, dark: ui.dark_mode) -> _Actions:
    actions = _Actions(session, dark)
    labels = {"start": "<u>S</u>tart", "mark": "<u>M</u>ark", "stop": "S<u>t</u>op", "save": "Sa<u>v</u>e"}
    with ui.element("div").classes("buttons").props('role="group" aria-label="Session"'):
        for name, label in labels.items():
            key = next(key for key, does in KEYS.items() if does == name)
            with ui.button(on_click=partial(actions.do, name), color=None) as button:
                ui.html(label, sanitize=False, tag="span")
            button.props(f'aria-label="{name.capitalize()} (key {key})" aria-keyshortcuts="{key}" no-caps')
            actions.buttons[name] = button
    return actions


def _titled(title: str, draw: Callable) -> Callable:
    return lambda status: f'<section class="chart"><h2>{title}</h2>{draw(status)}</section>'


def _toggle(dark: ui.dark_mode) -> None:
    """Light, dark: what the device prefers counts until the first press."""
    dark.set_value(not dark.value)
