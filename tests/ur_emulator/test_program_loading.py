"""Loading a program: the script that PolyScope saved beside it, and small files that want to become large.

Each of those is refused within the budgets of a program, in one short line.
"""

import gzip
import pickle
from dataclasses import replace
from pathlib import Path

import pytest
from dashboard_support import Dashboard, external_control, script_line, urp

from protocol.script_channel import MAX_PROGRAM
from ur_emulator.budgets import BUDGETS
from ur_emulator.emulator import ControlBox
from ur_emulator.errors import ProgramFileError
from ur_emulator.machine.controller.events import ScriptFailed
from ur_emulator.program_files import reader
from ur_emulator.program_files.compiling import compile_loaded
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.installation_reader import NEW_BOX
from ur_emulator.program_files.loading import load_program
from ur_emulator.program_files.script_writer import Header
from urscript.catalogue import catalogue_for

GRIPPER = '<Contributed strategyURCapName="Gripper"/>'
KNOWN, UNKNOWN = urp(script_line('textmsg("nodes")')), urp(GRIPPER + script_line('textmsg("nodes")'))


def twin(*header, statement='textmsg("saved")'):
    """A script as PolyScope saves it."""
    lines = [*header, '$ 1 "Robot Program"', '$ 2 "Script"', statement]
    return "def unnamed():\n" + "".join(f"  {line}\n" for line in lines) + "end\n"


def load_pair(folder, program, saved=None, **options):
    (folder / "p.urp").write_bytes(program)
    if saved is not None:
        (folder / "p.script").write_text(saved)
    return load_program(ProgramFolder(folder), "p.urp", **options)


def script_of(program):
    return program.script(lambda pc: "# gap")


def test_the_nodes_come_first(tmp_path):
    program = load_pair(tmp_path, KNOWN, twin())
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
    program = load_pair(tmp_path, UNKNOWN, twin(*header))
    assert script_of(program) == twin(*header)
    assert program.notes == (
        "p.urp: a node of the URCap 'Gripper' cannot be turned into a script: "
        f"instead of the nodes runs p.script, saved by software {software}",
    )


OLD = b'<gui.program.ProgramRootNode serialization="custom"><unserializable-parents/></gui.program.ProgramRootNode>'


def test_a_program_of_polyscope_1_8_runs_as_its_saved_script(tmp_path):
    old = '<gui.installation.RobotInstallation><TCPSettings toolPayload="heavy"/></gui.installation.RobotInstallation>'
    (tmp_path / "default.installation").write_text(old)
    program = load_pair(tmp_path, OLD, twin())
    assert (script_of(program), program.undefined, program.installation) == (twin(), "", NEW_BOX)
    assert program.notes[0].startswith(
        "p.urp: a program of PolyScope 1.8 cannot be turned into a script: instead"
    )


@pytest.mark.parametrize(
    ("program", "saved", "problem"),
    [
        (
            OLD,
            None,
            "a program of PolyScope 1.8 cannot be turned into a script; put the .script that PolyScope saved",
        ),
        (OLD, 'textmsg("mine")\n', "and p.script is not a script that PolyScope saved"),
        (UNKNOWN, None, "'Gripper' cannot be turned into a script; put the .script that PolyScope saved"),
        (UNKNOWN, 'textmsg("mine")\n', "and p.script is not a script that PolyScope saved"),
        (
            UNKNOWN,
            'def mine():\n  textmsg("mine")\nend\n',
            "and p.script is not a script that PolyScope saved",
        ),
        (urp(GRIPPER + external_control()), twin(), "and p.script has what a PC sent when it was saved"),
    ],
    ids=[
        "old",
        "old beside the user's",
        "none",
        "statements of the user",
        "a program of the user",
        "with a PC's part",
    ],
)
def test_when_there_is_no_saved_script_to_use(tmp_path, program, saved, problem):
    with pytest.raises(ProgramFileError, match=problem):
        load_pair(tmp_path, program, saved)


def test_nodes_that_are_not_known_are_left_out(tmp_path):
    program = load_pair(tmp_path, UNKNOWN, twin(), skip_unknown=True)
    assert 'textmsg("nodes")' in script_of(program)
    assert program.notes == (
        "p.urp: a node of the URCap 'Gripper' cannot be turned into a script: it is left out",
    )
    many = load_pair(tmp_path, urp(GRIPPER * 25), skip_unknown=True).notes
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


LAUGHS = "".join(f'<!ENTITY {chr(98 + n)} "{("&" + chr(97 + n) + ";") * 10}">' for n in range(7))
DOCTYPES = {
    "laughs": f'<!DOCTYPE URProgram [<!ENTITY a "<c/><c/><c/>">{LAUGHS}]><URProgram>&h;</URProgram>',
    "defaults": f'<!DOCTYPE c [<!ATTLIST c x CDATA "{"y" * 100_000}">]><URProgram>{"<c/>" * 20_000}</URProgram>',
}


def load(folder, data, name="p.urp"):
    (folder / name).write_bytes(data)
    return load_program(ProgramFolder(folder), name)


def refused(folder, data):
    with pytest.raises(ProgramFileError) as told:
        load(folder, data)
    text = str(told.value)
    assert "\n" not in text
    assert len(text) <= 500
    return text


def nested(depth, inside):
    return '<Loop type="Forever"><children>' * depth + inside + "</children></Loop>" * depth


# --- files


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "cp037", "utf-7"]
)
@pytest.mark.parametrize("kind", DOCTYPES)
@pytest.mark.parametrize("packed", [False, True])
def test_document_types_are_refused_in_every_encoding(tmp_path, kind, encoding, packed):
    declared = encoding.removesuffix("-sig").removesuffix("-le").removesuffix("-be")
    data = f'<?xml version="1.0" encoding="{declared}"?>{DOCTYPES[kind]}'.encode(encoding)
    text = refused(tmp_path, gzip.compress(data) if packed else data)
    assert any(word in text for word in ("document type", "not text in UTF-8", "not XML"))


@pytest.mark.parametrize(
    ("plain", "problem"),
    [
        (b"<URProgram>" + b"<a/>" * 4_200_000 + b"</URProgram>", "more than 16777216 bytes unpacked"),
        (b"<URProgram>" + b"<a/>" * 300_000 + b"</URProgram>", "more than 300000 tags and attributes"),
        (b"<URProgram " + b" ".join(b'a%d=""' % n for n in range(300_000)) + b"/>", "more than 300000 tags"),
        (
            b"<URProgram>" + b"<a>" * 140_000 + b"</a>" * 140_000 + b"</URProgram>",
            "nested more than 200 deep",
        ),
        (b"<URProgram>\0</URProgram>", "not text in UTF-8"),
        (b"<URProgram>\xff</URProgram>", "not text in UTF-8"),
        (b"<" + b"x" * 1_000_000 + b"/>", "is not a program"),
        (b"<URProgram/><URProgram/>", "is not XML"),
    ],
    ids=["bytes", "elements", "attributes", "depth", "zeros", "encoding", "long name", "two roots"],
)
def test_a_file_is_bounded_before_and_after_it_is_unpacked(tmp_path, plain, problem):
    assert problem in refused(tmp_path, gzip.compress(plain))


def test_a_packed_file_ends_at_its_end(tmp_path):
    data = urp(script_line("x = 1"))
    assert "something stands behind its end" in refused(tmp_path, data + data)
    assert "something stands behind its end" in refused(tmp_path, data + b"more")
    assert load(tmp_path, data + bytes(100)).script(str) == load(tmp_path, data).script(str)


def test_the_budgets_hold_for_all_files_of_a_program_together(tmp_path, monkeypatch):
    monkeypatch.setattr(reader, "BUDGETS", replace(BUDGETS, program_marks=3_000))
    (tmp_path / "s.urp").write_bytes(urp("<Comment/>" * 200))
    call = "<CallSubProgram><subprogram><programFile>s.urp</programFile></subprogram></CallSubProgram>"
    load(tmp_path, urp(call * 2))
    assert "more than 3000 tags and attributes" in refused(tmp_path, urp(call * 20))
    (tmp_path / "s.script").write_text("#" * 3_000_000 + "\n")
    node = '<Script type="File"><file>s.script</file></Script>'
    assert f"more than {MAX_PROGRAM} bytes" in refused(tmp_path, urp(node * 3))


# --- trees


def test_levels_of_a_file_are_counted_exactly(tmp_path, monkeypatch):
    monkeypatch.setattr(reader, "BUDGETS", replace(BUDGETS, program_depth=9))
    load(tmp_path, urp(nested(2, "<Halt/>")))
    assert "nested more than 9 deep" in refused(tmp_path, urp(nested(3, "<Halt/>")))


def test_many_equal_names_are_numbered_without_a_search_each(tmp_path):
    threads = '<Thread name="t"><children/></Thread>' * 20_000
    script = load(tmp_path, urp("", around=threads)).script(str)
    assert "thread t_20000():" in script


# --- scripts


def test_indentation_counts(tmp_path):
    lines = '<Script type="File"><cachedContents>' + "\n" * 200_000 + "x = 1</cachedContents></Script>"
    load(tmp_path, urp(lines))
    assert f"a script of more than {MAX_PROGRAM} bytes" in refused(tmp_path, urp(nested(45, lines)))


def test_characters_of_several_bytes_count_as_such(tmp_path):
    line = f'<Comment comment="{"€" * 600_000}"/>'
    load(tmp_path, urp(line))
    assert f"a script of more than {MAX_PROGRAM} bytes" in refused(tmp_path, urp(line * 2))
    (tmp_path / "e.script").write_text("#" + "€" * 1_390_000)
    with pytest.raises(ProgramFileError, match=f"more than {MAX_PROGRAM} bytes"):
        load(tmp_path, ("#" + "€" * 1_400_000).encode(), "e.script")


def test_what_comes_back_to_the_box_is_small(tmp_path):
    loaded = load(tmp_path, urp(script_line("x = 1") * 5000))
    first, header, body = loaded.parts
    assert (first, header) == ("def sample():", Header())
    assert len(pickle.dumps(loaded)) < len(body) + 2000
    assert "more than 20 nodes of External Control" in refused(tmp_path, urp(external_control() * 21))
    assert "host of External Control has more than 253" in refused(
        tmp_path, urp(external_control(host="h" * 254))
    )


def test_parts_of_pcs_are_bounded_together(tmp_path):
    loaded = load(tmp_path, urp(nested(40, external_control(host="h") * 20)))
    sent = dict.fromkeys(loaded.pcs, "x = 1\n" + "\n" * 100000 + "y = 2\n")
    outcome = compile_loaded(loaded, sent, catalogue_for("3.15"))
    assert isinstance(outcome, ScriptFailed)
    assert (
        outcome.text
        == f"p.urp cannot be compiled: the parts of PCs together have more than {MAX_PROGRAM} bytes"
    )


# --- a box


def test_a_box_refuses_them_in_one_line_each_and_loads_the_next(tmp_path):
    bombs = {
        "elements.urp": gzip.compress(b"<URProgram>" + b"<a/>" * 4_000_000 + b"</URProgram>"),
        "utf16.urp": gzip.compress(DOCTYPES["defaults"].encode("utf-16")),
        "names.urp": urp(f"<{'x' * 100_000}/>"),
        "lines.script": b"x = 1\n" * 1_000_000,
    }
    for name, data in {**bombs, "good.urp": urp(script_line("x = 1"))}.items():
        (tmp_path / name).write_bytes(data)
    with ControlBox(pace="lockstep", port_base=None, programs=tmp_path) as box, Dashboard(box) as dashboard:
        replies = dashboard.ask_all(*(f"load {name}" for name in bombs), "load good.urp")
        told = [entry.text for entry in box.log if "failed" in entry.text]
    assert replies == [f"Error while loading program: {name}" for name in bombs] + [
        "Loading program: /programs/good.urp"
    ]
    assert len(told) == len(bombs)
    assert all(text.startswith(f"load {name} failed: ") for name, text in zip(bombs, told, strict=True))
    assert max(map(len, told)) < 600


def test_the_page_names_the_limits():
    page = " ".join((Path(__file__).parents[2] / "docs" / "programs.md").read_text().split())
    mib = 1 << 20
    for words in (
        f"{BUDGETS.program_bytes // mib} MiB unpacked",
        f"{BUDGETS.program_marks:,} tags and attributes",
        f"{BUDGETS.program_depth} levels of XML",
        f"{BUDGETS.node_depth} levels of nodes",
        f"{BUDGETS.subprograms} sub-programs",
        f"{BUDGETS.external_control_nodes} nodes of External Control",
        f"{MAX_PROGRAM // mib} MiB of script",
        f"{BUDGETS.report_files} flight reports and support files, or {BUDGETS.report_bytes // mib} MiB",
    ):
        assert words in page
