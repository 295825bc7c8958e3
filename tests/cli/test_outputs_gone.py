"""Exit codes where standard output or error is full, closed, or read by nobody: as ever, and without a traceback."""

import os
import shlex
import subprocess
import sys

import pytest

full = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")


@pytest.mark.slow
@full
@pytest.mark.parametrize(
    ("command", "where", "code"),
    [
        ("heading nofile.csv", "2>/dev/full", 2),
        ("heading nofile.csv", "2>&-", 2),
        ("heading nofile.csv", "2>&1 | head -c 0", 2),
        ("--help", ">/dev/full 2>&1", 2),
        ("--help", "2>/dev/full", 0),
        ("--help", "| head -c 0", 141),
        ("sensors", "| head -c 0", 141),
    ],
)
def test_the_exit_code_says_what_was_found(tmp_path, command, where, code):
    line = f"{{ {shlex.quote(sys.executable)} -m gyronorth {command}; echo $? >code; }} {where}"
    run = subprocess.run(["bash", "-c", line], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (tmp_path / "code").read_text().split() == [str(code)]
    assert "Traceback" not in run.stdout + run.stderr
