"""Heading by a trained bundle, run through ONNX Runtime; PyTorch is not needed."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.alignment.networks.bundle import (
    WINDOW_SLACK,
    Bundle,
    DenoiserPart,
    HeadingPart,
    ProposalPart,
    RecordingFacts,
    bundle_contents,
    is_shipped,
    mismatch,
    shipped_bundle,
)
from gyronorth.alignment.networks.diffusion import Predict, denoise, white_noise
from gyronorth.alignment.networks.network import Arrays, Network, Runner
from gyronorth.alignment.result import Attitude, Result, unknown
from gyronorth.alignment.tones.proposals import KEPT, Amortised, Propose, amortising
from gyronorth.alignment.tones.side_by_side import TOGETHER, Proposing, searched
from gyronorth.angles import wrap_heading
from gyronorth.conditioning import decimate
from gyronorth.deviation import DeviationModel, deviation_of
from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.sensor import TriadErrors
from gyronorth.uncertainty import SIGMA_UNKNOWN

#: Log odds within which rounding could tip a proposal.
HANGS = 1e-3


@dataclass(frozen=True)
class LoadedBundle:
    """A bundle with its networks loaded."""

    name: str
    info: Bundle
    denoiser: Network | None
    heading: Network | None
    proposal: Network | None = None
    deviation: DeviationModel | None = None

    def renew(self) -> None:
        """Give its networks their time for the next recording."""
        for network in (self.denoiser, self.heading, self.proposal):
            if network is not None:
                network.renew()


def load_bundle(folder: str | Path, *, threads: int = 1) -> LoadedBundle:
    """Read a bundle and load its networks, each on `threads` threads.

    Raises
    ------
    InputError
        If the folder is not a bundle, a network is not what the bundle says, or onnxruntime is not installed.
    """
    folder = Path(folder)
    info, contents = bundle_contents(folder)
    if importlib.util.find_spec("onnxruntime") is None:
        raise InputError(
            "Running a trained bundle needs onnxruntime, which is not installed. "
            "Install it with: pip install 'gyronorth[learned]'."
        )
    trusted = is_shipped(folder)

    def network(part: DenoiserPart | HeadingPart | ProposalPart | None) -> Network | None:
        if part is None:
            return None
        inputs, outputs = _SIGNATURES[type(part)]
        what = f"{part.file} of the bundle {folder.name}"
        make = partial(_runner, threads=threads)
        return Network(contents[part.file], make, inputs=inputs, outputs=outputs, what=what, trusted=trusted)

    return LoadedBundle(
        folder.name,
        info,
        network(info.denoiser),
        network(info.heading),
        network(info.proposal),
        None
        if info.deviation is None
        else deviation_of(contents[info.deviation.file], where=str(folder / info.deviation.file)),
    )


#: Names of the inputs of each network, and the number of its outputs.
_SIGNATURES: dict[type, tuple[tuple[str, ...], int]] = {
    DenoiserPart: (("x", "t"), 1),
    HeadingPart: (("rate",), 1),
    ProposalPart: (("rate", "index", "cycles"), 2),
}


def _runner(content: bytes, *, threads: int) -> Runner:
    """What runs a network by ONNX Runtime: answers, and the CPU time that they took, s."""
    import onnxruntime  # pyright: ignore[reportMissingTypeStubs]

    library: Any = onnxruntime
    options = library.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 4  # its errors are told by us
    # Without a second try, which it would announce on standard output.
    session = library.InferenceSession(content, options, providers=["CPUExecutionProvider"], enable_fallback=0)

    def run(request: Arrays | None) -> Any:
        start = time.process_time()
        if request is None:
            answer: Any = [each.name for each in session.get_inputs()], len(session.get_outputs())
        else:
            answer = session.run(None, request)
        return answer, time.process_time() - start

    return run


def bundle_of(method: str, model: str | Path | None) -> LoadedBundle:
    """The bundle of a method, loaded once for as long as its description does not change."""
    folder = Path(shipped_bundle(method) if model is None else model)
    described = folder / "bundle.json"
    return _loaded(folder, described.stat().st_mtime_ns if described.is_file() else 0)


@lru_cache(maxsize=4)
def _loaded(folder: Path, changed: int) -> LoadedBundle:  # noqa: ARG001 - a changed description is another bundle
    return load_bundle(folder)


def mismatched(method: str, attitude: Attitude, bundle: LoadedBundle, misfits: Sequence[Finding]) -> Result:
    """No heading: every way in which the recording does not fit the bundle is a reason."""
    refusals = tuple(
        replace(misfit, message=f"The bundle {bundle.name} does not fit: {misfit.message}.") for misfit in misfits
    )
    return unknown(attitude, method=method, refusals=refusals, bundle=bundle.name, known=False)


def run(bundle: LoadedBundle, gyro_l: ArrayLike) -> NDArray[np.float64]:
    """Headings of levelled recordings.

    Parameters
    ----------
    gyro_l : array_like, shape (n, samples, 3)
        Angular rate in the level frame, rad/s, at the bundle's rate; `samples` at least the
        bundle's window, of which the last one is used.

    Returns
    -------
    ndarray, shape (n,)
        Heading in [0, 2 pi) rad.

    Notes
    -----
    Recordings go through the networks one by one: float32 matrix products round differently
    with the size of a batch, by more than the 1e-5 deg to which a heading must not depend on it.
    """
    if bundle.heading is None or bundle.info.heading is None:
        what = "a denoiser only" if bundle.info.proposal is None else "proposals for `solve`"
        raise InputError(f"The bundle {bundle.name} holds {what}; it gives no heading by itself.")
    rate = clean(bundle, gyro_l) / EARTH_RATE
    if len(rate) == 0:
        return np.zeros(0)
    output = bundle.info.heading.output
    raw: list[NDArray[np.float64]] = []
    for one in rate:
        bundle.heading.renew()
        found = bundle.heading.run({"rate": one[None]})[0]
        raw.append(bundle.heading.check(found, (1, 1 if output == "degrees" else 2)))
    return decode(np.concatenate(raw), output)


def last_window(bundle: LoadedBundle, gyro_l: ArrayLike, *, rate_hz: float) -> NDArray[np.float64]:
    """The last window of gyro_l (..., n, 3) at `rate_hz`, averaged down to the bundle's rate: (..., samples, 3).

    The recording must fit (`bundle.mismatch`); gyro_l stays in its unit.
    """
    domain = bundle.info.domain
    return decimate(gyro_l, rate_hz=rate_hz, to_hz=min(domain.rate_hz, rate_hz))[..., -domain.samples :, :]


@dataclass(frozen=True)
class LearnedHeadings:
    """Headings under disturbance, arrays over recordings."""

    heading: NDArray[np.float64]  # rad in [0, 2 pi)
    sigma: NDArray[np.float64]  # rad
    low: NDArray[np.float64]  # ends of the 95 % interval, rad from `heading`
    high: NDArray[np.float64]
    fits: NDArray[np.bool_]  # False where the disturbance is of no kind that was learned; sigma is widened there
    found: tuple[Amortised, ...]  # what was found in each, before sigma was calibrated
    rate_hz: float  # of the samples that they were averaged down to


def solve(
    bundle: LoadedBundle, gyro_l: ArrayLike, *, rate_hz: float, latitude: float, errors: TriadErrors | None
) -> LearnedHeadings:
    """Headings of disturbed recordings by the proposals of a network and closed-form evidence.

    Parameters
    ----------
    bundle : LoadedBundle
        One with a proposal network, such as the `learned` one that ships.
    gyro_l : array_like, shape (n, samples, 3)
        Angular rate in the level frame, rad/s; a rate above the bundle's is averaged down, and what is longer
        than its longest window further, to no more samples.
    rate_hz : float
        Sample rate, Hz.
    latitude : float
        Geodetic latitude, rad.
    errors : TriadErrors, optional
        Error terms of the gyro; see `amortised`.

    Notes
    -----
    Recordings go side by side, and none depends on those beside it, see `side_by_side`.
    """
    if bundle.proposal is None or bundle.info.proposal is None:
        raise InputError(
            f"The bundle {bundle.name} holds neither proposals nor a deviation curve: none for the method learned."
        )
    gyro_l, domain = np.asarray(gyro_l, dtype=float), bundle.info.domain
    if gyro_l.ndim != 3 or gyro_l.shape[1] / rate_hz < domain.window * (1 - WINDOW_SLACK) or gyro_l.shape[2] != 3:
        raise InputError(
            f"gyro_l has shape {np.shape(gyro_l)} at {rate_hz:g} Hz; (n, samples, 3) with at least "
            f"{domain.window:g} s is expected by {bundle.name}."
        )
    slow = min(domain.rate_at(gyro_l.shape[1] / rate_hz), rate_hz)
    level, propose = decimate(gyro_l, rate_hz=rate_hz, to_hz=slow), side_by_side(bundle.proposal)
    found: list[Amortised] = []
    for start in range(0, len(level), TOGETHER):
        searches = [
            amortising(one, rate_hz=slow, latitude=latitude, errors=errors) for one in level[start : start + TOGETHER]
        ]
        found += searched(searches, propose)
    scale = bundle.info.proposal.sigma_scale
    return LearnedHeadings(
        heading=np.array([one.heading for one in found]),
        sigma=np.minimum([one.sigma * scale for one in found], SIGMA_UNKNOWN),
        low=np.maximum([one.low * scale for one in found], -np.pi),
        high=np.minimum([one.high * scale for one in found], np.pi),
        fits=np.array([one.fits for one in found], dtype=bool),
        found=tuple(found),
        rate_hz=slow,
    )


def onnx_proposals(network: Network) -> Propose:
    """The proposals of an exported network."""

    def propose(
        rate: NDArray[np.float32], index: NDArray[np.float32], cycles: NDArray[np.float32]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        network.renew()
        bump, tone = network.run({"rate": rate[None], "index": index, "cycles": cycles})
        return network.check(bump, (1, len(rate)))[0], network.check(tone, (1, len(cycles)))[0]

    return propose


def side_by_side(network: Network) -> Callable[[Sequence[Proposing]], list[tuple[Any, Any]]]:
    """The same for several recordings of one length at once, with what is taken of them as if each were alone.

    Products in single precision round differently beside others, by some 1e-6 of the log odds. What is taken of a
    proposal are the samples with positive odds and the `KEPT` likeliest frequencies: where one of them hangs by a
    thousandth, the recording is asked for alone. A stranger's network is asked for each alone, within its time.
    """
    alone = onnx_proposals(network)

    def propose(asked: Sequence[Proposing]) -> list[tuple[Any, Any]]:
        if len(asked) == 1 or not network.trusted:
            return [alone(one.rate, one.index, one.cycles) for one in asked]
        rates = np.stack([one.rate for one in asked])
        bump, tone = network.run({"rate": rates, "index": asked[0].index, "cycles": asked[0].cycles})
        network.check(bump, rates.shape[:2])
        network.check(tone, (len(asked), len(asked[0].cycles)))
        ranked = np.sort(tone, axis=1)
        close = np.abs(bump).min(axis=1) < HANGS
        if tone.shape[1] > KEPT:
            close |= ranked[:, -KEPT] - ranked[:, -KEPT - 1] < HANGS
        return [
            alone(one.rate, one.index, one.cycles) if close[n] else (bump[n], tone[n]) for n, one in enumerate(asked)
        ]

    return propose


def misfits(
    bundle: LoadedBundle, gyro_l: ArrayLike, *, rate_hz: float, latitude: float | None, sensor: str | None
) -> list[Finding]:
    """Every way in which one levelled recording (n, 3), rad/s, does not fit the bundle (see `bundle.mismatch`)."""
    gyro_l = np.asarray(gyro_l, dtype=float)
    facts = RecordingFacts(rate_hz, len(gyro_l) / rate_hz, latitude, sensor)
    found = mismatch(bundle.info, facts)
    if found:
        return found
    noise = white_noise(last_window(bundle, gyro_l[None], rate_hz=rate_hz))[0]
    return mismatch(bundle.info, replace(facts, noise=float(noise)))


def clean(bundle: LoadedBundle, gyro_l: ArrayLike) -> NDArray[np.float64]:
    """The last window of each recording, denoised where the bundle has a denoiser, rad/s, shape (n, window, 3)."""
    gyro_l = np.asarray(gyro_l, dtype=float)
    samples = bundle.info.domain.samples
    if gyro_l.ndim != 3 or gyro_l.shape[1] < samples or gyro_l.shape[2] != 3:
        raise InputError(f"gyro_l has shape {gyro_l.shape}; (n, {samples} or more, 3) is expected by {bundle.name}.")
    gyro_l = gyro_l[:, -samples:]
    part = bundle.info.denoiser
    if part is None or bundle.denoiser is None or len(gyro_l) == 0:
        return gyro_l
    predict = onnx_predictor(bundle.denoiser)
    schedule, sampler, normalisation = part.schedule, part.sampler, part.normalisation
    cleaned: list[NDArray[np.float64]] = []
    for one in gyro_l:
        bundle.renew()
        cleaned.append(denoise(predict, one[None], schedule=schedule, sampler=sampler, normalisation=normalisation))
    return np.concatenate(cleaned)


def onnx_predictor(network: Network) -> Predict:
    """The noise prediction of an exported denoiser."""

    def predict(x: NDArray[np.float32], t: int) -> NDArray[np.float32]:
        return network.check(network.run({"x": x, "t": np.full(len(x), t, dtype=np.int64)})[0], x.shape)

    return predict


def decode(raw: NDArray[np.float64], output: str) -> NDArray[np.float64]:
    """Heading in [0, 2 pi) rad from a heading network's output (n, 1) in degrees or (n, 2) as cos, sin."""
    if output == "degrees":
        return wrap_heading(np.radians(raw[:, 0] % 360.0))
    return wrap_heading(np.arctan2(raw[:, 1], raw[:, 0]))
