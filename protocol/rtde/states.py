"""When RTDE data flows: the answer to every request in both states of a connection, and the rate.

Only tables and sums stand here; `rtde.connection` obeys them.
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

__all__ = ["TRANSITIONS", "RtdeState", "Verdict", "cycles_per_package"]


class RtdeState(Enum):
    """Whether data packages flow to the client."""

    PAUSED = "paused"
    STARTED = "started"


class Verdict(NamedTuple):
    """What the robot makes of a request: accepted or not, and the state after it."""

    accepted: bool
    state: RtdeState


_PAUSED, _STARTED = RtdeState

TRANSITIONS: Mapping[tuple[RtdeState, type[Request]], Verdict] = {
    (_PAUSED, RequestProtocolVersion): Verdict(True, _PAUSED),
    (_PAUSED, GetControllerVersion): Verdict(True, _PAUSED),
    (_PAUSED, SetupOutputs): Verdict(True, _PAUSED),
    (_PAUSED, SetupInputs): Verdict(True, _PAUSED),
    (_PAUSED, Start): Verdict(True, _STARTED),
    # ur_rtde's I/O interface never starts, but waits for this reply when it ends.
    (_PAUSED, Pause): Verdict(True, _PAUSED),
    # The layout of what flows cannot change under it.
    (_STARTED, RequestProtocolVersion): Verdict(False, _STARTED),
    (_STARTED, GetControllerVersion): Verdict(True, _STARTED),
    # Assumed: the guide has set-ups before S or after P only, and does not say that others fail.
    (_STARTED, SetupOutputs): Verdict(True, _STARTED),
    (_STARTED, SetupInputs): Verdict(True, _STARTED),
    (_STARTED, Start): Verdict(True, _STARTED),
    (_STARTED, Pause): Verdict(True, _PAUSED),
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
