"""Pose functions against the manual's examples, scipy's rotations and 4 x 4 matrices."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from urscript.builtins import PURE
from urscript.errors import ScriptRuntimeError
from urscript.values import Pose

LENGTHS = st.floats(-2, 2)
VECTORS = st.lists(st.floats(-3, 3), min_size=3, max_size=3)
POSES = st.builds(lambda p, r: Pose(*p, *r), st.lists(LENGTHS, min_size=3, max_size=3), VECTORS)
WRENCHES = st.lists(st.floats(-100, 100), min_size=6, max_size=6)


def call(name: str, *args: Any) -> Any:
    return PURE[name](*args)


def refusal(name: str, *args: Any) -> str:
    with pytest.raises(ScriptRuntimeError) as caught:
        call(name, *args)
    return caught.value.message


def transform(pose: Pose) -> NDArray[np.float64]:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(pose[3:]).as_matrix()
    T[:3, 3] = pose[:3]
    return T


@pytest.mark.parametrize(
    ("name", "args", "result"),
    [
        (
            "interpolate_pose",
            (Pose(0.2, 0.2, 0.4, 0, 0, 0), Pose(0.2, 0.2, 0.6, 0, 0, 0), 0.5),
            [0.2, 0.2, 0.5, 0, 0, 0],
        ),
        (
            "pose_add",
            (Pose(0.2, 0.5, 0.1, 1.57, 0, 0), Pose(0.2, 0.5, 0.6, 1.57, 0, 0)),
            [0.4, 1.0, 0.7, 3.14, 0, 0],
        ),
        (
            "pose_sub",
            (Pose(0.2, 0.5, 0.1, 1.57, 0, 0), Pose(0.2, 0.5, 0.6, 1.57, 0, 0)),
            [0, 0, -0.5, 0, 0, 0],
        ),
        (
            "pose_trans",
            (Pose(0.2, 0.5, 0.1, 1.57, 0, 0), Pose(0.2, 0.5, 0.6, 1.57, 0, 0)),
            [0.4, -0.0996, 0.60048, 3.14, 0, 0],
        ),
        (
            "pose_inv",
            (Pose(0.2, 0.5, 0.1, 1.57, 0, 3.14),),
            [0.19324, 0.41794, -0.29662, 1.23993, 0.0, 2.47985],
        ),
        ("rotvec2rpy", ([3.14, 1.57, 0],), [-2.80856, -0.16202, 0.9]),
        ("rpy2rotvec", ([3.14, 1.57, 0],), [2.22153, 0.00177, -2.21976]),
    ],
)
def test_manual_examples(name: str, args: tuple[Any, ...], result: list[float]) -> None:
    # The manual prints five digits.
    assert list(call(name, *args)) == pytest.approx(result, abs=6e-6)


@pytest.mark.parametrize("name", ["pose_add", "pose_sub", "pose_trans"])
@given(a=POSES, b=POSES)
def test_products_against_matrices(name: str, a: Pose, b: Pose) -> None:
    A, B = transform(a), transform(b)
    expected = A @ B
    if name == "pose_add":
        expected = np.eye(4)
        expected[:3, :3], expected[:3, 3] = A[:3, :3] @ B[:3, :3], A[:3, 3] + B[:3, 3]
    if name == "pose_sub":
        expected = np.eye(4)
        expected[:3, :3], expected[:3, 3] = A[:3, :3] @ B[:3, :3].T, A[:3, 3] - B[:3, 3]
    result = call(name, a, b)
    assert isinstance(result, Pose)
    assert transform(result) == pytest.approx(expected, abs=1e-12)


@given(POSES)
def test_inverse_undoes(pose: Pose) -> None:
    assert transform(call("pose_inv", pose)) @ transform(pose) == pytest.approx(np.eye(4), abs=1e-12)
    assert np.linalg.norm(call("pose_inv", pose)[3:]) <= math.pi + 1e-12


@given(POSES, POSES)
def test_interpolation_ends_and_goes_on_beyond(a: Pose, b: Pose) -> None:
    assert transform(call("interpolate_pose", a, b, 0)) == pytest.approx(transform(a), abs=1e-9)
    assert transform(call("interpolate_pose", a, b, 1)) == pytest.approx(transform(b), abs=1e-9)
    middle = call("interpolate_pose", a, b, 0.5)
    turn = Rotation.from_rotvec(a[3:]).inv() * Rotation.from_rotvec(b[3:])
    half = Rotation.from_rotvec(a[3:]).inv() * Rotation.from_rotvec(middle[3:])
    if turn.magnitude() < 3:  # nearer pi the shortest turn is not unique
        assert half.as_rotvec() == pytest.approx(turn.as_rotvec() / 2, abs=1e-7)
    assert call("interpolate_pose", a, b, 2)[0] == pytest.approx(2 * b[0] - a[0], abs=1e-12)


def test_distances() -> None:
    a, b = Pose(0.2, 0.5, 0.1, 1.57, 0, 3.14), Pose(0.2, 0.5, 0.6, 0, 1.57, 3.14)
    assert call("point_dist", a, b) == pytest.approx(0.5)
    turn = (Rotation.from_rotvec(b[3:]) * Rotation.from_rotvec(a[3:]).inv()).magnitude()
    assert call("pose_dist", a, b) == pytest.approx(math.hypot(0.5, turn), rel=1e-12)
    assert call("pose_dist", a, a) == pytest.approx(0, abs=1e-15)


@given(VECTORS)
def test_roll_pitch_yaw_against_scipy(vector: list[float]) -> None:
    rotation = Rotation.from_rotvec(vector)
    roll, pitch, yaw = call("rotvec2rpy", vector)
    assert Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix() == pytest.approx(
        rotation.as_matrix(), abs=1e-7
    )
    again = Rotation.from_rotvec(call("rpy2rotvec", [roll, pitch, yaw]))
    assert again.as_matrix() == pytest.approx(rotation.as_matrix(), abs=1e-7)


def test_wrench_at_the_tip_of_a_tool() -> None:
    # 10 N along x at the flange; the TCP is 0.1 m out along z. About the TCP the force acts below the point:
    # M = -p x F = -(0, 0.1 * 10, 0).
    tcp = Pose(0, 0, 0.1, 0, 0, 0)
    assert call("wrench_trans", tcp, [10, 0, 0, 0, 0, 0]) == pytest.approx([10, 0, 0, 0, -1, 0])
    # The TCP turned by 90 degrees about z sees a force along x as one along -y.
    turned = Pose(0, 0, 0, 0, 0, math.pi / 2)
    assert call("wrench_trans", turned, [10, 0, 0, 0, 0, 1]) == pytest.approx([0, -10, 0, 0, 0, 1], abs=1e-12)


@given(POSES, POSES, WRENCHES)
def test_wrenches_chain_like_frames(a: Pose, b: Pose, wrench: list[float]) -> None:
    chained = call("wrench_trans", b, call("wrench_trans", a, wrench))
    assert chained == pytest.approx(call("wrench_trans", call("pose_trans", a, b), wrench), abs=1e-9)
    assert np.linalg.norm(chained[:3]) == pytest.approx(float(np.linalg.norm(wrench[:3])), abs=1e-9)


@given(POSES, WRENCHES, WRENCHES)
def test_wrenches_keep_power(pose: Pose, wrench: list[float], twist: list[float]) -> None:
    # A twist (v, w) at "from" seen from "to": w' = R^T w, v' = R^T (v + w x p). Power is the same in both.
    T = transform(pose)
    R, p = T[:3, :3], T[:3, 3]
    v, w = np.array(twist[:3]), np.array(twist[3:])
    moved = np.concatenate([R.T @ (v + np.cross(w, p)), R.T @ w])
    power = float(np.dot(wrench, twist))
    assert float(np.dot(call("wrench_trans", pose, wrench), moved)) == pytest.approx(power, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "args"),
    [
        ("pose_trans", (Pose(0, 0, 0, 0, 0, 0), [0, 0, 0, 0, 0, 0])),
        ("pose_add", ([0] * 6, Pose(0, 0, 0, 0, 0, 0))),
        ("pose_sub", (1, 2)),
        ("pose_inv", ("p",)),
        ("point_dist", (None, None)),
        ("pose_dist", ([0] * 6, [0] * 6)),
        ("interpolate_pose", ([0] * 6, [0] * 6, 0.5)),
        ("wrench_trans", ([0] * 6, [0] * 6)),
    ],
)
def test_lists_are_no_poses(name: str, args: tuple[Any, ...]) -> None:
    assert refusal(name, *args) == f"{name}: Parameter must be a Pose on the form p[x,y,z,a,b,c]"


def test_other_argument_errors() -> None:
    origin = Pose(0, 0, 0, 0, 0, 0)
    assert refusal("rotvec2rpy", [0, 0]).endswith("must be a list of 3 numbers, got a list of 2")
    assert refusal("rpy2rotvec", origin).endswith("must be a list of 3 numbers, got a pose")
    assert refusal("interpolate_pose", origin, origin, "x").endswith('must be a number, got the string "x"')
    assert refusal("wrench_trans", origin, [1]).endswith(
        "must be a list of 6 numbers or a Pose, got a list of 1"
    )
    assert refusal("pose_inv", Pose(0, 0, 0, math.inf, 0, 0)) == "pose_inv: Parameters must be finite"
