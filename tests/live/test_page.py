"""The page in Debian's Chromium, and who may open it."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from http.cookiejar import CookieJar
from math import degrees, radians
from pathlib import Path
from threading import Event, Thread

import numpy as np
import pytest
from typer.testing import CliRunner

import gyronorth as gn
from gyronorth.cli import app
from gyronorth.live import access as access_module
from gyronorth.live.access import COOKIE, Access, is_loopback
from gyronorth.readers import write
from gyronorth.simulation import Motion

ROOT = Path(__file__).parents[2]
#: The verdicts that the page has shown, one after the other.
REMEMBER = """
window.verdicts = [];
new MutationObserver(() => {
  const now = document.querySelector('[data-verdict]')?.textContent;
  if (now && now !== window.verdicts.at(-1)) window.verdicts.push(now);
}).observe(document, {childList: true, subtree: true, characterData: true});
"""


@contextmanager
def live(folder: Path, *arguments: str, given: int | None = None) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A running command and the address of its page."""
    command = [sys.executable, "-m", "gyronorth.cli", "live", *arguments, "--port", "0"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    process = subprocess.Popen(
        command, cwd=folder, env=environment, text=True, stdin=given, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stderr is not None
    try:
        yield process.stderr.readline().split()[1], process
    finally:
        process.terminate()
        out, err = process.communicate(timeout=300)
        print(out, err)
    assert "Traceback" not in err


def turned_recording(path: Path) -> float:
    """A unit that stands, turns by 180 deg and stands; its heading at the end, deg."""
    recording = gn.simulate(
        "hg9900",
        latitude=radians(48),
        heading=radians(120),
        duration=100,
        rate_hz=100,
        rng=np.random.default_rng(20260501),
        motion=Motion(turns=((60.0, 10.0, np.pi),), smooth=True),
    )
    write(recording, path)
    assert recording.heading_true is not None
    return degrees(recording.heading_true)


#: Samples of the first stand, their rate, and how much faster they come.
STAND, RATE_HZ, SPEED = 6000, 100, 6
STRUCK = "getComputedStyle(document.querySelector('[data-heading]')).textDecorationLine"


def feed(pipe: int, lines: list[str], released: Event) -> None:
    """Six times faster than measured: a stand, as long as `released` is not set, then the turn and the other stand."""
    rows = [line.partition(",")[2] if line[0] in "t0123456789" else line for line in lines]
    first = next(i for i, line in enumerate(lines) if line.startswith("t,")) + 1
    stand, rest = rows[first : first + STAND], rows[first + STAND :]
    with os.fdopen(pipe, "w") as out:
        out.writelines(rows[:first])
        at = 0
        while at < STAND or not released.is_set():
            begun = at % STAND
            out.writelines(stand[begun : begun + 100])
            out.flush()
            at += 100
            time.sleep(100 / (SPEED * RATE_HZ))
        for begun in range(0, len(rest), 100):
            out.writelines(rest[begun : begun + 100])
            out.flush()
            time.sleep(100 / (SPEED * RATE_HZ))


@pytest.mark.slow
def test_a_turned_recording_on_the_page(tmp_path, new_page):
    """Aligning, valid, lost by a stop, a server that freezes, the end, a server that dies."""
    from playwright.sync_api import expect

    truth = turned_recording(tmp_path / "turned.csv")
    arguments = ("-", "--rate", str(RATE_HZ), "--sensor", "hg9900", "--save", "north.csv")
    reading, writing = os.pipe()
    released = Event()
    sender = Thread(target=feed, args=(writing, (tmp_path / "turned.csv").read_text().splitlines(True), released))
    problems: list[str] = []
    hosts: set[str] = set()
    page = new_page(viewport={"width": 1180, "height": 900}, reduced_motion="reduce")
    page.add_init_script(REMEMBER)
    page.on("console", lambda message: problems.append(message.text) if message.type in ("error", "warning") else 0)
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("request", lambda request: hosts.add(re.sub(r"\w+://([^:/]+).*", r"\1", request.url)))
    verdict = page.locator("[data-verdict]")
    with live(tmp_path, *arguments, given=reading) as (url, process):
        os.close(reading)
        page.goto(url)
        sender.start()
        expect(verdict).to_be_visible()
        expect(page.get_by_role("button", name="Mark")).to_be_enabled()
        page.keyboard.press("m")
        expect(page.locator(".gn")).to_contain_text("Marks:")
        expect(verdict).to_contain_text("Valid")
        watch, alarm = page.locator("[data-watch]"), page.locator("[data-alarm]")
        watch.click()
        expect(watch).to_have_attribute("aria-pressed", "true")
        expect(alarm).to_be_empty()
        health = page.request.get(f"{url}healthz")
        assert (health.status, health.json()) == (200, {"ok": True, "troubles": []})
        assert page.request.get(f"{url}api/heading").json()["valid"] is True
        page.keyboard.press("t")
        expect(verdict).to_have_text("✕ Invalid: stopped")
        expect(alarm).to_have_text("Heading lost: invalid. Do not steer by it.")
        assert page.evaluate(STRUCK) == "line-through"
        health = page.request.get(f"{url}healthz")
        assert (health.status, health.json()["ok"]) == (503, False)
        assert page.request.get(f"{url}api/heading").json()["valid"] is False
        page.keyboard.press("s")
        expect(verdict).to_contain_text("Valid")
        expect(alarm).to_be_empty()
        process.send_signal(signal.SIGSTOP)
        expect(verdict).to_contain_text("Invalid: no news from the instrument")
        assert page.evaluate(STRUCK) == "line-through"
        expect(page.get_by_text("Heading: valid")).not_to_be_visible()
        process.send_signal(signal.SIGCONT)
        released.set()
        page.get_by_text("Data: ended").wait_for()
        expect(verdict).to_have_text("✕ Invalid: the source has ended")
        page.wait_for_timeout(3500)  # it stays so
        expect(verdict).to_have_text("✕ Invalid: the source has ended")
        verdicts = page.evaluate("window.verdicts")
        assert "✓ Valid" in verdicts
        assert "✕ Aligning: too short" in verdicts or "… Aligning: too short" in verdicts
        heading_deg = float(page.locator("[data-heading]").inner_text().rstrip("°"))
        text = page.locator(".verdict").inner_text()
        low, high = map(float, re.search(r"95 %: ([\d.]+) to ([\d.]+)°", text).groups())  # type: ignore[union-attr]
        assert low <= truth <= high
        assert low <= heading_deg <= high

        page.get_by_role("button", name="Save").click()
        expect(page.locator("[data-saved]")).to_contain_text("north.2.csv")
        page_heading(page, tmp_path, heading_deg, url)
        page.get_by_label("Bow to starboard").fill("10")
        page.get_by_role("button", name="Set the alignment offset").click()
        turned = re.compile(f"{heading_deg + 10:.1f}".replace(".", r"\.")[:-1])
        expect(page.locator("[data-heading]")).to_contain_text(turned)
        assert problems == []
        process.kill()
        expect(verdict).to_contain_text("Invalid: no news from the instrument")
        assert page.evaluate(STRUCK) == "line-through"
        page.screenshot(path=os.environ.get("GYRONORTH_SHOT", str(tmp_path / "late.png")))
    sender.join()
    page.close()
    assert hosts == {"127.0.0.1"}


def page_heading(page, folder: Path, heading_deg: float, url: str) -> None:
    """What was saved, and what the links give, is read back to the same answer."""
    offline = gn.heading(gn.read(folder / "north.2.csv"), sensor="hg9900")
    assert offline.valid
    assert offline.heading is not None
    assert degrees(offline.heading) == pytest.approx(heading_deg, abs=0.051)  # one decimal is shown
    assert page.request.get(f"{url}recording").body() == (folder / "north.2.csv").read_bytes()
    assert f"{degrees(offline.heading):.2f}" in (folder / "north.2.html").read_text()
    assert "<svg" in page.request.get(f"{url}report").text()


@pytest.fixture(scope="module")
def guarded(tmp_path_factory) -> Iterator[tuple[Path, str, int]]:
    """An instrument for the network, which asks for a token: its folder, its address and the port of its sentences."""
    import socket

    from gyronorth.live.binding import allow_descriptors

    allow_descriptors()
    folder = tmp_path_factory.mktemp("guarded")
    turned_recording(folder / "turned.csv")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        nmea_port = free.getsockname()[1]
    arguments = (
        "turned.csv",
        "--method",
        "mean",
        "--speed",
        "1",
        "--save",
        "north.csv",
        "--nmea-out",
        f"tcp:127.0.0.1:{nmea_port}",
    )
    with live(folder, *arguments, "--host", "0.0.0.0", "--token", "a b&c" * 4) as (url, process):
        yield folder, url.replace("0.0.0.0", "127.0.0.1"), nmea_port
        assert process.poll() is None


def opened_with_its_token(url: str) -> urllib.request.OpenerDirector:
    """What has opened the page once, and has its cookie."""
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))
    assert b"gyronorth live" in opener.open(url, timeout=300).read()
    return opener


@pytest.mark.slow
def test_a_token_opens_the_page(guarded):
    _, url, _ = guarded
    page = url.partition("?")[0]
    with pytest.raises(urllib.error.HTTPError, match="401"):
        urllib.request.urlopen(page, timeout=300)
    assert b"gyronorth live" in opened_with_its_token(url).open(page, timeout=300).read()


@pytest.mark.slow
def test_many_idle_connections_do_no_harm(guarded):
    """1,200 to the page and 200 to the sentences: both go on to answer, and the recording goes on."""
    import socket
    from contextlib import ExitStack

    folder, url, nmea_port = guarded
    port = int(url.partition("?")[0].rstrip("/").rpartition(":")[2])
    with ExitStack() as idle:
        for target in [port] * 1200 + [nmea_port] * 200:
            idle.enter_context(socket.create_connection(("127.0.0.1", target), timeout=300))
        before = (folder / "north.csv").stat().st_size
        opened_with_its_token(url)
        with socket.create_connection(("127.0.0.1", nmea_port), timeout=300) as listener, listener.makefile() as lines:
            assert [next(lines).startswith("$") for _ in range(4)] == [True] * 4
        deadline = time.monotonic() + 300
        while (folder / "north.csv").stat().st_size == before and time.monotonic() < deadline:
            time.sleep(0.05)
        assert (folder / "north.csv").stat().st_size > before


@pytest.mark.slow
def test_the_recording_is_downloaded_while_it_grows(guarded):
    folder, url, _ = guarded
    opener, page = opened_with_its_token(url), url.partition("?")[0]
    for _ in range(8):
        body = opener.open(f"{page}recording", timeout=300).read()
        assert body.endswith(b"\n")
        assert (folder / "north.csv").read_bytes()[200 : len(body)] == body[200:]  # the rate is filled in before
        time.sleep(0.1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--host", "0.0.0.0"], "--token"),
        (["--host", "::"], "--token"),
        (["--host", "0.0.0.0", "--token", "password"], "easily guessed"),
        (["--host", "0.0.0.0", "--token", "a" * 32], "easily guessed"),
        (["--require-sigma", "0"], "positive"),
        (["--save", "no/such/rec.csv"], "does not exist"),
        (["--no-page", "--nmea-out", "tcp:1"], "--nmea-out"),
        (["--sensor", "nonesuch"], "nonesuch"),
        (["--speed", "0"], "positive"),
    ],
)
def test_wrong_arguments_are_one_message(tmp_path, arguments, message):
    turned = tmp_path / "rec.csv"
    turned.write_text("# gyro_unit: rad/s\n# axes: frd\n# rate_hz: 10\nw_x,w_y,w_z\n" + "0,0,0\n" * 20)
    result = CliRunner().invoke(app, ["live", str(turned), *arguments])
    assert result.exit_code == 2
    assert message in result.output
    assert "Traceback" not in result.output


@pytest.mark.slow
def test_a_replay_without_a_page_prints_json_lines_and_ends(tmp_path):
    truth = turned_recording(tmp_path / "turned.csv")
    arguments = [str(tmp_path / "turned.csv"), "--no-page", "--json", "--speed", "500", "--sensor", "hg9900"]
    result = CliRunner().invoke(app, ["live", *arguments, "--save", str(tmp_path / "north.csv")])
    assert result.exit_code == 0
    last = json.loads(result.stdout.splitlines()[-1])
    assert last["heading_deg"] == pytest.approx(truth, abs=4 * last["sigma_deg"])
    assert (last["live"]["state"], last["live"]["good"]) == ("ended", 10000)


def asked(
    access: Access, *, headers: dict[str, str], query: str = "", kind: str = "http", path: str = "/x"
) -> list[dict]:
    """What is sent when a request comes."""
    sent: list[dict] = []
    raw = [(name.encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": kind, "path": path, "query_string": query.encode(), "headers": raw}

    async def receive() -> dict:
        return {"type": "websocket.connect"}

    async def send(message: dict) -> None:
        sent.append(message)

    with ThreadPoolExecutor(1) as apart:  # the browser of this file keeps a loop in this thread
        apart.submit(asyncio.run, access(scope, receive, send)).result()
    return sent


async def opened(scope, receive, send) -> None:
    await send({"type": "opened"})


HOME = {"host": "127.0.0.1:8080"}


def test_here_no_token_is_needed_but_another_site_is_refused():
    access = Access(opened, token=None, loopback=True, port=8080)
    assert asked(access, headers=HOME) == [{"type": "opened"}]
    assert asked(access, headers={**HOME, "origin": "http://127.0.0.1:8080"}) == [{"type": "opened"}]
    assert asked(access, headers={**HOME, "origin": "http://evil.example"})[0]["status"] == 403
    assert asked(access, headers={"host": "evil.example"})[0]["status"] == 403  # a name that points here
    socket = asked(access, headers={**HOME, "origin": "http://evil.example"}, kind="websocket")
    assert socket == [{"type": "websocket.close", "code": 1008}]


def test_elsewhere_a_token_is_needed_once(monkeypatch):
    access = Access(opened, token="secret", loopback=False, port=8080)
    there = {"host": "north.local:8080"}
    monkeypatch.setattr(access_module, "DELAY", 0.0)
    for query in ("", "token=", "token=wrong", "token=secre"):
        assert asked(access, headers=there, query=query)[0]["status"] == 401
    assert asked(access, headers=there, kind="websocket")[0]["code"] == 1008
    first = asked(access, headers=there, query="token=secret&a=b")[0]
    headers = dict(first["headers"])
    assert (first["status"], headers[b"location"]) == (303, b"/x?a=b")
    cookie = headers[b"set-cookie"].decode().partition(";")[0]
    assert cookie.startswith(f"{COOKIE}_8080=")
    assert "secret" not in cookie
    assert b"HttpOnly" in headers[b"set-cookie"]
    for kind in ("http", "websocket"):
        assert asked(access, headers={**there, "cookie": cookie}, kind=kind) == [{"type": "opened"}]
    other = Access(opened, token="secret", loopback=False, port=8080)
    assert asked(other, headers={**there, "cookie": cookie})[0]["status"] == 401  # of another run


def test_a_program_sends_the_token_with_each_request(monkeypatch):
    access = Access(opened, token="secret", loopback=False, port=8080)
    there = {"host": "north.local:8080"}
    monkeypatch.setattr(access_module, "DELAY", 0.0)
    for kind in ("http", "websocket"):
        for scheme in ("Bearer", "bearer"):
            assert asked(access, headers={**there, "authorization": f"{scheme} secret"}, kind=kind) == [
                {"type": "opened"}
            ]
    for wrong in ("Bearer wrong", "Bearer ", "Basic secret", "secret"):
        assert asked(access, headers={**there, "authorization": wrong})[0]["status"] == 401
        assert asked(access, headers={**there, "authorization": wrong}, kind="websocket")[0]["code"] == 1008
    elsewhere = {**there, "authorization": "Bearer secret", "origin": "http://evil.example"}
    assert asked(access, headers=elsewhere)[0]["status"] == 403


@pytest.mark.parametrize(
    "odd",
    [{"host": "[::1"}, {"host": "127.0.0.1:x"}, {"host": ""}, {}, {"host": "a@127.0.0.1"}, {"host": "127.0.0.1 x"}],
)
def test_an_odd_host_is_bad_request(odd):
    assert asked(Access(opened, token=None, loopback=True, port=8080), headers=odd)[0]["status"] == 400


def test_an_odd_origin_is_bad_request():
    access = Access(opened, token=None, loopback=True, port=8080)
    assert asked(access, headers={**HOME, "origin": "http://[::1"})[0]["status"] == 400


@pytest.mark.parametrize("path", ["//evil.example/x", "/\\evil.example", "/\\/evil.example", "///evil.example"])
def test_the_token_leads_to_no_other_site(path):
    access = Access(opened, token="secret", loopback=False, port=8080)
    answer = asked(access, headers={"host": "north.local"}, query="token=secret", path=path)[0]
    location = dict(answer["headers"])[b"location"].decode()
    assert answer["status"] == 303
    assert location.startswith("/evil.example")


def test_every_answer_tells_the_browser_to_be_careful():
    async def page(scope, receive, send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": [(b"x", b"y")]})

    for access, headers in (
        (Access(page, token=None, loopback=True, port=1), HOME),
        (Access(page, token="s", loopback=False, port=1), HOME),
    ):
        sent = dict(asked(access, headers=headers)[0]["headers"])
        assert b"frame-ancestors 'none'" in sent[b"content-security-policy"]
        assert (sent[b"x-content-type-options"], sent[b"referrer-policy"]) == (b"nosniff", b"no-referrer")


def test_many_wrong_tokens_are_turned_away(monkeypatch):
    monkeypatch.setattr(access_module, "MOST_WAITING", 0)
    access = Access(opened, token="secret", loopback=False, port=8080)
    assert asked(access, headers={"host": "north.local"}, query="token=wrong")[0]["status"] == 429


@pytest.mark.slow
@pytest.mark.parametrize(
    ("host", "here"), [("127.0.0.1", True), ("localhost", True), ("::1", True), ("0.0.0.0", False), ("ship", False)]
)
def test_loopback(host, here):
    assert is_loopback(host) is here
