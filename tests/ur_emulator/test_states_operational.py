"""Operational modes of an e-Series box beside what chunks show (`chunks/watched/operational.script`): choice, device, limits."""

from math import hypot

import pytest
from box_support import Bench
from states_support import failures

from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator.errors import RefusedError
from ur_emulator.machine.commands.power import (
    ChooseModeByDashboard,
    MoveEnablingDevice,
    ReleaseBrakes,
    SetOperationalMode,
)
from ur_emulator.machine.commands.safety import AssignSafetyInput, ReducedMode, SafeguardStop
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
PRESS = MoveEnablingDevice("pressed")
OPEN = SafeguardStop(True, "automatic mode")
FAST = (
    "def fast():\n  q = get_actual_joint_positions()\n"
    "  movej([q[0] + 2, q[1], q[2], q[3], q[4], q[5]], a=8, v=3)\nend\n"
)


@pytest.fixture
def bench():
    return Bench(robot="ur5e", generation=E_SERIES, fidelity="exact")


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
