"""The prior-fitted network: what it cannot get wrong by construction, what it learns from, and that it learns it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

torch = pytest.importorskip("torch", reason="PyTorch comes with the extra train")

from gyronorth.deviation import GAUSSIAN, DeviationPrior, error_covariance  # noqa: E402
from gyronorth.learn.prior_fitted import (  # noqa: E402
    PriorFittedSettings,
    Stage,
    draw_swings,
    predict,
    train_to,
    trained,
)

TINY = PriorFittedSettings(width=8, heads=2, layers=2, harmonics=4, swings=3, asked=4, steps=4)
#: One setting for certain: a smooth curve of few harmonics, Gaussian noise, no coupling.
SMOOTH = DeviationPrior((0.5, 0), (0.8, 0), (3.0, 0), (0.0, 0), absent=0.0, dof=GAUSSIAN)


def swing(known=9, asked=5, *, seed=3):
    rng = np.random.default_rng(seed)
    heading, surplus = rng.uniform(0, 2 * np.pi, known + asked), 0.1 * rng.standard_normal(known + asked)
    surplus[known:] *= 0.1  # inside the range of the known
    return heading[:known], surplus[:known], 0.07 * rng.standard_normal(known), heading[known:], surplus[known:]


@pytest.fixture(scope="module")
def network():
    return trained(TINY, train_to(TINY, 2))


def test_a_swing_turned_mirrored_or_in_another_order_gives_the_same(network):
    heading, surplus, error, at, at_surplus = swing()
    expected = predict(network, heading, surplus, error, at, at_surplus)
    order = np.random.default_rng(0).permutation(len(heading))
    for turned in (
        predict(network, heading[order], surplus[order], error[order], at, at_surplus),
        predict(network, heading + 2.0, surplus, error, at + 2.0, at_surplus),
        predict(network, -heading, surplus, error, -at, at_surplus),
    ):
        assert_allclose(turned, expected, atol=1e-7)


def test_errors_ten_times_as_large_give_answers_ten_times_as_large(network):
    heading, surplus, error, at, at_surplus = swing()
    small = predict(network, heading, surplus, error, at, at_surplus)
    large = predict(network, heading, 10 * surplus, 10 * error, at, 10 * at_surplus)
    assert_allclose(large, 10 * np.array(small), rtol=1e-5)


def test_what_else_is_asked_for_changes_no_answer(network):
    heading, surplus, error, at, at_surplus = swing()
    together = predict(network, heading, surplus, error, at, at_surplus)
    alone = [predict(network, heading, surplus, error, at[k : k + 1], at_surplus[k : k + 1]) for k in range(len(at))]
    assert_allclose(np.concatenate(alone, axis=1), together, atol=1e-7)


def test_the_answer_depends_on_errors_headings_and_surplus(network):
    heading, surplus, error, at, at_surplus = swing()
    before = np.array(predict(network, heading, surplus, error, at, at_surplus))
    for changed in (
        predict(network, heading, surplus, error[::-1].copy(), at, at_surplus),
        predict(network, heading[::-1].copy(), surplus, error, at, at_surplus),
        predict(network, heading, surplus[::-1].copy(), error, at, at_surplus),
        predict(network, heading, surplus, error, at + 1, at_surplus),
        predict(network, heading, surplus, error, at, 0.5 * at_surplus),
    ):
        assert np.abs(np.array(changed) - before).max() > 1e-5


def test_a_surplus_beyond_the_known_is_taken_at_the_end_of_their_range(network):
    heading, surplus, error, at, _ = swing()
    far, end = (predict(network, heading, surplus, error, at, np.full(5, s)) for s in (9.0, surplus.max()))
    assert_array_equal(far, end)


def test_swings_are_drawn_from_the_law_that_the_gaussian_process_states():
    """Of one setting: their covariance, with noise of k degrees of freedom k / (k - 2) times its scale's variance."""
    prior = DeviationPrior((0.5, 0), (0.8, 0), (0.6, 0), (0.9, 0), absent=0.0, dof=20.0)
    drawn = draw_swings(prior, swings=20000, known=4, asked=2, rng=np.random.default_rng(5))
    settings = np.array([[0.5, 0.8, 0.6, 0.9]])
    expected = error_covariance(drawn.heading, drawn.surplus, settings, np.full((1, 6), 0.25 * 20 / 18))[0]
    found = drawn.error.T @ drawn.error / 20000
    assert_allclose(found, expected, atol=4 * np.sqrt(2 / 20000) * expected.max())


def test_a_part_of_the_swings_has_neither_curve_nor_coupling():
    """Of these the errors are noise; absent for certain, all are."""
    prior = DeviationPrior((0.1, 0), (5.0, 0), (9.0, 0), (5.0, 0), absent=1.0, dof=GAUSSIAN)
    drawn = draw_swings(prior, swings=500, known=6, asked=2, rng=np.random.default_rng(1))
    assert float(drawn.error.std()) == pytest.approx(0.1, rel=0.05)


def test_a_training_in_stages_ends_in_the_same_weights():
    whole, stage = train_to(TINY, 4), train_to(TINY, 2)
    copied = Stage(stage.step, {name: value.copy() for name, value in stage.arrays.items()}, stage.loss)
    for name, value in train_to(TINY, 4, copied).arrays.items():
        assert_array_equal(value, whole.arrays[name], err_msg=name)


@pytest.mark.slow
def test_for_a_gaussian_prior_of_one_setting_it_learns_the_answer_of_the_gaussian_process():
    """The ideal answer is then known: the errors left are within 8 % of the ideal's, sigma is of their size."""
    settings = PriorFittedSettings(
        prior=SMOOTH, width=16, heads=2, layers=1, harmonics=3, swings=24, asked=16, most=16, steps=160, rate=2e-2
    )
    network = trained(settings, train_to(settings, settings.steps))
    ideal, found, sigma, before = [], [], [], []
    for seed in range(40):
        drawn = draw_swings(SMOOTH, swings=1, known=12, asked=40, rng=np.random.default_rng([7, seed]))
        heading, surplus, error = drawn.heading, drawn.surplus, drawn.error[0]
        noise = np.full((1, 52), 0.25)
        covariance = error_covariance(heading, surplus, np.array([[0.5, 0.8, 3.0, 0.0]]), noise)[0]
        expected = covariance[12:, :12] @ np.linalg.solve(covariance[:12, :12], error[:12])
        mean, spread = predict(network, heading[:12], surplus[:12], error[:12], heading[12:], surplus[12:])
        ideal.append(error[12:] - expected)
        found.append(error[12:] - mean)
        sigma.append(spread)
        before.append(error[12:])
    root = [float(np.sqrt(np.mean(np.square(values)))) for values in (ideal, found, before)]
    assert root[0] < 0.75 * root[2]
    assert root[1] < 1.08 * root[0]
    assert float(np.mean(np.square(np.array(found) / sigma))) == pytest.approx(1.0, abs=0.15)
