"""Run all benchmarks, or those named: `python -m benchmarks [generation allan ...] [--rounds N] [--json FILE]`.

`python -m benchmarks league` compares errors and claims, not times; `samples` shows cost and memory against length,
`stages` where the time of `heading` goes; `page` writes docs/results/performance.md from what was written with
`--json`. One thread, CPU time, candidates interleaved; exit code 1 if a promised ratio was missed.
"""

from __future__ import annotations

import argparse
import importlib
import json
import pkgutil
import statistics
import sys
from pathlib import Path

from benchmarks.comparison import Result, run

#: Modules of this folder that compare nothing.
OTHERS = ("__main__", "comparison", "league", "live_soak", "page", "samples", "stages")


def main() -> int:
    """Run, print, and tell whether every promise was kept."""
    if sys.argv[1:2] in (["league"], ["page"], ["samples"], ["stages"]):
        return importlib.import_module(f"benchmarks.{sys.argv[1]}").main(sys.argv[2:])
    package = Path(__file__).parent
    found = [m.name for m in pkgutil.iter_modules([str(package)]) if m.name not in OTHERS]
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Speed beside peers, as ratios.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which to run, of {', '.join(found)}; default all")
    parser.add_argument("--rounds", type=int, default=7, help="timed rounds of each comparison")
    parser.add_argument("--json", type=Path, help="also write the figures here")
    arguments = parser.parse_args()
    unknown = set(arguments.names) - set(found)
    if unknown:
        parser.error(f"no benchmark named {', '.join(sorted(unknown))}; there are {', '.join(found)}")

    results: list[Result] = []
    for name in arguments.names or found:
        for comparison in importlib.import_module(f"benchmarks.{name}").comparisons():
            results.append(run(comparison, rounds=arguments.rounds))
            _show(results[-1])
    if arguments.json:
        figures = [
            {
                "title": r.comparison.title,
                "ours": r.comparison.ours,
                "promised": r.comparison.targets,
                "cpu_s": {name: [round(each, 4) for each in all_] for name, all_ in r.seconds.items()},
                "peak_mb": r.peak,
            }
            for r in results
        ]
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    return 1 if any(result.missed() for result in results) else 0


def _show(result: Result) -> None:
    comparison = result.comparison
    width = max(len(name) for name in comparison.candidates)
    print(f"\n{comparison.title}")
    for name in comparison.candidates:
        line = f"  {name:<{width}}  {result.median(name):9.4f} CPU-s"
        if name != comparison.ours:
            ratios = result.ratios(name)
            line += f"  ours is {statistics.median(ratios):5.2f}x as fast ({min(ratios):.2f} to {max(ratios):.2f})"
            if name in comparison.targets:
                line += f", promised {comparison.targets[name]:g}x"
        elif comparison.limit is not None:
            line += f"  promised {comparison.limit:g}"
        if name == comparison.ours and result.peak is not None:
            line += f"  peak {result.peak:.0f} MB, promised {comparison.megabytes:g}"
        print(line, flush=True)
    for problem in result.missed():
        print(f"  MISSED  {problem}")


if __name__ == "__main__":
    sys.exit(main())
