"""A method from outside: one file and one row, and it goes every way that the others go."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from gyronorth.alignment import registry
from gyronorth.errors import InputError

ROOT = Path(__file__).parents[2]
#: What somebody else's module would hold, then a command line that takes it.
TOY = '''
import sys
from dataclasses import replace

import numpy as np

from gyronorth.alignment import registry
from gyronorth.alignment.result import Result
from gyronorth.catalogue import MethodInfo


class Median:
    """The median of each axis in place of the mean; it claims what the mean claims."""

    info = MethodInfo("median", "median of each axis", __name__)

    def solve(self, problem, options):
        mean = registry.METHODS["mean"].solve(problem, options)
        rate = np.median(problem.rate_l(), axis=-2)
        heading = np.asarray(np.arctan2(-rate[1], rate[0]) % (2 * np.pi))
        return replace(mean, method="median", attitude=replace(mean.attitude, heading=heading))


registry.register(Median())
'''


def run(tmp_path, body, *arguments):
    """A fresh interpreter that registers the toy and goes on."""
    script = tmp_path / "toy.py"
    script.write_text(TOY + body)
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run(
        [sys.executable, script, *map(str, arguments)], capture_output=True, text=True, env=environment, check=False
    )
    return done


COMMAND = """
from gyronorth.cli import main
main()
"""


@pytest.fixture
def recording():
    return ROOT / "examples/data/demo.npz"


@pytest.mark.slow
def test_a_toy_method_runs_at_the_command_line_with_json_and_report(tmp_path, recording):
    page = tmp_path / "toy.html"
    arguments = ("heading", recording, "--sensor", "sdc500", "--method", "median", "--json", "--report", page)
    done = run(tmp_path, COMMAND, *arguments)
    assert (done.returncode, done.stderr) == (0, f"wrote {page}\n")
    document = json.loads(done.stdout)
    assert document["method"] == "median"
    assert abs(document["heading_deg"] - 45.7) < 2  # the mean's answer, less or more its noise
    assert document["valid"] is True
    assert "median" in page.read_text()


@pytest.mark.slow
def test_a_toy_method_is_judged_by_the_gates_and_streams_and_batches(tmp_path):
    body = """
import gyronorth as gn
rng = np.random.default_rng(0)
fine = gn.simulate("sdc500", latitude=0.56, heading=1.0, duration=60, rate_hz=5, rng=rng)
bad = replace(fine, gyro_b=fine.gyro_b * 8)
one = gn.heading(fine, sensor="sdc500", method="median")
refused = gn.heading(bad, sensor="sdc500", method="median")
stream = gn.StreamingHeading(rate_hz=5, latitude=0.56, accelerometer=True, sensor="sdc500", method="median")
stream.add(fine.gyro_b, fine.accel_b)
known = {"rate_hz": 5, "latitude": 0.56, "sensor": "sdc500", "method": "median"}
batch = gn.heading_batch(fine.gyro_b[None], fine.accel_b[None], **known)
print(one.valid, [r.code for r in refused.reasons], abs(stream.estimate().heading - one.heading) < 1e-9,
      abs(batch.heading[0] - one.heading) < 1e-9, batch.method[0])
"""
    done = run(tmp_path, body)
    assert done.stderr == ""
    assert done.stdout.startswith("True ['rate_norm'")
    assert done.stdout.strip().endswith("True True median")


def test_an_unknown_method_names_the_nearest():
    with pytest.raises(InputError, match="did you mean inertial") as told:
        registry.METHODS["inertal"]
    assert "auto, mean, inertial" in str(told.value)


def test_an_installed_package_names_its_method_as_an_entry_point(tmp_path):
    """An entry point of the group gyronorth.methods is found when its name is asked for, and not before."""
    package = tmp_path / "site" / "toy_method-1.0.dist-info"
    package.mkdir(parents=True)
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: toy-method\nVersion: 1.0\n")
    (package / "entry_points.txt").write_text("[gyronorth.methods]\nmedian = toy_method:METHOD\n")
    source = TOY.replace("registry.register(Median())", "METHOD = Median()")
    (tmp_path / "site" / "toy_method.py").write_text(source)
    code = (
        "import sys; from gyronorth.alignment import registry; print('toy_method' in sys.modules, 'nope' in "
        "registry.METHODS); print(registry.METHODS['median'].info.summary)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(tmp_path / "site")])}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    assert done.stdout.split("\n")[:2] == ["False False", "median of each axis"]
