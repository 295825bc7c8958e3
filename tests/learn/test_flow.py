"""The flow over the error of a recording's rate: its densities are densities, its headings those of the closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch", reason="PyTorch comes with the extra train")

from gyronorth.angles import angle_error  # noqa: E402
from gyronorth.earth import EARTH_RATE  # noqa: E402
from gyronorth.learn.flow import (  # noqa: E402
    HEADINGS,
    Encoder,
    Flow,
    FlowSettings,
    TrainedFlow,
    draw_recordings,
    flow_log_density,
    headings,
    initialised_all,
    read_headings,
    train_flow,
)

LATITUDE = math.radians(32.11)


def flow(gain=1.0):
    generator = torch.Generator().manual_seed(0)
    network = initialised_all(lambda: Flow(4, hidden=8), generator)
    assert isinstance(network, Flow)
    with torch.no_grad():
        network.leave.weight.mul_(gain)
        network.leave.bias.mul_(gain)
    return network


@pytest.mark.parametrize("gain", [0.0, 2.0])
def test_whatever_its_weights_the_flow_gives_a_density(gain):
    """Its integral over the plane is 1 (change of variables); a flow that stands still leaves the normal law."""
    axis = torch.linspace(-8, 8, 81)
    points = torch.stack(torch.meshgrid(axis, axis, indexing="ij"), dim=2).reshape(1, -1, 2)
    with torch.no_grad():
        found = flow_log_density(flow(gain), points, torch.ones(1, 4))
    assert float(found.exp().sum() * 0.2**2) == pytest.approx(1.0, abs=5e-3)
    normal = -0.5 * (points**2).sum(dim=2) - math.log(2 * math.pi)
    assert (float((found - normal).abs().max()) < 1e-5) == (gain == 0.0)


def test_a_density_is_read_as_its_mean_and_its_shortest_arc():
    mean = np.radians([3.0, 120.0, 359.9, -170.0])
    heading, low, high = read_headings(400 * np.cos(headings() - mean[:, None]))
    step = 2 * np.pi / HEADINGS
    assert_allclose(angle_error(heading, mean), 0, atol=1e-6)
    assert_allclose(high - low, 2 * 1.96 / np.sqrt(400), atol=step)
    assert_allclose(high + low, 0, atol=2 * step)


def test_an_arc_that_is_no_normal_laws_lies_on_its_own_side():
    """An exponential from 100 deg on, rate 1/5 deg: 95 % of it within 5 ln 20 deg."""
    off = np.degrees(headings()) - 100
    heading, low, high = read_headings(np.where(off > 0, -off / 5, -60.0)[None])
    assert np.degrees(heading[0]) == pytest.approx(105, abs=1)
    assert np.degrees(heading + low)[0] == pytest.approx(100, abs=1)
    assert np.degrees(heading + high)[0] == pytest.approx(100 + 5 * math.log(20), abs=1)


def test_without_anything_learned_the_heading_is_that_of_the_median():
    """Centre 0 and scale 1 whatever it sees: the density is highest where the Earth's rate is nearest."""
    settings = FlowSettings(samples=24, features=4)
    encoder = Encoder(24, 4)
    with torch.no_grad():
        encoder.head.weight.zero_()
        encoder.head.bias.zero_()
    trained = TrainedFlow(encoder, flow(0.0), settings, {})
    psi = np.radians([10.0, 200.0])
    level = EARTH_RATE * np.stack(
        [np.cos(psi) * math.cos(LATITUDE), -np.sin(psi) * math.cos(LATITUDE), 0 * psi - math.sin(LATITUDE)], axis=1
    )
    rate = np.broadcast_to(level[:, None], (2, 24, 3))
    for normal in (True, False):
        heading, low, high = read_headings(trained.log_density(rate, LATITUDE, normal=normal))
        assert_allclose(angle_error(heading, psi), 0, atol=1e-3)
        assert_allclose(high - low, 2 * 1.96 * settings.unit / (EARTH_RATE * math.cos(LATITUDE)), rtol=0.1)


def test_what_is_learned_from_is_what_was_taken_off():
    """Of quiet recordings without bias the error of the median is noise: pi/2 of the mean's variance."""
    settings = FlowSettings(mixed=0, quiet=2000, samples=75, bias=0.0)
    rate, error = draw_recordings(settings)
    assert float(rate.median(dim=1).values.abs().max()) < 1e-5
    assert float(error.var() * 75) == pytest.approx(math.pi / 2, rel=0.15)


def test_the_same_seed_trains_the_same_flow():
    small = FlowSettings(samples=24, mixed=40, quiet=10, batch=8, steps=3, flow_steps=3, features=4)
    first, second = (train_flow(small).flow.state_dict() for _ in range(2))
    assert all(torch.equal(first[name], second[name]) for name in first)
