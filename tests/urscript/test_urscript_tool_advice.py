"""Programs as people get them wrong, and what `urscript check` tells them; a controller is told nothing of it."""

import json
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_trees import WORDS, programs
from tree_printer import print_program
from typer.testing import CliRunner

from urscript.check.checking import RULES, advise, check_program, check_with_advice, first_syntax_error
from urscript.cli import app
from urscript.errors import ScriptSyntaxError
from urscript.program import compile_program
from urscript.source import Source, as_utf8


def body(*lines):
    return "def p():\n" + "".join(f"  {line}\n" for line in lines) + "end\n"


def told(text):
    return [as_utf8(error.headline()).removeprefix("a:") for error in check_with_advice(text, name="a")[0]]


WRONG = {
    "missing end if": (
        body("x = 1", "if x == 1:", "  movej([0,0,0,0,0,0])", "textmsg(x)"),
        "3:3: Syntax error: this 'if' has no 'end' (it seems to belong before line 5)",
    ),
    "missing end while": (
        body("i = 0", "while i < 3:", "  i = i + 1", "textmsg(i)"),
        "3:3: Syntax error: this 'while' has no 'end' (it seems to belong before line 5)",
    ),
    "missing end fn": (
        body("def f(x):", "  return x + 1", "textmsg(f(1))"),
        "2:3: Syntax error: this 'def' has no 'end' (it seems to belong before line 4)",
    ),
    "missing end prog": (
        "def p():\n  textmsg(1)\n",
        "1:1: Syntax error: this 'def' has no 'end' (add 'end' at the end of the program)",
    ),
    "python indent only": (
        "def p():\n  if True:\n    textmsg(1)\n  else:\n    textmsg(2)\n",
        "1:1: Syntax error: this 'def' has no 'end' (add 'end' at the end of the program)",
        "2:3: Syntax error: this 'if' has no 'end' (add 'end' at the end of the program)",
    ),
    "extra end": (
        "def p():\n  textmsg(1)\n  end\nend\n",
        "3:3: Syntax error: this 'end' has no block (remove it)",
    ),
    "endif": (
        body("if True:", "  sync()", "endif"),
        "4:3: Syntax error: there is no 'endif' in URScript (write end)",
    ),
    "end if": (
        body("if True:", "  sync()", "end if"),
        "4:3: Syntax error: a block ends with 'end', not 'end if' (write end)",
    ),
    "missing colon if": (
        body("x = 1", "if x == 1", "  textmsg(x)", "end"),
        "3:11: Syntax error: a ':' is missing after '1' (write if x == 1:)",
    ),
    "missing colon while": (
        body("while True", "  sync()", "end"),
        "2:12: Syntax error: a ':' is missing after 'True' (write while True:)",
    ),
    "missing colon def": (
        "def p()\n  textmsg(1)\nend\n",
        "1:7: Syntax error: a ':' is missing after ')' (write def p():)",
    ),
    "missing colon else": (
        body("if True:", "  textmsg(1)", "else", "  textmsg(2)", "end"),
        "4:6: Syntax error: a ':' is missing after 'else' (write else:)",
    ),
    "missing colon elif": (
        body("x = 1", "if x == 1:", "  textmsg(1)", "elif x == 2", "  textmsg(2)", "end"),
        "5:13: Syntax error: a ':' is missing after '2' (write elif x == 2:)",
    ),
    "missing colon thread": (
        body("thread t()", "  sync()", "end", "run t()"),
        "2:12: Syntax error: a ':' is missing after ')' (write thread t():)",
    ),
    "assign in if": (
        body("x = 1", "if x = 1:", "  textmsg(x)", "end"),
        "3:8: Syntax error: '=' assigns; it does not compare (write ==)",
    ),
    "double assign": (
        body("a = b = 1"),
        "2:9: Syntax error: an assignment has no value (write two assignments)",
    ),
    "unknown name": (
        body("speed = 0.1", "movej([0,0,0,0,0,0], v=sped)"),
        "3:26: Compile error: name 'sped' is not defined (did you mean 'speed'?)",
    ),
    "unknown fn": (
        body("move_j([0,0,0,0,0,0])"),
        "2:3: Compile error: name 'move_j' is not defined (did you mean 'movej'?)",
    ),
    "wrong count": (
        body("movej()", "sleep()", "sin(1, 2)"),
        "2:3: Type error: movej takes exactly 1 to 5 arguments (0 given) (use movej(q, a=1.4, v=1.05, t=0, r=0))",
        "3:3: Type error: sleep takes exactly 1 argument (0 given) (use sleep(t))",
        "4:3: Type error: sin takes exactly 1 argument (2 given) (use sin(f))",
    ),
    "kw typo": (
        body("movej([0,0,0,0,0,0], acc=1.4, vel=1)"),
        "2:24: Type error: movej() got an unexpected keyword argument 'acc' (write a=, use movej(q, a=1.4, v=1.05, t=0, r=0))",
    ),
    "kw case": (
        body("movej([0,0,0,0,0,0], A=1.4)"),
        "2:24: Type error: movej() got an unexpected keyword argument 'A' (write a=, use movej(q, a=1.4, v=1.05, t=0, r=0))",
    ),
    "smart quotes": (
        body("textmsg(“hello”)"),
        '2:11: Lexer exception: “ does not delimit a string (write ")',
    ),
    "single quotes": (
        body("textmsg('hello')"),
        "2:11: Lexer exception: ' does not delimit a string (write \")",
    ),
    "tabs": (
        "def p():\n\tx = 1\n\ttextmsg(y)\nend\n",
        "3:10: Compile error: name 'y' is not defined",
    ),
    "nbsp": (
        body("x =\u00a01", "textmsg(x)"),
        "2:6: Lexer exception: unexpected no-break space (write a space)",
    ),
    "degree": (
        body("movej([90°,0,0,0,0,0])"),
        "2:12: Lexer exception: unexpected character '°'",
    ),
    "unclosed paren": (
        body("textmsg(sin(1)", "textmsg(2)"),
        "2:10: Syntax error: this '(' is never closed (write ) at the end of line 2)",
    ),
    "unclosed paren last": (
        body("textmsg(1"),
        "2:10: Syntax error: this '(' is never closed (write ) at the end of line 2)",
    ),
    "extra paren": (
        body("textmsg(1))", "textmsg(2)"),
        "2:13: Syntax error: this ')' has no '(' (remove it)",
    ),
    "unclosed bracket": (
        body("movej([0,0,0,0,0,0, a=1)", "textmsg(2)"),
        "2:9: Syntax error: this '[' is never closed (write ] before ', a=')",
    ),
    "wrong bracket": (
        body("x = [1, 2)", "textmsg(x)"),
        "2:12: Syntax error: ')' does not close the '[' of 2:7 (write ])",
    ),
    "paren in bracket": (
        body("x = [1, (2]"),
        "2:11: Syntax error: this '(' is never closed (write ) before ])",
    ),
    "value after condition": (
        body("x = 1", "if x 5:", "  sync()", "end"),
        "3:8: Syntax error: unexpected '5', expected ':'",
    ),
    "no value at the end": (
        "x = 1 +\n",
        "1:7: Syntax error: a value is missing after '+'",
    ),
    "else if": (
        body("x = 1", "if x == 1:", "  textmsg(1)", "else if x == 2:", "  textmsg(2)", "end"),
        "5:3: Syntax error: there is no 'else if' in URScript (write elif)",
    ),
    "elseif": (
        body("x = 1", "if x == 1:", "  textmsg(1)", "elseif x == 2:", "  textmsg(2)", "end"),
        "5:3: Syntax error: there is no 'elseif' in URScript (write elif)",
    ),
    "for in": (
        body("for i in range(3):", "  textmsg(i)", "end"),
        "2:3: Syntax error: there is no 'for' in URScript (write i = 0, then while i < n: ... i = i + 1 end)",
    ),
    "for c": (
        body("for (i = 0; i < 3; i = i + 1) {", "  textmsg(i)", "}"),
        "2:3: Lexer exception: there is no 'for' in URScript (write i = 0, then while i < n: ... i = i + 1 end)",
        "4:3: Lexer exception: there is no '}' in URScript (a block begins with ':' and ends with 'end')",
    ),
    "plus eq": (
        body("i = 0", "i += 1", "textmsg(i)"),
        "3:5: Syntax error: there is no '+=' in URScript (write i = i + ...)",
    ),
    "pose comma": (
        body("movel(p[0.1, 0.2 0.3, 0, 0, 0])"),
        "2:20: Syntax error: a ',' is missing before '0.3'",
    ),
    "pose five": (
        body("movel(p[0.1, 0.2, 0.3, 0, 0])"),
        "2:9: Syntax error: a pose has 6 elements, not 5 (write p[x, y, z, rx, ry, rz])",
    ),
    "list comma": (
        body("x = [1, 2 3]", "textmsg(x)"),
        "2:13: Syntax error: a ',' is missing before '3'",
    ),
    "args comma": (
        body("movej([0,0,0,0,0,0] a=1.4)"),
        "2:23: Syntax error: a ',' is missing before 'a'",
    ),
    "args comma2": (
        body("movej([0,0,0,0,0,0], a=1.4 v=1)"),
        "2:30: Syntax error: a ',' is missing before 'v'",
    ),
    "list of lists trailing": (
        body("x = [1, 2,]", "textmsg(x)"),
        "2:12: Syntax error: nothing follows this ',' (remove it)",
    ),
    "print": (
        body('print("hello")'),
        "2:3: Compile error: name 'print' is not defined (write textmsg(...))",
    ),
    "comment slash": (
        body("// go home", "textmsg(1)"),
        "2:3: Syntax error: there is no '//' in URScript (a comment begins with '#')",
    ),
    "comment slash end": (
        body("textmsg(1) // go home"),
        "2:14: Syntax error: there is no '//' in URScript (a comment begins with '#')",
    ),
    "comment star": (
        body("/* go", "home */", "textmsg(1)"),
        "2:3: Syntax error: there is no '/*' in URScript (begin each line of a comment with '#')",
    ),
    "comment dash": (
        body("-- go home", "textmsg(1)"),
        "2:6: Compile error: name 'go' is not defined (a comment begins with '#')",
    ),
    "TRUE": (
        body("x = TRUE", "textmsg(x)"),
        "2:7: Compile error: name 'TRUE' is not defined (write True)",
    ),
    "null": (
        body("x = null", "textmsg(x)"),
        "2:7: Compile error: name 'null' is not defined (write None)",
    ),
    "semicolon": (
        body("x = 1;", "textmsg(x);"),
        "2:8: Lexer exception: there is no ';' in URScript (remove it; statements need no separator)",
        "3:13: Lexer exception: there is no ';' in URScript (remove it; statements need no separator)",
    ),
    "braces": (
        "def p() {\n  textmsg(1)\n}\n",
        "1:9: Lexer exception: there is no '{' in URScript (a block begins with ':' and ends with 'end')",
        "3:1: Lexer exception: there is no '}' in URScript (a block begins with ':' and ends with 'end')",
    ),
    "and amp": (
        body("x = 1", "if x == 1 && True:", "  textmsg(x)", "end"),
        "3:13: Lexer exception: there is no '&&' in URScript (write and)",
    ),
    "or bar": (
        body("x = 1", "if x == 1 || True:", "  textmsg(x)", "end"),
        "3:13: Lexer exception: there is no '||' in URScript (write or)",
    ),
    "power": (
        body("x = 2**3", "textmsg(x)", "y = 2^3", "textmsg(y)"),
        "2:8: Syntax error: there is no '**' in URScript (write pow(a, b))",
        "4:8: Lexer exception: there is no '^' in URScript (write pow(a, b))",
    ),
    "intdiv": (
        body("x = 7//2", "textmsg(x)"),
        "2:8: Syntax error: there is no '//' in URScript (write floor(a / b))",
    ),
    "ne": (
        body("x=1", "if x <> 1:", "  textmsg(1)", "end"),
        "3:8: Syntax error: there is no '<>' in URScript (write !=)",
    ),
    "is none": (
        body("x=1", "if x is None:", "  textmsg(1)", "end"),
        "3:8: Syntax error: there is no 'is' in URScript (write ==)",
    ),
    "not in": (
        body("x=[1]", "if 1 in x:", "  textmsg(1)", "end"),
        "3:8: Syntax error: there is no 'in' in URScript (write a while loop)",
    ),
    "chain": (
        body("x = 1", "if 0 < x < 2:", "  textmsg(x)", "end"),
        "3:12: Syntax error: comparisons cannot be chained (write ... and x < ...)",
    ),
    "ternary": (
        body("x = 1 if True else 2", "textmsg(x)"),
        "2:9: Syntax error: URScript has no conditional expressions (write if ...: x = a else: x = b end)",
    ),
    "lambda": (
        body("f = lambda x: x"),
        "2:7: Syntax error: there is no 'lambda' in URScript (write a def)",
    ),
    "fstring": (
        body("x=1", 'textmsg(f"x {x}")'),
        "3:11: Syntax error: a string has no prefix 'f' (write textmsg(text, x) or str_cat(text, x))",
    ),
    "escape": (
        body('textmsg("say \\"hi\\"")'),
        '2:16: Syntax error: a string cannot contain \\": it ends here (remove the quotation marks)',
    ),
    "string newline": (
        body('textmsg("hello)', "textmsg(2)"),
        "2:11: Lexer exception: unterminated string: no closing '\"' (close it on the same line)",
    ),
    "hex": (
        body("x = 0xFF", "textmsg(x)"),
        '2:7: Lexer exception: URScript has no hexadecimal numbers, got 0xFF (write 255 or to_num("0xFF"))',
    ),
    "unit": (
        body("sleep(5s)"),
        "2:9: Lexer exception: a number has no unit, got 5s (write 5 alone: lengths are in m, times in s, angles in rad)",
    ),
    "dec comma": (
        body("x = 0,5", "textmsg(x)"),
        "2:8: Syntax error: the decimal separator is '.', not ',' (write 0.5)",
    ),
    "tuple": (
        body("x = (1, 2)", "textmsg(x)"),
        "2:7: Syntax error: a list is written in [ ] (write [a, b])",
    ),
    "unpack": (
        body("a, b = 1, 2"),
        "2:3: Syntax error: an assignment sets one variable (write one assignment for each)",
    ),
    "import": (
        "import math\ndef p():\n  textmsg(math.pi)\nend\n",
        "1:1: Compile error: name 'import' is not defined (all functions are available; remove the line)",
        "3:11: Compile error: name 'math' is not defined (mathematical functions have no prefix: sqrt(x), sin(x))",
    ),
    "math pi": (
        body("textmsg(pi)", "x = math.sin(1)", "textmsg(x)"),
        "2:11: Compile error: name 'pi' is not defined (write 3.141592653589793)",
        "3:7: Compile error: name 'math' is not defined (mathematical functions have no prefix: write sin(...))",
    ),
    "len": (
        body("x=[1]", "textmsg(len(x))"),
        "3:11: Compile error: name 'len' is not defined (write length(...))",
    ),
    "int decl": (
        body("int x = 1", "textmsg(x)"),
        "2:3: Compile error: name 'int' is not defined (URScript has no type declarations: write x = ...)",
    ),
    "reserved": (
        body("end = 3", "textmsg(end)"),
        "2:3: Syntax error: 'end' is a reserved word and cannot be a name (choose another name, for example my_end)",
        "3:11: Syntax error: 'end' is a reserved word and cannot be a name (choose another name, for example my_end)",
    ),
    "reserved2": (
        body("run = 3", "textmsg(run)"),
        "2:3: Syntax error: 'run' is a reserved word and cannot be a name (choose another name, for example my_run)",
        "3:11: Syntax error: 'run' is a reserved word and cannot be a name (choose another name, for example my_run)",
    ),
    "run def": (
        body("thread t(x):", "  sync()", "end", "run t(1)"),
        "2:12: Syntax error: a thread takes no parameters (pass values in global variables)",
        "5:9: Syntax error: a thread takes no parameters (pass values in global variables)",
    ),
    "return type": (
        "def p() -> int:\n  textmsg(1)\nend\n",
        "1:9: Syntax error: a function has no return type (remove it)",
    ),
    "function kw": (
        "function p():\n  sync()\nend\n",
        "1:1: Syntax error: there is no 'function' in URScript (write def)",
    ),
    "do": (
        body("while True do", "  sync()", "end"),
        "2:14: Syntax error: there is no 'do' in URScript (write ':')",
    ),
    "then": (
        body("if True then", "  sync()", "end"),
        "2:11: Syntax error: there is no 'then' in URScript (write ':')",
    ),
    "switch": (
        body("x = 1", "switch x:", "case 1:", "  textmsg(1)", "end"),
        "3:3: Syntax error: there is no 'switch' in URScript (write if, elif and else)",
        "4:3: Syntax error: there is no 'case' in URScript (write if, elif and else)",
    ),
    "try": (
        body("try:", "  x = 1", "except:", "  x = 2", "end"),
        "2:3: Syntax error: there is no 'try' in URScript (an error ends the program; check conditions before)",
        "4:3: Syntax error: there is no 'except' in URScript (an error ends the program; check conditions before)",
    ),
    "run without parentheses": (
        body("thread watch():", "  sync()", "end", "w = run watch", "kill w", "run watch"),
        "5:11: Syntax error: 'run' needs parentheses after the name (write run watch())",
        "7:7: Syntax error: 'run' needs parentheses after the name (write run watch())",
    ),
    "keywords called": (
        body("if True:", "  halt()", "end", "while True:", "  break ( )", "end", "kill()", "nothing()"),
        "3:5: Syntax error: 'halt' is a statement, not a function (write halt)",
        "6:5: Syntax error: 'break' is a statement, not a function (write break)",
        "8:3: Syntax error: 'kill' needs a thread (write kill t, with t = run name())",
        "9:3: Compile error: name 'nothing' is not defined",
    ),
    "kill of a thread's name": (
        body("thread watch():", "end", "thread other():", "end", "w = run watch()", "kill watch", "join(other)", "join w()"),
        "7:8: Compile error: name 'watch' is not defined (write kill w, the handle of this thread)",
        "8:8: Compile error: name 'other' is not defined (write t = run other(), then join t)",
        "9:8: Compile error: name 'w' is not defined (write join w)",
    ),
    "def call as value": (
        body("x = get_actual_tcp_pose", "textmsg(x)"),
        "2:7: Compile error: name 'get_actual_tcp_pose' is not defined ('get_actual_tcp_pose' is a function, call it as get_actual_tcp_pose(...))",
    ),
    "self call missing paren": (
        body("sync"),
        "2:3: Compile error: name 'sync' is not defined ('sync' is a function, call it as sync(...))",
    ),
    "wait": (
        body("wait(1)", "delay(2)"),
        "2:3: Compile error: name 'wait' is not defined (write sleep(...))",
        "3:3: Compile error: name 'delay' is not defined (write sleep(...))",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_programs_get_the_place_and_what_to_write(name):
    text, *expected = WRONG[name]
    assert told(text) == expected


@pytest.mark.parametrize("name", WRONG)
def test_the_controller_says_where_the_parser_noticed(name):
    """What is told to people changes nothing of what is sent to clients."""
    text = WRONG[name][0]
    with pytest.raises(Exception) as caught:  # noqa: PT011 - whichever it is, it is the first of check_program
        compile_program(text)
    first = check_program(text)[0][0]
    assert (caught.value.line, caught.value.column, caught.value.message) == (
        first.line,
        first.column,
        first.message,
    )


def test_every_rule_knows_a_program_of_the_table():
    known = set()
    for text, *_ in WRONG.values():
        while (error := first_syntax_error(Source(text))) is not None:
            advice = advise(text, error)
            if advice is None or not advice.edits:
                break
            known.add(advice.message)
            for edit in sorted(advice.edits, reverse=True):
                text = text[: edit.start] + edit.new + text[edit.end :]
    assert len(RULES) <= len(known)


def test_all_errors_are_found_in_one_pass_with_their_own_lines():
    text = body(
        "x = 1;",
        "if x = 1",
        "  textmsg(x",
        "else if x == 2:",
        "  movej([0, 0 0, 0, 0, 0], acc=1)",
        "end",
        "for i in range(3):",
        "  x += 1",
        "end",
        "while x < 3",
        "  print(x)",
        "end",
        "textmsg('a')",
        "texmsg(y)",
    )
    lines = [line.split(":")[0] for line in told(text)]
    assert lines == ["2", "3", "4", "5", "6", "8", "9", "11", "12", "14", "15"]


def test_names_are_looked_up_beside_syntax_errors():
    assert told(body("x = 1;", "if y == 1", "  print(x)", "end")) == [
        "2:8: Lexer exception: there is no ';' in URScript (remove it; statements need no separator)",
        "3:11: Syntax error: a ':' is missing after '1' (write if y == 1:)",
        "4:5: Compile error: name 'print' is not defined (write textmsg(...))",
    ]


def test_constant_values_are_looked_at_beside_errors_of_all_kinds():
    lines = (
        "movej([90, 0, 0, 0, 0, 0])",
        "texmsg(1)",
        "halt() movel(p[400, 0, 0, 0, 0, 0])",
        "x = 1",
        "servoj([0, 0], 1)",
    )
    errors, warnings = check_with_advice(body(*lines), name="a")
    assert [(error.line, error.column) for error in errors] == [(3, 3), (4, 3)]
    # Not of the line that was repaired, nor what may follow from an error: x, which is never read.
    assert [(warning.line, warning.rule.code) for warning in warnings] == [(2, "W117"), (6, "W116")]
    assert [warning.source.text for warning in warnings] == 2 * [body(*lines)]
    for others in (("movej(1, 2, 3, 4, 5, 6, 7)",), ("halt()", "x = 1")):
        _, warnings = check_with_advice(body(lines[0], *others))
        assert [(warning.line, warning.rule.code) for warning in warnings] == [(2, "W117")]


def test_errors_and_warnings_are_shown_in_the_order_of_the_text(tmp_path):
    file = tmp_path / "a.script"
    file.write_text(body("movej([90, 0, 0, 0, 0, 0])", "halt()", "movel(p[400, 0, 0, 0, 0, 0])", "texmsg(1)"))
    shown = CliRunner().invoke(app, ["check", str(file)]).output
    assert re.findall(r"script:(\d+):\d+: (\w+)", shown) == [
        ("2", "Warning"),
        ("3", "Syntax"),
        ("4", "Warning"),
        ("5", "Compile"),
    ]
    shown = CliRunner().invoke(app, ["check", "--json", "--ignore", "W118", str(file)]).output
    assert [one["line"] for one in json.loads(shown)["diagnostics"]] == [2, 3, 5]


def test_names_of_what_had_to_be_left_out_are_not_missed():
    assert len(told(body("for i in [1, 2]:", "  textmsg(i)", "end"))) == 1


def test_carets_stand_below_characters_of_several_bytes():
    (error,), _ = check_with_advice(body('textmsg("\u00e4\u00f6\u00fc", y)'))
    assert as_utf8(error.render()).split("\n")[1:] == [
        '      textmsg("\u00e4\u00f6\u00fc", y)',
        "                     ^",
    ]


def test_the_same_words_when_a_wrong_program_is_run_or_laid_out(tmp_path):
    file = tmp_path / "a.script"
    file.write_text(body("x = 1", "if x == 1", "  sync()", "end"))
    for command in ("check", "run", "fmt"):
        result = CliRunner().invoke(app, [command, str(file)])
        assert result.exit_code == 1
        assert "a.script:3:11: Syntax error: a ':' is missing after '1'" in result.output


# --- any text --------------------------------------------------------------------------------------------

FOREIGN = """
elseif for in then do && || += ++ // /* 5s 1,5 lambda \u201c \xe2\x80\x9c \xb0 -> := <>
"""


def assert_reports(text):
    errors, warnings = check_with_advice(text)
    assert bool(errors) == bool(check_program(text)[0])
    n_lines = text.count("\n") + 1
    for error in (*errors, *warnings):
        assert 1 <= error.line <= n_lines
        assert error.column >= 1
        assert error.message
        assert error.render()
    lines = [error.line for error in errors if isinstance(error, ScriptSyntaxError)]
    assert lines == sorted(set(lines))


@given(st.lists(st.sampled_from([*WORDS, *FOREIGN.split(), "\n", "\t"]), max_size=30).map(" ".join))
def test_any_words_get_diagnostics(text):
    assert_reports(text)


@given(st.text(st.characters(max_codepoint=255), max_size=60))
def test_any_bytes_get_diagnostics(text):
    assert_reports(text)


@settings(max_examples=50)
@given(programs, st.data())
def test_an_incomplete_program_gets_diagnostics(tree, data):
    text = print_program(tree)
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(len(text), start + 8)))
    put = data.draw(st.sampled_from(["", " ", "\n", ";", "=", ")", "end", "x"]))
    assert_reports(text[:start] + put + text[end:])


@settings(max_examples=50)
@given(programs)
def test_a_program_without_syntax_errors_meets_no_rule(tree):
    text = print_program(tree)
    assert [item.message for item in check_with_advice(text)[0]] == [
        item.message for item in check_program(text)[0]
    ]
