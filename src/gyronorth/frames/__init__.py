"""Frames of inertial units: from the bytes on the cable, or in a capture, to samples in SI.

Numbers of `Samples` are in the axes of the protocol's data; `Report.axes` says where these point (None: as marked on
the unit). The rest of the package declares or turns axes at its edge, as for files.

A capture::

    samples, report = decode(data)                      # the protocol is recognised by its checksums
    samples, report = decode(data, "kvh", StreamOptions(rate_hz=1000.0))

A running unit, or a file that is read in pieces::

    stream = FrameStream("stim")
    for piece in pieces:                                # cut anywhere
        samples = stream.feed(piece)                    # None, or Samples
    samples = stream.finish()
    stream.report                                       # rate, lost, skipped, assumptions

A reader takes `Samples.columns()` as the rows of a block, `Report.axes` and `Report.rate_hz` as what the file states,
`Samples.start` as the place to name in a message (byte) and `Report.findings` as notes. A live source feeds what the
port gives and passes `saturated` and `sensor_fault` on.
"""

from __future__ import annotations

from gyronorth.errors import InputError
from gyronorth.frames.catalogue import NAMES, PROTOCOLS, ProtocolInfo, protocol_info
from gyronorth.frames.others import no_inertial_data, others_of
from gyronorth.frames.protocol import StreamOptions
from gyronorth.frames.recognition import LOOK, recognise
from gyronorth.frames.samples import Report, Samples, joined
from gyronorth.frames.stream import FrameStream

__all__ = [
    "NAMES",
    "PIECE",
    "PROTOCOLS",
    "FrameStream",
    "ProtocolInfo",
    "Report",
    "Samples",
    "StreamOptions",
    "decode",
    "joined",
    "no_inertial_data",
    "others_of",
    "protocol_info",
    "recognise",
]

#: Bytes that are decoded at once: the memory that a capture takes does not grow with its length but for its samples.
PIECE = 1 << 20


def decode(data: bytes, protocol: str | None = None, options: StreamOptions | None = None) -> tuple[Samples, Report]:
    """All samples of a capture.

    Parameters
    ----------
    data : bytes
        As they came from the unit; both ends may be cut.
    protocol : str, optional
        Name in `NAMES`; by default it is recognised.
    options : StreamOptions, optional
        What the user declares.

    Raises
    ------
    InputError
        If no protocol is recognised, there is no whole frame with inertial data, or something must be declared.
    """
    name = protocol or recognise(data)
    others = others_of(data[:LOOK]) if name is None else None
    if others is not None:
        raise InputError(no_inertial_data("The capture", *others))
    if name is None:
        raise InputError(
            f"No frames of a known protocol are in these {len(data)} bytes: no start is followed by a checksum that "
            f"holds. Known are {', '.join(NAMES)}. The likely cause is a wrong baud rate, or another message."
        )
    stream = FrameStream(name, options)
    parts = [stream.feed(data[at : at + PIECE]) for at in range(0, len(data), PIECE)]
    given = [part for part in (*parts, stream.finish()) if part is not None]
    if not given:
        report = stream.report
        if report.messages:
            raise InputError(no_inertial_data("The capture", name, report.messages))
        raise InputError(
            f"No sample of protocol {name} is in these {len(data)} bytes: {report.other} whole frames hold other data, "
            f"{report.skipped} bytes belong to no whole frame. Set the unit to send inertial data, or check the "
            "protocol and the baud rate."
        )
    return joined(given), stream.report


def __dir__() -> list[str]:
    return sorted(__all__)
