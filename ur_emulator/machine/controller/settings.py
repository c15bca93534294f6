"""What programs declare: tool and payload, how moves are planned, errors and limits.

Sources: URScript manual CB3 3.15, module motion; e-Series 5.22, motion versions, 5.24,
jerk_gain_scaling_set, and 5.19, tool_wrench_limit_set.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from protocol.primary.messages import ReportLevel
from protocol.ur_types import JOINT_NAMES
from ur_emulator.machine.controller.events import ErrorReported, Event
from ur_emulator.machine.controller.safety.limit_checks import MAX_POSITION_DEVIATION
from ur_emulator.machine.models.robot_model import ZERO6, Vector3, Vector6, six


@dataclass(frozen=True, slots=True)
class Payload:
    """What the controller assumes at the flange: mass [kg], centre of gravity [m] in the flange frame.

    `at_tcp`: no centre of gravity was given; it is the TCP, also after a later change of the TCP. Source:
    URScript manual, set_payload.
    `inertia`: as declared, Ixx Iyy Izz Ixy Ixz Iyz about the centre of gravity [kg m^2]; zero: not known.
    """

    mass: float = 0.0
    cog: Vector3 = (0.0, 0.0, 0.0)
    at_tcp: bool = False
    inertia: Vector6 = ZERO6

    def towards(self, goal: Payload, share: float) -> Payload:
        """Return the payload a share of the way to another one, 0..1."""

        def between(a: Sequence[float], b: Sequence[float]) -> list[float]:
            return [x + share * (y - x) for x, y in zip(a, b, strict=True)]

        (mass,), (x, y, z) = between([self.mass], [goal.mass]), between(self.cog, goal.cog)
        return Payload(mass, (x, y, z), inertia=six(between(self.inertia, goal.inertia)))


class ToolSettings:
    """What programs declare about the tool and the mounting.

    Attributes:
        tcp_offset: pose of the TCP in the flange frame [m, rotation vector in rad].
        payload: mass, centre of gravity and inertia.
        gravity: acceleration in the base frame [m/s^2]; it is only kept.
        base_acceleration: of the base [m/s^2]; it is only kept.
    """

    __slots__ = ("_change", "base_acceleration", "gravity", "payload", "tcp_offset")

    def __init__(self) -> None:
        self.tcp_offset: Vector6 = ZERO6
        self.payload = Payload()
        # A change of the payload in steps: before, after, number of steps done, and of all.
        self._change: tuple[Payload, Payload, int, int] | None = None
        self.gravity: Vector3 = (0.0, 0.0, 9.82)
        self.base_acceleration: Vector3 = (0.0, 0.0, 0.0)

    def set_tcp(self, offset: Vector6) -> None:
        """Set the TCP, and with it the centre of gravity of a payload that has none of its own."""
        if self.payload.at_tcp:
            self.change_payload(Payload(self.payload.mass, offset[:3], at_tcp=True))
        self.tcp_offset = offset

    def change_payload(self, payload: Payload, cycles: int = 0) -> None:
        """Change the payload, at once or on a straight line over so many cycles."""
        self._change = (self.payload, payload, 0, cycles) if cycles > 1 else None
        if self._change is None:
            self.payload = payload

    @property
    def is_changing(self) -> bool:
        """The payload is on its way to another one."""
        return self._change is not None

    def step(self) -> None:
        """Advance a change of the payload by a cycle."""
        if self._change is None:
            return
        before, after, step, steps = self._change
        step += 1
        if step < steps:
            self.payload = before.towards(after, step / steps)
            self._change = (before, after, step, steps)
        else:
            self.change_payload(after)


# Accelerations of jerk-limited moves change within this time at a gain of 1 [s]. Chosen.
JERK_TIME = 0.1


@dataclass(frozen=True, slots=True)
class ToolWrenchLimit:
    """Greatest wrench that motion may cause on the payload, along and about the axes of a frame.

    The frame is in that of the flange; `most` are magnitudes [N, Nm], infinite where nothing is limited.
    """

    frame: Vector6
    most: Vector6


@dataclass(slots=True)
class PlanningSettings:
    """Settings that stay until the controller ends.

    Attributes:
        motion_version: 1, or 2: movej and movel are jerk-limited, and their limits are those of the arm.
        jerk_gain: share of the jerk limit, 0.01 to 1.
    """

    motion_version: int = 1
    jerk_gain: float = 1.0
    tool_wrench_limit: ToolWrenchLimit | None = None

    @property
    def smoothing(self) -> float:
        """Time in which the acceleration of a jerk-limited move changes [s]."""
        return JERK_TIME / self.jerk_gain


# Code of the log entry; the real one is not known.
DEVIATION_CODE = 174


@dataclass(slots=True)
class ErrorSettings:
    """Settings of `pause_on_error_code` and related builtins. Some have no effect here: they are only kept.

    Attributes:
        pause_codes: (code, argument or None for any) at which the present program pauses.
        warns_of_deviation: whether joints that deviate from the path are reported.
        deviation_threshold: part of the deviation limit at which to warn.
        transition_hardness: of safeguard stops and reduced mode: 0 hard, 1 soft.
        revolution_reference: joint positions of the last `reset_revolution_counter` [rad]; kept only.
        holds_high: a resting arm of the e-Series may give way further before it is stopped.
    """

    pause_codes: set[tuple[int, int | None]] = field(default_factory=set)
    warns_of_deviation: bool = False
    deviation_threshold: float = 0.8
    transition_hardness: int = 0
    revolution_reference: Vector6 | None = None
    holds_high: bool = True
    _has_warned: bool = False

    def must_pause(self, events: Iterable[Event]) -> bool:
        """True when one of the events is an error code at which the program is to be paused."""
        return any(
            isinstance(event, ErrorReported)
            and not self.pause_codes.isdisjoint(((event.code, None), (event.code, event.argument)))
            for event in events
        )

    def deviation_warning(self, position_error: tuple[float, ...]) -> ErrorReported | None:
        """Return the log entry when a joint begins to deviate too far, once until it is back.

        `position_error` (6,) is the delayed target minus the true position [rad].
        """
        error, joint = max((abs(error), joint) for joint, error in enumerate(position_error))
        was_warned = self._has_warned
        self._has_warned = error > self.deviation_threshold * MAX_POSITION_DEVIATION
        if was_warned or not self._has_warned:
            return None
        text = f"Large position deviation: {JOINT_NAMES[joint]}"
        return ErrorReported(DEVIATION_CODE, joint, ReportLevel.INFO, text)
