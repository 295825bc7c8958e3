"""Profiles: their figures, their units, their errors; the law of the in-run bias."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.errors import InputError
from gyronorth.sensor import (
    FLICKER_SPACING,
    Sensor,
    TriadErrors,
    flicker_components,
    profiles,
    read_sensor,
    sensor_names,
    write_sensor,
)

MINIMAL = {"schema": "gyronorth.sensor/1", "name": "test", "gyro": {}}
DEG = np.pi / 180


def write(tmp_path, content):
    path = tmp_path / "profile.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def variance_of_mean(variance, tau, duration):
    """Of a stationary Gauss-Markov process over `duration`, as DESIGN and the theory page have it."""
    return 2 * variance * tau / duration**2 * (duration - tau * (1 - np.exp(-duration / tau)))


def test_built_in_profiles_cover_the_classes_and_read_by_any_case():
    assert sensor_names() == (
        "adis16495", "blueseis-3a", "bmi088", "hg1700", "hg4930", "hg9900", "isa100c", "kvh-1750", "kvh-1775", "ln-200",
        "mti-600", "sdc500", "stim300", "vn-100",
    )  # fmt: skip
    for name in sensor_names():
        sensor = read_sensor(name)
        assert sensor.name == name == read_sensor(name.upper()).name
        assert profiles.builtin(name) == profiles.parse(profiles.builtin_text(name), where=name)  # checked here alone
        assert min(sensor.gyro.white, sensor.gyro.turn_on_bias) > 0
        assert (sensor.accel.white > 0) == (name != "blueseis-3a"), "it has no accelerometer"
        assert len(sensor.source) > 100, "a profile says where its figures come from"
        assert "ot verified" in sensor.source or "assumption" in sensor.source, "and which could not be verified"
    assert read_sensor(sensor) is sensor


def test_sdc500_in_si_by_hand():
    sensor = read_sensor("sdc500")
    assert_allclose(sensor.gyro.white, np.radians(0.02) / 60, rtol=1e-12)
    assert_allclose(sensor.gyro.flicker, np.radians(1.0) / 3600, rtol=1e-12)
    assert_allclose(sensor.accel.white, 100e-6 * 9.80665, rtol=1e-12)
    assert_allclose(sensor.accel.flicker, 0.15e-3 * 9.80665, rtol=1e-12)


def test_sdc500_turn_on_bias_and_in_run_mean_make_1_2_deg_per_hour_over_230_s():
    gyro = read_sensor("sdc500").gyro
    in_run = variance_of_mean(*flicker_components(gyro), 230.0).sum()
    assert_allclose(np.sqrt(gyro.turn_on_bias**2 + in_run) / DEG_PER_HOUR, 1.2, rtol=1e-4)
    assert_allclose(np.sqrt(in_run) / DEG_PER_HOUR, 0.978, atol=5e-4)


def test_every_key_has_the_unit_in_its_name(tmp_path):
    gyro = {
        "angle_random_walk_deg_sqrt_h": (1, "white", DEG / 60),
        "bias_instability_deg_h": (1, "flicker", DEG / 3600),
        "bias_instability_longest_s": (500, "flicker_longest", 500),
        "rate_random_walk_deg_h_sqrt_h": (1, "random_walk", DEG / 3600 / 60),
        "turn_on_bias_deg_h": (1, "turn_on_bias", DEG / 3600),
        "scale_factor_ppm": (1, "scale_factor", 1e-6),
        "misalignment_mrad": (1, "misalignment", 1e-3),
        "quantisation_arcsec": (1, "quantisation", DEG / 3600),
        "range_deg_s": (1, "saturation", DEG),
    }
    accel = {
        "velocity_random_walk_m_s_sqrt_h": (1, "white", 1 / 60),
        "bias_instability_mg": (1, "flicker", 9.80665e-3),
        "acceleration_random_walk_mg_sqrt_h": (1, "random_walk", 9.80665e-3 / 60),
        "turn_on_bias_mg": (1, "turn_on_bias", 9.80665e-3),
        "scale_factor_ppm": (1, "scale_factor", 1e-6),
        "misalignment_mrad": (1, "misalignment", 1e-3),
        "quantisation_m_s": (1, "quantisation", 1),
        "range_g": (1, "saturation", 9.80665),
    }
    content = MINIMAL | {
        part: {key: value for key, (value, _, _) in table.items()} | {"bias_instability_definition": "coefficient"}
        for part, table in (("gyro", gyro), ("accel", accel))
    }
    content["gyro"]["g_sensitivity_deg_h_g"] = 1
    sensor = read_sensor(write(tmp_path, content))
    for table, triad in ((gyro, sensor.gyro), (accel, sensor.accel)):
        for key, (_, field, expected) in table.items():
            assert_allclose(getattr(triad, field), expected, rtol=1e-12, err_msg=key)
    assert_allclose(sensor.g_sensitivity, DEG / 3600 / 9.80665, rtol=1e-12)


def test_noise_density_is_the_other_unit_of_velocity_random_walk(tmp_path):
    density = read_sensor(write(tmp_path, MINIMAL | {"accel": {"velocity_random_walk_ug_sqrt_hz": 100}}))
    walk = read_sensor(write(tmp_path, MINIMAL | {"accel": {"velocity_random_walk_m_s_sqrt_h": 0.0588399}}))
    assert_allclose(density.accel.white, walk.accel.white, rtol=1e-6)


def test_allan_minimum_is_converted_to_the_coefficient(tmp_path):
    def flicker(definition):
        gyro = {"bias_instability_deg_h": 0.664, "bias_instability_definition": definition}
        return read_sensor(write(tmp_path, MINIMAL | {"gyro": gyro})).gyro.flicker / DEG_PER_HOUR

    assert_allclose(flicker("coefficient"), 0.664, rtol=1e-12)
    assert_allclose(flicker("allan_minimum"), 1.0, rtol=5e-4)  # 0.664 is 0.66428 rounded
    assert_allclose(profiles.ALLAN_MINIMUM, 0.6643, atol=5e-5)


values = st.floats(0, 10).filter(lambda v: v == 0 or v > 1e-20)
triads = st.builds(
    TriadErrors,
    white=values,
    flicker=values,
    flicker_longest=st.floats(0.1, 1e5),
    random_walk=values,
    turn_on_bias=values,
    scale_factor=values,
    misalignment=values,
    quantisation=values,
    saturation=st.one_of(st.just(np.inf), st.floats(1e-9, 1e3)),
)


@pytest.mark.slow
@given(gyro=triads, accel=triads, g_sensitivity=values, source=st.text(max_size=40))
@settings(max_examples=60)
def test_a_written_sensor_reads_back_the_same(tmp_path_factory, gyro, accel, g_sensitivity, source):
    source = source.encode("utf-8", "ignore").decode()
    sensor = Sensor("unit 7", gyro, accel, g_sensitivity * 1e-3, source)
    path = tmp_path_factory.mktemp("round") / "trip.json"
    write_sensor(sensor, path)
    again = read_sensor(path)
    assert (again.name, again.source) == (sensor.name, sensor.source)
    for part in ("gyro", "accel"):
        ours, theirs = (dataclasses.astuple(getattr(s, part)) for s in (sensor, again))
        assert_allclose(theirs, ours, rtol=1e-12)
    assert_allclose(again.g_sensitivity, sensor.g_sensitivity, rtol=1e-12)
    assert [entry.name for entry in path.parent.iterdir()] == ["trip.json"]  # nothing left beside it


def test_a_sensor_that_could_not_be_read_back_is_not_written(tmp_path):
    with pytest.raises(InputError, match=r"gyro\.g_sensitivity_deg_h_g is -.*greater than or equal to 0"):
        write_sensor(Sensor("odd", TriadErrors(), g_sensitivity=-1.0), tmp_path / "odd.json")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (MINIMAL | {"gyro": {"angle_randm_walk_deg_sqrt_h": 1}}, "did you mean angle_random_walk_deg_sqrt_h?"),
        (MINIMAL | {"gyro": {"turn_on_bias_deg_h": -3}}, "gyro.turn_on_bias_deg_h is -3: greater than or equal to 0"),
        (MINIMAL | {"gyro": {"scale_factor_ppm": float("nan")}}, "gyro.scale_factor_ppm is nan: a finite number"),
        (MINIMAL | {"gyro": {"scale_factor_ppm": "30"}}, "gyro.scale_factor_ppm is '30': a valid number"),
        (MINIMAL | {"gyro": {"scale_factor_ppm": True}}, "gyro.scale_factor_ppm is True: a valid number"),
        (MINIMAL | {"gyro": {"range_deg_s": 0}}, "gyro.range_deg_s is 0: greater than 0"),
        (MINIMAL | {"gyro": {"bias_instability_deg_h": 1}}, "gyro: bias_instability_definition is missing"),
        (
            MINIMAL | {"accel": {"velocity_random_walk_m_s_sqrt_h": 1, "velocity_random_walk_ug_sqrt_hz": 1}},
            "accel: velocity random walk is given twice",
        ),
        (MINIMAL | {"colour": "red"}, "colour is not a known field"),
        (MINIMAL | {"schema": "gyronorth.sensor/9"}, "schema is 'gyronorth.sensor/9': 'gyronorth.sensor/1'"),
        ({"schema": "gyronorth.sensor/1"}, "name is missing; gyro is missing"),
        ([1, 2], "holds [1, 2]; a JSON object"),
        ("{", "is not valid JSON"),
        ("[" * 100_000, "is not valid JSON"),
        ('{"a": 1' + "0" * 5000 + "}", "is not valid JSON"),
        (" " * 1_000_001, "1000001 bytes"),
    ],
)
def test_a_bad_profile_is_one_clear_error(tmp_path, content, expected):
    path = write(tmp_path, content)
    with pytest.raises(InputError) as caught:
        read_sensor(path)
    assert str(path) in str(caught.value)
    assert expected in str(caught.value)


def test_what_is_no_profile_at_all_is_one_clear_error(tmp_path):
    with pytest.raises(InputError, match=r"There is no sensor 'sdc5000': neither a built-in profile .*sdc500"):
        read_sensor("sdc5000")
    with pytest.raises(InputError, match="There is no sensor"):
        read_sensor(tmp_path)
    binary = tmp_path / "binary.json"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="is not UTF-8 text"):
        read_sensor(binary)


@pytest.mark.parametrize("field", [f.name for f in dataclasses.fields(TriadErrors)])
@pytest.mark.parametrize("value", [-1.0, np.nan])
def test_error_terms_are_not_negative(field, value):
    with pytest.raises(ValueError, match=field):
        TriadErrors(**{field: value})


def test_error_terms_are_finite_but_for_the_range():
    assert TriadErrors(saturation=np.inf).saturation == np.inf
    with pytest.raises(ValueError, match="white is inf"):
        TriadErrors(white=np.inf)
    with pytest.raises(ValueError, match=r"flicker_longest is 0\.01"):
        TriadErrors(flicker_longest=0.01)


def spectrum_times_f(errors, frequency):
    """f x two-sided spectrum / (B^2 / 2 pi) of the in-run bias: 1 for flicker."""
    variance, tau = flicker_components(errors)
    omega_tau = 2 * np.pi * frequency[:, None] * tau
    return (variance * 2 * tau / (1 + omega_tau**2)).sum(axis=1) * 2 * np.pi * frequency / errors.flicker**2


def test_in_run_bias_has_the_spectrum_its_docstring_claims():
    errors = TriadErrors(flicker=3.0)
    band = np.geomspace(0.003, 0.087, 500)
    assert np.abs(spectrum_times_f(errors, band) - 1).max() < 0.02
    # Both limits of the band are limits: a fifth outside them it is already off by more than 2 %.
    assert np.all(1 - spectrum_times_f(errors, np.array([0.0024, 0.105])) > 0.02)
    # The ripple, seen alone between ends nine decades apart.
    wide = TriadErrors(flicker=1.0, flicker_longest=1e8)
    ripple = np.abs(spectrum_times_f(wide, np.geomspace(1e-5, 1e-4, 500)) - 1).max()
    assert_allclose(ripple, 2 / np.cosh(np.pi**2 / FLICKER_SPACING), rtol=0.15)


def test_in_run_bias_has_the_allan_deviation_its_docstring_claims():
    variance, tau = flicker_components(TriadErrors(flicker=1.0))

    def allan(averaging):
        # Half the variance of the difference of adjacent means: var(mean) - cov(adjacent means).
        x = averaging / tau
        return np.sqrt((variance_of_mean(variance, tau, averaging) - variance * ((1 - np.exp(-x)) / x) ** 2).sum())

    assert_allclose([allan(t) for t in np.geomspace(2, 150, 40)], profiles.ALLAN_MINIMUM, rtol=0.02)
    assert_allclose([allan(t) for t in np.geomspace(0.8, 400, 40)], profiles.ALLAN_MINIMUM, rtol=0.05)


def test_in_run_bias_has_the_scatter_its_docstring_claims():
    variance, tau = flicker_components(TriadErrors(flicker=1.0))
    assert_allclose(np.sqrt(variance.sum()), 1.82, atol=0.005)
    means = [np.sqrt(variance_of_mean(variance, tau, duration).sum()) for duration in (100, 230)]
    assert_allclose(means, [1.10, 0.98], atol=0.005)


def test_in_run_bias_of_a_short_band_still_has_a_process():
    variance, tau = flicker_components(TriadErrors(flicker=1.0, flicker_longest=0.1))
    assert len(variance) == len(tau) == 1
    assert len(flicker_components(TriadErrors(flicker=0.0))[0]) == 0
