"""Installations: what they do to the box, to scripts that come of nodes, and what programs leave in them."""

import gzip
import math
import re
from contextlib import contextmanager
from pathlib import Path

import pytest
from box_support import Bench, MessageReader, connect, inside
from dashboard_support import Dashboard, script_line, urp
from installation_support import SAFETY, TCP, installation, listed, pose_feature

from protocol.primary.layout import ConfigurationData, SafetyData
from protocol.primary.messages import TextMessage
from protocol.ur_types import SafetyMode
from ur_emulator.emulator import ControlBox
from ur_emulator.errors import RefusedError
from ur_emulator.host.ports.primary.robot_state import safety_checksum
from ur_emulator.machine.commands.programs import SetUp, StartProgram
from ur_emulator.machine.commands.surroundings import Push
from ur_emulator.machine.controller.io.lines import RunState
from ur_emulator.machine.controller.io.network import SignalType
from ur_emulator.machine.controller.safety.inputs import SafetyInput
from ur_emulator.machine.controller.safety.safety_state import SafetySettings, limits_of
from ur_emulator.machine.models.cb3_arms import UR3
from ur_emulator.machine.models.robot_model import ZERO6
from ur_emulator.machine.models.robots import robot_by_name
from ur_emulator.machine.models.safety_limits import ArmLimits
from ur_emulator.program_files.header import header_lines, setup_script
from ur_emulator.program_files.installation import DeclaredSignal, Feature, Installation, OutputRule
from urscript import compile_program

LAMP = DeclaredSignal("LAMP", "10.0.0.9", 255, 7, SignalType.DIGITAL_OUTPUT, 5.0, RunState.LOW_WHEN_STOPPED)
CELL = Installation(
    "/programs/cell.installation",
    tcps={"Gripper": (0.0, 0.0, 0.12, 0.0, 0.0, 0.5)},
    tcp_offset=(0.0, 0.0, 0.12, 0.0, 0.0, 0.5),
    payload=1.25,
    payload_cog=(0.0, 0.01, 0.05),
    tool_voltage=24,
    input_actions=(("tool_digital", 1, "FREEDRIVE"), ("standard_digital", 0, "START")),
    output_rules=(
        OutputRule("standard_digital", 1, RunState.LOW_WHEN_STOPPED),
        OutputRule("standard_digital", 2, RunState.HIGH_WHEN_RUNNING),
    ),
    features={
        "table": Feature((0.1, 0.2, 0.3, 0.0, 0.0, 0.0), is_variable=True),
        "Box": Feature(ZERO6, is_variable=True),
        "fixed": Feature(ZERO6),
    },
    variables={"count": "7", "names": '["a", "b"]'},
    modbus=(LAMP,),
)


@pytest.fixture
def box(tmp_path):
    with ControlBox(in_process=True, pace="lockstep", port_base=None, seed=7, programs=tmp_path) as box:
        yield box


@pytest.fixture
def dashboard(box):
    with Dashboard(box) as dashboard:
        yield dashboard


def test_the_header_has_what_polyscope_writes():
    text = "\n".join(header_lines(CELL))
    golden = (Path(__file__).parents[1] / "programs" / "installation_header.script").read_text()
    assert (
        re.sub(r"(?<=step_count)_\w+|(?<=Step_Counter_Thread)_\w+", "", text)
        == golden.partition("\n")[2].rstrip()
    )
    compile_program(f"def p():\n{text}\nend\n")


def test_an_installation_takes_back_what_the_one_before_has_set_up():
    text = setup_script(Installation("/programs/default.installation"), CELL)
    assert "  set_runstate_standard_digital_output_to_value(2, 0)\n" in text
    assert '  modbus_delete_signal("LAMP")\n' in text
    compile_program(text)


@pytest.mark.parametrize("power", ["on", "off"])
def test_an_installation_is_effective_when_it_is_loaded(box, dashboard, tmp_path, power):
    actions = listed("DigitalOutputActions", "NONE", "PROGRAM_RUNNING")
    (tmp_path / "cell.installation").write_bytes(installation(TCP, "<IOs>", actions, "</IOs>"))
    if power == "off":
        dashboard.ask("power off")
    said = dashboard.ask("load installation cell.installation")
    assert said == "Loading installation: /programs/cell.installation"
    state = inside(box)._box.controller.snapshot
    assert state.tcp_offset == (0.0, 0.0, 0.12, 0.0, 0.0, 0.5)
    assert (state.payload, state.payload_cog) == (1.25, (0.0, 0.01, 0.05))


def first_text(box, dashboard, folder, parts, *lines):
    """Play a program of these lines with an installation of these parts; return the first text that it shows."""
    (folder / "cell.installation").write_bytes(installation(*parts))
    (folder / "p.urp").write_bytes(urp("".join(map(script_line, lines)), installation="cell"))
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        said = dashboard.ask_all("load p.urp", "play")
        assert said == ["Loading program: /programs/p.urp", "Starting program"]
        text = reader.message(TextMessage).text
    dashboard.until("programState", "STOPPED p.urp")
    return text


def test_a_program_takes_the_installation_that_it_names(box, dashboard, tmp_path):
    table = pose_feature("table", (0.5, 0, 0, 0, 0, 0), is_variable=True)
    parts = TCP, "<Features>", table, "</Features>"
    assert first_text(box, dashboard, tmp_path, parts, "textmsg(table)") == "p[0.5,0,0,0,0,0]"


def test_an_installation_that_the_arm_cannot_bear_is_said(box, dashboard, tmp_path):
    (tmp_path / "heavy.installation").write_bytes(installation(TCP.replace("1.25", "8.5")))
    dashboard.ask("load installation heavy.installation")
    dashboard.ask("running")
    assert any("a payload of 8.5 kg is out of range" in entry.text for entry in box.log)


def test_the_limits_of_an_installation_bind_the_arm(box, dashboard, tmp_path):
    """The ranges of the joints count from its safety settings, and the speeds of reduced mode."""
    parts = "<SafetySettings>", SAFETY.replace("[1, 1, 1,", "[0, 1, 1,"), "</SafetySettings>"
    lines = (
        "textmsg(is_within_safety_limits([0, -1, 0, 0, 0, 0]))", "movej([1.0, -1.76, -2.1, -0.1, 1.3, 1.86])",
    )  # fmt: skip
    assert first_text(box, dashboard, tmp_path, parts, *lines) == "True"
    assert any("joint 0 cannot be at 1 rad; allowed: -6.3355 to 0.0524" in entry.text for entry in box.log)
    limits = inside(box)._box.controller.state.safety.limits
    assert limits.reduced_speed == (1.5, 1.5, 1.5, 3.0, 3.0, 3.0)
    dashboard.ask("load installation default.installation")
    assert inside(box)._box.controller.state.safety.limits == limits_of(robot_by_name("ur3"))


PAIRS = {
    "safeguardStopReset": (0, 1), "threePositionEnabling": (2, 3), "operationalMode": (255, 255),
    "automaticModeSafeguardStop": (4, 5), "automaticModeSafeguardStopReset": (6, 7),
}  # fmt: skip
INPUTS = "\n[SafetyIOConfiguration Inputs]\n" + "".join(
    f"{name}InputA = {a}\n{name}InputB = {b}\n" for name, (a, b) in PAIRS.items()
)
ASSIGNED = {
    1: SafetyInput.ENABLING_DEVICE,
    2: SafetyInput.AUTOMATIC_SAFEGUARD,
    3: SafetyInput.AUTOMATIC_RESET,
}


@pytest.mark.parametrize(("robot", "assigned"), [("ur3", {}), ("ur5e", ASSIGNED)])
def test_an_installation_sets_up_inputs_of_an_e_series_box(tmp_path, robot, assigned):
    settings = f"<SafetySettings>{SAFETY}{INPUTS}</SafetySettings>"
    (tmp_path / "cell.installation").write_bytes(installation(settings))
    (tmp_path / "plain.installation").write_bytes(installation(""))
    with (
        ControlBox(in_process=True, robot=robot, pace="lockstep", port_base=None, programs=tmp_path) as box,
        Dashboard(box) as dashboard,
    ):
        dashboard.ask("load installation cell.installation")
        assert inside(box)._box.controller.safety.inputs.assigned == assigned
        if assigned:
            box.set_operational_mode("automatic")
            assert box.state.safety_status == "AUTOMATIC_MODE_SAFEGUARD_STOP"
            for n in (4, 5):
                box.set_digital_input("configurable", n, True)
            assert box.state.safety_status == "AUTOMATIC_MODE_SAFEGUARD_STOP"  # it has a reset
            for n in (6, 7):
                box.set_digital_input("configurable", n, True)
            assert box.state.safety_status == "NORMAL"
        dashboard.ask("load installation plain.installation")
        assert inside(box)._box.controller.safety.inputs.assigned == {}


def test_an_installation_cannot_widen_the_limits_of_the_arm():
    own = limits_of(robot_by_name("ur5"))
    wide, fast = (1e9,) * 6, (100.0,) * 6
    settings = SafetySettings(tuple(-x for x in wide), wide, fast, own.reduced_speed)
    assert own.within(settings) == own
    slow = own.within(SafetySettings(joint_speed=(1.0,) * 6, reduced_joint_speed=fast))
    assert (slow.speed, slow.reduced_speed) == ((1.0,) * 6, (1.0,) * 6)


def test_reduced_mode_allows_no_more_than_normal_mode():
    own = limits_of(robot_by_name("ur5e"))
    normal, reduced = ArmLimits(tool_speed=0.5, force=100.0), ArmLimits(tool_speed=1.0, force=50.0)
    assert own.within(SafetySettings(arm=normal)).reduced_arm == ArmLimits(tool_speed=0.5, force=100.0)
    both = own.within(SafetySettings(arm=normal, reduced_arm=reduced))
    assert (both.arm, both.reduced_arm) == (normal, ArmLimits(tool_speed=0.5, force=50.0))


LIMITS = SAFETY.replace("[1, 1, 1,", "[0, 1, 1,") + (
    "[SafetyLimits Normal Values]\nmaxTcpSpeed = 0.25\nmaxForce = 150.0\nmaxPower = 300.0\nmaxMomentum = 25.0\n"
    "[SafetyLimits BoundaryPlane0]\nmode = FAR\n"
    "[SafetyLimits BoundaryPlane1]\nmode = NORMAL\nplaneNormal = [0, 0, 1]\ndistanceToOrigin = -3\n"
)


def test_inverse_kinematics_and_what_clients_are_told_keep_the_limits_of_an_installation(
    box, dashboard, tmp_path
):
    q, parts = "[1.0, -1.2, -1.7, -0.1, 1.2, 1.8]", ("<SafetySettings>", LIMITS, "</SafetySettings>")
    line = f"textmsg(get_inverse_kin(get_forward_kin({q}), {q})[0] < 0.06)"
    assert first_text(box, dashboard, tmp_path, parts, line) == "True"
    texts = " ".join(entry.text for entry in box.log)
    unknown = "SafetyLimits BoundaryPlane0 with the unknown mode FAR is not watched"
    assert f"/programs/cell.installation: {unknown}" in texts
    limits = inside(box)._box.controller.state.safety.limits
    assert [plane.name for plane in limits.boundaries.planes] == ["BoundaryPlane1"]
    with connect(box, "primary") as sock:
        first = MessageReader(sock).state()
    assert first.find(ConfigurationData).joint_max_limit[0] == pytest.approx(0.0524, abs=1e-4)
    assert first.find(SafetyData).safety_checksum != safety_checksum(UR3, limits_of(UR3))


def set_up(bench, **settings):
    """Make the limits of an installation effective."""
    limits = limits_of(bench.controller.state.robot).within(SafetySettings(**settings))
    bench.tick(1, SetUp(compile_program("sec installation():\n  sync()\nend\n"), limits, {}))


def test_an_installation_does_not_act_in_the_middle_of_a_motion():
    bench = Bench(fidelity="ideal")
    bench.tick(1, StartProgram(compile_program("movej([-1.0, -1.7, -1.7, -0.1, 1.2, 1.8])\n")))
    set_up = SetUp(compile_program("sec s():\n  sync()\nend\n"), bench.controller.state.safety.limits, {})
    with pytest.raises(RefusedError, match="a program runs"):
        set_up.apply(bench.controller)


def test_what_is_loaded_stays_when_a_program_begins_while_another_is_read(tmp_path):
    (tmp_path / "next.urp").write_bytes(urp(script_line("x = 1")))
    (tmp_path / "default.installation").write_bytes(installation())
    with ControlBox(in_process=True, pace="lockstep", port_base=None, programs=tmp_path) as box:
        served, player = inside(box)._box, inside(box)._player
        runs = StartProgram(compile_program("def p():\n  while True:\n    sync()\n  end\nend\n"))

        def both():
            served.start_alone(player.load("next.urp"))
            served.submit(runs)

        inside(box)._loop.call_soon_threadsafe(both, lambda error: None)
        box.wait_until(log="load next.urp failed: a program runs")
        assert player.loaded is None
        assert box.state.program_state == "PLAYING"


def test_an_arm_keeps_the_tool_speed_of_its_installation():
    bench = Bench(fidelity="ideal")
    set_up(bench, arm=ArmLimits(tool_speed=0.25))
    bench.run("movej([-1.0, -1.7, -1.7, -0.1, 1.2, 1.8], a=1.5, v=3)\n")
    speeds = [math.hypot(*s.target_tcp_speed[:3]) for s in bench.snapshots]
    assert 0.2 < max(speeds) <= 0.25
    assert min(s.speed_scaling for s in bench.snapshots) < 0.5
    assert bench.now.safety_mode == SafetyMode.NORMAL
    set_up(bench)
    bench.snapshots.clear()
    bench.run("movej([0.5, -1.7, -1.7, -0.1, 1.2, 1.8], a=1.5, v=3)\n")
    assert max(math.hypot(*s.target_tcp_speed[:3]) for s in bench.snapshots) > 0.5


def test_an_arm_that_presses_harder_than_its_installation_allows_is_stopped():
    bench = Bench(fidelity="ideal")
    set_up(bench, arm=ArmLimits(force=40.0))
    bench.tick(30, Push((0.0, 0.0, -60.0), duration=2.0))
    assert bench.now.safety_mode == SafetyMode.NORMAL
    bench.tick(60)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert any("Force limit violated" in getattr(event, "text", "") for event in bench.events)


def test_a_hand_cannot_lead_a_joint_out_of_the_range_of_its_installation():
    bench = Bench(fidelity="ideal")
    end = bench.now.actual_q[0] + 0.05
    set_up(bench, q_max=(end, *(6.0,) * 5))
    bench.start("def p():\n  freedrive_mode()\n  sleep(100)\nend\n")
    bench.tick(5)
    x, y, *_ = bench.now.actual_tcp_pose
    arm_length = math.hypot(x, y)
    bench.tick(150, Push((-60.0 * y / arm_length, 60.0 * x / arm_length, 0.0), duration=5.0))
    assert any(getattr(event, "code", 0) == 150 for event in bench.events)
    assert bench.now.actual_q[0] < end + 0.2


# --- variables

PROPERTIES = (
    "#\n#Tue Mar 02 10:11:12 CET 2021\ncount=7\nplace=p[0.1, 0.2, 0.3, 0.0, 0.0, 0.0]\nother=[1, 2]\n"
)
XML = (
    '<InstallationVariables timestamp="1"><variable name="count" value="7" favourite="false" />'
    '<variable name="place" value="p[0.1, 0.2, 0.3, 0.0, 0.0, 0.0]" /><variable name="other" value="[1, 2]" />'
    "</InstallationVariables>"
)


@pytest.mark.parametrize(("text", "packed"), [(PROPERTIES, True), (XML, False)], ids=["properties", "XML"])
def test_variables_survive_a_run(box, dashboard, tmp_path, text, packed):
    file = tmp_path / "cell.variables"
    file.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
    (tmp_path / "cell.installation").write_bytes(installation())
    nodes = script_line("count = count + 1") + script_line("place[0] = 1 / 3") + script_line("textmsg(count)")
    (tmp_path / "p.urp").write_bytes(urp(nodes, installation="cell"))
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        dashboard.ask_all("load p.urp", "play")
        assert reader.message(TextMessage).text == "8"
        dashboard.until("programState", "STOPPED p.urp")
        dashboard.until("play", "Starting program")
        assert reader.message(TextMessage).text == "9"
        dashboard.until("programState", "STOPPED p.urp")
    expected = text.replace("7", "9").replace("0.1, 0.2", "0.33333, 0.2")
    for _ in range(20_000):  # the worker process writes it
        if sum("Saved the variables" in entry.text for entry in box.log) == 2:
            break
        dashboard.ask("running")
    data = file.read_bytes()
    saved = (gzip.decompress(data) if packed else data).decode()
    assert saved == expected


# --- actions of inputs


def pulse(box, dashboard, line):
    for level in (True, False):
        box.set_digital_input("standard", line, level)
        dashboard.ask_all("running", "running")


@pytest.fixture
def machine(box, dashboard, tmp_path):
    """A box with an installation whose inputs 0, 1 and 2 start, pause and stop, and a program for ever."""
    actions = listed("DigitalInputActions", "START", "PAUSE", "STOP", "NONE")
    (tmp_path / "cell.installation").write_bytes(installation("<IOs>", actions, "</IOs>"))
    (tmp_path / "p.urp").write_bytes(urp(script_line("sleep(1000)"), installation="cell"))
    dashboard.ask("load p.urp")
    return box


def test_inputs_start_pause_resume_and_stop_a_program(machine, dashboard):
    for line, state in ((0, "PLAYING"), (1, "PAUSED"), (0, "PLAYING"), (2, "STOPPED"), (0, "PLAYING")):
        pulse(machine, dashboard, line)
        dashboard.until("programState", f"{state} p.urp")


def test_inputs_act_on_rising_edges_of_the_installation_that_is_loaded(machine, dashboard, tmp_path):
    machine.set_digital_input("standard", 2, True)
    dashboard.ask_all("play", "running", "running")
    dashboard.until("programState", "PLAYING p.urp")
    machine.set_digital_input("standard", 2, False)
    dashboard.ask_all("running", "running")
    dashboard.until("programState", "PLAYING p.urp")
    pulse(machine, dashboard, 2)
    dashboard.until("programState", "STOPPED p.urp")
    dashboard.ask("load installation default.installation")
    pulse(machine, dashboard, 0)
    dashboard.ask_all(*["running"] * 5)
    assert dashboard.ask("programState") == "STOPPED p.urp"


# --- start-up


def start_up(line="digital_in[6]", level="true"):
    return (
        f'<DefaultProgramSettings autoLoad="true" fileName="sub/p.urp" nameOfSensorToAutoStartProgram="{line}" '
        f'triggerValueToStartProgram="{level}"/>'
    )


@contextmanager
def starting_box(folder, *parts, statement="x = 1", robot="ur3"):
    """A box with a default installation of these parts, a program that it names, and a client of the dashboard."""
    (folder / "sub").mkdir()
    (folder / "sub" / "p.urp").write_bytes(urp(script_line(statement)))
    (folder / "default.installation").write_bytes(installation(*parts))
    with (
        ControlBox(robot, in_process=True, pace="lockstep", port_base=None, programs=folder) as box,
        Dashboard(box) as dashboard,
    ):
        yield box, dashboard


def after_start_up(dashboard):
    """What is loaded then: what a client asks to load comes after it."""
    dashboard.ask("load installation default.installation")
    return dashboard.ask("get loaded program")


@pytest.mark.parametrize(("line", "level"), [("digital_in[6]", True), ("digital_in[6]", False), ("go", True)])
def test_the_default_installation_loads_a_program_that_a_line_starts(tmp_path, line, level):
    parts = start_up(line, str(level).lower()), listed("DigitalInputNames", *[""] * 6, "go", "")
    with (
        starting_box(tmp_path, *parts, statement='textmsg("started")') as (box, dashboard),
        connect(box, "primary") as sock,
    ):
        reader = MessageReader(sock)
        assert after_start_up(dashboard) == "Loaded program: /programs/sub/p.urp"
        for state in (not level, level):
            box.set_digital_input("standard", 6, state)
            dashboard.ask_all("running", "running")
        assert reader.message(TextMessage).text == "started"


def test_what_a_client_loads_at_start_up_stays(tmp_path):
    """However soon it asks: the box loads its own program before."""
    (tmp_path / "other.urp").write_bytes(urp(script_line("x = 1")))
    with starting_box(tmp_path, start_up()) as (box, dashboard):
        assert dashboard.ask("load other.urp") == "Loading program: /programs/other.urp"
        loaded = [entry.text for entry in box.log if entry.text.startswith("Loaded program")]
        assert loaded == ["Loaded program: /programs/sub/p.urp", "Loaded program: /programs/other.urp"]
        pulse(box, dashboard, 6)
        said = dashboard.ask_all("running", "get loaded program")
        assert said == ["Program running: false", "Loaded program: /programs/other.urp"]


def test_a_start_line_that_is_no_input_is_said(tmp_path):
    with starting_box(tmp_path, start_up("digital_in[9]")) as (box, dashboard):
        assert after_start_up(dashboard) == "Loaded program: /programs/sub/p.urp"
        dashboard.ask("running")
        assert any("'digital_in[9]': it is no digital input" in entry.text for entry in box.log)


def test_an_input_starts_nothing_in_local_control(tmp_path):
    parts = "<IOs>", listed("DigitalInputActions", "START"), "</IOs>", start_up("")
    with starting_box(tmp_path, *parts, statement="sleep(1000)", robot="ur5e") as (box, dashboard):
        assert after_start_up(dashboard) == "Loaded program: /programs/sub/p.urp"
        box.remote_control(False)
        pulse(box, dashboard, 0)
        dashboard.ask_all(*["running"] * 5)
        assert dashboard.ask("running") == "Program running: false"
        assert any("an input starts programs only in remote control" in entry.text for entry in box.log)
