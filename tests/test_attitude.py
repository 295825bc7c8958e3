"""Roll and pitch, and the rotations they make."""

import numpy as np
from hypothesis import given
from hypothesis.strategies import floats
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from gyronorth.attitude import level, mat_bn, mat_lb

ROLL, PITCH, HEADING = floats(-3.1, 3.1), floats(-1.5, 1.5), floats(-3.1, 3.1)


def test_by_hand():
    # Right side down by 30 deg: specific force (0, 0, -g) up in n is (0, -g/2, -g sqrt(3)/2) in b.
    assert_allclose(np.degrees(level([0, -0.5, -np.sqrt(3) / 2])), [30, 0], atol=1e-12)
    # Nose up by 30 deg: the force has a forward component g/2.
    assert_allclose(np.degrees(level([0.5, 0, -np.sqrt(3) / 2])), [0, 30], atol=1e-12)


@given(ROLL, PITCH, HEADING)
def test_attitude_matrix_is_the_textbook_sequence(roll, pitch, heading):
    # Heading about z, then pitch about y, then roll about x, all intrinsic (Groves 2013, eq. 2.22).
    independent = Rotation.from_euler("ZYX", [heading, pitch, roll]).as_matrix().T
    assert_allclose(mat_bn(roll, pitch, heading), independent, atol=1e-14)


@given(ROLL, PITCH)
def test_level_undoes_any_attitude(roll, pitch):
    force_b = mat_bn(roll, pitch, 0.0) @ [0, 0, -9.8]
    assert_allclose(level(force_b), [roll, pitch], atol=1e-9)
    assert_allclose(mat_lb(roll, pitch) @ force_b, [0, 0, -9.8], atol=1e-12)
