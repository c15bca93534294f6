"""ArmModel: forward, differential and inverse kinematics of one calibrated arm.

The controller computes poses with it: it knows the calibration and no physics. MuJoCo's kinematic stages
evaluate the chain on a model of their own, in about two microseconds; the rest is plain floats.
"""

from collections.abc import Sequence
from math import inf, isfinite, pi, sqrt
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from protocol.pose import Pose, pose_inv, pose_trans, rotvec_from_flat, rotvec_to_flat
from ur_emulator.errors import KinematicsError
from ur_emulator.machine.kinematics.closed_form import closed_form_inverse
from ur_emulator.machine.models.mjcf import FLANGE, JOINTS, LINKS, arm_spec
from ur_emulator.machine.models.robot_model import DhRow, JointRange, RobotModel, Vector3, Vector6, six
from ur_hil.arithmetic import add_up

# Of the inverse of a Jacobian. Chosen: changes joint speeds away from singularities by 1e-9 relative at most.
_DAMPING = 1e-12 * np.eye(6)
_POSITION_TOLERANCE = 1e-11  # m and rad; a tenth of what `inverse` promises
_MAX_ITERATIONS = 20
_NEAR = 0.3  # rad; a result of Newton's method this close to its start is on the same branch
_LONGEST_STEP = 0.5  # rad; greatest step of Newton's method, for convergence near singularities


def moved_wrench(wrench: Vector6, of: Sequence[float], to: Sequence[float]) -> Vector6:
    """Return a wrench [N, Nm] at another point, in the same axes: the moment loses lever times force.

    `of` is the point that its moment refers to, (3,) [m] or a pose there.
    """
    rx, ry, rz = (b - a for a, b in zip(of[:3], to[:3], strict=True))
    fx, fy, fz, mx, my, mz = wrench
    return (fx, fy, fz, mx - ry * fz + rz * fy, my - rz * fx + rx * fz, mz - rx * fy + ry * fx)


def joint_speeds(jacobian: NDArray[np.float64], twist: NDArray[np.float64]) -> NDArray[np.floating]:
    """Return the joint speeds (6,) [rad/s] whose twist, `jacobian @ qd`, is closest to the one given.

    Finite at singularities, too. The twist (6,) is linear first [m/s, rad/s]; a small displacement [m, rad]
    gives joint steps [rad].
    """
    transposed = jacobian.T
    return np.linalg.solve(transposed @ jacobian + _DAMPING, transposed @ twist)


class CartesianState(NamedTuple):
    """The Cartesian state of the arm, in the base frame: positions [m], speeds [m/s, rad/s].

    Attributes:
        tcp_pose: of the tool centre point [m, rad].
        tcp_speed: its twist in base axes, linear first.
        elbow_position: origin of the second DH frame, on the axis of joint 3.
        momentum: norm of the arm's linear momentum, without a payload [kg m/s].
    """

    tcp_pose: Pose
    tcp_speed: Vector6
    elbow_position: Vector3
    elbow_velocity: Vector3
    flange_position: Vector3
    momentum: float


class ArmModel:
    """Kinematics of one arm; poses are `[x y z rx ry rz]` in the base frame, metres and rotation vector.

    Not to be shared between threads: evaluation uses one scratch state.

    Args:
        dh: its six rows; None: the nominal ones.

    Attributes:
        range: the joint ranges that `inverse` keeps; at first those of the robot.
        mass: of all moving links [kg].
        n_iterations: of Newton's method in the last call of `inverse`.

    `tcp` in all methods: pose of the tool centre point in the flange frame; None for the flange itself.
    """

    def __init__(self, robot: RobotModel, dh: tuple[DhRow, ...] | None = None) -> None:
        self.robot = robot
        self.dh = robot.dh if dh is None else dh
        self._model = arm_spec(robot, self.dh, (1.0,) * 6).compile()
        self._data = mujoco.MjData(self._model)
        data = self._data
        self._flange_link: int = self._model.body(LINKS[5]).id
        elbow_link: int = self._model.joint(JOINTS[2]).bodyid[0]
        root: int = self._model.body(LINKS[0]).id
        # Views of MuJoCo's memory: saves attribute look-ups in each call.
        site: int = self._model.site(FLANGE).id
        self._qpos = data.qpos
        self._qvel = data.qvel
        self._flange_position = data.site_xpos[site]
        self._flange_rotation = data.site_xmat[site]
        self._elbow_position = data.xpos[elbow_link]
        self._flange_motion = data.cvel[self._flange_link]
        self._elbow_motion = data.cvel[elbow_link]
        self._centre = data.subtree_com[root]
        self._root_velocity = data.subtree_linvel[root]
        self._root_spin = data.subtree_angmom[root]
        self.mass = float(self._model.body_subtreemass[root])
        self.n_iterations = 0
        self._tcp: Sequence[float] | None = None
        self._tcp_offset: Vector3 = (0.0, 0.0, 0.0)
        self.range = JointRange(robot.q_min, robot.q_max)
        self._tcp_rotation: Sequence[float] = rotvec_to_flat(0.0, 0.0, 0.0)

    def fk(self, q: Sequence[float], tcp: Sequence[float] | None = None) -> Pose:
        """Forward kinematics: the pose of the tool centre point at joint angles q (6,) [rad]."""
        self._qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)
        return self._tcp_pose(tcp)

    def state(
        self, q: Sequence[float], qd: Sequence[float], tcp: Sequence[float] | None = None
    ) -> CartesianState:
        """Return the Cartesian state at q (6,) [rad] and qd (6,) [rad/s]."""
        model, data = self._model, self._data
        self._qpos[:] = q
        self._qvel[:] = qd
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        pose = self._tcp_pose(tcp)
        # MuJoCo's cvel is (angular, linear), of the point of the body at the centre of mass of the chain.
        cx, cy, cz = self._centre.tolist()
        wx, wy, wz, vx, vy, vz = self._flange_motion.tolist()
        rx, ry, rz = pose[0] - cx, pose[1] - cy, pose[2] - cz
        speed = (vx + wy * rz - wz * ry, vy + wz * rx - wx * rz, vz + wx * ry - wy * rx, wx, wy, wz)
        ex, ey, ez = self._elbow_position.tolist()
        wx, wy, wz, vx, vy, vz = self._elbow_motion.tolist()
        rx, ry, rz = ex - cx, ey - cy, ez - cz
        elbow_velocity = (vx + wy * rz - wz * ry, vy + wz * rx - wx * rz, vz + wx * ry - wy * rx)
        fx, fy, fz = self._flange_position.tolist()
        vx, vy, vz = self._root_velocity.tolist()
        momentum = self.mass * sqrt(vx * vx + vy * vy + vz * vz)
        return CartesianState(pose, speed, (ex, ey, ez), elbow_velocity, (fx, fy, fz), momentum)

    def momentum(
        self, q: Sequence[float], qd: Sequence[float]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the momentum of the arm without a payload, and where its mass is.

        Returns:
            Linear and angular momentum about the base's origin (6,) [kg m/s, kg m^2/s]; first moment of the
            mass (3,) [kg m].
        """
        self.state(q, qd)
        centre, linear = self._centre.copy(), self.mass * self._root_velocity
        return np.concatenate((linear, self._root_spin + np.cross(centre, linear))), self.mass * centre

    def jacobian(
        self, q: Sequence[float] | NDArray[np.float64], tcp: Sequence[float] | None = None
    ) -> NDArray[np.float64]:
        """Geometric Jacobian (6, 6) at q (6,) [rad]: twist of the tool centre point in base = J @ qd."""
        self._qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        jacobian = np.empty((6, 6))
        point = np.array(self._tcp_pose(tcp)[:3])
        mujoco.mj_jac(self._model, self._data, jacobian[:3], jacobian[3:], point, self._flange_link)
        return jacobian

    def jacobian_rate(
        self, q: Sequence[float], qd: Sequence[float], tcp: Sequence[float] | None = None
    ) -> NDArray[np.float64]:
        """Change of the Jacobian (6, 6) with time at q (6,) [rad], qd (6,) [rad/s]."""
        model, data = self._model, self._data
        self._qpos[:] = q
        self._qvel[:] = qd
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        rate = np.empty((6, 6))
        point = np.array(self._tcp_pose(tcp)[:3])
        mujoco.mj_jacDot(model, data, rate[:3], rate[3:], point, self._flange_link)
        return rate

    def inverse(
        self, pose: Sequence[float], q_near: Sequence[float], tcp: Sequence[float] | None = None
    ) -> Vector6 | None:
        """Inverse kinematics: the solution closest to given joint angles.

        Newton's method starts from `q_near` (6,) [rad], which is enough along a path; else from the
        closed-form branches of the nominal arm, the closest first.

        Returns:
            Joint angles within the joint ranges, pose error at most 1e-10 m and 1e-10 rad; None when the
            pose cannot be reached.

        Raises:
            KinematicsError: when the pose is not six finite numbers.
        """
        if len(pose) != 6 or not all(isfinite(value) for value in pose):
            raise KinematicsError(f"pose {list(pose)} given: six finite numbers are needed")
        flange = tuple(pose) if tcp is None else pose_trans(pose, pose_inv(tcp))
        near = [float(angle) for angle in q_near]
        position = (flange[0], flange[1], flange[2])
        self.n_iterations = 0
        rotation = rotvec_to_flat(flange[3], flange[4], flange[5])
        found = self._refine(near, position, rotation, 2.0 * _NEAR)
        if found is not None and max(abs(a - b) for a, b in zip(found, near, strict=True)) < _NEAR:
            inside = self._into_range(found, near)
            if inside is not None:
                return inside
        starts = [
            start
            for branch in closed_form_inverse(self.robot.dh, rotation, position, near[5])
            if (start := self._into_range(branch, near)) is not None
        ]
        starts.sort(key=lambda start: add_up((a - b) ** 2 for a, b in zip(start, near, strict=True)))
        for start in starts:
            found = self._refine(start, position, rotation)
            if found is not None and (inside := self._into_range(found, near)) is not None:
                return inside
        return None

    def _tcp_pose(self, tcp: Sequence[float] | None) -> Pose:
        """Pose of the tool centre point for the kinematics evaluated last."""
        x, y, z = self._flange_position.tolist()
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = self._flange_rotation.tolist()
        if tcp is None:
            rx, ry, rz = rotvec_from_flat(r00, r01, r02, r10, r11, r12, r20, r21, r22)
            return (x, y, z, rx, ry, rz)
        if tcp != self._tcp:
            self._tcp = tuple(tcp)
            self._tcp_offset = (tcp[0], tcp[1], tcp[2])
            self._tcp_rotation = rotvec_to_flat(tcp[3], tcp[4], tcp[5])
        ox, oy, oz = self._tcp_offset
        t00, t01, t02, t10, t11, t12, t20, t21, t22 = self._tcp_rotation
        rx, ry, rz = rotvec_from_flat(
            r00 * t00 + r01 * t10 + r02 * t20,
            r00 * t01 + r01 * t11 + r02 * t21,
            r00 * t02 + r01 * t12 + r02 * t22,
            r10 * t00 + r11 * t10 + r12 * t20,
            r10 * t01 + r11 * t11 + r12 * t21,
            r10 * t02 + r11 * t12 + r12 * t22,
            r20 * t00 + r21 * t10 + r22 * t20,
            r20 * t01 + r21 * t11 + r22 * t21,
            r20 * t02 + r21 * t12 + r22 * t22,
        )
        return (
            x + r00 * ox + r01 * oy + r02 * oz,
            y + r10 * ox + r11 * oy + r12 * oz,
            z + r20 * ox + r21 * oy + r22 * oz,
            rx,
            ry,
            rz,
        )

    def _refine(
        self,
        start: Sequence[float],
        position: Sequence[float],
        rotation: Sequence[float],
        within: float = inf,
    ) -> Vector6 | None:
        """Newton's method on the calibrated arm for a flange pose.

        None if it does not converge, or a joint leaves its start by more than `within` [rad].
        """
        first = np.array(start)
        q = first.copy()
        wanted = np.array(rotation).reshape(3, 3)
        error = np.empty(6)
        for _ in range(_MAX_ITERATIONS):
            self.n_iterations += 1
            jacobian = self.jacobian(q)
            error[:3] = position - self._flange_position
            error[3:] = rotvec_from_flat(*(wanted @ self._flange_rotation.reshape(3, 3).T).ravel().tolist())
            size = sqrt(float(error @ error))
            if size < _POSITION_TOLERANCE:
                return six(q.tolist())
            step = joint_speeds(jacobian, error)
            longest = float(np.abs(step).max())
            q += step if longest < _LONGEST_STEP else step * (_LONGEST_STEP / longest)
            if within < inf and float(np.abs(q - first).max()) > within:
                return None
        return None

    def _into_range(self, q: Sequence[float], near: Sequence[float]) -> Vector6 | None:
        """Unwrap each angle to the turn next to `near` that lies in the joint's range."""
        angles: list[float] = []
        for angle, reference, low, high in zip(q, near, self.range.q_min, self.range.q_max, strict=True):
            turned = angle + 2.0 * pi * round((reference - angle) / (2.0 * pi))
            while turned > high:
                turned -= 2.0 * pi
            while turned < low:
                turned += 2.0 * pi
            if turned > high:
                return None
            angles.append(turned)
        return six(angles)
