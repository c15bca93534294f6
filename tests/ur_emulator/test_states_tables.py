"""The tables of safety modes and events, written down once more by hand, and the box that follows them.

docs/states.md agrees with the tables, and a program takes the ways that the page shows.
"""

from itertools import pairwise

import pytest
from states_support import BRAKING, COMMANDS, ENDLESS, ENTRY, infos, moving

from docs.generate import states_page
from protocol.ur_types import JointMode, ProgramState, RobotMode, SafetyMode
from ur_emulator.machine.commands.power import PowerOff, PowerOn, ReleaseBrakes
from ur_emulator.machine.commands.programs import PauseProgram, ResumeProgram, StartProgram, StopProgram
from ur_emulator.machine.commands.safety import PressEmergencyStop, SafeguardStop, TriggerProtectiveStop
from ur_emulator.machine.controller.robot_mode import (
    JOINT_MODES,
    POWERED,
    TRANSITIONS,
    ModeCommand,
    RobotModeMachine,
)
from ur_emulator.machine.controller.safety.modes import (
    MODES,
    MOVING_MODES,
    ROW,
    WATCHED_MODES,
    SafetyEvent,
    after,
    mode_of,
)
from urscript import compile_program

M, E = SafetyMode, SafetyEvent
N, RD, RC, EN, AS, SG, PS, SE, RE, V, F = (
    M.NORMAL,
    M.REDUCED,
    M.RECOVERY,
    M.SYSTEM_THREE_POSITION_ENABLING_STOP,
    M.AUTOMATIC_MODE_SAFEGUARD_STOP,
    M.SAFEGUARD_STOP,
    M.PROTECTIVE_STOP,
    M.SYSTEM_EMERGENCY_STOP,
    M.ROBOT_EMERGENCY_STOP,
    M.VIOLATION,
    M.FAULT,
)
# From (columns) by event (rows) to; from a mode whose cause alone stands.
FROM = (N, RD, RC, EN, AS, SG, PS, SE, RE, V, F)
EXPECTED = {
    E.PROTECTIVE_STOP: (PS, PS, PS, PS, PS, PS, PS, SE, RE, V, F),
    E.UNLOCK: (N, RD, RC, EN, AS, SG, N, SE, RE, V, F),
    E.SAFEGUARD_OPENED: (SG, SG, SG, SG, SG, SG, PS, SE, RE, V, F),
    E.SAFEGUARD_RESTORED: (N, RD, RC, EN, AS, N, PS, SE, RE, V, F),
    E.AUTOMATIC_SAFEGUARD_OPENED: (AS, AS, AS, AS, AS, SG, PS, SE, RE, V, F),
    E.AUTOMATIC_SAFEGUARD_RESTORED: (N, RD, RC, EN, N, SG, PS, SE, RE, V, F),
    E.NOT_ENABLED: (EN, EN, EN, EN, AS, SG, PS, SE, RE, V, F),
    E.ENABLED: (N, RD, RC, N, AS, SG, PS, SE, RE, V, F),
    E.ROBOT_EMERGENCY_PRESSED: (RE, RE, RE, RE, RE, RE, RE, RE, RE, V, F),
    E.SYSTEM_EMERGENCY_PRESSED: (SE, SE, SE, SE, SE, SE, SE, SE, RE, V, F),
    E.ROBOT_EMERGENCY_RELEASED: (N, RD, RC, EN, AS, SG, PS, SE, N, V, F),
    E.SYSTEM_EMERGENCY_RELEASED: (N, RD, RC, EN, AS, SG, PS, N, RE, V, F),
    E.REDUCED_ON: (RD, RD, RC, EN, AS, SG, PS, SE, RE, V, F),
    E.REDUCED_OFF: (N, N, RC, EN, AS, SG, PS, SE, RE, V, F),
    E.RANGE_LEFT: (RC, RC, RC, EN, AS, SG, PS, SE, RE, V, F),
    E.RANGE_KEPT: (N, RD, N, EN, AS, SG, PS, SE, RE, V, F),
    E.VIOLATION: (V, V, V, V, V, V, V, V, V, V, F),
    E.FAULT: (F, F, F, F, F, F, F, F, F, F, F),
    E.RESTART: (N, RD, N, EN, AS, SG, N, SE, RE, N, N),
    E.POWERED_OFF: (N, RD, N, EN, AS, SG, PS, SE, RE, V, F),
}
# Modes of a CB3 that commands lead into; those of an e-Series box: test_states_operational.py.
COMMANDED = [mode for mode in FROM if mode not in (RC, EN, AS)]
CASES = [(event, was, EXPECTED[event][i]) for event in SafetyEvent for i, was in enumerate(FROM)]


def test_the_tables_are_whole():
    assert {row.mode for row in MODES} == set(FROM)
    assert set(EXPECTED) == set(SafetyEvent)
    assert all(row.remedy for row in MODES if row.mode is not N)
    assert {N, RD, RC} == MOVING_MODES
    assert {N, RD, RC, EN, AS, SG} == WATCHED_MODES


@pytest.mark.parametrize(("event", "was", "then"), CASES)
def test_transitions(event, was, then):
    causes = frozenset() if was is N else frozenset({was})
    assert mode_of(causes) is was
    assert mode_of(after(causes, event)) is then


def test_what_lies_under_a_mode_comes_back():
    causes = frozenset()
    for event in (
        E.REDUCED_ON,
        E.SAFEGUARD_OPENED,
        E.PROTECTIVE_STOP,
        E.SYSTEM_EMERGENCY_PRESSED,
        E.ROBOT_EMERGENCY_PRESSED,
    ):
        causes = after(causes, event)
    seen = [mode_of(causes)]
    for event in (
        E.ROBOT_EMERGENCY_RELEASED,
        E.SYSTEM_EMERGENCY_RELEASED,
        E.UNLOCK,
        E.SAFEGUARD_RESTORED,
        E.REDUCED_OFF,
    ):
        causes = after(causes, event)
        seen.append(mode_of(causes))
    assert seen == [RE, SE, PS, SG, RD, N]


# --- the box in each mode


def enter(mode, *, loaded=False):
    bench = moving(fidelity="exact", loaded=loaded)
    entry = ENTRY[mode]
    if mode is M.RECOVERY:
        bench.controller.safety.handle(E.RANGE_LEFT)
        past = bench.controller.state.past
        past.sensed = past.sensed._replace(actual_q=(7.0, *past.sensed.actual_q[1:]))
    elif entry is not None:
        bench.tick(1, COMMANDS[entry])
    return bench


# A mode that each command changes, and one that it leaves as it is; test_transitions has all of them.
FROM_MODES = {
    E.PROTECTIVE_STOP: (SG, RE),
    E.UNLOCK: (PS, SG),
    E.SAFEGUARD_OPENED: (RD, PS),
    E.SAFEGUARD_RESTORED: (SG, PS),
    E.ROBOT_EMERGENCY_PRESSED: (PS, V),
    E.SYSTEM_EMERGENCY_PRESSED: (N, RE),
    E.ROBOT_EMERGENCY_RELEASED: (RE, PS),
    E.SYSTEM_EMERGENCY_RELEASED: (SE, V),
    E.REDUCED_ON: (N, SG),
    E.REDUCED_OFF: (RD, SE),
    E.VIOLATION: (RD, F),
    E.FAULT: (V, F),
    E.RESTART: (V, RE),
    E.POWERED_OFF: (N, PS),
}


@pytest.mark.parametrize("event", COMMANDS)
def test_commands_lead_where_the_table_says(event):
    for mode in FROM_MODES[event]:
        bench = enter(mode)
        assert bench.now.safety_status == mode
        bench.tick(BRAKING)
        bench.tick(1, COMMANDS[event])
        then = EXPECTED[event][FROM.index(mode)]
        assert bench.now.safety_status == bench.now.safety_mode == then


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("mode", COMMANDED)
def test_what_a_mode_does_to_arm_program_and_power(mode, loaded):
    bench = enter(mode, loaded=loaded)
    bench.tick(BRAKING)
    row, now = ROW[mode], bench.now
    rests = not bench.controller.state.motion.is_moving
    assert rests is not row.may_move
    assert now.robot_mode == (RobotMode.RUNNING if row.may_have_power else RobotMode.POWER_OFF)
    assert {
        "runs": ProgramState.PLAYING,
        "paused, goes on when the mode ends": ProgramState.PAUSED,
        "a loaded one paused until somebody resumes it, one from a socket ended": (
            ProgramState.PAUSED if loaded else ProgramState.STOPPED
        ),
        "ended": ProgramState.STOPPED,
    }[row.program.value] == now.runtime_state
    bench.start("def other():\n  movej([0,-1.5,1,0,0,0])\nend\n")
    bench.tick(20)
    assert any(bench.now.target_qd) is row.may_move


@pytest.mark.parametrize("mode", [mode for mode in COMMANDED if not ROW[mode].may_have_power])
def test_power_is_refused_with_the_remedy(mode):
    bench = enter(mode)
    bench.tick(BRAKING)
    bench.tick(1, PowerOn(), ReleaseBrakes())
    bench.tick(300)
    assert bench.now.robot_mode == RobotMode.POWER_OFF
    first, second = infos(bench)[-2:]
    assert first.startswith("power on refused")
    assert second.startswith("brake release refused")
    assert mode.name in first
    assert ROW[mode].remedy in first


# --- robot and joint modes

TRANSITION_LISTS = {
    (RobotMode.POWER_OFF, ModeCommand.POWER_ON): "POWER_ON IDLE",
    (RobotMode.POWER_OFF, ModeCommand.BRAKE_RELEASE): "POWER_ON IDLE BACKDRIVE RUNNING",
    (RobotMode.POWER_ON, ModeCommand.BRAKE_RELEASE): "POWER_ON IDLE BACKDRIVE RUNNING",
    (RobotMode.IDLE, ModeCommand.BRAKE_RELEASE): "BACKDRIVE RUNNING",
    (RobotMode.POWER_ON, ModeCommand.POWER_OFF): "POWER_OFF",
    (RobotMode.IDLE, ModeCommand.POWER_OFF): "POWER_OFF",
    (RobotMode.BACKDRIVE, ModeCommand.POWER_OFF): "POWER_OFF",
    (RobotMode.RUNNING, ModeCommand.POWER_OFF): "POWER_OFF",
    (RobotMode.NO_CONTROLLER, ModeCommand.BOOT): "NO_CONTROLLER DISCONNECTED BOOTING POWER_OFF",
    (RobotMode.POWER_OFF, ModeCommand.ASK_TO_CONFIRM): "CONFIRM_SAFETY",
    (RobotMode.CONFIRM_SAFETY, ModeCommand.CONFIRM): "POWER_OFF",
}


@pytest.mark.parametrize("mode", RobotMode)
@pytest.mark.parametrize("command", ModeCommand)
def test_transitions_of_the_robot_mode(mode, command):
    machine = RobotModeMachine(mode, 0.008)
    machine.command(command)
    seen = [machine.mode]
    for _ in range(1000):
        machine.step()
        if machine.mode is not seen[-1]:
            seen.append(machine.mode)
    assert not machine.is_changing
    assert " ".join(step.name for step in seen) == TRANSITION_LISTS.get((mode, command), mode.name)
    assert ((mode, command) in TRANSITIONS) is ((mode, command) in TRANSITION_LISTS)


def test_joint_modes():
    assert set(JOINT_MODES) == {(robot, safety) for robot in RobotMode for safety in SafetyMode}
    plain = {robot: JOINT_MODES[robot, N] for robot in RobotMode}
    assert plain[RobotMode.RUNNING] is JointMode.RUNNING
    assert plain[RobotMode.POWER_OFF] is JointMode.POWER_OFF
    assert plain[RobotMode.IDLE] is JointMode.IDLE
    assert plain[RobotMode.BACKDRIVE] is JointMode.BACKDRIVE
    assert plain[RobotMode.POWER_ON] is JointMode.BOOTING
    for robot in POWERED:
        assert JOINT_MODES[robot, RE] is JOINT_MODES[robot, SE] is JointMode.READY_FOR_POWER_OFF
        assert JOINT_MODES[robot, V] is JointMode.VIOLATION
        assert JOINT_MODES[robot, F] is JointMode.FAULT
        assert JOINT_MODES[robot, PS] is plain[robot]
    assert JOINT_MODES[RobotMode.POWER_OFF, RE] is JointMode.POWER_OFF


P = ProgramState


PAUSES = [PauseProgram(), TriggerProtectiveStop(), SafeguardStop(True)]
ENDS = [StopProgram(), PressEmergencyStop(), PowerOff()]
START = StartProgram(compile_program(ENDLESS))


def transitions_of(*commands, loaded=True):
    """States that a moving program passes when these commands come, one every 100 cycles but for (n, command)."""
    bench = moving(fidelity="exact", loaded=loaded)
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
    for end in ENDS:
        for before in ([], [PauseProgram()], [(3, PauseProgram())]):
            taken.update(transitions_of(*before, end))
    taken.update(transitions_of(TriggerProtectiveStop(), loaded=False))
    taken.update(transitions_of(PauseProgram(), ResumeProgram()))
    taken.update(transitions_of((3, PauseProgram()), ResumeProgram()))
    taken.update(transitions_of(SafeguardStop(True), SafeguardStop(False)))
    taken.update(transitions_of(StopProgram(), START))
    taken.update(transitions_of((3, StopProgram()), START))
    assert taken == {(row.state, row.then) for row in states_page.PROGRAM_TRANSITIONS}


def test_every_safety_mode_that_the_guide_names_is_on_the_page():
    unused = {SafetyMode.VALIDATE_JOINT_ID, SafetyMode.UNDEFINED_SAFETY_MODE}
    assert {row.mode for row in MODES} == {mode for mode in SafetyMode if mode <= 13} - unused
