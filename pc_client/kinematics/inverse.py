"""Iterative Jacobian inverse kinematics, as the paper used, on Pinocchio.

A damped Newton (Levenberg-Marquardt) iteration on the pose error log6(T_tcp_goal): near a solution the
damping is zero and convergence quadratic, so a seed from the previous sample of a path needs two steps.
It finds the solution nearest to the seed; the caller chooses the branch by the seed.

Source: paper section III ("an iterative Jacobian solver"); log6 on SE(3) as in Pinocchio's example of inverse
kinematics.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

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
