"""Outputs that follow the program: the codes of set_runstate_*, and the level of each.

Source: URScript manual CB3 3.15, module ioconfiguration.
"""

from __future__ import annotations

from enum import IntEnum


class RunState(IntEnum):
    """What an output does when programs start and stop."""

    KEEP = 0
    LOW_WHEN_STOPPED = 1
    HIGH_WHEN_STOPPED = 2
    HIGH_WHEN_RUNNING = 3  # and low when stopped


_WHEN_RUNNING = {RunState.HIGH_WHEN_RUNNING: True}
_WHEN_STOPPED = {
    RunState.LOW_WHEN_STOPPED: False,
    RunState.HIGH_WHEN_STOPPED: True,
    RunState.HIGH_WHEN_RUNNING: False,
}


def level(rule: RunState, program_runs: bool) -> bool | None:
    """Return the level of an output (True is high); None does not change it."""
    return (_WHEN_RUNNING if program_runs else _WHEN_STOPPED).get(rule)
