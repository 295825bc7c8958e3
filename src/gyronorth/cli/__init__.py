"""The command line: thin, no physics.

Exit codes: 0 done, or a valid heading; 2 bad input or usage, with one message; 3 a heading was
refused or could not be computed, with the reasons; 130 interrupted (Ctrl-C); 141 whoever read standard
output has gone.
"""

from __future__ import annotations

import gc
import os
import sys
import warnings

# A command makes much that lives until it ends, and few cycles: counting through all of it again and again is a fifth
# of what a short one takes. This package is loaded by the command alone.
gc.set_threshold(100_000)

from gyronorth.cli.app import app as app  # noqa: E402  # its libraries are most of what is counted


def main() -> None:
    """Entry point of the `gyronorth` command."""
    # Matrices are small here: a second thread of the matrix library brings nothing, and waits for its turn on a busy
    # machine (`allan` took six times as long).
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Typer's own models need no plugins of pydantic, and looking for them reads what is known of every package.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # What libraries remark on damaged numbers is no message: every result is checked.
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    try:
        app()
    finally:
        gc.freeze()  # the process ends: what is left needs no search for cycles
