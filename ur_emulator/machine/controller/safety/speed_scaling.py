"""Speed scaling: the speed slider, and the limits of reduced, recovery and manual mode.

In these modes the time on the path runs slower, so that no joint, nor TCP or elbow, exceeds its limit.

The limits are those of the robot's generation. Source of tolerance and patience: UR3 and UR5/CB3 user
manuals. That the controller slows down instead of stopping is chosen.
"""

from dataclasses import dataclass
from math import hypot, isfinite, radians

from protocol.ur_types import JOINT_NAMES, SafetyMode
from ur_emulator.machine.controller.arm_in_space import ArmInSpace
from ur_emulator.machine.controller.safety.limit_checks import Violation, protective_stop
from ur_emulator.machine.controller.safety.safety_state import ConfiguredLimits
from ur_emulator.machine.kinematics.arm_model import ArmModel, CartesianState
from ur_emulator.machine.models.robot_model import Vector6, six
from ur_emulator.machine.models.safety_limits import UNLIMITED, ArmLimits, SafetyLimits
from ur_emulator.machine.motion.arm_motion import SCALING_RATE, ArmMotion
from ur_emulator.machine.plant.arm_plant import PlantState
from ur_hil.arithmetic import add_up

TOLERANCE = radians(1.15)
# Tolerance of the limits of TCP, force, power and momentum, as a share; chosen.
ARM_TOLERANCE = 0.05
# Above a limit for longer than this is a protective stop [s].
PATIENCE = 0.5
# The controller stays below the limit by this share, so that noise and lag do not cross it.
AIM = 0.95


@dataclass(frozen=True, slots=True)
class ModeLimits:
    """Limits that hold in a mode; those of the joints are speeds [rad/s]."""

    joints: Vector6
    arm: ArmLimits


def limits_of_mode(
    mode: SafetyMode, is_manual: bool, limits: ConfiguredLimits, rules: SafetyLimits
) -> ModeLimits | None:
    """Return what is allowed in a mode; None where only the rated joint speeds hold."""
    manual = rules.manual if is_manual else UNLIMITED
    match mode:
        case SafetyMode.REDUCED:
            return ModeLimits(limits.reduced_speed, manual.within(limits.reduced_arm))
        case SafetyMode.RECOVERY:
            return ModeLimits(limits.recovery_speed, manual.within(rules.recovery))
    arm = manual.within(limits.arm)
    return None if arm == UNLIMITED else ModeLimits(limits.speed, arm)


class SpeedLimiter:
    """Keeps speeds below the limits of a mode; `scale` is the speed scaling asked for in this cycle, 0..1."""

    def __init__(self, limits: ModeLimits, scale: float, hard: bool) -> None:
        """Begin with the scale in force; `hard`: slow down as in a stop, else as the speed slider."""
        self.scale = scale
        self._limits = limits
        self._hard = hard
        self._exceeded_s = 0.0

    def step(self, motion: ArmMotion, arm: ArmModel, tcp: Vector6, slider: float, dt: float) -> float:
        """Return the scale for the next cycle; the path is slowed down to keep the limits.

        `tcp` is in the flange frame; `slider` 0..1; `dt` is the duration of a cycle [s].
        """
        target = motion.target
        ahead = six([qd + qdd * dt for qd, qdd in zip(target.qd, target.qdd, strict=True)])
        load = max(abs(qd) / limit for qd, limit in zip(ahead, self._limits.joints, strict=True))
        if isfinite(self._limits.arm.tool_speed):
            load = max(load, _tool_speed(arm.state(target.q, ahead, tcp)) / self._limits.arm.tool_speed)
        scale = slider if load <= 0.0 else min(slider, motion.scale * AIM / load)
        rate = SCALING_RATE
        if self._hard and (speed := max(map(abs, target.qd))) > 0.0:
            rate = max(rate, motion.stop_deceleration * motion.scale / speed)
        motion.scaling_rate = rate if scale < motion.scale else SCALING_RATE
        self.scale = scale
        return scale

    def find_violation(self, sensed: PlantState, space: ArmInSpace, dt: float) -> Violation | None:
        """Return the protective stop for what has exceeded a limit for too long, or None.

        `space` is the arm in the last cycle, `dt` the duration of a cycle [s].
        """
        violation = self._joint_violation(sensed.actual_qd) or self._arm_violation(sensed, space)
        self._exceeded_s = 0.0 if violation is None else self._exceeded_s + dt
        return violation if self._exceeded_s > PATIENCE else None

    def _joint_violation(self, actual_qd: Vector6) -> Violation | None:
        limits = self._limits.joints
        excess = [abs(qd) - limit for qd, limit in zip(actual_qd, limits, strict=True)]
        worst = max(range(6), key=excess.__getitem__)
        if excess[worst] <= TOLERANCE:
            return None
        text = (
            f"Protective Stop: Joint speed limit violated: {JOINT_NAMES[worst]} at "
            f"{abs(actual_qd[worst]):.3f} rad/s, limit {limits[worst]:.3f}"
        )
        return protective_stop(191, 32 + worst, text)

    def _arm_violation(self, sensed: PlantState, space: ArmInSpace) -> Violation | None:
        limits = self._limits.arm
        if limits == UNLIMITED:
            return None
        power = add_up(
            abs(moment * qd) for moment, qd in zip(sensed.target_moment, sensed.actual_qd, strict=True)
        )
        for code, argument, name, unit, value, limit in (
            (191, 3, "TCP speed", "m/s", _tool_speed(space.actual), limits.tool_speed),
            (0, 0, "Force", "N", hypot(*space.tcp_force[:3]), limits.force),
            (191, 6, "Power", "W", power, limits.power),
            (191, 12, "Momentum", "kg m/s", space.actual.momentum, limits.momentum),
        ):
            if value > limit * (1.0 + ARM_TOLERANCE):
                text = f"Protective Stop: {name} limit violated: {value:.3f} {unit}, limit {limit:g}"
                return protective_stop(code, argument, text)
        return None


def _tool_speed(arm: CartesianState) -> float:
    """Return the speed of TCP or elbow, whichever is faster [m/s]."""
    return max(hypot(*arm.tcp_speed[:3]), hypot(*arm.elbow_velocity))


@dataclass(slots=True)
class SpeedScaling:
    """Rate of the time on the path, by speed slider (0..1) and the limits of the safety mode."""

    slider: float = 1.0
    limiter: SpeedLimiter | None = None

    @property
    def share(self) -> float:
        """Part of the slider's speed that the limits allow, 0..1."""
        if self.limiter is None or self.slider <= 0.0:
            return 1.0
        return min(1.0, self.limiter.scale / self.slider)
