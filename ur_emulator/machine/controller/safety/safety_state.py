"""The limits that a box is configured to, the causes that stand, and the safety mode they lead to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from protocol.ur_types import SafetyMode
from ur_emulator.machine.controller.safety.boundaries import NO_BOUNDARIES, Boundaries
from ur_emulator.machine.controller.safety.inputs import SafetyInput
from ur_emulator.machine.controller.safety.modes import (
    MOVING_MODES,
    ROW,
    WATCHED_MODES,
    SafetyEvent,
    after,
    mode_of,
)
from ur_emulator.machine.models.robot_model import RobotModel, Vector6, six
from ur_emulator.machine.models.safety_limits import UNLIMITED, ArmLimits


@dataclass(frozen=True, slots=True)
class SafetySettings:
    """The safety configuration in an installation; limits are None where it gives none.

    Attributes:
        q_min, q_max: ends of the joint ranges [rad]; infinite where a joint has no limit.
        joint_speed, reduced_joint_speed: the second in reduced mode [rad/s].
        arm, reduced_arm: likewise.
        unwatched: settings that the safety system does not watch, for the log.
        inputs: pairs of configurable inputs with functions that need operational modes.
    """

    q_min: Vector6 | None = None
    q_max: Vector6 | None = None
    joint_speed: Vector6 | None = None
    reduced_joint_speed: Vector6 | None = None
    arm: ArmLimits | None = None
    reduced_arm: ArmLimits | None = None
    boundaries: Boundaries = NO_BOUNDARIES
    unwatched: tuple[str, ...] = ()
    inputs: Mapping[int, SafetyInput] = field(default_factory=dict)


NO_SETTINGS = SafetySettings()


@dataclass(frozen=True, slots=True)
class ConfiguredLimits:
    """Limits of an arm.

    Attributes:
        q_min, q_max: ends of the joint ranges [rad].
        speed: at which the arm is stopped [rad/s].
        reduced_speed, recovery_speed: allowed in these modes [rad/s].
        arm, reduced_arm: beside those of the joints; the second in reduced mode.
    """

    q_min: Vector6
    q_max: Vector6
    speed: Vector6
    reduced_speed: Vector6
    recovery_speed: Vector6
    arm: ArmLimits
    reduced_arm: ArmLimits
    boundaries: Boundaries = NO_BOUNDARIES

    def allow(self, q: Sequence[float]) -> bool:
        """Whether all joints are within their ranges; angles (6,) [rad]."""
        return all(low <= x <= high for low, x, high in zip(self.q_min, q, self.q_max, strict=True))

    def within(self, settings: SafetySettings) -> ConfiguredLimits:
        """Return the limits with those of an installation, which cannot widen those of the joints."""
        top, arm = _each(min, self.speed, settings.joint_speed), settings.arm or self.arm
        return ConfiguredLimits(
            _each(max, self.q_min, settings.q_min),
            _each(min, self.q_max, settings.q_max),
            top,
            _each(min, top, settings.reduced_joint_speed or self.reduced_speed),
            self.recovery_speed,
            arm,
            arm.within(settings.reduced_arm or self.reduced_arm),
            settings.boundaries,
        )


def limits_of(robot: RobotModel) -> ConfiguredLimits:
    """Return the limits of an arm whose installation sets none."""
    limits = robot.generation.limits
    return ConfiguredLimits(
        robot.q_min,
        robot.q_max,
        robot.qd_safety,
        six([limits.reduced_share * speed for speed in robot.qd_max]),
        (limits.recovery_speed,) * 6,
        UNLIMITED,
        limits.reduced,
    )


def _each(choose: Callable[[float, float], float], own: Vector6, given: Vector6 | None) -> Vector6:
    return own if given is None else six([choose(x, y) for x, y in zip(own, given, strict=True)])


# The dashboard refuses to unlock a protective stop sooner than this [s]. Source: UR dashboard documents.
UNLOCK_DELAY = 5.0


class SafetyState:
    """Which causes stand, and the safety mode that follows from them; see `modes`.

    Attributes:
        status: the mode of the first cause in `modes.MODES`.
        mode: the safety mode: `status`, or what several of them have in common.
        is_stopped: the safety system does not let programs move the arm.
        lets_programs_run: programs may start and go on.
        is_watched: a protective stop would be something new.
        limits: of joints and space, as the installation sets them.
        boundaries: strict limits of this mode; none in recovery mode.
    """

    def __init__(self, limits: ConfiguredLimits, *, has_programs_in_recovery: bool) -> None:
        self.limits = limits
        self._stops_programs = frozenset() if has_programs_in_recovery else {SafetyMode.RECOVERY}
        self._causes: frozenset[SafetyMode] = frozenset()
        self._stopped_since = 0.0
        self._enter(SafetyMode.NORMAL)

    def apply(self, event: SafetyEvent, now: float) -> None:
        """Apply an event at controller time `now` [s]."""
        had_stop = SafetyMode.PROTECTIVE_STOP in self._causes
        self._causes = after(self._causes, event)
        if not had_stop and SafetyMode.PROTECTIVE_STOP in self._causes:
            self._stopped_since = now
        self._enter(mode_of(self._causes))

    def set_limits(self, limits: ConfiguredLimits) -> None:
        """Set the limits of joints and space."""
        self.limits = limits
        self._enter(self.status)

    def has(self, cause: SafetyMode) -> bool:
        """True while the cause of a mode stands, also under a mode of higher rank."""
        return cause in self._causes

    def may_unlock(self, now: float) -> bool:
        """True when the dashboard's `unlock protective stop` is allowed."""
        return self.mode is SafetyMode.PROTECTIVE_STOP and now - self._stopped_since >= UNLOCK_DELAY

    def limits_in_space(self) -> Boundaries:
        """Return the strict limits of normal or reduced mode, whatever stops the arm."""
        return self.limits.boundaries.limits(self.has(SafetyMode.REDUCED))

    def _enter(self, mode: SafetyMode) -> None:
        self.status, self.mode = mode, ROW[mode].safety_mode
        self.is_stopped = mode not in MOVING_MODES
        self.lets_programs_run = not self.is_stopped and mode not in self._stops_programs
        self.is_watched = mode in WATCHED_MODES
        self.boundaries = NO_BOUNDARIES if mode is SafetyMode.RECOVERY else self.limits_in_space()
