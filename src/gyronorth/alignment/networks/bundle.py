"""A trained bundle on disk: `bundle.json`, its schema, and whether a recording fits it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from gyronorth.alignment.networks.diffusion import Normalisation, Sampler, Schedule, check_steps
from gyronorth.errors import InputError
from gyronorth.findings import Finding

SCHEMA = "gyronorth.bundle/1"
#: A recording longer than the window by less than this part still fits (rounding of durations), s.
WINDOW_SLACK = 1e-6
#: Rates to which longer recordings are averaged down, within a factor of two.
RATE_STEPS = 4

#: Where the bundles of the package stand.
_SHIPPED = Path(__file__).parents[2] / "bundles"
#: Largest file of a bundle, and largest description, bytes.
LARGEST, LARGEST_DESCRIPTION = 1 << 28, 1 << 24
#: Most samples of a window.
MOST_SAMPLES = 10_000_000

#: No rate, noise or factor lies outside of these.
Positive = Annotated[float, Field(ge=1e-9, le=1e9)]
Latitude = Annotated[float, Field(ge=-90, le=90)]
Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class Strict(BaseModel):
    """Immutable, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Domain(Strict):
    """What the bundle was trained for; `None` means any."""

    rate_hz: Positive  # rate of the network's input, Hz; a faster recording is decimated to it
    samples: Annotated[
        int, Field(gt=0, le=MOST_SAMPLES)
    ]  # length of the window in samples; the shortest one if there are several
    #: The longest window, where any length between will do; what is longer is averaged down to no more samples.
    longest_samples: Annotated[int, Field(gt=0, le=MOST_SAMPLES)] | None = None
    latitude_deg: Latitude | None = None
    latitude_tolerance_deg: Annotated[float, Field(ge=1e-9, le=180)] = 2.0
    sensor: str | None = None  # sensor class: the name of a profile
    noise_deg_s: Positive | None = None  # white noise of one sample at rate_hz, median over the training recordings
    noise_factor: Annotated[float, Field(gt=1, le=1000)] = 3.0  # a recording may be this much noisier or quieter
    unit: str | None = None  # serial number, where the bundle carries that unit's deviation curve
    session: str | None = None  # power-up session(s) it was trained on

    @property
    def window(self) -> float:
        """Length of the window, s."""
        return self.samples / self.rate_hz

    def rate_at(self, duration: float) -> float:
        """Rate, Hz, to which a recording of `duration` s is averaged down: the bundle's, or less in steps of 2^(1/4).

        The steps keep the rate, and what is worked out for it once, while a recording grows.
        """
        if self.longest_samples is None:
            return self.rate_hz
        steps = np.ceil(RATE_STEPS * np.log2(duration * self.rate_hz / self.longest_samples) - 1e-6)
        return float(self.rate_hz * 2.0 ** (-max(steps, 0) / RATE_STEPS))


class DenoiserPart(Strict):
    """`denoiser.onnx`: inputs x (n, samples, 3) normalised and t (n,); output the noise."""

    file: str = "denoiser.onnx"
    sha256: Sha256
    schedule: Schedule = Schedule()
    sampler: Sampler = Sampler()
    normalisation: Normalisation = Normalisation()

    @model_validator(mode="after")
    def _steps_are_left(self) -> DenoiserPart:
        check_steps(self.sampler, self.schedule)
        return self


class HeadingPart(Strict):
    """`heading.onnx`: input angular rate (n, samples, 3) in units of Earth rate, float64; output by `output`."""

    file: str = "heading.onnx"
    sha256: Sha256
    output: Literal["degrees", "cos_sin"] = "degrees"


class ProposalPart(Strict):
    """`proposal.onnx`: bumps and frequencies of tones, which `gyronorth.alignment.tones.proposals` weighs."""

    file: str = "proposal.onnx"
    sha256: Sha256
    sigma_scale: Positive = 1.0  # sigma and interval are widened by this: calibrated on validation recordings


class DeviationPart(Strict):
    """`deviation.json`: what the unit's known headings taught of the closed form (`gyronorth.deviation`)."""

    file: str = "deviation.json"
    sha256: Sha256


class Bundle(Strict):
    """The contents of `bundle.json`."""

    schema_: Literal["gyronorth.bundle/1"] = Field(default=SCHEMA, alias="schema")
    method: Literal["paper", "baseline", "learned", "denoiser"]
    layout: Literal["temporal", "flattened"]  # an across_batch model is never exported
    domain: Domain
    denoiser: DenoiserPart | None = None
    heading: HeadingPart | None = None
    proposal: ProposalPart | None = None
    deviation: DeviationPart | None = None
    training: dict[str, Any] = {}  # the settings it was trained with
    data_sha256: dict[str, str] = {}  # of the training and validation arrays
    metrics: dict[str, float | None] = {}  # in degrees where the name says so
    provenance: dict[str, str] = {}  # code version, libraries, where the data come from

    model_config = ConfigDict(populate_by_name=True)

    @field_validator("training")
    @classmethod
    def _finite(cls, training: dict[str, Any]) -> dict[str, Any]:
        """Settings are free in their form, but not infinite or NaN at any depth."""
        json.dumps(training, allow_nan=False)
        return training

    def to_json(self) -> str:
        """The text of `bundle.json`."""
        return json.dumps(self.model_dump(mode="json", by_alias=True), indent=2, allow_nan=False) + "\n"


def read_bundle(folder: str | Path) -> Bundle:
    """Read `bundle.json` and check the files beside it against their checksums.

    Raises
    ------
    InputError
        If the folder is no bundle, is of another schema, or a file is missing or changed.
    """
    return bundle_contents(folder)[0]


def bundle_contents(folder: str | Path) -> tuple[Bundle, dict[str, bytes]]:
    """What `read_bundle` reads, and the files of its parts by name: the bytes whose checksums were compared.

    Raises
    ------
    InputError
        As `read_bundle`.
    """
    folder = Path(folder)
    path = folder / "bundle.json"
    if not path.is_file():
        raise InputError(
            f"{folder} is not a bundle: there is no bundle.json in it. "
            "Give --model the folder that `gyronorth train ... -o FOLDER` wrote."
        )
    try:
        # Strict: `true` and "3" are no numbers.
        bundle = Bundle.model_validate_json(_content(path, LARGEST_DESCRIPTION), strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        raise InputError(
            f"{path}: {where}: {first['msg']} (got {str(first['input'])[:60]!r}). "
            f"A bundle of schema {SCHEMA} is expected; train it again with this version of gyronorth."
        ) from None
    contents: dict[str, bytes] = {}
    for part in (bundle.denoiser, bundle.heading, bundle.proposal, bundle.deviation):
        if part is None:
            continue
        file = _inside(folder, part.file)
        contents[part.file] = _content(file) if file.is_file() else b""
        if hashlib.sha256(contents[part.file]).hexdigest() != part.sha256 or not contents[part.file]:
            raise InputError(
                f"{file} does not match its checksum in bundle.json: "
                "the bundle was changed or copied incompletely. Copy or train it again."
            )
    return bundle, contents


def is_shipped(folder: Path) -> bool:
    """Whether a bundle is one of those that ship with the package."""
    return folder.resolve().parent == _SHIPPED.resolve()


@lru_cache
def shipped_bundle(method: str) -> Path:
    """Folder of the bundle of a method: in this package, or in `gyronorth_bundles` if that is installed.

    Raises
    ------
    InputError
        If there is none.
    """
    places = [Path(__file__).parents[2] / "bundles"]
    extra = find_spec("gyronorth_bundles")
    if extra is not None and extra.origin is not None:
        places.append(Path(extra.origin).parent)
    for place in places:
        if (place / method / "bundle.json").is_file():
            return place / method
    raise InputError(
        f"There is no bundle for the method {method}: those of `paper` and `baseline` are a package of their own. "
        "Install it with: pip install 'gyronorth[bundles,learned]', or give --model FOLDER."
    )


def _content(path: Path, largest: int = LARGEST) -> bytes:
    if path.stat().st_size > largest:
        raise InputError(
            f"{path} has {path.stat().st_size >> 20} MiB; at most {largest >> 20} are read of such a file."
        )
    return path.read_bytes()


def checksum(path: Path) -> str:
    """SHA-256 of a file, hexadecimal; empty if there is no such file."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


def _inside(folder: Path, name: str) -> Path:
    if Path(name).name != name:
        raise InputError(f"bundle.json names the file {name!r}; a file name in the bundle's own folder is expected.")
    return folder / name


@dataclass(frozen=True)
class RecordingFacts:
    """What is known of a recording when a bundle is to be run on it; `None` is not checked."""

    rate_hz: float  # Hz
    duration: float  # s
    latitude: float | None = None  # rad
    sensor: str | None = None  # name of the profile
    noise: float | None = None  # white noise of one sample at the bundle's rate, rad/s


def mismatch(bundle: Bundle, facts: RecordingFacts) -> list[Finding]:
    """Every way in which the recording does not fit the bundle; empty if it fits."""
    domain = bundle.domain
    found: list[Finding] = []
    if bundle.heading is None and bundle.proposal is None and bundle.deviation is None:
        found.append(_off("the bundle holds a denoiser only and gives no heading"))
    needed = domain.rate_at(facts.duration)
    if facts.rate_hz < needed * (1 - 1e-9):
        text = f"the recording's rate of {facts.rate_hz:g} Hz is below the bundle's {needed:g} Hz"
        found.append(_off(text, facts.rate_hz, needed))
    if facts.duration < domain.window * (1 - WINDOW_SLACK):
        text = f"the recording's {facts.duration:g} s are shorter than the bundle's window of {domain.window:g} s"
        found.append(_off(text, facts.duration, domain.window))
    if facts.sensor and domain.sensor and facts.sensor.casefold() != domain.sensor.casefold():
        text = f"the recording's sensor is {facts.sensor}; the bundle was trained for {domain.sensor}"
        found.append(_off(text))
    if facts.latitude is not None and domain.latitude_deg is not None:
        latitude = float(np.degrees(facts.latitude))
        if abs(latitude - domain.latitude_deg) > domain.latitude_tolerance_deg:
            text = (
                f"the latitude of {latitude:.2f} deg is more than {domain.latitude_tolerance_deg:g} deg from the "
                f"{domain.latitude_deg:.2f} deg the bundle was trained at"
            )
            found.append(_off(text, latitude, domain.latitude_deg))
    if facts.noise is not None and domain.noise_deg_s is not None:
        noise = float(np.degrees(facts.noise))
        if not 1 / domain.noise_factor <= noise / domain.noise_deg_s <= domain.noise_factor:
            text = (
                f"the recording's noise of {noise:.3g} deg/s a sample is not within a factor of "
                f"{domain.noise_factor:g} of the {domain.noise_deg_s:.3g} deg/s the bundle was trained on"
            )
            found.append(_off(text, noise, domain.noise_deg_s))
    return found


def _off(message: str, value: float | None = None, limit: float | None = None) -> Finding:
    return Finding("bundle_mismatch", message, value, limit)
