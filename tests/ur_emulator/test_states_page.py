"""docs/states.md and the tables hold together, and the program takes the ways that the page shows."""

from itertools import pairwise

import pytest
from states_support import ENDLESS, moving

from docs.generate import states_page
from protocol.ur_types import ProgramState, SafetyStatus
from ur_emulator.commands.power import PowerOff
from ur_emulator.commands.programs import PauseProgram, ResumeProgram, StartProgram, StopProgram
from ur_emulator.commands.safety import (
    PressEmergencyStop,
    SafeguardStop,
    TriggerFault,
    TriggerProtectiveStop,
    TriggerViolation,
)
from ur_emulator.controller.robot_mode import TRANSITIONS
from ur_emulator.controller.safety.modes import EVENTS, MODES
from urscript import compile_program

P = ProgramState


def test_the_page_shows_every_mode_event_and_transition():
    text = states_page.render()
    for row in MODES:
        assert f"| {row.mode.name} | {int(row.mode)} |" in text
    for event in EVENTS:
        assert text.count(f"\n| {event.value} |") == 2  # what it does, and the matrix
    for mode, command in TRANSITIONS:
        assert f"| {mode.name} | {command.value} |" in text


PAUSES = [PauseProgram(), TriggerProtectiveStop(), SafeguardStop(True)]
ENDS = [
    StopProgram(),
    PressEmergencyStop(),
    TriggerViolation(),
    TriggerFault(),
]
START = StartProgram(compile_program(ENDLESS))


def transitions_of(*commands, loaded=True):
    """States that a moving program passes when these commands come, one every 100 cycles but for (n, command)."""
    bench = moving(loaded=loaded)
    seen = [P(bench.now.runtime_state)]
    for item in commands:
        ticks, command = item if isinstance(item, tuple) else (100, item)
        for i in range(ticks):
            bench.tick(1, *((command,) if i == 0 else ()))
            if (state := P(bench.now.runtime_state)) is not seen[-1]:
                seen.append(state)
    return list(pairwise(seen))


def test_every_transition_of_the_page_is_taken_and_no_other():
    taken = set()
    for pause in PAUSES:
        taken.update(transitions_of(pause))
    for end in [*ENDS, PowerOff()]:
        for before in ([], [PauseProgram()], [(3, PauseProgram())]):
            taken.update(transitions_of(*before, end))
    taken.update(transitions_of(TriggerProtectiveStop(), loaded=False))
    taken.update(transitions_of(PauseProgram(), ResumeProgram()))
    taken.update(transitions_of((3, PauseProgram()), ResumeProgram()))
    taken.update(transitions_of(SafeguardStop(True), SafeguardStop(False)))
    taken.update(transitions_of(StopProgram(), START))
    taken.update(transitions_of((3, StopProgram()), START))
    assert taken == {(row.state, row.then) for row in states_page.PROGRAM_TRANSITIONS}


@pytest.mark.parametrize("pause", PAUSES)
def test_pauses_lead_to_paused(pause):
    assert transitions_of(pause) == [(P.PLAYING, P.PAUSING), (P.PAUSING, P.PAUSED)]


def test_every_number_of_the_safety_status_is_on_the_page():
    unused = {SafetyStatus.VALIDATE_JOINT_ID, SafetyStatus.UNDEFINED_SAFETY_MODE}
    assert {row.mode for row in MODES} == set(SafetyStatus) - unused
