"""Allan deviation, identification of error terms, and the profile of a recording."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import stats

from gyronorth.allan import allan_deviation, characterise, deviation, identification, identified_sensor, identify
from gyronorth.allan.characterisation import with_turn_on_bias
from gyronorth.allan.deviation import allan_variance, degrees_of_freedom, octaves
from gyronorth.allan.identification import AllanFit
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.earth import EARTH_RATE, earth_rate_n
from gyronorth.errors import InputError
from gyronorth.pipeline import heading
from gyronorth.recording import Gap, Recording
from gyronorth.sensor import Sensor, TriadErrors, read_sensor, write_sensor
from gyronorth.sensor.gauss_markov import gauss_markov_allan_variance
from gyronorth.sensor.law import NoiseLaw
from gyronorth.simulation import sensor_errors, simulate, simulate_batch

LATITUDE = np.radians(32.11)
#: Angle random walk of most tests: 0.02 deg/sqrt(h).
ARW = 0.02 * DEG_PER_SQRT_HOUR


def series(errors: TriadErrors, runs: int, n: int, rate_hz: float, *, seed: int) -> np.ndarray:
    """`runs` independent axes of simulated errors, shape (n, runs)."""
    drawn = sensor_errors(errors, (-(-runs // 3), n), rate_hz, rng=np.random.default_rng(seed))
    return drawn.transpose(1, 0, 2).reshape(n, -1)[:, :runs]


def at_least(probability: float, trials: int) -> float:
    """Share of successes that is undercut once in a thousand times."""
    return stats.binom.ppf(1e-3, trials, probability) / trials


# --- deviation: closed forms ---


def test_four_samples_by_hand():
    # Rates 1 3 2 6 1 1 1 1 1 1 at 2 Hz; m = 1: half the mean square of the differences 2 -1 4 -5 0 0 0 0 0
    # is 46 / 18; m = 2: pair means 2 2.5 4 3.5 1 1 1 1 1, differences two apart 2 1 -3 -2.5 0 0 0.
    x = [1, 3, 2, 6, 1, 1, 1, 1, 1, 1]
    found = allan_deviation(x, rate_hz=2, taus=[0.5, 1.0])
    assert_allclose(found.deviation, np.sqrt([46 / 18, (4 + 1 + 9 + 6.25) / 14]), rtol=1e-14)
    assert_allclose(found.tau, [0.5, 1.0])
    assert found.n == 10


def test_linear_drift_is_rate_times_tau_over_root_two():
    slope, rate_hz = 3e-7, 20.0
    found = allan_deviation(slope * np.arange(5000) / rate_hz + 0.1, rate_hz=rate_hz)
    assert_allclose(found.deviation, slope * found.tau / np.sqrt(2), rtol=1e-6)


def test_sine_follows_its_closed_form():
    # Over whole periods the estimate is exact: A^2 sin^4(pi f tau) / (m sin(pi f / rate))^2, and 0 at tau = 1 / f.
    rate_hz, frequency, n = 100.0, 0.5, 200 * 400
    x = 2.0 * np.sin(2 * np.pi * frequency * np.arange(n) / rate_hz + 0.3)
    m = np.array([1, 10, 50, 100, 150])
    expected = 2.0 * np.sin(np.pi * frequency * m / rate_hz) ** 2 / (m * np.sin(np.pi * frequency / rate_hz))
    # A window of n + 1 - 2 m second differences is not a whole number of periods: below 300 / 80000 of error.
    assert_allclose(allan_deviation(x, rate_hz=rate_hz, taus=m / rate_hz).deviation, expected, rtol=4e-3)
    null = allan_deviation(x, rate_hz=rate_hz, taus=[1 / frequency]).deviation
    assert null[0] < 1e-9


@pytest.mark.parametrize(
    ("errors", "power"), [(TriadErrors(white=2.0), -0.5), (TriadErrors(white=1e-3, random_walk=2.0), 0.5)]
)
def test_white_noise_falls_and_a_walk_rises_with_the_root_of_tau(errors, power):
    # N / sqrt(tau) and K sqrt(tau / 3). 60 axes; relative error of a variance sqrt(2 / (60 dof)), bound at 4 of it.
    x = series(errors, 60, 4096, 10.0, seed=1)
    m = np.array([16, 64, 256])
    found = allan_deviation(x, rate_hz=10.0, taus=m / 10)
    coefficient = 2.0 if power < 0 else 2.0 / np.sqrt(3)
    ratio = np.mean(found.deviation**2, axis=1) / (coefficient * found.tau**power) ** 2
    bound = 4 * np.sqrt(2 / (60 * degrees_of_freedom(m, 4096, 2 * power)))
    assert (np.abs(ratio - 1) < bound).all()


# --- deviation: other software, properties ---


@pytest.mark.parametrize("kind", ["white", "offset", "drift", "walk"])
def test_allantools_agrees(kind):
    import allantools

    rng = np.random.default_rng(5)
    noise = rng.standard_normal(100_000)
    x = {
        "white": noise,
        "offset": noise + 1e6,
        "drift": noise + np.linspace(0, 1e3, len(noise)),
        "walk": np.cumsum(noise),
    }[kind]
    found = allan_deviation(x, rate_hz=100.0)
    tau, theirs, _, _ = allantools.oadev(x, rate=100.0, data_type="freq", taus=found.tau)
    assert_allclose(found.tau, tau, rtol=1e-12)
    assert_allclose(found.deviation, theirs, rtol=1e-9)


@pytest.mark.parametrize("chunk", [7, 64, 1000])
def test_chunks_do_not_show(chunk, monkeypatch):
    x = np.random.default_rng(2).standard_normal(1001)
    m = [1, 2, 6, 7, 8, 63, 64, 65, 200, 499, 500]
    whole = allan_variance(x, m)
    monkeypatch.setattr(deviation, "CHUNK", chunk)
    assert_allclose(allan_variance(x, m), whole, rtol=1e-12)


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(10, 300),
    scale=st.floats(1e-6, 1e6),
    offset=st.floats(-100, 100),
)
def test_scale_passes_through_and_offset_does_not(seed, n, scale, offset):
    x = np.random.default_rng(seed).standard_normal(n)
    plain = allan_deviation(x, rate_hz=3.0)
    other = allan_deviation(scale * (x + offset), rate_hz=3.0)
    for name in ("deviation", "low", "high"):
        assert_allclose(getattr(other, name), scale * getattr(plain, name), rtol=1e-9)


def test_axes_are_columns():
    x = np.random.default_rng(3).standard_normal((500, 3))
    together = allan_deviation(x, rate_hz=10)
    assert together.deviation.shape == together.low.shape == together.high.shape == (len(together.tau), 3)
    for k in range(3):
        assert_allclose(together.high[:, k], allan_deviation(x[:, k], rate_hz=10).high, rtol=1e-12)


def test_bounds_hold_the_truth_as_often_as_they_say():
    # 300 axes; the table's degrees of freedom are good to some 10 %, which moves 95 % by less than 1 %.
    rate_hz, n = 10.0, 1024
    tau = np.array([4, 16, 64, 128, 256]) / rate_hz
    cases = (TriadErrors(white=1.0), TriadErrors(flicker=1.0, flicker_longest=1e5), TriadErrors(random_walk=1.0))
    for seed, errors in enumerate(cases):
        found = allan_deviation(series(errors, 300, n, rate_hz, seed=seed), rate_hz=rate_hz, taus=tau)
        truth = np.sqrt(NoiseLaw(errors).allan_variance(tau).sum(axis=-1))[:, None]
        share = ((found.low <= truth) & (truth <= found.high)).mean(axis=1)
        assert (share >= at_least(0.94, 300)).all()
        assert (share <= 1 - at_least(0.02, 300)).all()


def test_one_averaging_time_alone_counts_as_white():
    x = np.random.default_rng(4).standard_normal(1000)
    found = allan_deviation(x, rate_hz=1.0, taus=[50.0])
    dof = degrees_of_freedom(50, 1000, -1)
    assert_allclose(found.high, found.deviation * np.sqrt(dof / stats.chi2.ppf(0.025, dof)))
    assert_allclose(found.low, found.deviation * np.sqrt(dof / stats.chi2.ppf(0.975, dof)))


# --- deviation: refusals ---


@pytest.mark.parametrize(
    ("x", "taus", "words"),
    [
        (np.zeros(9), None, ["9 samples", "at least 10"]),
        (np.r_[np.zeros(20), np.nan, np.zeros(20)], None, ["1 of 41", "10 s", "unbroken"]),
        (np.zeros(100), [60.0], ["60 s", "25 s", "half"]),
        (np.zeros(100), [0.1], ["0.1 s", "0.5 to 25 s"]),
        (np.zeros(100), [np.nan], ["taus"]),
        (np.zeros((2, 20, 3)), None, ["(2, 20, 3)", "(n, axes)"]),
    ],
)
def test_refusals_say_what_came_and_what_is_needed(x, taus, words):
    with pytest.raises(InputError) as caught:
        allan_deviation(x, rate_hz=2.0, taus=taus)
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_rate_must_be_positive():
    with pytest.raises(InputError, match="rate_hz"):
        allan_deviation(np.zeros(100), rate_hz=0.0)


def test_import_leaves_scipy_alone():
    code = "import sys, gyronorth.allan; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# --- the model ---


@pytest.mark.parametrize("ratio", [1e-3, 0.0099, 0.0101, 0.5, 3.0, 40.0])
def test_gauss_markov_variance_is_the_integral_of_its_covariance(ratio):
    # V(tau) = 2 int (1 - u) exp(-r u) du over u in [0, 1], and sigma^2 = 2 V(tau) - 2 V(2 tau), by quadrature.
    node, weight = np.polynomial.legendre.leggauss(80)
    u, du = (node + 1) / 2, weight / 2
    integral = np.sum(4 * (1 - u) * np.exp(-ratio * u) * -np.expm1(-ratio * u) * du)
    assert_allclose(gauss_markov_allan_variance(ratio, 1.0), integral, rtol=2e-9)
    assert_allclose(gauss_markov_allan_variance(5 * ratio, 5.0), integral, rtol=2e-9)


def test_flicker_of_the_model_is_flat_at_0_664():
    tau = np.geomspace(2, 150, 30)
    assert_allclose(
        np.sqrt(NoiseLaw(TriadErrors(flicker=1.0)).allan_variance(tau).sum(axis=-1)),
        np.sqrt(2 * np.log(2) / np.pi),
        rtol=0.02,
    )


@pytest.mark.parametrize(("k", "slope", "within"), [(1, -1, 0.05), (2, 0, 0.2), (3, 1, 0.2)])
def test_covariance_has_the_degrees_of_freedom_of_the_table(k, slope, within):
    n = 20_000
    m = octaves(n, 0.1)[4:]
    fit = AllanFit(m, np.ones(len(m)), n, 10.0, axes=1, flicker_longest=1e5)
    fit.model_error = 0.0
    square = np.eye(4)[k]
    dof = 2 * (fit.columns @ square) ** 2 / np.diag(fit.covariance(square))
    assert_allclose(dof, degrees_of_freedom(m, n, slope), rtol=within)


def test_covariance_has_the_correlation_of_simulated_estimates():
    # 600 axes: a correlation is known to 0.04 at most; bound 4 of that.
    n, rate_hz = 2048, 10.0
    m = octaves(n, 0.1)
    for seed, errors in enumerate((TriadErrors(white=1.0), TriadErrors(white=1.0, random_walk=0.2))):
        x = series(errors, 600, n, rate_hz, seed=seed)
        drawn = np.corrcoef([allan_variance(column, m) for column in x.T], rowvar=False)
        fit = AllanFit(m, np.ones(len(m)), n, rate_hz, axes=1, flicker_longest=1000.0)
        fit.model_error = 0.0
        covariance = fit.covariance(np.array([0, errors.white**2, 0, errors.random_walk**2]))
        scale = np.sqrt(np.diag(covariance))
        assert_allclose(covariance / np.outer(scale, scale), drawn, atol=0.17)


# --- identification ---


def test_white_noise_alone_is_identified_and_the_rest_bounded():
    found = identify(series(TriadErrors(white=ARW), 1, 36_000, 10.0, seed=1)[:, 0], rate_hz=10.0)
    assert found.angle_random_walk.status == "identified"
    assert_allclose(found.angle_random_walk.value, ARW, rtol=0.03)
    assert found.bias_instability.status == found.rate_random_walk.status == "upper bound"
    # One hour: the flat part of 0.664 B at 100 s cannot be far above N / sqrt(100).
    assert 0 < found.bias_instability.high < 2 * ARW / np.sqrt(100) / 0.664


def test_quantisation_is_told_from_white_noise():
    rng = np.random.default_rng(4)
    n, rate_hz, step = 60_000, 100.0, 2e-6  # noise of 0.6 steps a sample: rounding errors are independent
    angle = np.cumsum(2 * ARW * rng.standard_normal(n) / np.sqrt(rate_hz) + 3e-7)
    x = np.diff(np.round(angle / step) * step) * rate_hz
    found = identify(x, rate_hz=rate_hz)
    assert found.quantisation.status == "identified"
    assert found.quantisation.low <= step <= found.quantisation.high
    assert_allclose(found.angle_random_walk.value, 2 * ARW, rtol=0.03)


def test_three_axes_are_one_sensor_known_better():
    x = series(TriadErrors(white=ARW), 3, 1200, 10.0, seed=6)
    spread = [found.angle_random_walk for found in (identify(x[:, 0], rate_hz=10), identify(x, rate_hz=10))]
    one, three = (term.high - term.low for term in spread)
    assert 1.2 < one / three < 2.5  # about sqrt(3)


def test_coefficients_scale_with_the_data():
    x = series(TriadErrors(white=1.0, flicker=1.0), 1, 5000, 10.0, seed=7)[:, 0]
    one, other = identify(x, rate_hz=10.0), identify(1e-7 * x + 1e-5, rate_hz=10.0)
    for term in ("angle_random_walk", "bias_instability", "rate_random_walk", "quantisation"):
        for end in ("value", "low", "high"):
            assert_allclose(getattr(getattr(other, term), end), 1e-7 * getattr(getattr(one, term), end), rtol=1e-4)


def test_vibration_and_filters_are_cut_off_not_fitted():
    rng = np.random.default_rng(8)
    n, rate_hz = 60_000, 100.0
    time = np.arange(n) / rate_hz
    x = ARW * np.sqrt(rate_hz) * rng.standard_normal(n) + 20 * ARW * np.sin(2 * np.pi * 7.3 * time)
    found = identify(x, rate_hz=rate_hz)
    assert found.tau[0] > 1 / 7.3
    # Left of the line is its tail, 1 / tau^2: quantisation takes that.
    assert_allclose(found.angle_random_walk.value, ARW, rtol=0.1)


def test_what_does_not_follow_the_model_is_not_identified():
    rng = np.random.default_rng(9)
    time = np.arange(30_000) / 10.0
    swaying = sum(np.sin(2 * np.pi * time / period) for period in (11.0, 300.0))
    found = identify(50 * ARW * swaying + ARW * rng.standard_normal(len(time)), rate_hz=10.0)
    assert found.misfit > 0.3
    for term in (found.angle_random_walk, found.bias_instability, found.rate_random_walk):
        assert term.status == "not identified"
        assert term.high > ARW


def test_deviation_of_the_model_passes_through_the_data():
    x = series(TriadErrors(white=ARW, flicker=DEG_PER_HOUR), 3, 36_000, 10.0, seed=10)
    found, curve = identify(x, rate_hz=10.0), allan_deviation(x, rate_hz=10.0, taus=[0.1, 1.0, 10.0, 100.0])
    mean = np.sqrt(np.mean(curve.deviation**2, axis=1))
    # Scatter of the data at 100 s: 125 degrees of freedom on three axes, 6.3 % of a deviation; at 3.29 sigma 21 %.
    assert np.all(np.abs(found.deviation(curve.tau) / mean - 1) < [0.1, 0.1, 0.1, 0.21])


@pytest.mark.parametrize(
    ("x", "words"),
    [
        (np.random.default_rng(1).standard_normal(100), ["100 samples", "10 s", "160 samples", "60 s"]),
        (np.random.default_rng(1).standard_normal(500), ["500 samples", "50 s", "longer"]),
        (np.full(2000, 0.25), ["does not vary", "0.25"]),
        (np.r_[np.zeros(1000), np.inf], ["1 of 1001"]),
    ],
)
def test_identification_refuses(x, words):
    with pytest.raises(InputError) as caught:
        identify(x, rate_hz=10.0)
    assert all(word in str(caught.value) for word in words), str(caught.value)


def coverage(errors: TriadErrors, runs: int, n: int, rate_hz: float, *, seed: int) -> dict[str, np.ndarray]:
    """Error terms found in `runs` records: rows value, low, high of each term."""
    found = [identify(column, rate_hz=rate_hz) for column in series(errors, runs, n, rate_hz, seed=seed).T]
    return {
        field: np.array([[getattr(f, term).value, getattr(f, term).low, getattr(f, term).high] for f in found]).T
        for term, field in (
            ("angle_random_walk", "white"),
            ("bias_instability", "flicker"),
            ("rate_random_walk", "random_walk"),
        )
    }


@pytest.mark.slow
def test_intervals_of_short_records_hold_the_truth():
    # 40 records of 100 s; the long test below is the thorough one.
    errors = TriadErrors(white=1.0, flicker=2.0)
    for field, (_, low, high) in coverage(errors, 40, 300, 3.0, seed=15).items():
        truth = getattr(errors, field)
        assert np.mean((low <= truth) & (truth <= high)) >= at_least(0.95, 40), field


@pytest.mark.long  # its small form stands above
@pytest.mark.parametrize(
    ("white", "flicker", "random_walk"),
    [(1.2, 0, 0), (1.2, 1.0, 0), (1.2, 0, 0.1), (0, 0, 1.0)],
)
@pytest.mark.parametrize(("n", "rate_hz"), [(300, 3.0), (6000, 20.0)])
def test_intervals_hold_the_truth_as_often_as_they_say(white, flicker, random_walk, n, rate_hz):
    # 150 records of 100 and 300 s. At a term's true value of 0 the interval must hold 0 in 95 %.
    errors = TriadErrors(white=white, flicker=flicker, random_walk=random_walk)
    for field, (_, low, high) in coverage(errors, 150, n, rate_hz, seed=11).items():
        truth = getattr(errors, field)
        assert np.mean((low <= truth) & (truth <= high)) >= at_least(0.95, 150), field


@pytest.mark.long  # its small form stands above
@pytest.mark.parametrize(("b_deg_h", "b_within"), [(1.0, 0.10), (0.3, 0.30), (0.1, None)])
def test_one_hour_identifies_what_the_issue_asks(b_deg_h, b_within):
    # One hour at 100 Hz, 50 axes, N = 0.02 deg/sqrt(h).
    errors = TriadErrors(white=ARW, flicker=b_deg_h * DEG_PER_HOUR)
    found = []
    for part in range(10):  # five axes at a time, for memory
        found += [identify(x, rate_hz=100.0) for x in series(errors, 5, 360_000, 100.0, seed=20 + part).T]
    white = np.array([f.angle_random_walk.value for f in found]) / errors.white
    assert np.sqrt(np.mean((white - 1) ** 2)) < 0.01
    assert all(f.angle_random_walk.status == "identified" for f in found)
    terms = [f.bias_instability for f in found]
    held = np.mean([t.low <= errors.flicker <= t.high for t in terms])
    assert held >= at_least(0.95, 50)
    if b_within is not None:
        ratio = np.array([t.value for t in terms]) / errors.flicker
        assert np.sqrt(np.mean((ratio - 1) ** 2)) < b_within
        assert np.mean([t.status == "identified" for t in terms]) >= 0.9
    else:
        # An upper bound in nearly all, and that above the truth in at least 97.5 % (two-sided 95 %).
        assert np.mean([t.status == "upper bound" for t in terms]) >= 0.9
        assert np.mean([errors.flicker <= t.high for t in terms]) >= at_least(0.975, 50)


# --- the profile of a recording ---


def still(errors: TriadErrors, bias: np.ndarray, *, n: int = 9000, rate_hz: float = 5.0, seed: int = 1) -> Recording:
    """A level recording that points north, with a constant gyro bias (3,), rad/s."""
    rng = np.random.default_rng(seed)
    gyro = earth_rate_n(LATITUDE) + bias + sensor_errors(errors, (1, n), rate_hz, rng=rng)[0]
    accel = np.array([0.0, 0.0, -9.7946]) + 1e-3 * rng.standard_normal((n, 3))
    return Recording(gyro, accel, rate_hz, latitude=LATITUDE, source="bench.csv")


BIAS = np.array([0.8, -1.0, 0.6]) * DEG_PER_HOUR


@pytest.mark.slow
def test_profile_is_written_and_read_back(tmp_path):
    found = characterise(still(TriadErrors(white=ARW, flicker=DEG_PER_HOUR), BIAS))
    write_sensor(found.sensor, tmp_path / "mine.json")
    again = read_sensor(tmp_path / "mine.json")
    assert_allclose(again.gyro.white, ARW, rtol=0.05)
    assert_allclose(again.gyro.turn_on_bias, found.sensor.gyro.turn_on_bias, rtol=1e-9)
    assert again.name == "bench"
    assert "bench.csv" in again.source


@pytest.mark.slow
def test_what_is_not_identified_stands_as_its_bound():
    found = characterise(still(TriadErrors(white=ARW), BIAS))
    gyro, triad = found.sensor.gyro, found.gyro.triad
    assert triad.bias_instability.status == "upper bound"
    assert gyro.flicker >= triad.bias_instability.high > 0
    assert gyro.random_walk >= triad.rate_random_walk.high > 0
    assert gyro.quantisation == 0.0
    assert any("bias instability is an upper bound" in note for note in found.notes)


def test_the_worst_axis_counts():
    record = still(TriadErrors(white=ARW), BIAS)
    gyro = record.gyro_b.copy()
    gyro[:, 2] += 9 * ARW * np.sqrt(5.0) * np.random.default_rng(2).standard_normal(len(gyro))
    found = characterise(Recording(gyro, None, 5.0, latitude=LATITUDE))
    assert found.sensor.gyro.white > 0.95 * np.sqrt(82) * ARW  # its lower end; the mean of squares is sqrt(28) ARW
    assert found.accel is None


@pytest.mark.slow
def test_base_supplies_what_allan_deviation_cannot_see():
    base = Sensor(
        "base",
        TriadErrors(white=1.0, turn_on_bias=7e-6, scale_factor=1e-4, flicker_longest=500.0, saturation=7.0),
        TriadErrors(turn_on_bias=1e-3, misalignment=1e-3),
        g_sensitivity=1e-8,
    )
    sensor = characterise(still(TriadErrors(white=ARW), BIAS), base=base, name="unit 7").sensor
    assert sensor.name == "unit 7"
    assert (sensor.gyro.turn_on_bias, sensor.gyro.scale_factor, sensor.gyro.saturation) == (7e-6, 1e-4, 7.0)
    assert (sensor.accel.turn_on_bias, sensor.accel.misalignment, sensor.g_sensitivity) == (1e-3, 1e-3, 1e-8)
    assert sensor.gyro.flicker_longest == 500.0
    assert sensor.gyro.white < 2 * ARW


@pytest.mark.slow
@pytest.mark.parametrize("latitude", [LATITUDE, np.radians(-60.0), None])
def test_inferred_turn_on_bias_claims_95_percent_for_another_axis(latitude):
    # The heading's error is the bias along east, unseen. Over 2000 units |b_east| <= 1.96 x the profile's figure
    # in 95 %: binomial bounds at 3.3 sigma. Attitude is level, any heading; biases of 0.5 deg/h against 15.
    rng = np.random.default_rng(13)
    true_latitude = LATITUDE if latitude is None else latitude
    inside = []
    for direction in rng.uniform(0, 2 * np.pi, 2000):
        bias_n = 0.5 * DEG_PER_HOUR * rng.standard_normal(3)
        rate_n = earth_rate_n(true_latitude) + bias_n
        c, s = np.cos(direction), np.sin(direction)
        rate_b = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ rate_n
        sensor, _ = with_turn_on_bias(Sensor("", TriadErrors()), rate_b, np.array([0.0, 0.0, -9.8]), latitude)
        inside.append(abs(bias_n[1]) <= 1.959964 * sensor.gyro.turn_on_bias)
    assert 0.95 - 0.016 < np.mean(inside) < 0.95 + 0.016


@pytest.mark.long
def test_heading_with_the_identified_profile_holds_the_truth():
    # 40 units of half an hour each; the profile of each from its own recording, the heading from its first 5 minutes.
    truth = Sensor(
        "truth",
        TriadErrors(white=ARW, flicker=0.3 * DEG_PER_HOUR, turn_on_bias=DEG_PER_HOUR),
        TriadErrors(white=1e-3, flicker=1e-4, turn_on_bias=2e-3),
    )
    rng = np.random.default_rng(14)
    headings = rng.uniform(0, 2 * np.pi, 40)
    gyro, accel = simulate_batch(
        truth, runs=40, latitude=LATITUDE, heading=headings, roll=0.05, pitch=-0.1, duration=1800, rate_hz=2.0, rng=rng
    )
    assert accel is not None
    inside, valid = [], []
    for gyro_b, accel_b, expected in zip(gyro, accel, headings, strict=True):
        recording = Recording(gyro_b, accel_b, 2.0, latitude=LATITUDE)
        estimate = heading(recording.window(0, 300), sensor=identified_sensor(recording), method="mean")
        low, high = estimate.interval95
        inside.append((expected - low) % (2 * np.pi) <= (high - low) % (2 * np.pi))
        valid.append(estimate.valid)
    assert np.mean(inside) >= at_least(0.95, 40)
    assert np.mean(valid) >= at_least(0.99, 40)


@pytest.mark.slow
def test_accelerometer_bias_is_inferred_from_gravity():
    record = still(TriadErrors(white=ARW), BIAS)
    biased = Recording(record.gyro_b, record.accel_b - [0, 0, 0.01], 5.0, latitude=LATITUDE)
    assert_allclose(characterise(biased).sensor.accel.turn_on_bias, 6.483 * 0.01, rtol=0.05)


def test_gaps_are_refused_with_the_window_to_use():
    record = still(TriadErrors(white=ARW), BIAS)
    broken = Recording(record.gyro_b, record.accel_b, 5.0, gaps=(Gap(100.0, 10), Gap(1500.0, 4)), source="bench.csv")
    with pytest.raises(InputError, match=r"bench\.csv has 2 gap\(s\), 14 samples.*102:1500 s"):
        characterise(broken)


def test_accelerometer_that_does_not_vary_is_left_out():
    record = still(TriadErrors(white=ARW), BIAS)
    constant = np.tile([0.0, 0.0, -9.7946], (len(record.gyro_b), 1))
    found = characterise(Recording(record.gyro_b, constant, 5.0, latitude=LATITUDE))
    assert found.accel is None
    assert any("does not vary" in note for note in found.notes)


@pytest.mark.slow
def test_json_is_plain_and_in_the_units_of_profiles():
    found = characterise(still(TriadErrors(white=ARW, flicker=DEG_PER_HOUR), BIAS))
    document = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert document["schema"] == "gyronorth.allan/1"
    term = document["gyro"]["triad"]["angle_random_walk_deg_sqrt_h"]
    assert_allclose(term["value"], 0.02, rtol=0.05)
    assert term["low"] < term["value"] < term["high"]
    walk = document["gyro"]["triad"]["rate_random_walk_deg_h_sqrt_h"]
    assert walk["value"] is None
    assert walk["status"] == "upper bound"
    assert len(document["gyro"]["deviation_deg_h"]) == len(document["gyro"]["tau_s"])
    assert_allclose(document["turn_on_bias_deg_h"] * DEG_PER_HOUR, found.sensor.gyro.turn_on_bias)


@pytest.mark.slow
def test_earth_rate_units():
    # A unit without errors pointing anywhere: nothing is left for the bias but the noise of the mean.
    found = characterise(still(TriadErrors(white=ARW), np.zeros(3)))
    assert found.sensor.gyro.turn_on_bias < 10 * ARW / np.sqrt(1800.0) < 0.02 * EARTH_RATE


def test_shortest_record_is_stated():
    assert identification.FEWEST_SAMPLES * identification.LONGEST_PART >= 2 ** (identification.FEWEST_OCTAVES - 1)


def test_a_record_that_repeats_itself_is_refused():
    x = np.tile(np.random.default_rng(8).normal(0, 1e-4, 1 << 12), 20)
    with pytest.raises(InputError, match=r"repeats itself every 40.96 s or a whole part of that"):
        identify(x, rate_hz=100.0)


@pytest.mark.slow
def test_a_bound_is_marked_in_the_profile_and_told_by_heading(tmp_path):
    """Ten minutes do not identify the drift of a fibre-optic gyro: the file says so, and so does every heading."""
    recording = simulate("isa100c", latitude=0.84, heading=1.0, duration=600, rate_hz=5, rng=np.random.default_rng(1))
    found = characterise(recording, name="mine").sensor
    write_sensor(found, tmp_path / "mine.json")
    again = read_sensor(tmp_path / "mine.json")
    assert again.bounds == found.bounds
    assert "gyro.bias_instability_deg_h" in again.bounds
    assert "gyro.angle_random_walk_deg_sqrt_h" not in again.bounds
    told = {warning.code: warning.message for warning in heading(recording, sensor=again, method="mean").warnings}
    assert "gyro.bias_instability_deg_h" in told["profile_bounds"]
    (tmp_path / "wrong.json").write_text((tmp_path / "mine.json").read_text().replace('"gyro.bias_', '"gyro.biass_'))
    with pytest.raises(InputError, match=r"did you mean gyro\.bias_instability_deg_h"):
        read_sensor(tmp_path / "wrong.json")
