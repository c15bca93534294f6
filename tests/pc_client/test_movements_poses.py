"""Samples of poses and of joint angles: files, arrays, and what is refused."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pc_client import JointTrajectory, Movement
from pc_client.errors import MovementError
from pc_client.movements.movement import load_motion, load_movement
from pc_client.movements.trajectory import Similarity

T = np.linspace(0.0, 2.0, 9)
POINTS = np.column_stack((0.3 + 0.01 * T, 0.1 * T, 0.3 + 0.0 * T))
TURNS = Rotation.from_rotvec(np.outer(T, [0.1, 0.0, 0.2]))


def table(folder, header, columns, name="poses.csv"):
    path = folder / name
    rows = [",".join(f"{value:.12g}" for value in row) for row in np.column_stack(columns)]
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("x,y,z,rx,ry,rz,t", (POINTS, TURNS.as_rotvec(), T)),
        ("t,x,y,z,rx,ry,rz", (T, POINTS, TURNS.as_rotvec())),
        ("x,y,z,qx,qy,qz,qw,t", (POINTS, TURNS.as_quat(), T)),
    ],
)
def test_a_file_of_poses_turns_the_tool(tmp_path, header, columns):
    movement = Movement.from_csv(table(tmp_path, header, columns))
    np.testing.assert_allclose(movement.rotations(T), TURNS.as_matrix(), atol=1e-9)
    np.testing.assert_allclose(movement.sample(T).p, POINTS, atol=1e-9)


def test_poses_are_written_and_read_back(tmp_path):
    movement = Movement.from_samples(T, POINTS, TURNS.as_quat(), name="turn")
    movement.save(tmp_path / "turn.csv")
    again = load_movement(tmp_path / "turn.csv")
    np.testing.assert_array_equal(again.sample(T).p, movement.sample(T).p)
    np.testing.assert_allclose(again.rotations(T), movement.rotations(T), atol=1e-12)


def test_poses_that_are_turned_elsewhere_turn_the_tool_too():
    R = Rotation.from_rotvec([0.0, 0.0, 0.5]).as_matrix()
    movement = Movement.from_samples(T, POINTS, TURNS.as_rotvec()).transformed(
        Similarity(1.0, R, np.zeros(3))
    )
    np.testing.assert_allclose(movement.rotations(T), R @ TURNS.as_matrix(), atol=1e-9)
    assert isinstance(movement, Movement)


def test_positions_alone_leave_the_orientation_to_planning():
    assert Movement.from_samples(T, POINTS).rotations(T) is None
    assert Movement.library("uniform_4_1").rotations(T) is None


def test_a_file_of_joint_angles_is_a_trajectory_of_joints(tmp_path):
    q = np.outer(T, np.arange(6.0) / 10)
    path = table(tmp_path, "t,q0,q1,q2,q3,q4,q5", (T, q))
    trajectory = load_motion(path)
    assert isinstance(trajectory, JointTrajectory)
    assert trajectory.name == "poses"
    np.testing.assert_allclose(trajectory.q, q)
    with pytest.raises(MovementError, match="holds joint angles"):
        load_movement(path)


def test_seven_columns_without_names_are_not_guessed(tmp_path):
    path = tmp_path / "seven.csv"
    path.write_text("0,0,0,0,0,0,0\n")
    with pytest.raises(MovementError, match="name them in the first line"):
        load_motion(path)


@pytest.mark.parametrize(
    ("rotations", "complaint"),
    [
        (np.zeros((9, 2)), "give \\(n, 3\\) rotation vectors"),
        (np.zeros((9, 4)), "give one of length 1"),
        (np.full((9, 3), np.nan), "give finite ones"),
        (np.zeros((8, 3)), "give one for each"),
    ],
)
def test_orientations_that_make_no_sense_are_refused(rotations, complaint):
    with pytest.raises(MovementError, match=complaint):
        Movement.from_samples(T, POINTS, rotations)


@pytest.mark.parametrize(
    ("t", "q", "complaint"),
    [
        (T, np.zeros((9, 5)), "six angles"),
        (T[:3], np.zeros((3, 6)), "at least 4"),
        (T, np.full((9, 6), np.inf), "not finite"),
        (T[::-1], np.zeros((9, 6)), "times must increase"),
        (1e4 * T, np.zeros((9, 6)), "duration"),
    ],
)
def test_joint_angles_that_make_no_sense_are_refused(t, q, complaint):
    with pytest.raises(MovementError, match=complaint):
        JointTrajectory(t, q)


numbers = st.floats(allow_nan=True, allow_infinity=True, width=32)


@given(
    t=st.lists(st.floats(-1e3, 1e3), min_size=4, max_size=6, unique=True).map(sorted),
    turn=st.lists(st.tuples(numbers, numbers, numbers), min_size=4, max_size=6),
)
def test_samples_of_any_numbers_make_a_movement_or_one_error(t, turn):
    n = min(len(t), len(turn))
    with suppress(MovementError):
        movement = Movement.from_samples(t[:n], np.zeros((n, 3)), turn[:n])
        assert np.isfinite(movement.rotations(movement.duration * np.linspace(0.0, 1.0, 5))).all()
