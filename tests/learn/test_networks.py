"""Layouts, the two networks, and where their randomness comes from."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="PyTorch comes with the extra train")

from gyronorth.learn.denoiser import Denoiser, predictor, step_embedding  # noqa: E402
from gyronorth.learn.recurrent import BiLSTM, dropout, from_layout, initialised, to_layout  # noqa: E402
from gyronorth.learn.regressor import HeadingNetwork, crmse_deg, heading_deg, precise  # noqa: E402
from gyronorth.learn.spectral_loss import spectral_loss  # noqa: E402

LAYOUTS = ["temporal", "flattened", "across_batch"]
#: For trainings: the paper's in every `make test`, the others before a release.
TRAINED = ["flattened", *(pytest.param(layout, marks=pytest.mark.long) for layout in ("temporal", "across_batch"))]
#: Of a float32 network whose outputs are of the order one.
ROUNDING = 1e-5


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


def batch(n=4, samples=20, seed=1):
    return torch.randn(n, samples, 3, generator=generator(seed))


def denoiser(layout, samples=20, seed=0, **sizes):
    return initialised(lambda: Denoiser(layout=layout, samples=samples, **sizes), generator(seed))


def heading(layout, samples=20, seed=0, **sizes):
    return initialised(lambda: HeadingNetwork(layout=layout, samples=samples, **sizes), generator(seed))


@pytest.mark.parametrize(
    ("layout", "shape"), [("temporal", (2, 3, 3)), ("flattened", (2, 1, 9)), ("across_batch", (1, 2, 9))]
)
def test_layouts(layout, shape):
    x = torch.arange(18.0).reshape(2, 3, 3)
    laid = to_layout(x, layout)
    assert laid.shape == shape
    assert torch.equal(from_layout(laid, layout), x)
    if layout != "temporal":  # channel-major: all x, then y, then z
        assert laid.reshape(2, 9)[0].tolist() == [0, 3, 6, 1, 4, 7, 2, 5, 8]


def test_a_sequence_of_one_step_is_the_lstm_itself():
    layer = initialised(lambda: BiLSTM(30, 8, single_step=True), generator())
    x = torch.randn(5, 1, 30, generator=generator(1))
    reference, _ = layer.lstm(x)
    assert torch.allclose(layer(x), reference, atol=1e-6)


def test_the_papers_sizes():
    """5 BiLSTM layers of 64 over 900 inputs, 20 embedding; 2 of 24: parameters counted by hand."""

    def lstm(inputs, hidden):
        return 2 * 4 * hidden * (inputs + hidden + 2)

    network = Denoiser(layout="flattened", samples=300)
    expected = lstm(900, 64) + 4 * lstm(128, 64) + 21 * 900 + 4 * 21 * 128 + 129 * 900
    assert sum(p.numel() for p in network.parameters()) == expected
    network = HeadingNetwork(layout="temporal", samples=300)
    assert sum(p.numel() for p in network.parameters()) == lstm(3, 24) + lstm(48, 24) + 49


def test_step_embedding_tells_every_step_apart():
    embedded = step_embedding(torch.arange(1, 1001), 20)
    assert embedded.shape == (1000, 20)
    assert torch.pdist(embedded).min() > 0.1
    assert embedded[0, 0].item() == pytest.approx(np.sin(1), abs=1e-6)
    assert embedded[0, 10].item() == pytest.approx(np.cos(1), abs=1e-6)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_only_across_batch_lets_neighbours_in(layout):
    x, t = batch(), torch.tensor([1, 50, 500, 1000])
    other = x.clone()
    other[2:] = batch(2, seed=9)
    noise, angle = denoiser(layout), heading(layout)
    same = torch.allclose(noise(x, t)[:2], noise(other, t)[:2], atol=ROUNDING)
    same_heading = torch.allclose(angle(x)[:2], angle(other)[:2], atol=ROUNDING)
    assert same == same_heading == (layout != "across_batch")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_denoiser_sees_signal_and_step(layout):
    network, x = denoiser(layout), batch()
    a = network(x, torch.full((4,), 3))
    assert a.shape == x.shape
    assert not torch.allclose(a, network(x, torch.full((4,), 900)), atol=1e-4)
    assert not torch.allclose(a, network(x + 1, torch.full((4,), 3)), atol=1e-4)


@pytest.mark.parametrize("layout", ["temporal", "flattened"])
def test_predictor_splits_without_a_trace(layout):
    network, x = denoiser(layout), batch(7).numpy()
    whole, parts = predictor(network, batch=100)(x, 40), predictor(network, batch=3)(x, 40)
    np.testing.assert_allclose(parts, whole, atol=ROUNDING)


def test_initial_weights_come_from_the_generator_alone():
    before = torch.get_rng_state()
    first, again, other = (denoiser("flattened", seed=seed).state_dict() for seed in (1, 1, 2))
    assert torch.equal(torch.get_rng_state(), before)
    assert all(torch.equal(first[key], again[key]) for key in first)
    assert not any(torch.equal(first[key], other[key]) for key in first)
    weight = first["recurrent.0.lstm.weight_ih_l0"]
    assert 0.99 / 8 < weight.abs().max() < 1 / 8  # uniform in +-1/sqrt(64)


def test_dropout_keeps_the_mean_and_draws_from_its_generator():
    x, before = torch.ones(200_000), torch.get_rng_state()
    dropped = dropout(x, 0.05, generator())
    assert torch.equal(torch.get_rng_state(), before)
    assert (dropped == 0).double().mean().item() == pytest.approx(0.05, abs=0.002)  # four sigma
    assert dropped.max().item() == pytest.approx(1 / 0.95)
    assert torch.equal(dropped, dropout(x, 0.05, generator()))
    assert torch.equal(dropout(x, 0.05, None), x)


def test_dropout_acts_in_training_only():
    network, x = heading("flattened", dropout=0.5), batch()
    assert torch.equal(network(x), network(x))
    assert not torch.allclose(network(x), network(x, generator()))


def test_crmse_by_hand_across_north():
    raw = torch.tensor([[359.0], [721.0], [-10.0]])  # errors of -2, +3 and +4 deg
    truth = torch.tensor([1.0, 358.0, 346.0])
    assert crmse_deg(raw, truth).item() == pytest.approx(np.sqrt((4 + 9 + 16) / 3), rel=1e-6)


def test_crmse_has_a_finite_gradient_at_zero_error():
    raw = torch.tensor([[10.0]], requires_grad=True)
    crmse_deg(raw, torch.tensor([10.0])).backward()
    assert raw.grad is not None
    assert torch.isfinite(raw.grad).all()


def test_cos_sin_output_points_along_the_heading():
    angle = torch.deg2rad(torch.tensor([0.0, 90.0, 200.0]))
    raw = 3 * torch.stack([torch.cos(angle), torch.sin(angle)], dim=1)
    assert torch.allclose(heading_deg(raw) % 360, torch.tensor([0.0, 90.0, 200.0]), atol=1e-4)


@pytest.mark.parametrize("layout", ["temporal", "flattened"])
def test_precise_copy_is_the_same_network(layout):
    network, x = heading(layout), batch()
    copied = precise(network)
    assert copied(x.double()).dtype == torch.float64
    assert torch.allclose(copied(x.double()).float(), network(x), atol=ROUNDING)
    assert network.head.weight.dtype == torch.float32


def learns(network, loss, *, rounds, rate, below):
    """Whether a training brings the loss below a bound within so many rounds."""
    optimiser = torch.optim.Adam(network.parameters(), lr=rate)
    for _ in range(rounds):
        optimiser.zero_grad()
        now = loss()
        if now.item() < below:
            return True
        now.backward()
        optimiser.step()
    return False


@pytest.mark.parametrize("output", [pytest.param("degrees", marks=pytest.mark.long), "cos_sin"])
@pytest.mark.parametrize("layout", TRAINED)
def test_heading_network_overfits_four_windows(layout, output):
    truth = torch.tensor([20.0, 110.0, 200.0, 290.0])
    angle = torch.deg2rad(truth)
    clean = torch.stack([torch.cos(angle), -torch.sin(angle), torch.zeros(4)], dim=1)
    x = clean[:, None] + 0.2 * batch()
    network = heading(layout, output=output, seed=3)
    assert learns(network, lambda: crmse_deg(network(x), truth), rounds=400, rate=0.02, below=2.0)


@pytest.mark.parametrize("layout", TRAINED)
def test_denoiser_overfits_four_windows(layout):
    """A constant signal with its noise: the noise is learnt by heart, from a loss near one (predicting zero)."""
    noise, t = batch(), torch.tensor([10, 300, 600, 1000])
    x = 0.9 * torch.ones(4, 1, 3) + 0.5 * noise
    network = denoiser(layout, layers=2, hidden=32, seed=3)
    assert learns(network, lambda: spectral_loss(network(x, t), noise, 0.2), rounds=200, rate=0.005, below=0.01)
