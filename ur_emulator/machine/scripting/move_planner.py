"""MovePlanner: the limits of moves that the controller plans by what the arm can do.

Source: URScript manual e-Series 5.2x: optimovej and optimovel take shares of the greatest acceleration and
speed along the path and are jerk-limited; so are movej and movel of motion version 2, whose limits are not
above what the arm can do. A duration that the arm cannot keep is made longer: live tests of the maker's
client library. Chosen: what the drives can give from rest by the controller's model, at points of the path;
the form of the ramps; a move with a blend at its end keeps the ramps of version 1.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from protocol.pose import rotvec_to_matrix
from ur_emulator.machine.controller.arm_dynamics import ArmDynamics
from ur_emulator.machine.controller.settings import Payload, PlanningSettings, ToolSettings, ToolWrenchLimit
from ur_emulator.machine.models.robot_model import Vector6
from ur_emulator.machine.motion.leg import Leg
from ur_emulator.machine.motion.path import JointLine
from ur_emulator.machine.motion.tool import UnreachableError

# Points of a path where the wrench is computed, and parts at whose ends the arm is asked.
_POINTS, _PARTS = 25, 8
_NOTHING = 1e-9  # N, Nm
# Share of the rated speed that the fastest joint has at a share of 1: rounding does not exceed the limit.
_TOP_SHARE = 0.99


def _motions(leg: Leg, places: Iterable[float]) -> Iterator[tuple[Vector6, Vector6]]:
    """Yield joint angles and their derivative at places of a path, up to where the move itself ends."""
    try:
        for s in places:
            yield leg.at(s)
    except UnreachableError:
        return


def _least(bounds: NDArray[np.float64]) -> float:
    least = float(bounds.min(initial=inf))
    return least if isfinite(least) else inf


def _wrenches(
    leg: Leg, limit: ToolWrenchLimit, payload: Payload
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what an acceleration of 1 and a speed of 1 along the path ask for.

    Both are magnitudes (points, 6) of the wrench in the frame of the limit: force [N], torque [Nm].
    """
    arm = leg.tool.arm
    places = np.linspace(0.0, leg.path.length, _POINTS)
    states = [arm.state(q, slope) for q, slope in _motions(leg, places.tolist())]
    if len(states) < 2:
        return np.zeros((1, 6)), np.zeros((1, 6))
    turn = np.array([rotvec_to_matrix(state.tcp_pose[3:]) for state in states])
    # Twists of the flange in its own axes, and how they change along the path.
    twist = np.array([state.tcp_speed for state in states])
    changes = np.gradient(twist, places[1], axis=0)
    linear, spin, linear_change, spin_change = (
        np.einsum("nji,nj->ni", turn, vectors)
        for vectors in (twist[:, :3], twist[:, 3:], changes[:, :3], changes[:, 3:])
    )
    cog = np.array(payload.cog)
    xx, yy, zz, xy, xz, yz = payload.inertia
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    frame = rotvec_to_matrix(limit.frame[3:])
    lever = cog - np.array(limit.frame[:3])

    def magnitude(acceleration: NDArray[np.float64], moment: NDArray[np.float64]) -> NDArray[np.float64]:
        force = payload.mass * acceleration
        moment = moment + np.cross(lever, force)
        wrench: NDArray[np.float64] = np.concatenate([force @ frame, moment @ frame], axis=1)
        return np.abs(wrench)

    return (
        magnitude(linear + np.cross(spin, cog), spin @ inertia),
        magnitude(
            linear_change + np.cross(spin_change, cog) + np.cross(spin, np.cross(spin, cog)),
            spin_change @ inertia + np.cross(spin, spin @ inertia),
        ),
    )


class MovePlanner:
    """Plans moves of one arm."""

    def __init__(self, dynamics: ArmDynamics, planning: PlanningSettings, tool: ToolSettings) -> None:
        self._dynamics = dynamics
        self._planning = planning
        self._tool = tool

    def limited(self, leg: Leg) -> Leg:
        """Return a move that accelerates what the tool carries by no more than the limited wrench.

        A duration that is too short is given up. Source: script manual e-Series 5.2x, tool_wrench_limit_set:
        the wrench that motion causes, without gravity, in a frame at the flange; axes without a limit are
        free. Chosen: the wrench is that of the declared payload, at points of the path; half of a limit is
        left for the change of direction, so the speed is lowered first, then the acceleration. Not limited:
        blends, streams (servoj, speedj, ...), overlays and stops.
        """
        limit, payload = self._planning.tool_wrench_limit, self._tool.payload
        if limit is None or leg.path.length <= 0.0 or payload.mass <= 0.0:
            return leg
        per_acceleration, per_square = _wrenches(leg, limit, payload)
        most, planned = np.array(limit.most), leg.with_duration()
        v = min(planned.v, _least(0.5 * most / np.maximum(per_square, _NOTHING)) ** 0.5)
        left = most - per_square * v**2
        a = min(planned.a, _least(left / np.maximum(per_acceleration, _NOTHING)))
        return leg if (a, v) == (planned.a, planned.v) else replace(leg, a=a, v=v, t=0.0)

    def usual(self, leg: Leg) -> Leg:
        """Return a move of movej or movel in the motion version that is set."""
        if leg.t > 0.0:
            # The tool is slowed down where its joints would be too fast; its ramps are at the ends.
            a, v = self._greatest(leg, 1)
            leg = replace(leg, a_max=a, v_max=v if isinstance(leg.path, JointLine) else leg.v_max)
        leg = self.limited(leg)
        if self._planning.motion_version == 1:
            return leg
        a, v = self._greatest(leg)
        return self._smooth(replace(leg, a=min(leg.a, a), v=min(leg.v, v)))

    def optimal(self, leg: Leg, a_share: float, v_share: float) -> Leg:
        """Return a move with shares of the greatest acceleration and speed along its path."""
        a, v = self._greatest(leg)
        return self._smooth(self.limited(replace(leg, a=a_share * a, v=v_share * v)))

    def _smooth(self, leg: Leg) -> Leg:
        if leg.r > 0.0:
            return leg
        window = self._planning.smoothing
        if leg.t > 0.0:
            window = min(window, 0.5 * leg.t)
            leg = replace(leg, t=leg.t - window)
        return replace(leg, smoothing=window)

    def _greatest(self, leg: Leg, parts: int = _PARTS) -> tuple[float, float]:
        """Return the greatest acceleration and speed at the ends of equal parts of a path.

        Units are those of the path [unit/s^2, unit/s].
        """
        a = v = inf
        robot = leg.tool.arm.robot
        if leg.path.length > 0.0:
            for q, slope in _motions(leg, (leg.path.length * k / parts for k in range(parts + 1))):
                a = min(a, self._dynamics.greatest_acceleration(q, slope))
                for most, rate in zip(robot.qd_max, slope, strict=True):
                    v = min(v, _TOP_SHARE * most / abs(rate)) if rate else v
        return (a, v) if a < inf else (leg.a, leg.v)
