"""Which protocol a stream of bytes is, by its checksums alone."""

from __future__ import annotations

import numpy as np

from gyronorth.frames.catalogue import NAMES
from gyronorth.frames.framing import Framer
from gyronorth.frames.registry import protocol_of

#: Frames of one layout with inertial data whose checksums must hold.
NEEDED = 4
#: Bytes that are looked at.
LOOK = 1 << 16


def recognise(data: bytes) -> str | None:
    """The name of the protocol whose frames `data` holds, by its first `LOOK` bytes; None for none.

    `NEEDED` frames of one layout must have good checksums; of several protocols, the one that explains the most
    bytes is taken. In n random bytes the weakest of the protocols shows one false frame with a chance of less than
    n 2^-24, and four of one layout never.
    """
    best, most = None, 0
    for name in NAMES:
        frames = Framer(protocol_of(name)).feed(data[:LOOK], last=True)
        inertial = frames.layout[frames.layout >= 0]
        if not len(inertial) or np.unique(inertial, return_counts=True)[1].max() < NEEDED:
            continue
        if frames.length.sum() > most:
            best, most = name, int(frames.length.sum())
    return best
