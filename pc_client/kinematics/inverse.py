"""Iterative Jacobian inverse kinematics, as the paper used, on Pinocchio.

A damped Newton (Levenberg-Marquardt) iteration on the pose error log6(T_tcp_goal): near a solution the
damping is zero and convergence quadratic, so a seed from the previous sample of a path needs two steps.
It finds a solution near the seed; the caller chooses the branch by the seed. `nearest_posture` compares all
branches, which it knows in closed form (Hawkins 2013), and lets the iteration finish the nearest.

Source: paper section III ("an iterative Jacobian solver"); log6 on SE(3) as in Pinocchio's example of inverse
kinematics.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import acos, atan2, cos, hypot, pi, sin
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from pc_client.errors import PlanningError
from pc_client.kinematics.forward import tcp_pose
from pc_client.kinematics.robot_model import RobotModel

Array = NDArray[np.float64]

_POSITION_TOLERANCE = 1e-11
"""Largest position error of a solution [m]; a hundredth of the accuracy of plans, far above rounding."""

ROTATION_TOLERANCE = 1e-11
"""Largest rotation error of a solution [rad]."""

_MAX_ITERATIONS = 60
"""Enough from any seed in reach; paths need 2-3. Out of reach it bounds the work (~1 ms)."""

# Levenberg-Marquardt: damping starts at nothing, is brought in when a step makes things worse, and forgotten
# again after good steps. Values in units of J'J, i.e. about 1 for a UR.
_FIRST_DAMPING = 1e-4
_DAMPING_UP = 10.0
_DAMPING_DOWN = 0.1
_LEAST_DAMPING = 1e-9
_MOST_DAMPING = 1e6
_LONGEST_STEP = 0.5


class IkSolution(NamedTuple):
    """Where the iteration ended.

    Attributes:
        q: (6,) joint angles [rad]; the best found when not converged. Not wrapped to any turn.
        position_error: distance between reached and wanted TCP [m].
        rotation_error: angle between reached and wanted orientation [rad].
        iterations: steps taken.
        converged: both errors are within tolerance.
    """

    q: Array
    position_error: float
    rotation_error: float
    iterations: int
    converged: bool


def solve_ik(
    model: RobotModel, T_base_tcp: ArrayLike, q_seed: ArrayLike, *, max_iterations: int = _MAX_ITERATIONS
) -> IkSolution:
    """Find joint angles that bring the TCP to T_base_tcp, starting from q_seed.

    Args:
        model: nominal arm.
        T_base_tcp: (4, 4) wanted pose in `base`.
        q_seed: (6,) joint angles to start from [rad].
        max_iterations: bound of the work.

    Returns:
        The solution; check `.converged`.
    """
    goal = np.asarray(T_base_tcp, dtype=np.float64)
    return solve_ik_se3(
        model, pin.SE3(goal[:3, :3], goal[:3, 3]), np.asarray(q_seed, dtype=np.float64), max_iterations
    )


def solve_ik_se3(
    model: RobotModel, T_base_goal: Any, q_seed: Array, max_iterations: int = _MAX_ITERATIONS
) -> IkSolution:
    """Do as `solve_ik` for a goal that is already a pin.SE3: the inner call of path following."""
    q = q_seed
    error = _pose_error(model, T_base_goal, q)
    damping = 0.0
    for iteration in range(max_iterations):
        if _is_small(error):
            return _solution(q, error, iteration, converged=True)
        step = _step(model, q, error, damping)
        q_new = q + step
        error_new = _pose_error(model, T_base_goal, q_new)
        if error_new @ error_new < error @ error:
            q, error = q_new, error_new
            damping = damping * _DAMPING_DOWN if damping > _LEAST_DAMPING else 0.0
        else:
            damping = max(damping * _DAMPING_UP, _FIRST_DAMPING)
            if damping > _MOST_DAMPING:
                break  # no direction improves any more: out of reach
    return _solution(q, error, max_iterations, converged=_is_small(error))


def nearest_posture(model: RobotModel, T_base_tcp: ArrayLike, q_near: ArrayLike) -> Array:
    """Return the posture that brings the TCP to a pose, of all that do the nearest to another posture.

    Args:
        model: nominal arm.
        T_base_tcp: (4, 4) wanted pose in `base`.
        q_near: (6,) joint angles [rad]; near is a small sum of squares over all joints.

    Returns:
        (6,) joint angles [rad], each within its range.

    Raises:
        PlanningError: no posture of the arm reaches the pose.
    """
    goal, limits = np.asarray(T_base_tcp, dtype=np.float64), model.limits
    q_min, q_max = np.array(limits.q_min), np.array(limits.q_max)
    near = np.clip(np.asarray(q_near, dtype=np.float64), q_min, q_max)
    turns = [q + 2.0 * pi * np.rint((near - q) / (2.0 * pi)) for q in _branches(model, goal, near[5])]
    within = [q - 2.0 * pi * ((q > q_max).astype(int) - (q < q_min).astype(int)) for q in turns]
    for q in sorted(within, key=lambda q: float(np.sum(np.square(q - near)))):
        if (found := solve_ik(model, goal, q)).converged:
            return found.q
    x, y, z = goal[:3, 3].tolist()
    raise PlanningError(
        f"no posture of a {model.title} brings the TCP to ({x:.3f}, {y:.3f}, {z:.3f}) m in this orientation; "
        f"its reach is {model.description.reach:g} m from the base axis"
    )


def _branches(model: RobotModel, T: Array, q6_near: float) -> Iterator[Array]:
    """Yield the up to eight postures (6,) [rad] of a pose: shoulder left or right, wrist and elbow two ways.

    Source: K. Hawkins, "Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms", 2013.
    """
    z_tcp = tcp_pose(model, np.zeros(6))[:3, 3]
    _, shoulder, elbow, wrist, wrist_2 = (model.pin_data.oMi[i].translation for i in range(1, 6))
    d1, d4, d5, d6 = shoulder[2], -wrist_2[1], shoulder[2] - z_tcp[2], wrist_2[1] - z_tcp[1]
    a2, a3 = elbow[0] - shoulder[0], wrist[0] - elbow[0]
    x_tool, y_tool, z_tool = T[:3, :3].T
    centre = T[:3, 3] - d6 * z_tool
    if (r := hypot(centre[0], centre[1])) < abs(d4):
        return
    for left in (1.0, -1.0):
        q1 = atan2(centre[1], centre[0]) + left * acos(d4 / r) + 0.5 * pi
        ahead, aside = np.array((cos(q1), sin(q1), 0.0)), np.array((sin(q1), -cos(q1), 0.0))
        c5 = min(1.0, max(-1.0, float(aside @ z_tool)))
        for flip in (1.0, -1.0):
            q5 = flip * acos(c5)
            q6 = atan2(-flip * (aside @ y_tool), flip * (aside @ x_tool))
            if abs(c5) > 1.0 - 1e-12:  # wrist 1 and wrist 3 are aligned: one of them is free
                q6 = q6_near
            axis = -(x_tool * sin(q6) + y_tool * cos(q6))
            x, z = ahead @ (centre - d5 * axis), centre[2] - d5 * axis[2] - d1
            c3 = (x * x + z * z - a2 * a2 - a3 * a3) / (2.0 * a2 * a3)
            for up in (1.0, -1.0) if abs(c3) <= 1.0 else ():
                q3 = up * acos(c3)
                q2 = atan2(z, x) - atan2(a3 * sin(q3), a2 + a3 * cos(q3))
                yield np.array((q1, q2, q3, atan2(ahead @ axis, -axis[2]) - q2 - q3, q5, q6))


def _pose_error(model: RobotModel, T_base_goal: Any, q: Array) -> Array:
    """Return log6 of the goal seen from the TCP at q: (6,), linear part first."""
    pin.framesForwardKinematics(model.pin_model, model.pin_data, q)
    error: Array = pin.log6(model.pin_data.oMf[model.tcp_frame].actInv(T_base_goal)).vector
    return error


def _step(model: RobotModel, q: Array, error: Array, damping: float) -> Array:
    """Return the joint step [rad] that removes `error`: Newton's without damping, else a damped one."""
    J = pin.computeFrameJacobian(model.pin_model, model.pin_data, q, model.tcp_frame, pin.LOCAL)
    step: Array
    if damping == 0.0:
        try:
            step = np.linalg.solve(J, error)
        except np.linalg.LinAlgError:  # exactly singular: any damping makes it regular
            step = J.T @ np.linalg.solve(J @ J.T + _FIRST_DAMPING * np.eye(6), error)
    else:
        step = J.T @ np.linalg.solve(J @ J.T + damping * np.eye(6), error)
    # A Newton step of several radians is a sign of a singularity, not of distance: it would leave the branch.
    longest = max(abs(step.max()), abs(step.min()))
    return step if longest <= _LONGEST_STEP else step * (_LONGEST_STEP / longest)


def _is_small(error: Array) -> bool:
    """Return True when a pose error is within both tolerances."""
    x, y, z, rx, ry, rz = error.tolist()
    off_position, off_rotation = x * x + y * y + z * z, rx * rx + ry * ry + rz * rz
    return bool(off_position <= _POSITION_TOLERANCE**2 and off_rotation <= ROTATION_TOLERANCE**2)


def _solution(q: Array, error: Array, iterations: int, *, converged: bool) -> IkSolution:
    """Put the end of an iteration into a record."""
    return IkSolution(
        q, float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:])), iterations, converged
    )
