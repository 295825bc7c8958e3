"""python -m tests.fuzz --cases N --seed S: mutated inputs against the one oracle; what fails is kept in a folder."""

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzz.running import campaign


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="targets whose name begins so")
    parser.add_argument("--keep", type=Path, default=Path("out/fuzz"), help="where what fails is kept")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        counts, failures = campaign(given.cases, given.seed, Path(folder), only=given.only, keep=given.keep)
    print(f"seed {given.seed}, {given.cases} cases: " + ", ".join(f"{n} {what}" for what, n in sorted(counts.items())))
    for failure in failures:
        print(failure)
    return 1 if failures else 0


sys.exit(main())
