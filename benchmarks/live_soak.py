"""`gyronorth live` on a bad line: 1 % lost, 1 % garbage, three broken connections; what is left of it is counted.

`python -m benchmarks.live_soak` plays 30 minutes at 600 Hz, 20 times faster, over TCP, and prints as JSON: good
rows that are missing in the saved file, growth of memory, share of a core, and the heading beside that of
`gyronorth.heading` on the saved file. `--speed 1 --minutes 3` tells the share of a core of a real sensor.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from math import degrees, radians
from pathlib import Path
from typing import Any

import numpy as np

from gyronorth import heading, read
from gyronorth.simulation import Motion, simulate

LATITUDE, HEADING, SENSOR, RATE_HZ, SEED = radians(48), radians(120), "isa100c", 600, 20260501
LOST = GARBAGE = 0.01
HEAD = b"# gyro_unit: rad/s\n# accel_unit: m/s2\n# axes: frd\n# rate_hz: 600\nt,w_x,w_y,w_z,f_x,f_y,f_z\n"
#: What a line may turn into.
NOISE = (b"", b"\xff\xfe\x00\x81", b"12.5,nan,0,0,0,0,0", b"1,2,3", b"t,w_x,,", b"$GPGGA,,*00")
NOISE += (b"# rate_hz: 6\x00", b"# rate_hz: 700", b"#")
STEP = 0.02  # s between two pieces of the stream
SETTLED = 60.0  # s of the stream after which memory is to be flat
#: s without any change, after which what is waited for is given up: a loaded machine is slow, but goes on.
PATIENCE = 120.0
#: Rows at the end that `live` may hold back until it is ended: one that follows a lost one waits for the next.
HELD = 3


@dataclass
class Sent:
    """What went over the line."""

    good: list[bytes] = field(default_factory=list)  # rows
    all: threading.Event = field(default_factory=threading.Event)
    lost: int = 0
    garbage: int = 0
    broken: str = ""  # why it went no further


def lines(minutes: float) -> list[bytes]:
    """Rows of a unit that stands, turns by 180 deg, and stands."""
    span = 60 * minutes
    motion = Motion(turns=((0.45 * span, 0.1 * span, np.pi),), smooth=True)
    rng = np.random.default_rng(SEED)
    recording = simulate(
        SENSOR, latitude=LATITUDE, heading=HEADING, duration=span, rate_hz=RATE_HZ, rng=rng, motion=motion
    )
    assert recording.accel_b is not None
    time_s = np.arange(len(recording.gyro_b)) / RATE_HZ
    rows = np.column_stack([time_s, recording.gyro_b, recording.accel_b])
    return [b",".join(b"%.9g" % value for value in row) for row in rows.tolist()]


def spoiled(rows: list[bytes], sent: Sent) -> Iterator[bytes]:
    """The rows as they arrive."""
    rng = np.random.default_rng(SEED)
    fate = rng.random(len(rows))
    for row, chance, kind in zip(rows, fate.tolist(), rng.integers(0, len(NOISE) + 1, len(rows)).tolist(), strict=True):
        if chance < LOST:
            sent.lost += 1
        elif chance < LOST + GARBAGE:
            sent.garbage += 1
            yield (row[: len(row) // 2] if kind == len(NOISE) else NOISE[kind]) + b"\n"
        else:
            sent.good.append(row)
            yield row + b"\n"


def play(server: socket.socket, rows: list[bytes], sent: Sent, over: threading.Event, *, speed: float) -> None:
    """Send all rows in time; what the other side does to the connection ends it."""
    try:
        _play(server, rows, sent, over, speed=speed)
    except OSError as error:
        sent.broken = str(error)
    finally:
        sent.all.set()


def _play(server: socket.socket, rows: list[bytes], sent: Sent, over: threading.Event, *, speed: float) -> None:
    """Send all rows in time, over four connections; each that breaks does so within a line, the last stays."""
    stream, number, size = spoiled(rows, sent), 0, max(1, round(STEP * speed * RATE_HZ))
    for part in np.array_split(np.arange(len(rows)), 4):
        connection, _ = server.accept()
        with connection:
            connection.sendall(HEAD)
            begun, first = time.monotonic(), number
            while number <= part[-1]:
                piece = list(islice(stream, min(size, part[-1] + 1 - number)))
                number += len(piece) or size
                connection.sendall(b"".join(piece))
                time.sleep(max(0.0, begun + (number - first) / (speed * RATE_HZ) - time.monotonic()))
            if part[-1] < len(rows) - 1:
                connection.sendall(rows[number][:20])
            else:
                sent.all.set()
                over.wait()


def watch(process: subprocess.Popen[str], samples: list[tuple[float, float]], over: threading.Event) -> None:
    """Note (time in s, MB) of a process until it is over."""
    page = os.sysconf("SC_PAGE_SIZE")
    while process.poll() is None and not over.wait(0.25):
        pages = int(Path(f"/proc/{process.pid}/statm").read_text().split()[1])
        samples.append((time.monotonic(), pages * page / 1e6))


def cpu_seconds(pid: int) -> float:
    """CPU time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def soak(folder: Path, *, minutes: float, speed: float) -> dict[str, Any]:
    """Play the stream to `gyronorth live` and compare."""
    rows, sent, saved = lines(minutes), Sent(), folder / "rec.csv"
    server = socket.create_server(("127.0.0.1", 0))
    server.settimeout(PATIENCE)
    source = f"tcp:127.0.0.1:{server.getsockname()[1]}"
    command = [sys.executable, "-m", "gyronorth.cli", "live", source, "--latitude", repr(degrees(LATITUDE))]
    command += [
        "--sensor",
        SENSOR,
        "--method",
        "mean",
        "--save",
        str(saved),
        "--json",
        "--port",
        "0",
        "--output-rate",
        "2",
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    answers: list[dict] = []
    reader = threading.Thread(target=lambda: answers.extend(json.loads(line) for line in process.stdout or ()))
    over, memory = threading.Event(), []
    watcher = threading.Thread(target=watch, args=(process, memory, over))
    player = threading.Thread(target=play, args=(server, rows, sent, over), kwargs={"speed": speed}, daemon=True)
    reader.start()
    watcher.start()
    player.start()
    try:
        _wait(process, lambda: len(answers) > 0 and _good(answers) > 0, lambda: len(answers))
        begun, used = time.monotonic(), cpu_seconds(process.pid)
        _wait(process, sent.all.is_set, lambda: len(sent.good))
        assert not sent.broken, sent.broken
        share = (cpu_seconds(process.pid) - used) / (time.monotonic() - begun)
        _wait(process, lambda: _good(answers) >= len(sent.good) - HELD, lambda: _good(answers))
    except BaseException:
        process.kill()
        raise
    finally:
        over.set()
        server.close()
    watcher.join()
    process.send_signal(signal.SIGINT)
    process.wait(timeout=PATIENCE)
    reader.join()
    player.join()
    print([(round(a - begun), round(b)) for a, b in memory[::4] if a > begun], file=sys.stderr)
    valid = process.returncode == 0  # the command's verdict on the last heading that was measured
    return _figures(answers[-1], sent, saved, memory, valid=valid, share=share, settled=begun + SETTLED / speed)


def _good(answers: list[dict]) -> int:
    return answers[-1]["live"]["good"]


def _wait(process: subprocess.Popen[str], done: Callable[[], bool], progress: Callable[[], int]) -> None:
    """Until `done`, as long as the process runs and `progress` changes within `PATIENCE`."""
    seen, since = progress(), time.monotonic()
    while not done():
        assert process.poll() is None, (
            f"live ended with {process.returncode}: {process.stderr and process.stderr.read()}"
        )
        if (now := progress()) != seen:
            seen, since = now, time.monotonic()
        assert time.monotonic() - since < PATIENCE, f"nothing has changed for {PATIENCE:g} s"
        time.sleep(0.05)


def _figures(
    last: dict,
    sent: Sent,
    saved: Path,
    memory: list[tuple[float, float]],
    *,
    valid: bool,
    share: float,
    settled: float,
) -> dict[str, Any]:
    kept = [line for line in saved.read_bytes().split(b"\n") if line and line[:1] not in b"#t"]
    offline = heading(read(saved), sensor=SENSOR, method="mean")
    assert offline.heading is not None
    flat = [mb for at, mb in memory if at >= settled]
    live = last["live"]
    return {
        "rows_sent": len(sent.good),
        "good_rows_missing_in_the_file": len(set(sent.good) - set(kept)),
        "in_order_and_nothing_else": kept == sent.good,
        "rows_lost_on_the_line": sent.lost,
        "lines_of_garbage_sent": sent.garbage,
        "garbage_counted": live["garbage"],
        "lost_counted": live["lost"],
        "reconnects": live["reconnects"],
        "restarts": live["restarts"],
        "memory_mb": round(memory[-1][1], 1),
        "memory_growth_mb": round(max(flat, default=0.0) - min(flat, default=0.0), 1),
        "share_of_a_core": round(share, 3),
        "heading_deg": last["heading_deg"],
        "offline_heading_deg": degrees(offline.heading),
        "difference_deg": abs((last["heading_deg"] - degrees(offline.heading) + 180) % 360 - 180),
        "valid": valid,
        "reasons": [reason["code"] for reason in last["reasons"] if reason["code"] != "not_running"],
    }


def main() -> int:
    """Run and print; exit code 1 where the promise was missed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.live_soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0, help="length of the stream")
    parser.add_argument("--speed", type=float, default=20.0, help="so many times faster than it was measured")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        figures = soak(Path(folder), minutes=arguments.minutes, speed=arguments.speed)
    print(json.dumps(figures, indent=2))
    kept = figures["in_order_and_nothing_else"] and figures["reconnects"] == 3 and figures["restarts"] == 0
    return 0 if kept and figures["memory_growth_mb"] <= 20 and figures["difference_deg"] <= 0.01 else 1


if __name__ == "__main__":
    sys.exit(main())
