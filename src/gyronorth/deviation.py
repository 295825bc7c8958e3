"""The deviation of a unit: what known headings teach about the error of the closed form.

The correction is physics first. A recording gives two things that can be seen without the
truth: the heading psi of its mean rate (the closed form, in error by e) and the surplus
c = horizontal mean rate / (Earth rate cos lat) - 1, which is the north bias. The model is

    e = f(psi) + rho c + noise,

f a Gaussian process on the circle with a Matern 3/2 kernel of the chord 2 |sin(d/2)|, rho the
coupling of the east to the north bias. Kernel, coupling and noise are not tuned: an ensemble
of settings drawn from a broad prior is weighted by marginal likelihood, and a part of the
prior says that there is no curve, no coupling, or neither. So data without structure, or few,
give a correction near zero. Gross outliers are carried by Student-t noise; sigma is
calibrated on the recordings fitted to, each left out in turn. The model belongs to one unit
and one set of recordings: elsewhere it corrects nothing.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.angles import angle_error, wrap_heading
from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.files import read_bounded, write_text
from gyronorth.given import checked_latitude, checked_path, finite, numbers, of_kind

#: Session of a model that its user applies to any recording of the unit.
ANY_SESSION = "*"
#: Fewest recordings a curve is fitted to: five unknowns of the classical curve and one to judge by.
FEWEST = 6
#: Members of the ensemble below this weight are left out of predictions.
SMALLEST_WEIGHT = 1e-5
GAUSSIAN = 1e3  # degrees of freedom at which Student-t noise is Gaussian for every practical end
#: Rounds of the variational fixed point: first for all settings, then for those that may matter.
ROUNDS = (4, 26)
#: What may matter after the first rounds: log weight at most this below the largest.
SCREEN = 15.0


@dataclass(frozen=True)
class DeviationPrior:
    """Prior of the settings: medians, and log standard deviations.

    `noise` and `curve` are relative to the root mean square error of the recordings fitted to.
    """

    noise: tuple[float, float] = (0.5, 0.5)  # scatter about the curve, relative
    curve: tuple[float, float] = (0.8, 0.5)  # amplitude of the curve, relative
    length: tuple[float, float] = (0.35, 0.6)  # correlation length, chord on the unit circle: 20 deg
    coupling: tuple[float, float] = (0.25, 0.5)  # rho, east per north bias; 0 to infinity, mostly below 1
    absent: float = 0.25  # probability that there is no curve, and likewise no coupling
    dof: float = 4.0  # degrees of freedom of the Student-t noise: gross outliers happen
    log2_draws: int = 6  # 64 settings for each of the four structures: more change nothing (studies)


#: Ablations, by name: what each ingredient brings is a row of the studies.
PRIORS = {
    "learned": DeviationPrior(),
    "gaussian noise": DeviationPrior(dof=GAUSSIAN),
    "no coupling": DeviationPrior(coupling=(0.0, 0.5)),
    "always a curve": DeviationPrior(absent=0.0),
    "gp on heading": DeviationPrior(coupling=(0.0, 0.5), absent=0.0, dof=GAUSSIAN),
}


@dataclass(frozen=True)
class DeviationModel:
    """A fitted deviation: the recordings it was fitted to and a weighted ensemble of settings."""

    heading: NDArray[np.float64]  # (n,) heading of the mean rate, rad
    surplus: NDArray[np.float64]  # (n,) horizontal rate over the expected one, minus one
    error: NDArray[np.float64]  # (n,) error of the closed form, rad
    weight: NDArray[np.float64]  # (k,) weights of the ensemble, sum 1
    settings: NDArray[np.float64]  # (k, 4) noise rad, curve rad, length (chord), coupling
    noise_variance: NDArray[np.float64]  # (k, n) of each recording after the outliers were weighed, rad^2
    noise_future: NDArray[np.float64]  # (k,) of a new recording, rad^2
    sigma_elsewhere: float  # heading error of a bias like the set's in a direction unknown, rad
    unit: str | None = None  # the unit the recordings come from
    session: str | None = None  # the set or power-up session they come from
    duration: float | None = None  # of the recordings, s
    latitude: float | None = None  # at which they were made, rad
    boresight: tuple[float, float, float] | None = None  # declared for them: roll, pitch, yaw, rad; None: not known

    def predict(
        self, heading: ArrayLike, surplus: ArrayLike, *, in_set: ArrayLike = True
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Expected error of the closed form and its standard deviation, rad, each shape (m,).

        Parameters
        ----------
        heading, surplus : array_like, shape (m,)
            Of the recordings to correct; see `rate_surplus`. A surplus beyond the range
            fitted to is taken at the end of that range: there is no support further out.
        in_set : array_like of bool, shape (m,) or scalar
            Whether a recording belongs to the unit and set fitted to. Where not, the
            correction is zero, and sigma the heading error of a bias as large as the set's,
            which may point north or east: of it, the error in the set is only one part.

        Returns
        -------
        error, sigma : ndarray, shape (m,)
            The corrected heading is `heading` - `error`.
        """
        heading, surplus = np.atleast_1d(np.asarray(heading, float)), np.atleast_1d(np.asarray(surplus, float))
        surplus = np.clip(surplus, self.surplus.min(), self.surplus.max())
        _, curve, length, coupling = self.settings.T
        inverse = np.linalg.inv(error_covariance(self.heading, self.surplus, self.settings, self.noise_variance))
        cross = _kernel(heading, self.heading, curve, length)
        cross += coupling[:, None, None] ** 2 * np.outer(surplus, self.surplus)
        gain = cross @ inverse
        mean = gain @ self.error
        variance = curve[:, None] ** 2 + (coupling[:, None] * surplus) ** 2 - (gain * cross).sum(-1)
        variance += self.noise_future[:, None]
        error = self.weight @ mean
        sigma = np.sqrt(self.weight @ (variance + (mean - error) ** 2))
        outside = ~np.broadcast_to(np.asarray(in_set, bool), error.shape)
        return np.where(outside, 0.0, error), np.where(outside, self.sigma_elsewhere, sigma)

    def covers(self, session: str | None) -> bool:
        """Whether a recording of `session` belongs to the set fitted to; an unnamed one never does."""
        return self.session == ANY_SESSION or (session is not None and session == self.session)

    def correct(
        self, heading: ArrayLike, surplus: ArrayLike, *, in_set: ArrayLike = True
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Corrected heading in [0, 2 pi) and its standard deviation, rad, each shape (m,)."""
        error, sigma = self.predict(heading, surplus, in_set=in_set)
        return wrap_heading(np.atleast_1d(np.asarray(heading, float)) - error), sigma

    def structure(self) -> dict[str, float]:
        """Posterior probability of a curve and of a coupling."""
        return {
            "curve": float(self.weight[self.settings[:, 1] > 0].sum()),
            "coupling": float(self.weight[self.settings[:, 3] > 0].sum()),
        }

    def write(self, path: str | Path) -> None:
        """Write as JSON (schema gyronorth.deviation/1, radians), whole or not at all."""
        from gyronorth.deviation_document import SCHEMA

        fields = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in vars(self).items()}
        write_text(path, json.dumps({"schema": SCHEMA, **fields}) + "\n")


def read_deviation(path: str | Path) -> DeviationModel:
    """Read a deviation written by `DeviationModel.write`.

    Raises
    ------
    InputError
        If the file is not such a deviation.
    """
    from gyronorth.deviation_document import LARGEST  # as below

    path = checked_path("path", path)
    return deviation_of(read_bounded(path, LARGEST), where=str(path))


def deviation_of(content: bytes, *, where: str) -> DeviationModel:
    """A deviation from the bytes of its file, named `where` in messages.

    Raises
    ------
    InputError
        If they are not such a deviation, or it gives no finite correction at its own recordings.
    """
    from gyronorth.deviation_document import parse_deviation  # its models cost a tenth of all that a heading imports

    model = DeviationModel(**parse_deviation(content, where=where))
    try:
        with np.errstate(all="ignore"):
            tried = np.concatenate(model.predict(model.heading, model.surplus))
    except np.linalg.LinAlgError:
        tried = np.full(1, np.nan)
    if not (np.isfinite(tried).all() and (tried[len(model.heading) :] > 0).all()):
        raise InputError(
            f"{where} is not a deviation profile that can be used: it gives no finite correction at its own recordings."
            " Write one with `gyronorth calibrate FOLDER -o PROFILE`."
        )
    return model


def rate_surplus(rate_l: ArrayLike, latitude: float) -> NDArray[np.float64]:
    """Horizontal mean rate over the expected one, minus one, (...), of levelled rates (..., 3) or (..., 2), rad/s."""
    rate_l = numbers("rate_l", rate_l, "(..., 3)")
    latitude = checked_latitude(latitude)
    if rate_l.shape[-1:] not in ((2,), (3,)):
        raise InputError(f"rate_l has shape {rate_l.shape}; (..., 3), or (..., 2) of the horizontal axes, is expected.")
    return np.hypot(rate_l[..., 0], rate_l[..., 1]) / (EARTH_RATE * np.cos(latitude)) - 1


def fit_deviation(
    heading: ArrayLike,
    surplus: ArrayLike,
    heading_true: ArrayLike,
    *,
    prior: DeviationPrior = PRIORS["learned"],
    unit: str | None = None,
    session: str | None = None,
    duration: float | None = None,
    latitude: float | None = None,
) -> DeviationModel:
    """Fit the deviation to recordings of known heading, one entry a recording.

    Parameters
    ----------
    heading, surplus, heading_true : array_like, shape (n,)
        Heading of the mean rate, surplus (`rate_surplus`), true heading; rad.
    prior : DeviationPrior
        What is believed beforehand.
    unit, session, duration, latitude
        Of the recordings, as the model states them; s and rad.

    Raises
    ------
    InputError
        With fewer than `FEWEST` recordings.

    Notes
    -----
    Each setting has the evidence lower bound of a Gaussian process with Student-t noise, a
    Gamma scale mixture in the factorised approximation (Tipping and Lawrence, "Variational
    inference for Student-t models", Neurocomputing 69, 2005, eq. 9-14); for many degrees of
    freedom it is the log marginal likelihood (Rasmussen and Williams, "Gaussian Processes for
    Machine Learning", 2006, eq. 2.30). The weight is its exponential times the prior.
    """
    of_kind("prior", prior, DeviationPrior, "a DeviationPrior")
    duration = None if duration is None else finite("duration", duration, "s", positive=True)
    latitude = None if latitude is None else checked_latitude(latitude)
    given = {"heading": heading, "surplus": surplus, "heading_true": heading_true}
    heading, surplus, truth = (np.atleast_1d(numbers(name, each, "(n,)")) for name, each in given.items())
    for name, each in zip(given, (heading, surplus, truth), strict=True):
        if each.shape != (len(heading),) or not np.isfinite(each).all():
            raise InputError(f"{name} has shape {each.shape}; one finite number for each recording is expected.")
    if len(heading) < FEWEST:
        raise InputError(
            f"{len(heading)} recordings of known heading came in; a deviation needs at least {FEWEST}. Record more."
        )
    error = angle_error(heading, truth)
    scale = np.sqrt(np.mean(error**2)) + 1e-12  # the addend keeps a perfect set of recordings from dividing by 0
    settings, log_prior = _ensemble(prior, scale)
    if not error.any():
        raise InputError("heading and heading_true agree to the last digit: there is no deviation to be fitted.")
    precision, evidence = evidence_bound(
        heading, surplus, error, settings, np.ones((1, len(error))), prior.dof, ROUNDS[0]
    )
    kept = log_prior + evidence > np.max(log_prior + evidence) - SCREEN
    settings, log_prior, precision = settings[kept], log_prior[kept], precision[kept]
    precision, evidence = evidence_bound(heading, surplus, error, settings, precision, prior.dof, ROUNDS[1])
    log_weight = log_prior + evidence
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    keep = weight > SMALLEST_WEIGHT
    settings, noise_variance = settings[keep], (settings[:, :1] ** 2 / precision)[keep]
    return DeviationModel(
        heading=heading,
        surplus=surplus,
        error=error,
        weight=weight[keep] / weight[keep].sum(),
        settings=settings,
        noise_variance=noise_variance,
        noise_future=scatter_left_out(heading, surplus, error, settings, noise_variance),
        sigma_elsewhere=_bias_scatter(heading, surplus, truth),
        unit=unit,
        session=session,
        duration=duration,
        latitude=latitude,
    )


def fit_classical(heading: ArrayLike, heading_true: ArrayLike, *, at: ArrayLike) -> tuple[NDArray, NDArray]:
    """The mariner's deviation curve A + B sin + C cos + D sin 2 + E cos 2 by least squares.

    Returns the expected error of the closed form and its standard deviation, rad, at the
    headings `at`, shape (m,), fitted to recordings of known heading, shape (n,)
    ("Handbook of Magnetic Compass Adjustment", NGA, 2004, ch. 4).
    """
    heading = np.atleast_1d(np.asarray(heading, float))
    error = angle_error(heading, heading_true)
    if len(heading) < FEWEST:
        raise InputError(f"{len(heading)} recordings came in; the classical curve needs at least {FEWEST}.")
    design, wanted = _harmonics(heading), _harmonics(np.atleast_1d(np.asarray(at, float)))
    inverse = np.linalg.pinv(design.T @ design)
    coefficients = inverse @ design.T @ error
    variance = np.sum((error - design @ coefficients) ** 2) / (len(error) - design.shape[1])
    leverage = np.einsum("ij,jk,ik->i", wanted, inverse, wanted)
    return wanted @ coefficients, np.sqrt(variance * (1 + leverage))


def _harmonics(angle: NDArray) -> NDArray:
    return np.stack([np.ones_like(angle), np.sin(angle), np.cos(angle), np.sin(2 * angle), np.cos(2 * angle)], axis=-1)


def _bias_scatter(heading: NDArray, surplus: NDArray, truth: NDArray) -> float:
    """Standard deviation per axis of the horizontal bias in the body frame, relative to Earth rate cos lat: rad."""
    measured = (1 + surplus) * np.array([np.cos(heading), -np.sin(heading)])
    bias = measured - np.array([np.cos(truth), -np.sin(truth)])
    return float(np.sqrt(np.mean(bias.var(axis=1, ddof=1))))


def _ensemble(prior: DeviationPrior, scale: float) -> tuple[NDArray, NDArray]:
    """Settings (k, 4) and log prior (k,): a low-discrepancy draw, the same each time."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    draws = qmc.Sobol(4, rng=0).random_base2(prior.log2_draws)
    median = np.array([prior.noise[0] * scale, prior.curve[0] * scale, prior.length[0], prior.coupling[0]])
    log_sd = np.array([prior.noise[1], prior.curve[1], prior.length[1], prior.coupling[1]])
    drawn = median * np.exp(ndtri(np.clip(draws, 1e-9, 1 - 1e-9)) * log_sd)
    settings, log_prior = [], []
    for curve in (False, True):
        for coupling in (False, True):
            probability = np.prod([1 - prior.absent if present else prior.absent for present in (curve, coupling)])
            if probability > 0:
                settings.append(drawn * np.array([1, curve, 1, coupling]))
                log_prior.append(np.full(len(drawn), np.log(probability / len(drawn))))
    return np.concatenate(settings), np.concatenate(log_prior)


def _kernel(a: NDArray, b: NDArray, curve: NDArray, length: NDArray) -> NDArray:
    """Matern 3/2 of the chord, (k, len(a), len(b)): positive definite on the circle as it is in the plane."""
    ratio = np.sqrt(3) * 2 * np.abs(np.sin((a[:, None] - b) / 2)) / length[:, None, None]
    return curve[:, None, None] ** 2 * (1 + ratio) * np.exp(-ratio)


def error_covariance(heading: NDArray, surplus: NDArray, settings: NDArray, noise_variance: NDArray) -> NDArray:
    """Covariance (k, n, n) of the errors of n recordings under each of k settings (noise, curve, length, coupling)."""
    _, curve, length, coupling = settings.T
    covariance = _kernel(heading, heading, curve, length)
    covariance += coupling[:, None, None] ** 2 * np.outer(surplus, surplus)
    index = np.arange(len(heading))
    covariance[:, index, index] += noise_variance
    return covariance


def scatter_left_out(
    heading: NDArray, surplus: NDArray, error: NDArray, settings: NDArray, noise_variance: NDArray
) -> NDArray:
    """Variance (k,) of a new recording about the curve, so that the recordings, each left out, agree with sigma.

    The left-out residual of recording i is (C^-1 y)_i / (C^-1)_ii and its variance 1 / (C^-1)_ii
    (Rasmussen and Williams, eq. 5.12), of which its own noise is a part.
    """
    inverse = np.linalg.inv(error_covariance(heading, surplus, settings, noise_variance))
    diagonal = np.diagonal(inverse, axis1=1, axis2=2)
    residual = (inverse @ error) / diagonal
    latent = 1 / diagonal - noise_variance
    scatter = np.maximum(np.mean(residual**2 - latent, axis=1), (0.1 * settings[:, 0]) ** 2)
    return scatter * len(error) / (len(error) - 3)  # noise, curve and coupling were fitted to the same recordings


def evidence_bound(
    heading: NDArray,
    surplus: NDArray,
    error: NDArray,
    settings: NDArray,
    precision: NDArray,
    dof: float,
    rounds: int,
) -> tuple[NDArray, NDArray]:
    """Mean precision factor of each recording (k, n), from `precision` on, and evidence lower bound (k,)."""
    from scipy.special import digamma, gammaln

    variance, index = settings[:, :1] ** 2, np.arange(len(error))
    shape, shape_0 = (dof + 1) / 2, dof / 2
    signal = error_covariance(heading, surplus, settings, np.zeros((len(settings), len(error))))

    def posterior(precision: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        noise = variance / precision
        covariance = signal.copy()
        covariance[:, index, index] += noise
        inverse = np.linalg.inv(covariance)
        weighted = inverse @ error
        # posterior mean square of error - f: squared residual plus posterior variance
        square = (noise * weighted) ** 2 + noise - noise**2 * inverse[:, index, index]
        return inverse, weighted, shape_0 + square / variance / 2

    used = np.broadcast_to(precision, (len(settings), len(error)))
    inverse, weighted, rate = posterior(used)
    for _ in range(rounds - 1):
        if np.abs(shape / rate / used - 1).max() < 1e-3:
            break
        used = shape / rate
        inverse, weighted, rate = posterior(used)
    divergence = (
        (shape - shape_0) * digamma(shape)
        - gammaln(shape)
        + gammaln(shape_0)
        + shape_0 * np.log(rate / shape_0)
        + shape * (shape_0 / rate - 1)
    )
    gaussian = -0.5 * (weighted @ error) + 0.5 * np.linalg.slogdet(inverse)[1]
    slack = 0.5 * (digamma(shape) - np.log(rate) - np.log(used)) - divergence
    return used, gaussian + slack.sum(axis=1) - 0.5 * len(error) * np.log(2 * np.pi)
