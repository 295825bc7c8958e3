"""A compass swing: recordings at known headings to a cross-validated deviation curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gyronorth.alignment.closed_form import align_mean
from gyronorth.angles import angle_error, cyclic_rmse
from gyronorth.arrays import Array
from gyronorth.deviation import FEWEST, DeviationModel, fit_deviation, rate_surplus
from gyronorth.errors import InputError
from gyronorth.given import of_kind
from gyronorth.recording import LATITUDE_CONFLICT, Recording


@dataclass(frozen=True)
class Calibration:
    """A deviation curve and how well it does on recordings it has not seen."""

    model: DeviationModel
    heading_true: Array  # (n,) rad
    error: Array  # (n,) of the closed form, rad
    left_out: Array  # (n,) of the corrected heading, each recording left out in turn, rad
    sigma: Array  # (n,) claimed for it, rad

    @property
    def ratio(self) -> float:
        """Corrected over uncorrected cyclic root mean square error, leave-one-out."""
        return float(cyclic_rmse(self.left_out) / cyclic_rmse(self.error))

    def to_json(self) -> dict[str, Any]:
        """Schema gyronorth.calibration/1, degrees."""
        return {
            "schema": "gyronorth.calibration/1",
            "recordings": len(self.error),
            "session": self.model.session,
            "crmse_deg": float(np.degrees(cyclic_rmse(self.error))),
            "left_out_crmse_deg": float(np.degrees(cyclic_rmse(self.left_out))),
            "ratio": self.ratio,
            "curve_probability": self.model.structure()["curve"],
            "rows": [
                {
                    "heading_true_deg": float(np.degrees(truth)),
                    "error_deg": float(np.degrees(error)),
                    "left_out_error_deg": float(np.degrees(left)),
                    "left_out_sigma_deg": float(np.degrees(sigma)),
                }
                for truth, error, left, sigma in zip(
                    self.heading_true, self.error, self.left_out, self.sigma, strict=True
                )
            ],
        }


def calibrate(recordings: Sequence[Recording], *, latitude: float | None = None) -> Calibration:
    """Fit and cross-validate the deviation of one unit in one session.

    Parameters
    ----------
    recordings : sequence of Recording
        Each at a known heading (`heading_true`), all of one session.
    latitude : float, optional
        rad; else each recording's own.

    Raises
    ------
    InputError
        If a recording has no true heading or latitude, sessions differ, or there are too few.
    """
    of_kind("recordings", recordings, Sequence, "a list of recordings")
    for recording in recordings:
        of_kind("One of recordings", recording, Recording, "a Recording")
    if len(recordings) < FEWEST + 1:
        raise InputError(
            f"A deviation curve that can be cross-validated needs at least {FEWEST + 1} recordings at known headings; "
            f"got {len(recordings)}. Record more headings."
        )
    sessions = {recording.session for recording in recordings}
    if len(sessions) > 1:
        raise InputError(
            f"The recordings are of {len(sessions)} sessions ({', '.join(sorted(map(str, sessions)))}); a deviation "
            "curve holds within one power-up session. Calibrate each on its own."
        )
    observed = [observe(recording, latitude) for recording in recordings]
    places = np.array([recording.latitude_given(latitude) for recording in recordings])
    if np.ptp(places) > LATITUDE_CONFLICT:
        raise InputError(
            f"The recordings are of latitudes {np.degrees(places.min()):.2f} to {np.degrees(places.max()):.2f} deg; "
            "a deviation curve holds at one place. Leave out those of another."
        )
    heading, surplus, truth = (np.array(column) for column in zip(*observed, strict=True))
    _check_different(recordings, np.stack([heading, surplus, truth], axis=-1))
    session = sessions.pop()
    duration = float(np.median([recording.duration for recording in recordings]))
    left_out, sigma = np.zeros(len(heading)), np.zeros(len(heading))
    for index in range(len(heading)):
        others = np.arange(len(heading)) != index
        model = fit_deviation(heading[others], surplus[others], truth[others])
        corrected, spread = model.correct(heading[index], surplus[index])
        left_out[index], sigma[index] = angle_error(corrected[0], truth[index]), spread[0]
    model = fit_deviation(
        heading, surplus, truth, session=session, duration=duration, latitude=float(np.median(places))
    )
    return Calibration(model, truth, angle_error(heading, truth), left_out, sigma)


def _check_different(recordings: Sequence[Recording], observed: Array) -> None:
    """No recording twice: its copy would be foretold without error, and the curve be believed too much."""
    _, first, counts = np.unique(observed, axis=0, return_index=True, return_counts=True)
    if (counts > 1).any():
        repeated = observed[int(first[np.argmax(counts)])]
        twice = np.flatnonzero((observed == repeated).all(axis=1)).tolist()
        names = " and ".join(recordings[i].source or f"number {i + 1}" for i in twice)
        raise InputError(f"{names} are one and the same recording. Leave its copies out of the swing.")


def observe(recording: Recording, latitude: float | None) -> tuple[float, float, float]:
    """Heading of the closed form, rad, surplus of its rate (`deviation.rate_surplus`), true heading, rad.

    Raises
    ------
    InputError
        If the recording has no true heading or no latitude.
    """
    if recording.heading_true is None:
        raise InputError(
            f"{recording.source or 'A recording'} has no true heading, which calibration needs. "
            "Give it as `# heading_true_deg: ...` or in the name of a file of the published layout."
        )
    known = recording.latitude_given(latitude)
    found = align_mean(recording.gyro_b, recording.accel_b)
    return float(found.heading), float(rate_surplus(found.rate_l, known)), recording.heading_true
