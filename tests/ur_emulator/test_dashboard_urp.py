"""Program files of PolyScope that cannot be used, or not yet: what is not known, damaged, not filled in."""

import gzip
import re

import pytest
from dashboard_support import Dashboard, expression, external_control, script_line, urp
from urp_samples import ANGLES, assignment, branch, direction, move, pin, until_distance, waypoint
from urp_support import lines_of, made

from ur_emulator.emulator import ControlBox
from ur_emulator.errors import ProgramFileError, UnknownNodeError
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.loading import load_program


@pytest.mark.parametrize(
    ("nodes", "problem"),
    [
        ("<PalletWizard/>", "a <PalletWizard> node cannot be turned into a script; put the .script that"),
        ('<Contributed strategyURCapName="Gripper"/>', "a node of the URCap 'Gripper' cannot"),
        (move("MoveC", waypoint()), "a move of type 'MoveC' cannot"),
        (move("MoveJ", waypoint(kind="Odd")), "a waypoint of type 'Odd' cannot"),
        (move("MoveL", waypoint(), 'optimoveEnabled="true"'), "a <Move> with OptiMove cannot"),
        (move("MoveJ", waypoint("W", '<motionParameters motionTime="3"/>' + ANGLES)), "motion parameter 'motionTime'"),
        (move("MoveJ", waypoint("W", f"{ANGLES}<children>{until_distance('1')}</children>")), "what is inside of a waypoint cannot"),
        (move("MoveJ", waypoint("W", '<position joints="1,2,3,4,5,6" pose="1e308,0,0,0,0,0"/>')), "waypoint 'W' has a number beyond"),
        (move("MoveL", direction(until_distance("1"), 'selectedDirection="Up"')), "a direction 'Up' cannot"),
        (move("MoveL", direction('<Until type="EXPRESSION"/>')), "an <Until> of type 'EXPRESSION' cannot"),
        ('<Force type="Point"/>', "a <Force> of type 'Point' cannot"),
        ('<Timer action="Jump"><variable name="t"/></Timer>', "a timer's action 'Jump' cannot"),
        (branch("If", "", "1") + branch("ElseIf", "", "2") * 51, "an <If> node has more than 50 branches"),
        (branch("If", "", "1") + branch("Else") * 2, "an Else node stands behind no If"),
        (branch("Maybe"), "an <If> node of type 'Maybe' cannot"),
        (f'<Loop type="Forever"><children/></Loop><If type="ElseIf">{expression("True")}</If>', "an ElseIf node stands"),
        ('<Loop type="Sometimes"/>', "a loop of type 'Sometimes' cannot"),
        ('<Set type="AnalogOutput"/>', "a <Set> of type 'AnalogOutput' cannot"),
        ('<Wait type="Wish"/>', "a <Wait> of type 'Wish' cannot"),
        ('<Wait type="Condition"><expression><Riddle/></expression></Wait>', "<Riddle> in an expression cannot"),
        ('<Popup type="Balloon"/>', "a popup of type 'Balloon' cannot"),
        ('<Popup inputType="Dance"/>', "a popup of 'Dance' cannot"),
        ('<Assignment valueSource="Operator" valueType="Pose"><variable name="a"/></Assignment>', "from 'Operator Pose' cannot"),
        (f'<Assignment><variable reference="../../Nothing[3]"/>{expression("1")}</Assignment>', "'../../Nothing\\[3\\]' of <variable> leads nowhere"),
        (f'<Assignment><variable reference="/etc/passwd"/>{expression("1")}</Assignment>', "leads nowhere"),
        (f'<Assignment><variable reference="../variable"/>{expression("1")}</Assignment>', "lead in a circle"),
        ('<Script type="Poem"/>', "a <Script> of type 'Poem' cannot"),
        ('<Switch><expression><ExpressionChar character="1"/></expression><children><Halt/></children></Switch>', "<Halt> in a <Switch>"),
        ("<Folder><children>" * 60 + "</children></Folder>" * 60, "nested more than 50 deep"),
        (external_control("10.0.0.1", "70000"), "port '70000' of External Control is none"),
    ],
)  # fmt: skip
def test_what_nobody_knows_is_an_error_that_names_it(tmp_path, nodes, problem):
    (tmp_path / "odd.urp").write_bytes(urp(nodes))
    with pytest.raises(ProgramFileError, match=f"^odd.urp: .*{problem}"):
        load_program(ProgramFolder(tmp_path), "odd.urp")


UNDEFINED = [
    (move("MoveJ", waypoint("W", '<position><JointAngles angles="1,2,3"/></position>')), "waypoint 'W' has 3 values, it needs 6"),
    (move("MoveJ", waypoint("W", '<position><JointAngles angles="1,2,3,4,5,nan"/></position>')), "waypoint 'W' is 'nan', a number"),
    (move("MoveJ", waypoint("W", "")), "waypoint 'W' has no position"),
    (move("MoveP", "<CircleMove><children/></CircleMove>"), "a <CircleMove> needs two waypoints"),
    (move("MoveL", direction("")), "a direction needs <Until> nodes"),
    (direction(until_distance("1"), 'selectedDirection="XPlus"'), "stands outside of a <Move> and has no toolParams"),
    ("<SafeHome/>", "time of a <SafeHome> is '', a number"),
    (waypoint(), "a <Waypoint> stands outside of a <Move>"),
    ('<Loop type="Counting" count="many"/>', "count of a <Loop> is 'many', a number is needed"),
    ('<Set type="NoAction"><tcp referencedName="TCP_1"/></Set>', "the installation has no TCP 'TCP_1': it has none"),
    (f'<Set type="DigitalOutput">{pin("valve")}<digitalValue>1</digitalValue></Set>', "the installation has no line 'valve': use"),
    (f'<Set type="DigitalOutput">{pin("digital_in[1]")}<digitalValue>1</digitalValue></Set>', r"line 'DI\[1\]' is an input"),
    (f'<Set type="DigitalOutput">{pin("digital_out[1]")}</Set>', "the level '': it is 0 or 1"),
    ('<Wait type="Sleep"><waitTime>1e999</waitTime></Wait>', "time of a <Wait> is '1e999', a number"),
    (f'<Wait type="AnalogInput">{pin("analog_in[0]")}<analogValue>1</analogValue></Wait>', "compares in an unknown way"),
    ('<Wait type="Condition"><expression/></Wait>', "the expression of a <Wait> node is empty"),
    ('<Assignment valueSource="Operator"/>', "'' of a <Assignment> node is not the name of a variable"),
    (f'<Assignment><variable name="a b"/>{expression("1")}</Assignment>', "'a b' of a <Assignment> node is not the name of a variable"),
    ("<CallSubProgram/>", "names no sub-program"),
    ('<Script type="File"/>', "a <Script> node is empty and names no file"),
    ('<Script type="Line"/>', "a <Script> node has no expression"),
    ('<Script type="File"><file>/programs/gone.script</file></Script>', r"the file of a <Script> node is missing: .*gone\.script"),
    (branch("If"), "the expression of a <If> node is empty"),
    (branch("If", "", "True") + branch("ElseIf"), "the expression of a <If> node is empty"),
    ("<Switch><expression/><children/></Switch>", "the expression of a <Switch> node is empty"),
    (assignment("a", ""), "the expression of a <Assignment> node is empty"),
    ('<Popup inputType="Variable"/>', "'' of a <Popup> node is not the name of a variable"),
    ('<Loop type="Counting"/>', "count of a <Loop> is '', a number"),
    (f'<Switch>{expression("1")}<children><Case/></children></Switch>', "value of a <Case> is '', a number"),
    ('<Timer action="Start"><variable/></Timer>', "'' of a <Timer> node is not the name of a variable"),
    ('<Wait type="DigitalInput"><digitalValue>1</digitalValue></Wait>', "the installation has no line ''"),
    (move("MoveL", waypoint("W", ANGLES, "Relative")), "waypoint 'W' has no position"),
    (move("MoveL", waypoint("W", "", "Variable")), "'' of a <Waypoint> node is not the name of a variable"),
    (move("MoveL", direction(until_distance(""))), "distance of an <Until> is '', a number"),
    (move("MoveL", direction(until_distance("1"), "")), "a <gui.*> node has no expression"),
    ('<Force type="Frame"/>', "selection of a <Force> has 0 values"),
    ('<CallSubProgram><subprogram name="gone"><programFile>gone.urp</programFile></subprogram></CallSubProgram>', r"sub-program 'gone' is missing: .*gone\.urp"),
]  # fmt: skip


@pytest.mark.parametrize(("nodes", "problem"), UNDEFINED)
def test_a_node_that_is_not_filled_in_is_loaded_and_named(tmp_path, nodes, problem):
    (tmp_path / "half.urp").write_bytes(urp(f"<Halt/>{nodes}"))
    program = load_program(ProgramFolder(tmp_path), "half.urp")
    assert re.match(f"half.urp: .*{problem}", program.undefined)
    assert "(label " in program.undefined or "sub-program" in program.undefined
    assert f"{program.undefined.partition(';')[0]}: it is undefined" in program.notes
    assert "\n  halt\n" in program.script(str)


def test_undefined_nodes_count_wherever_they_are(tmp_path):
    empty = script_line("")
    around = f"<Thread name='t'><children>{empty}</children></Thread><Event><expression/><children/></Event>"
    call = f'<CallSubProgram><subprogram name="s"><children>{empty}</children></subprogram></CallSubProgram>'
    nodes = f'<Folder name="F"><children>{empty}{call}</children></Folder>'
    (tmp_path / "half.urp").write_bytes(urp(nodes, around=around))
    program = load_program(ProgramFolder(tmp_path), "half.urp")
    labels = sorted(int(note.partition("(label ")[2].partition(")")[0]) for note in program.notes)
    assert labels == [3, 6, 7, 9]
    assert program.undefined.endswith(", and 3 more")
    suppressed = f'<SuppressedNode><suppressedNode class="Folder"><children>{empty}</children></suppressedNode></SuppressedNode>'
    (tmp_path / "half.urp").write_bytes(urp(suppressed))
    assert load_program(ProgramFolder(tmp_path), "half.urp").undefined == ""


def test_what_holds_no_node_is_defined(tmp_path):
    folder = '<Folder name="F"><children/></Folder>'
    (tmp_path / "p.urp").write_bytes(
        urp(folder + move("MoveL", "") + branch("If", "", "True") + branch("Else"))
    )
    assert load_program(ProgramFolder(tmp_path), "p.urp").undefined == ""


def test_a_program_with_an_undefined_node_is_loaded_and_not_played(tmp_path):
    (tmp_path / "half.urp").write_bytes(urp(script_line("") + move("MoveL", waypoint("Home", ""))))
    (tmp_path / "whole.urp").write_bytes(urp("<Halt/>"))
    box = ControlBox(in_process=True, pace="lockstep", port_base=None, programs=tmp_path)
    with box, Dashboard(box) as dashboard:
        assert dashboard.ask_all("load half.urp", "play", "load whole.urp", "play") == [
            "Loading program: /programs/half.urp", "Failed to execute: play", "Loading program: /programs/whole.urp",
            "Starting program",
        ]  # fmt: skip
        texts = [entry.text for entry in box.log]
    empty = "half.urp: the expression of a <Script> node is empty (label 2)"
    assert f"{empty}: it is undefined" in texts
    assert "half.urp: waypoint 'Home' has no position (label 4): it is undefined" in texts
    assert f"play failed: {empty}, and 1 more; fill it in with PolyScope" in texts


@pytest.mark.parametrize(
    ("nodes", "left", "named"),
    [
        ("<PalletWizard/><Halt/>", ['$ 3 "Halt"', "halt"], ["a <PalletWizard> node"]),
        ('<Contributed strategyURCapName="Gripper"><children><Halt/></children></Contributed>', [], ["URCap 'Gripper'"]),
        (
            '<Folder name="F"><children><Wait type="Wish"/><Odd/></children></Folder>',
            ['$ 2 "F"'],
            ["a <Wait> of type 'Wish'", "an? <Odd> node"],
        ),
        ('<Loop type="While"><expression><Riddle/></expression><children><Halt/></children></Loop>', [], ["<Riddle>"]),
    ],
)  # fmt: skip
def test_what_nobody_knows_can_be_left_out(tmp_path, nodes, left, named):
    with pytest.raises(UnknownNodeError):
        made(tmp_path, urp(nodes))
    assert lines_of(tmp_path, nodes, skip_unknown=True) == left
    told = made(tmp_path, urp(nodes), skip_unknown=True).left_out
    assert len(told) == len(named)
    assert all(re.search(name, text) for name, text in zip(named, told, strict=True))


def test_events_and_first_values_that_nobody_knows_can_be_left_out(tmp_path):
    riddle = "<expression><Riddle/></expression>"
    data = urp(
        "<Halt/>",
        around=f"<Event>{riddle}<children/></Event>",
        first=f'<variables><variable name="a">{riddle}</variable></variables>',
    )
    with pytest.raises(UnknownNodeError, match="<Riddle> in an expression"):
        made(tmp_path, data)
    told = made(tmp_path, data, skip_unknown=True)
    assert len(told.left_out) == 2
    assert told.parts[-1].splitlines() == ['  $ 2 "Robot Program"', '  $ 3 "Halt"', "  halt", "end"]


def test_a_sequence_that_nobody_knows_is_named(tmp_path):
    with pytest.raises(UnknownNodeError, match="a sequence of type 'AfterStop' cannot"):
        made(
            tmp_path, urp("<Halt/>", around='<SpecialSequence type="AfterStop"><children/></SpecialSequence>')
        )


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"", "is not XML that PolyScope has written"),
        (b"\x1f\x8b" + bytes(30), "is damaged"),
        (urp("<Halt/>")[:-20], "is damaged: it ends too early"),
        (gzip.compress(b"<URProgram>"), "is not XML"),
        (gzip.compress(b"<Installation/>"), "is not a program: it is a <Installation>, not a <URProgram>"),
        (gzip.compress(b"<URProgram/>"), "there is no <MainProgram> in it"),
        (urp("<Halt/>", installation="gone"), "needs the installation gone.installation: put it beside"),
    ],
    ids=["empty", "no gzip", "cut off", "half", "installation", "no program", "lost installation"],
)
def test_damaged_files_are_refused_in_one_line(tmp_path, data, problem):
    (tmp_path / "bad.urp").write_bytes(data)
    with pytest.raises(ProgramFileError, match=problem) as told:
        load_program(ProgramFolder(tmp_path), "bad.urp")
    assert "\n" not in str(told.value)


def test_a_sub_program_that_contains_itself_comes_to_an_end(tmp_path):
    call = '<CallSubProgram><subprogram name="again"><programFile>again.urp</programFile></subprogram></CallSubProgram>'
    (tmp_path / "again.urp").write_bytes(urp(call))
    with pytest.raises(ProgramFileError, match="more than 200 sub-programs"):
        load_program(ProgramFolder(tmp_path), "again.urp")
