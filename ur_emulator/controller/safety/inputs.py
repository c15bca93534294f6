"""Buttons and inputs of the safety system: their states, and the events of their changes.

Commands and configurable inputs may activate a function at the same time; it ends when none of them does.
Source: UR3/CB3 user manual, safety I/O: low is the safe state, both channels of a pair are looked at. That a
pair whose channels differ is not a fault is chosen.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from ur_emulator.controller.io.lines import CONFIGURABLE
from ur_emulator.controller.safety.modes import SafetyEvent

N_INPUT_PAIRS = CONFIGURABLE.count // 2


class SafetyInput(Enum):
    """What a pair of configurable inputs can be set up for. Source: UR3/CB3 manual, configurable I/O."""

    EMERGENCY_STOP = "emergency stop"  # low presses the system emergency stop
    REDUCED = "reduced"  # low switches reduced mode on
    SAFEGUARD_RESET = "safeguard reset"  # a rising edge resets


_PRESSED = {
    "robot": SafetyEvent.ROBOT_EMERGENCY_PRESSED,
    "system": SafetyEvent.SYSTEM_EMERGENCY_PRESSED,
}
_RELEASED = {
    "robot": SafetyEvent.ROBOT_EMERGENCY_RELEASED,
    "system": SafetyEvent.SYSTEM_EMERGENCY_RELEASED,
}


class SafetyInputs:
    """Which functions are active, and by whom.

    Attributes:
        assigned: pairs of configurable inputs that are set up.
    """

    def __init__(self, handle: Callable[[SafetyEvent], None]) -> None:
        self._handle = handle
        self.assigned: dict[int, SafetyInput] = {}
        self._pressed: set[tuple[str, str]] = set()
        self._reducing: set[str] = set()
        self._is_open = self._needs_reset = False
        self._reset_was_high: bool | None = None

    # --- emergency stops

    def press(self, kind: str, who: str = "command") -> None:
        """Press an emergency stop: "robot" or "system"."""
        self._pressed.add((kind, who))
        self._handle(_PRESSED[kind])

    def release(self, who: str = "command") -> None:
        """Release those that `who` has pressed; the others stay."""
        self._pressed = {press for press in self._pressed if press[1] != who}
        held = {kind for kind, _ in self._pressed}
        for kind, event in _RELEASED.items():
            if kind not in held:
                self._handle(event)

    # --- safeguard

    def guard(self, is_open: bool) -> None:
        """Open or close the safeguard."""
        self._is_open = is_open
        if is_open:
            self._handle(SafetyEvent.SAFEGUARD_OPENED)
        elif not self._needs_reset:
            self._handle(SafetyEvent.SAFEGUARD_RESTORED)

    def require_reset(self, required: bool) -> None:
        """Set up whether closing is enough."""
        self._needs_reset = required
        if not self._is_open and not required:
            self._handle(SafetyEvent.SAFEGUARD_RESTORED)

    def reset(self) -> None:
        """Press the reset button."""
        if not self._is_open:
            self._handle(SafetyEvent.SAFEGUARD_RESTORED)

    # --- reduced mode

    def reduce(self, active: bool, who: str = "command") -> None:
        """Switch reduced mode on or off."""
        (self._reducing.add if active else self._reducing.discard)(who)
        self._handle(SafetyEvent.REDUCED_ON if self._reducing else SafetyEvent.REDUCED_OFF)

    # --- configurable inputs

    def assign(self, pair: int, function: SafetyInput | None) -> None:
        """Set up a pair of configurable inputs."""
        if function is None:
            self.assigned.pop(pair, None)
        else:
            self.assigned[pair] = function
        functions = self.assigned.values()
        if SafetyInput.EMERGENCY_STOP not in functions:
            self.release("input")
        if SafetyInput.REDUCED not in functions:
            self.reduce(False, "input")
        if SafetyInput.SAFEGUARD_RESET not in functions:
            self._reset_was_high = None

    def step(self, digital_in: int) -> None:
        """Read the inputs that are set up."""
        high = dict.fromkeys(self.assigned.values(), True)
        for pair, function in self.assigned.items():
            lines = digital_in >> (CONFIGURABLE.first + 2 * pair) & 3
            high[function] = high[function] and lines == 3
        pressed = high.get(SafetyInput.EMERGENCY_STOP) is False
        if pressed != (("system", "input") in self._pressed):
            if pressed:
                self.press("system", "input")
            else:
                self.release("input")
        reduced = high.get(SafetyInput.REDUCED) is False
        if reduced != ("input" in self._reducing):
            self.reduce(reduced, "input")
        reset = high.get(SafetyInput.SAFEGUARD_RESET)
        if reset and self._reset_was_high is False:
            self.reset()
        self._reset_was_high = reset
