"""Bundles from strangers: what is loaded is what was hashed, within limits, and errors are one message."""

import copy
import hashlib
import json
import shutil

import numpy as np
import pytest
from pydantic import ValidationError

from gyronorth.alignment.networks.bundle import Bundle, read_bundle, shipped_bundle
from gyronorth.alignment.networks.onnx_file import DamagedOnnx, names_other_files
from gyronorth.alignment.networks.runtime import load_bundle, run
from gyronorth.errors import InputError

helper = pytest.importorskip("onnx.helper")


def bundle(tmp_path, model, **changes):
    """The shipped baseline with another network, its checksum right."""
    folder = tmp_path / "b"
    shutil.copytree(shipped_bundle("baseline"), folder)
    content = model if isinstance(model, bytes) else model.SerializeToString()
    (folder / "heading.onnx").write_bytes(content)
    info = json.loads((folder / "bundle.json").read_text())
    info["heading"]["sha256"] = hashlib.sha256(content).hexdigest()
    for path, value in changes.items():
        *where, last = path.split("__")
        place = info
        for name in where:
            place = place[name]
        place[last] = value
    (folder / "bundle.json").write_text(json.dumps(info))
    return folder


def network(value=123.0, *, name="rate", shape=(1, 1), external=False, outputs=1):
    """A network that says always the same."""
    constant = helper.make_tensor("c", 1, shape, np.full(shape, value).ravel())
    if external:
        constant = helper.make_tensor("c", 1, shape, np.full(shape, value, np.float32).tobytes(), raw=True)
        constant.ClearField("raw_data")
        constant.data_location = 1
        entry = constant.external_data.add()
        entry.key, entry.value = "location", "../../secret"
    ins = [helper.make_tensor_value_info(name, 11, [None, None, 3])]
    outs = [helper.make_tensor_value_info(f"y{i}", 1, shape) for i in range(outputs)]
    nodes = [helper.make_node("Identity", ["c"], [f"y{i}"]) for i in range(outputs)]
    graph = helper.make_graph(nodes, "g", ins, outs, [constant])
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


RATES = np.zeros((1, 300, 3))


def test_a_network_of_a_stranger_runs_in_a_process_of_its_own(tmp_path):
    loaded = load_bundle(bundle(tmp_path, network(123.0)))
    assert np.degrees(run(loaded, RATES)) == pytest.approx([123.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "words"),
    [
        (network(np.inf), "not finite"),
        (network(np.nan), "not finite"),
        (network(shape=(1, 2)), r"shape \(1, 2\); \(1, 1\) is expected"),
        (network(shape=(3,)), "is expected"),
        (network(name="x"), "has the inputs x and 1 outputs; rate"),
        (network(outputs=2), "and 2 outputs"),
        (network(external=True), "keeps numbers in other files"),
        (b"\x0a\xff\xff\xff\xff\x0f", "is no ONNX network"),
        (b"\x08\x08", "cannot be run"),
    ],
)
def test_what_is_no_such_network_is_one_message(tmp_path, model, words):
    with pytest.raises(InputError, match=words):
        run(load_bundle(bundle(tmp_path, model)), RATES)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"heading__sha256": ""}, "heading.sha256"),
        ({"heading__sha256": "0" * 64}, "does not match its checksum"),
        ({"domain__rate_hz": float("nan")}, "domain.rate_hz"),
        ({"domain__noise_deg_s": float("inf")}, "domain.noise_deg_s"),
        ({"metrics__test_network_crmse_deg": float("nan")}, "metrics"),
        ({"domain__samples": 10**12}, "domain.samples"),
        ({"domain__samples": True}, "domain.samples: Input should be a valid integer"),
        ({"domain__rate_hz": "3"}, "domain.rate_hz: Input should be a valid number"),
        ({"domain__noise_factor": 1e308}, "domain.noise_factor: Input should be less than or equal to 1000"),
        ({"heading__file": "../heading.onnx"}, "own folder"),
    ],
)
def test_settings_that_mean_nothing_are_refused(tmp_path, changes, words):
    with pytest.raises(InputError, match=words):
        read_bundle(bundle(tmp_path, network(), **changes))


#: What stands in a bundle for readers alone, in whatever form.
FREE = ("training", "data_sha256", "metrics", "provenance")


def numbers(document, *where):
    """Where numbers stand in a document, and which."""
    if isinstance(document, dict):
        return [found for name, inside in document.items() for found in numbers(inside, *where, name)]
    return [(where, document)] if isinstance(document, float | int) and not isinstance(document, bool) else []


FULL = {
    "schema": "gyronorth.bundle/1",
    "method": "denoiser",
    "layout": "temporal",
    "domain": {
        "rate_hz": 3.0, "samples": 90, "longest_samples": 900, "latitude_deg": 48.0, "latitude_tolerance_deg": 2.0,
        "noise_deg_s": 0.01, "noise_factor": 3.0,
    },
    "denoiser": {
        "sha256": "0" * 64,
        "schedule": {"steps": 1000, "beta_min": 1e-4, "beta_max": 5e-4},
        "sampler": {"t_back": 950, "jumps": 4, "seed": 1},
        "normalisation": {"mean": 0.0, "std": 1.0},
    },
    "heading": {"sha256": "0" * 64},
    "proposal": {"sha256": "0" * 64, "sigma_scale": 1.2},
    "deviation": {"sha256": "0" * 64},
}  # fmt: skip


def test_every_number_of_a_bundle_has_its_type_and_range():
    """A new one with a default too: it must stand in FULL, and takes none of these."""
    document = Bundle.model_validate_json(json.dumps(FULL)).model_dump(mode="json", by_alias=True)
    places = [(where, value) for where, value in numbers(document) if where[0] not in FREE]
    assert {where for where, _ in places} == {where for where, _ in numbers(FULL)}
    for where, value in places:
        for wrong in (True, str(value), "", [value], 1e308, -1e308, np.inf, np.nan, 10**400):
            changed = copy.deepcopy(FULL)
            inside = changed
            for name in where[:-1]:
                inside = inside[name]
            inside[where[-1]] = wrong
            with pytest.raises(ValidationError):
                Bundle.model_validate_json(json.dumps(changed), strict=True)


def test_a_description_without_end_is_not_read(tmp_path):
    folder = bundle(tmp_path, network())
    (folder / "bundle.json").write_text('{"training": {"a": [' + "0," * (1 << 23) + "0]}}")
    with pytest.raises(InputError, match="at most 16 are read"):
        read_bundle(folder)


def test_a_missing_network_is_refused(tmp_path):
    folder = bundle(tmp_path, b"")
    with pytest.raises(InputError, match="does not match its checksum"):
        read_bundle(folder)


def test_other_files_are_found_however_deep_and_damage_is_told():
    assert not names_other_files(network().SerializeToString())
    assert names_other_files(network(external=True).SerializeToString())
    inner = network(external=True).graph
    node = helper.make_node("If", ["c"], ["y"], then_branch=inner, else_branch=network().graph)
    outer = helper.make_model(helper.make_graph([node], "g", [], []))
    assert names_other_files(outer.SerializeToString())
    with pytest.raises(DamagedOnnx):
        names_other_files(network().SerializeToString()[:-1])


@pytest.mark.slow
@pytest.mark.parametrize("field", [b"\0\0", b"\x08\0"])
def test_a_file_of_fields_without_end_is_no_network(field):
    """Walking through 50 MB of them had no bound."""
    with pytest.raises(DamagedOnnx, match=r"without number|more than"):
        names_other_files(field * 600_000)
