"""What programs have set up about errors and limits. Some settings are only kept: they have no effect here.

Source: URScript manual CB3 3.15, module motion.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from protocol.primary.messages import ReportLevel
from protocol.ur_types import JOINT_NAMES
from ur_emulator.controller.events import ErrorReported, Event
from ur_emulator.controller.safety.limit_checks import MAX_POSITION_DEVIATION
from ur_emulator.models.robot_model import Vector6

# Code of the log entry; the real one is not known.
DEVIATION_CODE = 174


@dataclass(slots=True)
class ErrorSettings:
    """Settings of `pause_on_error_code` and related builtins.

    Attributes:
        pause_codes: (code, argument or None for any) at which the program pauses.
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

    def pause_on(self, code: int, argument: int | None) -> None:
        """Pause the program when an error is reported; None: with any argument."""
        self.pause_codes.add((code, argument))

    def program_ended(self) -> None:
        """Forget the errors at which the program was to be paused."""
        self.pause_codes.clear()

    def warn_of_deviation(self, enabled: bool, threshold: float) -> None:
        """Report joints that deviate by this part of the limit, or do not."""
        self.warns_of_deviation, self.deviation_threshold = enabled, threshold

    def set_transition_hardness(self, hardness: int) -> None:
        """Set how a safeguard stop and reduced mode begin: 0 hard, 1 soft."""
        self.transition_hardness = hardness

    def set_revolution_reference(self, q: Vector6) -> None:
        """Keep the joint positions of `reset_revolution_counter` [rad]."""
        self.revolution_reference = q

    def set_high_holding_torque(self, enabled: bool) -> None:
        """Let a resting arm give way further before it is stopped, or as a moving one."""
        self.holds_high = enabled

    def must_pause(self, events: Iterable[Event]) -> bool:
        """True when one of the events is an error code at which the program is to be paused."""
        return any(
            isinstance(event, ErrorReported)
            and not self.pause_codes.isdisjoint(((event.code, None), (event.code, event.argument)))
            for event in events
        )

    def deviation_warning(self, position_error: tuple[float, ...]) -> ErrorReported | None:
        """Return the log entry when a joint begins to deviate too far, once until it is back.

        Args:
            position_error: delayed target minus true position [rad], (6,).
        """
        error, joint = max((abs(error), joint) for joint, error in enumerate(position_error))
        was_warned, self._has_warned = (
            self._has_warned,
            error > self.deviation_threshold * MAX_POSITION_DEVIATION,
        )
        if was_warned or not self._has_warned:
            return None
        return ErrorReported(
            DEVIATION_CODE, joint, ReportLevel.INFO, f"Large position deviation: {JOINT_NAMES[joint]}"
        )
