"""Networks trained together are those that the trainer trains alone."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

torch = pytest.importorskip("torch", reason="PyTorch comes with the extra train")

from gyronorth.alignment.networks.diffusion import Normalisation  # noqa: E402
from gyronorth.learn.batched import PILE, RememberingDenoiser, train_batched  # noqa: E402
from gyronorth.learn.data import HeadingSet, TrainingData, synthetic_set  # noqa: E402
from gyronorth.learn.settings import Settings  # noqa: E402
from gyronorth.learn.stages import TrainedDenoiser, heading_parts, new_denoiser, train_heading  # noqa: E402
from gyronorth.learn.training import Progress  # noqa: E402

SAMPLES = 10


def data(seed):
    """Seven, three and four recordings at other headings for each seed."""
    clean = synthetic_set(headings=14, latitude=radians(32), samples=SAMPLES)
    noise = 5e-6 * np.random.default_rng(seed).standard_normal(clean.gyro_l.shape)
    every = HeadingSet(clean.gyro_l + noise, clean.heading, clean.recording)
    order = np.random.default_rng(seed).permutation(14)
    train, validation, test = (every.rows(order[a:b]) for a, b in ((0, 7), (7, 10), (10, 14)))
    return TrainingData(train, validation, test=test)


def the_test(seed):
    part = data(seed).test
    assert part is not None
    return part


def settings(seed, **heading):
    small = {"hidden": 5, "batch": 16, "epochs": 12, "patience": 12, "augment": {"copies": 6}, "denoised": False}
    return Settings.model_validate({"seed": seed, "samples": SAMPLES, "heading": {**small, **heading}})


@pytest.mark.slow
@pytest.mark.parametrize(
    "heading",
    [
        {"output": "cos_sin", "dropout": 0.2},
        {"output": "degrees", "dropout": 0.0, "rate_end": None, "layers": 1},
        {"output": "cos_sin", "patience": 2, "rate": 0.05},
    ],
)
def test_networks_trained_together_follow_the_trainer(heading):
    """The same draws, so the same losses epoch by epoch but for float32 sums, and the same chosen epoch."""
    own = [settings(seed, **heading) for seed in (3, 4, 5)]
    many = [data(seed) for seed in (3, 4, 5)]
    together = train_batched(own, [heading_parts(s, d, None) for s, d in zip(own, many, strict=True)])
    for k, (one, parts) in enumerate(zip(own, many, strict=True)):
        alone = train_heading(one, parts, None).progress
        for name, found in (("loss", together.loss), ("validation", together.validation), ("test", together.test)):
            expected = [entry[name] for entry in alone.history]
            assert_allclose([epoch[k] for epoch in found][: len(expected)], expected, rtol=2e-3)
        assert together.chosen["validation"].epoch[k] == alone.best_epoch


def test_the_epoch_is_kept_that_each_part_would_choose():
    own = [settings(seed, output="cos_sin") for seed in (0, 1)]
    found = train_batched(own, [heading_parts(s, data(s.seed), None) for s in own])
    test = np.array(found.test)
    assert found.chosen["test"].epoch.tolist() == (test.argmin(axis=0) + 1).tolist()
    assert found.chosen["last"].epoch.tolist() == [12, 12]
    for choice in found.chosen.values():  # the outputs kept are those of the epoch
        for k, one in enumerate(own):
            heading = np.degrees(np.arctan2(*choice.test[k].double().numpy().T[::-1]))
            error = (heading - np.degrees(the_test(one.seed).heading) + 180) % 360 - 180
            assert np.sqrt(np.mean(error**2)) == pytest.approx(test[choice.epoch[k] - 1, k], rel=1e-4)


def test_what_cannot_be_trained_together_is_refused():
    own = [settings(0), settings(0, dropout=0.3)]
    with pytest.raises(ValueError, match="differ in the seed alone"):
        train_batched(own, [heading_parts(s, data(0), None) for s in own])
    temporal = Settings.model_validate({**settings(0).model_dump(), "layout": "temporal"})
    with pytest.raises(ValueError, match="Only flattened"):
        train_batched([temporal], [heading_parts(temporal, data(0), None)])


def test_every_network_is_tested_on_its_own_recordings():
    """Swapping the test parts of two networks swaps their errors and nothing else."""
    own, many = [settings(0), settings(1)], [data(0), data(1)]
    swapped = [replace(many[0], test=many[1].test), replace(many[1], test=many[0].test)]
    first, second = (
        train_batched(own, [heading_parts(s, d, None) for s, d in zip(own, some, strict=True)])
        for some in (many, swapped)
    )
    assert first.loss == second.loss
    assert first.validation == second.validation
    assert not np.allclose(first.test, second.test)


def test_what_was_denoised_for_one_split_is_not_denoised_again(monkeypatch):
    """And is bit by bit what a denoiser without memory gives, whatever else is beside it."""
    own = Settings.model_validate(
        {"samples": SAMPLES, "denoiser": {"layers": 2, "hidden": 4}, "sampler": {"t_back": 990}}
    )
    plain = TrainedDenoiser(new_denoiser(own)[0], own, Normalisation("sequence"), Progress())
    gyro = 5e-5 * np.random.default_rng(0).standard_normal((7, SAMPLES, 3))
    expected, counted = plain.clean(gyro), []
    once = TrainedDenoiser.clean

    def counting(self, gyro_l):
        counted.append(len(gyro_l))
        return once(self, gyro_l)

    monkeypatch.setattr(TrainedDenoiser, "clean", counting)
    found = RememberingDenoiser(**vars(plain))
    assert_array_equal(found.clean(gyro[:4]), expected[:4])
    assert_array_equal(found.clean(gyro[[6, 2, 2, 5, 0]]), expected[[6, 2, 2, 5, 0]])
    assert_array_equal(found.clean(gyro[[2, 4]]), expected[[2, 4]])
    assert_array_equal(found.clean(gyro), expected)
    assert counted == [PILE, PILE, PILE]
