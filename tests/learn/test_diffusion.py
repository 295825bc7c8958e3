"""The noise schedule, normalisation and samplers of the denoiser, without a network."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from gyronorth.alignment.networks.diffusion import Normalisation, Sampler, Schedule, denoise, reverse, white_noise

SCHEDULE = Schedule()
PLAIN = Sampler(noise=False)


def wave(x, t):
    """A smooth stand-in for a network: depends on every input and on the step."""
    return np.sin(3 * x + 0.01 * t).astype(np.float32)


def data(n=3, samples=40, seed=0):
    rng = np.random.default_rng(seed)
    return 7e-5 * rng.standard_normal((n, 1, 3)) + 1e-5 * rng.standard_normal((n, samples, 3))


def test_schedule_by_hand():
    three = Schedule(steps=2, beta_min=0.1, beta_max=0.5)  # eq:16 at t = 1, 2: 0.3, 0.5
    assert_allclose(three.beta, [0, 0.3, 0.5], atol=1e-15)
    assert_allclose(three.alpha_bar, [1, 0.7, 0.35], atol=1e-15)
    assert_allclose(three.noise_ratio, [0, np.sqrt(0.3 / 0.7), np.sqrt(0.65 / 0.35)], atol=1e-15)


def test_the_papers_schedule_stays_far_from_noise():
    """Figures worked out in the reading of the paper: signal gain at T and at t_back; sums of the 50 steps."""
    assert SCHEDULE.beta[1] == pytest.approx(1e-4 + 4e-7)
    assert SCHEDULE.beta[-1] == pytest.approx(5e-4)
    assert np.sqrt(SCHEDULE.alpha_bar[[1000, 950]]) == pytest.approx([0.861, 0.871], abs=5e-4)
    (one,) = Sampler(jumps=1).table(SCHEDULE, 1000)
    assert one.gain == pytest.approx(1.012, abs=5e-4)
    assert one.weight == pytest.approx(0.049, abs=5e-4)
    assert one.sigma == pytest.approx(0.157, abs=1e-3)


@pytest.mark.parametrize(("steps", "low", "high"), [(0, 0.1, 0.2), (5, 0.0, 0.1), (5, 0.2, 0.1), (5, 0.2, 1.0)])
def test_impossible_schedules_are_refused(steps, low, high):
    with pytest.raises(ValueError, match="expected"):
        Schedule(steps, low, high)


def scheduler(kind):
    diffusers = pytest.importorskip(
        "diffusers", reason="diffusers, the oracle of the samplers, comes with the extra dev"
    )
    settings = {"num_train_timesteps": 1000, "trained_betas": SCHEDULE.beta[1:], "clip_sample": False}
    if kind == "chain":
        made = diffusers.DDPMScheduler(**settings, variance_type="fixed_large")
    else:
        made = diffusers.DDIMScheduler(**settings, set_alpha_to_one=True)
    made.set_timesteps(1000)
    return made


def oracle(kind, x, t_back, noise=None):
    """diffusers counts steps from 0: its step k is our t = k + 1."""
    made, x = scheduler(kind), torch.from_numpy(x)
    for k in made.timesteps[: 1000 - t_back]:
        out = torch.from_numpy(wave(x.numpy().astype(np.float32), int(k) + 1)).double()
        if kind == "ddim":
            x = made.step(out, k, x).prev_sample
            continue
        step = made.step(out, k, x, generator=torch.Generator().manual_seed(0))
        x0, abar, before = step.pred_original_sample, SCHEDULE.alpha_bar[int(k) + 1], SCHEDULE.alpha_bar[int(k)]
        beta = SCHEDULE.beta[int(k) + 1]
        x = x0 * np.sqrt(before) * beta / (1 - abar) + x * np.sqrt(1 - beta) * (1 - before) / (1 - abar)
        if noise is not None and k > 0:
            x = x + made._get_variance(k, variance_type="fixed_large").sqrt() * torch.from_numpy(noise())
    return x.numpy()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["chain", "ddim"])
@pytest.mark.parametrize("t_back", [950, 990, 0])
def test_samplers_agree_with_diffusers(kind, t_back):
    """Mean of each step from diffusers' x_0 estimate (Ho et al. 2020, eq. 7); its betas are float32, good to 1e-6."""
    x = np.random.default_rng(1).standard_normal((2, 5, 3))
    ours = reverse(wave, x, Sampler(kind=kind, t_back=t_back).table(SCHEDULE, 1000), None)
    assert_allclose(ours, oracle(kind, x, t_back), atol=2e-4 if t_back == 0 else 2e-5)


@pytest.mark.slow
def test_sampling_noise_agrees_with_diffusers():
    """The same draws in both; the variance of eq:18 is beta_t (diffusers' `fixed_large`), none at t = 1."""
    x = np.random.default_rng(1).standard_normal((2, 5, 3))
    ours_rng, their_rng = np.random.default_rng(2), np.random.default_rng(2)
    for t_back in (950, 0):
        table = Sampler(t_back=t_back).table(SCHEDULE, 1000)
        ours = reverse(wave, x, table, lambda: ours_rng.standard_normal(x.shape))
        theirs = oracle("chain", x, t_back, lambda: their_rng.standard_normal(x.shape))
        assert_allclose(ours, theirs, atol=1e-3 if t_back == 0 else 5e-5)


@given(start=st.integers(2, 1000), back=st.integers(0, 999), jumps=st.integers(1, 60))
def test_fewer_jumps_equal_the_chain_for_a_constant_prediction(start, back, jumps):
    """Holding the prediction changes nothing where it is constant anyway: every few-step chain is the chain."""
    noise = np.random.default_rng(3).standard_normal((1, 4, 3))
    x = np.ones((1, 4, 3))
    full = reverse(lambda x, t: noise, x, Sampler(t_back=back, noise=False).table(SCHEDULE, start), None)
    few = Sampler(t_back=back, noise=False, jumps=jumps).table(SCHEDULE, start)
    assert len(few) == max(0, min(jumps, start - back))
    assert_allclose(reverse(lambda x, t: noise, x, few, None), full, atol=1e-12)


def test_ddim_in_one_jump_with_the_true_noise_recovers_the_clean_signal():
    rng = np.random.default_rng(4)
    clean, noise = rng.standard_normal((2, 6, 3)), rng.standard_normal((2, 6, 3))
    for t in (1, 400, 1000):
        x_t = np.sqrt(SCHEDULE.alpha_bar[t]) * clean + np.sqrt(1 - SCHEDULE.alpha_bar[t]) * noise
        for jumps in (1, 7):
            table = Sampler(kind="ddim", t_back=0, jumps=jumps).table(SCHEDULE, t)
            assert_allclose(reverse(lambda x, t: noise, x_t, table, None), clean, atol=1e-12)


@pytest.mark.parametrize("kind", ["sample", "sequence", "channel", "dataset", "none"])
def test_normalisation_and_back(kind):
    gyro = data()
    normalisation = Normalisation(kind).recorded(gyro)
    mean, std = normalisation.moments(gyro)
    x = (gyro - mean) / std
    assert_allclose(x * std + mean, gyro, rtol=1e-12)
    axis = {"sample": 2, "sequence": (1, 2), "channel": 1, "dataset": None}.get(kind, ())
    if kind == "none":
        assert_allclose(x, np.degrees(gyro), rtol=1e-12)  # deg/s
    else:
        assert_allclose(x.mean(axis), 0, atol=1e-12)
        assert_allclose(x.std(axis), 1, rtol=1e-12)


@pytest.mark.parametrize("kind", ["sample", "sequence", "channel"])
def test_constant_data_normalise_to_zero(kind):
    gyro = np.full((2, 300, 3), 7.3e-5)
    mean, std = Normalisation(kind).moments(gyro)
    assert_allclose((gyro - mean) / std, 0, atol=1e-12)


def test_matched_step_is_the_nearest_noise_ratio():
    for t in (0, 1, 137, 1000):
        assert SCHEDULE.matched_step(SCHEDULE.noise_ratio[[t]])[0] == t
    assert SCHEDULE.matched_step(np.array([0.0, 9.0])).tolist() == [0, 1000]


def test_white_noise_is_measured_and_drift_is_not():
    """300 x 3 samples: the relative deviation of the estimate is about sqrt(3/4 / 900) x sqrt(2) = 4 %."""
    x = 0.3 * np.random.default_rng(5).standard_normal((50, 300, 3))
    drift = np.linspace(0, 5, 300)[None, :, None]
    assert_allclose(white_noise(x + drift), 0.3, rtol=0.16)
    assert white_noise(x).mean() == pytest.approx(0.3, rel=0.02)


def run(gyro, sampler, normalisation="sequence", predict=wave):
    return denoise(predict, gyro, schedule=SCHEDULE, sampler=sampler, normalisation=Normalisation(normalisation))


def test_matched_start_with_the_true_noise_gives_the_clean_signal():
    """A predictor that knows the clean signal: the matched start and t_back = 0 return it, up to the step's grid."""
    rng = np.random.default_rng(6)
    clean = np.repeat(rng.standard_normal((3, 1, 3)), 300, axis=1)
    noisy = clean + 0.3 * rng.standard_normal(clean.shape)

    def predict(x, t):
        return (x - np.sqrt(SCHEDULE.alpha_bar[t]) * clean) / np.sqrt(1 - SCHEDULE.alpha_bar[t])

    sampler = Sampler(kind="ddim", t_back=0, start="matched", jumps=1)
    out = np.stack(
        [
            denoise(
                lambda x, t, k=k: predict(x, t)[k : k + 1],
                noisy[k : k + 1],
                schedule=SCHEDULE,
                sampler=sampler,
                normalisation=Normalisation("dataset", 0.0, 1.0),
            )[0]
            for k in range(3)
        ]
    )
    assert np.abs(out - clean).max() < 1e-6  # float32 input of the predictor


def test_matched_start_leaves_a_clean_recording_alone():
    gyro = np.repeat(data(samples=1), 300, axis=1)
    assert np.array_equal(run(gyro, Sampler(start="matched", t_back=0), "dataset"), gyro)


def test_sampling_noise_has_its_size_and_does_not_depend_on_the_batch():
    gyro = data(n=4, samples=300)
    silent = run(gyro, PLAIN, predict=lambda x, t: np.zeros_like(x))
    noisy = run(gyro, Sampler(seed=3), predict=lambda x, t: np.zeros_like(x))
    std = gyro.std(axis=(1, 2))
    sigma = (noisy - silent).std(axis=(1, 2)) / std
    assert_allclose(sigma, 0.1575, rtol=0.1)  # 900 values: 2.4 % each, four sigma
    assert not np.allclose(noisy[0] - silent[0], noisy[1] - silent[1])
    alone = np.concatenate([run(one[None], Sampler(seed=3), predict=lambda x, t: np.zeros_like(x)) for one in gyro])
    assert np.array_equal(noisy, alone)
    assert np.array_equal(noisy, run(gyro, Sampler(seed=3), predict=lambda x, t: np.zeros_like(x)))
    assert not np.allclose(noisy, run(gyro, Sampler(seed=4), predict=lambda x, t: np.zeros_like(x)))


def test_sampling_noise_survives_rounding_upstream():
    gyro = data()
    assert_allclose(run(gyro * (1 + 1e-15), Sampler()), run(gyro, Sampler()), rtol=1e-6, atol=1e-12)
