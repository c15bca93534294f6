"""SafetyState: the causes that stand, and the safety mode that they lead to."""

from __future__ import annotations

from protocol.ur_types import SafetyMode
from ur_emulator.controller.safety.boundaries import NO_BOUNDARIES, Boundaries
from ur_emulator.controller.safety.configured_limits import ConfiguredLimits
from ur_emulator.controller.safety.modes import MOVING_MODES, ROW, WATCHED_MODES, SafetyEvent, after, mode_of

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
