"""Half an hour of frames at 1 kHz, 20 times faster than a unit sends them, ended by kill -9."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from unit_at_rest import unit

from gyronorth.frames import FrameStream

ROOT = Path(__file__).parents[2]
#: Frames of a second, seconds, and how much faster they come; the share of frames with a wrong byte.
RATE_HZ, SECONDS, SPEED, DAMAGED = 1000, 1800, 20, 0.01
#: Frames that are sent again and again: their sequence counter, of 128 numbers, goes on from the last to the first.
BLOCK = 100 * 128
#: Once so many s of the stream are behind, 12 s of the program, memory is flat within so many MB.
SETTLED, FLAT = 240, 20.0


def resident(pid: int) -> float:
    """MB that a process holds."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.long
def test_half_an_hour_of_frames_loses_none_and_kill_9_loses_a_second(tmp_path, monkeypatch):
    case, _ = unit("kvh-A-rate", monkeypatch, seconds=BLOCK / RATE_HZ)
    frames, rng = case.frames, np.random.default_rng(7)
    saved, size = tmp_path / "rec.csv", len(frames[0])
    command = [sys.executable, "-m", "gyronorth.cli", "live", "-", "--no-page", "--save", str(saved)]
    command += ["--latitude", "48", "--rate", str(RATE_HZ), "--axes", "frd", "--sensor", "isa100c"]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": str(ROOT / "src")}
    )
    assert process.stdin is not None
    pipe, memory = process.stdin.fileno(), []
    os.set_blocking(pipe, False)
    sent, begun, step = bytearray(), time.monotonic(), RATE_HZ * SPEED // 20
    for first in range(0, RATE_HZ * SECONDS, step):
        piece = bytearray(b"".join(frames[(first + i) % BLOCK] for i in range(step)))
        for hit in np.flatnonzero(rng.random(step) < DAMAGED):
            piece[hit * size + size // 2] ^= 0x15
        sent += piece
        while piece:
            if select.select([], [pipe], [], 10)[1]:
                del piece[: os.write(pipe, piece)]
        assert process.poll() is None
        if first >= SETTLED * RATE_HZ and first % (20 * step) == 0:
            memory.append(resident(process.pid))
        time.sleep(max(0.0, begun + (first + step) / (RATE_HZ * SPEED) - time.monotonic()))
    raw = tmp_path / "rec.bin"
    while raw.stat().st_size < len(sent) - RATE_HZ * SPEED * size:  # what a loaded machine still has to read
        time.sleep(1.0)
    time.sleep(1.0)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    kept = raw.read_bytes()
    assert kept == sent[: len(kept)]
    assert len(kept) > len(sent) - RATE_HZ * SPEED * size
    stream, good = FrameStream("kvh"), 0
    for at in range(0, len(kept), 1 << 20):
        samples = stream.feed(kept[at : at + (1 << 20)])
        good += 0 if samples is None else len(samples)
    with saved.open() as lines:
        rows = sum(line[0] in "-.0123456789" for line in lines)
    print(f"{len(sent)} bytes, {len(kept)} kept, {good} good frames, {rows} rows")
    print(f"memory {np.round(memory).tolist()} MB")
    assert good - RATE_HZ * SPEED < rows <= good
    assert max(memory) - min(memory) < FLAT
