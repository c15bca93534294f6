"""The script that PolyScope saves beside a program: when it is used, and what the log says of it."""

import pytest
from dashboard_support import Dashboard, external_control, script_line, urp

from ur_emulator.emulator import ControlBox
from ur_emulator.errors import ProgramFileError
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.loading import load_program

GRIPPER = '<Contributed strategyURCapName="Gripper"/>'
KNOWN, UNKNOWN = urp(script_line('textmsg("nodes")')), urp(GRIPPER + script_line('textmsg("nodes")'))


def twin(*header, statement='textmsg("saved")'):
    """A script as PolyScope saves it."""
    lines = [*header, '$ 1 "Robot Program"', '$ 2 "Script"', statement]
    return "def unnamed():\n" + "".join(f"  {line}\n" for line in lines) + "end\n"


def load(folder, program, saved=None, **options):
    (folder / "p.urp").write_bytes(program)
    if saved is not None:
        (folder / "p.script").write_text(saved)
    return load_program(ProgramFolder(folder), "p.urp", **options)


def script_of(program):
    return program.script(lambda pc: "# gap")


def test_the_nodes_come_first(tmp_path):
    program = load(tmp_path, KNOWN, twin())
    assert 'textmsg("nodes")' in script_of(program)
    assert (program.notes, program.origin) == ((), "")


@pytest.mark.parametrize(
    ("header", "software"),
    [
        (["set_tool_voltage(0)", "set_payload(0.0)"], "3.x"),
        (["set_tool_communication(False, 115200, 0, 1, 1.5, 3.5)", "set_tool_voltage(0)"], "5.x"),
        (["set_tool_communication(False, 115200, 0, 1, 1.5, 3.5)", "set_target_payload(0, [0, 0, 0])"], "5.10 or later"),
        (["global _hidden_verificationVariable=0", "set_target_payload(0, [0, 0, 0])"], "5.12 or later"),
        ([], "unknown"),
    ],
)  # fmt: skip
def test_a_node_that_is_not_known_needs_the_saved_script(tmp_path, header, software):
    program = load(tmp_path, UNKNOWN, twin(*header))
    assert script_of(program) == twin(*header)
    assert program.notes == (
        "p.urp: a node of the URCap 'Gripper' cannot be turned into a script: "
        f"instead of the nodes runs p.script, saved by software {software}",
    )


@pytest.mark.parametrize(
    ("program", "saved", "problem"),
    [
        (UNKNOWN, None, "'Gripper' cannot be turned into a script; put the .script that PolyScope saved"),
        (UNKNOWN, 'textmsg("mine")\n', "and p.script is not a script that PolyScope saved"),
        (
            UNKNOWN,
            'def mine():\n  textmsg("mine")\nend\n',
            "and p.script is not a script that PolyScope saved",
        ),
        (urp(GRIPPER + external_control()), twin(), "and p.script has what a PC sent when it was saved"),
    ],
    ids=["none", "statements of the user", "a program of the user", "with a PC's part"],
)
def test_when_there_is_no_saved_script_to_use(tmp_path, program, saved, problem):
    with pytest.raises(ProgramFileError, match=problem):
        load(tmp_path, program, saved)


def test_nodes_that_are_not_known_are_left_out(tmp_path):
    program = load(tmp_path, UNKNOWN, twin(), skip_unknown=True)
    assert 'textmsg("nodes")' in script_of(program)
    assert program.notes == (
        "p.urp: a node of the URCap 'Gripper' cannot be turned into a script: it is left out",
    )
    many = load(tmp_path, urp(GRIPPER * 25), skip_unknown=True).notes
    assert len(many) == 21
    assert many[-1] == "p.urp: 25 things are left out in all"


def test_the_log_says_what_is_left_out(tmp_path):
    (tmp_path / "p.urp").write_bytes(UNKNOWN)
    with (
        ControlBox(pace="lockstep", port_base=None, programs=tmp_path, skip_unknown_nodes=True) as box,
        Dashboard(box) as dashboard,
    ):
        assert dashboard.ask("load p.urp") == "Loading program: /programs/p.urp"
        dashboard.ask("running")
        assert any(
            "'Gripper' cannot be turned into a script: it is left out" in entry.text for entry in box.log
        )


def test_a_saved_script_that_does_not_compile_is_said(tmp_path):
    (tmp_path / "p.urp").write_bytes(UNKNOWN)
    (tmp_path / "p.script").write_text(twin("set_tool_communication(False, 115200, 0, 1, 1.5, 3.5)"))
    with ControlBox(pace="lockstep", port_base=None, programs=tmp_path) as box, Dashboard(box) as dashboard:
        assert dashboard.ask_all("load p.urp", "play") == [
            "Loading program: /programs/p.urp",
            "Failed to execute: play",
        ]
        texts = [entry.text for entry in box.log]
    assert any("instead of the nodes runs p.script, saved by software 5.x" in text for text in texts)
    end = "this is CB3 3.15); the script is p.script, saved by software 5.x"
    said = [text for text in texts if text.startswith("p.urp will not start: ") and text.endswith(end)]
    assert any("; known since e-Series 5.0, " in text for text in said)
