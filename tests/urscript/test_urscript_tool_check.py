"""`urscript check`: what it says of wrong programs, each warning with programs that get it and that do not; the command.

A controller is told nothing of the advice.
"""

import json
import re
from pathlib import Path

import pytest
from program_texts import program_of
from typer.testing import CliRunner

from urscript.catalogue import catalogue_for
from urscript.check.checking import advise, check_program, check_with_advice, first_syntax_error
from urscript.check.syntax_rules import RULES as SYNTAX_RULES
from urscript.check.warnings import RULES
from urscript.cli import app
from urscript.source import Source, as_utf8

# --- wrong programs --------------------------------------------------------------------------------------


def cases(file):
    """Name, program and what is said of it, of all programs of a file: `--- name`, the program, lines of `#said`."""
    text = Path(__file__).with_name(file).read_bytes().decode("latin-1")
    for part in re.split(r"^--- ", text, flags=re.MULTILINE)[1:]:
        name, _, rest = part.partition("\n")
        program = re.sub(r"^#said .*\n", "", rest, flags=re.MULTILINE)
        yield name, program, [as_utf8(line) for line in re.findall(r"^#said (.*)$", rest, flags=re.MULTILINE)]


WRONG = list(cases("wrong_programs.script"))


def told(text):
    """Place and words of each error, and its carets."""
    errors, _ = check_with_advice(text, name="a")
    return [
        as_utf8(f"{error.headline()} {error.render().split()[-1]}").removeprefix("a:") for error in errors
    ]


@pytest.mark.parametrize(("name", "text", "said"), WRONG, ids=[name for name, *_ in WRONG])
def test_wrong_programs_get_the_place_and_what_to_write(name, text, said):
    assert told(text) == said


def test_every_rule_knows_a_program_of_the_table():
    known = set()
    for _, text, _ in WRONG:
        while (error := first_syntax_error(Source(text))) is not None:
            advice = advise(text, error)
            if advice is None or not advice.edits:
                break
            known.add(advice.message)
            for edit in sorted(advice.edits, reverse=True):
                text = text[: edit.start] + edit.new + text[edit.end :]
    assert len(SYNTAX_RULES) <= len(known)


def test_constant_values_are_looked_at_beside_errors_of_all_kinds():
    lines = (
        "movej([90, 0, 0, 0, 0, 0])",
        "texmsg(1)",
        "halt() movel(p[400, 0, 0, 0, 0, 0])",
        "x = 1",
        "servoj([0, 0], 1)",
    )
    errors, warnings = check_with_advice(program_of(*lines), name="a")
    assert [(error.line, error.column) for error in errors] == [(3, 3), (4, 3)]
    # Not of the line that was repaired, nor what may follow from an error: x, which is never read.
    assert [(warning.line, warning.rule.code) for warning in warnings] == [(2, "W117"), (6, "W116")]
    assert [warning.source.text for warning in warnings] == 2 * [program_of(*lines)]
    for others in (("movej(1, 2, 3, 4, 5, 6, 7)",), ("halt()", "x = 1")):
        _, warnings = check_with_advice(program_of(lines[0], *others))
        assert [(warning.line, warning.rule.code) for warning in warnings] == [(2, "W117")]


def test_carets_stand_below_characters_of_several_bytes():
    (error,), _ = check_with_advice(program_of('textmsg("\u00e4\u00f6\u00fc", y)'))
    assert as_utf8(error.render()).split("\n")[1:] == [
        '      textmsg("\u00e4\u00f6\u00fc", y)',
        "                     ^",
    ]


# --- warnings --------------------------------------------------------------------------------------------


def warnings_of(text, code):
    errors, warnings = check_program(text)
    assert not errors, errors
    return [f"{item.line}:{item.column} {item.message}" for item in warnings if item.rule.code == code]


WARNED = list(cases("warned_programs.script"))


@pytest.mark.parametrize(("name", "text", "said"), WARNED, ids=[name for name, *_ in WARNED])
def test_it_is_warned_of_and_not_of_programs_that_are_meant_so(name, text, said):
    code, _, fine = name.partition(" ")
    assert len(said) == (not fine)
    assert warnings_of(text, code) == said


def test_every_warning_underlines_something():
    for _, text, _ in WARNED:
        for warning in check_program(text)[1]:
            span, lines = warning.span, text.split("\n")
            assert lines[span.line - 1][span.column - 1 : span.end_column - 1].strip()
            assert (span.line, span.column) < (span.end_line, span.end_column)
            assert span.end_column <= len(lines[span.end_line - 1]) + 1


def test_every_rule_of_the_table_is_tested_and_has_its_own_code():
    codes = [rule.code for rule in RULES]
    assert codes == sorted(set(codes))
    assert {name for name, *_ in WARNED} == {*codes, *(f"{code} fine" for code in codes)}


def test_statements_of_interpreter_mode_may_use_everything():
    text = "global x = 1\ndef f(a):\nlocal y = 2\ninterpreter_mode()\nend\nthread t():\nend\nf(1)\n"
    assert check_program(text, catalogue=catalogue_for("5.12")) == ((), [])


PAGE = Path(__file__).parents[2] / "docs" / "urscript-tool.md"


def test_the_table_of_warnings_is_that_of_the_rules():
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    table = [line for line in lines if re.match(r"\| W\d+ \|", line)]
    assert [row.split(" | ")[:2] for row in table] == [[f"| {rule.code}", rule.meaning] for rule in RULES]


@pytest.mark.parametrize(
    ("text", "on_cb3", "on_e_series"),
    [
        (program_of("servoj([0, 0, 0, 0, 0, 0], t=0.002)"), ["W120"], []),
        (program_of("servoj([0, 0, 0, 0, 0, 0], t=0.001)"), ["W120"], ["W120"]),
        (program_of("x = [1]", "textmsg(x)", "x.append(2)"), ["W115"], []),
        # What a method has changed is no constant any more.
        (program_of("q = [0, 0, 0, 0, 0, 0, 0]", "q.pop()", "movej(q)"), ["W115"], []),
    ],
)
def test_some_warnings_depend_on_the_generation(text, on_cb3, on_e_series):
    def codes(software):
        _, warnings = check_program(text, catalogue=catalogue_for(software))
        return [warning.rule.code for warning in warnings]

    assert codes("3.15") == on_cb3
    assert codes("5.15") == on_e_series


# --- the command -----------------------------------------------------------------------------------------

GOOD = 'def good():\n  movej([0,0,0,0,0,0])\n  textmsg("gr\u00fc\u00dfe")\nend\n'
BAD = "def bad():\n  txtmsg(1)\n  y = nothing\nend\n"


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def run(*words, standard_input=None, **files):
        for name, text in files.items():
            Path(f"{name}.script").write_text(text, encoding="utf-8")
        return CliRunner().invoke(app, [*words, *(f"{name}.script" for name in files)], input=standard_input)

    return run


def test_check_is_silent_about_good_programs(call):
    result = call("check", good=GOOD, crlf=GOOD.replace("\n", "\r\n"), bom="\ufeff" + GOOD)
    assert (result.exit_code, result.output) == (0, "")


def test_check_shows_all_errors_of_all_files(call):
    result = call("check", bad=BAD, good=GOOD, broken="def f(:\nend")
    assert result.exit_code == 1
    assert re.findall(r"^(.*?:\d+:\d+: \w+ error)", result.output, re.MULTILINE) == [
        "bad.script:2:3: Compile error",
        "bad.script:3:7: Compile error",
        "broken.script:1:7: Syntax error",
    ]
    assert (
        "name 'txtmsg' is not defined (did you mean 'textmsg'?)\n      txtmsg(1)\n      ^^^^^^\n"
        in result.output
    )


def test_json_has_the_errors_of_all_files(call):
    result = call("check", "--json", good=GOOD, bad=BAD)
    assert result.exit_code == 1
    error, _ = json.loads(result.stdout)["diagnostics"]
    assert (error["severity"], error["code"], error["hint"]) == ("error", "E103", "did you mean 'textmsg'?")
    assert (error["line"], error["column"], error["end_column"]) == (2, 3, 9)


def test_json_of_a_good_program_is_a_document_too(call):
    result = call("check", "--json", "-", standard_input="sync()\n")
    assert (result.exit_code, json.loads(result.stdout)) == (0, {"diagnostics": []})


def test_json_of_fmt_says_what_would_change(call):
    result = call("fmt", "--check", "--json", "-", standard_input="x =", a="x = 1\n", b="x=1\n")
    assert result.exit_code == 1
    document = json.loads(result.stdout)
    assert [(one["file"], one["changes"]) for one in document["files"]] == [
        ("a.script", False),
        ("b.script", True),
    ]
    assert [item["code"] for item in document["diagnostics"]] == ["E101"]


@pytest.mark.parametrize(
    "words",
    [
        ("check",),
        ("run",),
        ("check", "--software", "9.9", "-"),
        *((it, "nowhere.script") for it in ("check", "run", "fmt")),
    ],
)
def test_wrong_use_exits_with_2(call, words):
    assert call(*words).exit_code == 2


@pytest.mark.parametrize(
    ("command", "encoding"), [("check", "utf-16"), ("run", "utf-16-le"), ("fmt", "utf-16-be")]
)
def test_a_file_in_utf_16_is_refused_as_that(call, command, encoding):
    Path("windows.script").write_text(GOOD, encoding=encoding)
    result = call(command, "windows.script")
    assert result.exit_code == 2
    assert result.stderr == "windows.script is UTF-16 text: a controller reads UTF-8, save it as that\n"


def test_only_codes_that_exist_can_be_ignored(call):
    result = call("check", "--ignore", "W999", good=GOOD)
    assert result.exit_code == 2
    assert "W999" in result.output
