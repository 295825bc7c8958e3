"""Work on workers that are lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from many_work import deadly, doubled

from gyronorth.many.running import WorkerLost, each
from gyronorth.many.workers import executor_on

PARENT = """
import sys
from functools import partial
from pathlib import Path
from many_work import written_after
from gyronorth.many.workers import executor_on
if __name__ == "__main__":
    with executor_on(None, workers=1) as executor:
        executor.submit(written_after, Path(sys.argv[1]), 5.0).result()
"""


@pytest.mark.parametrize("pool", [False, True])
def test_results_and_exceptions_come_with_their_items(pool):
    with ThreadPoolExecutor(2) as executor:
        found = dict(each(doubled, range(600), executor if pool else None))
    assert list(found) == list(range(600)) or pool
    error = found.pop(3)
    assert isinstance(error, ValueError)
    assert found == {value: 2 * value for value in range(600) if value != 3}


@pytest.mark.slow
def test_an_item_that_kills_its_worker_is_told_and_the_others_are_done():
    with executor_on(None, workers=2) as executor:
        found = dict(each(deadly, range(12), executor))
    assert isinstance(found.pop(5), WorkerLost)
    assert found == {value: 2 * value for value in range(12) if value != 5}


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system has no SIGKILL")
def test_workers_whose_parent_was_killed_stop(tmp_path):
    (tmp_path / "parent.py").write_text(PARENT)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}
    parent = subprocess.Popen([sys.executable, tmp_path / "parent.py", tmp_path], env=environment)
    while not (tmp_path / "begun").exists() or not (tmp_path / "begun").read_text():
        assert parent.poll() is None
        time.sleep(0.02)
    worker = int((tmp_path / "begun").read_text())
    parent.kill()
    parent.wait()
    for _ in range(1500):
        if not _alive(worker):
            break
        time.sleep(0.02)
    assert not _alive(worker)
    assert not (tmp_path / "done").exists()


def _alive(process: int) -> bool:
    """Whether it runs; one that has ended may wait for a parent that never asks."""
    try:
        with open(f"/proc/{process}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
