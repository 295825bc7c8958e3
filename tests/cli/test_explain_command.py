"""gyronorth explain: the checks are those that judged the heading."""

import json

from typer.testing import CliRunner

from gyronorth import heading, read
from gyronorth.cli import app
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
