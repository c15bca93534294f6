"""What stops the arm by itself: limit checks, and the protective stop they lead to.

`SetpointCheck` checks the next set-point, `JointWatch` the measured state.
Sources: joint limits and torque limits of the robot model; C153 "position deviates from path" and C204
"invalid setpoints" from user reports. The thresholds of the deviation are not published; those here are
chosen (docs/fidelity.md).
"""

from dataclasses import dataclass
from math import cos, hypot, sin
from operator import sub

from protocol.primary.messages import ReportLevel
from protocol.ur_types import JOINT_NAMES
from ur_emulator.machine.controller.events import ErrorReported
from ur_emulator.machine.controller.safety.safety_state import ConfiguredLimits
from ur_emulator.machine.models.robot_model import RobotModel, Vector6
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.plant.arm_plant import PlantState

# A joint this far from its (delayed) target is blocked or pushed [rad].
MAX_POSITION_DEVIATION = 0.15
# A drive at its torque limit for longer than this cannot follow [s].
MAX_SATURATION_TIME = 0.1
# For the high holding torque a joint is at rest up to this speed [rad/s]. Source: see `JointWatch`.
RESTING_SPEED = 0.01
# Rounding of a joint speed.
SPEED_TOLERANCE = 1.0 + 1e-6


@dataclass(frozen=True, slots=True)
class Violation:
    """Why a protective stop begins. `blocked`: the arm is away from its target, which must be dropped."""

    error: ErrorReported
    blocked: bool = False


def protective_stop(code: int, argument: int, text: str, *, blocked: bool = False) -> Violation:
    """Return the violation that clients are told of by a code, its argument and a text."""
    return Violation(ErrorReported(code, argument, ReportLevel.WARNING, text), blocked)


class SetpointCheck:
    """Checks each set-point before the joints get it.

    Joint ranges include the distance that a protective stop needs, with its deceleration [rad/s^2], so that
    the arm comes to rest within them. A joint outside its range, because something pushed it, may move back.
    """

    def __init__(self, robot: RobotModel, period_s: float) -> None:
        self._robot = robot
        self._period_s = period_s
        self._braking = 0.5 / robot.stop_deceleration
        self._limits: ConfiguredLimits | None = None
        self._safe_speed = self._safe_reach = 0.0

    def find_invalid(
        self, limits: ConfiguredLimits, before: JointTarget, target: JointTarget
    ) -> Violation | None:
        """Return what is wrong with the set-point `target`, which follows `before`; None: nothing."""
        least = self._robot.generation.limits.clamping_distance
        if least and target.q[3:5] != before.q[3:5]:
            gap = clamping_gap(self._robot, target.q)
            if gap < least and gap < clamping_gap(self._robot, before.q):
                return CLAMPING
        if limits is not self._limits:
            # Below these no joint can exceed its own limit: most set-points need no check joint by joint.
            self._limits = limits
            self._safe_speed = min(limits.speed)
            self._safe_reach = min(*limits.q_max, *(-low for low in limits.q_min))
        # Norms are at least as large as each joint's value, and not a number where one is not.
        fastest = hypot(*target.qd)
        steepest = hypot(*map(sub, target.q, before.q)) / self._period_s
        reach = max(map(abs, target.q)) + fastest * fastest * self._braking
        if fastest <= self._safe_speed >= steepest and reach <= self._safe_reach:
            return None
        braking_time = max(map(abs, target.qd)) / (2.0 * self._robot.stop_deceleration)
        for i, (q_before, q, qd, limit, low, high) in enumerate(
            zip(before.q, target.q, target.qd, limits.speed, limits.q_min, limits.q_max, strict=True)
        ):
            step, most = abs(q - q_before) / self._period_s, limit * SPEED_TOLERANCE
            if not (abs(qd) <= most and step <= most):  # one that is not a number is invalid
                speed = max(step, abs(qd))
                return _invalid_setpoint(i, f"{speed:.4g} rad/s, limit {limit:.3f}")
            reach = q + qd * braking_time
            if (reach > high and q > q_before) or (reach < low and q < q_before):
                return _invalid_setpoint(i, f"{q:.3f} rad, limits {low:.3f} to {high:.3f}")
        return None


def _invalid_setpoint(joint: int, value: str) -> Violation:
    text = f"Protective Stop: Invalid setpoints: {JOINT_NAMES[joint]} at {value}"
    return protective_stop(204, joint, text)


# Of the cylinder around the forearm and of the sphere around the flange that no hand may come between [m].
# Source of radii, distance and code: the maker by a user of a UR5e.
_CLAMPING_RADIUS = 0.0375
CLAMPING = protective_stop(
    403, 0, "Protective Stop: Danger of clamping between the Robot's lower arm and tool"
)


def clamping_gap(robot: RobotModel, q: Vector6) -> float:
    """Return the distance of the cylinder around the forearm and the sphere around the flange [m].

    Both in the frame of the forearm, in which wrists 1 and 2 move the flange. Chosen: the axis of the
    cylinder is that of the housing.
    """
    _, _, elbow, wrist_1, wrist_2, wrist_3 = robot.dh
    c4, s4, c5, s5 = cos(q[3]), sin(q[3]), cos(q[4]), sin(q[4])
    x = wrist_2.d * s4 - wrist_3.d * s5 * c4
    y = -wrist_2.d * c4 - wrist_3.d * s5 * s4
    z = wrist_1.d + wrist_3.d * c5 - robot.outline.forearm[0]
    return hypot(x - min(max(x, 0.0), -elbow.a), y, z) - 2.0 * _CLAMPING_RADIUS


# The arm cannot go where a tool path leads. The real code is not known: 204 is that of other set-points.
UNREACHABLE_PATH = protective_stop(
    204, 0, "Protective Stop: Invalid setpoints: the path leads to a pose that the robot cannot reach"
)


def most_loaded_joint(robot: RobotModel, currents: tuple[float, ...]) -> int:
    """Return the joint whose drive needs the greatest part of its torque; currents [A], (6,)."""
    shares = torque_shares(robot, currents)
    return shares.index(max(shares))


def torque_shares(robot: RobotModel, currents: tuple[float, ...]) -> list[float]:
    """Return the part of its torque that each drive needs; arguments as in `most_loaded_joint`."""
    return [
        abs(current) * constant / limit
        for current, constant, limit in zip(currents, robot.torque_constant, robot.tau_max, strict=True)
    ]


class JointWatch:
    """Watches that the joints follow their set-point.

    A resting arm of some generations gives way further, with all torque, before it is stopped
    (`SafetyLimits.holding_deviation`). Source: URScript manual e-Series 5.15, high_holding_torque_disable:
    while a program runs, no joint moves faster than 0.01 rad/s, and the target rests. Chosen: once it has
    begun it lasts until the target moves.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._period_s = robot.generation.period_s
        self._holding_deviation = robot.generation.limits.holding_deviation
        self._holds = False
        self._saturated_s = 0.0

    def count_saturation(self, sensed: PlantState) -> None:
        """Count, in every cycle, for how long a drive has been at its torque limit without a break."""
        self._saturated_s = self._saturated_s + self._period_s if sensed.torque_saturated else 0.0

    def find_violation(self, sensed: PlantState, target_qd: Vector6, *, may_hold: bool) -> Violation | None:
        """Return a violation by the measured state, or None.

        `target_qd` are the speeds of the set-point [rad/s]; a resting arm may hold with all torque while a
        program runs that has not switched it off.
        """
        most, holding = MAX_POSITION_DEVIATION, self._holding_deviation
        if holding is not None:
            rests = may_hold and not any(target_qd)
            self._holds = rests and (self._holds or max(map(abs, sensed.actual_qd)) <= RESTING_SPEED)
            most = holding if self._holds else most
        errors = sensed.position_error
        if max(errors) > most or min(errors) < -most:
            i = next(i for i, error in enumerate(errors) if abs(error) > most)
            text = f"Protective stop: position deviates from path: {JOINT_NAMES[i]}"
            return protective_stop(153, i, text, blocked=True)
        if self._saturated_s > MAX_SATURATION_TIME and not self._holds:
            joint = most_loaded_joint(self._robot, sensed.joint_control_output)
            text = f"Protective stop: Collision detected by joint: {JOINT_NAMES[joint]}"
            return protective_stop(157, joint, text, blocked=True)
        return None
