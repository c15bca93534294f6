"""What the box decides by its generation, it reads from the record: a second record gives a second kind of box."""

from dataclasses import fields, replace
from functools import partial

import pytest
from box_support import Bench, FrameReader, MessageReader, connect, inside
from dashboard_support import Dashboard
from generation_support import MISSING_BUILTIN, SECOND
from rtde_support import RtdeClient

from protocol.primary.layout import ConfigurationData, ForceModeData, MasterboardData
from protocol.primary.messages import VersionMessage
from protocol.rtde import codec as R
from protocol.ur_types import SafetyMode
from ur_emulator import ControlBox
from ur_emulator.controller.safety.safety_state import limits_of
from ur_emulator.controller.safety.speed_scaling import ModeLimits, limits_of_mode
from ur_emulator.errors import ArgumentError, EmulatorError
from ur_emulator.models.cb3_arms import UR3
from ur_emulator.models.generations import CB3
from ur_emulator.models.safety_limits import ArmLimits


@pytest.fixture(scope="module")
def box():
    with ControlBox(in_process=True, pace="lockstep", port_base=None, generation=SECOND) as box:
        yield box


def test_the_second_record_differs_in_every_field():
    assert not [f.name for f in fields(CB3) if getattr(SECOND, f.name) == getattr(CB3, f.name)]


def test_every_arm_names_its_generation_and_the_box_follows_it(box):
    assert UR3.generation is CB3
    assert inside(box)._box.controller.generation is SECOND
    assert box.identity["software"] == "5.1.0"


def test_the_dashboard_has_its_commands(box):
    with Dashboard(box) as dashboard:
        assert dashboard.ask("PolyscopeVersion") == "second: URSoftware 5.1.0.77 (Feb 03 2031)"
        assert dashboard.ask("power on") == "could not understand: 'power on'"


def test_frames_have_its_columns_and_its_size(box):
    with connect(box, "realtime") as sock:
        frame = FrameReader(sock).next()
    assert (frame.layout.size, frame.names[-1]) == (1060, "runtime_state")


def test_states_have_its_sub_packages_and_configuration(box):
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        version = reader.message(VersionMessage)
        state = reader.state()
    assert (version.major, version.build_date) == (5, "03-02-2031, 00:00:00")
    assert state.find(MasterboardData) is not None
    assert state.find(ForceModeData) is None
    configuration = state.find(ConfigurationData)
    assert configuration.robot_sub_type == 3
    assert configuration.joint_max_acceleration == (55.0,) * 6


def test_rtde_has_its_variables_and_its_rate(box):
    with connect(box, "rtde") as sock:
        client = RtdeClient(sock)
        assert client.ask(R.GetControllerVersion()).version == (5, 1, 0, 77)
        assert client.ask(R.SetupOutputs(("timestamp", "actual_momentum"), 250.0)).types == (
            "DOUBLE",
            "NOT_FOUND",
        )
        assert client.ask(R.SetupInputs(("speed_slider_mask", "speed_slider_fraction"))).types == (
            "NOT_FOUND",
            "DOUBLE",
        )


def test_programs_have_its_builtins(box):
    box.run_program("def p():\n  textmsg(get_steptime())\nend\n")
    box.wait_until(log="0.004")
    with pytest.raises(ArgumentError, match=MISSING_BUILTIN):
        box.run_program(f'def p():\n  {MISSING_BUILTIN}("x")\nend\n')


def test_an_arm_is_as_good_as_one_of_its_fidelities():
    bench = Bench(generation=SECOND, fidelity="ideal")
    assert bench.controller.plant.dead_time == pytest.approx(CB3.fidelity("ideal").dead_time + 0.004)
    with pytest.raises(EmulatorError, match="unknown fidelity 'poor': choose one of exact, ideal, typical"):
        ControlBox(in_process=True, fidelity="poor", generation=SECOND)


def test_reduced_and_recovery_mode_have_its_limits():
    robot = replace(UR3, generation=SECOND)
    rules = SECOND.limits
    of = partial(limits_of_mode, limits=limits_of(robot), rules=rules)
    reduced = tuple(0.25 * speed for speed in UR3.qd_max)
    assert of(SafetyMode.REDUCED, is_manual=False) == ModeLimits(reduced, rules.reduced)
    assert of(SafetyMode.RECOVERY, is_manual=True) == ModeLimits((0.1,) * 6, rules.recovery)
    assert of(SafetyMode.NORMAL, is_manual=True) == ModeLimits(robot.qd_safety, rules.manual)
    assert of(SafetyMode.REDUCED, is_manual=True).arm == ArmLimits(tool_speed=0.3)
