"""Captures of a unit's frames: the bytes as they came from the cable, in one of the protocols of `gyronorth.frames`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal, cast

import numpy as np

from gyronorth.errors import InputError
from gyronorth.frames import (
    NAMES,
    PIECE,
    FrameStream,
    Report,
    Samples,
    StreamOptions,
    no_inertial_data,
    others_of,
    recognise,
)
from gyronorth.frames.recognition import LOOK
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import FORCES, RATES, TIME, Bad, Block, Clock, Facts, Source
from gyronorth.recording import Note


def open_frames(path: Path, options: ReadOptions) -> Source:
    """Open a capture; the protocol is that declared, else the one whose checksums hold.

    Raises
    ------
    InputError
        If no protocol is recognised, no sample is in the file, or something is declared that frames state themselves.
    """
    protocol = options.protocol or _recognised(path)
    declared = frame_options(protocol, options, path.name)
    stream = FrameStream(protocol, declared)
    first = next((samples for samples, _ in _samples(path, stream)), None)
    if first is None:
        if stream.report.messages:
            raise InputError(no_inertial_data(path.name, protocol, stream.report.messages))
        raise InputError(
            f"{path.name} holds no sample of protocol {protocol}: {stream.report.other} whole frames hold other data, "
            f"{stream.report.skipped} bytes belong to no whole frame. Set the unit to send inertial data, or check the "
            "protocol and the baud rate."
        )
    report = stream.report
    account = _Account(report)
    on_clock = report.clock == "unit's clock"
    return Source(
        format="frames",
        name=path.name,
        columns=(TIME, *RATES, *(FORCES if first.accel is not None else ())),
        blocks=partial(_blocks, path, protocol, declared, account),
        stated=SI,
        usual=usual_facts(report),
        axes_defined=report.axes is not None,
        decoded=True,
        clock=Clock(unit=1.0, name="the unit's clock") if on_clock else Clock(unit=None, name="the frames", step=1.0),
        remarks=account.remarks,
    )


#: What frames are decoded to.
SI = Facts(gyro_unit="rad/s", accel_unit="m/s2")
#: Declarations that mean something for frames, and of which protocols.
DECLARED_OF = {
    "gyro_unit": ("kvh",),
    "increments": ("kvh", "stim"),
    "accel_range_g": ("stim",),
    "imu": ("novatel",),
    "accel_unit": (),
    "gyro_scale": (),
    "accel_scale": (),
    "columns": (),
}


def usual_facts(report: Report) -> Facts:
    """What is usual for the protocol: axes, and the rate where the frames carry no time."""
    return Facts(axes=report.axes, rate_hz=None if report.clock == "unit's clock" else report.rate_hz)


def frame_options(protocol: str, options: ReadOptions, name: str) -> StreamOptions:
    """Declarations about a file or a stream as those about its frames.

    Raises
    ------
    InputError
        If one of them does not apply to this protocol, or cannot be.
    """
    for field, protocols in DECLARED_OF.items():
        if getattr(options, field) not in (None, {}) and protocol not in protocols:
            option = f"--{field.removesuffix('_g').replace('_', '-')}"
            needed = f"It is for {' and '.join(protocols)}; l" if protocols else "L"
            raise InputError(
                f"{option} does not apply to {name}: its {protocol} frames state what it says. {needed}eave it out."
            )
    if options.gyro_unit == "deg/h":
        raise InputError(f"--gyro-unit deg/h is declared of {name}; KVH frames hold rad/s or deg/s.")
    increments = {None: None, True: "both", False: "none"}.get(options.increments, options.increments)  # type: ignore[call-overload]
    gyro_unit = cast("Literal['rad/s', 'deg/s'] | None", options.gyro_unit)
    return StreamOptions(options.rate_hz, gyro_unit, increments, options.accel_range_g, options.imu)


def refuse_others(path: Path) -> None:
    """InputError where the file holds frames or lines of a known protocol without inertial data."""
    with path.open("rb") as file:
        head = file.read(LOOK)
    others = others_of(head) if recognise(head) is None else None
    if others is not None:
        raise InputError(no_inertial_data(path.name, *others))


def _recognised(path: Path) -> str:
    with path.open("rb") as file:
        protocol = recognise(file.read(LOOK))
    if protocol is None:
        refuse_others(path)
        raise InputError(
            f"{path.name} holds no frames of a known protocol: no start is followed by a checksum that holds. Known "
            f"are {', '.join(NAMES)}. The likely cause is a wrong baud rate, or another message."
        )
    return protocol


def _samples(path: Path, stream: FrameStream) -> Iterator[tuple[Samples, float]]:
    """The samples piece by piece, with the share of the file that is read.

    Raises
    ------
    InputError
        If the unit was reset on the way, so that what comes is another recording.
    """
    size = max(path.stat().st_size, 1)
    with path.open("rb") as file:
        while True:
            piece = file.read(PIECE)
            samples = stream.feed(piece) if piece else stream.finish()
            if samples is not None:
                if len(stream.report.kinds) > 1:
                    raise _of_two_settings(path.name, samples, stream.report)
                yield samples, file.tell() / size
            if not piece:
                return


def _of_two_settings(name: str, samples: Samples, report: Report) -> InputError:
    places = samples.start[samples.jumped]
    at = int(places[-1] if len(places) else samples.start[0])
    before, after = report.kinds[-2:]
    rates = "" if before.rate_hz == after.rate_hz else f" from {before.rate_hz:g} to {after.rate_hz:g} Hz"
    forces = "" if before.accel == after.accel else f" {'with' if after.accel else 'without'} the accelerometer"
    return InputError(
        f"{name} holds more than one recording: at byte {at} the unit was reset,{rates}{forces}. Cut the file "
        f"there: head -c {at} {name} > first.bin; tail -c +{at + 1} {name} > second.bin."
    )


@dataclass
class _Account:
    """Of a capture, as far as it is read."""

    report: Report
    breaks: int = 0  # of unknown length

    def remarks(self) -> tuple[Note, ...]:
        """What there is to say."""
        if not self.breaks:
            return self.report.findings
        message = (
            f"The unit or its clock was reset {self.breaks} times on the way. How long each break was is not known; "
            "the samples are taken to go on as the bytes and the counter show."
        )
        return (*self.report.findings, Note("clock_set", message, float(self.breaks), 0.0))


def _blocks(path: Path, protocol: str, options: StreamOptions, account: _Account) -> Iterator[Block]:
    stream = FrameStream(protocol, options)
    account.breaks = 0
    for samples, share in _samples(path, stream):
        flags = np.column_stack([samples.saturated, samples.sensor_fault])
        account.report, account.breaks = stream.report, account.breaks + int(samples.jumped.sum())
        yield Block(_table(samples, stream.report), samples.number + 1, Bad.none(), share, flags)


def _table(samples: Samples, report: Report) -> np.ndarray:
    """Time in s, or the number of the sample, then rates and forces."""
    on_clock = report.clock == "unit's clock" and samples.t is not None
    time = samples.t if on_clock else samples.number.astype(float)
    parts = [time, *samples.gyro.T, *([] if samples.accel is None else samples.accel.T)]
    return np.column_stack(parts)


def _recognises(head: bytes) -> bool:
    """Frames of a protocol, with inertial data or not; lines without, though, are read as any other text."""
    if recognise(head) is not None:
        return True
    others = others_of(head)
    return others is not None and not all(message.startswith(("$", "#")) for message in others[1])


FORMAT = Format(format_info("frames"), open_frames, recognises=_recognises)
