"""The three-position enabling device of an e-Series box as a table.

Source: UR5e hardware manual 2022: stop when fully released or fully pressed; from automatic to manual mode it
must be released and pressed again. That it enables from full pressure only after a release: IEC 60947-5-8.
"""

from __future__ import annotations

from enum import Enum


class EnablingAct(Enum):
    """What happens to the device; the values but the last are those of the control API."""

    DISCONNECT = "none"
    RELEASE = "released"
    PRESS = "pressed"  # into its middle position
    PRESS_FULLY = "fully pressed"
    BEGIN_MANUAL_MODE = "manual mode begins"


class EnablingState(Enum):
    """Where the device is."""

    NO_DEVICE = "no device"
    RELEASED = "released"
    ENABLING = "in the middle"
    FULLY_PRESSED = "fully pressed"
    TO_BE_RELEASED = "in the middle, must be released first"


_S, _A = EnablingState, EnablingAct
# A pair that is not listed changes nothing.
TRANSITIONS: dict[tuple[EnablingState, EnablingAct], EnablingState] = {
    **{(state, _A.DISCONNECT): _S.NO_DEVICE for state in _S},
    **{(state, _A.RELEASE): _S.RELEASED for state in _S},
    **{(state, _A.PRESS_FULLY): _S.FULLY_PRESSED for state in _S},
    (_S.NO_DEVICE, _A.PRESS): _S.ENABLING,
    (_S.RELEASED, _A.PRESS): _S.ENABLING,
    (_S.FULLY_PRESSED, _A.PRESS): _S.TO_BE_RELEASED,
    (_S.ENABLING, _A.BEGIN_MANUAL_MODE): _S.TO_BE_RELEASED,
}
# States in which it stops the arm in manual mode, and those in which its input is active.
STOPPING = frozenset({_S.RELEASED, _S.FULLY_PRESSED, _S.TO_BE_RELEASED})
ACTIVE = frozenset({_S.ENABLING, _S.TO_BE_RELEASED})


class EnablingDevice:
    """The device of a box, or none.

    Attributes:
        state: where it is.
    """

    def __init__(self) -> None:
        self.state = EnablingState.NO_DEVICE

    def act(self, act: EnablingAct) -> None:
        """Let something happen to it."""
        self.state = TRANSITIONS.get((self.state, act), self.state)
