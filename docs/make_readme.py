"""Write the figures of README.md from their seeds: the demo's answer and picture, and the table.

python docs/make_readme.py            rewrite README.md and docs/images/demo.png
python docs/make_readme.py --check    exit code 1 if README.md is not what its seeds give
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from gyronorth.angles import angle_error, cyclic_rmse
from gyronorth.pipeline import heading_batch
from gyronorth.sensor import read_sensor
from gyronorth.simulation import Motion, simulate_batch
from gyronorth.uncertainty import heading_sigma_parts

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
RECORDING = "examples/data/demo.npz"
LATITUDE_DEG, DURATION, RATE_HZ, RUNS, SEED = 32.11, 100.0, 3.0, 2000, 20260501
#: (profile, scene, method), one row each. Every row of a scene sees the same recordings.
ROWS = (
    ("hg9900", "quiet", "mean"),
    ("isa100c", "quiet", "mean"),
    ("sdc500", "quiet", "mean"),
    ("sdc500", "quiet", "inertial"),
    ("sdc500", "quiet", "auto"),
    ("sdc500", "sway", "mean"),
    ("sdc500", "sway", "inertial"),
    ("sdc500", "sway", "auto"),
    ("stim300", "quiet", "mean"),
    ("bmi088", "quiet", "mean"),
)


def table() -> str:
    """The table of methods, with the sentence that says what it is."""
    lines = [
        f"{RUNS} simulated recordings a row, each a power-up of its own with any heading: {DURATION:g} s at "
        f"{RATE_HZ:g} Hz, {LATITUDE_DEG} N, seed {SEED}.",
        "All figures in deg. *Floor* is the Cramér-Rao bound of the profile's white noise alone, *sigma* the root mean",
        "square of what the method claims, *CRMSE* its cyclic root mean square error against the truth with a 95 %",
        "bootstrap interval. Refused recordings are counted in every column; guessing gives a CRMSE of 104.",
        "",
        "| profile | scene | method | floor | sigma | CRMSE | truth in the 95 % interval | refused |",
        "|---|---|---|---|---|---|---|---|",
        *(row(*settings) for settings in ROWS),
    ]
    return "\n".join(lines)


def row(name: str, scene: str, method: str) -> str:
    """One line of the table."""
    rng = np.random.default_rng([SEED, *name.encode(), *scene.encode()])
    sensor, latitude = read_sensor(name), np.radians(LATITUDE_DEG)
    truth = rng.uniform(0, 2 * np.pi, RUNS)
    gyro_b, accel_b = simulate_batch(
        sensor,
        runs=RUNS,
        latitude=latitude,
        heading=truth,
        duration=DURATION,
        rate_hz=RATE_HZ,
        motion=Motion(disturbance=scene),
        rng=rng,
    )
    found = heading_batch(gyro_b, accel_b, rate_hz=RATE_HZ, latitude=latitude, sensor=sensor, method=method)
    error = angle_error(found.heading, truth)
    # An interval of the whole circle is [0, 2 pi].
    inside = (truth - found.low) % (2 * np.pi) <= found.high - found.low + 2 * np.pi * (found.high < found.low)
    resampled = cyclic_rmse(error[rng.integers(RUNS, size=(500, RUNS))], axis=1)
    low, high = np.quantile(resampled, [0.025, 0.975])
    floor = heading_sigma_parts(sensor, latitude=latitude, duration=DURATION)["noise"]
    figures = [deg(floor), deg(np.sqrt(np.mean(found.sigma**2))), f"{deg(cyclic_rmse(error))} ({deg(low)}-{deg(high)})"]
    shares = [f"{100 * inside.mean():.1f} %", f"{100 * (1 - found.valid.mean()):.1f} %"]
    return "| " + " | ".join([name, scene, method, *figures, *shares]) + " |"


def deg(angle: float) -> str:
    """An angle in rad as text in deg with three significant digits."""
    value = float(np.degrees(angle))
    return f"{value:.{max(0, 2 - int(np.floor(np.log10(value))))}f}"


def demo(picture: Path) -> str:
    """What `gyronorth heading` prints for the shipped recording; its picture goes to `picture`."""
    arguments = ["heading", RECORDING, "--sensor", "sdc500", "--plot", str(picture)]
    environment = {**os.environ, "COLUMNS": "100", "NO_COLOR": "1"}
    run = subprocess.run(
        [sys.executable, "-c", "from gyronorth.cli import main; main()", *arguments],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        env=environment,
    )
    lines = [line.rstrip() for line in run.stdout.splitlines() if str(picture) not in line]
    return "\n".join(["```text", *lines, "```"])


def between(text: str, name: str, content: str) -> str:
    """`text` with `content` between the marks of `name`."""
    pattern = re.compile(rf"(<!-- {name}: make readme -->\n).*?(<!-- end -->)", re.DOTALL)
    assert pattern.search(text), f"README.md has no mark for {name}"
    return pattern.sub(lambda found: f"{found[1]}{content}\n{found[2]}", text)


def main() -> int:
    """Rewrite the README, or compare."""
    check = "--check" in sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        answer = demo(Path(folder, "demo.png") if check else ROOT / "docs/images/demo.png")
    old = README.read_text()
    new = between(between(old, "demo", answer), "table", table())
    if not check:
        README.write_text(new)
    elif new != old:
        print("README.md is not what its seeds give: run `make readme`", file=sys.stderr)
    return int(check and new != old)


if __name__ == "__main__":
    sys.exit(main())
