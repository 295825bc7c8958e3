"""Bundles: the schema, whether a recording fits, export, and inference without PyTorch."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from math import radians

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from typer.testing import CliRunner

torch = pytest.importorskip("torch", reason="PyTorch comes with the extra train")
pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra learned")

from gyronorth.alignment.networks.bundle import Bundle, Domain, RecordingFacts, mismatch, read_bundle, shipped_bundle  # noqa: E402
from gyronorth.alignment.networks.diffusion import Sampler  # noqa: E402
from gyronorth.alignment.networks.runtime import clean, decode, last_window, load_bundle, misfits, run  # noqa: E402
from gyronorth.angles import angle_error, cyclic_rmse  # noqa: E402
from gyronorth.cli import app  # noqa: E402
from gyronorth.deviation import rate_surplus  # noqa: E402
from gyronorth.errors import InputError  # noqa: E402
from gyronorth.learn.data import HeadingSet, Swing, TrainingData, synthetic_set  # noqa: E402
from gyronorth.learn.export import export_bundle, model_card  # noqa: E402
from gyronorth.learn.settings import Settings, baseline, paper  # noqa: E402
from gyronorth.learn.shipped import twin_data  # noqa: E402
from gyronorth.learn.stages import train_denoiser, train_heading  # noqa: E402
from gyronorth.pipeline import heading, heading_batch  # noqa: E402
from gyronorth.readers import write  # noqa: E402
from gyronorth.recording import Recording  # noqa: E402

LATITUDE = radians(32.11)
#: White noise of one sample at 3 Hz of an SDC500: 0.02 deg/sqrt(h) x sqrt(3 Hz), rad/s.
NOISE = radians(0.02 / 60) * np.sqrt(3)


def windows(n, samples, seed=0):
    clean_set = synthetic_set(headings=n, latitude=LATITUDE, samples=samples)
    noise = NOISE * np.random.default_rng(seed).standard_normal(clean_set.gyro_l.shape)
    return HeadingSet(clean_set.gyro_l + noise, clean_set.heading, clean_set.recording)


def made(layout, output, samples=40, **sampler):
    tree = {
        "layout": layout,
        "samples": samples,
        "synthetic": {"headings": 40},
        "sampler": sampler,
        "denoiser": {"layers": 3, "hidden": 16, "epochs": 3, "batch": 10},
        "heading": {"output": output, "epochs": 6, "augment": {"copies": 8}},
    }
    every = windows(16, samples)
    parts = [every.rows(np.arange(start, 16, step)) for start, step in ((0, 2), (1, 4), (3, 4))]
    data = TrainingData(*parts[:2], "simulated", LATITUDE, "sdc500", test=parts[2])
    denoiser = train_denoiser(Settings.model_validate(tree))
    return denoiser, train_heading(Settings.model_validate(tree), data, denoiser), data


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(("flattened", "degrees"), marks=pytest.mark.long),
        pytest.param(("flattened", "cos_sin"), marks=pytest.mark.slow),
        pytest.param(("temporal", "degrees"), marks=pytest.mark.long),
    ],
    ids="-".join,
)
def exported(request, tmp_path_factory):
    denoiser, heading, data = made(*request.param, t_back=980)
    folder = tmp_path_factory.mktemp("bundles") / "b"
    export_bundle(folder, denoiser=denoiser, heading=heading, data=data)
    return folder, denoiser, heading


@pytest.mark.slow
def test_exported_networks_agree_with_pytorch_to_1e_4_deg(exported):
    folder, denoiser, heading = exported
    gyro = windows(90, 40, seed=2).gyro_l
    bundle = load_bundle(folder)
    assert_allclose(clean(bundle, gyro), denoiser.clean(gyro), atol=1e-6 * 7.3e-5)
    error = angle_error(run(bundle, gyro), heading.headings(gyro))
    assert np.abs(np.degrees(error)).max() < 1e-4


@pytest.mark.slow
def test_a_heading_does_not_depend_on_the_batch(exported):
    folder, _, _ = exported
    bundle = load_bundle(folder)

    @settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
    @given(
        seed=st.integers(0, 1000), n=st.integers(1, 6), place=st.integers(0, 5), scale=st.sampled_from([0.0, 1.0, 1e3])
    )
    def check(seed, n, place, scale):
        mine = windows(8, 40, seed=seed).gyro_l[seed % 8]
        others = scale * windows(n, 40, seed=seed + 1).gyro_l
        batch = np.insert(others, min(place, n), mine, axis=0)
        together, alone = run(bundle, batch)[min(place, n)], run(bundle, mine[None])[0]
        assert abs(np.degrees(angle_error(together, alone))) < 1e-5

    check()


def test_both_networks_take_any_batch_size(exported):
    folder, _, _ = exported
    bundle = load_bundle(folder)
    for n in (1, 5):
        x = np.zeros((n, 40, 3))
        assert bundle.heading.run({"rate": x})[0].shape[0] == n
        t = np.full(n, 7)
        assert bundle.denoiser.run({"x": x.astype(np.float32), "t": t})[0].shape == (n, 40, 3)


def test_a_bundle_read_again_is_the_same(exported, tmp_path):
    folder, _, heading = exported
    bundle = read_bundle(folder)
    assert Bundle.model_validate_json(bundle.to_json()) == bundle
    assert Settings.model_validate(bundle.training) == heading.settings
    assert bundle.domain.latitude_deg == pytest.approx(32.11)
    assert np.radians(bundle.domain.noise_deg_s) == pytest.approx(NOISE, rel=0.2)
    shutil.copytree(folder, tmp_path / "copy")
    gyro = windows(5, 40).gyro_l
    assert np.array_equal(run(load_bundle(tmp_path / "copy"), gyro), run(load_bundle(folder), gyro))
    card = (folder / "README.md").read_text()
    assert f"layout `{bundle.layout}`" in card
    assert "validation (4 recordings)" in card
    assert "test (4 recordings)" in card


def test_the_last_window_of_a_longer_recording_is_used(exported):
    folder, _, _ = exported
    bundle, gyro = load_bundle(folder), windows(3, 60).gyro_l
    assert np.array_equal(run(bundle, gyro), run(bundle, gyro[:, -40:]))
    assert run(bundle, gyro[:0]).shape == (0,)
    with pytest.raises(InputError, match=r"\(n, 40 or more, 3\)"):
        run(bundle, gyro[:, :39])


@pytest.mark.slow
@pytest.mark.parametrize(
    "sampler",
    [{"kind": "ddim", "t_back": 0, "jumps": 1, "start": "matched"}, {"t_back": 990, "jumps": 2, "noise": False}],
)
def test_other_samplers_agree_with_pytorch_too(tmp_path, sampler):
    denoiser, heading, data = made("flattened", "cos_sin", **sampler)
    export_bundle(tmp_path / "b", denoiser=denoiser, heading=heading, data=data)
    bundle, gyro = load_bundle(tmp_path / "b"), windows(20, 40, seed=5).gyro_l
    assert bundle.info.denoiser.sampler == Sampler(**sampler)
    assert np.abs(np.degrees(angle_error(run(bundle, gyro), heading.headings(gyro)))).max() < 1e-4


def test_across_batch_is_never_exported(tmp_path):
    denoiser, heading, data = made("across_batch", "degrees", t_back=998)
    with pytest.raises(InputError, match="depends on the others beside it"):
        export_bundle(tmp_path / "b", denoiser=denoiser, heading=heading, data=data)
    assert not (tmp_path / "b").exists()


@pytest.mark.slow
def test_a_denoiser_alone_gives_no_heading(tmp_path):
    denoiser, _, _ = made("flattened", "degrees", t_back=998)
    info = export_bundle(tmp_path / "b", denoiser=denoiser)
    with pytest.raises(InputError, match="denoiser only"):
        run(load_bundle(tmp_path / "b"), np.zeros((1, 40, 3)))
    assert "denoiser only" in mismatch(info, RecordingFacts(600, 100))[0].message


def test_a_folder_of_something_else_is_not_replaced(tmp_path):
    denoiser, _, _ = made("flattened", "degrees", t_back=998)
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="not empty and not a bundle"):
        export_bundle(tmp_path, denoiser=denoiser)
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_damaged_bundles_are_refused_by_name(exported, tmp_path):
    folder = tmp_path / "b"
    with pytest.raises(InputError, match=r"no bundle\.json"):
        load_bundle(folder)
    shutil.copytree(exported[0], folder)
    whole = json.loads((folder / "bundle.json").read_text())
    for change, message in [
        ({"schema": "gyronorth.bundle/9"}, "schema"),
        ({"layout": "across_batch"}, "layout"),
        ({"surprise": 1}, "surprise"),
        ({"domain": {**whole["domain"], "rate_hz": 1e-320}}, "rate_hz"),  # its window would be infinite
        ({"training": {"a": [{"b": float("inf")}]}}, "training"),
        ({"heading": {**whole["heading"], "file": "../heading.onnx"}}, "in the bundle's own folder"),
    ]:
        (folder / "bundle.json").write_text(json.dumps({**whole, **change}))
        with pytest.raises(InputError, match=message):
            load_bundle(folder)
    (folder / "bundle.json").write_text("{")
    with pytest.raises(InputError, match=r"bundle\.json"):
        load_bundle(folder)
    (folder / "bundle.json").write_text(json.dumps(whole))
    with open(folder / "heading.onnx", "ab") as handle:
        handle.write(b"\0")
    with pytest.raises(InputError, match="does not match its checksum"):
        load_bundle(folder)


def test_a_fast_recording_is_averaged_down_and_judged(exported):
    pytest.importorskip("gyronorth.conditioning", reason="decimation is in gyronorth.conditioning")
    bundle, slow = load_bundle(exported[0]), windows(1, 45, seed=8).gyro_l[0]
    fast = np.repeat(slow, 200, axis=0)  # 600 Hz, constant within a sample of 3 Hz
    assert_allclose(last_window(bundle, fast, rate_hz=600.0), slow[-40:], atol=1e-15)
    facts = {"rate_hz": 600.0, "latitude": LATITUDE, "sensor": "sdc500"}
    assert misfits(bundle, fast, **facts) == []
    (found,) = misfits(bundle, 10 * fast, **facts)
    assert "noise" in found.message
    assert "shorter" in misfits(bundle, fast[:100], **facts)[0].message


#: North bias of the unit whose bundle carries its deviation, rad/s: up to 5 deg of heading error.
BIAS = np.array([radians(1.1 / 3600), 0.0, 0.0])


@pytest.fixture(scope="module")
def own_bundle(tmp_path_factory):
    """A bundle of a unit with a bias, trained on 16 recordings of 60 s of its session."""
    denoiser, network, data = made("flattened", "degrees", t_back=998)
    noisy = windows(16, 180, seed=3)
    rate = noisy.gyro_l.mean(axis=1) + BIAS
    swing = Swing(np.arctan2(-rate[:, 1], rate[:, 0]), rate_surplus(rate, LATITUDE), noisy.heading, 60.0)
    part = replace(data.test, gyro_l=data.test.gyro_l + BIAS)
    folder = tmp_path_factory.mktemp("own") / "b"
    export_bundle(folder, denoiser=denoiser, heading=network, data=replace(data, test=part, session="s", swing=swing))
    return folder


def biased(session, seconds=60, seed=9, latitude=LATITUDE):
    """A recording at the heading, 22.5 deg off any known one, at which the bias costs most."""
    gyro = windows(32, 3 * seconds, seed=seed).gyro_l[9] + BIAS
    truth = 9 * 2 * np.pi / 32
    return Recording(gyro, None, 3.0, latitude=latitude, heading_true=truth, session=session)


@pytest.mark.slow
def test_a_units_bundle_corrects_the_closed_form_in_its_session_and_says_so(own_bundle):
    plain = heading(biased("s"), method="mean", sensor="sdc500")
    found = heading(biased("s"), method="learned", model=own_bundle, sensor="sdc500")
    truth = biased("s").heading_true
    assert (found.method, found.bundle) == ("learned", "b")
    assert abs(angle_error(found.heading, truth)) < 0.4 * abs(angle_error(plain.heading, truth))
    assert found.sigma < plain.sigma
    assert np.sqrt(sum(part**2 for part in found.sigma_parts.values())) == pytest.approx(found.sigma, rel=1e-6)
    (said,) = [warning for warning in found.warnings if warning.code == "deviation_applied"]
    assert "16 recordings" in said.message
    info, card = read_bundle(own_bundle), (own_bundle / "README.md").read_text()
    assert info.domain.session == "s"
    assert "learned + deviation" in card
    assert "Carries the deviation of unit not stated, session s" in card
    assert info.metrics["test_deviation_crmse_deg"] < 0.6 * info.metrics["test_model_based_crmse_deg"]


@pytest.mark.slow
def test_a_known_bias_and_a_bundle_that_carries_a_curve_would_correct_twice(own_bundle, exported, tmp_path):
    write(biased("s"), tmp_path / "rec.csv")
    arguments = ["heading", str(tmp_path / "rec.csv"), "--gyro-bias", "1.1,0,0", "--method"]
    result = CliRunner().invoke(app, [*arguments, "learned", "--model", str(own_bundle)])
    assert result.exit_code == 2
    assert "--gyro-bias was given, and --model" in result.output
    assert "would correct it twice" in result.output
    result = CliRunner().invoke(app, [*arguments, "paper", "--model", str(exported[0])])
    assert "twice" not in result.output


@pytest.mark.slow
def test_why_a_bundle_is_without_a_curve_is_written_into_it(tmp_path):
    denoiser, network, data = made("flattened", "degrees", t_back=998)
    why = "the recordings are of latitudes from 32.00 to 48.00 deg"
    export_bundle(tmp_path / "b", denoiser=denoiser, heading=network, data=replace(data, latitude=None, no_swing=why))
    assert read_bundle(tmp_path / "b").provenance["no_deviation"] == why
    assert f"No deviation curve (`deviation.json`), so no `heading --method learned`: {why}." in (
        (tmp_path / "b" / "README.md").read_text()
    )


@pytest.mark.parametrize("session", ["another", None])
def test_a_units_bundle_leaves_other_sessions_alone(own_bundle, session):
    plain = heading(biased(session), method="mean", sensor="sdc500")
    found = heading(biased(session), method="learned", model=own_bundle, sensor="sdc500")
    assert (found.heading, found.sigma, found.interval95) == (plain.heading, plain.sigma, plain.interval95)
    assert any("not applied" in warning.message for warning in found.warnings)


@pytest.mark.parametrize(("error", "reasons"), [(2.0, ["network_contradicts"]), (100.0, ["too_noisy"])])
def test_a_network_claims_what_its_tests_show_and_says_whose_error_it_learned(own_bundle, tmp_path, error, reasons):
    """Four test recordings: Student's t with 4 degrees of freedom, 2.776 for 1.960."""
    shutil.copytree(own_bundle, tmp_path / "b")
    info = json.loads((tmp_path / "b" / "bundle.json").read_text())
    info["metrics"]["test_network_crmse_deg"] = error
    (tmp_path / "b" / "bundle.json").write_text(json.dumps(info))
    found = heading(biased("another"), method="paper", model=tmp_path / "b")
    assert [reason.code for reason in found.reasons] == reasons
    if error < 90:
        assert np.degrees(found.sigma) == pytest.approx(error * 2.7764 / 1.9600, rel=5e-3)
    (said,) = [warning for warning in found.warnings if warning.code == "deviation_applied"]
    assert "session s: part of what it learned" in said.message


def test_a_bundle_of_another_method_is_refused(own_bundle):
    with pytest.raises(InputError, match="is one of method paper, but method baseline"):
        heading(biased("s"), method="baseline", model=own_bundle)
    assert heading(biased("s"), method="paper", model=own_bundle).bundle == "b"


def test_a_units_bundle_is_refused_where_it_does_not_fit_and_in_batches(own_bundle, tmp_path):
    found = heading(biased("s", latitude=0.0), method="learned", model=own_bundle, sensor="sdc500")
    assert [reason.code for reason in found.reasons] == ["bundle_mismatch"]
    with pytest.raises(InputError, match="Use `heading` with each recording"):
        heading_batch(np.ones((2, 200, 3)), rate_hz=3.0, latitude=LATITUDE, method="learned", model=own_bundle)
    shutil.copytree(own_bundle, tmp_path / "b")
    text = (tmp_path / "b" / "deviation.json").read_text()
    (tmp_path / "b" / "deviation.json").write_text(text.replace('"s"', '"*"'))
    with pytest.raises(InputError, match="does not match its checksum"):
        load_bundle(tmp_path / "b")


def test_a_recording_shorter_than_those_learned_from_adds_its_noise(own_bundle):
    """15 of 60 s have noise of variance N^2 / 15 s, of which the curve's sigma holds N^2 / 60 s."""
    short, whole = (heading(biased("s", n), method="learned", model=own_bundle, sensor="sdc500") for n in (15, 60))
    assert whole.sigma_parts["noise"] == 0
    noise = radians(0.02 / 60) * np.sqrt(1 / 15 - 1 / 60) / (7.292115e-5 * np.cos(LATITUDE))
    assert short.sigma_parts["noise"] == pytest.approx(noise, rel=0.25)  # the record's own noise, of 45 samples


@pytest.mark.slow
@pytest.mark.parametrize(("method", "recipe"), [("paper", paper), ("baseline", baseline)])
def test_shipped_bundles_reproduce_the_errors_on_their_card(method, recipe):
    """The reconstruction, the split, the networks and the inference together: the test error comes out as printed."""
    bundle, test = load_bundle(shipped_bundle(method)), twin_data(recipe()).test
    info = bundle.info
    assert (info.method, info.layout, info.domain.sensor) == (method, "flattened", "sdc500")
    assert Settings.model_validate(info.training) == recipe()
    assert model_card(info) == (shipped_bundle(method) / "README.md").read_text()
    crmse = np.degrees(cyclic_rmse(angle_error(run(bundle, test.gyro_l), test.heading)))
    assert crmse == pytest.approx(info.metrics["test_network_crmse_deg"], abs=1e-4)


def test_a_method_without_a_shipped_bundle_is_refused():
    with pytest.raises(InputError, match=r"gyronorth\[bundles,learned\]', or give --model FOLDER"):
        shipped_bundle("nonesuch")


def test_decode_by_hand():
    assert_allclose(np.degrees(decode(np.array([[-10.0], [365.0], [720.0]]), "degrees")), [350, 5, 0], atol=1e-12)
    assert_allclose(np.degrees(decode(np.array([[0.0, -2.0], [3.0, 0.0]]), "cos_sin")), [270, 0], atol=1e-12)


DOMAIN = Domain(rate_hz=3.0, samples=300, latitude_deg=32.11, sensor="sdc500", noise_deg_s=5.8e-4)
FITS = {"rate_hz": 600.0, "duration": 100.0, "latitude": LATITUDE, "sensor": "SDC500", "noise": NOISE}


@pytest.mark.parametrize(
    ("change", "message", "value", "limit"),
    [
        ({"rate_hz": 2.0}, "rate of 2 Hz is below", 2.0, 3.0),
        ({"duration": 99.9}, "shorter than the bundle's window of 100 s", 99.9, 100.0),
        ({"latitude": radians(35)}, "latitude of 35.00 deg", 35.0, 32.11),
        ({"latitude": -LATITUDE}, "latitude of -32.11 deg", -32.11, 32.11),
        ({"sensor": "stim300"}, "sensor is stim300", None, None),
        ({"noise": 4 * NOISE}, "noise", np.degrees(4 * NOISE), 5.8e-4),
        ({"noise": NOISE / 4}, "noise", np.degrees(NOISE / 4), 5.8e-4),
    ],
)
def test_every_mismatch_is_named_with_value_and_limit(change, message, value, limit):
    bundle = Bundle.model_validate(
        {"method": "paper", "layout": "flattened", "domain": DOMAIN, "heading": {"sha256": "0" * 64}}
    )
    assert mismatch(bundle, RecordingFacts(**FITS)) == []
    (found,) = mismatch(bundle, RecordingFacts(**{**FITS, **change}))
    assert message in found.message
    assert found.value == (None if value is None else pytest.approx(value))
    assert found.limit == limit


def test_what_is_longer_than_the_longest_window_may_come_slower():
    made = {"method": "learned", "layout": "temporal", "proposal": {"sha256": "0" * 64}}
    bundle = Bundle.model_validate({**made, "domain": {"rate_hz": 3, "samples": 90, "longest_samples": 900}})
    assert mismatch(bundle, RecordingFacts(rate_hz=1.0, duration=900.0)) == []
    (found,) = mismatch(bundle, RecordingFacts(rate_hz=1.0, duration=600.0))
    assert "rate of 1 Hz is below the bundle's 1.5 Hz" in found.message


def test_what_is_not_known_is_not_judged():
    anything = Bundle.model_validate(
        {
            "method": "baseline",
            "layout": "temporal",
            "domain": {"rate_hz": 3, "samples": 300},
            "heading": {"sha256": "0" * 64},
        }
    )
    assert mismatch(anything, RecordingFacts(**FITS)) == []
    assert mismatch(anything, RecordingFacts(3.0, 100.0)) == []
