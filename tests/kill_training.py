"""Kill a training 20 times and continue it each time; a program of `test_learn_training`.

It forks the trainings from one process that has imported PyTorch already and runs no other
thread, so that a start costs nothing: `python kill_training.py FOLDER` reads settings.yaml and
data.npz there, trains to FOLDER/b, and prints for each kill the epochs logged and saved.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
from pathlib import Path

import numpy as np
import torch
import torch.utils.tensorboard

from gyronorth.learn.data import HeadingSet, TrainingData
from gyronorth.learn.run import run_training
from gyronorth.learn.settings import read_settings

KILLS = 20


def main(folder: Path) -> None:
    torch.set_num_threads(1)
    settings = read_settings(folder / "settings.yaml")
    with np.load(folder / "data.npz") as stored:
        sets = [HeadingSet(*(stored[f"{part}_{name}"] for name in ("gyro_l", "heading", "recording"))) for part in "tv"]
    data, chance, kills = TrainingData(*sets), random.Random(20240501), 0
    # Once through here, for all that is imported on first use, and to know how long a training lasts.
    started = time.monotonic()
    run_training(settings, "all", data, folder / "whole")
    span = (time.monotonic() - started) / 4
    while kills < KILLS:
        child = os.fork()
        if child == 0:
            run_training(settings, "all", data, folder / "b", resume=True)
            os._exit(0)
        time.sleep(chance.uniform(0, span))
        done, status = os.waitpid(child, os.WNOHANG)
        if done:  # it finished before the kill: begin another one
            assert status == 0
            for path in [*folder.glob("b.training/*.pt"), *folder.glob("b.training/*.jsonl")]:
                path.unlink()
            continue
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        kills += 1
        print(json.dumps({"logged": logged(folder / "b.training"), "saved": saved(folder / "b.training")}), flush=True)


def logged(folder: Path) -> list[int]:
    return [
        path.read_text().count("}\n") if path.exists() else 0
        for path in (folder / "denoiser.jsonl", folder / "heading.jsonl")
    ]


def saved(folder: Path) -> list[int]:
    files = (folder / "denoiser.pt", folder / "heading.pt")
    return [len(torch.load(path, weights_only=True)["progress"]["history"]) if path.exists() else 0 for path in files]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
