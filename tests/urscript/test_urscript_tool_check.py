"""`urscript check`: each warning, programs that get it and programs like them that do not; the command."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from urscript.catalogue import catalogue_for
from urscript.check.checking import check_program
from urscript.check.warnings import RULES
from urscript.cli import app


def warnings_of(text, *codes):
    errors, warnings = check_program(text)
    assert not errors, errors
    return [
        f"{warning.line}:{warning.column} {warning.message}"
        for warning in warnings
        if not codes or warning.rule.code in codes
    ]


def body(*lines):
    return "def p():\n" + "".join(f"  {line}\n" for line in lines) + "end\n"


WARNED = {
    "W101": [
        (body("global x = 1"), "2:10 global variable 'x' is never read"),
        (body("x = [1]", "x[0] = 2"), "2:3 global variable 'x' is never read"),
        (body("global x"), "2:10 global variable 'x' is never read"),
        (body("def f():", "x = 1", "textmsg(x)", "end", "f()", "if False:", "global y = 0", "end"), "8:10 global variable 'y' is never read"),
    ],
    "W102": [(body("def f():", "local x = 1", "y = 2", "return y", "end", "f()"), "3:9 local variable 'x' is never read")],
    "W103": [(body("def f(a, b=a):", "return b", "end", "a = 2", "f(a)"), "2:9 parameter 'a' of 'f' is never read"), (body("def f(a, b=1):", "a = 2", "return a", "end", "f(1)"), "2:12 parameter 'b' of 'f' is never read")],
    "W104": [
        (body("def f():", "end"), "2:7 function 'f' is never called"),
        (body("def f():", "f()", "end"), "2:7 function 'f' is never called"),
    ],
    "W105": [(body("thread  t():", "sync()", "end"), "2:11 thread 't' is never run")],
    "W106": [
        (body("while (True):", "x = 1", "end"), "2:3 this loop takes no time"),
        (body("while not False:", "while True:", "break", "end", "end"), "2:3 this loop takes no time"),
        (body("while not get_digital_in(0):", "end"), "2:3 this loop takes no time"),
        (body("while True:", "if get_digital_in(0):", "break", "end", "end"), "2:3 this loop takes no time"),
        (body("def f():", "set_flag(0, True)", "end", "while True:", "f()", "end"), "5:3 this loop takes no time"),
    ],
    "W107": [
        (body("r = socket_read_ascii_float(2)", "textmsg(r[1])"), "2:7 the number of received values is never checked: r[0]"),
        (body("textmsg(socket_read_byte_list(2)[1])"), "2:11 the number of received values is never checked"),
        (body("def f():", "local r = socket_read_binary_integer(1)", "return r[1]", "end", "r = [0]", "textmsg(r[0], f())"), "3:13 the number of received values is never checked"),
    ],
    "W108": [
        (body("def f():", "return 1", "textmsg(2)", "end", "f()"), "4:3 unreachable code: it follows return"),
        (body("halt", "$ 1", "def f():", "end", "f()"), "6:3 unreachable code: it follows halt"),
        (body("while True:", "if True:", "break", "textmsg(1)", "end", "sync()", "end"), "5:3 unreachable code: it follows break"),
        (body("while True:", "sync()", "end", "if get_flag(0):", "end"), "5:3 unreachable code: it follows an endless loop"),
        (body("if get_flag(0):", "halt", "else:", "halt", "end", "textmsg(1)"), "7:3 unreachable code: it follows an if whose branches all leave"),
    ],
    "W109": [
        (body("force = 1", "textmsg(force)"), "2:3 variable 'force' hides the builtin"),
        (body("def sync():", "end", "sync()"), "2:7 function 'sync' hides the builtin"),
        (body("def f(force):", "return force", "end", "f(1)"), "2:9 parameter 'force' hides the builtin"),
        (body("def f():", "a_joint_default = 2", "return a_joint_default", "end", "f()"), "3:3 variable 'a_joint_default' hides the builtin"),
    ],
    "W110": [
        (body("if True:", "elif get_flag(0):", "end"), "3:3 this branch is never reached: the condition of line 2 is always true"),
        (body("if get_flag(0):", "elif 1 == 1:", "else:", "halt", "end"), "5:3 this branch is never reached: the condition of line 3 is always true"),
        (body("x = 1", "if x == 1:", "elif x == 2:", "elif x == 1:", "end"), "5:3 this branch is never reached: the condition of line 3 is the same"),
    ],
    "W111": [(body("def f():", "end", "def f():", "end", "f()"), "2:7 'f' is defined twice here; the last definition is used")],
    "W112": [(body("def f():", "end", "run f()"), "4:3 'f' is run as a thread but defined with 'def'")],
    "W114": [
        (body("x = 0", "x == 1", "textmsg(x)"), "3:3 the result of this comparison is not used"),
        (body("i = 0", "i++", "textmsg(i)"), "3:3 a value is computed and not used"),
        (body('"text"'), "2:3 a value is computed and not used"),
    ],
    "W116": [
        (body("movej([0, -1.57, 0 -1.57, 0, 0])"), "2:9 movej: Parameter 'q' must be a Pose on the form p[x,y,z,a,b,c] or a list of 6 joint positions, got a list of 5"),
        (body("home = [0, -1.57, 0]", "movej(home)"), "3:9 movej: Parameter 'q' must be"),
        (body("x = 1", "movej([x, x, x], a=1)"), "3:9 movej: Parameter 'q' must be"),
        (body("set_tcp([0, 0, 0, 0, 0, 0])"), "2:11 set_tcp: Parameter must be a Pose on the form p[x,y,z,a,b,c]"),
        (body('sleep("1")'), "2:9 sleep: Parameter 't' must be a number"),
        (body("set_standard_digital_out(9, True)"), "2:28 set_standard_digital_out: Parameter 'n' must be in the range 0 to 7, got 9"),
        (body("set_standard_digital_out(0, 1)"), "2:31 set_standard_digital_out: Parameter 'b' must be True or False, got the int 1"),
    ],
    "W119": [
        (body("def f(a, b=0):", "return a", "end", "if False:", "x = f()", "end"), "6:7 f takes exactly 1 or 2 arguments (0 given)"),
        (body("def f():", "end", "f(1)"), "4:3 f takes exactly 0 arguments (1 given)"),
    ],
    "W117": [
        (body("movej([90, -90, 0, 0, 0, 0])"), "2:9 movej: joint 0 at 90 rad is 5157 degrees"),
        (body("home = [0, -90, 0, 0, 0, 0]", "movej(home)"), "3:9 movej: joint 1 at -90 rad is -5157 degrees"),
        (body("def f():", "local q = [0, 0, 0, 0, 0, 45]", "servoj(q)", "end", "f()"), "4:10 servoj: joint 5 at 45 rad is 2578 degrees"),
        (body("movej([0, -1.57, 0, 0, 0, 0], v=60)"), "2:35 movej: 60 rad/s is faster than any joint"),
        (body("speedj([0, -30, 0, 0, 0, 0], 1.4)"), "2:10 speedj: -30 rad/s is faster than any joint"),
        (body("movel(p[0.4, 0, 0.2, 0, 180, 0])"), "2:9 movel: a rotation vector with 180 rad is more than a turn"),
    ],
    "W118": [
        (body("movel(p[400, -100, 200, 0, 3.14, 0])"), "2:9 movel: 400 m is farther than any arm reaches"),
        (body("movej(p[0.4, -100, 0.2, 0, 3.14, 0])"), "2:9 movej: -100 m is farther than any arm reaches"),
        (body("set_tcp(p[0, 0, 120, 0, 0, 0])"), "2:11 set_tcp: 120 m is farther than any arm reaches"),
        (body("set_payload(1.5, [0, 0, 50])"), "2:20 set_payload: 50 m is farther than any arm reaches"),
        (body("movel(p[0.4, 0, 0.2, 0, 3.14, 0], v=250)"), "2:39 movel: 250 m/s is faster than any arm"),
        (body("movel(p[0.4, 0, 0.2, 0, 3.14, 0], r=50)"), "2:39 movel: 50 m is farther than any arm reaches"),
        (body("speedl([100, 0, 0, 0, 0, 0], 0.5)"), "2:10 speedl: 100 m/s is faster than any arm"),
    ],
    "W120": [
        (body("servoj([0, 0, 0, 0, 0, 0], t=0.002)"), "2:32 servoj: 0.002 s is shorter than a control cycle of 0.008 s"),
        (body("speedj([0, 0, 0, 0, 0, 0], 1, 0.004)"), "2:33 speedj: 0.004 s is shorter than a control cycle of 0.008 s"),
    ],
    "W115": [(body("x = [1]", "x.append(2)"), "3:3 nothing in this program has a method 'append'")],
    "W113": [("def f():\n  sync()\nend\nf()\n", "4:1 'f' runs when it is defined; this call is a program of its own and fails")],
}  # fmt: skip

FINE = {
    "W101": [
        body("x = 1", "textmsg(x)"),
        body("x = 1", "def f(a=x):", "return a", "end", "f()"),
        body("x = 1", "thread t():", "x = x + 1", "end", "run t()"),
        body("i = 0", "x = [1]", "x[i] = 2", "textmsg(x)"),
        body("_x = 1"),
    ],
    "W102": [body("def f():", "x = [1]", "x[0] = 2", "return x", "end", "f()")],
    "W103": [body("def f(a, _b):", "return a", "end", "f(1, 2)")],
    "W104": [body("f()", "def f():", "g()", "end", "def g():", "end"), body("def f(a=g()):", "return a", "end", "def g():", "return 1", "end", "f()")],
    "W105": [body("h = run t()", "thread t():", "run u()", "end", "thread u():", "end", "join h")],
    "W106": [
        body("while True:", "sync()", "end"),
        body("while True:", "if get_flag(0):", "sleep(1)", "end", "end"),
        body("x = 0", "while x < 3:", "x = x + 1", "end"),
        body("x = 0", "while True:", "x = x + 1", "if x > 3:", "break", "end", "end"),
        body("def f():", "g()", "end", "def g():", "sync()", "end", "while True:", "f()", "end"),
        body("while not get_flag(0):", "set_flag(0, True)", "end"),
        body("while random() < 0.5:", "end"),
        body('while "":', "end", "while False:", "end"),
        body("while get_flag(0):", "if get_flag(1):", "halt", "else:", "break", "end", "end"),
        body("thread t():", "end", "while True:", "h = run t()", "join h", "end"),
        body('x = rpc_factory("xmlrpc", "http://a")', "while True:", "x.f()", "end"),
    ],
    "W107": [
        body("r = socket_read_ascii_float(2)", "if r[0] == 2:", "textmsg(r[1])", "end"),
        body("r = socket_read_ascii_float(2)", "if r == [1, 2]:", "textmsg(r[1])", "end"),
        body("def f(r):", "return r[0]", "end", "r = socket_read_ascii_float(2)", "f(r)", "textmsg(r[1])"),
        body("socket_read_ascii_float(2)"),
        body("def socket_read_ascii_float(n):", "return [n, n]", "end", "r = socket_read_ascii_float(2)", "textmsg(r[1])"),
        body("textmsg(socket_read_byte_list(2)[0])"),
    ],
    "W108": [
        body("def f(a):", "if a:", "return 1", "end", "return 2", "end", "f(True)"),
        body("while True:", "if get_flag(0):", "break", "end", "sync()", "end", "textmsg(1)"),
        body("halt", "def f():", "end", "$ 2"),
        body("while get_flag(0):", "sync()", "end", "textmsg(1)"),
    ],
    "W109": [body("t = 1", "type = 2", "textmsg(t, type)")],
    "W110": [
        body("if (False):", "global x = 0", "end"),
        body("if random() < 0.5:", "elif random() < 0.5:", "end"),
        body("if get_flag(0):", "elif True:", "end"),
    ],
    "W111": [body("def f():", "def g():", "end", "g()", "end", "def h():", "def g():", "end", "g()", "end", "f()", "h()")],
    "W112": [body("thread t():", "end", "run t()")],
    "W114": [body("x = [1]", "x[0] == 1 textmsg(x)".replace("==", "=")), body("def f():", "return 1", "end", "f()"), body("thread t():", "end", "run t()")],
    "W116": [
        body("x = 1", "movej([x, x, x, x, x, x])", "movel(p[x, 0, 0, 0, 0, 0], t=x)", "set_tcp(p[0, 0, 0, 0, 0, 0])"),
        body("def sleep(t):", "return t", "end", 'sleep("1")'),
        body('set_tcp(p["a", 0, 0, 0, 0, 0])'),  # not a pose: the run says so
        body("speedl([0, 0, 0, 0, 0, 0], 1, t=0.1)", "set_payload(0.5)", "set_payload(0.5, [0, 0, 0])", "textmsg([[1, 2], [3, 4]])"),
    ],
    "W117": [
        body("movej([6.28, -6.33, 0, 0, 0, -7.3])", "movej([d2r(90), 0, 0, 0, 0, 0], v=10)", "movel(p[0.4, 0, 0.2, 0, 4.5, 4.4])"),
        body("q = [0, 0, 0, 0, 0, 0]", "q[0] = d2r(90)", "movej(q)"),
        body("q = [90, 0, 0, 0, 0, 0]", "q = [1, 0, 0, 0, 0, 0]", "movej(q)"),
        body("q = [90, 0, 0, 0, 0, 0]", "def f(q):", "movej(q)", "end", "f([0, 0, 0, 0, 0, d2r(q[0])])"),
        body("force_mode(p[0, 0, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0], [0, 0, 20, 0, 0, 0], 2, [0.1, 0.1, 15, 10, 0.3, 0.3])", "sleep(90)"),
    ],
    "W119": [body("def f(a, b=0):", "return a + b", "end", "textmsg(f(1), f(b=2, a=1))")],
    "W118": [body("movel(p[0.4, -1.8, 0.2, 0, 3.14, 0], a=15, v=3, r=0.5)", "set_payload(20, [0, 0, 0.3])")],
    "W120": [body("servoj([0, 0, 0, 0, 0, 0], t=0.008)", "speedl([0, 0, 0, 0, 0, 0], 1, get_steptime())", "sleep(0.001)")],
    "W115": [body('x = rpc_factory("xmlrpc", "http://a")', "x.append(2)")],
    "W113": ["def f(a):\n  textmsg(a)\nend\nf(1)\n", "def f():\n  sync()\nend\n"],
}  # fmt: skip


@pytest.mark.parametrize(
    ("code", "text", "expected"), [(code, *case) for code, cases in WARNED.items() for case in cases]
)
def test_it_is_warned_of(code, text, expected):
    found = warnings_of(text, code)
    assert len(found) == 1
    assert found[0].startswith(expected)


@pytest.mark.parametrize(("code", "text"), [(code, text) for code, cases in FINE.items() for text in cases])
def test_nothing_is_said_about_programs_that_are_meant_so(code, text):
    assert warnings_of(text, code) == []


def test_every_warning_underlines_something():
    for cases in WARNED.values():
        for text, _ in cases:
            for warning in check_program(text)[1]:
                span, lines = warning.span, text.split("\n")
                assert lines[span.line - 1][span.column - 1 : span.end_column - 1].strip()
                assert (span.line, span.column) < (span.end_line, span.end_column)
                assert span.end_column <= len(lines[span.end_line - 1]) + 1


def test_every_rule_of_the_table_is_tested_and_has_its_own_code():
    codes = [rule.code for rule in RULES]
    assert codes == sorted(set(codes)) == sorted(WARNED) == sorted(FINE)


def test_statements_of_interpreter_mode_may_use_everything():
    lines = [
        "global x = 1",
        "def f(a):",
        "local y = 2",
        "interpreter_mode()",
        "end",
        "thread t():",
        "sync()",
        "end",
        "f(1)",
    ]
    assert check_program(body(*lines), catalogue=catalogue_for("5.12")) == ((), [])


def test_programs_with_errors_get_no_warnings_that_may_follow_from_them():
    errors, warnings = check_program(body("global x = 1", "nothing()"))
    assert len(errors) == 1
    assert warnings == []


# --- the command -----------------------------------------------------------------------------------------

WARNED_TEXT = body("global gr\u00f6n = 1", "x = 2").replace("\u00f6", "oe") + "# \u00fc\n"


@pytest.fixture
def check(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.script").write_text(WARNED_TEXT, encoding="utf-8")
    (tmp_path / "b.script").write_text('def b():\n  txtmsg("\u00fc")\nend\n', encoding="utf-8")
    return lambda *words, **more: CliRunner().invoke(app, ["check", *words], **more)


def test_warnings_end_in_their_code_and_do_not_fail(check):
    result = check("a.script")
    assert result.exit_code == 0
    first = "a.script:2:10: Warning: global variable 'groen' is never read [W101]\n      global groen = 1\n             ^^^^^\n"
    assert result.output.startswith(first)


def test_strict_fails_with_warnings_unless_they_are_ignored(check):
    assert check("--strict", "a.script").exit_code == 1
    result = check("--strict", "--ignore", "w102,W101", "a.script")
    assert (result.exit_code, result.output) == (0, "")


@pytest.mark.parametrize(
    ("text", "on_cb3", "on_e_series"),
    [
        (body("servoj([0, 0, 0, 0, 0, 0], t=0.002)"), ["W120"], []),
        (body("servoj([0, 0, 0, 0, 0, 0], t=0.001)"), ["W120"], ["W120"]),
        (body("x = [1]", "textmsg(x)", "x.append(2)"), ["W115"], []),
        # What a method has changed is no constant any more.
        (body("q = [0, 0, 0, 0, 0, 0, 0]", "q.pop()", "movej(q)"), ["W115"], []),
    ],
)
def test_some_warnings_depend_on_the_generation(text, on_cb3, on_e_series):
    def codes(software):
        _, warnings = check_program(text, catalogue=catalogue_for(software))
        return [warning.rule.code for warning in warnings]

    assert codes("3.15") == on_cb3
    assert codes("5.15") == on_e_series


def test_ignoring_a_code_that_does_not_exist_is_wrong_use(check):
    result = check("--ignore", "W999", "a.script")
    assert result.exit_code == 2
    assert "W999" in result.output


def test_json_is_one_document_with_every_place(check):
    result = check("--json", "a.script", "b.script")
    assert result.exit_code == 1
    warning, other, error = json.loads(result.stdout)["diagnostics"]
    assert warning == {
        "file": "a.script",
        "line": 2,
        "column": 10,
        "end_line": 2,
        "end_column": 15,
        "severity": "warning",
        "code": "W101",
        "message": "global variable 'groen' is never read",
        "hint": None,
    }
    assert other["line"] == 3
    assert (error["severity"], error["code"], error["hint"]) == ("error", "E103", "did you mean 'textmsg'?")
    assert (error["line"], error["column"], error["end_column"]) == (2, 3, 9)


def test_json_of_a_good_program_is_a_document_too(check):
    result = check("--json", "-", input="sync()\n")
    assert (result.exit_code, json.loads(result.stdout)) == (0, {"diagnostics": []})


def test_json_of_fmt_says_what_would_change(check):
    result = CliRunner().invoke(app, ["fmt", "--check", "--json", "a.script", "b.script", "-"], input="x =")
    assert result.exit_code == 1
    document = json.loads(result.stdout)
    assert document["files"] == [
        {"file": "a.script", "changes": False},
        {"file": "b.script", "changes": False},
    ]
    assert [item["code"] for item in document["diagnostics"]] == ["E101"]


# --- the page


PAGE = Path(__file__).parents[2] / "docs" / "urscript-tool.md"


def test_the_table_of_warnings_is_that_of_the_rules():
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    table = [line for line in lines if re.match(r"\| W\d+ \|", line)]
    assert table == [f"| {rule.code} | {rule.meaning} | {rule.reason} |" for rule in RULES]


# --- all commands


GOOD = 'def good():\n  movej([0,0,0,0,0,0])\n  textmsg("gr\u00fc\u00dfe")\nend\n'
BAD = "def bad():\n  txtmsg(1)\n  y = nothing\nend\n"


@pytest.fixture
def call(tmp_path):
    def run(*words, **files):
        paths = []
        for name, text in files.items():
            path = tmp_path / f"{name}.script"
            path.write_text(text, encoding="utf-8")
            paths.append(str(path))
        return CliRunner().invoke(app, [*words, *paths])

    return run


def test_check_is_silent_about_good_programs(call):
    result = call("check", good=GOOD, crlf=GOOD.replace("\n", "\r\n"), bom="\ufeff" + GOOD)
    assert (result.exit_code, result.output) == (0, "")


def test_check_shows_all_errors_of_all_files(call):
    result = call("check", bad=BAD, good=GOOD, broken="def f(:\nend")
    assert result.exit_code == 1
    assert (
        "bad.script:2:3: Compile error: name 'txtmsg' is not defined (did you mean 'textmsg'?)"
        in result.output
    )
    assert "bad.script:3:7: Compile error: name 'nothing' is not defined" in result.output
    assert "broken.script:1:7: Syntax error" in result.output
    assert "      txtmsg(1)\n      ^^^^^^\n" in result.output


@pytest.mark.parametrize(
    "words", [("check", "/nowhere.script"), ("run", "/nowhere.script"), ("run",), ("check",)]
)
def test_wrong_use_exits_with_2(call, words):
    assert call(*words).exit_code == 2


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("command", ["check", "run", "fmt"])
def test_a_file_in_utf_16_is_refused_as_that(tmp_path, command, encoding):
    path = tmp_path / "windows.script"
    path.write_text(GOOD, encoding=encoding)
    result = CliRunner().invoke(app, [command, str(path)])
    assert result.exit_code == 2
    assert result.stderr == f"{path} is UTF-16 text: a controller reads UTF-8, save it as that\n"


def test_the_software_version_decides_which_names_exist(call):
    late = "set_target_payload(1, [0,0,0])\n"
    assert call("check", late=late).exit_code == 1
    assert call("check", "--software", "5.11", late=late).exit_code == 0
    assert call("check", "--software", "9.9", late=late).exit_code == 2


@pytest.mark.parametrize(
    ("software", "name", "hint"),
    [
        ("5.9", "set_target_payload", "known since e-Series 5.10, PolyScope X 10.0; this is e-Series 5.9"),
        ("3.15", "struct", "known since e-Series 5.14, PolyScope X 10.0; this is CB3 3.15"),
        ("5.17", "optimovej", "known since e-Series 5.21, PolyScope X 10.8; this is e-Series 5.17"),
        ("5.11", "set_euromap_output", "known since CB3 3.0; this is e-Series 5.11"),
        ("3.7", "str_cat", "known since CB3 3.8, e-Series 5.0, PolyScope X 10.0; this is CB3 3.7"),
    ],
)
def test_a_name_of_other_software_comes_with_its_first_releases(call, software, name, hint):
    result = call("check", "--software", software, other=f"def p():\n  {name}()\nend\n")
    assert f"other.script:2:3: Compile error: name '{name}' is not defined ({hint})" in result.output
