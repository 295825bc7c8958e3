"""The estimate as a user sees it: one line, a table in a notebook, degrees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import gyronorth as gn
from gyronorth.findings import Finding


@pytest.fixture(scope="module")
def estimate():
    rng = np.random.default_rng(0)
    made = gn.simulate("isa100c", latitude=0.8, heading=6.28, duration=60, rate_hz=5, rng=rng, roll=0.02, pitch=-0.01)
    return gn.heading(made, sensor="isa100c", method="mean")


def html(estimate) -> str:
    """What a notebook asks for."""
    return type(estimate).__dict__["_repr_html_"](estimate)


def test_degrees_are_those_of_the_radians(estimate):
    for name in ("heading", "sigma", "roll", "pitch", "latitude"):
        assert getattr(estimate, f"{name}_deg") == pytest.approx(np.degrees(getattr(estimate, name)))
    assert estimate.interval95_deg == pytest.approx(np.degrees(estimate.interval95))
    document = estimate.to_json()
    assert document["heading_deg"] == estimate.heading_deg
    assert document["interval95_deg"] == list(estimate.interval95_deg)


def test_one_line_says_the_answer_and_the_verdict(estimate):
    low, high = estimate.interval95_deg
    assert repr(estimate) == (
        f"HeadingEstimate({estimate.heading_deg:.2f} deg, sigma {estimate.sigma_deg:.3g} deg, "
        f"95 % {low:.2f} to {high:.2f} deg, valid, method mean)"
    )
    twice = (Finding("motion", "It moved."), Finding("motion", "Again."), Finding("gaps", "Some."))
    assert "refused: motion, gaps, method mean" in repr(replace(estimate, reasons=twice))
    nothing = replace(estimate, heading=None, sigma=None, reasons=twice[:1])
    assert repr(nothing) == "HeadingEstimate(no heading, refused: motion, method mean)"
    assert nothing.heading_deg is nothing.sigma_deg is None


def test_a_notebook_shows_a_table_with_every_finding_and_no_markup_of_a_message(estimate):
    shown = html(replace(estimate, reasons=(Finding("gaps", "<b>12</b> & more."),)))
    assert f"<td>{estimate.heading_deg:.2f}°</td>" in shown
    assert "<td>refused</td>" in shown
    assert "gaps: &lt;b&gt;12&lt;/b&gt; &amp; more." in shown
    assert "<th>verdict</th><td>valid</td>" in html(estimate)
