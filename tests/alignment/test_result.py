"""Posterior and result: intervals stay as they were found."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from gyronorth.alignment.result import Attitude, Posterior, Result, unknown
from gyronorth.uncertainty import SIGMA_UNKNOWN


def attitude(shape=()):
    zero = np.zeros(shape)
    return Attitude(zero + 1.0, zero, zero, np.zeros((*shape, 3)))


def test_a_symmetric_posterior_reaches_as_far_to_either_side():
    found = Posterior.symmetric([0.1, 0.2], [0.3, 4.0])
    assert_allclose(found.low, [-0.3, -4.0])
    assert_allclose(found.half_width, [0.3, np.pi])
    assert found.whole.tolist() == [False, True]


def test_a_skewed_posterior_keeps_its_ends():
    found = Posterior(np.asarray(0.1), np.asarray(-0.05), np.asarray(0.35))
    assert_allclose(found.half_width, 0.2)
    assert (float(found.low), float(found.high)) == (-0.05, 0.35)


def test_nothing_is_known_of_an_unknown_result():
    found = unknown(attitude((3,)))
    assert found.posterior.whole.all()
    assert_allclose(found.posterior.sigma, SIGMA_UNKNOWN)
    assert not found.variance
    assert found.known


def test_the_total_is_the_sum_of_the_terms():
    terms = {"noise": np.asarray(1e-12), "drift": np.asarray(3e-12)}
    found = Result("mean", attitude(), Posterior.unknown(), terms, np.asarray(1.0))
    assert_allclose(found.total, 4e-12)
