"""`python -m tests.plant_faults`: do the tests of the training loop catch the faults that they are there for?

Each fault is planted alone in a copy of src, the tests run on that copy, and the tests that fail are named. Exit
code 1 if a fault is caught by none, or if the tests fail without a fault.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: What watches the training loop, and what watches other files.
WATCHED = (
    "tests/learn/test_training_watched.py",
    "tests/studies/test_networks.py::test_the_baseline_of_the_studies_is_that_of_the_settings",
)
OTHERS = {
    "learn/prior_fitted.py": ("tests/learn/test_prior_fitted.py",),
    "learn/batched.py": (
        "tests/studies/test_best.py::test_what_the_closed_form_leaves_is_the_same_for_every_copy_of_a_recording",
    ),
}


@dataclass(frozen=True)
class Fault:
    """A change of one place in the source."""

    name: str
    file: str  # below src/gyronorth
    before: str
    after: str


FAULTS = (
    Fault(
        "gain abar in place of its root",
        "learn/stages.py",
        "np.sqrt(settings.schedule.alpha_bar))",
        "settings.schedule.alpha_bar)",
    ),
    Fault("the denoiser's target is x_0", "learn/stages.py", "noise, t, noise\n", "noise, t, x_0\n"),
    Fault(
        "t from 0 to T - 1",
        "learn/stages.py",
        "torch.randint(1, settings.schedule.steps + 1,",
        "torch.randint(0, settings.schedule.steps,",
    ),
    Fault(
        "step embedding at the first layer only",
        "learn/denoiser.py",
        "            step = project(embedded)\n",
        "            step = project(embedded) * (project is self.project[0])\n",
    ),
    Fault(
        "no dropout between the layers",
        "learn/regressor.py",
        "dropout(recurrent(h), self.dropout, generator)",
        "dropout(recurrent(h), self.dropout * (recurrent is self.recurrent[-1]), generator)",
    ),
    Fault(
        "no dropout before the head",
        "learn/regressor.py",
        "dropout(recurrent(h), self.dropout, generator)",
        "dropout(recurrent(h), self.dropout * (recurrent is not self.recurrent[-1]), generator)",
    ),
    Fault(
        "the decay never reaches the optimiser", "learn/training.py", 'group["lr"] = rate', 'group["lr"] = group["lr"]'
    ),
    Fault(
        "heading network without decay", "learn/stages.py", "decay(part.rate, part.rate_end,", "decay(part.rate, None,"
    ),
    Fault(
        "validation and test left undenoised",
        "learn/stages.py",
        "[denoiser.clean(part.gyro_l) for part in parts]",
        "[denoiser.clean(parts[0].gyro_l), *(part.gyro_l for part in parts[1:])]",
    ),
    Fault("the augmentation's span ignored", "learn/stages.py", "span=radians(more.span_deg)", "span=radians(20.0)"),
    Fault("baseline with batch 32", "learn/settings.py", "batch=100", "batch=32"),
    Fault("baseline of the studies with batch 32", "studies/networks.py", '"batch": 100', '"batch": 32'),
    Fault("(cos, sin) that is degrees", "learn/stages.py", "output=part.output,", 'output="degrees",'),
    Fault(
        "attention to headings asked for too",
        "learn/prior_fitted.py",
        "difference = torch.cos((heading[:, None] - heading[:known])[..., None] * order).float()",
        "difference, known = torch.cos((heading[:, None] - heading)[..., None] * order).float(), len(heading)",
    ),
    Fault(
        "swings without coupling to the rate",
        "learn/prior_fitted.py",
        "error_covariance(heading, surplus, settings,",
        "error_covariance(heading, 0 * surplus, settings,",
    ),
    Fault(
        "headings themselves in place of differences",
        "learn/prior_fitted.py",
        " - heading[:known])",
        " + heading[:known])",
    ),
    Fault(
        "the optimiser forgets between stages",
        "learn/prior_fitted.py",
        "_restore(network, optimiser, start.arrays)",
        "_restore(network, None, start.arrays)",
    ),
    Fault(
        "a network trained on another error than that asked for",
        "learn/prior_fitted.py",
        "(error[:, known:] - mean)",
        "(error[:, known:].flip(1) - mean)",
    ),
    Fault(
        "residual of the wrong sign",
        "learn/batched.py",
        "torch.remainder(h - c, 360.0)",
        "torch.remainder(h + c, 360.0)",
    ),
    Fault("no dropout in the loss", "learn/stages.py", "network(x_train[index], generator)", "network(x_train[index])"),
)


def failing(fault: Fault | None) -> list[str]:
    """Names of the tests that fail with a fault planted."""
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / "src", Path(folder) / "src", ignore=shutil.ignore_patterns("__pycache__"))
        if fault is not None:
            path = Path(folder) / "src" / "gyronorth" / fault.file
            text = path.read_text(encoding="utf-8")
            if text.count(fault.before) != 1:
                sys.exit(
                    f"{fault.name}: {fault.file} holds {text.count(fault.before)} places {fault.before!r}, not one."
                )
            path.write_text(text.replace(fault.before, fault.after), encoding="utf-8")
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "-p",
            "no:randomly",
            "--tb=no",
            "-rfE",
        ]
        tests = (*WATCHED, *sum(OTHERS.values(), ())) if fault is None else OTHERS.get(fault.file, WATCHED)
        command += ["-o", f"pythonpath={folder}/src {ROOT}/tests"]
        environment = os.environ | {"PYTHONPATH": str(Path(folder) / "src")}
        done = subprocess.run(
            [*command, *tests], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
        )
    if done.returncode not in (0, 1):
        sys.exit(f"pytest ended with code {done.returncode}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return sorted(set(re.findall(r"^(?:FAILED|ERROR) \S+::(\w+)", done.stdout, re.M)))


def main() -> int:
    """Plant every fault in turn and print what catches it."""
    sound = failing(None)
    if sound:
        print(f"without a fault fail: {', '.join(sound)}")
        return 1
    missed = 0
    for fault in FAULTS:
        caught = failing(fault)
        missed += not caught
        print(f"{fault.name:<56}{', '.join(caught) if caught else 'NOT CAUGHT'}", flush=True)
    print(f"{len(FAULTS) - missed} of {len(FAULTS)} faults are caught.")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
