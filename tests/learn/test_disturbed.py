"""Training of the proposal network: its data, that it learns, that it resumes, that it exports."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")

from gyronorth.alignment.networks.bundle import read_bundle  # noqa: E402
from gyronorth.alignment.tones.evidence import network_axes  # noqa: E402
from gyronorth.learn import disturbed  # noqa: E402
from gyronorth.learn.disturbed import DisturbedSettings, draw_batch, export_proposal, loss_of, make_bundle, train  # noqa: E402
from gyronorth.learn.proposal import Proposal  # noqa: E402

TINY = DisturbedSettings(batch=4, batches=2, epochs=3, validation=4, calibration=8, hidden=8, samples=(90, 120))


def test_labels_say_what_was_simulated():
    batch = draw_batch(DisturbedSettings(knocks=0.0), 400, samples=300, rng=np.random.default_rng(1))
    assert batch.rate.shape == (400, 300, 3)
    assert_allclose(batch.present.mean(), 0.7, atol=0.08)  # 800 draws: 5 sigma
    # One bump per 100 s of 0.3-2 s touches some 4.4 samples; those below 0.3 of the noise are not counted.
    assert 0.008 < batch.bump.mean() < 0.018
    # Bumps of 0.02 deg/s stand far out of noise of 0.0003 to 0.0014 deg/s and tones of 0.002 deg/s.
    square = (batch.rate**2).sum(dim=2)
    assert square[batch.bump > 0].median() > 20 * square[batch.bump == 0].median()
    # The strongest line of a recording with one tone is in its labelled cell, or in the next one.
    phase = 2 * np.pi * batch.index[:, None] * batch.cycles
    free = batch.rate * (batch.bump == 0)[:, :, None]
    power = sum(((free.transpose(1, 2) @ wave) ** 2).sum(dim=1) for wave in (torch.cos(phase), torch.sin(phase)))
    high = (batch.present.sum(dim=1) == 1) & (power[:, 20:].amax(dim=1) > 100 * power.median())
    label = batch.tone[torch.arange(400), batch.present.argmax(dim=1)]
    high &= label > 30  # above what settling leaks to
    assert high.sum() > 20
    near = (power[:, 20:].argmax(dim=1) + 20 - label).abs()[high] <= 2
    assert near.float().mean() > 0.95


@pytest.mark.long  # the same loss, and a whole training, below
def test_network_learns_a_batch_by_heart():
    torch.manual_seed(0)
    batch = draw_batch(TINY, 4, samples=90, rng=np.random.default_rng(0))
    network = Proposal(16)
    optimiser = torch.optim.Adam(network.parameters(), lr=0.01)
    first = loss_of(network, batch).item()
    for _ in range(150):
        optimiser.zero_grad()
        loss = loss_of(network, batch)
        loss.backward()
        optimiser.step()
        if loss.item() < 0.2 * first:
            return
    pytest.fail(f"the loss is {loss.item()}, {first} at first")


def test_axes_and_signs_of_a_bump_do_not_matter():
    torch.manual_seed(1)
    network, batch = Proposal(8), draw_batch(TINY, 3, samples=90, rng=np.random.default_rng(2))
    with torch.no_grad():
        bump = network(batch.rate, batch.index, batch.cycles)[0]
        swapped = network(batch.rate[:, :, [2, 0, 1]], batch.index, batch.cycles)[0]
    assert_allclose(swapped.numpy(), bump.numpy(), atol=1e-5)


@pytest.mark.slow
def test_interrupted_training_ends_in_the_same_weights(tmp_path):
    class Killed(Exception):
        pass

    def kill(progress):
        if progress.epoch == 2:
            raise Killed

    whole, _ = train(TINY)
    with pytest.raises(Killed):
        train(TINY, checkpoint=tmp_path / "proposal.pt", report=kill)
    resumed, progress = train(TINY, checkpoint=tmp_path / "proposal.pt")
    assert progress.epoch == 3
    for name, value in whole.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name]), name


@pytest.mark.slow
@pytest.mark.parametrize("samples", [90, 301, 900])
def test_exported_network_is_the_same(tmp_path, samples):
    onnxruntime = pytest.importorskip("onnxruntime")
    torch.manual_seed(2)
    network = Proposal(8)
    export_proposal(network, tmp_path / "p.onnx", rate_hz=3.0)
    session = onnxruntime.InferenceSession(tmp_path / "p.onnx", providers=["CPUExecutionProvider"])
    index, cycles = network_axes(samples, 3.0)
    rate = np.random.default_rng(0).normal(0, 3, (2, samples, 3)).astype(np.float32)
    exported = session.run(None, {"rate": rate, "index": index, "cycles": cycles})
    with torch.no_grad():
        ours = network(torch.as_tensor(rate), torch.as_tensor(index), torch.as_tensor(cycles))
    for a, b in zip(exported, ours, strict=True):
        assert_allclose(a, b.numpy(), atol=2e-4)  # float32 sums over up to 900 samples


@pytest.mark.slow
def test_bundle_is_whole_and_remade_alike(tmp_path):
    pytest.importorskip("onnxruntime")
    made = make_bundle(tmp_path / "learned", TINY)
    assert sorted(p.name for p in (tmp_path / "learned").iterdir()) == ["README.md", "bundle.json", "proposal.onnx"]
    assert read_bundle(tmp_path / "learned") == made
    assert made.domain.window == 30.0
    assert made.proposal is not None
    assert made.proposal.sigma_scale > 0
    assert "Remake" in (tmp_path / "learned" / "README.md").read_text()
    again = make_bundle(tmp_path / "other", TINY)
    assert json.loads(again.to_json())["metrics"] == json.loads(made.to_json())["metrics"]


def test_shipped_bundle_was_made_with_the_default_settings():
    bundle = read_bundle(disturbed.__file__.replace("learn/disturbed.py", "bundles/learned"))
    expected = json.loads(json.dumps(vars(disturbed.DEFAULT)))
    assert bundle.training == expected
    assert bundle.metrics["epochs"] == disturbed.DEFAULT.epochs
