"""The bases of a law, whitened: of the horizontal axes, whose trace is seen beside the rate, and of the vertical."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.alignment.posterior.blocks import COUNT
from gyronorth.arrays import Array, Index


@dataclass(frozen=True)
class Axis:
    """Whitened bases of one kind of axis: the trace by the noise n of each, the rate given the trace by itself."""

    noise: Index  # (b,) number of its noise
    root: Array  # (b, COUNT, COUNT) root of the inverse covariance of the rate given the trace
    beside: Array  # (n, COUNT, COUNT) what of the rate follows from the trace; none of either without a trace
    trace_root: Array  # (n, COUNT, COUNT) root of the inverse covariance of the trace
    known: Array  # (b, 1 + c + m, d) whitened: the constant, columns, and modes of a walk, turned until orthogonal
    information: Array  # (b,) of the constant
    cross: Array  # (b, c) constant by column
    square: Array  # (b, c) columns by themselves
    walk_cross: Array  # (b, m) constant by mode
    walk_square: Array  # (b, m) modes by themselves
    half_log_det: Array  # (b,) log of the determinant of the root of the covariance

    def whitened(self, seen: Array) -> Array:
        """Every base of what is seen, (e, d, k): (e, b, d, k)."""
        return _whitened(seen, self.noise, self.root, self.beside, self.trace_root)


def axis_of(
    noise: Array, number: Index, motion: Array, gyro: Array, trace: Array | None, walk: Array, seconds: float
) -> Axis:
    """Bases of noises (n, d, d), by number (b,), with motions (b, COUNT, COUNT): the rate has them, the trace not.

    The trace is whitened first, once for each noise, and the rate given the trace for each base.
    """
    columns = np.concatenate([np.ones((COUNT, 1)), gyro, walk], axis=1)
    rate, log_det = noise[:, :COUNT, :COUNT], np.zeros(len(noise))
    trace_root = beside = np.zeros((0, COUNT, COUNT))
    if trace is not None:
        integral = (np.tri(COUNT) - 0.5 * np.eye(COUNT)) * seconds
        of_trace = np.concatenate([integral @ np.ones((COUNT, 1)), trace, integral @ walk], axis=1)
        columns = np.concatenate([columns, of_trace])
        factor = np.linalg.cholesky(noise[:, COUNT:, COUNT:])
        trace_root = np.asarray(np.linalg.inv(factor), dtype=float)
        share = trace_root @ noise[:, COUNT:, :COUNT]
        rate = rate - np.swapaxes(share, 1, 2) @ share
        beside = np.swapaxes(share, 1, 2) @ trace_root
        log_det = np.sum(np.log(np.diagonal(factor, axis1=1, axis2=2)), axis=1)
    factor = np.linalg.cholesky(rate[number] + motion)
    root: Array = np.asarray(np.linalg.inv(factor), dtype=float)
    half_log_det = log_det[number] + np.sum(np.log(np.diagonal(factor, axis1=1, axis2=2)), axis=1)
    known = _whitened(columns[None], number, root, beside, trace_root)[0]
    one, shaped, modes = known[..., 0], known[..., 1 : 1 + gyro.shape[1]], known[..., 1 + gyro.shape[1] :]
    square, turn = np.linalg.eigh(np.swapaxes(modes, 1, 2) @ modes)
    modes = modes @ turn
    return Axis(
        noise=number,
        root=root,
        beside=beside,
        trace_root=trace_root,
        known=np.concatenate([one[:, None], np.swapaxes(shaped, 1, 2), np.swapaxes(modes, 1, 2)], axis=1),
        information=np.sum(one**2, axis=1),
        cross=(one[:, None, :] @ shaped)[:, 0],
        square=np.sum(shaped**2, axis=1),
        walk_cross=(one[:, None, :] @ modes)[:, 0],
        walk_square=square,
        half_log_det=half_log_det,
    )


def _whitened(seen: Array, number: Index, root: Array, beside: Array, trace_root: Array) -> Array:
    """Rates and, below them, traces (e, d, k) whitened by every base (see `Axis`): (e, b, d, k)."""
    e, _, k = seen.shape
    if len(beside) == 0:
        return (root.reshape(-1, COUNT) @ seen).reshape(e, -1, COUNT, k)
    rate, trace = seen[:, :COUNT], seen[:, COUNT:]
    both = (np.concatenate([beside, trace_root]).reshape(-1, COUNT) @ trace).reshape(e, 2, -1, COUNT, k)
    given = root @ (rate[:, None] - both[:, 0])[:, number]
    return np.concatenate([given, both[:, 1, number]], axis=2)
