"""Which method, and what it finds in one recording: the choice of auto, trained bundles, deviation curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gyronorth.alignment.closed_form import Levelled
from gyronorth.alignment.turned_segments import Segments
from gyronorth.angles import angle_error
from gyronorth.conclusion import Found
from gyronorth.deviation import DeviationModel
from gyronorth.errors import InputError
from gyronorth.estimate import Unrest
from gyronorth.findings import Finding
from gyronorth.solution import (
    Data,
    Disturbance,
    Solution,
    changes_slowly,
    disturbance,
    mean_alignment,
    prefers_inertial,
    solve_inertial,
    solve_mean,
)
from gyronorth.specialists import (
    BAYES_LONGEST,
    bayes_fits,
    mismatched,
    part_of,
    segments_of,
    solve_bayes,
    solve_learned,
    solve_network,
    solve_turned,
    with_deviation,
)

if TYPE_CHECKING:
    from gyronorth.alignment.learned import LoadedBundle

#: Methods that run a trained bundle.
TRAINED = ("learned", "paper", "baseline")
#: Said where `learned` is asked for and cannot explain the recording.
UNLEARNED = "The disturbance is of no kind that was learned; sigma is widened by what stays unexplained."
#: Probability that the bias settles or walks from which auto takes no method that holds it constant.
UNSTEADY = 0.5
#: A deviation curve applies within this of the latitude it was measured at, rad.
DEVIATION_LATITUDE = np.radians(2.0)
#: And of one of its headings, rad: in the middle between the six that it takes at least one is 30 deg off.
DEVIATION_SUPPORT = np.radians(45.0)


def find(
    method: str,
    data: Data,
    model: str | Path | None,
    turn_angles: Sequence[float] | None,
    *,
    session: str | None = None,
) -> Found:
    """What the asked method, or the one that auto chooses, finds in one recording."""
    if method in ("auto", "turned") and data.attitude is None:
        segments = segments_of(data)
        if method == "turned" or segments.poses > 1:
            angles = None if turn_angles is None else np.asarray(turn_angles, dtype=float)
            turned = solve_turned(data, segments, angles)
            why = "asked for" if method == "turned" else _counted(segments)
            return Found(
                "turned",
                turned.solution,
                why,
                None,
                turned.poses,
                turned.turns,
                turned.fit.gyro_bias,
                None,
                turned.warnings,
            )
    if turn_angles is not None:
        raise InputError("Turn angles were given, but the recording holds one pose only. Leave them out.")
    closed = mean_alignment(data)
    moved = disturbance(data, closed)
    if method in TRAINED:
        bundle = bundle_of(method, model)
        if method == "learned" and bundle.deviation is not None:
            return _corrected(data, closed, moved, bundle, session=session)
        if method == "learned":
            solution, unrest = solve_learned(data, closed, moved, bundle)
            return replace(_learned(solution, unrest, moved, bundle), why="asked for")
        if bundle.info.method in set(TRAINED) - {method}:
            raise InputError(
                f"The bundle {bundle.name} is one of method {bundle.info.method}, but method {method} was asked for. "
                f"Use --method {bundle.info.method} with it."
            )
        solution = solve_network(data, closed, moved, bundle)
        return Found(method, solution, "asked for", moved, bundle=bundle.name, warnings=_carried(bundle))
    mean = solve_mean(data, closed, moved)
    if method == "mean":
        return Found("mean", mean, "asked for", moved)
    if method == "inertial":
        return Found("inertial", solve_inertial(data, moved), "asked for", moved)
    if method == "bayes":
        solution, unrest = solve_bayes(data, closed, moved)
        return Found("bayes", solution, "asked for", moved, unrest=unrest)
    return _of_one_pose(data, closed, moved, mean)


def _carried(bundle: LoadedBundle) -> tuple[Finding, ...]:
    """That a network has learned one unit's own error with everything else."""
    domain = bundle.info.domain
    if domain.unit is None and domain.session is None:
        return ()
    unit, session = domain.unit or "not stated", domain.session or "not stated"
    message = (
        f"The bundle {bundle.name} was trained on unit {unit}, session {session}: part of what it learned is that "
        "unit's own error and holds for no other."
    )
    return (Finding("deviation_applied", message),)


def _counted(segments: Segments) -> str:
    """Poses and steady rotations in words."""
    spins = sum(turn.spin for turn in segments.turns)
    counts = ((segments.poses - spins, "pose"), (spins, "steady rotation"))
    return " and ".join(f"{count} {name}{'s' * (count > 1)}" for count, name in counts if count)


def _of_one_pose(data: Data, closed: Levelled, moved: Disturbance, mean: Solution) -> Found:
    """The choice of auto where there is one pose: the mean, or what has the smallest sigma under disturbance."""
    can_trace = data.accel_b is not None and data.attitude is None
    traced = solve_inertial(data, moved) if can_trace and (moved.detected or data.sensor is None) else None
    disturbed = bool(moved.detected) or (traced is not None and bool(prefers_inertial(data, moved, mean, traced)))
    asked = moved.detected or (data.sensor is not None and changes_slowly(data))
    modelled = _modelled(data, closed, moved) if asked else None
    unrest = None if modelled is None else modelled.unrest
    if modelled is not None and unrest is not None and unrest.unsteady >= UNSTEADY:
        why = f"one pose: the bias settles or walks with probability {unrest.unsteady:.2f}"
        return replace(modelled, why=f"{why}, which mean and inertial would take for Earth rate")
    if not disturbed:
        return Found("mean", mean, "one pose, undisturbed", moved)
    candidates = {"mean": mean}
    if traced is not None:
        candidates["inertial"] = traced
    if modelled is not None:
        candidates[modelled.method] = modelled.solution
    best = min(candidates, key=lambda name: float(candidates[name].sigma))
    sigmas = ", ".join(f"{np.degrees(float(found.sigma)):.2f} deg by {name}" for name, found in candidates.items())
    why = f"one pose, disturbed: sigma {sigmas}"
    if modelled is not None and best == modelled.method:
        return replace(modelled, why=why)
    return Found(best, candidates[best], why, moved, unrest=unrest)


def _modelled(data: Data, closed: Levelled, moved: Disturbance) -> Found | None:
    """The method that models disturbance: learned, or bayes where it cannot run or explain the recording.

    None where neither takes the recording, or `learned` cannot explain one that is too long for `bayes`. Where
    `learned` is not installed, `bayes` sees the end of such a one, and the beginning, where a bias settles.
    """
    installed = find_spec("onnxruntime") is not None
    if installed:
        bundle = bundle_of("learned", None)
        solution, unrest = solve_learned(data, closed, moved, bundle)
        if unrest is not None and unrest.fits:
            return _learned(solution, unrest, moved, bundle)
    if bayes_fits(data):
        solution, unrest = solve_bayes(data, closed, moved)
        return Found("bayes", solution, "", moved, unrest=unrest)
    begin, end = (part_of(data, seconds) for seconds in (BAYES_LONGEST, -BAYES_LONGEST))
    if bayes_fits(end) and not installed:
        (_, first), (solution, last) = solve_bayes(begin, closed, moved), solve_bayes(end, closed, moved)
        return Found("bayes", solution, "", moved, unrest=max(first, last, key=lambda unrest: unrest.unsteady))
    return None


def _learned(solution: Solution, unrest: Unrest | None, moved: Disturbance, bundle: LoadedBundle) -> Found:
    warnings = () if unrest is None or unrest.fits else (Finding("swaying", UNLEARNED),)
    return Found("learned", solution, "", moved, bundle=bundle.name, warnings=warnings, unrest=unrest)


def bundle_of(method: str, model: str | Path | None) -> LoadedBundle:
    """The bundle of a method, loaded once for as long as its description does not change."""
    from gyronorth.alignment.bundle import shipped_bundle

    folder = Path(shipped_bundle(method) if model is None else model)
    described = folder / "bundle.json"
    return _loaded(folder, described.stat().st_mtime_ns if described.is_file() else 0)


@lru_cache(maxsize=4)
def _loaded(folder: Path, changed: int) -> LoadedBundle:
    from gyronorth.alignment.learned import load_bundle

    return load_bundle(folder)


def _corrected(data: Data, closed: Levelled, moved: Disturbance, bundle: LoadedBundle, *, session: str | None) -> Found:
    """The closed form with the correction that a bundle learned from its unit's own recordings."""
    from gyronorth.alignment.bundle import RecordingFacts, mismatch

    assert bundle.deviation is not None
    sensor = None if data.sensor is None else data.sensor.name
    misfits = mismatch(bundle.info, RecordingFacts(data.rate_hz, data.duration, data.latitude, sensor))
    if misfits:
        return Found("learned", mismatched(closed, bundle, misfits), "asked for", moved, bundle=bundle.name)
    found = Found("mean", solve_mean(data, closed, moved), "asked for", moved, bundle=bundle.name)
    return replace(deviated(found, data, bundle.deviation, session=session), method="learned")


def deviated(found: Found, data: Data, model: DeviationModel, *, session: str | None) -> Found:
    """`found` corrected by a deviation curve, with the warning that says whether it was."""
    if found.method != "mean":
        raise InputError(
            f"A deviation curve corrects the closed form, but the method is {found.method}. Use --method mean with it."
        )
    if model.latitude is not None and abs(model.latitude - data.latitude) > DEVIATION_LATITUDE:
        raise InputError(
            f"The deviation curve was measured at latitude {np.degrees(model.latitude):.2f} deg, this recording is of "
            f"{np.degrees(data.latitude):.2f} deg: the same bias costs another angle there. Measure a new curve."
        )
    in_set = model.covers(session)
    off = float(np.min(np.abs(angle_error(model.heading, found.solution.levelled.heading))))
    applied = in_set and off <= DEVIATION_SUPPORT
    if applied:
        warning = Finding(
            "deviation_applied",
            f"Corrected by a deviation curve of {len(model.heading)} recordings; it holds for that unit and session.",
        )
    elif in_set:
        warning = Finding(
            "deviation_unused",
            f"The nearest heading of the deviation curve is {np.degrees(off):.0f} deg away; within "
            f"{np.degrees(DEVIATION_SUPPORT):.0f} deg it is believed: not applied.",
        )
    else:
        warning = Finding(
            "deviation_unused",
            f"The deviation curve was measured in session {_named(model.session)}, this recording is of "
            f"{_named(session)}: not applied. Where both are of one power-up session, say so: --deviation FILE "
            "--any-session.",
        )
    solution = with_deviation(found.solution, model, latitude=data.latitude, duration=data.duration, in_set=applied)
    return replace(found, solution=solution, warnings=(*found.warnings, warning))


def _named(session: str | None) -> str:
    return "not stated" if session is None else repr(session)
