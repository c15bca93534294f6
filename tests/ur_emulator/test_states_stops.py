"""What stops do to a moving arm, and how people and clients get it going again."""

from types import SimpleNamespace

import numpy as np
import pytest
from box_support import Bench
from states_support import BRAKING, ENDLESS, failures, modes, moving, power_up

from protocol.primary.messages import ReportLevel
from protocol.ur_types import JointMode, ProgramState, RobotMode, SafetyMode
from ur_emulator.errors import EmulatorError, RefusedError
from ur_emulator.machine.commands.power import PowerOff, PowerOn, ReleaseBrakes, StartFreedrive
from ur_emulator.machine.commands.programs import PauseProgram, ResumeProgram, StartProgram, StopProgram
from ur_emulator.machine.commands.safety import (
    AssignSafetyInput,
    ChangeSafetySettings,
    ConfirmSafety,
    PressButton,
    PressEmergencyStop,
    ReducedMode,
    ReleaseEmergencyStop,
    RequireSafeguardReset,
    ResetSafeguard,
    RestartSafety,
    SafeguardStop,
    TriggerFault,
    TriggerProtectiveStop,
    TriggerViolation,
    UnlockProtectiveStop,
)
from ur_emulator.machine.controller.events import ErrorReported, ProgramPaused, ProgramResumed
from ur_emulator.machine.controller.safety.speed_scaling import TOLERANCE
from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.motion.arm_motion import ArmMotion
from ur_emulator.machine.motion.generators import SpeedJ
from urscript import compile_program

PRESS, RELEASE = PressEmergencyStop("robot"), ReleaseEmergencyStop()
OPEN, CLOSE = SafeguardStop(True), SafeguardStop(False)
REDUCE, NO_REDUCE = ReducedMode(True), ReducedMode(False)
LONG_MOVE = "def m():\n  q = get_actual_joint_positions()\n  movej([q[0] + 2, q[1], q[2], q[3], q[4], q[5]], a=3, v=3)\nend\n"


@pytest.fixture
def bench():
    """A bench whose arm is moving for ever."""
    return moving()


def speeds(bench, first=0):
    return np.array([s.target_qd for s in bench.snapshots[first:]])


# --- emergency stops


@pytest.mark.parametrize("command", [PRESS, PressEmergencyStop("system"), TriggerViolation(), TriggerFault()])
def test_the_arm_brakes_as_it_can_then_loses_its_power(bench, command):
    first = len(bench.snapshots)
    bench.tick(BRAKING, command)
    limit = bench.controller.state.robot.stop_deceleration * 0.008
    assert np.abs(np.diff(speeds(bench, first - 1), axis=0)).max() <= limit * (1 + 1e-9)
    powered = [s.robot_mode == RobotMode.RUNNING for s in bench.snapshots[first:]]
    n_braking = powered.index(False)
    assert 5 < n_braking < 40
    assert not any(powered[n_braking:])
    resting = bench.snapshots[first + n_braking - 1]
    assert resting.target_qd == (0.0,) * 6
    assert np.abs(resting.actual_qd).max() < 0.02
    assert bench.now.runtime_state == ProgramState.STOPPED


def test_joint_modes_report_the_stop_while_the_arm_brakes(bench):
    assert bench.tick(1, PRESS).joint_mode == (JointMode.READY_FOR_POWER_OFF,) * 6
    assert bench.tick(BRAKING).joint_mode == (JointMode.POWER_OFF,) * 6
    bench.tick(1, TriggerFault())
    assert bench.now.joint_mode == (JointMode.FAULT,) * 6


def test_a_client_gets_the_arm_going_after_an_emergency_stop(bench):
    bench.tick(BRAKING, PRESS)
    bench.tick(300, PowerOn())
    assert bench.now.robot_mode == RobotMode.POWER_OFF
    bench.tick(1, RELEASE)
    assert (bench.now.safety_mode, bench.now.robot_mode) == (SafetyMode.NORMAL, RobotMode.POWER_OFF)
    bench.start(ENDLESS)
    assert "it must be RUNNING" in failures(bench)[-1]
    assert power_up(bench).robot_mode == RobotMode.RUNNING
    bench.start(ENDLESS)
    bench.tick(30)
    assert any(bench.now.target_qd)


def test_a_stop_that_is_released_at_once_still_ends_without_power(bench):
    bench.tick(1, PRESS)
    bench.tick(1, RELEASE)
    assert (bench.now.safety_mode, bench.now.robot_mode) == (SafetyMode.NORMAL, RobotMode.POWER_OFF)
    before = bench.now.actual_q
    bench.start(ENDLESS)
    bench.tick(50)
    assert bench.now.actual_q == pytest.approx(before, abs=0.01)


@pytest.mark.parametrize("ticks", [1, 80, 140, 160])
def test_a_stop_on_the_way_up_cuts_the_power(ticks):
    bench = Bench(mode=RobotMode.POWER_OFF)
    bench.tick(ticks, ReleaseBrakes())
    assert bench.now.robot_mode not in (RobotMode.POWER_OFF, RobotMode.RUNNING)
    assert bench.tick(1, PRESS).robot_mode == RobotMode.POWER_OFF
    bench.tick(300)
    assert bench.now.robot_mode == RobotMode.POWER_OFF


def test_two_buttons_must_both_be_released(bench):
    bench.tick(1, AssignSafetyInput(0, "emergency stop"))
    assert bench.now.safety_mode == SafetyMode.SYSTEM_EMERGENCY_STOP
    bench.tick(BRAKING, PRESS)
    assert bench.now.safety_mode == SafetyMode.ROBOT_EMERGENCY_STOP
    bench.tick(1, RELEASE)
    assert bench.now.safety_mode == SafetyMode.SYSTEM_EMERGENCY_STOP
    bench.controller.state.io.digital_in = 0x0300
    bench.tick(1)
    assert bench.now.safety_mode == SafetyMode.NORMAL


def test_an_emergency_stop_in_freedrive_ends_it():
    bench = Bench()
    bench.tick(5, StartFreedrive())
    bench.controller.plant.push((30.0, 0.0, 0.0))
    bench.tick(30)
    assert max(map(abs, bench.now.actual_qd)) > 0.01
    bench.tick(BRAKING, PRESS)
    assert bench.now.robot_mode == RobotMode.POWER_OFF
    assert bench.now.control_mode == 0


def test_unknown_kinds_and_pairs_are_refused():
    with pytest.raises(EmulatorError, match="allowed is robot or system"):
        PressEmergencyStop("red")
    with pytest.raises(EmulatorError, match="allowed is 0 to 3"):
        AssignSafetyInput(4, "none")


# --- safeguard


def test_a_safeguard_pauses_on_the_path_and_the_program_goes_on_by_itself():
    bench = moving(fidelity="ideal")
    first = len(bench.snapshots)
    bench.tick(100, OPEN)
    assert bench.now.runtime_state == ProgramState.PAUSED
    assert bench.now.robot_mode == RobotMode.RUNNING
    bench.tick(400, CLOSE)
    assert bench.now.runtime_state == ProgramState.PLAYING
    assert [type(e) for e in bench.events if isinstance(e, ProgramPaused | ProgramResumed)] == [
        ProgramPaused,
        ProgramResumed,
    ]
    # The path is a line in joint space: it never was left, whatever the time on it.
    path = np.array([s.target_q for s in bench.snapshots[first:]])
    assert np.ptp(path[:, 1:], axis=0).max() < 1e-5  # it begins where the arm was measured
    assert any(speeds(bench)[-100:, 0])


@pytest.mark.parametrize(("hardness", "least", "most"), [(0, 15.0, 20.0), (1, 2.0, 8.0)])
def test_the_hardness_of_the_stop_is_the_programs(hardness, least, most):
    bench = Bench(fidelity="ideal")
    bench.start(LONG_MOVE.replace("():\n", f"():\n  set_safety_mode_transition_hardness({hardness})\n"))
    bench.tick(55)
    first = len(bench.snapshots)
    top = bench.now.target_qd[0]
    assert top > 1.0
    bench.tick(100, OPEN)
    drops = -np.diff(speeds(bench, first)[:, 0]) / 0.008
    assert least <= drops.max() <= most + 3.0 + 1e-6  # the move's own acceleration comes on top
    assert bench.now.target_qd == (0.0,) * 6


def test_with_a_reset_button_closing_is_not_enough(bench):
    bench.tick(1, RequireSafeguardReset(True))
    bench.tick(100, OPEN)
    bench.tick(1, ResetSafeguard())
    assert bench.now.safety_mode == SafetyMode.SAFEGUARD_STOP
    bench.tick(50, CLOSE)
    assert bench.now.safety_mode == SafetyMode.SAFEGUARD_STOP
    bench.tick(10, ResetSafeguard())
    assert bench.now.safety_mode == SafetyMode.NORMAL
    assert bench.now.runtime_state == ProgramState.PLAYING


def test_a_reset_input_resets_on_its_rising_edge(bench):
    bench.tick(1, RequireSafeguardReset(True), AssignSafetyInput(1, "safeguard reset"))
    bench.tick(50, OPEN)
    bench.tick(5, CLOSE)
    assert bench.now.safety_mode == SafetyMode.SAFEGUARD_STOP
    bench.controller.state.io.digital_in = 0x0C00
    assert bench.tick(1).safety_mode == SafetyMode.NORMAL


def test_what_was_paused_before_stays_paused(bench):
    bench.tick(60, PauseProgram())
    bench.tick(60, OPEN)
    bench.tick(60, CLOSE)
    assert bench.now.runtime_state == ProgramState.PAUSED
    bench.tick(10, ResumeProgram())
    assert bench.now.runtime_state == ProgramState.PLAYING


def test_programs_and_resuming_are_refused_while_the_safeguard_is_open(bench):
    bench.tick(60, OPEN)
    bench.start(ENDLESS)
    bench.tick(10, ResumeProgram())
    assert "SAFEGUARD_STOP" in failures(bench)[-1]
    assert "close the safeguard" in failures(bench)[-1]
    report = [event for event in bench.events if isinstance(event, ErrorReported)][-1]
    assert "stays paused: the robot is in SAFEGUARD_STOP" in report.text
    assert report.level is ReportLevel.INFO  # a client of the public library ends its script on warnings
    assert bench.now.runtime_state == ProgramState.PAUSED


def test_a_push_in_a_safeguard_stop_is_a_protective_stop():
    bench = moving(loaded=True)
    bench.tick(60, OPEN)
    bench.tick(1, TriggerProtectiveStop())
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    bench.tick(20, CLOSE)
    bench.tick(20, UnlockProtectiveStop())
    assert bench.now.safety_mode == SafetyMode.NORMAL
    assert bench.now.runtime_state == ProgramState.PAUSED
    assert modes(bench) == ["SAFEGUARD_STOP", "PROTECTIVE_STOP", "NORMAL"]


# --- protective stop


def test_unlocking_waits_five_seconds_for_the_dashboard_only(bench):
    bench.tick(1, TriggerProtectiveStop())
    stopped_at, safety = bench.now.timestamp, bench.controller.state.safety
    while not safety.may_unlock(bench.now.timestamp):
        assert bench.controller.is_active
        bench.tick()
    assert bench.now.timestamp - stopped_at == pytest.approx(5.0, abs=0.01)
    bench.tick(1, UnlockProtectiveStop())
    assert bench.now.safety_mode == SafetyMode.NORMAL
    bench.tick(1, TriggerProtectiveStop())
    assert not safety.may_unlock(bench.now.timestamp)


def test_an_emergency_stop_over_a_protective_stop_leads_back_to_it(bench):
    bench.tick(50, TriggerProtectiveStop())
    bench.tick(BRAKING, PRESS)
    assert bench.now.runtime_state == ProgramState.STOPPED
    bench.tick(1, RELEASE)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    bench.tick(1, UnlockProtectiveStop())
    assert power_up(bench).robot_mode == RobotMode.RUNNING


@pytest.mark.parametrize("name", ["ur3", "ur5", "ur10"])
def test_every_arm_brakes_with_its_own_deceleration(name):
    bench = Bench(robot=name, fidelity="ideal")
    bench.start(LONG_MOVE)
    bench.tick(55)
    first = len(bench.snapshots)
    bench.tick(2, TriggerProtectiveStop())
    bench.tick(60)
    drops = -np.diff(speeds(bench, first)[:, 0]) / 0.008
    assert drops.max() == pytest.approx(bench.controller.state.robot.stop_deceleration)


# --- reduced mode, recovery


def test_reduced_mode_slows_a_move_down_to_half_the_rated_speed():
    bench = Bench(fidelity="ideal")
    bench.tick(1, REDUCE)
    bench.run(LONG_MOVE)
    limit = CB3.limits.reduced_share * bench.controller.state.robot.qd_max[0]
    fastest = np.abs(speeds(bench)[:, 0]).max()
    assert 0.85 * limit < fastest <= limit + TOLERANCE
    assert bench.now.safety_mode == SafetyMode.REDUCED
    assert min(s.speed_scaling for s in bench.snapshots) < 0.7
    assert bench.now.target_speed_fraction == 1.0
    bench.run(
        "def b():\n  q = get_actual_joint_positions()\n  movej([q[0] - 2, q[1], q[2], q[3], q[4], q[5]], a=3, v=1)\nend\n"
    )
    assert np.abs(speeds(bench, -200)[:, 0]).max() == pytest.approx(
        1.0, rel=1e-3
    )  # what is slow stays as it is


@pytest.mark.parametrize("hardness", [0, 1])
def test_a_fast_arm_is_within_the_limits_half_a_second_after_reduced_mode_began(hardness):
    bench = Bench(fidelity="ideal")
    bench.start(
        f"def m():\n  set_safety_mode_transition_hardness({hardness})\n  while True:\n"
        "    speedj([2.6, 0, 0, 0, 0, 0], 8, 0.008)\n  end\nend\n"
    )
    bench.tick(50)
    assert bench.now.target_qd[0] == pytest.approx(2.6)
    first = len(bench.snapshots)
    bench.tick(110, REDUCE)
    limit = CB3.limits.reduced_share * bench.controller.state.robot.qd_max[0]
    assert np.abs(speeds(bench, first + 62)[:, 0]).max() <= limit + TOLERANCE
    assert bench.now.safety_mode == SafetyMode.REDUCED
    bench.tick(100, NO_REDUCE)
    assert bench.now.target_qd[0] == pytest.approx(2.6)


def test_who_is_too_fast_for_too_long_is_stopped():
    bench = Bench(fidelity="ideal")
    bench.tick(1, REDUCE)
    limiter, plant = bench.controller.state.speed.limiter, bench.controller.plant.sense()
    fast = plant._replace(actual_qd=(0.0, 0.0, 3.0, 0.0, 0.0, 0.0))
    space = bench.now.space
    found = [limiter.find_violation(fast, space, 0.008) for _ in range(70)]
    assert found[:60] == [None] * 60
    assert found[-1].error.code == 191
    assert "elbow at 3.000 rad/s" in found[-1].error.text
    assert limiter.find_violation(plant, space, 0.008) is None
    assert limiter.find_violation(fast, space, 0.008) is None


def test_an_arm_that_wakes_up_out_of_range_is_in_recovery_until_it_is_back():
    bench = Bench(fidelity="ideal", mode=RobotMode.POWER_OFF)
    high = bench.controller.state.robot.q_max[0]
    q = (high + 0.05, *bench.now.actual_q[1:])
    bench.controller.plant.reset(q)
    bench.controller.state.motion.place(q)
    bench.tick(5)
    bench.tick(220, ReleaseBrakes())
    assert (bench.now.robot_mode, bench.now.safety_mode) == (RobotMode.RUNNING, SafetyMode.RECOVERY)
    bench.start(
        "def back():\n  q = get_actual_joint_positions()\n  movej([q[0] - 1, q[1], q[2], q[3], q[4], q[5]], a=2, v=2)\nend\n"
    )
    while bench.now.safety_mode == SafetyMode.RECOVERY:
        bench.tick()
        assert abs(bench.now.target_qd[0]) <= CB3.limits.recovery_speed + TOLERANCE
    assert bench.now.safety_mode == SafetyMode.NORMAL
    assert bench.now.actual_q[0] <= high
    bench.tick(100)
    assert min(speeds(bench)[:, 0]) < -1.0  # fast again


def test_the_scale_of_an_arm_at_rest_is_that_of_the_slider():
    motion = ArmMotion((0.0,) * 6, 20.0)
    bench = Bench()
    bench.tick(1, REDUCE)
    limiter = bench.controller.state.speed.limiter
    arm, tcp = bench.controller.state.arm, (0.0,) * 6
    assert limiter.step(motion, arm, tcp, 0.4, 0.008) == 0.4
    assert limiter.step(motion, arm, tcp, 0.0, 0.008) == 0.0
    motion.command(SimpleNamespace(), SpeedJ((0.0,) * 6, 1.0))
    assert limiter.step(motion, arm, tcp, 1.0, 0.008) == 1.0


# --- the pendant and the start


def test_the_teach_button_guides_by_hand_and_is_reported():
    bench = Bench()
    bench.tick(5, PressButton("teach", True), PressButton("power", True))
    assert bench.now.robot_status_bits & 0b1100 == 0b1100
    assert bench.now.control_mode == 1
    bench.tick(5, PressButton("teach", False))
    assert bench.now.robot_status_bits & 0b1100 == 0b1000
    assert bench.now.control_mode == 0


def test_changed_safety_settings_want_to_be_confirmed(bench):
    bench.tick(1, ChangeSafetySettings())
    assert bench.now.robot_mode == RobotMode.CONFIRM_SAFETY
    bench.tick(300, ReleaseBrakes())
    assert bench.now.robot_mode == RobotMode.CONFIRM_SAFETY
    bench.tick(1, ConfirmSafety())
    assert bench.now.robot_mode == RobotMode.POWER_OFF
    assert power_up(bench).robot_mode == RobotMode.RUNNING


def test_a_controller_that_starts_from_nothing_boots():
    bench = Bench(mode=RobotMode.NO_CONTROLLER)
    seen = [bench.now.robot_mode]
    while bench.controller.is_active:
        if bench.tick().robot_mode != seen[-1]:
            seen.append(bench.now.robot_mode)
    assert seen == [RobotMode.NO_CONTROLLER, RobotMode.DISCONNECTED, RobotMode.BOOTING, RobotMode.POWER_OFF]


def test_faults_and_violations_are_reported_and_end_with_a_restart(bench):
    bench.tick(BRAKING, TriggerViolation("too fast"))
    reports = [e for e in bench.events if isinstance(e, ErrorReported)]
    assert [(e.text, e.level.name) for e in reports] == [("too fast", "VIOLATION")]
    bench.tick(1, TriggerFault("broken"))
    assert bench.now.safety_mode == SafetyMode.FAULT
    bench.tick(1, RestartSafety())
    assert (bench.now.safety_mode, bench.now.robot_mode) == (SafetyMode.NORMAL, RobotMode.POWER_OFF)
    assert power_up(bench).robot_mode == RobotMode.RUNNING


@pytest.mark.parametrize("mode", [RobotMode.RUNNING, RobotMode.IDLE, RobotMode.POWER_OFF])
def test_a_requested_stop_is_one_whatever_the_robot_mode(mode):
    """A program may ask for it in the cycle in which the arm loses its power."""
    bench = Bench(mode=mode)
    bench.tick(20)
    bench.controller.state.requests.protective_stop = True
    bench.tick(5)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert [e.code for e in bench.events if isinstance(e, ErrorReported)] == [209]


# --- what a box does not do it refuses, for every command in every state

POWERED = (RobotMode.POWER_ON, RobotMode.IDLE, RobotMode.BACKDRIVE, RobotMode.RUNNING)
GOES = (ProgramState.PLAYING, ProgramState.RESUMING)
PAUSES = (ProgramState.PAUSED, ProgramState.PAUSING)


def has(*causes):
    return lambda box: any(box.state.safety.has(cause) for cause in causes)


# Each command, and what it has done half a second later, or had before.
EFFECTS = [
    (PowerOn(), lambda box: box.state.mode.mode in POWERED),
    (ReleaseBrakes(), lambda box: box.state.mode.mode is RobotMode.RUNNING or box.state.mode.is_changing),
    (PowerOff(), lambda box: box.state.mode.mode not in POWERED),
    (StartFreedrive(), lambda box: box.state.compliance.is_in_freedrive),
    (TriggerProtectiveStop(), has(SafetyMode.PROTECTIVE_STOP)),
    (UnlockProtectiveStop(), lambda box: not has(SafetyMode.PROTECTIVE_STOP)(box)),
    (TriggerViolation(), has(SafetyMode.VIOLATION)),
    (TriggerFault(), has(SafetyMode.FAULT)),
    (
        RestartSafety(),
        lambda box: (
            not has(SafetyMode.FAULT, SafetyMode.VIOLATION, SafetyMode.PROTECTIVE_STOP)(box)
            and box.state.mode.mode not in POWERED
        ),
    ),
    (PRESS, has(SafetyMode.ROBOT_EMERGENCY_STOP)),
    (OPEN, has(SafetyMode.SAFEGUARD_STOP)),
    (REDUCE, has(SafetyMode.REDUCED)),
    (ChangeSafetySettings(), lambda box: box.state.mode.mode is RobotMode.CONFIRM_SAFETY),
    (ConfirmSafety(), lambda box: box.state.mode.mode is RobotMode.POWER_OFF),
    (StartProgram(compile_program(ENDLESS)), lambda box: box.programs.runtime_state in GOES),
    (PauseProgram(), lambda box: box.programs.runtime_state in PAUSES),
    (ResumeProgram(), lambda box: box.programs.runtime_state in GOES),
    (StopProgram(), lambda box: not box.programs.is_running),
]
# How a moving arm gets into each state, and the commands that are refused there.
SWITCH_ON = [PowerOn, ReleaseBrakes]
MOVE = [StartFreedrive, StartProgram, ResumeProgram]
NONE_STANDS = [UnlockProtectiveStop, ConfirmSafety]
REFUSED = {
    "plays": ([], [*NONE_STANDS, ResumeProgram]),
    "paused": ([PauseProgram()], [*NONE_STANDS, PauseProgram]),
    "stopped": ([StopProgram()], [*NONE_STANDS, PauseProgram, ResumeProgram]),
    "reduced": ([REDUCE], [*NONE_STANDS, ResumeProgram]),
    "off": ([PowerOff()], [*NONE_STANDS, PauseProgram, *MOVE]),
    "on": ([PowerOff(), PowerOn()], [*NONE_STANDS, PauseProgram, *MOVE]),
    "safeguard": ([OPEN], [*NONE_STANDS, PauseProgram, *MOVE]),
    "protective": ([TriggerProtectiveStop()], [ConfirmSafety, PauseProgram, *MOVE]),
    "emergency": ([PRESS], [*NONE_STANDS, *SWITCH_ON, TriggerProtectiveStop, PauseProgram, *MOVE]),
    "violation": (
        [TriggerViolation()],
        [*NONE_STANDS, *SWITCH_ON, TriggerProtectiveStop, PauseProgram, *MOVE],
    ),
    "fault": (
        [TriggerFault()],
        [*NONE_STANDS, *SWITCH_ON, TriggerProtectiveStop, TriggerViolation, PauseProgram, *MOVE],
    ),
    "to confirm": ([ChangeSafetySettings()], [UnlockProtectiveStop, *SWITCH_ON, PauseProgram, *MOVE]),
}


@pytest.mark.parametrize("state", [*REFUSED, "boots"])
def test_what_a_box_does_not_do_it_refuses(state):
    boots = [*NONE_STANDS, *SWITCH_ON, ChangeSafetySettings, PauseProgram, *MOVE]
    way, refused = REFUSED.get(state, ([], boots))
    for command, has_effect in EFFECTS:
        bench = Bench(mode=RobotMode.NO_CONTROLLER) if state == "boots" else moving(loaded=True)
        for step in way:
            bench.tick(BRAKING, step)
        bench.tick(1, command)
        ((_, error),) = bench.controller.outcomes
        assert isinstance(error, RefusedError) is (type(command) in refused), f"{command}: {error}"
        if error is None:
            bench.tick(60)
            assert has_effect(bench.controller), command
