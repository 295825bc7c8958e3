"""Roll and pitch, and the rotations they make."""

import numpy as np
from hypothesis import given
from hypothesis.strategies import floats
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from gyronorth.attitude import level, mat_bn, mat_lb, rotation_vector

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


# At half a turn either sign is right: see the next test.
@given(floats(-1, 1), floats(-1, 1), floats(0.1, 1), floats(0, np.pi - 1e-6))
def test_rotation_vectors_of_any_angle_are_those_of_scipy(x, y, z, angle):
    vector = angle * np.array([x, y, z]) / np.linalg.norm([x, y, z])
    mat = Rotation.from_rotvec(vector).as_matrix()
    assert_allclose(rotation_vector(np.stack([mat, np.eye(3)])), [vector, np.zeros(3)], atol=1e-7)


def test_half_a_turn_has_the_length_pi_about_its_axis():
    for axis in (*np.eye(3), np.array([0.6, 0.0, -0.8])):
        vector = rotation_vector(Rotation.from_rotvec(np.pi * axis).as_matrix())
        assert_allclose(np.abs(vector @ axis), np.pi, rtol=1e-12)
