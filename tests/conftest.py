"""What holds for every test: threads, chance, markers; and fixtures that several modules use."""

from __future__ import annotations

import gc
import os
import shutil
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import hypothesis
import pytest

#: One thread of the matrix library, unless told otherwise; before numpy is loaded, and for every process that a test
#: starts. On the small matrices here two threads take ten times as long as one, waiting for each other.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

# A busy machine is no fault of the code: no example has a deadline. In CI the examples are the same in every run, so
# that what fails is the change under test; at a desk they are new each time, and a failure tells how to repeat it.
hypothesis.settings.register_profile(
    "gyronorth",
    deadline=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
    derandomize=bool(os.environ.get("CI")),
    print_blob=True,
)
hypothesis.settings.load_profile("gyronorth")


# Everything that is loaded while tests are collected stays to the end: nothing to look for in it, then or later.
gc.disable()


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop() -> None:
    """Set what the collection has loaded aside from the searches for garbage."""
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_itemcollected(item: pytest.Item) -> None:
    """What is long is slow too: `-m "not slow"` leaves out both."""
    if item.get_closest_marker("long"):
        item.add_marker("slow")


@pytest.fixture(scope="session", autouse=True)
def one_command_line() -> Iterator[None]:
    """The commands with all their options are put together once, not anew at each call of a test."""
    from typer.main import get_command

    from gyronorth.cli.tasks import MODULES

    for module in MODULES:  # a command is loaded when it is called; what is put together has all
        import_module(f"gyronorth.cli.{module}")
    with pytest.MonkeyPatch.context() as patch:
        once = cache(get_command)
        patch.setattr("typer.main.get_command", once)
        patch.setattr("typer.testing._get_command", once)
        yield


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of recorded data: GYRONORTH_REAL_DATA, or ../shared/data beside the project."""
    folder = Path(os.environ.get("GYRONORTH_REAL_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no recorded data: {folder} is not a folder (set GYRONORTH_REAL_DATA)")
    return folder


#: How long a page may take to come to what is expected of it, ms: a busy machine is no fault of the page.
PATIENCE_MS = 300_000


@pytest.fixture(scope="module")
def new_page() -> Iterator[Callable[..., Any]]:
    """Opens pages of Debian's Chromium, which must be there in CI."""
    pytest.importorskip("playwright", reason="playwright comes with the extra dev")
    from playwright.sync_api import expect, sync_playwright

    path = shutil.which("chromium")
    if path is None:
        told = "chromium is not installed: apt-get install chromium (make browser does it)"
        pytest.fail(told) if os.environ.get("CI") else pytest.skip(told)
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"], timeout=PATIENCE_MS)

        def opened(**options: Any) -> Any:
            page = browser.new_page(**options)
            page.set_default_timeout(PATIENCE_MS)
            return page

        yield opened
        browser.close()
