"""A batch on the disk gives what it gives in memory, and no more of it than a group is held."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest

from gyronorth import pipeline
from gyronorth.errors import InputError


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["float64", "float32"])
def test_memory_maps_and_single_precision(tmp_path, monkeypatch, kind):
    rng = np.random.default_rng(2)
    gyro = rng.normal(4e-5, 1e-4, (240, 500, 3)).astype(kind)
    accel = rng.normal([0.1, 0.2, -9.8], 1e-2, gyro.shape).astype(kind)
    for name, samples in (("gyro", gyro), ("accel", accel)):
        np.save(tmp_path / f"{name}.npy", samples)
    mapped = [np.load(tmp_path / f"{name}.npy", mmap_mode="r") for name in ("gyro", "accel")]
    known = {"rate_hz": 50.0, "latitude": 0.6, "sensor": "sdc500"}
    whole = pipeline.heading_batch(gyro, accel, **known)
    monkeypatch.setattr(pipeline, "GROUP_SAMPLES", 5000)  # ten recordings at a time
    tracemalloc.start()
    found = pipeline.heading_batch(*mapped, **known)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    for name, expected in vars(whole).items():
        if expected.dtype.kind == "f":
            assert np.allclose(getattr(found, name), expected, rtol=1e-9, atol=0, equal_nan=True), name
        else:
            assert np.array_equal(getattr(found, name), expected), name
    assert peak < 0.5 * gyro.size * 2 * 8  # the whole as doubles would be as much as twice this


def test_what_is_not_finite_is_named_by_its_place(monkeypatch):
    monkeypatch.setattr(pipeline, "GROUP_SAMPLES", 100)
    gyro = np.ones((7, 50, 3)) * 1e-5
    gyro[5, 20, 1] = np.nan
    with pytest.raises(InputError, match=r"gyro_b\[5, 20, 1\] is nan"):
        pipeline.heading_batch(gyro, rate_hz=10.0, latitude=0.6)


def test_parts_of_an_iterator_and_a_dataset_give_the_headings_of_the_whole(tmp_path):
    h5py = pytest.importorskip("h5py")
    rng = np.random.default_rng(5)
    gyro_b = rng.normal((5e-5, 1e-5, -5e-5), 1e-6, (7, 120, 3))
    accel_b = rng.normal((0.1, -0.2, -9.8), 1e-3, gyro_b.shape)
    known: dict[str, Any] = {"rate_hz": 2.0, "latitude": 0.8, "sensor": "sdc500"}
    whole = pipeline.heading_batch(gyro_b, accel_b, **known)
    parts = pipeline.heading_batch(
        (gyro_b[i : i + 3] for i in (0, 3, 6)), iter([accel_b[:3], accel_b[3:6], accel_b[6:]]), **known
    )
    with h5py.File(tmp_path / "rates.h5", "w") as file:
        stored = pipeline.heading_batch(
            file.create_dataset("gyro", data=gyro_b), file.create_dataset("f", data=accel_b), **known
        )
    for other in (parts, stored):
        np.testing.assert_array_equal(other.heading, whole.heading)
        np.testing.assert_array_equal(other.sigma, whole.sigma)


def test_parts_without_their_partner_are_refused():
    part = np.ones((2, 120, 3))
    known: dict[str, Any] = {"rate_hz": 2.0, "latitude": 0.8}
    with pytest.raises(InputError, match="One of gyro_b and accel_b is an iterator"):
        pipeline.heading_batch(iter([part]), part, **known)
    with pytest.raises(ValueError, match="is expected of both"):
        pipeline.heading_batch(iter([part, part]), iter([part]), **known)
    with pytest.raises(InputError, match="holds no recordings"):
        pipeline.heading_batch(iter([]), **known)
