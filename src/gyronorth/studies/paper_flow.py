"""`benchmark paper`: a flow over the error of a recording's rate beside the closed form and `learned`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.evaluation import bootstrap_crmse, bootstrap_ratio, wilson
from gyronorth.sensor import TriadErrors
from gyronorth.studies.floors import floor_deg
from gyronorth.studies.methods import as_rad
from gyronorth.studies.networks import pack, unpack
from gyronorth.studies.study import Study, StudyPlan
from gyronorth.studies.tables import StudyReport, Table, degrees
from gyronorth.studies.work import Job, Result

if TYPE_CHECKING:
    from gyronorth.learn.flow import TrainedFlow

#: Seed of the recordings judged: that of the test set of `benchmark disturbed`.
SEED = 20240611
#: Kind of disturbance, residual bias, deg/h, recordings of 100 s.
CASES = (
    ("mixed", 0.1, 300),
    ("quiet", 0.1, 100),
    ("mixed", 1.0, 100),
    *((kind, 0.1, 60) for kind in ("tilt", "soak", "square", "ramp", "beat", "wind", "lean", "nudge")),
)
#: Kinds that the flow learned from, with the residual bias of the first case.
TRAINED_ON = ("mixed", "quiet")
ROWS = ("mean", "normal law of a network", "flow", "learned")


def train_flow_unit(*, settings: dict) -> Result:
    """Train both networks on simulated recordings; their weights and losses."""
    from gyronorth.learn.flow import FlowSettings, train_flow

    trained = train_flow(FlowSettings(**settings))
    return {
        "settings": settings,
        "loss": {name: [float(f"{value:.5g}") for value in values] for name, values in trained.loss.items()},
        "encoder": pack({k: v.numpy() for k, v in trained.encoder.state_dict().items()}),
        "flow": pack({k: v.numpy() for k, v in trained.flow.state_dict().items()}),
    }


def judge_flow_unit(trained: Result, *, kind: str, bias_deg_h: float, runs: int, seed: int) -> Result:
    """Errors, deg, and whether the intervals hold, of each of `ROWS`."""
    from gyronorth.learn.flow import read_headings
    from gyronorth.studies.disturbed_methods import MethodHeadings, Part, by_learned, by_mean, judged, part_of

    flow = rebuilt_flow(trained)
    part = part_of(kind=kind, duration=100.0, bias_deg_h=bias_deg_h, runs=runs, rows=(0, runs), seed=seed)

    def by_flow(one: Part, *, normal: bool) -> MethodHeadings:
        return MethodHeadings(*read_headings(flow.log_density(one.gyro, one.made.latitude, normal=normal)))

    return judged(
        part,
        {
            "mean": by_mean,
            "normal law of a network": lambda one: by_flow(one, normal=True),
            "flow": lambda one: by_flow(one, normal=False),
            "learned": by_learned,
        },
    )


def rebuilt_flow(result: Result) -> TrainedFlow:
    """The networks of a unit's result."""
    from gyronorth.learn.denoiser import set_weights
    from gyronorth.learn.flow import Encoder, Flow, FlowSettings, TrainedFlow

    settings = FlowSettings(**result["settings"])
    encoder, flow = Encoder(settings.samples, settings.features), Flow(settings.features)
    set_weights(encoder, unpack(result["encoder"]))
    set_weights(flow, unpack(result["flow"]))
    return TrainedFlow(encoder.eval(), flow.eval(), settings, result["loss"])


def _jobs(plan: StudyPlan) -> dict[tuple[str, float], Job]:
    settings: dict[str, Any] = {"seed": plan.seed}
    if plan.epochs is not None:
        settings |= {"steps": min(1500, 30 * plan.epochs), "flow_steps": min(6000, 120 * plan.epochs)}
    name = "full" if plan.epochs is None else str(plan.epochs)
    training = Job(f"flow/training-{name}-{plan.seed}", train_flow_unit, {"settings": settings})
    jobs = {}
    for kind, bias, runs in CASES:
        arguments = {"kind": kind, "bias_deg_h": bias, "runs": runs, "seed": SEED + plan.seed}
        jobs[kind, bias] = Job(f"flow/{kind}-{bias:g}-{name}-{plan.seed}", judge_flow_unit, arguments, (training,))
    return jobs


def _report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    rows, rng = [], np.random.default_rng(plan.seed)
    for (kind, bias), job in _jobs(plan).items():
        found = results[job.name]
        errors = {name: as_rad(found["error_deg"][name]) for name in ROWS}
        known = kind in TRAINED_ON and bias == CASES[0][1]
        where = f"{kind}, residual bias {bias:g} deg/h{'' if known else ', not trained on'}"
        for name, error in errors.items():
            count = np.arange(len(error))
            crmse = degrees(bootstrap_crmse(error, count, rng=rng))
            to_mean, to_learned = (bootstrap_ratio(error, errors[one], count, rng=rng) for one in ("mean", "learned"))
            inside = found["inside"][name]
            held = wilson(float(np.mean(inside)), len(inside))
            rows.append((where, name, len(error), crmse, to_mean, to_learned, held))
    columns = (
        "recordings",
        "method",
        "number",
        "CRMSE, deg",
        "ratio to the mean",
        "ratio to learned",
        "inside the 95 % interval",
    )
    note = "100 s at 3 Hz and 32.11 N, angle random walk 0.02 deg/sqrt(h), level, gyro alone; seed of the test set."
    return StudyReport(TEXT, (Table("A flow over the bias beside `learned`", columns, tuple(rows), note),))


def _floor(_plan: StudyPlan, _table: Table) -> str:
    white, bias = 0.02 * DEG_PER_SQRT_HOUR, CASES[0][1]
    bound = floor_deg(TriadErrors(white=white, turn_on_bias=bias * DEG_PER_HOUR), 100.0)
    return f"Floor (Cramér-Rao, white noise and a residual bias of {bias:g} deg/h): {bound:.3f} deg at 100 s."


TEXT = (
    "Where a diffusion model could help: not on white noise, but on the error that a disturbance leaves in the mean. "
    "Two networks are trained on simulated recordings of the reference mix, one in six quiet. The first looks at a "
    "recording less its median and gives the error of that median a normal law; the second, a flow (the "
    "deterministic form of a diffusion model, trained by flow matching), bends this law into any other. The density "
    "of the heading follows, since the Earth's horizontal rate lies on a circle. The networks have seen 28 800 "
    "recordings, each in eight forms (signs, x and y swapped); the network of `learned` some 230 000, and the closed "
    "form of the physics weighs what it proposes. `learned` is told the sensor's noise and residual bias; the flow "
    "was trained with a noise of 0.02 deg/sqrt(h) and a residual bias of 0.1 deg/h and cannot be told of others."
)
FLOW = Study(
    "flow",
    "Diffusion where it could help",
    "paper",
    lambda plan: list(_jobs(plan).values()),
    _report,
    _floor,
    simulates=True,
)
