"""Where programs end on a script port: the manual's rule, the field's exceptions, garbage, bounds."""

from __future__ import annotations

from pathlib import Path

import pytest
from codec_ways import check_reading, in_pieces
from hypothesis import given
from hypothesis import strategies as st

from protocol.script_channel import MAX_LINE, ControlLine, Overflow, ProgramText, ScriptChannel

# Nested blocks; a body in column 1 (the blended moves of python-urx); a value that ur_rtde has put into column 1.
NESTED, URX, URRTDE = (
    (Path(__file__).parent / "programs" / f"{name}.script").read_text()
    for name in ("nested", "urx", "ur_rtde")
)
# ur_modern_driver indents with tabs.
UMD = "def driverProg():\n\tMSTOP = 0\n\tdef set(q):\n\t\tenter_critical\n\tend\n\tsync()\nend\n"

CASES = [
    ("nested blocks", NESTED, [ProgramText(NESTED, "outer", "def")]),
    ("unindented body", URX, [ProgramText(URX, "movexs", "def")]),
    ("tabs", UMD, [ProgramText(UMD, "driverProg", "def")]),
    ("spliced lines", URRTDE, [ProgramText(URRTDE, "rtde_control", "def")]),
    ("secondary", "sec setOut():\n\tset_flag(1, True)\nend\n",
     [ProgramText("sec setOut():\n\tset_flag(1, True)\nend\n", "setOut", "sec")]),
    ("one line", "def a(): sync() end\n", [ProgramText("def a(): sync() end\n", "a", "def")]),
    ("CRLF", "def a():\r\n  sync()\r\nend\r\n", [ProgramText("def a():\n  sync()\nend\n", "a", "def")]),
    ("indented as a whole", "  def a():\n    b()\n  end\n",
     [ProgramText("  def a():\n    b()\n  end\n", "a", "def")]),
    ("no name", "def :\nend\n", [ProgramText("def :\nend\n", "", "def")]),
    ("text after the end is the compiler's", "def a(): end end\n",
     [ProgramText("def a(): end end\n", "a", "def")]),
    ("unclosed string stays on its line", 'def a():\n  textmsg("if)\nend\n',
     [ProgramText('def a():\n  textmsg("if)\nend\n', "a", "def")]),
    ("statements", "movej([0,0,0,0,0,0])\n digital_out[2]=True # f(x)\nhalt\n",
     [ProgramText("movej([0,0,0,0,0,0])\n", "movej", "statement"),
      ProgramText(" digital_out[2]=True # f(x)\n", "digital_out", "statement"),
      ProgramText("halt\n", "halt", "statement")]),
    ("called function's name", "x = get_actual_tcp_pose ()\n",
     [ProgramText("x = get_actual_tcp_pose ()\n", "get_actual_tcp_pose", "statement")]),
    ("names that begin like keywords", "define(1)\nsection = 2\n",
     [ProgramText("define(1)\n", "define", "statement"),
      ProgramText("section = 2\n", "section", "statement")]),
    ("nothing", "\n   \n# comment\n  # if\n$ 3 \"label\"\n\r\n", []),
    ("garbage is a statement for the compiler", "\x00\xff\xfe)(\n",
     [ProgramText("\x00\xff\xfe)(\n", "", "statement")]),
    ("two programs in one", URX + "stopj(2)\n" + UMD,
     [ProgramText(URX, "movexs", "def"), ProgramText("stopj(2)\n", "stopj", "statement"),
      ProgramText(UMD, "driverProg", "def")]),
    ("call after the program", "def a():\n b()\nend\na()\n",
     [ProgramText("def a():\n b()\nend\n", "a", "def"), ProgramText("a()\n", "a", "statement")]),
    ("a new def ends a program that never closes", "def a():\n  if x:\n    b()\nend\ndef c():\nend\n",
     [ProgramText("def a():\n  if x:\n    b()\nend\n", "a", "def"),
      ProgramText("def c():\nend\n", "c", "def")]),
    ("so does a controller word", "def a():\n  if x:\nend\nstop program\nsync()\n",
     [ProgramText("def a():\n  if x:\nend\n", "a", "def"), ControlLine("stop program", "stop program", ""),
      ProgramText("sync()\n", "sync", "statement")]),
    ("controller words", "power on\nset  speed\t0.5\r\n power off \nset robotmode run\n",
     [ControlLine("power on", "power on", ""), ControlLine("set speed 0.5", "set speed", "0.5"),
      ControlLine("power off", "power off", ""), ControlLine("set robotmode run", "set robotmode run", "")]),
    ("not quite controller words", "set speed\nset speed fast\npower on 1\nPower on\nset speed 1 2\n",
     [ProgramText("set speed\n", "set", "statement"), ProgramText("set speed fast\n", "set", "statement"),
      ProgramText("power on 1\n", "power", "statement"), ProgramText("Power on\n", "Power", "statement"),
      ProgramText("set speed 1 2\n", "set", "statement")]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "items"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_cases_alone_and_followed_by_half_a_program(text, items):
    data, rest = text.encode("latin-1"), b"def late():\n  sync()\nen"
    check_reading(lambda: ScriptChannel().feed, data, items, trailing=rest)
    channel = ScriptChannel()
    assert channel.feed(data) == items
    assert channel.pending == 0
    assert channel.feed(rest) == []
    assert channel.pending == len(rest)
    assert channel.feed(b"d\n") == [ProgramText("def late():\n  sync()\nend\n", "late", "def")]


def test_without_the_last_newline_nothing_runs():
    channel = ScriptChannel()
    assert channel.feed(b"movej([0,0,0,0,0,0])") == []
    assert channel.feed(b"def a():\n end") == [
        ProgramText("movej([0,0,0,0,0,0])def a():\n", "movej", "statement")
    ]


PIECES = st.sampled_from(
    [b"def a():\n", b"sec b():\n", b"end\n", b" if x: ", b"end", b"\n", b"while y:\n", b"stop program\n",
     b'"', b"#", b"$", b" ", b"\r\n", b"\xff\x00", b"x" * 30, b"set speed .5\n", b"thread t():\n"]
)  # fmt: skip


@given(
    st.lists(st.one_of(PIECES, st.binary(max_size=20)), max_size=40), st.lists(st.integers(1, 40), min_size=1)
)
def test_the_split_does_not_matter_and_nothing_raises(pieces, cuts):
    data = b"".join(pieces)
    whole = ScriptChannel(max_line=50, max_program=120)
    expected = whole.feed(data)
    pieced = ScriptChannel(max_line=50, max_program=120)
    items, position, k = [], 0, 0
    while position < len(data):
        step = cuts[k % len(cuts)]
        items += pieced.feed(data[position : position + step])
        position, k = position + step, k + 1
    assert items == expected
    assert pieced.pending == whole.pending <= 50 + 120


@given(st.lists(st.one_of(PIECES, st.binary(max_size=20)), max_size=40))
def test_whatever_came_before_a_control_word_is_heard_and_the_next_program_runs(pieces):
    channel = ScriptChannel(max_line=50, max_program=120)
    channel.feed(b"".join(pieces) + b"\n")
    assert channel.feed(b"stop program\n")[-1] == ControlLine("stop program", "stop program", "")
    assert channel.feed(b"def a():\nend\n") == [ProgramText("def a():\nend\n", "a", "def")]


@pytest.mark.parametrize("size", [1, 13, 1 << 20])
def test_a_line_that_is_too_long_is_dropped_and_said_once(size):
    channel = ScriptChannel(max_line=100)
    data = b"a" * 1000 + b"\nsync()\n" + b"b" * 100 + b"\n"
    items = in_pieces(channel.feed, data, size)
    assert items == [
        Overflow("line", 100),
        ProgramText("sync()\n", "sync", "statement"),
        ProgramText("b" * 100 + "\n", "b" * 100, "statement"),
    ]


@pytest.mark.parametrize("size", [1, 13, 1 << 20])
def test_the_body_of_a_dropped_program_does_not_run_line_by_line(size):
    channel = ScriptChannel(max_line=100)
    body = (
        b"def a():\n  movej(q1)\n  x = [" + b"1," * 100 + b"]\nmovej(q2)\n  if x:\n  end\nend_teach_mode()\n"
    )
    assert in_pieces(channel.feed, body + b"end\nsync()\n", size) == [
        Overflow("line", 100),
        ProgramText("sync()\n", "sync", "statement"),
    ]
    # if its end never comes, the next program still does
    later = [Overflow("line", 100), ProgramText("def b():\nend\n", "b", "def")]
    assert in_pieces(channel.feed, body + b"def b():\nend\n", size) == later


def test_a_program_that_is_too_long_is_dropped():
    channel = ScriptChannel(max_program=1000)
    items = channel.feed(b"def a():\n" + b"  movej(q)\n" * 1000)
    assert items == [Overflow("program", 1000)]
    assert channel.pending == 0
    assert channel.feed(b"end\nsync()\n") == [ProgramText("sync()\n", "sync", "statement")]


@pytest.mark.parametrize("unit", [b"a", b"a(", b'"', b"#", b" ", b"if ", b"\x80", b"def ", b"1a"])
def test_megabytes_without_a_newline_are_bounded_and_cheap(unit):
    # quadratic scanning would need hours here; pytest's timeout is the judge
    channel = ScriptChannel()
    data = unit * (3_000_000 // len(unit))
    items = in_pieces(channel.feed, data, 4096)
    assert items == [Overflow("line", MAX_LINE)]
    assert channel.pending == 0
    line = unit * (MAX_LINE // len(unit) - 1)
    (item,) = ScriptChannel().feed(b"x=" + line[:-2] + b"\n")
    assert isinstance(item, ProgramText)
    assert channel.feed(b"\nsync()\n") == [ProgramText("sync()\n", "sync", "statement")]


def test_what_is_dropped_from_outside_does_not_run_line_by_line():
    channel = ScriptChannel()
    assert not channel.feed(b"def p():\n  a()\n  b(")
    channel.drop()
    assert channel.pending == 0
    assert channel.feed(b"1)\nend\nsync()\n") == [ProgramText("sync()\n", "sync", "statement")]
