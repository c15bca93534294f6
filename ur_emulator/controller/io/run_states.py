"""Outputs that follow the program: the codes of set_runstate_*, and the level of each.

Source: URScript manuals CB3 3.15 and e-Series 5.11, module ioconfiguration. An unscheduled stop is one by a
protective stop, a fault, a violation or an error of the program; that an emergency stop is one: chosen.
"""

from __future__ import annotations

from enum import IntEnum


class RunState(IntEnum):
    """What an output does when programs start and stop."""

    KEEP = 0
    LOW_WHEN_STOPPED = 1
    HIGH_WHEN_STOPPED = 2
    HIGH_WHEN_RUNNING = 3  # and low when stopped
    # Of the e-Series:
    LOW_WHEN_UNSCHEDULED = 4  # low after an unscheduled stop
    HIGH_UNTIL_UNSCHEDULED = 5  # and high from the start on


_WHEN_RUNNING = {RunState.HIGH_WHEN_RUNNING: True, RunState.HIGH_UNTIL_UNSCHEDULED: True}
_WHEN_STOPPED = {
    RunState.LOW_WHEN_STOPPED: False,
    RunState.HIGH_WHEN_STOPPED: True,
    RunState.HIGH_WHEN_RUNNING: False,
}
_WHEN_UNSCHEDULED = _WHEN_STOPPED | {
    RunState.LOW_WHEN_UNSCHEDULED: False,
    RunState.HIGH_UNTIL_UNSCHEDULED: False,
}


def level(rule: RunState, program_runs: bool, *, unscheduled: bool = False) -> bool | None:
    """Return the level of an output (True is high); None does not change it.

    Args:
        rule: of the output.
        program_runs: a primary program runs.
        unscheduled: it has just been stopped, and not by itself or by a user.
    """
    if program_runs:
        return _WHEN_RUNNING.get(rule)
    return (_WHEN_UNSCHEDULED if unscheduled else _WHEN_STOPPED).get(rule)
