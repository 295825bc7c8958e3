"""Splits share no recording; intervals hold what they claim."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from gyronorth.evaluation import (
    Split,
    bootstrap_crmse,
    bootstrap_ratio,
    coverage,
    leave_arcs_out,
    leave_one_out,
    random_splits,
    share_of_wins,
)


def rng():
    return np.random.default_rng(20260101)


@given(count=st.integers(34, 80), seed=st.integers(0, 99))
def test_random_splits_have_their_sizes_and_share_nothing(count, seed):
    for split in random_splits(count, 3, rng=np.random.default_rng(seed)):
        parts = [split.train, split.validation, split.test]
        assert [len(part) for part in parts] == [24, 4, 6]
        assert len(np.unique(np.concatenate(parts))) == 34
        assert set(split.known) == set(split.train) | set(split.validation)


def test_leave_one_out_tests_each_once_and_knows_the_others():
    splits = leave_one_out(5)
    assert_array_equal(np.concatenate([split.test for split in splits]), np.arange(5))
    assert all(len(split.train) == 4 and split.test[0] not in split.train for split in splits)


def test_arcs_are_neighbours_on_the_circle_whatever_the_order_of_the_recordings():
    heading = np.radians([350, 10, 200, 100, 300, 50])  # by heading: 1, 5, 3, 2, 4, 0
    arcs = [set(split.test.tolist()) for split in leave_arcs_out(heading, 2)]
    assert arcs == [{1, 5}, {5, 3}, {3, 2}, {2, 4}, {4, 0}, {0, 1}]
    assert all(len(split.train) == 4 for split in leave_arcs_out(heading, 2))


def test_a_recording_in_two_parts_is_refused():
    with pytest.raises(ValueError, match="two parts"):
        Split(np.array([0, 1]), np.array([1]), np.zeros(0, int))


def test_wrong_sizes_are_refused_with_the_figures():
    with pytest.raises(ValueError, match=r"20 recordings came in; 24\+4\+6"):
        random_splits(20, 1, rng=rng())
    with pytest.raises(ValueError, match="arc is 6"):
        leave_arcs_out(np.zeros(6), 6)


def test_figures_by_hand():
    error, reference = np.array([0.3, -0.4]), np.array([0.6, 0.8])
    assert_allclose(bootstrap_crmse(error, [0, 1], rng=rng()).value, np.sqrt(0.125))
    assert_allclose(bootstrap_ratio(error, reference, [0, 1], rng=rng()).value, 0.5)  # half in each test
    assert share_of_wins([[0.1], [0.5]], [[0.2], [0.4]]) == 0.5


def test_errors_are_taken_around_the_circle():
    assert_allclose(bootstrap_crmse([2 * np.pi - 0.1, 0.1], [0, 1], rng=rng()).value, 0.1)


def test_ratio_is_paired_so_that_a_constant_factor_has_no_spread():
    reference = rng().standard_normal(60) * 0.1
    interval = bootstrap_ratio(0.7 * reference, reference, np.arange(60), rng=rng())
    assert_allclose([interval.low, interval.high], 0.7)


def test_repeating_the_tests_of_a_recording_does_not_narrow_the_interval():
    error = rng().standard_normal(30) * 0.1
    once = bootstrap_crmse(error, np.arange(30), rng=rng())
    often = bootstrap_crmse(np.repeat(error, 20), np.repeat(np.arange(30), 20), rng=rng())
    assert_allclose([often.low, often.high], [once.low, once.high])


def test_interval_of_the_crmse_holds_the_truth_as_often_as_it_says():
    # 300 sets of 40 Gaussian errors. Percentile intervals of 40 are a little short: 91 to 94 % are expected,
    # and the binomial spread at 300 is 1.6 %. A bootstrap of half the recordings would give 83 % at most.
    hits = 0
    for child in rng().spawn(300):
        interval = bootstrap_crmse(child.standard_normal(40) * 0.1, np.arange(40), rng=child, draws=400)
        hits += interval.low < 0.1 < interval.high
    assert 0.87 < hits / 300 < 0.98


def test_coverage_counts_what_lies_within_196_sigma():
    error = np.array([0.0, 1.95, -1.95, 1.97]) * 0.1
    interval = coverage(error, np.full(4, 0.1), np.arange(4), rng=rng())
    assert_allclose(interval.value, 0.75)
    assert interval.low < 0.75 < interval.high


def test_full_coverage_of_few_is_not_certain():
    # Wilson's interval for 10 of 10: lower end 1 / (1 + 1.96^2 / 10) = 0.722
    interval = coverage(np.zeros(10), np.ones(10), np.arange(10), rng=rng())
    assert_allclose([interval.value, interval.low, interval.high], [1, 0.7225, 1], atol=1e-3)
