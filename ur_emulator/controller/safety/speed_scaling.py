"""Speed scaling: the speed slider, and the joint limits of reduced and recovery mode.

In these modes the time on the path runs slower, so that no joint exceeds its limit.

The limits are those of the robot's generation. Source of tolerance and patience: UR3 and UR5/CB3 user
manuals. That the controller slows down instead of stopping is chosen.
"""

from __future__ import annotations

from math import radians

from protocol.primary.messages import ReportLevel
from protocol.ur_types import JOINT_NAMES, SafetyMode
from ur_emulator.controller.events import ErrorReported
from ur_emulator.controller.safety.joint_limits import JointLimits
from ur_emulator.controller.safety.limit_checks import Violation
from ur_emulator.models.robot_model import Vector6
from ur_emulator.motion.arm_motion import ArmMotion
from ur_emulator.motion.path_motion import SCALING_RATE

TOLERANCE = radians(1.15)
# A joint above its limit for longer than this is a protective stop [s].
PATIENCE = 0.5
# The controller stays below the limit by this share, so that noise and lag do not cross it.
AIM = 0.95


def allowed_speeds(mode: SafetyMode, limits: JointLimits) -> Vector6 | None:
    """Return the joint speeds allowed in a mode [rad/s]; None for the rated ones."""
    if mode is SafetyMode.REDUCED:
        return limits.reduced_speed
    return limits.recovery_speed if mode is SafetyMode.RECOVERY else None


class SpeedLimiter:
    """Keeps joint speeds below limits.

    Attributes:
        scale: speed scaling asked for in this cycle, 0..1.
    """

    def __init__(self, limits: Vector6, scale: float, hard: bool) -> None:
        """Begin.

        Args:
            limits: of the joints [rad/s].
            scale: in force until now.
            hard: slow down with the deceleration of a stop, else with the rate of the speed slider.
        """
        self.scale = scale
        self._limits = limits
        self._hard = hard
        self._exceeded_s = 0.0

    def step(self, motion: ArmMotion, slider: float, dt: float) -> float:
        """Return the scale for the next cycle; the path is slowed down to keep the limits.

        Args:
            motion: of the arm; the rate of its scaling is set.
            slider: speed slider, 0..1.
            dt: duration of a cycle [s].
        """
        target = motion.target
        load = max(
            abs(qd + qdd * dt) / limit
            for qd, qdd, limit in zip(target.qd, target.qdd, self._limits, strict=True)
        )
        scale = slider if load <= 0.0 else min(slider, motion.scale * AIM / load)
        rate = SCALING_RATE
        if self._hard and (speed := max(map(abs, target.qd))) > 0.0:
            rate = max(rate, motion.stop_deceleration * motion.scale / speed)
        motion.scaling_rate = rate if scale < motion.scale else SCALING_RATE
        self.scale = scale
        return scale

    def share(self, slider: float) -> float:
        """Return the part of the slider's speed that the limits allow, 0..1."""
        return min(1.0, self.scale / slider) if slider > 0.0 else 1.0

    def find_violation(self, actual_qd: Vector6, dt: float) -> Violation | None:
        """Return the protective stop for a joint that has been too fast for too long, or None."""
        excess = [abs(qd) - limit for qd, limit in zip(actual_qd, self._limits, strict=True)]
        worst = max(range(6), key=excess.__getitem__)
        if excess[worst] <= TOLERANCE:
            self._exceeded_s = 0.0
            return None
        self._exceeded_s += dt
        if self._exceeded_s <= PATIENCE:
            return None
        text = (
            f"Protective Stop: Joint speed limit violated: {JOINT_NAMES[worst]} at "
            f"{abs(actual_qd[worst]):.3f} rad/s, limit {self._limits[worst]:.3f}"
        )
        return Violation(ErrorReported(191, 32 + worst, ReportLevel.WARNING, text))


class SpeedScaling:
    """Rate of the time on the path, by speed slider and safety mode.

    Attributes:
        slider: speed slider, 0..1.
        limiter: keeps joint speeds below the limits of the safety mode; None in a mode that has none.
    """

    __slots__ = ("limiter", "slider")

    def __init__(self) -> None:
        self.slider = 1.0
        self.limiter: SpeedLimiter | None = None

    def set_slider(self, fraction: float) -> None:
        """Set the speed slider, 0..1."""
        self.slider = fraction

    def set_limiter(self, limiter: SpeedLimiter | None) -> None:
        """Limit the joint speeds from now on, or no longer."""
        self.limiter = limiter

    def step(self, motion: ArmMotion, dt: float) -> float:
        """Return the scale for the next cycle; arguments as in `SpeedLimiter.step`."""
        return self.slider if self.limiter is None else self.limiter.step(motion, self.slider, dt)

    @property
    def share(self) -> float:
        """Part of the slider's speed that the limits allow, 0..1."""
        return 1.0 if self.limiter is None else self.limiter.share(self.slider)
