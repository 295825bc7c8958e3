"""The list of checks: one for each gate, the three on the width as one, failures under the code of their finding."""

import numpy as np
import pytest

from gyronorth.alignment.checks import checks_of
from gyronorth.alignment.gates import Gate, motion_gate, rate_gates, width_gates

LATITUDE = np.radians(45)


def gates(variance, noise=0.0, duration=100.0, latitude=LATITUDE, half=0.1):
    array = np.asarray
    return [
        *rate_gates(
            7.292115e-5 * np.array([np.cos(latitude), 0, -np.sin(latitude)]),
            variance=array(variance),
            vertical_variance=array(variance),
            latitude=latitude,
            known=True,
        ),
        *width_gates(
            array(half), variance=array(variance), noise_variance=array(noise), latitude=latitude, duration=duration
        ),
        motion_gate(array(0.02), array(0.01)),
    ]


def test_one_check_a_gate_with_its_value_and_limit():
    found = checks_of(gates(1e-12), samples=1000, duration=100.0)
    assert [check.code for check in found] == ["too_short", "rate_norm", "implied_latitude", "too_noisy", "motion"]
    assert [check.passed for check in found] == [True] * 4 + [False]
    length, norm, _, width, motion = found
    assert (length.value, length.limit) == (100.0, 2.0)
    # By hand: horizontal and vertical variance are alike, so the limit is 3.29 s whatever the latitude.
    assert norm.limit == pytest.approx(3.29e-6 / np.radians(1 / 3600))
    assert width.value == pytest.approx(np.degrees(0.1))
    assert width.limit == pytest.approx(90)
    assert (motion.value, motion.limit) == pytest.approx((np.degrees(0.02), np.degrees(0.01)))


@pytest.mark.parametrize(
    ("noise", "variance", "latitude", "code"),
    [
        (1e-8, 1e-8, LATITUDE, "too_short"),
        (0.0, 1e-10, np.radians(89.9), "near_pole"),
        (0.0, 1e-6, LATITUDE, "too_noisy"),
    ],
)
def test_a_wide_interval_is_one_check_under_the_code_that_says_why(noise, variance, latitude, code):
    found = checks_of(gates(variance, noise, latitude=latitude, half=2.0), samples=1000, duration=100.0)
    width = [check for check in found if check.title.startswith("half-width")]
    assert [(check.code, check.passed) for check in width] == [(code, False)]
    assert width[0].value > width[0].limit


def test_no_gates_no_checks():
    assert checks_of([], samples=10, duration=1.0) == ()


def test_a_gate_that_is_not_shown_adds_nothing():
    strange = Gate("elsewhere", "", np.zeros(()), np.zeros(()), np.asarray(False))
    assert len(checks_of([strange], samples=1000, duration=100.0)) == 1
