"""Data sets for training: the synthetic one of the paper, augmentation, splits by recording, a folder of recordings."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.alignment.networks.diffusion import white_noise
from gyronorth.attitude import level, mat_bn, mat_lb
from gyronorth.calibration import observe
from gyronorth.conditioning import decimated
from gyronorth.deviation import FEWEST
from gyronorth.earth import earth_rate_n
from gyronorth.errors import InputError
from gyronorth.learn.settings import Settings
from gyronorth.readers import ReadOptions
from gyronorth.recording import LATITUDE_CONFLICT, Recording
from gyronorth.sources.listing import recordings
from gyronorth.sources.reading import read_each

Array = NDArray[np.float64]

#: Recordings of one's own that are worth splitting into training, validation and test.
FEWEST_OWN = 10


@dataclass(frozen=True)
class HeadingSet:
    """Windows of levelled angular rate with their headings.

    Raises
    ------
    ValueError
        If the shapes do not agree.
    """

    gyro_l: Array  # (n, samples, 3) angular rate in the level frame, rad/s
    heading: Array  # (n,) rad
    recording: NDArray[np.int64]  # (n,) which recording a window comes from: the unit of every split

    def __post_init__(self) -> None:
        n = len(self.gyro_l)
        if (
            self.gyro_l.ndim != 3
            or self.gyro_l.shape[2] != 3
            or self.heading.shape != (n,)
            or self.recording.shape != (n,)
        ):
            shapes = (self.gyro_l.shape, self.heading.shape, self.recording.shape)
            raise ValueError(
                f"gyro_l, heading, recording have shapes {shapes}; (n, samples, 3), (n,), (n,) are expected."
            )

    def __len__(self) -> int:
        return len(self.gyro_l)

    def rows(self, index: ArrayLike) -> HeadingSet:
        """The windows at `index` (integers or a mask)."""
        index = np.asarray(index)
        return HeadingSet(self.gyro_l[index], self.heading[index], self.recording[index])

    def sha256(self) -> str:
        """Checksum of the arrays, hexadecimal."""
        digest = hashlib.sha256()
        for array in (self.gyro_l, self.heading, self.recording):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


@dataclass(frozen=True)
class Swing:
    """Whole recordings at known headings, one entry each, as a deviation is fitted to them (`fit_deviation`)."""

    heading: Array  # (n,) of the closed form, rad
    surplus: Array  # (n,) `rate_surplus` of the mean rate
    heading_true: Array  # (n,) rad
    duration: float  # median, s


@dataclass(frozen=True)
class TrainingData:
    """What trains and validates a heading network, and where it comes from."""

    train: HeadingSet
    validation: HeadingSet
    source: str = ""  # for the model card
    latitude: float | None = None  # rad
    sensor: str | None = None  # name of the profile
    unit: str | None = None  # serial number of the sensor, when all data are of one
    session: str | None = None  # power-up session(s)
    test: HeadingSet | None = None  # its error is recorded and decides nothing
    swing: Swing | None = None  # of the training and validation recordings, when one set's deviation can be learned
    no_swing: str = ""  # why it cannot, for the user and the model card


def synthetic_set(*, headings: int = 720, latitude: float = 0.0, samples: int = 300) -> HeadingSet:
    """Clean constant Earth rate (eq:8) at headings evenly over the circle: the x_0 of the denoiser.

    The paper takes latitude 0, at which w_z is zero; `latitude` is in rad.
    """
    heading = np.linspace(0, 2 * np.pi, headings, endpoint=False)
    gyro = mat_bn(0.0, 0.0, heading) @ earth_rate_n(latitude)
    return HeadingSet(np.repeat(gyro[:, None], samples, axis=1), heading, np.arange(headings))


def split_recordings(data: HeadingSet, shares: tuple[float, ...], *, rng: np.random.Generator) -> list[HeadingSet]:
    """Random parts in the ratio of `shares`, whole recordings each: 60/20/20 % or 24/4/6.

    Every part gets at least one recording.
    """
    ids = rng.permutation(np.unique(data.recording))
    if len(ids) < len(shares):
        raise InputError(
            f"The data hold {len(ids)} recordings; at least {len(shares)} are needed for {len(shares)} parts."
        )
    edges = np.round(np.cumsum(shares[:-1]) / sum(shares) * len(ids)).astype(int)
    for k in range(len(edges)):
        edges[k] = min(max(edges[k], (edges[k - 1] if k else 0) + 1), len(ids) - (len(edges) - k))
    return [data.rows(np.isin(data.recording, part)) for part in np.split(ids, edges)]


def turned(gyro_l: Array, angle: ArrayLike) -> Array:
    """Angular rate (..., samples, 3) of the same unit turned clockwise by `angle` (...), rad, about the vertical."""
    angle = np.asarray(angle, dtype=float)[..., None]
    x, y, z = np.moveaxis(gyro_l, -1, 0)
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * x + sin * y, cos * y - sin * x, z + 0 * angle], axis=-1)


def augment(
    data: HeadingSet,
    *,
    copies: int = 100,
    span: float = radians(20),
    noise: Literal["faithful", "redrawn"] = "faithful",
    rng: np.random.Generator,
) -> HeadingSet:
    """Each window turned to `copies` headings evenly from -span to +span, rad (IV-A).

    `faithful` turns the recorded samples, so that one noise realisation and the bias turn
    along: a network can learn the fingerprint of the few recordings. `redrawn` turns the mean
    and draws white noise of the window's own deviation for every copy, its mean taken out: what
    the mean knows of the heading stays as recorded.
    """
    angles = np.linspace(-span, span, copies) if copies > 1 else np.zeros(1)
    gyro = data.gyro_l
    if noise == "faithful":
        many = turned(gyro[:, None], angles[None, :])
    else:
        samples = gyro.shape[1]
        draw = rng.standard_normal((len(gyro), copies, samples, 3))
        draw -= draw.mean(axis=2, keepdims=True)
        std = np.sqrt(np.mean(np.diff(gyro, axis=1) ** 2, axis=1) / 2)
        many = turned(gyro.mean(axis=1, keepdims=True)[:, None], angles[None, :]) + draw * std[:, None, None]
    heading = (data.heading[:, None] + angles) % (2 * np.pi)
    return HeadingSet(many.reshape(-1, *gyro.shape[1:]), heading.ravel(), np.repeat(data.recording, copies))


def noise_deg_s(data: HeadingSet) -> float:
    """Median over the windows of the white noise of one sample, deg/s."""
    return float(np.degrees(np.median(white_noise(data.gyro_l))))


def own_data(folder: str | Path, *, settings: Settings, reading: ReadOptions | None = None) -> TrainingData:
    """A user's recordings, split 24/4/6 by recording, with what is known of where they come from.

    Where all are of one session (or none says one) and of one known latitude, and enough to learn a deviation
    from, `swing` holds what it is fitted to. `reading` declares how the files are read.

    Raises
    ------
    InputError
        If a file has no reference heading or is shorter than one window, or there are too few.
    """
    given = None if reading is None else reading.latitude
    parts, seen, latitudes, sessions = [], [], [], []
    for number, recording in enumerate(_known_recordings(folder, reading)):
        parts.append(_window(recording, number, rate_hz=settings.rate_hz, samples=settings.samples))
        sessions.append(recording.session)
        latitude = recording.latitude if given is None else given
        latitudes.append(latitude)
        seen.append((0.0, 0.0, 0.0, 0.0) if latitude is None else (*observe(recording, latitude), recording.duration))
    data = _joined(parts, folder)
    if len(parts) < FEWEST_OWN:
        raise InputError(
            f"{folder} holds {len(parts)} recordings; at least {FEWEST_OWN} at different headings are needed to train, "
            "validate and test a network."
        )
    rng = np.random.default_rng([settings.seed, len(data.heading)])
    train, validation, test = split_recordings(data, (24, 4, 6), rng=rng)
    latitude = _common(latitudes)
    swing, known = None, np.unique(np.concatenate([train.recording, validation.recording]))
    why = _no_swing(latitudes, latitude, sessions)
    if len(known) < FEWEST:
        why.append(f"{len(known)} recordings train and validate; at least {FEWEST} are needed")
    if not why:
        heading, surplus, truth, duration = np.array(seen)[known].T
        swing = Swing(heading, surplus, truth, float(np.median(duration)))
    return TrainingData(
        train,
        validation,
        test=test,
        source=f"own recordings: {Path(folder).name}",
        latitude=latitude,
        session=_session(sessions),
        swing=swing,
        no_swing="; ".join(why),
    )


def _no_swing(latitudes: list[float | None], common: float | None, sessions: list[str | None]) -> list[str]:
    """Why recordings are no one set, whose deviation could be learned."""
    why, known = [], [latitude for latitude in latitudes if latitude is not None]
    if common is None and len(known) < len(latitudes):
        why.append(f"{len(latitudes) - len(known)} of {len(latitudes)} recordings state no latitude")
    elif common is None:
        low, high = np.degrees([min(known), max(known)])
        why.append(f"the recordings are of latitudes from {low:.2f} to {high:.2f} deg")
    if len(set(sessions)) > 1:
        why.append(f"the recordings are of {len(set(sessions))} sessions")
    return why


def _session(sessions: list[str | None]) -> str | None:
    """The one that all share, else their names, or their number where they are many."""
    names = sorted({"not stated" if session is None else session for session in sessions})
    if len(names) == 1:
        return sessions[0]
    return ", ".join(names) if len(names) <= 3 else f"{len(names)} sessions"


def _known_recordings(folder: str | Path, reading: ReadOptions | None) -> Iterator[Recording]:
    items = recordings([folder])
    for item, recording in zip(items, read_each(items, reading), strict=True):
        if recording.heading_true is None:
            raise InputError(
                f"{item.address} has no reference heading, which training needs. "
                "Give it as `# heading_true_deg: ...` or in the name of a file of the published layout."
            )
        yield recording


def _window(recording: Recording, number: int, *, rate_hz: float, samples: int) -> HeadingSet:
    """The first window of one recording, levelled and decimated; without accelerometer it is taken as level."""
    assert recording.heading_true is not None
    if recording.accel_b is not None:
        recording = recording.rotated(mat_lb(*level(recording.accel_b.mean(axis=0))))
    slow = decimated(recording, rate_hz).gyro_b
    if len(slow) < samples:
        raise InputError(
            f"{recording.source} lasts {recording.duration:g} s; a window of {samples / rate_hz:g} s is expected."
        )
    return HeadingSet(slow[None, :samples], np.array([recording.heading_true]), np.array([number]))


def _joined(parts: list[HeadingSet], folder: str | Path) -> HeadingSet:
    if not parts:
        raise InputError(f"{folder} holds no recordings to train on.")
    columns = [[getattr(part, name) for part in parts] for name in ("gyro_l", "heading", "recording")]
    return HeadingSet(*(np.concatenate(column) for column in columns))


def _common(latitudes: list[float | None]) -> float | None:
    """The latitude, rad, where all recordings agree on one."""
    known = [latitude for latitude in latitudes if latitude is not None]
    if not known or len(known) < len(latitudes) or np.ptp(known) > LATITUDE_CONFLICT:
        return None
    return float(np.median(known))
