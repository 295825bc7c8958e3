"""The spectral-filter loss: its value, its true gradient, and its degenerate inputs."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="PyTorch comes with the extra train")

from gyronorth.learn.spectral_loss import spectral_filter, spectral_loss  # noqa: E402


def noise(n, samples, seed=0, dtype=torch.float64):
    return torch.randn(n, samples, 3, dtype=dtype, generator=torch.Generator().manual_seed(seed))


def by_svd(m, tau):
    """eq:19-21 as written, differentiated by autograd through the SVD."""
    u, s, vt = torch.linalg.svd(m, full_matrices=False)
    return u @ torch.diag_embed(torch.where(s > tau * s[..., :1], s, torch.zeros_like(s))) @ vt


@pytest.mark.parametrize("tau", [0.0, 0.5, 0.8, 0.9, 0.95])
def test_value_and_gradient_agree_with_autograd_through_the_svd(tau):
    m, target = noise(20, 300).requires_grad_(), noise(20, 300, seed=1)
    (ours,) = torch.autograd.grad(spectral_loss(m, target, tau), m)
    reference = torch.mean((by_svd(m, tau) - by_svd(target, tau)) ** 2)
    (theirs,) = torch.autograd.grad(reference, m)
    assert spectral_loss(m, target, tau).item() == pytest.approx(reference.item(), rel=1e-12)
    assert torch.linalg.norm(ours - theirs) < 1e-9 * torch.linalg.norm(theirs)


def test_holding_the_projector_constant_would_be_another_gradient():
    """What the true gradient is for: without the projector's own derivative it is wrong by more than half."""
    m, target = noise(20, 300).requires_grad_(), torch.zeros(20, 300, 3, dtype=torch.float64)
    target[:] = noise(20, 300, seed=1)
    (ours,) = torch.autograd.grad(spectral_loss(m, target, 0.95), m)
    kept = spectral_filter(m, 0.95)
    values, vectors = torch.linalg.eigh(m.detach().mT @ m.detach())
    keep = (values > 0.95**2 * values[..., -1:]).double()
    projector = (vectors * keep[..., None, :]) @ vectors.mT
    held = 2 * (kept - spectral_filter(target, 0.95)) @ projector / m.numel()
    assert torch.linalg.norm(ours - held) > 0.5 * torch.linalg.norm(ours)


@pytest.mark.slow
@pytest.mark.parametrize("tau", [0.0, 0.6, 0.9])
def test_gradient_by_finite_differences(tau):
    assert torch.autograd.gradcheck(lambda x: spectral_filter(x, tau), (noise(3, 12, seed=2).requires_grad_(),))


def test_float32_gradient_is_the_float64_one():
    m = noise(20, 300)
    grads = []
    for dtype in (torch.float32, torch.float64):
        x = m.to(dtype).requires_grad_()
        grads.append(torch.autograd.grad(spectral_loss(x, noise(20, 300, seed=1).to(dtype), 0.9), x)[0].double())
    assert torch.linalg.norm(grads[0] - grads[1]) < 1e-4 * torch.linalg.norm(grads[1])


def test_all_zero_gives_zero_and_lets_the_gradient_through():
    m = torch.zeros(2, 30, 3, requires_grad=True)
    target = noise(2, 30, dtype=torch.float32)
    spectral_loss(m, target, 0.5).backward()
    assert torch.equal(spectral_filter(m, 0.5), torch.zeros_like(m))
    assert m.grad is not None
    expected = -2 * target / target.numel()
    assert torch.allclose(m.grad, expected, atol=1e-7)  # the target is filtered in float32


def test_equal_singular_values_are_all_kept_with_the_identity_gradient():
    q, _ = torch.linalg.qr(noise(1, 30)[0])
    m = (5 * q)[None].requires_grad_()
    weight = noise(1, 30, seed=3)
    (spectral_filter(m, 0.99) * weight).sum().backward()
    assert torch.allclose(spectral_filter(m, 0.99), m, atol=1e-12)
    assert m.grad is not None
    assert torch.allclose(m.grad, weight, atol=1e-12)


def test_a_kept_and_a_dropped_value_close_together_give_a_bounded_gradient():
    u, _ = torch.linalg.qr(noise(1, 30)[0])
    s = torch.tensor([1.0, 0.9 + 1e-9, 0.9 - 1e-9], dtype=torch.float64)
    m = (u * s)[None].requires_grad_()
    (spectral_filter(m, 0.9) * noise(1, 30, seed=3)).sum().backward()
    assert m.grad is not None
    assert torch.isfinite(m.grad).all()
    assert m.grad.abs().max() < 1e5  # the true one is of the order 1e9


def test_the_filter_drops_what_it_should():
    """Singular values 4, 3, 1 by construction: tau 0.26 drops the last, tau 0.76 the last two."""
    q, _ = torch.linalg.qr(noise(1, 30)[0])
    m = (q * torch.tensor([4.0, 3.0, 1.0]))[None]
    for tau, rank in ((0.24, 3), (0.26, 2), (0.74, 2), (0.76, 1)):
        assert int(torch.linalg.matrix_rank(spectral_filter(m, tau)[0])) == rank


def test_white_noise_passes_a_threshold_of_0_8_almost_untouched():
    """Reading 4 of the paper: S_3/S_1 of 300 white samples is above 0.80 in 99 %, about 0.89 in the median."""
    m = noise(2000, 300, seed=4)
    ratio = torch.linalg.svdvals(m)
    ratio = ratio[:, 2] / ratio[:, 0]
    assert ratio.median().item() == pytest.approx(0.89, abs=0.01)
    untouched = (spectral_filter(m, 0.8) - m).abs().amax((1, 2)) < 1e-12
    assert untouched.double().mean().item() == pytest.approx(0.99, abs=0.01)
