"""Whether a program plays, is paused, or may be played now."""

from __future__ import annotations

from protocol.ur_types import ProgramState, RobotMode
from ur_emulator.controller.safety.status_bits import RUNNING_STATES
from ur_emulator.servers.box_access import BoxAccess

_PAUSED = frozenset({ProgramState.PAUSING, ProgramState.PAUSED})


def is_running(access: BoxAccess) -> bool:
    """Return True while a program plays, also one that a client has sent."""
    return access.snapshot.runtime_state in RUNNING_STATES


def is_paused(access: BoxAccess) -> bool:
    """Return True while a program is paused, or about to be."""
    return access.snapshot.runtime_state in _PAUSED


def obstacle_to_playing(access: BoxAccess, *, has_program: bool) -> str:
    """Return what stands against playing, "" if nothing does.

    Args:
        access: to the box.
        has_program: a program is loaded.
    """
    state, mode = access.controller.state, access.snapshot.robot_mode
    if not state.safety.lets_programs_run:
        return "the robot is stopped for safety"
    if mode != RobotMode.RUNNING:
        return f"the robot is in {RobotMode(mode).name}, it must be RUNNING"
    if is_running(access) and not is_paused(access):
        return "a program plays already"
    if state.operator.requests:
        return "a popup waits to be closed, or a question for its answer"
    return "" if has_program or is_paused(access) else "no program is loaded"
