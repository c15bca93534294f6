"""What the box decides by its generation, it reads from the record.

A second record makes a second kind of box, with other control cycles: the same times in seconds, and frames,
packages and steps at its own period. A software version has one number, build and date on all ports.
"""

import json
import zipfile
from dataclasses import fields, replace
from functools import partial

import numpy as np
import pytest
from box_support import Bench, FrameReader, MessageReader, connect, inside
from dashboard_support import Dashboard, write_programs
from generation_support import MISSING_BUILTIN, SECOND
from rtde_support import RtdeClient

from protocol.primary import messages as M
from protocol.primary.layout import ConfigurationData, ForceModeData, MasterboardData, RobotModeData
from protocol.primary.messages import VersionMessage
from protocol.rtde import codec as R
from protocol.ur_types import SafetyMode, SoftwareVersion
from ur_emulator import ControlBox
from ur_emulator.errors import ArgumentError, EmulatorError
from ur_emulator.machine.commands.safety import TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.machine.controller.safety.safety_state import limits_of
from ur_emulator.machine.controller.safety.speed_scaling import ModeLimits, limits_of_mode
from ur_emulator.machine.models.cb3_arms import UR3
from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.models.safety_limits import ArmLimits


@pytest.fixture(scope="module")
def box():
    with ControlBox(in_process=True, pace="lockstep", port_base=None, generation=SECOND) as box:
        yield box


def test_the_second_record_differs_in_every_field():
    assert not [f.name for f in fields(CB3) if getattr(SECOND, f.name) == getattr(CB3, f.name)]


def test_the_box_follows_its_generation(box):
    assert UR3.generation is CB3
    assert inside(box)._box.controller.generation is SECOND
    assert box.identity["software"] == "5.1.0"
    box.run_program("def p():\n  textmsg(get_steptime())\nend\n")
    box.wait_until(log="0.004")
    with pytest.raises(ArgumentError, match=MISSING_BUILTIN):
        box.run_program(f'def p():\n  {MISSING_BUILTIN}("x")\nend\n')


def test_ports_have_its_commands_columns_sub_packages_and_variables(box):
    with Dashboard(box) as dashboard:
        assert dashboard.ask("PolyscopeVersion") == "second: URSoftware 5.1.0.77 (Feb 03 2031)"
        assert dashboard.ask("power on") == "could not understand: 'power on'"
    with connect(box, "realtime") as sock:
        frame = FrameReader(sock).next()
    assert (frame.layout.size, frame.names[-1]) == (1060, "runtime_state")
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        version = reader.message(VersionMessage)
        state = reader.state()
    assert (version.major, version.build_date) == (5, "03-02-2031, 00:00:00")
    assert state.find(MasterboardData) is not None
    assert state.find(ForceModeData) is None
    configuration = state.find(ConfigurationData)
    assert (configuration.robot_sub_type, configuration.joint_max_acceleration) == (3, (55.0,) * 6)
    with connect(box, "rtde") as sock:
        client = RtdeClient(sock)
        assert client.ask(R.GetControllerVersion()).version == (5, 1, 0, 77)
        outputs = client.ask(R.SetupOutputs(("timestamp", "actual_momentum"), 250.0))
        inputs = client.ask(R.SetupInputs(("speed_slider_fraction", "speed_slider_mask")))
        assert outputs.types == inputs.types == ("DOUBLE", "NOT_FOUND")


def test_an_arm_is_as_good_as_one_of_its_fidelities():
    bench = Bench(generation=SECOND, fidelity="exact")
    assert bench.controller.plant.fidelity.dead_time == pytest.approx(CB3.fidelity("ideal").dead_time + 0.004)
    with pytest.raises(EmulatorError, match="unknown fidelity 'poor': choose one of exact, ideal, typical"):
        ControlBox(in_process=True, fidelity="poor", generation=SECOND)
    with pytest.raises(EmulatorError, match=r"software of the test series is 4\.x"):
        ControlBox(in_process=True, generation=replace(CB3, name="test series", major=4))


def test_reduced_and_recovery_mode_have_its_limits():
    robot = replace(UR3, generation=SECOND)
    rules = SECOND.limits
    of = partial(limits_of_mode, limits=limits_of(robot), rules=rules)
    reduced = tuple(0.25 * speed for speed in UR3.qd_max)
    assert of(SafetyMode.REDUCED, is_manual=False) == ModeLimits(reduced, rules.reduced)
    assert of(SafetyMode.RECOVERY, is_manual=True) == ModeLimits((0.1,) * 6, rules.recovery)
    assert of(SafetyMode.NORMAL, is_manual=True) == ModeLimits(robot.qd_safety, rules.manual)
    assert of(SafetyMode.REDUCED, is_manual=True).arm == ArmLimits(tool_speed=0.3)
    assert of(SafetyMode.NORMAL, is_manual=False) is None


# Version given, all four numbers, day, and what the version message says: third number, build, date.
TOLD = [
    ("3.2.0", (3, 2, 0, 19171), "Jan 01 2016", (19171, 0, "Jan 01 2016, 00:00:00")),
    ("3.4.5", (3, 4, 5, 60), "Jul 08 2016", (5, 60, "Jul 08 2016, 16:07:20")),
    ("3.12.1", (3, 12, 1, 76000), "May 03 2019", (1, 0, "03-05-2019, 06:39:00")),
    ("3.15.8.7", (3, 15, 8, 7), "Nov 30 2021", (8, 0, "30-11-2021, 00:00:00")),
    ("5.24.0", (5, 24, 0, 1214860), "Oct 04 2025", (0, 0, "04-10-2025, 00:25:33")),
]
REPORTS_SINCE = SoftwareVersion(3, 13)


@pytest.mark.parametrize(("given", "numbers", "day", "message"), TOLD, ids=[row[0] for row in TOLD])
def test_every_port_reports_the_same_software(tmp_path, given, numbers, day, message):
    version = SoftwareVersion(*numbers)
    folder = write_programs(tmp_path)
    robot = "ur3" if version.major == 3 else "ur5e"
    with ControlBox(robot, given, in_process=True, pace="lockstep", port_base=None, programs=folder) as box:
        with connect(box, "rtde") as sock:
            assert RtdeClient(sock).ask(R.GetControllerVersion()).version == version
        with connect(box, "primary") as sock:
            told = MessageReader(sock).message(M.VersionMessage)
        assert (told.major, told.minor) == numbers[:2]
        assert (told.bugfix, told.build, told.build_date) == message
        with Dashboard(box) as dashboard:
            assert dashboard.ask("PolyscopeVersion") == f"URSoftware {version} ({day})"
            if version >= REPORTS_SINCE:
                assert dashboard.ask("generate flight report").endswith(":1")
                with zipfile.ZipFile(folder / "flightreports" / "flightreport_1.zip") as report:
                    assert json.loads(report.read("versions.json"))["software"] == str(version)
        assert box.identity["software"] == given


# One more with a control cycle of one physics step.
OTHERS = [SECOND, replace(CB3, period_us=2_000, substep_us=2_000)]
# Two cycles of a CB3 [s]: by so much a script that waits for a whole cycle may differ.
SLACK = 0.016

every_generation = pytest.mark.parametrize("generation", OTHERS, ids=["second", "one step a cycle"])


def body(text):
    return "def p():\n" + "".join(f"  {line}\n" for line in text.splitlines()) + "end\n"


def time_of(bench, text):
    """Run a program to its end; return how long it took [s]."""
    begin = bench.now.timestamp
    bench.start(body(text))
    while bench.controller.programs.is_running:
        bench.tick()
    return bench.now.timestamp - begin


@every_generation
def test_a_box_begins_a_minute_after_its_start_and_counts_in_its_own_cycles(generation):
    bench = Bench(generation=generation)
    assert bench.now.timestamp == pytest.approx(60.0, abs=SLACK)
    bench.tick(100)
    stamps = [snapshot.timestamp for snapshot in bench.snapshots]
    assert np.diff(stamps) == pytest.approx(generation.period_s)


@every_generation
def test_programs_get_the_cycle_and_sync_takes_one(generation):
    bench = Bench(generation=generation)
    assert bench.run(body("textmsg(get_steptime())")) == [f"{generation.period_s:g}"]
    took = time_of(bench, "i = 0\nwhile i < 50:\n  i = i + 1\n  sync()\nend")
    assert took == pytest.approx(50 * generation.period_s, abs=2 * generation.period_s)


@every_generation
@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("sleep(0.5)", 0.5),
        # The time of a program's first move runs up in 0.16 s.
        ("movej([0.3, -1.57, -1.57, -1.57, 1.57, 0], t=1)", 1.0 + 0.08),
        # 0.1 m: 0.1/0.25 + 0.25/1.2 s.
        ("movel(pose_add(get_target_tcp_pose(), p[0, 0, 0.1, 0, 0, 0]))", 0.608 + 0.08),
    ],
    ids=["sleep", "movej", "movel"],
)
def test_what_takes_time_takes_the_same_time(generation, text, seconds):
    bench = Bench(generation=generation, fidelity="exact")
    assert time_of(bench, text) == pytest.approx(seconds, abs=2 * SLACK)


@every_generation
def test_a_stream_of_speedj_reaches_its_speed_and_goes_as_far(generation):
    bench = Bench(generation=generation, fidelity="exact")
    q_before = bench.now.actual_q[0]
    bench.start(body("while True:\n  speedj([0.2, 0, 0, 0, 0, 0], 1, get_steptime())\nend"))
    bench.tick(generation.cycles(1.0))
    assert bench.now.actual_qd[0] == pytest.approx(0.2, abs=0.005)
    # 0.2 s of acceleration at 1 rad/s^2, then 0.2 rad/s.
    assert bench.now.target_q[0] - q_before == pytest.approx(0.02 + 0.2 * 0.8, abs=0.2 * SLACK)
    assert bench.now.actual_q[0] == pytest.approx(bench.now.target_q[0], abs=0.01)


@every_generation
def test_a_watchdog_counts_seconds(generation):
    bench = Bench(generation=generation)
    text = 'rtde_set_watchdog("input_int_register_24", 10, "stop")\nwhile True:\n  sync()\nend'
    assert 0.1 <= time_of(bench, text) <= 0.1 + 3 * generation.period_s


@every_generation
def test_a_protective_stop_may_be_unlocked_after_its_delay_and_time_passes_until_then(generation):
    bench = Bench(generation=generation, fidelity="exact")
    bench.tick(1, TriggerProtectiveStop())
    begin = bench.now.timestamp
    while bench.controller.is_active:
        bench.tick()
    assert bench.now.timestamp - begin >= 5.0
    bench.tick(1, UnlockProtectiveStop())
    assert bench.now.safety_mode == 1


@every_generation
def test_joint_positions_are_remembered_for_a_second(generation):
    bench = Bench(generation=generation)
    bench.tick(generation.cycles(1.5))
    allowed = generation.cycles(1.0) - 1
    (text,) = bench.run(body(f"textmsg(get_actual_joint_positions_history({allowed}))"))
    assert text.startswith("[")


@every_generation
def test_frames_and_packages_come_at_the_period(generation):
    period, rate = generation.period_s, generation.cycle_rate
    with (
        ControlBox(in_process=True, pace="lockstep", port_base=None, generation=generation) as box,
        connect(box, "realtime") as sock,
        connect(box, "primary") as sender,
    ):
        frames, states = FrameReader(sock), MessageReader(sender)
        sender.sendall(body("sleep(1.2)").encode())
        stamps = [frames.until(lambda frame: frame.runtime_state == 2).timestamp]
        stamps += [frames.next().timestamp for _ in range(rate)]
        assert np.diff(stamps) == pytest.approx(period)
        # Before the program is compiled time stands still, and states repeat themselves.
        while not (state := states.state().find(RobotModeData)).is_program_running:
            pass
        times = [state.timestamp, *(states.state().find(RobotModeData).timestamp for _ in range(8))]
        assert np.diff(times) == pytest.approx(100_000, abs=generation.period_us)


@every_generation
@pytest.mark.parametrize("frequency", [125.0, 10.0])
def test_rtde_has_whole_parts_of_the_full_rate(generation, frequency):
    with (
        ControlBox(in_process=True, pace="lockstep", port_base=None, generation=generation) as box,
        connect(box, "rtde") as sock,
    ):
        client = RtdeClient(sock)
        client.subscribe("timestamp", "runtime_state", frequency=frequency)
        with connect(box, "secondary") as sender:
            sender.sendall(body("sleep(2)").encode())
            while client.data()["runtime_state"] != 2:
                pass
            stamps = [client.data()["timestamp"] for _ in range(10)]
    # 10 of 125 a second are every twelfth.
    cycles = int(generation.cycle_rate / frequency)
    assert np.diff(stamps) == pytest.approx(cycles * generation.period_s)
