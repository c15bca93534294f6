"""Operational modes of an e-Series box: who chooses them, the enabling device, safeguards, limits."""

from math import hypot

import pytest
from box_support import Bench
from states_support import BRAKING, ENDLESS, failures, infos

from protocol.rtde.types import SafetyStatusBits
from protocol.ur_types import ProgramState, RobotMode, SafetyMode, SafetyStatus
from ur_emulator.errors import RefusedError
from ur_emulator.machine.commands.power import (
    ChooseModeByDashboard,
    MoveEnablingDevice,
    ReleaseBrakes,
    SetOperationalMode,
    StartFreedrive,
)
from ur_emulator.machine.commands.safety import (
    AssignSafetyInput,
    PressButton,
    ReducedMode,
    RequireSafeguardReset,
    ResetSafeguard,
    SafeguardStop,
)
from ur_emulator.machine.commands.surroundings import SetDigitalInput
from ur_emulator.machine.controller.safety.inputs import (
    OPERATIONAL_MODES,
    EnablingAct,
    EnablingDevice,
    EnablingState,
    ModeSource,
    OperationalMode,
    OperationalModeChoice,
)
from ur_emulator.machine.controller.safety.modes import SafetyEvent
from ur_emulator.machine.models.generations import CB3, E_SERIES

MANUAL, AUTOMATIC = SetOperationalMode("manual"), SetOperationalMode("automatic")
PRESS, RELEASE = MoveEnablingDevice("pressed"), MoveEnablingDevice("released")
FULLY = MoveEnablingDevice("fully pressed")
OPEN, CLOSE = SafeguardStop(True, "automatic mode"), SafeguardStop(False, "automatic mode")
# Long enough for an arm to come to rest at 500 Hz.
REST = 4 * BRAKING
FAST = (
    "def fast():\n  q = get_actual_joint_positions()\n"
    "  movej([q[0] + 2, q[1], q[2], q[3], q[4], q[5]], a=8, v=3)\nend\n"
)


@pytest.fixture
def bench():
    return Bench(robot="ur5e", generation=E_SERIES, fidelity="exact")


def run(bench):
    bench.start(ENDLESS)
    bench.tick(100)
    assert any(bench.now.target_qd)


def status(bench):
    return SafetyStatus(bench.now.safety_status).name


# --- who chooses


def test_the_first_source_that_has_chosen_decides():
    choice = OperationalModeChoice()
    assert (choice.mode, choice.source) == (OperationalMode.NONE, ModeSource.PENDANT)
    choice.choose(ModeSource.PENDANT, OperationalMode.AUTOMATIC)
    choice.choose(ModeSource.DASHBOARD, OperationalMode.MANUAL)
    assert (choice.mode, choice.source) == (OperationalMode.MANUAL, ModeSource.DASHBOARD)
    choice.choose(ModeSource.SELECTOR, OperationalMode.AUTOMATIC)
    assert choice.allows is OPERATIONAL_MODES[OperationalMode.AUTOMATIC]
    choice.choose(ModeSource.SELECTOR, None)
    assert choice.mode is OperationalMode.MANUAL
    choice.choose(ModeSource.DASHBOARD, None)
    assert choice.mode is OperationalMode.AUTOMATIC


def test_a_wired_selector_overrides_pendant_and_dashboard(bench):
    choice = bench.controller.state.operational
    bench.tick(1, MANUAL, AssignSafetyInput(1, "operational mode"))
    assert choice.mode is OperationalMode.AUTOMATIC  # low
    for command in (MANUAL, ChooseModeByDashboard(OperationalMode.MANUAL)):
        with pytest.raises(RefusedError, match="stays AUTOMATIC: the selector decides"):
            command.apply(bench.controller)
    bench.tick(1, *(SetDigitalInput("configurable", n, True) for n in (2, 3)))
    assert choice.mode is OperationalMode.MANUAL
    bench.tick(1, AUTOMATIC, AssignSafetyInput(1, "none"))
    assert choice.mode is OperationalMode.MANUAL  # what the pendant chose before


def test_the_pendant_has_no_choice_until_the_dashboard_gives_it_back(bench):
    bench.tick(1, ChooseModeByDashboard(OperationalMode.AUTOMATIC))
    with pytest.raises(RefusedError, match="the dashboard decides, which comes before the pendant"):
        MANUAL.apply(bench.controller)
    bench.tick(1, ChooseModeByDashboard(None))
    assert bench.controller.state.operational.mode is OperationalMode.NONE
    bench.tick(1, MANUAL)
    assert bench.controller.state.operational.mode is OperationalMode.MANUAL


@pytest.mark.parametrize("command", [MANUAL, PRESS, OPEN, AssignSafetyInput(0, "operational mode")])
def test_a_cb3_has_none(command):
    bench = Bench(generation=CB3)
    with pytest.raises(RefusedError, match="a box of the CB3 has no operational modes"):
        command.apply(bench.controller)


# --- the enabling device

S, A = EnablingState, EnablingAct


@pytest.mark.parametrize(
    ("acts", "then"),
    [
        ((), S.NO_DEVICE),
        ((A.RELEASE,), S.RELEASED),
        ((A.PRESS,), S.ENABLING),
        ((A.RELEASE, A.PRESS), S.ENABLING),
        ((A.PRESS, A.PRESS_FULLY), S.FULLY_PRESSED),
        ((A.PRESS_FULLY, A.PRESS), S.TO_BE_RELEASED),
        ((A.PRESS_FULLY, A.PRESS, A.PRESS), S.TO_BE_RELEASED),
        ((A.PRESS_FULLY, A.PRESS, A.RELEASE, A.PRESS), S.ENABLING),
        ((A.PRESS, A.BEGIN_MANUAL_MODE), S.TO_BE_RELEASED),
        ((A.RELEASE, A.BEGIN_MANUAL_MODE, A.PRESS), S.ENABLING),
        ((A.PRESS_FULLY, A.DISCONNECT), S.NO_DEVICE),
    ],
)
def test_states_of_the_enabling_device(acts, then):
    device = EnablingDevice()
    for act in acts:
        device.act(act)
    assert device.state is then


def test_a_device_that_is_not_held_stops_the_arm_in_manual_mode_only(bench):
    run(bench)
    for mode in (SetOperationalMode("none"), AUTOMATIC):
        bench.tick(REST, RELEASE, mode)
        assert (status(bench), any(bench.now.target_qd)) == ("NORMAL", True)
    bench.tick(REST, MANUAL)
    assert status(bench) == "SYSTEM_THREE_POSITION_ENABLING_STOP"
    assert bench.now.safety_mode == SafetyMode.SAFEGUARD_STOP
    assert bench.now.robot_mode == RobotMode.RUNNING
    assert bench.now.runtime_state == ProgramState.PAUSED
    assert not any(bench.now.target_qd)
    bench.tick(REST, PRESS)
    assert (status(bench), any(bench.now.target_qd)) == ("NORMAL", True)
    bench.tick(REST, FULLY)
    assert (status(bench), any(bench.now.target_qd)) == ("SYSTEM_THREE_POSITION_ENABLING_STOP", False)


def test_a_device_that_is_held_when_manual_mode_begins_must_be_released_first(bench):
    bench.tick(1, AUTOMATIC, PRESS)
    bench.tick(1, MANUAL)
    assert status(bench) == "SYSTEM_THREE_POSITION_ENABLING_STOP"
    bench.tick(1, ResetSafeguard(), PRESS)
    assert status(bench) == "SYSTEM_THREE_POSITION_ENABLING_STOP"
    bench.tick(1, RELEASE, PRESS)
    assert status(bench) == "NORMAL"


def test_the_device_on_configurable_inputs_and_its_status_bit(bench):
    bit = SafetyStatusBits.THREE_POSITION_ENABLING_INPUT_ACTIVE
    bench.tick(1, MANUAL, AssignSafetyInput(2, "three-position enabling"))
    assert status(bench) == "SYSTEM_THREE_POSITION_ENABLING_STOP"
    assert not bench.now.safety_status_bits & bit
    bench.tick(1, SetDigitalInput("configurable", 4, True))
    assert not bench.now.safety_status_bits & bit  # one channel of two
    bench.tick(1, SetDigitalInput("configurable", 5, True))
    assert status(bench) == "NORMAL"
    assert bench.now.safety_status_bits == bit | SafetyStatusBits.NORMAL_MODE
    bench.tick(1, AssignSafetyInput(2, "none"))
    assert bench.now.safety_status_bits == SafetyStatusBits.NORMAL_MODE


# --- the safeguard of automatic mode


def test_the_automatic_safeguard_acts_in_automatic_mode_only(bench):
    run(bench)
    bench.tick(REST, OPEN)
    assert (status(bench), any(bench.now.target_qd)) == ("NORMAL", True)
    bench.tick(REST, AUTOMATIC)
    assert status(bench) == "AUTOMATIC_MODE_SAFEGUARD_STOP"
    assert bench.now.safety_mode == SafetyMode.SAFEGUARD_STOP
    bits = SafetyStatusBits.SAFEGUARD_STOPPED | SafetyStatusBits.STOPPED_DUE_TO_SAFETY
    assert bench.now.safety_status_bits == bits
    assert not any(bench.now.target_qd)
    bench.tick(REST, MANUAL)
    assert (status(bench), any(bench.now.target_qd)) == ("NORMAL", True)
    bench.tick(REST, CLOSE, AUTOMATIC)
    assert (status(bench), any(bench.now.target_qd)) == ("NORMAL", True)


def test_it_has_a_reset_of_its_own(bench):
    bench.tick(1, AUTOMATIC, RequireSafeguardReset(True, "automatic mode"), OPEN)
    bench.tick(1, CLOSE, ResetSafeguard())
    assert status(bench) == "AUTOMATIC_MODE_SAFEGUARD_STOP"
    bench.tick(1, ResetSafeguard("automatic mode"))
    assert status(bench) == "NORMAL"


def test_it_and_its_reset_on_configurable_inputs(bench):
    bench.tick(
        1,
        AUTOMATIC,
        RequireSafeguardReset(True, "automatic mode"),
        AssignSafetyInput(0, "automatic-mode safeguard"),
        AssignSafetyInput(1, "automatic-mode safeguard reset"),
    )
    assert status(bench) == "AUTOMATIC_MODE_SAFEGUARD_STOP"
    bench.tick(1, *(SetDigitalInput("configurable", n, True) for n in (0, 1)))
    assert status(bench) == "AUTOMATIC_MODE_SAFEGUARD_STOP"
    bench.tick(1, *(SetDigitalInput("configurable", n, True) for n in (2, 3)))
    assert status(bench) == "NORMAL"


def test_a_permanent_safeguard_comes_first(bench):
    bench.tick(1, AUTOMATIC, OPEN, SafeguardStop(True))
    assert status(bench) == "SAFEGUARD_STOP"
    bench.tick(1, SafeguardStop(False))
    assert status(bench) == "AUTOMATIC_MODE_SAFEGUARD_STOP"


# --- limits


@pytest.mark.parametrize(
    ("commands", "limit"),
    [((MANUAL,), 0.25), ((ReducedMode(True),), 0.75), ((MANUAL, ReducedMode(True)), 0.25), ((), None)],
)
def test_tcp_and_elbow_keep_the_limit_of_the_mode(bench, commands, limit):
    bench.tick(1, *commands)
    bench.run(FAST)
    speeds = [
        max(hypot(*now.target_tcp_speed[:3]), hypot(*now.space.target.elbow_velocity))
        for now in bench.snapshots
    ]
    if limit is None:
        assert max(speeds) > 0.75
    else:
        assert 0.9 * limit < max(speeds) <= limit
        assert min(now.speed_scaling for now in bench.snapshots) < 1.0
    assert bench.now.safety_mode in (SafetyMode.NORMAL, SafetyMode.REDUCED)


def test_a_mode_that_begins_slows_a_moving_arm_down(bench):
    bench.start(FAST)
    bench.tick(300)
    assert hypot(*bench.now.target_tcp_speed[:3]) > 0.5
    bench.tick(200, MANUAL)
    assert hypot(*bench.now.target_tcp_speed[:3]) <= 0.25
    assert bench.now.runtime_state == ProgramState.PLAYING
    assert bench.now.safety_mode == SafetyMode.NORMAL


def test_no_program_starts_in_recovery_mode():
    bench = Bench(robot="ur5e", generation=E_SERIES, fidelity="exact", mode=RobotMode.POWER_OFF)
    q = (bench.controller.state.robot.q_max[0] + 0.05, *bench.now.actual_q[1:])
    bench.controller.plant.reset(q)
    bench.controller.state.motion.place(q)
    bench.tick(1, ReleaseBrakes())
    bench.tick(1000)
    assert (bench.now.robot_mode, bench.now.safety_mode) == (RobotMode.RUNNING, SafetyMode.RECOVERY)
    bench.start(FAST)
    assert "the robot is in RECOVERY" in failures(bench)[-1]
    assert bench.now.runtime_state == ProgramState.STOPPED
    limiter = bench.controller.state.speed.limiter
    assert limiter.find_violation(bench.controller.plant.sense(), bench.now.space, 0.6) is None


@pytest.mark.parametrize(
    ("wrench", "moment", "code", "text"),
    [
        ((120.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0, "Force limit violated: 120.000 N, limit 100"),
        ((0.0,) * 6, 500.0, 191, "Power limit violated: 100.000 W, limit 80"),
    ],
)
def test_force_and_power_are_limited_in_recovery_mode(bench, wrench, moment, code, text):
    bench.controller.safety.handle(SafetyEvent.RANGE_LEFT)
    limiter = bench.controller.state.speed.limiter
    sensed = bench.controller.plant.sense()._replace(
        actual_qd=(0.2, 0.0, 0.0, 0.0, 0.0, 0.0), target_moment=(moment, 0.0, 0.0, 0.0, 0.0, 0.0)
    )
    bench.now.space.wrench_at_flange = wrench
    error = limiter.find_violation(sensed, bench.now.space, 0.6).error
    assert (error.code, text in error.text) == (code, True)


# --- rights


def test_people_may_not_guide_the_arm_in_automatic_mode(bench):
    bench.tick(5, PressButton("teach", True))
    assert bench.now.control_mode == 1
    bench.tick(5, AUTOMATIC)
    assert bench.now.control_mode == 0
    bench.tick(5, StartFreedrive())
    assert bench.now.control_mode == 0
    assert "freedrive refused" in infos(bench)[-1]
    bench.tick(5, MANUAL)
    assert bench.now.control_mode == 1


def test_a_program_may_go_into_freedrive_in_automatic_mode(bench):
    bench.tick(1, AUTOMATIC)
    bench.start("def f():\n  freedrive_mode()\n  sleep(1)\nend\n")
    bench.tick(10)
    assert bench.now.control_mode == 1
