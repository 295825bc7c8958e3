"""gyronorth explain: the checks are those that judged the heading."""

import json

from typer.testing import CliRunner

from gyronorth import heading, read
from gyronorth.cli import app
from gyronorth.cli.app import commands
from gyronorth.cli.options import SITE
from gyronorth.report.checks import limit_text, value_text

DEMO = "examples/data/demo.npz"


def run(*arguments):
    return CliRunner().invoke(app, ["explain", DEMO, *map(str, arguments)])


def test_every_check_with_value_limit_and_formula():
    result = run("--sensor", "sdc500")
    assert result.exit_code == 0
    for check in heading(read(DEMO), sensor="sdc500").checks:
        assert check.title in result.stdout
        assert f"value {value_text(check)}, limit {limit_text(check)}" in result.stdout
    assert "FAILED" not in result.stdout
    assert "asin(-w_down / |w|)" in result.stdout


def test_a_refused_heading_names_the_check_that_failed():
    result = run("--sensor", "bmi088")
    assert result.exit_code == 3
    assert result.stdout.count("FAILED") == 1
    document = json.loads(run("--sensor", "bmi088", "--json").stdout)
    failed = [check for check in document["checks"] if not check["passed"]]
    assert [check["code"] for check in failed] == ["too_noisy"]
    assert failed[0]["value"] > failed[0]["limit"] == 90


def test_a_reason_without_a_check_is_told_too():
    result = run("--method", "paper", "--sensor", "stim300")
    assert result.exit_code == 3
    assert "bundle_mismatch" in result.stdout


def test_what_heading_is_told_of_a_recording_explain_may_be_told_too():
    def told(name):
        return {option.name for option in commands()[name].params if getattr(option, "rich_help_panel", None) == SITE}

    assert told("heading") - told("explain") == {"poses"}  # several files, each a pose


def test_a_known_bias_is_subtracted_before_the_checks():
    def checks(*arguments):
        said = run("--sensor", "sdc500", "--method", "mean", "--json", *arguments).stdout
        return {check["code"]: check["value"] for check in json.loads(said)["checks"]}

    rate = read(DEMO).without_bias((0.0, 0.0, 30 * 4.84813681109536e-06)).gyro_b.mean(axis=0)
    off = abs((rate @ rate) ** 0.5 - 7.292115e-5) / 4.84813681109536e-06
    assert abs(checks("--gyro-bias", "0,0,30")["rate_norm"] - off) < 1e-6
    assert abs(checks()["rate_norm"] - off) > 10


def test_a_required_sigma_is_judged_as_by_heading():
    assert run("--sensor", "sdc500", "--require-sigma", "7").exit_code == 0
    refused = run("--sensor", "sdc500", "--require-sigma", "2")
    assert refused.exit_code == 3
    assert "sigma_required" in refused.stdout
