"""Inverse kinematics along a whole path, on one continuous branch, with a fixed orientation or its own.

Each sample is solved from a linear prediction by the samples before it, so the solution stays on the branch
of the first sample; leaving it, coming near a singularity or out of reach is refused.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from pc_client.arrays import Array
from pc_client.errors import PlanningError
from pc_client.kinematics.model import (
    SINGULARITIES,
    IkSolution,
    RobotModel,
    SingularityMeasure,
    measure_singularity,
    solve_ik_se3,
    tcp_jacobian,
    tcp_pose,
)
from pc_client.planning.limits import PathNames, PlanLimits

_TCP_RPY = (0.0, 0.75 * pi, 0.0)
"""Roll, pitch, yaw of the TCP in `base` [rad]. Source: paper section III, "RPY(0, 3/4 pi, 0)"."""


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Return R = Rz(yaw) @ Ry(pitch) @ Rx(roll), (3, 3), the convention of UR and ROS.

    Turns about the fixed x, y and z axis, in this order [rad].
    """
    # Lower-case axes are scipy's fixed (extrinsic) axes.
    return np.asarray(Rotation.from_euler("xyz", (roll, pitch, yaw)).as_matrix(), dtype=np.float64)


def fixed_tcp_rotation() -> Array:
    """Return R_base_tcp of the experiment: tool z = (.7071, 0, -.7071), forward and 45 deg down."""
    return rotation_from_rpy(*_TCP_RPY)


# Between the solutions that carry the branch from its own posture to the first sample [m, rad].
_LEAD_IN_STEP, _LEAD_IN_TURN = 0.01, 0.02


@dataclass(frozen=True, slots=True)
class JointPath:
    """Joint angles along a path, with what they were checked for.

    Attributes:
        q: (n, 6) joint angles [rad].
        position_error: (n,) distance between reached and wanted TCP [m].
        rotation_error: (n,) angle between reached and wanted orientation [rad].
    """

    q: Array
    position_error: Array
    rotation_error: Array
    singularity: SingularityMeasure


def follow_path(
    model: RobotModel,
    names: PathNames,
    R_base_tcp: Array,
    *,
    q_branch: ArrayLike | None = None,
    limits: PlanLimits,
) -> JointPath:
    """Solve the inverse kinematics of a path of finite positions.

    Args:
        names: time and TCP positions of the samples.
        R_base_tcp: orientation of the TCP at all samples (3, 3), or at each (n, 3, 3).
        q_branch: (6,) posture whose branch is followed [rad]; the arm's preferred one by default.
        limits: which steps and singularity distance are allowed.

    Raises:
        PlanningError: a sample is out of reach, too near a singularity, or on another branch; the first such
            sample is named.
    """
    branch = np.array(model.description.q_branch if q_branch is None else q_branch, dtype=np.float64)
    n = len(names.p)
    rotations = np.broadcast_to(R_base_tcp, (n, 3, 3))
    q_before = _lead_in(model, names, rotations[0], branch, limits)

    q = np.empty((n, 6))
    errors = np.empty((n, 2))
    jacobians = np.empty((n, 6, 6))
    goal = pin.SE3(rotations[0], names.p[0])
    seed, refusal = q_before, None
    for k in range(n):
        goal.rotation, goal.translation = rotations[k], names.p[k]
        solution = solve_ik_se3(model, goal, seed)
        refusal = _refuse_step(model, names, k, solution, q_before, limits)
        if refusal is not None:
            q, jacobians = q[:k], jacobians[:k]
            break
        q[k] = solution.q
        errors[k] = solution.position_error, solution.rotation_error
        jacobians[k] = tcp_jacobian(model, solution.q)
        seed = 2.0 * solution.q - q_before if k else solution.q
        q_before = solution.q

    # A singularity shows first as a small measure, then as failing steps: name the first sample of the two.
    singularity = measure_singularity(jacobians, model.description.reach)
    _refuse_singular(names, singularity, limits)
    if refusal is not None:
        raise refusal
    return JointPath(q, errors[:, 0].copy(), errors[:, 1].copy(), singularity)


def _lead_in(
    model: RobotModel, names: PathNames, R_base_tcp: Array, q_branch: Array, limits: PlanLimits
) -> Array:
    """Carry the branch of `q_branch` along a straight line to the first sample; return the posture there.

    The TCP begins in the orientation that belongs to the arm's branch and turns about one axis meanwhile.
    """
    p_branch = tcp_pose(model, q_branch)[:3, 3]
    R_branch = fixed_tcp_rotation()
    turn = Rotation.from_matrix(R_base_tcp @ R_branch.T).as_rotvec()
    distance = float(np.linalg.norm(names.p[0] - p_branch)) / _LEAD_IN_STEP
    steps = max(1, int(np.ceil(max(distance, float(np.linalg.norm(turn)) / _LEAD_IN_TURN))))
    goal = pin.SE3(R_branch, p_branch)
    q = q_branch
    for k in range(steps + 1):
        goal.rotation = Rotation.from_rotvec(turn * (k / steps)).as_matrix() @ R_branch
        goal.translation = p_branch + (names.p[0] - p_branch) * (k / steps)
        solution = solve_ik_se3(model, goal, q)
        measure = measure_singularity(tcp_jacobian(model, solution.q)[None], model.description.reach)
        if not solution.converged or measure.sigma_min[0] < limits.sigma_min:
            raise names.refuse(
                0,
                "the start cannot be reached from the preferred posture without passing a singularity or"
                " leaving the reach; move the movement into the arm's working box or give another q_branch",
                joint=int(measure.critical_joint[0]),
            )
        q = solution.q
    return q


def _refuse_step(
    model: RobotModel, names: PathNames, k: int, solution: IkSolution, q_before: Array, limits: PlanLimits
) -> PlanningError | None:
    """Return the error of a sample that is out of reach or too far from the one before; None if good."""
    off = solution.position_error, solution.rotation_error
    near = off[0] <= limits.position_error_max and off[1] <= limits.rotation_error_max
    if not (solution.converged or near):
        joint = int(
            measure_singularity(
                tcp_jacobian(model, solution.q)[None], model.description.reach
            ).critical_joint[0]
        )
        return names.refuse(
            k,
            f"out of reach: the nearest posture misses by {off[0] * 1e3:.2f} mm and"
            f" {np.degrees(off[1]):.2f} deg; move or scale the movement into the box",
            joint=joint,
        )
    step = np.abs(solution.q - q_before)
    joint = int(step.argmax())
    if step[joint] > limits.joint_step_max:
        return names.refuse(
            k,
            f"the joint path jumps by {step[joint]:.3f} rad to another branch (at most"
            f" {limits.joint_step_max:g} rad a sample); keep the path continuous and away from singularities",
            joint=joint,
        )
    return None


def _refuse_singular(names: PathNames, singularity: SingularityMeasure, limits: PlanLimits) -> None:
    """Raise for the first sample that comes too near a singularity."""
    near = np.flatnonzero(singularity.sigma_min < limits.sigma_min)
    if near.size:
        k = int(near[0])
        joint = int(singularity.critical_joint[k])
        raise names.refuse(
            k,
            f"too near the singularity where {SINGULARITIES[joint]}: smallest singular value"
            f" {singularity.sigma_min[k]:.4f}, at least {limits.sigma_min:g}; move the movement away from it",
            joint=joint,
        )
