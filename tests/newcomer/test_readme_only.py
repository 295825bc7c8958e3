"""A newcomer with README.md and nothing else: three tasks, each with commands that stand there or in its help.

They run in a folder of their own, through the installed command, as a shell would.
"""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
pytestmark = pytest.mark.slow
#: Lines of README.md that begin as a command of ours.
COMMANDS = re.findall(r"^gyronorth .+$", README, re.MULTILINE)


@pytest.fixture
def clone(tmp_path):
    """What the README speaks of: the demo's recording, and a folder for results."""
    (tmp_path / "out").mkdir()
    (tmp_path / "examples/data").mkdir(parents=True)
    shutil.copy(ROOT / "examples/data/demo.npz", tmp_path / "examples/data")
    return tmp_path


def shell(command, folder, expected=(0,)):
    """Standard output of a command line that begins with gyronorth."""
    assert command.startswith("gyronorth ")
    words = command.replace("gyronorth", f"{sys.executable} -m gyronorth.cli", 1)
    done = subprocess.run(["bash", "-c", words], capture_output=True, text=True, cwd=folder, timeout=300)
    assert done.returncode in expected, f"{command}\n{done.stderr}"
    return done.stdout


def test_the_demo_gives_what_the_readme_prints(clone):
    answer = re.search(r"```text\n(verdict.+?)```", README, re.DOTALL)[1]
    assert shell("gyronorth heading examples/data/demo.npz --sensor sdc500", clone) == answer


@pytest.mark.long  # tests/test_docs.py runs them too, in this tree
def test_every_command_of_the_readme_runs(clone):
    one_shot = [command for command in COMMANDS if " live " not in command]
    assert len(one_shot) >= 6
    for command in one_shot:
        shell(command, clone)
    assert (clone / "out/heading.html").stat().st_size > 10_000


def test_an_own_csv_with_other_titles_and_units(clone):
    rows = (clone / "examples/data/mine.csv").open("w")
    shell("gyronorth convert examples/data/demo.npz -o out/demo.csv --decimate-to 5", clone)
    lines = (clone / "out/demo.csv").read_text().splitlines()
    data = [line.split(",") for line in lines if re.match(r"[-0-9.]", line)]
    with rows:  # degrees, g, and titles of the newcomer's own
        rows.write("time,gx,gy,gz,ax,ay,az\n")
        for time, *values in data:
            rates, forces = (map(float, values[:3]), map(float, values[3:6]))
            figures = [
                *(f"{value * 57.29577951308232:.9f}" for value in rates),
                *(f"{value / 9.80665:.9f}" for value in forces),
            ]
            rows.write(",".join([time, *figures]) + "\n")
    told = subprocess.run(
        [sys.executable, "-m", "gyronorth.cli", "heading", "examples/data/mine.csv", "--sensor", "sdc500"],
        capture_output=True, text=True, cwd=clone,
    )  # fmt: skip
    assert told.returncode == 2
    assert "Try: gyronorth heading" in told.stderr  # the message names what to declare
    columns = "t=time,w_x=gx,w_y=gy,w_z=gz,f_x=ax,f_y=ay,f_z=az"
    command = (
        "gyronorth heading examples/data/mine.csv --sensor sdc500 --latitude 32.11 --gyro-unit deg/s --accel-unit g"
    )
    found = json.loads(shell(f"{command} --axes frd --columns {columns} --json", clone))
    assert found["valid"]
    assert found["heading_deg"] == pytest.approx(45.7, abs=1.0)


def test_a_replay_of_a_live_sensor(clone):
    shell("gyronorth convert examples/data/demo.npz -o out/demo.csv --decimate-to 5", clone)
    lines = shell(
        "gyronorth live out/demo.csv --speed 1000 --sensor sdc500 --latitude 32.11 --no-page --json", clone, (0, 3)
    )
    last = json.loads(lines.splitlines()[-1])
    assert last["live"]["state"] == "ended"
    assert last["heading_deg"] == pytest.approx(45.74, abs=1.0)
