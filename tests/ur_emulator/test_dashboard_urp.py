"""Program files of PolyScope that cannot be used: what is not known, what is damaged."""

import gzip
import re

import pytest
from dashboard_support import expression, external_control, urp
from urp_samples import ANGLES, branch, direction, move, pin, until_distance, waypoint
from urp_support import lines_of, made

from ur_emulator.errors import FileMissingError, ProgramFileError, UnknownNodeError
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
        (move("MoveJ", waypoint("W", '<position><JointAngles angles="1,2,3"/></position>')), "waypoint 'W' has 3 values, it needs 6"),
        (move("MoveJ", waypoint("W", '<position><JointAngles angles="1,2,3,4,5,nan"/></position>')), "waypoint 'W' is 'nan', a number"),
        (move("MoveJ", waypoint("W", "")), "waypoint 'W' has no position"),
        (move("MoveJ", waypoint("W", f"{ANGLES}<children>{until_distance('1')}</children>")), "what is inside of a waypoint cannot"),
        (move("MoveJ", waypoint("W", '<position joints="1,2,3,4,5,6" pose="1e308,0,0,0,0,0"/>')), "waypoint 'W' has a number beyond"),
        (move("MoveJ", waypoint("W", "<position/>")), "waypoint 'W' has 0 values"),
        (move("MoveP", "<CircleMove><children/></CircleMove>"), "a <CircleMove> needs two waypoints"),
        (move("MoveL", direction("")), "a direction needs <Until> nodes"),
        (move("MoveL", direction(until_distance("1"), 'selectedDirection="Up"')), "a direction 'Up' cannot"),
        (move("MoveL", direction('<Until type="EXPRESSION"/>')), "an <Until> of type 'EXPRESSION' cannot"),
        (direction(until_distance("1"), 'selectedDirection="XPlus"'), "stands outside of a <Move> and has no toolParams"),
        ('<Force type="Point"/>', "a <Force> of type 'Point' cannot"),
        ("<SafeHome/>", "time of a <SafeHome> is '', a number"),
        ('<Timer action="Jump"><variable name="t"/></Timer>', "a timer's action 'Jump' cannot"),
        (branch("If", "", "1") + branch("ElseIf", "", "2") * 51, "an <If> node has more than 50 branches"),
        (branch("If", "", "1") + branch("Else") * 2, "an Else node stands behind no If"),
        (branch("Maybe"), "an <If> node of type 'Maybe' cannot"),
        (waypoint(), "a <Waypoint> stands outside of a <Move>"),
        ('<If type="Else"><children/></If>', "an Else node stands behind no If"),
        (f'<Loop type="Forever"><children/></Loop><If type="ElseIf">{expression("True")}</If>', "an ElseIf node stands"),
        ('<Loop type="Sometimes"/>', "a loop of type 'Sometimes' cannot"),
        ('<Loop type="Counting" count="many"/>', "count of a <Loop> is 'many', a number is needed"),
        ('<Set type="AnalogOutput"/>', "a <Set> of type 'AnalogOutput' cannot"),
        ('<Set type="NoAction"><tcp referencedName="TCP_1"/></Set>', "the installation has no TCP 'TCP_1': it has none"),
        (f'<Set type="DigitalOutput">{pin("valve")}<digitalValue>1</digitalValue></Set>', "the installation has no line 'valve': use"),
        (f'<Set type="DigitalOutput">{pin("digital_in[1]")}<digitalValue>1</digitalValue></Set>', r"line 'DI\[1\]' is an input"),
        (f'<Set type="DigitalOutput">{pin("digital_out[1]")}</Set>', "the level '': it is 0 or 1"),
        ('<Wait type="Sleep"><waitTime>1e999</waitTime></Wait>', "time of a <Wait> is '1e999', a number"),
        ('<Wait type="Wish"/>', "a <Wait> of type 'Wish' cannot"),
        (f'<Wait type="AnalogInput">{pin("analog_in[0]")}<analogValue>1</analogValue></Wait>', "compares in an unknown way"),
        ('<Wait type="Condition"/>', "a <Wait> node has no expression"),
        ('<Wait type="Condition"><expression/></Wait>', "the expression of a <Wait> node is empty"),
        ('<Wait type="Condition"><expression><Riddle/></expression></Wait>', "<Riddle> in an expression cannot"),
        ('<Popup type="Balloon"/>', "a popup of type 'Balloon' cannot"),
        ('<Popup inputType="Dance"/>', "a popup of 'Dance' cannot"),
        ('<Assignment valueSource="Operator"/>', "'' is not the name of a variable"),
        ('<Assignment valueSource="Operator" valueType="Pose"><variable name="a"/></Assignment>', "from 'Operator Pose' cannot"),
        (f'<Assignment><variable name="a b"/>{expression("1")}</Assignment>', "'a b' is not the name of a variable"),
        (f'<Assignment><variable reference="../../Nothing[3]"/>{expression("1")}</Assignment>', "'../../Nothing\\[3\\]' of <variable> leads nowhere"),
        (f'<Assignment><variable reference="/etc/passwd"/>{expression("1")}</Assignment>', "leads nowhere"),
        (f'<Assignment><variable reference="../variable"/>{expression("1")}</Assignment>', "lead in a circle"),
        ("<CallSubProgram/>", "names no sub-program"),
        ('<Script type="Poem"/>', "a <Script> of type 'Poem' cannot"),
        ('<Script type="File"/>', "a <Script> node is empty and names no file"),
        ('<Switch><expression><ExpressionChar character="1"/></expression><children><Halt/></children></Switch>', "<Halt> in a <Switch>"),
        ("<Folder><children>" * 60 + "</children></Folder>" * 60, "nested more than 50 deep"),
        (external_control("10.0.0.1", "70000"), "port '70000' of External Control is none"),
    ],
)  # fmt: skip
def test_what_nobody_knows_is_an_error_that_names_it(tmp_path, nodes, problem):
    (tmp_path / "odd.urp").write_bytes(urp(nodes))
    with pytest.raises(ProgramFileError, match=f"^odd.urp: .*{problem}"):
        load_program(ProgramFolder(tmp_path), "odd.urp")


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


def test_a_lost_script_file_is_named(tmp_path):
    (tmp_path / "p.urp").write_bytes(urp('<Script type="File"><file>/programs/gone.script</file></Script>'))
    with pytest.raises(FileMissingError, match=r"gone\.script"):
        load_program(ProgramFolder(tmp_path), "p.urp")
