"""One suite for every method of the catalogue (after scikit-learn's `check_estimator`)."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.alignment import registry
from gyronorth.alignment.judging import GATES
from gyronorth.alignment.networks.bundle import read_bundle, shipped_bundle
from gyronorth.angles import angle_error, wrap_heading
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.pipeline import heading, heading_batch
from gyronorth.recording import Recording
from gyronorth.sensor import Sensor, TriadErrors, read_sensor
from gyronorth.simulation import Motion, simulate
from gyronorth.streaming import StreamingHeading

LATITUDE = np.radians(32.11)
NAMES = tuple(registry.METHODS)
#: Bundles of the paper are trained for 3 Hz and the sdc500.
SENSOR, RATE = "sdc500", 3.0
#: A half turn, in the middle, of recordings for `turned`.
HALF_TURN = Motion(turns=((50.0, 10.0, np.pi),))


@cache
def recorded(name: str, *, seed: int = 5, sensor: str = SENSOR, psi: float = 0.0, rate_hz: float = RATE) -> Recording:
    """A recording that the method is made for, whose body heads for 1 rad + psi at the end."""
    motion = HALF_TURN if name == "turned" else None
    rng = np.random.default_rng(seed)
    start = 1.0 + psi + (np.pi if name == "turned" else 0.0)
    return simulate(sensor, latitude=LATITUDE, heading=start, duration=110.0, rate_hz=rate_hz, rng=rng, motion=motion)


def info(name):
    return registry.METHODS.info(name)


def skip_what_needs_onnxruntime(name):
    if info(name).takes_bundle:
        pytest.importorskip("onnxruntime")


@pytest.fixture(params=NAMES)
def name(request):
    skip_what_needs_onnxruntime(request.param)
    return request.param


def test_the_catalogue_and_the_classes_agree(name):
    assert registry.METHODS[name].info == info(name)
    assert set(info(name).gates) <= set(GATES)


@pytest.mark.slow
def test_it_answers_what_it_is_made_for(name):
    recording = recorded(name)
    estimate = heading(recording, sensor=SENSOR, method=name)
    assert estimate.heading is not None
    assert estimate.method == (name if name != "auto" else "posterior")
    off = float(angle_error(recording.heading_true, estimate.heading))
    assert abs(off) < 4 * estimate.sigma


def test_a_given_attitude_is_used_or_refused(name):
    recording = recorded(name)
    if not info(name).takes_attitude:
        with pytest.raises(InputError, match="Roll and pitch were given"):
            heading(recording, sensor=SENSOR, method=name, attitude=(0.3, 0.1))
        return
    estimate = heading(recording, sensor=SENSOR, method=name, attitude=(0.3, 0.1))
    assert_allclose((estimate.roll, estimate.pitch), (0.3, 0.1))


def test_turn_angles_are_used_or_refused(name):
    recording = recorded(name)
    if name == "turned":
        exact = heading(recording, sensor=SENSOR, method=name, turn_angles=[np.pi])
        bent = heading(recording, sensor=SENSOR, method=name, turn_angles=[np.pi - 0.1])
        assert abs(angle_error(exact.poses[0].heading, exact.heading)) == pytest.approx(np.pi, abs=1e-2)
        assert exact.poses[0].heading != bent.poses[0].heading
        return
    with pytest.raises(InputError, match="Turn angles"):
        heading(recording, sensor=SENSOR, method=name, turn_angles=[np.pi])


@pytest.mark.parametrize("method", ["auto", "turned"])
def test_turn_angles_and_an_attitude_do_not_go_together(method):
    with pytest.raises(InputError, match="and pitch were given") as told:
        heading(recorded("turned"), sensor=SENSOR, method=method, turn_angles=[np.pi], attitude=(0.0, 0.0))
    assert "one pose only" not in str(told.value)


@pytest.mark.slow
@pytest.mark.parametrize(
    "terms", [{}, {"flicker": 1e-6}, {"turn_on_bias": 2e-5}, {"random_walk": 1e-8}, {"white": 1e-4}]
)
def test_a_profile_with_zero_terms_gives_a_number_or_an_input_error(name, terms):
    """Today's faults: `bayes` ended in a traceback, `turned` erred by tens of degrees."""
    sensor = Sensor("with zeros", TriadErrors(**terms))
    recording = recorded(name)
    try:
        estimate = heading(recording, sensor=sensor, method=name)
    except InputError:
        return
    if estimate.heading is None:
        assert estimate.reasons
        return
    assert np.isfinite([estimate.heading, estimate.sigma]).all()
    off = abs(float(angle_error(recording.heading_true, estimate.heading)))
    assert not estimate.valid or off < max(4 * estimate.sigma, 1e-6)
    if name == "turned":  # two poses bear any bias: what is left is noise and drift of the sdc500
        assert off < np.radians(30.0)


@pytest.mark.slow
def test_a_batch_gives_what_its_recordings_give(name):
    kinds = [recorded(name, seed=seed) for seed in (1, 2)]
    if name == "auto":
        swayed = Motion(disturbance="sway")
        rng = np.random.default_rng(8)
        kinds.append(
            simulate(SENSOR, latitude=LATITUDE, heading=2.0, duration=110, rate_hz=RATE, rng=rng, motion=swayed)
        )
        kinds.append(recorded("turned"))
    gyro, accel = np.stack([r.gyro_b for r in kinds]), np.stack([r.accel_b for r in kinds])
    batch = heading_batch(gyro, accel, rate_hz=RATE, latitude=LATITUDE, sensor=SENSOR, method=name)
    for index, recording in enumerate(kinds):
        single = heading(recording, latitude=LATITUDE, sensor=SENSOR, method=name)
        assert batch.method[index] == single.method
        assert_allclose(batch.heading[index], single.heading, rtol=0, atol=1e-9)
        assert_allclose(batch.sigma[index], single.sigma, rtol=1e-9)
        assert_allclose((batch.low[index], batch.high[index]), single.interval95, rtol=0, atol=1e-9)
        assert batch.valid[index] == single.valid


@pytest.mark.slow
def test_a_stream_gives_what_the_file_gives(name):
    recording = recorded(name, sensor=SENSOR)
    stream = StreamingHeading(rate_hz=RATE, latitude=LATITUDE, accelerometer=True, sensor=SENSOR, method=name)
    for start in range(0, len(recording.gyro_b), 37):
        stream.add(recording.gyro_b[start : start + 37], recording.accel_b[start : start + 37])
    streamed, read = stream.estimate(), heading(recording, sensor=SENSOR, method=name)
    assert streamed.method == read.method
    assert streamed.valid == read.valid
    assert_allclose(streamed.heading, read.heading, rtol=0, atol=1e-9)
    assert_allclose(streamed.interval95, read.interval95, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_float32_lists_and_read_only_arrays_are_taken(name):
    recording = recorded(name)
    expected = heading(recording, sensor=SENSOR, method=name)
    frozen_gyro, frozen_accel = recording.gyro_b.copy(), recording.accel_b.copy()
    frozen_gyro.flags.writeable = frozen_accel.flags.writeable = False
    forms = [
        (frozen_gyro, frozen_accel, 1e-12),
        (recording.gyro_b.tolist(), recording.accel_b.tolist(), 1e-12),
        # float32 rounds a rate of 1e-4 rad/s by 6e-12: nothing beside a sigma of degrees
        (recording.gyro_b.astype(np.float32), recording.accel_b.astype(np.float32), 1e-3),
    ]
    for gyro_b, accel_b, within in forms:
        found = heading(gyro_b, accel_b=accel_b, rate_hz=RATE, latitude=LATITUDE, sensor=SENSOR, method=name)
        assert abs(angle_error(found.heading, expected.heading)) <= within
    assert (frozen_gyro == recording.gyro_b).all()


@pytest.mark.slow
@pytest.mark.parametrize("psi", [0.7, -2.0])
def test_turning_the_body_turns_the_heading(name, psi):
    """The same noise in the turned body: only networks, trained on headings, turn within their own error."""
    recording = recorded(name)
    c, s = np.cos(psi), np.sin(psi)
    turned = recording.rotated([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    before, after = (heading(r, sensor=SENSOR, method=name) for r in (recording, turned))
    off = float(angle_error(after.heading, wrap_heading(before.heading + psi)))
    within = 3 * before.sigma if info(name).gates and name in ("paper", "baseline") else 2e-3
    assert abs(off) <= within


@pytest.mark.slow
@pytest.mark.parametrize("method", ["bayes", "learned"])
def test_a_knock_is_motion_to_a_method_that_leaves_out_bumps(method):
    """Once 40 of 40 were valid, and a third of the intervals missed. Half of the knock is 0.75 deg off the mean."""
    skip_what_needs_onnxruntime(method)
    recording = knocked("isa100c", np.radians([0.0, 1.5, 0.0]), np.random.default_rng(1))
    assert "motion" in {reason.code for reason in heading(recording, sensor="isa100c", method=method).reasons}


@pytest.mark.slow
@pytest.mark.parametrize(("runs", "most"), [(3, 1), pytest.param(40, 7, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "sensor", ["isa100c", *(pytest.param(name, marks=pytest.mark.long) for name in ("hg9900", "sdc500"))]
)
def test_a_knocked_unit_is_refused_or_covered(name, sensor, runs, most):
    """A knock of 1.5 deg about any axis, at any time: more of 95 % intervals miss in 0.7 % of series, and in 0.07 %."""
    if name in ("paper", "baseline") and sensor != SENSOR:
        pytest.skip("the bundle is trained for one sensor")
    if name == "bayes" and runs < 40:
        pytest.skip("3 s for each; the test before holds its gate")
    rng = np.random.default_rng(20261128)
    missed = valid = 0
    for _ in range(runs):
        axis = rng.standard_normal(3)
        recording = knocked(sensor, axis / np.linalg.norm(axis) * np.radians(1.5), rng)
        estimate = heading(recording, sensor=sensor, method="auto" if name == "turned" else name)
        if estimate.valid:
            valid += 1
            low, high = estimate.interval95
            inside = (recording.heading_true - low) % (2 * np.pi) <= (high - low) % (2 * np.pi) or high - low >= 6.28
            missed += not inside
    assert missed <= most, f"{missed} of {valid} valid intervals miss"


def knocked(sensor, angle_b, rng) -> Recording:
    """110 s of a level unit that turns by a rotation vector within 1 s, with the heading that it has at the end."""
    from gyronorth.attitude import mat_bn, rotation
    from gyronorth.earth import earth_rate_n

    samples, when = round(110 * RATE), rng.uniform(0.1, 0.9)
    true = rng.uniform(0, 2 * np.pi)
    before = mat_bn(0.0, 0.0, true)
    after = rotation(-angle_b) @ before
    first = round(when * samples)
    share = np.clip((np.arange(samples) + 0.5 - first) / RATE, 0, 1)
    mat = np.where((share > 0.5)[:, None, None], after, before)
    rate = mat @ earth_rate_n(LATITUDE)
    inside = (np.arange(samples) >= first) & (np.arange(samples) < first + round(RATE))
    rate[inside] += angle_b * RATE / inside.sum()
    force = mat @ np.array([0.0, 0.0, -STANDARD_GRAVITY])
    still = simulate(sensor, latitude=LATITUDE, heading=0.0, duration=110, rate_hz=RATE, rng=rng)
    own_rate = still.gyro_b - earth_rate_n(LATITUDE)
    own_force = still.accel_b - still.accel_b.mean(axis=0)
    heading_end = np.arctan2(after[0, 1], after[0, 0])
    return Recording(rate + own_rate, force + own_force, RATE, latitude=LATITUDE, heading_true=float(heading_end))


@pytest.mark.slow
def test_its_json_is_valid_against_the_schema(name):
    jsonschema = pytest.importorskip("jsonschema")
    from gyronorth.schemas import read_schema

    document = json.loads(json.dumps(heading(recorded(name), sensor=SENSOR, method=name).to_json(), allow_nan=False))
    jsonschema.validate(document, read_schema("heading-1"))


def test_its_budget_adds_up_to_sigma(name):
    estimate = (
        heading(recorded(name, sensor="isa100c", rate_hz=10.0), sensor="isa100c", method=name)
        if not info(name).takes_bundle or name == "learned"
        else heading(recorded(name), sensor=SENSOR, method=name)
    )
    together = np.sqrt(sum(part**2 for part in estimate.sigma_parts.values()))
    # The von Mises law adds (sigma^2 / 2) of itself to first order.
    assert_allclose(together, estimate.sigma, rtol=0.02 + estimate.sigma**2)


def mixed(seed, *, duration) -> Recording:
    """An isa100c under the reference mix of disturbances."""
    motion, rng = Motion(disturbance="mixed"), np.random.default_rng(seed)
    return simulate("isa100c", latitude=LATITUDE, heading=1.0, duration=duration, rate_hz=RATE, rng=rng, motion=motion)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", [None, SENSOR])
def test_a_mixture_has_a_budget_of_its_own(sensor):
    """Once sigma 0.93 stood beside "noise 7.21": the terms were those of a method that did not answer."""
    pytest.importorskip("onnxruntime")
    rng = np.random.default_rng(3)
    recording = simulate(
        "isa100c",
        latitude=LATITUDE,
        heading=1.0,
        duration=200,
        rate_hz=RATE,
        rng=rng,
        motion=Motion(disturbance="mixed"),
    )
    for name in ("learned", "bayes"):
        estimate = heading(replace(recording, accel_b=None), sensor=sensor, method=name)
        together = np.sqrt(sum(part**2 for part in estimate.sigma_parts.values()))
        assert_allclose(together, estimate.sigma, rtol=1e-6)
        assert set(estimate.sigma_parts) <= {"noise", "drift", "turn_on_bias", "levelling", "model"}


def test_the_interval_of_a_mixture_stays_skewed():
    """The ends are those that the method found, not half the width to either side."""
    pytest.importorskip("onnxruntime")
    skewed = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        recording = simulate(
            "isa100c",
            latitude=LATITUDE,
            heading=1.0,
            duration=60,
            rate_hz=RATE,
            rng=rng,
            motion=Motion(disturbance="mixed"),
        )
        estimate = heading(recording, sensor="isa100c", method="learned")
        low, high = (float(angle_error(end, estimate.heading)) for end in estimate.interval95)
        skewed += abs(high + low) > 0.01 * (high - low)
    assert skewed >= 3


def test_what_the_fit_of_turns_knows_reaches_the_user():
    recording = recorded("turned", sensor="stim300", rate_hz=25.0)
    estimate = heading(recording, sensor="stim300", method="turned")
    errors = estimate.sensor_errors
    assert errors is not None
    document = estimate.to_json()
    assert_allclose(np.radians(document["gyro_bias_sigma_deg_h"]) / 3600, errors.bias_sigma)
    assert_allclose(np.array(document["scale_factor_ppm"]) * 1e-6, errors.scale_factor)
    assert all(sigma > 0 for sigma in (*errors.bias_sigma, *errors.scale_factor_sigma))
    # two poses tell the horizontal bias far better than the profile does
    assert max(errors.bias_sigma[:2]) < read_sensor("stim300").gyro.turn_on_bias


def test_the_shipped_bundles_are_of_their_methods():
    for name in NAMES:
        if info(name).takes_bundle:
            assert read_bundle(shipped_bundle(name)).method == name
