"""Program files as scripts: each node alone, whole programs, and what the scripts do on a controller."""

from dataclasses import replace

import pytest
from box_support import Bench
from dashboard_support import expression, script_line, urp
from hypothesis import given
from hypothesis import strategies as st
from urp_samples import (
    BASE,
    CONTACT,
    HALT,
    JOINTS,
    POSE_TEXT,
    POSITION,
    SAMPLES,
    TOOL,
    assignment,
    branch,
    direction,
    move,
    pin,
    until_distance,
    variable_waypoint,
    waypoint,
)
from urp_support import NEW_BOX, lines_of, script_of, undefined_in

from protocol.pose import pose_inv, pose_trans
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
from ur_emulator.program_files.script_writer import identifier, is_identifier
from ur_emulator.program_files.urp_expressions import pose_text
from ur_emulator.program_files.urp_program import KINDS
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


def compiles(text, *variables):
    """Whether a script compiles for software 3.15, with variables that the installation would declare."""
    head, _, rest = text.partition("\n")
    declared = "".join(f"global {name}=p[0, 0, 0, 0, 0, 0]\n" for name in variables)
    compile_program(f"{head}\n{declared}{rest}".encode().decode("latin-1"), catalogue=catalogue_for("3.15"))
    return True


# --- order and numbers


def test_all_parts_stand_in_the_order_of_polyscope(tmp_path):
    first = f'<variables><variable name="count">{expression("7")}</variable><variable name="kept"><expression/></variable></variables>'
    call = f'<CallSubProgram><subprogram name="pick"><children>{move("MoveL", waypoint("Part", FIXED), CARTESIAN)}</children></subprogram></CallSubProgram>'
    around = (
        f'<SpecialSequence type="BeforeStart"><children>{assignment("count", "1")}</children></SpecialSequence>'
        '<Thread name="Watch" runOnlyOnce="false"><children><Wait type="Sleep"><waitTime>1.0</waitTime></Wait></children></Thread>'
        f'<SuppressedNode><suppressedNode class="Thread"><children>{HALT}</children></suppressedNode></SuppressedNode>'
        f'<Thread name="Once" runOnlyOnce="true"><children>{HALT}</children></Thread>'
        f"<Event>{expression('count≟2')}<children>{HALT}</children></Event><Event>{expression('count≟3')}<children/></Event>"
        '<SubProgram reference="../MainProgram/children/CallSubProgram/subprogram"/>'
    )
    nodes = '<Timer action="Start"><variable name="t"/></Timer>' + call
    nodes += move("MoveJ", waypoint("Home", FIXED), CARTESIAN)
    text = script_of(
        tmp_path, urp(nodes, once=False, around=around, first=first, saved_in=NEW, name="7pick V1.2"),
    )  # fmt: skip
    pose = pose_text(ArmModel(UR5).fk(Q, OFFSET))
    assert text.splitlines() == [
        "def P7pick_V12():",
        "  global t=0",
        "  global count=7",
        f"  global Home_p={pose}",
        f"  global Home_q=[{JOINTS}]",
        f"  global Part_p={pose}",
        f"  global Part_q=[{JOINTS}]",
        "  global t_is_counting=False",
        "  thread Timer_Thread():",
        "    while (True):",
        "      if (t_is_counting):",
        "        t = t + get_steptime()",
        "      end",
        "      sync()",
        "    end",
        "  end",
        "  run Timer_Thread()",
        "  def pick():",
        '    $ 18 "pick" "noBreak"',
        '    $ 19 "MoveL"',
        '    $ 20 "Part" "breakAfter"',
        "    movel(Part_p, a=1.2, v=0.25)",
        "  end",
        '  $ 2 "BeforeStart"',
        '  $ 3 "count≔1"',
        "  global count=1",
        '  $ 9 "Watch"',
        "  thread Watch():",
        "    while (True):",
        '      $ 10 "Wait: 1.0"',
        "      sleep(1.0)",
        "    end",
        "  end",
        "  threadId_Watch = run Watch()",
        '  $ 13 "Once"',
        "  thread Once():",
        '    $ 14 "Halt"',
        "    halt",
        "  end",
        "  threadId_Once = run Once()",
        "  thread EventThread():",
        "    while (True):",
        "      if (count == 2):",
        '        $ 16 "Halt"',
        "        halt",
        "      elif (count == 3):",
        "      end",
        "      sync()",
        "    end",
        "  end",
        "  eventThread = run EventThread()",
        "  while (True):",
        '    $ 4 "Robot Program"',
        '    $ 5 "t: Start"',
        "    t_is_counting = True",
        '    $ 6 "Call pick"',
        "    pick()",
        '    $ 7 "MoveJ"',
        '    $ 8 "Home" "breakAfter"',
        "    movej(get_inverse_kin(Home_p, qnear=Home_q), a=1.2, v=0.25)",
        "  end",
        "end",
    ]
    assert compiles(text)


@pytest.mark.parametrize(
    ("top", "numbers"),
    [
        ("", [1, 2]),
        ("<InitVariablesNode/>", [2, 3]),
        ("<InitVariablesNode><children/></InitVariablesNode>", [2, 3]),
        (
            '<InitVariablesNode><variables><variable name="n"><expression/></variable></variables></InitVariablesNode>',
            [2, 3],
        ),
    ],
    ids=["none", "empty", "without variables", "without values"],
)
def test_the_node_of_first_values_has_a_number_if_it_is_there(tmp_path, top, numbers):
    data = urp(HALT, packed=False).replace(b"<children><MainProgram", f"<children>{top}<MainProgram".encode())
    labels = [line for line in script_of(tmp_path, data).splitlines() if "$" in line]
    assert labels == [f'  $ {numbers[0]} "Robot Program"', f'  $ {numbers[1]} "Halt"']


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


def test_a_suppressed_node_can_hold_what_others_refer_to(tmp_path):
    nodes = (
        '<SuppressedNode><suppressedNode class="CallSubProgram"><subprogram name="pick"><children><Halt/></children></subprogram>'
        '</suppressedNode></SuppressedNode><CallSubProgram><subprogram reference="../../SuppressedNode/suppressedNode/subprogram"/>'
        '</CallSubProgram><SuppressedNode><suppressedNode class="Assignment"><variable name="part"/></suppressedNode></SuppressedNode>'
        '<Popup type="Message" inputType="Variable"><variable reference="../../SuppressedNode[2]/suppressedNode/variable"/></Popup>'
        '<If reference="../Folder/If"/><Folder name="F"><children/><If type="If"><expression>'
        '<ExpressionChar character="1"/></expression><children><Halt/></children></If></Folder>'
    )
    text = script_of(tmp_path, urp(nodes))
    assert text.splitlines() == [
        "def sample():",
        "  def pick():",
        '    $ 9 "pick" "noBreak"',
        '    $ 10 "Halt"',
        "    halt",
        "  end",
        '  $ 1 "Robot Program"',
        '  $ 3 "Call pick"',
        "  pick()",
        '  $ 5 "Popup"',
        '  popup(str_cat("",part), "Message", False, False, blocking=True)',
        '  $ 6 "If 1"',
        "  if (1):",
        '    $ 7 "Halt"',
        "    halt",
        "  end",
        '  $ 8 "F"',
        "end",
    ]


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


def test_a_file_without_compression_is_read_too(tmp_path):
    assert lines_of(tmp_path, HALT, packed=False) == ['$ 2 "Halt"', "halt"]


# --- positions of e-Series software


def test_a_taught_pose_is_that_of_the_angles_and_the_tool(tmp_path):
    lines = script_of(
        tmp_path, urp(move("MoveL", waypoint("W", FIXED), CARTESIAN), saved_in=NEW)
    ).splitlines()
    assert lines[1].startswith("  global W_p=p[")
    found = [float(one) for one in lines[1].partition("[")[2].rstrip("]").split(",")]
    assert found == pytest.approx(ArmModel(UR5).fk(Q, OFFSET), abs=1e-11)
    assert lines[2] == f"  global W_q=[{JOINTS}]"


@pytest.mark.parametrize(
    ("kind", "attributes", "statement"),
    [
        ("MoveJ", CARTESIAN, "movej(get_inverse_kin(W_p, qnear=W_q), a=1.2, v=0.25)"),
        ("MoveJ", 'positionType="JointAngles"', "movej(W_q, a=1.2, v=0.25)"),
        ("MoveL", CARTESIAN, "movel(W_p, a=1.2, v=0.25)"),
        ("MoveP", f'{CARTESIAN} blendRadius="0.025"', "movep(W_p, a=1.2, v=0.25, r=0.0)"),
    ],
)
def test_waypoints_of_e_series_software(tmp_path, kind, attributes, statement):
    assert lines_of(tmp_path, move(kind, waypoint("W", FIXED), attributes), saved_in=NEW)[-1] == statement


def test_a_waypoint_is_declared_once_in_the_order_of_use(tmp_path):
    nodes = move("MoveL", "".join(waypoint(name, FIXED) for name in ("B", "A", "B")), CARTESIAN)
    nodes += (
        '<Assignment><variable name="x"/><expression><ExpressionWaypoint><Waypoint referenceName="A" '
        'reference="../../../../Move/children/Waypoint[2]"/></ExpressionWaypoint></expression></Assignment>'
    )
    text = script_of(tmp_path, urp(nodes, saved_in=NEW))
    assert [line.split("=")[0] for line in text.splitlines() if "_p=" in line or "_q=" in line] == [
        "  global B_p",
        "  global B_q",
        "  global A_p",
        "  global A_q",
    ]
    assert text.splitlines()[-3:-1] == ['  $ 6 "x≔A"', "  global x=A_p"]
    assert compiles(text)


def test_relative_waypoints_are_steps_of_the_tool(tmp_path):
    inside = f"<motionParameters/><relativeFromPosition>{TAUGHT}</relativeFromPosition><position>{TAUGHT}</position>"
    text = script_of(tmp_path, urp(move("MoveL", waypoint("W", inside, "Relative"), CARTESIAN), saved_in=NEW))
    pose = pose_text(ArmModel(UR5).fk(Q, OFFSET))
    assert text.splitlines()[1:] == [
        f"  global W_from_p={pose}",
        f"  global W_to_p={pose}",
        '  $ 1 "Robot Program"',
        '  $ 2 "MoveL"',
        '  $ 3 "W" "breakAfter"',
        "  movel(pose_add(get_target_tcp_pose(), pose_sub(W_to_p, W_from_p)), a=1.2, v=0.25)",
        "end",
    ]


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


def test_software_up_to_3_6_has_waypoints_outside_of_moves(tmp_path):
    data = urp(waypoint(), packed=False).decode()
    main = '<MainProgram motionType="MoveL" speed="0.3" acceleration="1.0" useActiveTCP="true" runOnlyOnce='
    text = script_of(tmp_path, data.replace("<MainProgram runOnlyOnce=", main).encode())
    assert text.splitlines()[-2] == f"  movel({POSE_TEXT}, a=1.0, v=0.3)"


# --- what the installation gives


def test_a_pose_moves_with_a_feature_that_is_a_variable(tmp_path):
    base = (0.1, 0.2, 0.0, 0.0, 0.0, 1.5)
    inverse = pose_text(pose_inv(base))
    taught = FIXED + f'<BaseToFeature pose="{", ".join(map(str, base))}"/>'
    for name, kind, statement in (
        ("Table", "MoveL", f"movel(pose_trans(Table, pose_trans({inverse}, W_p)), a=1.2, v=0.25)"),
        ("Table", "MoveJ", f"movej(get_inverse_kin(pose_trans(Table, pose_trans({inverse}, W_p)), qnear=W_q), a=1.2, v=0.25)"),
        ("Wall", "MoveL", "movel(W_p, a=1.2, v=0.25)"),
    ):  # fmt: skip
        nodes = move(kind, waypoint("W", taught), CARTESIAN, feature(name))
        assert lines_of(tmp_path, nodes, CELL, saved_in=NEW)[-1] == statement
    nodes = move("MoveL", variable_waypoint("part"), CARTESIAN, feature("Table"))
    assert lines_of(tmp_path, nodes, CELL)[-1] == "movel(pose_trans(Table, part), a=1.2, v=0.25)"


def test_a_pose_of_cb3_software_is_kept_in_its_feature(tmp_path):
    inside = (
        "<motionParameters/>"
        + POSITION.removesuffix("/>")
        + '><poseInFeatureCoordinates pose="0.5, 0, 0, 0, 0, 0"/></position>'
    )
    lines = lines_of(tmp_path, move("MoveL", waypoint("W", inside), feature=feature("Table")), CELL)
    half = ", ".join([".500000000000", *[".000000000000"] * 5])
    assert lines[-1] == f"movel(pose_trans(Table, p[{half}]), a=1.2, v=0.25)"
    unknown = undefined_in(tmp_path, move("MoveL", waypoint(), feature=feature("Table")), CELL)
    assert "the pose of waypoint 'W' in feature 'Table' is not known" in unknown


def test_features_are_targets_frames_and_values(tmp_path):
    target = (
        '<Waypoint type="Variable" name="W"><motionParameters/><variable featureName="Table"/></Waypoint>'
    )
    assert lines_of(tmp_path, move("MoveL", target), CELL)[-2:] == [
        '$ 3 "Table" "breakAfter"',
        "movel(Table, a=1.2, v=0.25)",
    ]
    value = '<Assignment><variable name="x"/><expression><ExpressionVariable><GeomFeatureVariable featureName="Table"/></ExpressionVariable></expression></Assignment>'
    assert lines_of(tmp_path, value, CELL) == ['$ 2 "x≔Table"', "global x=Table"]
    for name, label, frame in (
        ("Table", "Table X-", "Table"),
        ("Wall", "Wall X-", pose_text((0.5, 0.0, 0.0, 0.0, 0.0, 0.0))),
    ):
        nodes = move(
            "MoveL",
            direction(until_distance("0.1"), 'selectedDirection="XMinus"', feature(name)),
            feature=BASE,
        )
        lines = lines_of(tmp_path, nodes, CELL)
        assert lines[1] == f'$ 3 "Direction: {label}"'
        assert f"calculate_point_to_move_towards({frame}, [-1.0, 0.0, 0.0], 0.1)" in lines[6]
    gone = undefined_in(tmp_path, move("MoveL", direction(CONTACT, inside=feature("Gone"))), CELL)
    assert "the installation has no feature 'Gone'" in gone


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


def test_a_contact_without_a_distance_is_looked_for_far_away(tmp_path):
    nodes = move("MoveL", direction(CONTACT, 'selectedDirection="ZPlus"', TOOL))
    lines = lines_of(tmp_path, nodes)
    assert lines[1] == '$ 3 "Direction: Tool Z+"'
    assert "towards(get_forward_kin(), [0.0, 0.0, 1.0], 1000.0)" in lines[6]


def test_tools_have_the_names_of_the_installation(tmp_path):
    statement = f"set_tcp(p[{TOOL_POSE}])"
    named = '<Set type="NoAction"><tcp referencedName="Gripper"/></Set>'
    assert lines_of(tmp_path, named, CELL) == ['$ 2 "Set"', statement]
    nodes = move("MoveL", variable_waypoint("a"), 'useActiveTCP="false"', '<tcp referencedName="Gripper"/>')
    assert lines_of(tmp_path, nodes, CELL)[:2] == ['$ 2 "MoveL"', statement]
    assert "has no TCP 'Hook': it has Gripper" in undefined_in(
        tmp_path, named.replace("Gripper", "Hook"), CELL
    )


def test_lines_have_the_names_of_the_installation(tmp_path):
    nodes = (
        f'<Set type="DigitalOutput">{pin("pump")}<digitalValue>1</digitalValue></Set>'
        f'<Wait type="DigitalInput">{pin("part there")}<digitalValue>1</digitalValue></Wait>'
        f'<If type="If"><expression><ExpressionIO>{pin("gate")}</ExpressionIO></expression><children/></If>'
    )
    assert lines_of(tmp_path, nodes, CELL) == [
        '$ 2 "Set pump=On"',
        "set_standard_digital_out(2, True)",
        '$ 3 "Wait part there=HI"',
        "while (get_tool_digital_in(0) == False):",
        "sync()",
        "end",
        '$ 4 "If gate"',
        'if (modbus_get_signal_status("gate")):',
        "end",
    ]


def test_safe_home_is_a_position_of_the_installation(tmp_path):
    node = '<SafeHome positionOptionType="{}" speed="1.0" acceleration="1.4" nextMotionTime="2.0"/>'
    assert lines_of(tmp_path, node.format("SPEED_AND_ACCELERATION"), CELL) == [
        '$ 2 "Home"',
        f"movej([{JOINTS}], a=1.4, v=1.0)",
    ]
    assert lines_of(tmp_path, node.format("TIME"), CELL)[-1] == f"movej([{JOINTS}], t=2.0)"
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


LABEL = '  $ 1 "Robot Program"'
# Variables that waypoints and popups name.
VARIABLES = "global part=1\nglobal Home=p[0, 0, 0, 0, 0, 0]\nglobal a=Home\nglobal b=Home\n"


@pytest.mark.parametrize(("nodes", "expected"), SAMPLES.values(), ids=SAMPLES)
def test_a_node_becomes_its_statements(tmp_path, nodes, expected):
    text = script_of(tmp_path, urp(nodes))
    if LABEL not in expected:
        expected = LABEL + expected
    assert text == "\n".join(("def sample():", expected.strip("\n"), "end"))
    program = text.replace("def sample():\n", f"def sample():\n{VARIABLES}").encode().decode("latin-1")
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


@pytest.mark.parametrize(("value", "said"), [("1", "one"), ("2", "two"), ("3", "default")])
def test_the_default_case_runs_when_no_other_one_does(run, value, said):
    cases = "".join(
        f'<Case caseValue="{number}"><children>{say(text)}</children></Case>'
        for number, text in (("1", "one"), ("2147483647", "default"), ("2", "two"))
    )
    assert run(f"<Switch>{expression(value)}<children>{cases}</children></Switch>") == [said]


def test_a_loop_counts_with_its_variable(run):
    loop = '<Loop type="Counting" count="3"><loopVariable name="Loop_1"/><children>{}</children></Loop>'
    assert run(loop.format(script_line('textmsg("turn ", Loop_1)'))) == ["turn 0", "turn 1", "turn 2"]


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


def test_threads_run_after_the_statements_before_the_start(run):
    around = (
        f'<SpecialSequence type="BeforeStart"><children>{assignment("n", "1")}{REST}{say("before")}</children></SpecialSequence>'
        f'<Thread name="Watch" runOnlyOnce="true"><children>{say("thread")}</children></Thread>'
    )
    assert run(REST + say("main"), around=around) == ["before", "thread", "main"]


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
