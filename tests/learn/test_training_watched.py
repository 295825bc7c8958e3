"""What the training loop gives its networks and optimiser, seen by spies: the tests of `plant_faults`."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch", reason="PyTorch comes with the extra train")

from gyronorth.alignment.networks.diffusion import Normalisation  # noqa: E402
from gyronorth.angles import wrap  # noqa: E402
from gyronorth.earth import EARTH_RATE  # noqa: E402
from gyronorth.learn import recurrent, stages  # noqa: E402
from gyronorth.learn.data import HeadingSet, TrainingData, synthetic_set  # noqa: E402
from gyronorth.learn.denoiser import Denoiser  # noqa: E402
from gyronorth.learn.regressor import HeadingNetwork  # noqa: E402
from gyronorth.learn.settings import HeadingSettings, Settings, baseline  # noqa: E402
from gyronorth.learn.stages import TrainedDenoiser, train_denoiser, train_heading  # noqa: E402
from gyronorth.learn.training import Progress  # noqa: E402
from gyronorth.published import model_based  # noqa: E402

SAMPLES = 8


def settings(*, heading=None, **parts):
    small = {"hidden": 3, "epochs": 3, "denoised": False, "augment": {"copies": 5}}
    tree = {"samples": SAMPLES, "sampler": {"t_back": 0}, "synthetic": {"headings": 40}}
    return Settings.model_validate({**tree, "heading": {**small, **(heading or {})}, **parts})


def recordings(n, seed):
    clean = synthetic_set(headings=n, latitude=radians(32), samples=SAMPLES)
    noise = 1e-6 * np.random.default_rng(seed).standard_normal(clean.gyro_l.shape)
    return HeadingSet(clean.gyro_l + noise, clean.heading + seed, clean.recording)


def data(n=6):
    return TrainingData(recordings(n, 0), recordings(3, 1), test=recordings(4, 2))


class SpyDenoiser(torch.nn.Module):
    """Keeps what it is given; its answer is a weight, at first `answer`."""

    def __init__(self, answer):
        super().__init__()
        self.answer, self.seen = torch.nn.Parameter(answer.clone()), []

    def forward(self, x, t):
        self.seen.append((torch.is_inference_mode_enabled(), x.detach().clone(), t.clone()))
        return self.answer.expand(x.shape)


@pytest.fixture
def denoiser_seen(monkeypatch):
    """Train a spy with a known disturbance in the place of noise: (noise, training, what it was given, x_0)."""
    noise = torch.from_numpy(np.random.default_rng(3).standard_normal((1, SAMPLES, 3))).float()
    spy = SpyDenoiser(noise[0])
    monkeypatch.setattr(stages, "new_denoiser", lambda _settings: (spy, torch.Generator().manual_seed(0)))
    clean = (recordings(30, 0), recordings(9, 1))
    one = settings(
        schedule={"steps": 3, "beta_min": 0.2, "beta_max": 0.8},
        normalisation="none",
        denoiser={"loss": "mse", "epochs": 4, "batch": 10},
    )
    trained = train_denoiser(one, clean, disturbance=noise)
    return noise[0], trained, spy.seen, [np.degrees(part.gyro_l) for part in clean]


@pytest.mark.slow
def test_the_denoiser_is_given_signal_and_noise_with_the_gains_of_eq_17(denoiser_seen):
    """beta = 0.4, 0.6, 0.8: abar = 0.6, 0.24, 0.048."""
    noise, _, seen, x_0 = denoiser_seen
    abar = torch.tensor([1.0, 0.6, 0.24, 0.048])
    for validating, x, t in seen:
        rest = (x - torch.sqrt(1 - abar[t])[:, None, None] * noise) / torch.sqrt(abar[t])[:, None, None]
        known = torch.from_numpy(x_0[int(validating)]).float()
        nearest = torch.cdist(rest.flatten(1), known.flatten(1)).min(dim=1).values
        assert nearest.max() < 1e-5


def test_steps_are_uniform_on_1_to_T(denoiser_seen):
    _, _, seen, _ = denoiser_seen
    steps = torch.cat([t for validating, _, t in seen if not validating])
    assert len(steps) == 120
    assert [int((steps == t).sum()) > 20 for t in range(-1, 5)] == [False, False, True, True, True, False]


def test_what_the_denoiser_learns_is_the_noise(denoiser_seen):
    """A network that answers with the noise itself has nothing to learn."""
    _, trained, _, _ = denoiser_seen
    assert all(entry["loss"] == entry["validation"] == 0 for entry in trained.progress.history)


def test_training_noise_is_drawn_anew_and_validation_noise_once(monkeypatch):
    spy = SpyDenoiser(torch.zeros(SAMPLES, 3))
    monkeypatch.setattr(stages, "new_denoiser", lambda _settings: (spy, torch.Generator().manual_seed(0)))
    train_denoiser(settings(denoiser={"epochs": 2, "batch": 30}), (recordings(30, 0), recordings(9, 1)))
    trained, checked = ([x for validating, x, _ in spy.seen if validating == which] for which in (False, True))
    assert len(trained) == len(checked) == 2
    assert torch.equal(checked[0], checked[1])
    assert torch.cdist(trained[0].flatten(1), trained[1].flatten(1)).min() > 0.01


@pytest.mark.parametrize("layout", ["flattened", "temporal", "across_batch"])
@pytest.mark.parametrize("layer", range(3))
def test_the_step_reaches_every_layer_of_the_denoiser(layout, layer):
    """With the projections of all other layers at zero the step still moves the output."""
    network = Denoiser(layout=layout, samples=SAMPLES, layers=3, hidden=4)
    for k, project in enumerate(network.project):
        torch.nn.init.constant_(project.weight, float(k == layer))
        torch.nn.init.zeros_(project.bias)
    x = torch.ones(2, SAMPLES, 3)
    early, late = (network(x, torch.full((2,), t)) for t in (1, 900))
    assert (early - late).abs().max() > 1e-5


@pytest.mark.parametrize("layout", ["flattened", "temporal"])
@pytest.mark.parametrize("layers", [1, 2, 3])
def test_dropout_is_behind_every_layer_of_the_heading_network(layout, layers):
    """Between the layers and before the head (III-D), written out."""
    network = HeadingNetwork(layout=layout, samples=SAMPLES, layers=layers, hidden=4, dropout=0.5)
    x = torch.rand(5, SAMPLES, 3)
    h, generator = recurrent.to_layout(x, layout), torch.Generator().manual_seed(1)
    for layer in network.recurrent:
        h = layer(h)
        h = h * (torch.rand(h.shape, generator=generator) >= 0.5) / 0.5
    h = h[:, 0] if layout == "flattened" else torch.cat([h[:, -1, :4], h[:, 0, 4:]], dim=1)
    assert_allclose(
        network(x, torch.Generator().manual_seed(1)).detach(), network.head(h).detach(), rtol=1e-5, atol=1e-6
    )


@pytest.fixture
def heading_seen(monkeypatch):
    """A heading network that keeps what it is given: (inference, dropout asked for, input, output)."""
    seen = []

    class Spy(HeadingNetwork):
        def forward(self, x, generator=None):
            raw = super().forward(x, generator)
            seen.append((torch.is_inference_mode_enabled(), generator is not None, x.clone(), raw.detach().clone()))
            return raw

    monkeypatch.setattr(stages, "HeadingNetwork", Spy)
    return seen


def given(seen, *, training):
    return np.concatenate([x.numpy() for inference, _, x, _ in seen if inference != training])


def test_the_loss_is_taken_with_dropout_and_validation_without(heading_seen):
    train_heading(settings(heading={"dropout": 0.4}), data(), None)
    assert {(inference, dropout) for inference, dropout, _, _ in heading_seen} == {(False, True), (True, False)}


def test_the_rate_decays_by_epoch_as_eq_23(monkeypatch):
    """From 0.08 to 0.01 in three epochs: 0.08, 0.04, 0.02, the same for every batch of an epoch."""
    rates = []

    class Watched(torch.optim.Adam):
        def step(self, *given, **named):
            rates.append([group["lr"] for group in self.param_groups])
            return super().step(*given, **named)

    monkeypatch.setattr(torch.optim, "Adam", Watched)
    train_heading(settings(heading={"rate": 0.08, "rate_end": 0.01, "batch": 15, "patience": 9}), data(), None)
    assert_allclose(np.array(rates), np.repeat([0.08, 0.04, 0.02], 2)[:, None])
    rates.clear()
    train_heading(settings(heading={"rate": 0.08, "rate_end": None, "batch": 15, "patience": 9}), data(), None)
    assert_allclose(np.array(rates), 0.08)


class Doubling(TrainedDenoiser):
    """A denoiser that doubles what it is given."""

    def clean(self, gyro_l):
        return 2 * gyro_l


def test_every_part_goes_through_the_denoiser(heading_seen):
    own, one = data(), settings()
    doubling = Doubling(stages.new_denoiser(one)[0], one, Normalisation(), Progress())
    train_heading(settings(heading={"denoised": True, "epochs": 1, "augment": {"copies": 1}}), own, doubling)
    assert own.test is not None
    expected = np.concatenate([own.validation.gyro_l, own.test.gyro_l])
    assert_allclose(given(heading_seen, training=False), 2 * expected / EARTH_RATE, rtol=1e-6)
    found, wanted = given(heading_seen, training=True), 2 * own.train.gyro_l / EARTH_RATE
    assert_allclose(np.sort(found.ravel()), np.sort(wanted.ravel()), rtol=1e-6)


@pytest.mark.parametrize("span", [0.0, 35.0, 180.0])
def test_copies_span_what_the_settings_say(heading_seen, span):
    own = replace(data(), train=recordings(1, 0))
    train_heading(settings(heading={"epochs": 1, "augment": {"copies": 5, "span_deg": span}}), own, None)
    turned = wrap(model_based(given(heading_seen, training=True)) - model_based(own.train.gyro_l))
    wanted = np.radians(np.linspace(-span, span, 5))
    assert_allclose(np.sort(np.cos(turned)), np.sort(np.cos(wanted)), atol=1e-6)
    assert_allclose(np.sort(np.sin(turned)), np.sort(np.sin(wanted)), atol=1e-6)


@pytest.mark.parametrize("batch", [7, 32])
def test_batches_have_the_size_of_the_settings_and_cover_every_copy_once(heading_seen, batch):
    train_heading(settings(heading={"epochs": 1, "batch": batch}), data(8), None)
    assert [len(x) for inference, _, x, _ in heading_seen if not inference] == {7: [7] * 5 + [5], 32: [32, 8]}[batch]
    assert len(np.unique(given(heading_seen, training=True)[:, 0, 0])) == 40


def test_the_baseline_is_that_of_ii_b():
    """No denoiser, dropout or decay; rate, epochs and batch of the public notebook."""
    own = HeadingSettings().model_dump() | {"dropout": 0.0, "denoised": False, "rate": 0.0015, "rate_end": None}
    assert baseline().heading.model_dump() == own | {"batch": 100, "epochs": 500, "patience": 100}
    assert baseline().model_dump(exclude={"heading"}) == Settings().model_dump(exclude={"heading"})


@pytest.mark.parametrize(("output", "wide"), [("degrees", 1), ("cos_sin", 2)])
def test_the_output_is_that_of_the_settings(heading_seen, output, wide):
    """A vector's heading is atan2 of its second and first part, in training and in use."""
    trained = train_heading(settings(heading={"output": output, "rate": 1e-9}), data(), None)
    assert {raw.shape[1] for *_, raw in heading_seen} == {wide}
    raw = trained.network(torch.from_numpy(data().train.gyro_l / EARTH_RATE)).detach().double().numpy()
    expected = np.radians(raw[:, 0]) if wide == 1 else np.arctan2(raw[:, 1], raw[:, 0])
    assert_allclose(wrap(trained.headings(data().train.gyro_l) - expected), 0, atol=1e-5)
    error = np.degrees(wrap(expected - data().train.heading))
    alone = train_heading(
        settings(heading={"output": output, "rate": 1e-9, "dropout": 0.0, "epochs": 1, "augment": {"copies": 1}}),
        data(),
        None,
    )
    assert alone.progress.history[0]["loss"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-4)
