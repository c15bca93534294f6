"""One arm as Pinocchio computes it: forward and inverse kinematics, singularities, agreement with a robot.

Everything is expressed in UR's `base` frame, the frame of the DH table and of the TCP poses that a control
box reports. (The URDF's own root, `base_link`, is turned by pi about z against it.) The TCP is the flange,
`tool0`, or lies before it on its z axis, by the length of the tool.

`solve_ik` is the iterative Jacobian inverse kinematics that the paper used: a damped Newton
(Levenberg-Marquardt) iteration on the pose error log6(T_tcp_goal). Near a solution the damping is zero and
convergence quadratic, so a seed from the previous sample of a path needs two steps. It finds a solution near
the seed; the caller chooses the branch by the seed. `nearest_posture` compares all branches, which it knows
in closed form (Hawkins 2013), and lets the iteration finish the nearest.

`check_flange` holds the flange pose that a robot reports against that of the nominal arm, before anything
moves and in each frame of a stream: angles that drift away from the pose, or a pose that drifts away from the
angles, mean that one of them is not what the robot measures.

Source: paper section III ("an iterative Jacobian solver"); log6 on SE(3) as in Pinocchio's example of inverse
kinematics.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import acos, atan2, cos, hypot, inf, pi, sin
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from pc_client.arrays import Array
from pc_client.errors import DriverError, PlanningError
from pc_client.kinematics.arms import ROBOTS, JointLimits, RobotDescription, Six
from protocol.pose import Pose, T_to_pose, pose_inv, pose_trans
from ur_hil.cell import NO_CELL, Cell


@dataclass(frozen=True, slots=True)
class RobotModel:
    """One arm as Pinocchio computes it, in its cell.

    `pin_data` is scratch memory that every computation overwrites: give each thread a model of its own.

    Attributes:
        pin_model: Pinocchio model whose world frame is UR's `base`.
        flange_frame: index of the frame `tool0`.
        tcp_frame: index of the frame of the TCP; without a tool the same.
    """

    description: RobotDescription
    cell: Cell = field(repr=False)
    pin_model: Any = field(repr=False)
    pin_data: Any = field(repr=False)
    flange_frame: int
    tcp_frame: int

    @property
    def name(self) -> str:
        """Short name, e.g. `ur3`."""
        return self.description.name

    @property
    def title(self) -> str:
        """The name for people, e.g. `UR5e`."""
        return self.description.title

    @property
    def limits(self) -> JointLimits:
        """Joint limits of the client's own table."""
        return self.description.limits

    @property
    def reach(self) -> float:
        """Distance from the base axis to the TCP of the stretched arm [m]."""
        return self.description.reach + self.cell.tool.length

    @property
    def tcp_offset(self) -> Pose:
        """Pose of the TCP in the flange frame [m, rad]."""
        return 0.0, 0.0, self.cell.tool.length, 0.0, 0.0, 0.0


def robot_model(name: str = "ur3", cell: Cell = NO_CELL) -> RobotModel:
    """Return a fresh nominal model of an arm, by its key in `ROBOTS`, in its cell.

    Raises:
        PlanningError: unknown name, or example-robot-data is not installed.
    """
    description = ROBOTS.get(name)
    if description is None:
        raise PlanningError(f"no nominal model is called {name!r}; choose one of {', '.join(ROBOTS)}")
    return model_of_arm(description, cell)


def model_of_arm(description: RobotDescription, cell: Cell = NO_CELL) -> RobotModel:
    """Return a fresh nominal model of an arm in its cell; PlanningError as `robot_model`."""
    model = load_pinocchio_model(description)
    tcp = index = int(model.getFrameId("tool0"))
    if length := cell.tool.length:
        model, flange = model.copy(), model.frames[index]
        placement = flange.placement * pin.SE3(np.eye(3), np.array((0.0, 0.0, length)))
        frame = pin.Frame("tcp", flange.parentJoint, index, placement, pin.FrameType.OP_FRAME)
        tcp = int(model.addFrame(frame))
    return RobotModel(description, cell, model, model.createData(), index, tcp)


@lru_cache(maxsize=len(ROBOTS))
def load_pinocchio_model(description: RobotDescription) -> Any:
    """Read the frames of an arm and move their world into UR's `base` frame.

    The result is shared between all callers and must not be changed.
    """
    model = pin.buildModelFromXML(description.urdf)
    T_base_root = model.frames[model.getFrameId("base")].placement.inverse()
    # Everything that hangs directly on the root moves with it; the rest of the chain follows by itself.
    model.jointPlacements[1] = T_base_root * model.jointPlacements[1]
    for frame in model.frames:
        if frame.parentJoint == 0:
            frame.placement = T_base_root * frame.placement
    return model


def tcp_pose(model: RobotModel, q: ArrayLike) -> Array:
    """Return T_base_tcp, (4, 4) with the translation in m, at joint angles q (6,) [rad]."""
    pin.framesForwardKinematics(model.pin_model, model.pin_data, np.asarray(q, dtype=np.float64))
    return np.array(model.pin_data.oMf[model.tcp_frame].homogeneous)


def tcp_jacobian(model: RobotModel, q: ArrayLike) -> Array:
    """Return J_base_tcp (6, 6) at joint angles q (6,) [rad]: twist of the TCP = J @ qd.

    Linear part first [m], in the axes of `base`, at the TCP; rows 3-5 are dimensionless.
    """
    jacobian = pin.computeFrameJacobian(
        model.pin_model,
        model.pin_data,
        np.asarray(q, dtype=np.float64),
        model.tcp_frame,
        pin.LOCAL_WORLD_ALIGNED,
    )
    return np.array(jacobian)


def tcp_positions(model: RobotModel, q: ArrayLike) -> Array:
    """Return the TCP positions (n, 3) in `base` [m] along a joint path q (n, 6) [rad]."""
    path = np.asarray(q, dtype=np.float64)
    positions = np.empty((len(path), 3))
    data, frame = model.pin_data, model.tcp_frame
    for k, q_k in enumerate(path):
        pin.framesForwardKinematics(model.pin_model, data, q_k)
        positions[k] = data.oMf[frame].translation
    return positions


SINGULARITIES = MappingProxyType(
    {
        0: "the wrist comes above the base axis and the base would race",
        2: "the elbow is stretched or folded",
        4: "wrist 1 and wrist 3 are aligned and would race",
    }
)
"""What happens at the singularity that a joint names.

Source: the factors of det J of a UR arm, a2 a3 sin(q3) sin(q5) r, r being the distance of the wrist centre
from the base axis in the plane of the arm (Hawkins 2013)."""


class SingularityMeasure(NamedTuple):
    """Measures of a stack of Jacobians (n, 6, 6).

    Attributes:
        sigma_min: (n,) smallest singular value: the twist that joint speed 1 gives in the worst direction, in
            rad/s and reaches of the arm a second.
        condition: (n,) largest over smallest singular value; inf when singular.
        critical_joint: (n,) joint that names the nearest singularity, a key of SINGULARITIES.
    """

    sigma_min: Array
    condition: Array
    critical_joint: NDArray[np.intp]


def measure_singularity(jacobians: ArrayLike, reach: float) -> SingularityMeasure:
    """Measure Jacobians (n, 6, 6), linear rows first, in `base`; the TCP lies on the axis of wrist 3.

    Lengths are divided by the reach of the arm [m]: arms of all sizes have the same measures in a posture.
    """
    J = np.asarray(jacobians, dtype=np.float64)
    scaled = J / np.repeat((reach, 1.0), 3)[:, None]
    sigma = np.asarray(np.linalg.svd(scaled, compute_uv=False), dtype=np.float64)
    sigma_min = sigma[:, -1]
    with np.errstate(divide="ignore"):
        condition = sigma[:, 0] / sigma_min
    nearest = np.argmin(_determinant_factors(J), axis=1)
    return SingularityMeasure(sigma_min, condition, np.array(tuple(SINGULARITIES), dtype=np.intp)[nearest])


def _determinant_factors(J: Array) -> Array:
    """Return (n, 3): r / |a2|, |sin q3| and |sin q5|, read off the columns axis x (tcp - origin) and axis."""
    linear, axis = J[:, :3, :], J[:, 3:, :]
    # Columns of parallel axes differ by axis x (link between them), so by the links turned a quarter.
    upper, fore = linear[:, :, 1] - linear[:, :, 2], linear[:, :, 2] - linear[:, :, 3]
    a2, a3 = np.linalg.norm(upper, axis=1), np.linalg.norm(fore, axis=1)
    elbow = np.linalg.norm(np.cross(upper, fore), axis=1) / (a2 * a3)
    wrist = np.linalg.norm(np.cross(axis[:, :, 3], axis[:, :, 5]), axis=1)
    # The base's column is (-y, x, 0) of the TCP; the wrist centre lies d6 behind it on the last axis.
    d6 = np.sum(np.cross(axis[:, :, 4], axis[:, :, 5]) * linear[:, :, 4], axis=1)
    centre_x, centre_y = linear[:, 1, 0] - d6 * axis[:, 0, 5], -linear[:, 0, 0] - d6 * axis[:, 1, 5]
    shoulder = np.abs(centre_y * axis[:, 0, 1] - centre_x * axis[:, 1, 1]) / a2
    return np.stack((shoulder, elbow, wrist), axis=1)


_IK_POSITION_TOLERANCE = 1e-11
"""Largest position error of a solution [m]; a hundredth of the accuracy of plans, far above rounding."""

_IK_ROTATION_TOLERANCE = 1e-11
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
        converged: both errors are within tolerance.
    """

    q: Array
    position_error: float
    rotation_error: float
    iterations: int
    converged: bool


def solve_ik(model: RobotModel, T_base_tcp: ArrayLike, q_seed: ArrayLike) -> IkSolution:
    """Find joint angles for the TCP pose T_base_tcp (4, 4) from q_seed (6,) [rad]; check `.converged`."""
    goal = np.asarray(T_base_tcp, dtype=np.float64)
    return solve_ik_se3(model, pin.SE3(goal[:3, :3], goal[:3, 3]), np.asarray(q_seed, dtype=np.float64))


def solve_ik_se3(model: RobotModel, T_base_goal: Any, q_seed: Array) -> IkSolution:
    """Do as `solve_ik` for a goal that is already a pin.SE3: the inner call of path following."""
    q, damping, iterations = q_seed, 0.0, 0
    error = _pose_error(model, T_base_goal, q)
    # With the most damping no direction improves any more: out of reach.
    while not _is_small(error) and iterations < _MAX_ITERATIONS and damping <= _MOST_DAMPING:
        iterations += 1
        q_new = q + _step(model, q, error, damping)
        error_new = _pose_error(model, T_base_goal, q_new)
        if error_new @ error_new < error @ error:
            q, error = q_new, error_new
            damping = damping * _DAMPING_DOWN if damping > _LEAST_DAMPING else 0.0
        else:
            damping = max(damping * _DAMPING_UP, _FIRST_DAMPING)
    position_error, rotation_error = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
    return IkSolution(q, position_error, rotation_error, iterations, _is_small(error))


def nearest_posture(model: RobotModel, T_base_tcp: ArrayLike, q_near: ArrayLike) -> Array:
    """Return the posture (6,) [rad] that brings the TCP to T_base_tcp (4, 4), nearest to q_near (6,) [rad].

    Near is a small sum of squares over all joints; each joint is within its range.

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
        f"its reach is {model.reach:g} m from the base axis"
    )


def _branches(model: RobotModel, T: Array, q6_near: float) -> Iterator[Array]:
    """Yield the up to eight postures (6,) [rad] of a pose: shoulder left or right, wrist and elbow two ways.

    Source: K. Hawkins, "Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms", 2013.
    """
    d1, a2, a3, d4, d5, d6 = dh_lengths(model)
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


def dh_lengths(model: RobotModel) -> Six:
    """Return d1, a2, a3, d4, d5, d6 of the DH table [m]; d6 is to the TCP."""
    z_tcp = tcp_pose(model, np.zeros(6))[:3, 3]
    _, shoulder, elbow, wrist, wrist_2 = (model.pin_data.oMi[i].translation for i in range(1, 6))
    a2, a3 = elbow[0] - shoulder[0], wrist[0] - elbow[0]
    return shoulder[2], a2, a3, -wrist_2[1], shoulder[2] - z_tcp[2], wrist_2[1] - z_tcp[1]


def _pose_error(model: RobotModel, T_base_goal: Any, q: Array) -> Array:
    """Return log6 of the goal seen from the TCP at q: (6,), linear part first."""
    pin.framesForwardKinematics(model.pin_model, model.pin_data, q)
    error: Array = pin.log6(model.pin_data.oMf[model.tcp_frame].actInv(T_base_goal)).vector
    return error


def _step(model: RobotModel, q: Array, error: Array, damping: float) -> Array:
    """Return the joint step [rad] that removes `error`: Newton's without damping, else a damped one."""
    J = pin.computeFrameJacobian(model.pin_model, model.pin_data, q, model.tcp_frame, pin.LOCAL)
    step: Array | None = None
    if damping == 0.0:
        try:
            step = np.linalg.solve(J, error)
        except np.linalg.LinAlgError:  # exactly singular: any damping makes it regular
            damping = _FIRST_DAMPING
    if step is None:
        step = J.T @ np.linalg.solve(J @ J.T + damping * np.eye(6), error)
    # A Newton step of several radians is a sign of a singularity, not of distance: it would leave the branch.
    longest = max(abs(step.max()), abs(step.min()))
    return step if longest <= _LONGEST_STEP else step * (_LONGEST_STEP / longest)


def _is_small(error: Array) -> bool:
    """Return True when a pose error is within both tolerances."""
    x, y, z, rx, ry, rz = error.tolist()
    off_position, off_rotation = x * x + y * y + z * z, rx * rx + ry * ry + rz * rz
    return bool(off_position <= _IK_POSITION_TOLERANCE**2 and off_rotation <= _IK_ROTATION_TOLERANCE**2)


ROTATION_TOLERANCE = 0.045
"""Between the reported flange and the model's [rad]: 34 real arms are off by 7 to 17 mrad at most, a UR10 by
41 mrad. That of the position is the arm's."""

_FARTHEST = 1e3
"""No angle [rad] and no coordinate [m, rad] of a pose is larger."""


def flange_difference(
    model: RobotModel, q: Sequence[float], pose: Sequence[float], tcp_offset: Sequence[float] | None = None
) -> tuple[float, float]:
    """How far the reported flange is from the model's [m, rad]; endless where a value is no number.

    Args:
        q: (6,) reported joint angles [rad].
        pose: (6,) reported pose of the TCP in the base frame [m, rad].
        tcp_offset: (6,) pose of the TCP in the flange frame [m, rad]; the model's by default.
    """
    offset = model.tcp_offset if tcp_offset is None else tcp_offset
    if not all(-_FARTHEST < value < _FARTHEST for value in (*q, *pose, *offset)):  # NaN is not
        return inf, inf
    x, y, z, rx, ry, rz = pose
    tcp_pose(model, q)
    computed = T_to_pose(np.array(model.pin_data.oMf[model.flange_frame].homogeneous))
    flange = pose_trans((x, y, z, rx, ry, rz), pose_inv(tuple(offset)))
    difference = pose_trans(pose_inv(computed), flange)
    return float(np.linalg.norm(difference[:3])), float(np.linalg.norm(difference[3:]))


def check_flange(model: RobotModel, q: Sequence[float], pose: Sequence[float]) -> None:
    """Refuse a robot whose angles q (6,) [rad] and TCP pose (6,) [m, rad] in `base` do not belong together.

    Raises:
        DriverError: they are further apart than the tolerances.
    """
    distance, angle = flange_difference(model, q, pose)
    most = model.description.position_tolerance
    if not (distance <= most and angle <= ROTATION_TOLERANCE):
        raise DriverError(
            f"the robot reports its flange {1e3 * distance:.1f} mm and {1e3 * angle:.1f} mrad from where its "
            f"joint angles put it, allowed is {1e3 * most:g} mm and {1e3 * ROTATION_TOLERANCE:g} mrad: "
            "its angles or its pose are not what it measures; the run was ended"
        )
