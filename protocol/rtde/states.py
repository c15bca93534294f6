"""The answer to every RTDE request in both states of a connection, and the rate of data packages.

Only tables and formulas; `rtde.server_connection` applies them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple

from protocol.rtde.messages import (
    GetControllerVersion,
    Pause,
    Request,
    RequestProtocolVersion,
    SetupInputs,
    SetupOutputs,
    Start,
)

__all__ = ["TRANSITIONS", "RtdeState", "Transition", "cycles_per_package"]


class RtdeState(Enum):
    """Whether data packages flow to the client."""

    PAUSED = "paused"
    STARTED = "started"


class Transition(NamedTuple):
    """The robot's answer to a request: accepted or not, and the state after it."""

    accepted: bool
    state: RtdeState


_PAUSED, _STARTED = RtdeState

TRANSITIONS: Mapping[tuple[RtdeState, type[Request]], Transition] = {
    (_PAUSED, RequestProtocolVersion): Transition(True, _PAUSED),
    (_PAUSED, GetControllerVersion): Transition(True, _PAUSED),
    (_PAUSED, SetupOutputs): Transition(True, _PAUSED),
    (_PAUSED, SetupInputs): Transition(True, _PAUSED),
    (_PAUSED, Start): Transition(True, _STARTED),
    # ur_rtde's I/O interface never starts, but waits for this reply when it ends.
    (_PAUSED, Pause): Transition(True, _PAUSED),
    # The layout of what flows cannot change under it.
    (_STARTED, RequestProtocolVersion): Transition(False, _STARTED),
    (_STARTED, GetControllerVersion): Transition(True, _STARTED),
    # Assumed: the guide shows set-ups before S or after P only, but not that others fail.
    (_STARTED, SetupOutputs): Transition(True, _STARTED),
    (_STARTED, SetupInputs): Transition(True, _STARTED),
    (_STARTED, Start): Transition(True, _STARTED),
    (_STARTED, Pause): Transition(True, _PAUSED),
}
"""Every request in every state. A version that does not exist is refused in both."""


def cycles_per_package(frequency: float | None, rate: int) -> int:
    """How many control cycles lie between two packages: floor(rate / frequency).

    Args:
        frequency: packages a second as asked for [Hz]; None for the full rate. What lies outside of 1 to
            `rate` is clamped (assumed: the guide gives the range only).
        rate: control cycles a second.
    """
    if frequency is None or math.isnan(frequency):
        return 1
    return int(rate / min(max(frequency, 1.0), rate))
