"""Captures of a unit's frames: the bytes as they came from the cable, in one of the protocols of `gyronorth.frames`."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from gyronorth.errors import InputError
from gyronorth.frames import NAMES, PIECE, FrameStream, Options, Report, Samples, recognise
from gyronorth.frames.recognition import LOOK
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import FORCES, RATES, TIME, Bad, Block, Clock, Facts, Source


def open_frames(path: Path, options: ReadOptions) -> Source:
    """Open a capture; the protocol is that declared, else the one whose checksums hold.

    Raises
    ------
    InputError
        If no protocol is recognised, no sample is in the file, or something is declared that frames state themselves.
    """
    for name, given in (
        ("--gyro-unit", options.gyro_unit),
        ("--accel-unit", options.accel_unit),
        ("--increments", options.increments),
        ("--columns", options.columns),
    ):
        if given:
            raise InputError(f"{name} does not apply to {path.name}: its frames state their units. Leave it out.")
    protocol = options.protocol or _recognised(path)
    stream = FrameStream(protocol, Options(rate_hz=options.rate_hz))
    first = next((samples for samples, _ in _samples(path, stream)), None)
    if first is None:
        raise InputError(
            f"{path.name} holds no sample of protocol {protocol}: {stream.report.other} whole frames hold other data, "
            f"{stream.report.skipped} bytes belong to no whole frame. Set the unit to send inertial data, or check the "
            "protocol and the baud rate."
        )
    report = stream.report
    on_clock = report.clock == "unit's clock"
    return Source(
        format="frames",
        name=path.name,
        columns=(TIME, *RATES, *(FORCES if first.accel is not None else ())),
        blocks=partial(_blocks, path, protocol, options),
        stated=Facts(gyro_unit="rad/s", accel_unit="m/s2"),
        axes_defined=report.axes is not None,
        usual=Facts(axes=report.axes, rate_hz=None if on_clock else report.rate_hz),
        clock=Clock(unit=1.0, name="the unit's clock") if on_clock else Clock(unit=None, name="the frames"),
        notes=report.findings,
    )


def _recognised(path: Path) -> str:
    with path.open("rb") as file:
        protocol = recognise(file.read(LOOK))
    if protocol is None:
        raise InputError(
            f"{path.name} holds no frames of a known protocol: no start is followed by a checksum that holds. Known "
            f"are {', '.join(NAMES)}. The likely cause is a wrong baud rate, or another message."
        )
    return protocol


def _samples(path: Path, stream: FrameStream) -> Iterator[tuple[Samples, float]]:
    """The samples piece by piece, with the share of the file that is read."""
    size = max(path.stat().st_size, 1)
    with path.open("rb") as file:
        while piece := file.read(PIECE):
            samples = stream.feed(piece)
            if samples is not None:
                yield samples, file.tell() / size
    samples = stream.finish()
    if samples is not None:
        yield samples, 1.0


def _blocks(path: Path, protocol: str, options: ReadOptions) -> Iterator[Block]:
    stream = FrameStream(protocol, Options(rate_hz=options.rate_hz))
    for samples, share in _samples(path, stream):
        yield Block(_table(samples, stream.report), samples.number + 1, Bad.none(), share)


def _table(samples: Samples, report: Report) -> np.ndarray:
    """Time in s, or the number of the sample, then rates and forces."""
    on_clock = report.clock == "unit's clock" and samples.t is not None
    time = samples.t if on_clock else samples.number.astype(float)
    parts = [time, *samples.gyro.T, *([] if samples.accel is None else samples.accel.T)]
    return np.column_stack(parts)


FORMAT = Format(format_info("frames"), open_frames, recognises=lambda head: recognise(head) is not None)
