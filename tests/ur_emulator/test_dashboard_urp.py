"""Program files of PolyScope as scripts: every kind of node, what is not known, what is damaged."""

import gzip
from pathlib import Path

import pytest
from dashboard_support import expression, external_control, script_line, urp

from ur_emulator.errors import FileMissingError, ProgramFileError
from ur_emulator.programs.folder import ProgramFolder
from ur_emulator.programs.installation import ExternalControlPc
from ur_emulator.programs.installation_files import NEW_BOX
from ur_emulator.programs.loading import load_program
from ur_emulator.programs.script_header import header_lines
from ur_emulator.programs.urp_program import NODES
from urscript import compile_program

VARIABLE = '<variable name="part"/>'
ASSIGNMENT = f'<Assignment valueSource="Expression">{VARIABLE}{expression("1 + 2")}</Assignment>'
JOINTS = "0.1, -1.5, 1.2, -1.0, -1.5, 0.0"
ANGLES = f'<position><JointAngles angles="{JOINTS}"/></position>'
BASE = '<feature class="GeomFeatureReference" referencedName="Joint_0_name"/>'


def move(kind, waypoints, attributes=""):
    return f'<Move motionType="{kind}" speed="0.5" acceleration="1.2" {attributes}>{BASE}<children>{waypoints}</children></Move>'


def waypoint(inside=f"<motionParameters/>{ANGLES}", kind="Fixed"):
    return f'<Waypoint type="{kind}" name="Waypoint_1" kinematicsFlags="4">{inside}</Waypoint>'


def pin(name):
    return f'<pin referencedName="{name}"/>'


def script_of(folder, data, name="sample.urp"):
    (folder / name).write_bytes(data)
    text = load_program(ProgramFolder(folder), name).script(lambda pc: "# gap")
    compile_program(text)
    return text


def lines_of(folder, nodes, **options):
    """Return the statements that nodes become, without indentation, labels and comments that fill empty blocks."""
    lines = [line.strip() for line in script_of(folder, urp(nodes, **options)).splitlines()]
    header = [line.strip() for line in header_lines(NEW_BOX)]
    assert (lines[0], lines[-1]) == ("def sample():", "end")
    assert lines[1 : 1 + len(header)] == header
    return [
        line
        for line in lines[1 + len(header) : -1]
        if not line.startswith("$") and line not in ("# nothing", "# sub-program")
    ]


MOVEJ = f"movej([{JOINTS}], a=1.2, v=0.5"
# Kind of node: nodes in a file, the statements that they are.
SAMPLES = {
    "Assignment": (ASSIGNMENT, ["global part = 1 + 2"]),
    "Assignment by reference": (
        f'{ASSIGNMENT}<Assignment><variable reference="../../Assignment/variable"/><expression><ExpressionVariable>'
        '<ProgramVariable reference="../../../../Assignment[1]/variable"/></ExpressionVariable>'
        '<ExpressionToken token=" + "/><ExpressionChar character="1"/></expression></Assignment>',
        ["global part = 1 + 2", "global part = part + 1"],
    ),
    "CallSubProgram": (
        '<CallSubProgram><subprogram name="pick up">'
        '<children><Halt/></children></subprogram></CallSubProgram>'
        '<CallSubProgram><subprogram reference="../../CallSubProgram/subprogram"/></CallSubProgram>',
        ["def pick_up():", "halt", "end", "pick_up()", "pick_up()"],
    ),
    "Comment": ('<Comment comment="the &quot;first&quot;&#10;part"/>', ["# the 'first' part"]),
    "Contributed": (external_control(), ["# gap"]),
    "Folder": (f'<Folder name="Set up"><children>{ASSIGNMENT}</children></Folder>', ["global part = 1 + 2"]),
    "Halt": ("<Halt/>", ["halt"]),
    "If": (
        f'<If type="If" checkContinuously="false">{expression("1 ≟ 2")}<children><Halt/></children></If>',
        ["if (1 == 2):", "halt", "end"],
    ),
    "If with ElseIf and Else": (
        f'<If type="If">{expression("1 ≠ 2")}<children><Halt/></children></If>'
        f'<If type="ElseIf"><expression><ExpressionToken token=" HI "/></expression><children/></If>'
        f'<If type="Else"><expression/><children>{script_line("sync()")}</children></If>',
        ["if (1 != 2):", "halt", "elif (True):", "else:", "sync()", "end"],
    ),
    "If of a line": (
        f'<If type="If"><expression><ExpressionPin>{pin("config_in[3]")}</ExpressionPin>'
        '<ExpressionToken token=" ≟ "/><ExpressionToken token=" LO "/></expression><children/></If>',
        ["if (get_configurable_digital_in(3) == False):", "end"],
    ),
    "Loop": ('<Loop type="Forever"><children><Halt/></children></Loop>', ["while (True):", "halt", "end"]),
    "Loop that counts": (
        '<Loop type="Counting" count="3"><variable name="turn"/><children><Halt/></children></Loop>',
        ["global turn = 0", "while (turn < 3):", "halt", "turn = turn + 1", "end"],
    ),
    "Loop that counts unseen": (
        f'<Assignment><variable name="Loop"/>{expression("0")}</Assignment><Loop type="Counting" count="2"><children/></Loop>',
        ["global Loop = 0", "global Loop_2 = 0", "while (Loop_2 < 2):", "Loop_2 = Loop_2 + 1", "end"],
    ),
    "Loop on a condition": (
        f'<Loop type="While" checkContinuously="">{expression("1 ≤ 2")}<children/></Loop>',
        ["while (1 <= 2):", "end"],
    ),
    "Move": (move("MoveJ", waypoint()), [f"{MOVEJ})"]),
    "Move in a line": (
        move("MoveL", waypoint(f'<motionParameters blendRadius="0.01" cartesianSpeed="0.3" jointSpeed="2"/>{ANGLES}')),
        [f"movel([{JOINTS}], a=1.2, v=0.3, r=0.01)"],
    ),
    "Move of a process": (
        move("MoveP", waypoint(), 'blendRadius="0.02"'),
        [f"movep([{JOINTS}], a=1.2, v=0.5, r=0.02)"],
    ),
    "Move with a tool of its own": (
        move("MoveJ", waypoint(f'<position><JointAngles angles="{JOINTS}"/><TCPOffset pose="0,0,0.1,0,0,0"/></position>'),
             'useActiveTCP="false"'),
        ["set_tcp(p[0.0, 0.0, 0.1, 0.0, 0.0, 0.0])", f"{MOVEJ})"],
    ),
    "Move with other nodes in it": (move("MoveJ", waypoint() + "<Halt/>"), [f"{MOVEJ})", "halt"]),
    "Placeholder": ("<Placeholder/>", []),
    "Popup": (
        '<Popup type="Message" haltProgram="false" message="say &quot;ok&quot;"/>',
        ["popup(\"say 'ok'\", \"Message\", False, False, blocking=True)"],
    ),
    "Popup that halts": (
        '<Popup type="Error" haltProgram="true"><message>no part</message></Popup>',
        ['popup("no part", "Error", False, True, blocking=True)', "halt"],
    ),
    "Script": (script_line('textmsg("a")'), ['textmsg("a")']),
    "Script in the node": (
        '<Script type="File"><cachedContents>x = 1\ntextmsg(x)\n</cachedContents></Script>',
        ["x = 1", "textmsg(x)"],
    ),
    "Script in a lost file": (
        '<Script type="File"><cachedContents>x = 1</cachedContents><file resolves-to="file">/programs/gone.script</file></Script>',
        ["x = 1"],
    ),
    "Set": (
        f'<Set type="DigitalOutput">{pin("digital_out[2]")}<digitalValue>1</digitalValue></Set>',
        ["set_standard_digital_out(2, True)"],
    ),
    "Set by reference": (
        f'<Set type="DigitalOutput">{pin("tool_out[1]")}<digitalValue>0</digitalValue></Set>'
        '<Set type="DigitalOutput"><pin reference="../../Set/pin"/><digitalValue>1</digitalValue></Set>',
        ["set_tool_digital_out(1, False)", "set_tool_digital_out(1, True)"],
    ),
    "Set nothing": ('<Set type="NoAction"/>', []),
    "SuppressedNode": ("<SuppressedNode><PalletWizard/></SuppressedNode>", []),
    "Switch": (
        f'<Switch>{expression("2")}<children><Case caseValue="1"><children><Halt/></children></Case>'
        '<Case caseValue="2"><children/></Case></children></Switch>',
        ["global switch_value = 2", "if (switch_value == 1):", "halt", "elif (switch_value == 2):", "end"],
    ),
    "Wait": ('<Wait type="Sleep"><waitTime>0.22</waitTime></Wait>', ["sleep(0.22)"]),
    "Wait for a line": (
        f'<Wait type="DigitalInput">{pin("digital_in[0]")}<digitalValue>1</digitalValue></Wait>',
        ["while (not (get_standard_digital_in(0) == True)):", "sync()", "end"],
    ),
    "Wait for a level": (
        f'<Wait type="AnalogInput">{pin("analog_in[2]")}<analogComparison>1</analogComparison><analogValue>4.0</analogValue></Wait>',
        ["while (not (get_tool_analog_in(0) > 4.0)):", "sync()", "end"],
    ),
    "Wait for a condition": (
        f'<Wait type="Condition">{expression("1 == 1")}</Wait>',
        ["while (not (1 == 1)):", "sync()", "end"],
    ),
    "Wait for nothing": ('<Wait type="NoWait"/>', []),
    "Waypoint": (
        move("MoveJ", waypoint(f'<motionParameters jointSpeed="1.0"/><position joints="{JOINTS}" pose="0,0,0,0,0,0"/>')),
        [f"movej([{JOINTS}], a=1.2, v=1.0)"],
    ),
    "Waypoint in a variable": (
        f'<Assignment>{VARIABLE}{expression("get_actual_tcp_pose()")}</Assignment>'
        + move("MoveL", waypoint('<motionParameters/><variable reference="../../../../Assignment/variable"/>', "Variable")),
        ["global part = get_actual_tcp_pose()", "movel(part, a=1.2, v=0.5)"],
    ),
    "suppressedNode": ("<suppressedNode><children><PalletWizard/></children></suppressedNode>", []),
}  # fmt: skip


def test_every_kind_of_node_has_a_sample():
    assert set(NODES) <= set(SAMPLES)


def test_the_page_names_every_kind_of_node():
    page = (Path(__file__).parents[2] / "docs" / "programs.md").read_text()
    assert [kind for kind in NODES if f"`{kind}`" not in page] == []


@pytest.mark.parametrize(("nodes", "expected"), SAMPLES.values(), ids=SAMPLES)
def test_a_node_becomes_its_statements(tmp_path, nodes, expected):
    assert lines_of(tmp_path, nodes) == expected


def test_the_program_has_the_form_that_polyscope_gives_it(tmp_path):
    around = (
        '<SpecialSequence type="BeforeStart"><children><Assignment><variable name="count"><initializeExpression>'
        f'<ExpressionChar character="7"/></initializeExpression></variable>{expression("count + 1")}</Assignment>'
        '</children></SpecialSequence><Thread name="Watch"><children><Wait type="Sleep"><waitTime>1</waitTime></Wait>'
        "</children></Thread>"
    )
    assert script_of(tmp_path, urp("<Halt/>", once=False, around=around)).splitlines() == [
        "def sample():",
        *(f"  {line}" for line in header_lines(NEW_BOX)),
        "  global count = 7",
        "  thread Watch():",
        "    # nothing",
        "    while (True):",
        "      # nothing",
        '      $ 1 "Wait"',
        "      sleep(1.0)",
        "    end",
        "  end",
        '  $ 2 "count=count + 1"',
        "  global count = count + 1",
        "  run Watch()",
        "  while (True):",
        '    $ 3 "Robot Program"',
        '    $ 4 "Halt"',
        "    halt",
        "  end",
        "end",
    ]


def test_sub_programs_in_files_of_their_own(tmp_path):
    (tmp_path / "cell").mkdir()
    (tmp_path / "cell" / "grip.urp").write_bytes(urp(script_line('textmsg("grip")')))
    call = (
        '<CallSubProgram><subprogram name="grip" keepHidden="true"><programFile resolves-to="file">../programs/grip.urp'
        "</programFile><children></children></subprogram></CallSubProgram>"
    )
    (tmp_path / "cell" / "main.urp").write_bytes(urp(call))
    text = load_program(ProgramFolder(tmp_path), "cell/main.urp").script(lambda pc: "")
    assert 'def grip():\n    # sub-program\n    $ 3 "Script"\n    textmsg("grip")\n  end' in text


def test_the_script_that_polyscope_saved_beside_it_is_taken(tmp_path):
    (tmp_path / "p.script").write_text('def p():\n  textmsg("saved")\nend\n')
    (tmp_path / "p.urp").write_bytes(urp("<PalletWizard/>"))
    program = load_program(ProgramFolder(tmp_path), "p.urp")
    assert program.script(lambda pc: "") == 'def p():\n  textmsg("saved")\nend\n'
    # What a PC sends is not in a saved script, so that of External Control is made from the nodes.
    (tmp_path / "p.urp").write_bytes(urp(external_control()))
    program = load_program(ProgramFolder(tmp_path), "p.urp")
    assert program.pcs == (ExternalControlPc(),)
    assert "sent" in program.script(lambda pc: "# sent")


def test_a_script_file_of_a_node_is_read_where_it_lies(tmp_path):
    node = (
        '<Script type="File"><cachedContents>old()</cachedContents><file resolves-to="file">/ursim/programs/f.script'
        "</file></Script>"
    )
    (tmp_path / "f.script").write_text('textmsg("new")\n')
    assert 'textmsg("new")' in script_of(tmp_path, urp(node))


def test_text_goes_out_as_it_stands_in_the_file(tmp_path):
    text = script_of(tmp_path, urp(script_line('textmsg("größe Ω")')))
    assert 'textmsg("größe Ω")'.encode() in text.encode("latin-1")


def test_a_file_without_compression_is_read_too(tmp_path):
    assert "halt" in script_of(tmp_path, urp("<Halt/>", packed=False))


@pytest.mark.parametrize(
    ("nodes", "problem"),
    [
        ("<PalletWizard/>", "a <PalletWizard> node cannot be turned into a script; put the .script that"),
        ('<Contributed strategyURCapName="Gripper"/>', "a node of the URCap 'Gripper' cannot"),
        (move("MoveC", waypoint()), "a move of type 'MoveC' cannot"),
        (move("MoveJ", waypoint(kind="Relative")), "a waypoint of type 'Relative' cannot"),
        (move("MoveJ", waypoint('<motionParameters motionTime="3"/>' + ANGLES)), "motion parameter 'motionTime'"),
        (move("MoveJ", waypoint('<position><JointAngles angles="1,2,3"/></position>')), "a waypoint has 3 values, it needs 6"),
        (move("MoveJ", waypoint('<position><JointAngles angles="1,2,3,4,5,nan"/></position>')), "a waypoint is 'nan', a number"),
        (move("MoveJ", waypoint("")), "a waypoint has 1 values"),
        (waypoint(), "a <Waypoint> stands outside of a <Move>"),
        (f'<If type="If" checkContinuously="true">{expression("True")}</If>', "a <If> that is checked continuously"),
        ('<If type="Else"><children/></If>', "an Else node stands behind no If"),
        (f'<Loop type="Forever"><children/></Loop><If type="ElseIf">{expression("True")}</If>', "an ElseIf node stands"),
        ('<Loop type="Sometimes"/>', "a loop of type 'Sometimes' cannot"),
        ('<Loop type="Counting" count="many"/>', "count of a <Loop> is 'many', a number is needed"),
        ('<Set type="AnalogOutput"/>', "a <Set> of type 'AnalogOutput' cannot"),
        ('<Set type="NoAction"><tcp referencedName="TCP_1"/></Set>', "a <Set> of type 'NoAction' cannot"),
        (f'<Set type="DigitalOutput">{pin("valve")}<digitalValue>1</digitalValue></Set>', "line 'valve' has a name of"),
        (f'<Set type="DigitalOutput">{pin("digital_in[1]")}<digitalValue>1</digitalValue></Set>', r"line digital_in\[...\] cannot"),
        (f'<Set type="DigitalOutput">{pin("digital_out[1]")}</Set>', "the level '': it is 0 or 1"),
        ('<Wait type="Sleep"><waitTime>1e999</waitTime></Wait>', "time of a <Wait> is '1e999', a number"),
        ('<Wait type="Wish"/>', "a <Wait> of type 'Wish' cannot"),
        (f'<Wait type="AnalogInput">{pin("analog_in[0]")}<analogValue>1</analogValue></Wait>', "compares in an unknown way"),
        ('<Wait type="Condition"/>', "a <Wait> node has no expression"),
        ('<Wait type="Condition"><expression/></Wait>', "the expression of a <Wait> node is empty"),
        ('<Wait type="Condition"><expression><Riddle/></expression></Wait>', "<Riddle> in an expression cannot"),
        ('<Popup type="Balloon"/>', "a popup of type 'Balloon' cannot"),
        ('<Assignment valueSource="Operator"/>', "an assignment from 'Operator' cannot"),
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
    ("data", "problem"),
    [
        (b"", "is not XML that PolyScope has written"),
        (b"\x1f\x8b" + bytes(30), "is damaged"),
        (urp("<Halt/>")[:-20], "is damaged: it ends too early"),
        (gzip.compress(b"<URProgram>"), "is not XML"),
        (gzip.compress(b"<Installation/>"), "is not a program: it is a <Installation>, not a <URProgram>"),
        (gzip.compress(b"<URProgram/>"), "there is no <MainProgram> in it"),
        (gzip.compress(bytes(40 << 20)), "has more than 16777216 bytes unpacked"),
        (
            gzip.compress(b'<!DOCTYPE x [<!ENTITY a "aaaa">]><URProgram>&a;</URProgram>'),
            "a document type is declared",
        ),
        (urp("<Halt/>", installation="gone"), "needs the installation gone.installation: put it beside"),
    ],
    ids=[
        "empty",
        "no gzip",
        "cut off",
        "half",
        "installation",
        "no program",
        "bomb",
        "doctype",
        "lost installation",
    ],
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
