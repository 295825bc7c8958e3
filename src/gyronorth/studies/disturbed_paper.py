"""The paper's pipeline trained on the reference mix, in the tables of `benchmark disturbed`.

Its networks are trained as units of work on recordings of other seeds than the test set, then
judged on the same recordings as the other methods.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gyronorth.angles import angle_error
from gyronorth.published import model_based
from gyronorth.studies.methods import rounded
from gyronorth.studies.networks import pack, rebuilt, unpack
from gyronorth.studies.work import Job, Result

#: Recordings that train and that choose the epoch.
TRAINED, VALIDATED = 16000, 2000
#: Samples of its windows, s at 3 Hz: the only length that it takes.
WINDOW = 100.0
#: What differs from the paper's settings: each recording is one of its own heading, so that none is turned to others.
HEADING = {
    "denoised": False,  # cleaned before, by a denoiser of any kind
    "epochs": 20,
    "patience": 20,
    "batch": 100,
    "augment": {"copies": 1, "span_deg": 0.0},
}
DENOISER = {"epochs": 60, "patience": 20}


@dataclass(frozen=True)
class Row:
    """One way to train it."""

    denoiser: str | None  # kind of `learn.disturbed_paper`, or none
    output: str | None  # of the heading network; None: the closed form of the time mean


#: Row of the tables -> how it was trained.
ROWS = {
    "paper's pipeline, denoiser trained on the mix, degrees": Row("disturbance", "degrees"),
    "paper's pipeline, denoiser trained on the mix, (cos, sin)": Row("disturbance", "cos_sin"),
    "paper's pipeline, denoiser trained on white noise, (cos, sin)": Row("white", "cos_sin"),
    "paper's heading network without denoiser, (cos, sin)": Row(None, "cos_sin"),
    "paper's denoiser trained on the mix, closed form": Row("disturbance", None),
    "paper's denoiser trained on white noise, closed form": Row("white", None),
    "paper's denoiser in one step, closed form": Row("pairs", None),
}


def settings_of(row: Row, seed: int, epochs: int | None) -> dict:
    """Settings of the networks of a row, with `epochs` at most."""
    settings: dict[str, Any] = {"seed": seed, "samples": round(3 * WINDOW), "denoiser": DENOISER, "heading": HEADING}
    if row.output is not None:
        settings["heading"] = {**HEADING, "output": row.output}
    if row.denoiser == "pairs":  # many recordings in place of 576 clean ones: fewer epochs are as many steps
        settings["denoiser"] = {"epochs": 30, "patience": 30, "batch": 100}
    if epochs is not None:
        for part in ("denoiser", "heading"):
            settings[part] = {**settings[part], "epochs": min(epochs, settings[part]["epochs"])}
    return settings


def training_units(seed: int, epochs: int | None) -> dict[str, tuple[Job, ...]]:
    """Units that train each row: its denoiser, its heading network."""
    units, drawn = {}, {"recordings": [TRAINED, VALIDATED]}
    for name, row in ROWS.items():
        needs: tuple[Job, ...] = ()
        if row.denoiser is not None:
            arguments = {"kind": row.denoiser, "settings": settings_of(Row(row.denoiser, None), seed, epochs), **drawn}
            needs = (Job(f"disturbed_paper/denoiser-{row.denoiser}", train_denoiser_unit, arguments),)
        if row.output is not None:
            arguments = {"kind": row.denoiser, "settings": settings_of(row, seed, epochs), **drawn}
            network = f"disturbed_paper/heading-{row.denoiser}-{row.output}"
            needs = (*needs, Job(network, train_heading_unit, arguments, needs))
        units[name] = needs
    return units


def judge_unit(name: str, case: dict, trained: dict[str, tuple[Job, ...]]) -> Job:
    """Errors of all rows on the recordings of a case."""
    needs = tuple(unit for units in trained.values() for unit in units)
    counts = {row: len(units) for row, units in trained.items()}
    return Job(name, judge_trained, {**case, "counts": counts}, needs)


def train_denoiser_unit(*, kind: Any, settings: dict, recordings: list[int]) -> Result:
    """Weights of a denoiser, and how it came about; recordings for training and validation are drawn."""
    from gyronorth.learn.disturbed_paper import TRAIN, VALIDATION, draw_recordings, train_kind
    from gyronorth.learn.settings import Settings

    checked = Settings.model_validate(settings)
    train, validation = (
        draw_recordings(checked, n, stream=s) for n, s in zip(recordings, (TRAIN, VALIDATION), strict=True)
    )
    trained = train_kind(checked, kind, train, validation)
    return {
        "kind": kind,
        "settings": checked.model_dump(mode="json"),
        "normalisation": vars(trained.normalisation),
        "epochs": trained.progress.epoch,
        "best_epoch": trained.progress.best_epoch,
        "weights": pack({k: v.numpy() for k, v in trained.network.state_dict().items()}),
    }


def train_heading_unit(*needs: Result, kind: Any, settings: dict, recordings: list[int]) -> Result:  # noqa: ARG001 - part of the job's name
    """Weights of a heading network behind a denoiser, or none."""
    from gyronorth.learn.data import TrainingData
    from gyronorth.learn.disturbed_paper import TRAIN, VALIDATION, draw_recordings
    from gyronorth.learn.settings import Settings
    from gyronorth.learn.stages import train_heading

    checked = Settings.model_validate(settings)
    streams = zip(recordings, (TRAIN, VALIDATION), strict=True)
    drawn = [draw_recordings(checked, count, stream=stream).noisy for count, stream in streams]
    train, validation = (type(one)(_cleaned(needs, one.gyro_l), one.heading, one.recording) for one in drawn)
    trained = train_heading(checked, TrainingData(train, validation), None)
    return {
        "settings": checked.model_dump(mode="json"),
        "epochs": trained.progress.epoch,
        "best_epoch": trained.progress.best_epoch,
        "weights": pack({k: v.numpy() for k, v in trained.network.state_dict().items()}),
    }


def judge_trained(
    *needs: Result,
    kind: str,
    duration: float,
    bias_deg_h: float,
    runs: int,
    seed: int,
    counts: dict[str, int],
) -> Result:
    """Errors, deg, of every row on the recordings of a case."""
    from gyronorth.studies.disturbed_methods import part_of

    part = part_of(kind=kind, duration=duration, bias_deg_h=bias_deg_h, runs=runs, rows=(0, runs), seed=seed)
    errors, first, cleaned = {}, 0, {}
    for name, count in counts.items():
        row, own = ROWS[name], needs[first : first + count]
        first += count
        if row.denoiser not in cleaned:
            cleaned[row.denoiser] = _cleaned(own[: int(row.denoiser is not None)], part.gyro)
        gyro = cleaned[row.denoiser]
        heading = model_based(gyro) if row.output is None else _network(own[-1]).headings_of_clean(gyro)
        errors[name] = rounded(angle_error(part.made.heading, heading))
    return {"error_deg": errors, "inside": {}}


def _cleaned(denoiser: tuple[Result, ...], gyro_l: Any) -> Any:
    """Through the denoiser of a unit's result, if there is one."""
    from gyronorth.learn.disturbed_paper import without_disturbance
    from gyronorth.learn.settings import Settings

    if not denoiser:
        return gyro_l
    result = denoiser[0]
    trained = rebuilt(result, Settings.model_validate(result["settings"]))
    return without_disturbance(trained, result["kind"], gyro_l)


def _network(result: Result) -> Any:
    """The heading network of a unit's result."""
    from gyronorth.learn.denoiser import set_weights
    from gyronorth.learn.regressor import HeadingNetwork
    from gyronorth.learn.settings import Settings
    from gyronorth.learn.stages import TrainedHeading
    from gyronorth.learn.training import Progress

    settings = Settings.model_validate(result["settings"])
    part = settings.heading
    network = HeadingNetwork(
        layout=settings.layout, samples=settings.samples, layers=part.layers, hidden=part.hidden, output=part.output
    )
    set_weights(network, unpack(result["weights"]))
    return TrainedHeading(network, settings, None, Progress(finished=True))
