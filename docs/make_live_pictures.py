"""The pictures of the live page in docs/guide/live.md: `python docs/make_live_pictures.py` (needs Debian's chromium).

A simulated recording with one turn is replayed to the command, and its page is photographed at the width of a desk
and of a phone, light and dark, while the heading of the second pose is valid.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from math import radians
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, sync_playwright

from gyronorth.readers import write
from gyronorth.simulation import Motion, simulate

IMAGES = Path(__file__).parent / "images"
SENSOR, LATITUDE, HEADING, RATE_HZ, SEED = "sdc500", radians(32.11), radians(40), 100.0, 20260501
RECORDING, SPEED = "turned.csv", 20
#: Second pose, s: the pictures are taken after the first part of it, and before its end.
SECOND, FIRST_PART = 1500, 240
DESK, PHONE = (1180, 900), (390, 844)
COLOURS = 200  # so that the files are small


def recording(folder: Path) -> None:
    """Five minutes in one direction, a turn by 180 deg, and long enough in the other."""
    motion = Motion(turns=((300.0, 20.0, radians(180)),), smooth=True)
    path, rng = folder / RECORDING, np.random.default_rng(SEED)
    write(
        simulate(
            SENSOR, latitude=LATITUDE, heading=HEADING, duration=320 + SECOND, rate_hz=RATE_HZ, rng=rng, motion=motion
        ),
        path,
    )


def photograph(browser: Browser, url: str, name: str, *, size: tuple[int, int], scheme: str) -> None:
    """One picture: on a desk of the whole page, on a phone of the first screen."""
    path = IMAGES / f"live_{name}.png"
    context = browser.new_context(
        viewport={"width": size[0], "height": size[1]},
        color_scheme=scheme,  # type: ignore[arg-type]
        reduced_motion="reduce",
    )
    page = context.new_page()
    page.goto(url)
    page.wait_for_selector("[data-heading]")
    page.wait_for_timeout(500)
    page.screenshot(path=path, full_page=size == DESK)
    context.close()
    Image.open(path).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
    print(path, f"{path.stat().st_size / 1000:.0f} kB")


def main() -> None:
    """Replay and photograph."""
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("chromium is not installed: apt-get install chromium")
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        recording(folder)
        command = [sys.executable, "-m", "gyronorth.cli", "live", RECORDING, "--sensor", SENSOR]
        command += ["--speed", str(SPEED), "--save", "north.csv", "--port", "0"]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=folder)
        assert process.stderr is not None
        url = process.stderr.readline().split()[1]
        page = browser.new_page()
        page.goto(url)
        page.get_by_text("Pose 2").wait_for(timeout=120_000)
        page.wait_for_timeout(1000 * FIRST_PART / SPEED)
        for scheme in ("light", "dark"):
            for width, size in (("desk", DESK), ("phone", PHONE)):
                photograph(browser, url, f"{width}_{scheme}", size=size, scheme=scheme)
        assert page.get_by_text("Data: ended").count() == 0, "the recording ended before the last picture"
        page.close()
        process.terminate()
        process.communicate()
        browser.close()


if __name__ == "__main__":
    main()
