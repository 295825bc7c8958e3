"""Which latitude a command works with: the one given, or else that of the file, by one rule in all of them."""

from __future__ import annotations

import inspect
import json

import numpy as np
import pytest
from typer.testing import CliRunner

import gyronorth as gn
from gyronorth.cli import app

RUNNER = CliRunner(**({"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}))
STATED, GIVEN, FAR = 32.11, 32.17, 32.3


def run(*arguments: object):
    return RUNNER.invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def rec(tmp_path_factory):
    path = tmp_path_factory.mktemp("latitude") / "rec.csv"
    rng = np.random.default_rng(0)
    gn.write(gn.simulate("sdc500", latitude=np.radians(STATED), heading=1, duration=20, rate_hz=5, rng=rng), path)
    return path


def heading(rec, tmp_path, *more):
    done = run("heading", rec, "--sensor", "sdc500", "--method", "mean", "--json", *more)
    return done, done.stdout and json.loads(done.stdout)["latitude_deg"]


def many(rec, tmp_path, *more):
    done = run("heading", rec, rec, "--sensor", "sdc500", "--method", "mean", "--json", "--workers", 1, *more)
    return done, done.stdout and json.loads(done.stdout)[0].get("latitude_deg")


def info(rec, tmp_path, *more):
    done = run("info", rec, "--json", *more)
    return done, done.stdout and json.loads(done.stdout)["latitude_deg"]


def convert(rec, tmp_path, *more):
    done = run("convert", rec, "-o", tmp_path / "out.npz", *more)
    return done, not done.exit_code and np.degrees(gn.read(tmp_path / "out.npz").latitude)


def live(rec, tmp_path, *more):
    done = run("live", rec, "--no-page", "--speed", 1000, "--json", "--sensor", "sdc500", "--method", "mean", *more)
    return done, done.stdout and json.loads(done.stdout.splitlines()[-1])["latitude_deg"]


@pytest.mark.slow
@pytest.mark.parametrize("command", [heading, many, info, convert, live], ids=lambda command: command.__name__)
def test_the_one_given_wins_and_must_agree_with_the_file(rec, tmp_path, command):
    for arguments, expected in (((), STATED), (("--latitude", GIVEN), GIVEN)):
        done, used = command(rec, tmp_path, *arguments, *(("--force",) if command is convert else ()))
        assert done.exit_code in (0, 3), done.stderr
        assert used == pytest.approx(expected, abs=1e-9)
    done, _ = command(rec, tmp_path, "--latitude", FAR, *(("--force",) if command is convert else ()))
    assert done.exit_code == 2
    assert "states latitude 32.1100 deg; 32.3000 deg is given" in done.stdout + done.stderr
