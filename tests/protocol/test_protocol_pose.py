"""The pose algebra: group laws, round trips at 0, pi and gimbal lock, SciPy as a second opinion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from protocol import pose as P

ANGLES = st.one_of(
    st.floats(0.0, 4.0 * math.pi),
    st.sampled_from([0.0, math.pi, 2 * math.pi]),
    st.floats(1e-320, 1e-6),
    st.floats(math.pi - 1e-6, math.pi + 1e-6),
)
DIRECTIONS = st.one_of(
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)).filter(lambda v: math.hypot(*v) > 1e-3),
    st.sampled_from([(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 0.0)]),
)


@st.composite
def rotvecs(draw):
    angle, direction = draw(ANGLES), draw(DIRECTIONS)
    length = math.hypot(*direction)
    return tuple(angle * component / length for component in direction)


COORDINATES = st.floats(-2.0, 2.0)
POSES = st.tuples(COORDINATES, COORDINATES, COORDINATES, rotvecs()).map(lambda v: (*v[:3], *v[3]))


def assert_same_pose(a, b, atol=1e-12):
    """As transformations: at pi, opposite rotation vectors are the same rotation."""
    np.testing.assert_allclose(a[:3], b[:3], atol=atol)
    np.testing.assert_allclose(P.rotvec_to_matrix(a[3:]), P.rotvec_to_matrix(b[3:]), atol=atol)


@given(rotvecs())
def test_matrix_of_a_rotation_vector_is_scipys(rotvec):
    expected = Rotation.from_rotvec(rotvec).as_matrix()
    np.testing.assert_allclose(P.rotvec_to_matrix(rotvec), expected, atol=2e-14)


@given(rotvecs())
def test_rotation_vector_of_a_matrix_gives_the_matrix_back_with_the_smaller_angle(rotvec):
    matrix = Rotation.from_rotvec(rotvec).as_matrix()
    back = P.rotvec_from_flat(*matrix.ravel().tolist())
    assert math.hypot(*back) <= math.pi * (1 + 1e-15)
    np.testing.assert_allclose(Rotation.from_rotvec(back).as_matrix(), matrix, atol=2e-14)


@given(rotvecs().filter(lambda v: math.hypot(*v) < math.pi - 1e-9))
def test_short_rotation_vectors_survive_the_matrix_to_the_last_digits(rotvec):
    back = P.rotvec_from_flat(*P.rotvec_to_flat(*rotvec))
    np.testing.assert_allclose(back, rotvec, atol=1e-14)


@pytest.mark.parametrize("angle", [1e-300, 1e-160, 1e-9, 1e-4])
def test_tiny_rotations_keep_their_relative_accuracy(angle):
    # sin(x) is x to the last digit there, so the matrix holds the whole vector
    assert P.rotvec_from_flat(*P.rotvec_to_flat(angle, 0.0, 0.0))[0] == pytest.approx(angle, rel=1e-8)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, -0.8, 0.0), (-0.48, 0.6, 0.64)])
@pytest.mark.parametrize("gap", [0.0, 1e-16, 1e-12, 1e-8, 1e-4])
def test_half_turns_keep_their_axis(axis, gap):
    rotvec = np.array(axis) * (math.pi - gap)
    back = np.array(P.rotvec_from_flat(*P.rotvec_to_flat(*rotvec)))
    assert min(np.abs(back - rotvec).max(), np.abs(back + rotvec).max()) < 2e-14


@given(POSES, POSES, POSES)
def test_pose_trans_is_a_group(a, b, c):
    zero = (0.0,) * 6
    assert_same_pose(P.pose_trans(P.pose_trans(a, b), c), P.pose_trans(a, P.pose_trans(b, c)))
    assert_same_pose(P.pose_trans(a, zero), a)
    assert_same_pose(P.pose_trans(zero, a), a)
    assert_same_pose(P.pose_trans(a, P.pose_inv(a)), zero)
    assert_same_pose(P.pose_trans(P.pose_inv(a), a), zero)


@given(POSES, POSES)
def test_pose_trans_is_the_matrix_product(a, b):
    np.testing.assert_allclose(P.pose_to_T(P.pose_trans(a, b)), P.pose_to_T(a) @ P.pose_to_T(b), atol=1e-13)


@given(POSES)
def test_pose_and_matrix_round_trip(a):
    assert_same_pose(P.T_to_pose(P.pose_to_T(a)), a)
    assert P.pose_to_T(a)[3].tolist() == [0.0, 0.0, 0.0, 1.0]


@given(POSES, POSES)
def test_pose_sub_undoes_pose_add(a, b):
    assert_same_pose(P.pose_sub(P.pose_add(a, b), b), a)
    assert_same_pose(P.pose_add(P.pose_sub(a, b), b), a)


@given(POSES, POSES)
def test_pose_add_adds_positions_and_multiplies_rotations(a, b):
    total = P.pose_add(a, b)
    np.testing.assert_allclose(total[:3], np.add(a[:3], b[:3]), atol=0)
    expected = Rotation.from_rotvec(a[3:]) * Rotation.from_rotvec(b[3:])
    np.testing.assert_allclose(P.rotvec_to_matrix(total[3:]), expected.as_matrix(), atol=1e-13)


@given(POSES, POSES)
def test_interpolation_meets_both_ends_and_goes_straight(a, b):
    assert_same_pose(P.interpolate_pose(a, b, 0.0), a)
    assert_same_pose(P.interpolate_pose(a, b, 1.0), b)
    middle = P.interpolate_pose(a, b, 0.5)
    np.testing.assert_allclose(middle[:3], np.add(a[:3], b[:3]) / 2, atol=1e-15)

    def turn(p, q):
        return math.hypot(*P.pose_trans(P.pose_inv(p), q)[3:])

    assert turn(a, middle) == pytest.approx(turn(a, b) / 2, abs=1e-12)


def test_interpolation_goes_on_beyond_its_ends():
    a, b = (0.0,) * 6, (1.0, 0.0, 0.0, 0.0, 0.0, 0.5)
    assert P.interpolate_pose(a, b, 2.0) == pytest.approx((2.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    assert P.interpolate_pose(a, b, -1.0) == pytest.approx((-1.0, 0.0, 0.0, 0.0, 0.0, -0.5))


def rpy_matrix(rpy):
    return P.rotvec_to_matrix(P.rpy_to_rotvec(rpy))


@given(st.tuples(*[st.floats(-math.pi, math.pi)] * 3))
def test_roll_pitch_yaw_is_rz_ry_rx(rpy):
    expected = Rotation.from_euler("xyz", rpy).as_matrix()  # SciPy: lower case is extrinsic
    np.testing.assert_allclose(rpy_matrix(rpy), expected, atol=1e-14)
    back = P.rotvec_to_rpy(P.rpy_to_rotvec(rpy))
    np.testing.assert_allclose(rpy_matrix(back), expected, atol=1e-13)
    assert abs(back[1]) <= math.pi / 2


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2, math.pi / 2 - 1e-9])
def test_gimbal_lock_still_gives_the_rotation_back(pitch):
    rotvec = P.rpy_to_rotvec((0.3, pitch, -0.8))
    np.testing.assert_allclose(rpy_matrix(P.rotvec_to_rpy(rotvec)), P.rotvec_to_matrix(rotvec), atol=1e-14)
