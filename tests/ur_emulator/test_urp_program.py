"""Program files as scripts: each node alone, whole programs, and what the scripts do on a controller."""

from dataclasses import replace

import pytest
from box_support import Bench
from dashboard_support import expression, script_line, urp
from hypothesis import given
from hypothesis import strategies as st
from urp_samples import (
    CONTACT,
    HALT,
    JOINTS,
    SAMPLES,
    assignment,
    branch,
    direction,
    move,
    until_distance,
    variable_waypoint,
    waypoint,
)
from urp_support import NEW_BOX, lines_of, script_of, undefined_in

from protocol.pose import pose_trans
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError
from ur_emulator.machine.controller.events import ErrorReported, PopupShown, ScriptFailed
from ur_emulator.machine.controller.io.network import SignalType
from ur_emulator.machine.kinematics.arm_model import ArmModel
from ur_emulator.machine.models.cb3_arms import UR5
from ur_emulator.machine.models.robot_model import ZERO6
from ur_emulator.program_files import urp_nodes
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.installation import NEW_HOME, DeclaredSignal, Feature, Installation
from ur_emulator.program_files.installation_reader import load_installation
from ur_emulator.program_files.loading import load_program
from ur_emulator.program_files.names import identifier, is_identifier
from ur_emulator.program_files.script_writer import KINDS
from urscript import compile_program
from urscript.catalogue import catalogue_for

NEW = "5.11.1.108318"
Q = tuple(map(float, JOINTS.split(", ")))
OFFSET = (0.01, 0.0, 0.12, 0.0, 0.3, 0.0)
TOOL_POSE = ", ".join(map(str, OFFSET))
KINEMATICS = (
    '<Kinematics status="NOT_INITIALIZED" validChecksum="false"><deltaTheta value="0.0, 0.0, 0.0, 0.0, 0.0, 0.0"/>'
    '<a value="0.0, -0.425, -0.39225, 0.0, 0.0, 0.0"/><d value="0.089159, 0.0, 0.0, 0.10915, 0.09465, 0.0823"/>'
    '<alpha value="1.5707963267948966, 0.0, 0.0, 1.5707963267948966, -1.5707963267948966, 0.0"/>'
    '<jointChecksum value="0, 0, 0, 0, 0, 0"/></Kinematics>'
)
TAUGHT = f'<JointAngles angles="{JOINTS}"/><TCPOffset pose="{TOOL_POSE}"/>{KINEMATICS}'
FIXED = f"<motionParameters/><position>{TAUGHT}</position>"
CARTESIAN = 'useActiveTCP="true" positionType="CartesianPose"'
CELL = Installation(
    "/programs/cell.installation",
    tcps={"Gripper": OFFSET},
    lines={"pump": "digital_out[2]", "part there": "tool_in[0]"},
    features={"Table": Feature((0.1, 0.2, 0.0, 0.0, 0.0, 1.5), is_variable=True), "Wall": Feature((0.5, 0.0, 0.0, 0.0, 0.0, 0.0))},
    modbus=(DeclaredSignal("gate", "10.0.0.9", 255, 3, SignalType.DIGITAL_INPUT),),
    safe_home=Q,
)  # fmt: skip


def feature(name):
    return f'<feature class="GeomFeatureReference" referencedName="{name}"/>'


# --- order and numbers


@pytest.mark.parametrize(
    ("name", "function"),
    [
        ("pick place", "pick_place"),
        ("cell V1.3", "cell_V13"),
        ("7pick", "P7pick"),
        ("größe", "gru246u223e"),
        ("a-b", "a_b"),
        ("_x", "_x"),
    ],
)
def test_names_of_programs_become_names_of_functions(name, function):
    assert identifier(name) == function


@given(st.text())
def test_every_name_becomes_one_that_a_script_can_have(name):
    assert is_identifier(identifier(name))


def test_references_that_grow_without_end_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(urp_nodes, "BUDGETS", replace(BUDGETS, program_marks=10_000))
    nodes = "".join(
        f'<Folder name="{n}"><children>{"".join(f"<Folder reference={chr(34)}../../../Folder[{n}]{chr(34)}/>" for _ in range(8))}</children></Folder>'
        for n in range(2, 10)
    )
    with pytest.raises(ProgramFileError, match="more than 10000 nodes"):
        script_of(tmp_path, urp(nodes + '<Folder name="last"><children/></Folder>'))


# --- files


def test_sub_programs_in_files_of_their_own(tmp_path):
    (tmp_path / "cell").mkdir()
    (tmp_path / "cell" / "grip.urp").write_bytes(urp(script_line('textmsg("grip")')))
    call = (
        '<CallSubProgram><subprogram name="grip" keepHidden="true" {}><programFile resolves-to="file">../programs/grip.urp'
        "</programFile><children>{}</children></subprogram></CallSubProgram>"
    )
    empty, kept = call.format("", ""), call.format('keepSynchronizedWithDisk="false"', HALT)
    fresh = call.format('keepSynchronizedWithDisk="true"', HALT)
    for node, line in ((empty, 'textmsg("grip")'), (fresh, 'textmsg("grip")'), (kept, "halt")):
        (tmp_path / "cell" / "main.urp").write_bytes(urp(node))
        text = load_program(ProgramFolder(tmp_path), "cell/main.urp").script(lambda pc: "")
        function = text.partition("  def grip():\n")[2].splitlines()[:4]
        assert function[0] == '    $ 3 "grip" "noBreak"'
        assert function[2:] == [f"    {line}", "  end"]
    (tmp_path / "cell" / "grip.urp").unlink()
    (tmp_path / "cell" / "main.urp").write_bytes(urp(fresh))
    assert "\n    halt\n" in load_program(ProgramFolder(tmp_path), "cell/main.urp").script(lambda pc: "")
    (tmp_path / "cell" / "main.urp").write_bytes(urp(empty))
    undefined = load_program(ProgramFolder(tmp_path), "cell/main.urp").undefined
    assert undefined.startswith("main.urp: sub-program 'grip' is missing: ")


def test_a_script_file_of_a_node_is_read_where_it_lies(tmp_path):
    node = (
        '<Script type="File"><cachedContents>old()</cachedContents><file resolves-to="file">/ursim/programs/f.script'
        "</file></Script>"
    )
    (tmp_path / "f.script").write_text('textmsg("new")\n')
    assert lines_of(tmp_path, node) == ['$ 2 "Script: f.script"', 'textmsg("new")']


# --- positions of e-Series software


def test_a_taught_pose_is_that_of_the_angles_and_the_tool(tmp_path):
    program = urp(move("MoveL", waypoint("W", FIXED), CARTESIAN), saved_in=NEW)
    pose = script_of(tmp_path, program).splitlines()[1].removeprefix("  global W_p=p[").removesuffix("]")
    assert [float(one) for one in pose.split(",")] == pytest.approx(ArmModel(UR5).fk(Q, OFFSET), abs=1e-11)


def test_a_path_goes_on_where_the_program_begins_again(tmp_path):
    path = move("MoveP", waypoint(), 'blendRadius="0.02"')
    loop = f'<Loop type="Counting" count="2"><loopVariable name="n"/><children>{path}</children></Loop>'
    for nodes, once, radii in (
        (path, True, ["0.0"]),
        (path, False, ["0.02"]),
        (path + path, True, ["0.02", "0.0"]),
        (loop + path, False, ["0.0", "0.02"]),
        (path + move("MoveL", direction(until_distance("0.1"))), False, ["0.0"]),
    ):
        lines = lines_of(tmp_path, nodes, once=once)
        assert [line.split("r=")[1].rstrip(")") for line in lines if line.startswith("movep")] == radii


# --- what the installation gives


@pytest.mark.parametrize(
    ("nodes", "problem"),
    [
        (move("MoveL", waypoint(), feature=feature("Table")), "the pose of waypoint 'W' in feature 'Table' is not known"),
        (move("MoveL", direction(CONTACT, inside=feature("Gone"))), "the installation has no feature 'Gone'"),
        ('<Set type="NoAction"><tcp referencedName="Hook"/></Set>', "has no TCP 'Hook': it has Gripper"),
    ],
)  # fmt: skip
def test_what_the_installation_lacks_is_undefined(tmp_path, nodes, problem):
    assert problem in undefined_in(tmp_path, nodes, CELL)


@pytest.mark.parametrize("is_variable", [True, False])
def test_what_uses_a_feature_that_was_never_taught_is_undefined(tmp_path, is_variable):
    cell = replace(CELL, features={"Plane": Feature(ZERO6, is_variable, is_taught=False)})
    target = (
        '<Waypoint type="Variable" name="W"><motionParameters/><variable featureName="Plane"/></Waypoint>'
    )
    value = assignment("x", "").replace(
        "<expression>",
        '<expression><ExpressionVariable><GeomFeatureVariable featureName="Plane"/></ExpressionVariable>',
    )
    for nodes, kind in (
        (move("MoveL", waypoint("W", FIXED), CARTESIAN, feature("Plane")), "Move"),
        (move("MoveL", variable_waypoint("part"), CARTESIAN, feature("Plane")), "Move"),
        (move("MoveL", target), "Waypoint"),
        (value, "Assignment"),
        (
            move("MoveL", direction(CONTACT, inside=feature("Plane"))),
            "gui.program.direction.MoveDirectionNode",
        ),
    ):
        assert f"a <{kind}> node uses feature 'Plane', which was never taught" in undefined_in(
            tmp_path, nodes, cell
        )
    assert lines_of(tmp_path, HALT, cell) == ['$ 2 "Halt"', "halt"]


def test_an_installation_without_a_safe_home_has_that_of_a_new_arm(tmp_path):
    (tmp_path / "cell.installation").write_bytes(
        b"<Installation><SafeHomeSettings enabled='false'/></Installation>"
    )
    assert load_installation(ProgramFolder(tmp_path), "cell.installation").safe_home == NEW_HOME


def test_the_pc_of_external_control_has_a_name_in_the_installation(tmp_path):
    node = '<Contributed strategyURCapName="External Control" strategyURCapDeveloper="fzi"><dataModel/></Contributed>'
    named = Installation(NEW_BOX.wire_path, pc_name="my pc")
    assert lines_of(tmp_path, node, named) == [
        "# begin: URCap Program Node",
        "#   Source: External Control, fzi",
        "#   Type: External Control",
        '$ 2 "Control by my pc"',
        "# gap",
        "# end: URCap Program Node",
    ]


# Variables that waypoints and popups name, and a feature.
VARIABLES = (
    "global part=1\nglobal Home=p[0, 0, 0, 0, 0, 0]\nglobal a=Home\nglobal b=Home\nglobal Table=Home\n"
)


@pytest.mark.parametrize("sample", SAMPLES.values(), ids=SAMPLES)
def test_a_node_becomes_its_statements(tmp_path, sample):
    text = script_of(tmp_path, sample.file(), CELL if "cell" in sample.words else NEW_BOX)
    head, _, body = text.partition("\n")
    label = "" if '"Robot Program"' in sample.script else '  $ 1 "Robot Program"'
    shown = body[body.index(label) :] if "functions" in sample.words else body
    assert shown == "\n".join(filter(None, (label, sample.script, "end")))
    assert head in ("def sample():", "def P7pick_V12():")
    program = f"{head}\n{VARIABLES}{body}".encode().decode("latin-1")
    compile_program(program, catalogue=catalogue_for("3.15"))


def test_every_kind_of_node_has_a_sample():
    assert set(KINDS) <= set(SAMPLES)


REST = '<Wait type="Sleep"><waitTime>0.1</waitTime></Wait>'


@pytest.fixture
def bench():
    return Bench(fidelity="ideal")


@pytest.fixture
def run(bench, tmp_path):
    def run_nodes(nodes, **options):
        text = script_of(tmp_path, urp(nodes, **options), NEW_BOX).encode().decode("latin-1")
        printed = bench.run(text)
        assert not [one for one in bench.events if isinstance(one, ScriptFailed | ErrorReported)]
        return printed

    return run_nodes


def say(text):
    return script_line(f'textmsg("{text}")')


def taught(bench, name, *step):
    """A waypoint at a step from where the tool is, in its axes."""
    pose, q = pose_trans(bench.now.target_tcp_pose, step or ZERO6), bench.now.target_q
    inside = f'<position joints="{", ".join(map(str, q))}" pose="{", ".join(map(str, pose))}"/>'
    return waypoint(name, f"<motionParameters/>{inside}"), pose


@pytest.mark.parametrize(("value", "said"), [("1", ["through"]), ("2", ["else"])])
def test_a_watched_condition_breaks_its_branch_off(run, value, said):
    watched = branch("If", script_line(f"x={value}") + REST + say("through"), "x≤1", watched=True)
    assert run(assignment("x", "0") + watched + branch("Else", say("else"))) == said


def test_a_watched_condition_breaks_its_loop_off(run):
    inside = script_line("x=x+1") + REST + script_line('textmsg("x", x)')
    loop = (
        f'<Loop type="While" checkContinuously="true">{expression("x≠2")}<children>{inside}</children></Loop>'
    )
    assert run(assignment("x", "0") + loop) == ["x1"]


def test_a_timer_counts_seconds_while_it_is_started(run):
    timer = "".join(
        f'<Timer action="{action}"><variable name="t"/></Timer>{REST}'
        for action in ("Reset", "Start", "Stop")
    )
    (said,) = run(timer + script_line('textmsg("", t)'))
    assert float(said) == pytest.approx(0.1, abs=0.01)


def test_a_popup_that_halts_is_shown_and_ends_the_program(run, bench):
    assert run('<Popup type="Message" haltProgram="true" message="enough"/>' + say("never")) == []
    assert [event.text for event in bench.events if isinstance(event, PopupShown)] == ["enough"]


def test_a_direction_ends_after_its_distance(run, bench):
    before = bench.now.target_tcp_pose
    assert run(move("MoveL", direction(CONTACT + until_distance("0.05", say("arrived"))))) == ["arrived"]
    assert bench.now.target_tcp_pose == pytest.approx((*before[:2], before[2] - 0.05, *before[3:]), abs=1e-6)


def test_a_direction_ends_at_a_contact_and_goes_back(run, bench):
    nodes = move("MoveL", direction(CONTACT) + script_line('textmsg("", get_target_tcp_pose()[2])'))
    (height,) = run(nodes)
    assert 0.0 < float(height) < 0.06  # the tool has met the table and is two centimetres above it
    assert float(height) == pytest.approx(
        min(one.target_tcp_pose[2] for one in bench.snapshots) + 0.02, abs=0.01
    )


def test_lines_and_circles_lead_the_active_tool_to_the_taught_poses(run, bench):
    tool = (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)
    via, _ = taught(bench, "Via", 0.02, 0.02, 0.0, 0.0, 0.0, 0.0)
    end, goal = taught(bench, "End", 0.04, 0.0, 0.0, 0.0, 0.0, 0.0)
    start, _ = taught(bench, "Start")
    circle = f'<CircleMove OrientationMode="UNCONSTRAINED"><children>{via}{end}</children></CircleMove>'
    run(
        script_line(f"set_tcp(p{list(tool)})")
        + move("MoveL", start)
        + move("MoveP", start + circle, 'blendRadius="0.0"')
    )
    assert bench.now.target_tcp_pose == pytest.approx(goal, abs=1e-5)
