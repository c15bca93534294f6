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
from urscript.check.checking import RULES as SYNTAX_RULES
from urscript.check.checking import advise, check_program, check_with_advice, first_syntax_error
from urscript.check.warnings import RULES
from urscript.cli import app
from urscript.source import Source, as_utf8

# --- wrong programs --------------------------------------------------------------------------------------


def told(text):
    return [as_utf8(error.headline()).removeprefix("a:") for error in check_with_advice(text, name="a")[0]]


WRONG = {
    "missing end if": (
        program_of("x = 1", "if x == 1:", "  movej([0,0,0,0,0,0])", "textmsg(x)"),
        "3:3: Syntax error: this 'if' has no 'end' (it seems to belong before line 5)",
    ),
    "missing end while": (
        program_of("i = 0", "while i < 3:", "  i = i + 1", "textmsg(i)"),
        "3:3: Syntax error: this 'while' has no 'end' (it seems to belong before line 5)",
    ),
    "missing end fn": (
        program_of("def f(x):", "  return x + 1", "textmsg(f(1))"),
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
        program_of("if True:", "  sync()", "endif"),
        "4:3: Syntax error: there is no 'endif' in URScript (write end)",
    ),
    "end if": (
        program_of("if True:", "  sync()", "end if"),
        "4:3: Syntax error: a block ends with 'end', not 'end if' (write end)",
    ),
    "missing colon if": (
        program_of("x = 1", "if x == 1", "  textmsg(x)", "end"),
        "3:11: Syntax error: a ':' is missing after '1' (write if x == 1:)",
    ),
    "missing colon while": (
        program_of("while True", "  sync()", "end"),
        "2:12: Syntax error: a ':' is missing after 'True' (write while True:)",
    ),
    "missing colon def": (
        "def p()\n  textmsg(1)\nend\n",
        "1:7: Syntax error: a ':' is missing after ')' (write def p():)",
    ),
    "missing colon else": (
        program_of("if True:", "  textmsg(1)", "else", "  textmsg(2)", "end"),
        "4:6: Syntax error: a ':' is missing after 'else' (write else:)",
    ),
    "missing colon elif": (
        program_of("x = 1", "if x == 1:", "  textmsg(1)", "elif x == 2", "  textmsg(2)", "end"),
        "5:13: Syntax error: a ':' is missing after '2' (write elif x == 2:)",
    ),
    "missing colon thread": (
        program_of("thread t()", "  sync()", "end", "run t()"),
        "2:12: Syntax error: a ':' is missing after ')' (write thread t():)",
    ),
    "assign in if": (
        program_of("x = 1", "if x = 1:", "  textmsg(x)", "end"),
        "3:8: Syntax error: '=' assigns; it does not compare (write ==)",
    ),
    "double assign": (
        program_of("a = b = 1"),
        "2:9: Syntax error: an assignment has no value (write two assignments)",
    ),
    "unknown name": (
        program_of("speed = 0.1", "movej([0,0,0,0,0,0], v=sped)"),
        "3:26: Compile error: name 'sped' is not defined (did you mean 'speed'?)",
    ),
    "unknown fn": (
        program_of("move_j([0,0,0,0,0,0])"),
        "2:3: Compile error: name 'move_j' is not defined (did you mean 'movej'?)",
    ),
    "wrong count": (
        program_of("movej()", "sleep()", "sin(1, 2)"),
        "2:3: Type error: movej takes exactly 1 to 5 arguments (0 given) (use movej(q, a=1.4, v=1.05, t=0, r=0))",
        "3:3: Type error: sleep takes exactly 1 argument (0 given) (use sleep(t))",
        "4:3: Type error: sin takes exactly 1 argument (2 given) (use sin(f))",
    ),
    "kw typo": (
        program_of("movej([0,0,0,0,0,0], acc=1.4, vel=1)"),
        "2:24: Type error: movej() got an unexpected keyword argument 'acc' (write a=, use movej(q, a=1.4, v=1.05, t=0, r=0))",
    ),
    "kw case": (
        program_of("movej([0,0,0,0,0,0], A=1.4)"),
        "2:24: Type error: movej() got an unexpected keyword argument 'A' (write a=, use movej(q, a=1.4, v=1.05, t=0, r=0))",
    ),
    "smart quotes": (
        program_of("textmsg(“hello”)"),
        '2:11: Lexer exception: “ does not delimit a string (write ")',
    ),
    "single quotes": (
        program_of("textmsg('hello')"),
        "2:11: Lexer exception: ' does not delimit a string (write \")",
    ),
    "tabs": (
        "def p():\n\tx = 1\n\ttextmsg(y)\nend\n",
        "3:10: Compile error: name 'y' is not defined",
    ),
    "nbsp": (
        program_of("x =\u00a01", "textmsg(x)"),
        "2:6: Lexer exception: unexpected no-break space (write a space)",
    ),
    "degree": (
        program_of("movej([90°,0,0,0,0,0])"),
        "2:12: Lexer exception: unexpected character '°'",
    ),
    "unclosed paren": (
        program_of("textmsg(sin(1)", "textmsg(2)"),
        "2:10: Syntax error: this '(' is never closed (write ) at the end of line 2)",
    ),
    "unclosed paren last": (
        program_of("textmsg(1"),
        "2:10: Syntax error: this '(' is never closed (write ) at the end of line 2)",
    ),
    "extra paren": (
        program_of("textmsg(1))", "textmsg(2)"),
        "2:13: Syntax error: this ')' has no '(' (remove it)",
    ),
    "unclosed bracket": (
        program_of("movej([0,0,0,0,0,0, a=1)", "textmsg(2)"),
        "2:9: Syntax error: this '[' is never closed (write ] before ', a=')",
    ),
    "wrong bracket": (
        program_of("x = [1, 2)", "textmsg(x)"),
        "2:12: Syntax error: ')' does not close the '[' of 2:7 (write ])",
    ),
    "paren in bracket": (
        program_of("x = [1, (2]"),
        "2:11: Syntax error: this '(' is never closed (write ) before ])",
    ),
    "value after condition": (
        program_of("x = 1", "if x 5:", "  sync()", "end"),
        "3:8: Syntax error: unexpected '5', expected ':'",
    ),
    "no value at the end": (
        "x = 1 +\n",
        "1:7: Syntax error: a value is missing after '+'",
    ),
    "else if": (
        program_of("x = 1", "if x == 1:", "  textmsg(1)", "else if x == 2:", "  textmsg(2)", "end"),
        "5:3: Syntax error: there is no 'else if' in URScript (write elif)",
    ),
    "elseif": (
        program_of("x = 1", "if x == 1:", "  textmsg(1)", "elseif x == 2:", "  textmsg(2)", "end"),
        "5:3: Syntax error: there is no 'elseif' in URScript (write elif)",
    ),
    "for in": (
        program_of("for i in range(3):", "  textmsg(i)", "end"),
        "2:3: Syntax error: there is no 'for' in URScript (write i = 0, then while i < n: ... i = i + 1 end)",
    ),
    "for c": (
        program_of("for (i = 0; i < 3; i = i + 1) {", "  textmsg(i)", "}"),
        "2:3: Lexer exception: there is no 'for' in URScript (write i = 0, then while i < n: ... i = i + 1 end)",
        "4:3: Lexer exception: there is no '}' in URScript (a block begins with ':' and ends with 'end')",
    ),
    "plus eq": (
        program_of("i = 0", "i += 1", "textmsg(i)"),
        "3:5: Syntax error: there is no '+=' in URScript (write i = i + ...)",
    ),
    "pose comma": (
        program_of("movel(p[0.1, 0.2 0.3, 0, 0, 0])"),
        "2:20: Syntax error: a ',' is missing before '0.3'",
    ),
    "pose five": (
        program_of("movel(p[0.1, 0.2, 0.3, 0, 0])"),
        "2:9: Syntax error: a pose has 6 elements, not 5 (write p[x, y, z, rx, ry, rz])",
    ),
    "list comma": (
        program_of("x = [1, 2 3]", "textmsg(x)"),
        "2:13: Syntax error: a ',' is missing before '3'",
    ),
    "args comma": (
        program_of("movej([0,0,0,0,0,0] a=1.4)"),
        "2:23: Syntax error: a ',' is missing before 'a'",
    ),
    "args comma2": (
        program_of("movej([0,0,0,0,0,0], a=1.4 v=1)"),
        "2:30: Syntax error: a ',' is missing before 'v'",
    ),
    "list of lists trailing": (
        program_of("x = [1, 2,]", "textmsg(x)"),
        "2:12: Syntax error: nothing follows this ',' (remove it)",
    ),
    "print": (
        program_of('print("hello")'),
        "2:3: Compile error: name 'print' is not defined (write textmsg(...))",
    ),
    "comment slash": (
        program_of("// go home", "textmsg(1)"),
        "2:3: Syntax error: there is no '//' in URScript (a comment begins with '#')",
    ),
    "comment slash end": (
        program_of("textmsg(1) // go home"),
        "2:14: Syntax error: there is no '//' in URScript (a comment begins with '#')",
    ),
    "comment star": (
        program_of("/* go", "home */", "textmsg(1)"),
        "2:3: Syntax error: there is no '/*' in URScript (begin each line of a comment with '#')",
    ),
    "comment dash": (
        program_of("-- go home", "textmsg(1)"),
        "2:6: Compile error: name 'go' is not defined (a comment begins with '#')",
    ),
    "TRUE": (
        program_of("x = TRUE", "textmsg(x)"),
        "2:7: Compile error: name 'TRUE' is not defined (write True)",
    ),
    "null": (
        program_of("x = null", "textmsg(x)"),
        "2:7: Compile error: name 'null' is not defined (write None)",
    ),
    "semicolon": (
        program_of("x = 1;", "textmsg(x);"),
        "2:8: Lexer exception: there is no ';' in URScript (remove it; statements need no separator)",
        "3:13: Lexer exception: there is no ';' in URScript (remove it; statements need no separator)",
    ),
    "braces": (
        "def p() {\n  textmsg(1)\n}\n",
        "1:9: Lexer exception: there is no '{' in URScript (a block begins with ':' and ends with 'end')",
        "3:1: Lexer exception: there is no '}' in URScript (a block begins with ':' and ends with 'end')",
    ),
    "and amp": (
        program_of("x = 1", "if x == 1 && True:", "  textmsg(x)", "end"),
        "3:13: Lexer exception: there is no '&&' in URScript (write and)",
    ),
    "or bar": (
        program_of("x = 1", "if x == 1 || True:", "  textmsg(x)", "end"),
        "3:13: Lexer exception: there is no '||' in URScript (write or)",
    ),
    "power": (
        program_of("x = 2**3", "textmsg(x)", "y = 2^3", "textmsg(y)"),
        "2:8: Syntax error: there is no '**' in URScript (write pow(a, b))",
        "4:8: Lexer exception: there is no '^' in URScript (write pow(a, b))",
    ),
    "intdiv": (
        program_of("x = 7//2", "textmsg(x)"),
        "2:8: Syntax error: there is no '//' in URScript (write floor(a / b))",
    ),
    "ne": (
        program_of("x=1", "if x <> 1:", "  textmsg(1)", "end"),
        "3:8: Syntax error: there is no '<>' in URScript (write !=)",
    ),
    "is none": (
        program_of("x=1", "if x is None:", "  textmsg(1)", "end"),
        "3:8: Syntax error: there is no 'is' in URScript (write ==)",
    ),
    "not in": (
        program_of("x=[1]", "if 1 in x:", "  textmsg(1)", "end"),
        "3:8: Syntax error: there is no 'in' in URScript (write a while loop)",
    ),
    "chain": (
        program_of("x = 1", "if 0 < x < 2:", "  textmsg(x)", "end"),
        "3:12: Syntax error: comparisons cannot be chained (write ... and x < ...)",
    ),
    "ternary": (
        program_of("x = 1 if True else 2", "textmsg(x)"),
        "2:9: Syntax error: URScript has no conditional expressions (write if ...: x = a else: x = b end)",
    ),
    "lambda": (
        program_of("f = lambda x: x"),
        "2:7: Syntax error: there is no 'lambda' in URScript (write a def)",
    ),
    "fstring": (
        program_of("x=1", 'textmsg(f"x {x}")'),
        "3:11: Syntax error: a string has no prefix 'f' (write textmsg(text, x) or str_cat(text, x))",
    ),
    "escape": (
        program_of('textmsg("say \\"hi\\"")'),
        '2:16: Syntax error: a string cannot contain \\": it ends here (remove the quotation marks)',
    ),
    "string newline": (
        program_of('textmsg("hello)', "textmsg(2)"),
        "2:11: Lexer exception: unterminated string: no closing '\"' (close it on the same line)",
    ),
    "hex": (
        program_of("x = 0xFF", "textmsg(x)"),
        '2:7: Lexer exception: URScript has no hexadecimal numbers, got 0xFF (write 255 or to_num("0xFF"))',
    ),
    "unit": (
        program_of("sleep(5s)"),
        "2:9: Lexer exception: a number has no unit, got 5s (write 5 alone: lengths are in m, times in s, angles in rad)",
    ),
    "dec comma": (
        program_of("x = 0,5", "textmsg(x)"),
        "2:8: Syntax error: the decimal separator is '.', not ',' (write 0.5)",
    ),
    "tuple": (
        program_of("x = (1, 2)", "textmsg(x)"),
        "2:7: Syntax error: a list is written in [ ] (write [a, b])",
    ),
    "unpack": (
        program_of("a, b = 1, 2"),
        "2:3: Syntax error: an assignment sets one variable (write one assignment for each)",
    ),
    "import": (
        "import math\ndef p():\n  textmsg(math.pi)\nend\n",
        "1:1: Compile error: name 'import' is not defined (all functions are available; remove the line)",
        "3:11: Compile error: name 'math' is not defined (mathematical functions have no prefix: sqrt(x), sin(x))",
    ),
    "math pi": (
        program_of("textmsg(pi)", "x = math.sin(1)", "textmsg(x)"),
        "2:11: Compile error: name 'pi' is not defined (write 3.141592653589793)",
        "3:7: Compile error: name 'math' is not defined (mathematical functions have no prefix: write sin(...))",
    ),
    "len": (
        program_of("x=[1]", "textmsg(len(x))"),
        "3:11: Compile error: name 'len' is not defined (write length(...))",
    ),
    "int decl": (
        program_of("int x = 1", "textmsg(x)"),
        "2:3: Compile error: name 'int' is not defined (URScript has no type declarations: write x = ...)",
    ),
    "reserved": (
        program_of("end = 3", "textmsg(end)"),
        "2:3: Syntax error: 'end' is a reserved word and cannot be a name (choose another name, for example my_end)",
        "3:11: Syntax error: 'end' is a reserved word and cannot be a name (choose another name, for example my_end)",
    ),
    "reserved2": (
        program_of("run = 3", "textmsg(run)"),
        "2:3: Syntax error: 'run' is a reserved word and cannot be a name (choose another name, for example my_run)",
        "3:11: Syntax error: 'run' is a reserved word and cannot be a name (choose another name, for example my_run)",
    ),
    "run def": (
        program_of("thread t(x):", "  sync()", "end", "run t(1)"),
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
        program_of("while True do", "  sync()", "end"),
        "2:14: Syntax error: there is no 'do' in URScript (write ':')",
    ),
    "then": (
        program_of("if True then", "  sync()", "end"),
        "2:11: Syntax error: there is no 'then' in URScript (write ':')",
    ),
    "switch": (
        program_of("x = 1", "switch x:", "case 1:", "  textmsg(1)", "end"),
        "3:3: Syntax error: there is no 'switch' in URScript (write if, elif and else)",
        "4:3: Syntax error: there is no 'case' in URScript (write if, elif and else)",
    ),
    "try": (
        program_of("try:", "  x = 1", "except:", "  x = 2", "end"),
        "2:3: Syntax error: there is no 'try' in URScript (an error ends the program; check conditions before)",
        "4:3: Syntax error: there is no 'except' in URScript (an error ends the program; check conditions before)",
    ),
    "run without parentheses": (
        program_of("thread watch():", "  sync()", "end", "w = run watch", "kill w", "run watch"),
        "5:11: Syntax error: 'run' needs parentheses after the name (write run watch())",
        "7:7: Syntax error: 'run' needs parentheses after the name (write run watch())",
    ),
    "keywords called": (
        program_of("if True:", "  halt()", "end", "while True:", "  break ( )", "end", "kill()", "nothing()"),
        "3:5: Syntax error: 'halt' is a statement, not a function (write halt)",
        "6:5: Syntax error: 'break' is a statement, not a function (write break)",
        "8:3: Syntax error: 'kill' needs a thread (write kill t, with t = run name())",
        "9:3: Compile error: name 'nothing' is not defined",
    ),
    "kill of a thread's name": (
        program_of("thread watch():", "end", "thread other():", "end", "w = run watch()", "kill watch", "join(other)", "join w()"),
        "7:8: Compile error: name 'watch' is not defined (write kill w, the handle of this thread)",
        "8:8: Compile error: name 'other' is not defined (write t = run other(), then join t)",
        "9:8: Compile error: name 'w' is not defined (write join w)",
    ),
    "def call as value": (
        program_of("x = get_actual_tcp_pose", "textmsg(x)"),
        "2:7: Compile error: name 'get_actual_tcp_pose' is not defined ('get_actual_tcp_pose' is a function, call it as get_actual_tcp_pose(...))",
    ),
    "self call missing paren": (
        program_of("sync"),
        "2:3: Compile error: name 'sync' is not defined ('sync' is a function, call it as sync(...))",
    ),
    "wait": (
        program_of("wait(1)", "delay(2)"),
        "2:3: Compile error: name 'wait' is not defined (write sleep(...))",
        "3:3: Compile error: name 'delay' is not defined (write sleep(...))",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_programs_get_the_place_and_what_to_write(name):
    text, *expected = WRONG[name]
    assert told(text) == expected


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
    assert len(SYNTAX_RULES) <= len(known)


def test_all_errors_are_found_in_one_pass_with_their_own_lines():
    text = program_of(
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
    assert told(program_of("x = 1;", "if y == 1", "  print(x)", "end")) == [
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
    errors, warnings = check_with_advice(program_of(*lines), name="a")
    assert [(error.line, error.column) for error in errors] == [(3, 3), (4, 3)]
    # Not of the line that was repaired, nor what may follow from an error: x, which is never read.
    assert [(warning.line, warning.rule.code) for warning in warnings] == [(2, "W117"), (6, "W116")]
    assert [warning.source.text for warning in warnings] == 2 * [program_of(*lines)]
    for others in (("movej(1, 2, 3, 4, 5, 6, 7)",), ("halt()", "x = 1")):
        _, warnings = check_with_advice(program_of(lines[0], *others))
        assert [(warning.line, warning.rule.code) for warning in warnings] == [(2, "W117")]


def test_names_of_what_had_to_be_left_out_are_not_missed():
    assert len(told(program_of("for i in [1, 2]:", "  textmsg(i)", "end"))) == 1


def test_carets_stand_below_characters_of_several_bytes():
    (error,), _ = check_with_advice(program_of('textmsg("\u00e4\u00f6\u00fc", y)'))
    assert as_utf8(error.render()).split("\n")[1:] == [
        '      textmsg("\u00e4\u00f6\u00fc", y)',
        "                     ^",
    ]


# --- warnings --------------------------------------------------------------------------------------------


def warnings_of(text, *codes):
    errors, warnings = check_program(text)
    assert not errors, errors
    return [
        f"{warning.line}:{warning.column} {warning.message}"
        for warning in warnings
        if not codes or warning.rule.code in codes
    ]


WARNED = {
    "W101": [
        (program_of("global x = 1"), "2:10 global variable 'x' is never read"),
        (program_of("x = [1]", "x[0] = 2"), "2:3 global variable 'x' is never read"),
        (program_of("global x"), "2:10 global variable 'x' is never read"),
        (program_of("def f():", "x = 1", "textmsg(x)", "end", "f()", "if False:", "global y = 0", "end"), "8:10 global variable 'y' is never read"),
    ],
    "W102": [(program_of("def f():", "local x = 1", "y = 2", "return y", "end", "f()"), "3:9 local variable 'x' is never read")],
    "W103": [(program_of("def f(a, b=a):", "return b", "end", "a = 2", "f(a)"), "2:9 parameter 'a' of 'f' is never read"), (program_of("def f(a, b=1):", "a = 2", "return a", "end", "f(1)"), "2:12 parameter 'b' of 'f' is never read")],
    "W104": [
        (program_of("def f():", "end"), "2:7 function 'f' is never called"),
        (program_of("def f():", "f()", "end"), "2:7 function 'f' is never called"),
    ],
    "W105": [(program_of("thread  t():", "sync()", "end"), "2:11 thread 't' is never run")],
    "W106": [
        (program_of("while (True):", "x = 1", "end"), "2:3 this loop takes no time"),
        (program_of("while not False:", "while True:", "break", "end", "end"), "2:3 this loop takes no time"),
        (program_of("while not get_digital_in(0):", "end"), "2:3 this loop takes no time"),
        (program_of("while True:", "if get_digital_in(0):", "break", "end", "end"), "2:3 this loop takes no time"),
        (program_of("def f():", "set_flag(0, True)", "end", "while True:", "f()", "end"), "5:3 this loop takes no time"),
    ],
    "W107": [
        (program_of("r = socket_read_ascii_float(2)", "textmsg(r[1])"), "2:7 the number of received values is never checked: r[0]"),
        (program_of("textmsg(socket_read_byte_list(2)[1])"), "2:11 the number of received values is never checked"),
        (program_of("def f():", "local r = socket_read_binary_integer(1)", "return r[1]", "end", "r = [0]", "textmsg(r[0], f())"), "3:13 the number of received values is never checked"),
    ],
    "W108": [
        (program_of("def f():", "return 1", "textmsg(2)", "end", "f()"), "4:3 unreachable code: it follows return"),
        (program_of("halt", "$ 1", "def f():", "end", "f()"), "6:3 unreachable code: it follows halt"),
        (program_of("while True:", "if True:", "break", "textmsg(1)", "end", "sync()", "end"), "5:3 unreachable code: it follows break"),
        (program_of("while True:", "sync()", "end", "if get_flag(0):", "end"), "5:3 unreachable code: it follows an endless loop"),
        (program_of("if get_flag(0):", "halt", "else:", "halt", "end", "textmsg(1)"), "7:3 unreachable code: it follows an if whose branches all leave"),
    ],
    "W109": [
        (program_of("force = 1", "textmsg(force)"), "2:3 variable 'force' hides the builtin"),
        (program_of("def sync():", "end", "sync()"), "2:7 function 'sync' hides the builtin"),
        (program_of("def f(force):", "return force", "end", "f(1)"), "2:9 parameter 'force' hides the builtin"),
        (program_of("def f():", "a_joint_default = 2", "return a_joint_default", "end", "f()"), "3:3 variable 'a_joint_default' hides the builtin"),
    ],
    "W110": [
        (program_of("if True:", "elif get_flag(0):", "end"), "3:3 this branch is never reached: the condition of line 2 is always true"),
        (program_of("if get_flag(0):", "elif 1 == 1:", "else:", "halt", "end"), "5:3 this branch is never reached: the condition of line 3 is always true"),
        (program_of("x = 1", "if x == 1:", "elif x == 2:", "elif x == 1:", "end"), "5:3 this branch is never reached: the condition of line 3 is the same"),
    ],
    "W111": [(program_of("def f():", "end", "def f():", "end", "f()"), "2:7 'f' is defined twice here; the last definition is used")],
    "W112": [(program_of("def f():", "end", "run f()"), "4:3 'f' is run as a thread but defined with 'def'")],
    "W114": [
        (program_of("x = 0", "x == 1", "textmsg(x)"), "3:3 the result of this comparison is not used"),
        (program_of("i = 0", "i++", "textmsg(i)"), "3:3 a value is computed and not used"),
        (program_of('"text"'), "2:3 a value is computed and not used"),
    ],
    "W116": [
        (program_of("movej([0, -1.57, 0 -1.57, 0, 0])"), "2:9 movej: Parameter 'q' must be a Pose on the form p[x,y,z,a,b,c] or a list of 6 joint positions, got a list of 5"),
        (program_of("home = [0, -1.57, 0]", "movej(home)"), "3:9 movej: Parameter 'q' must be"),
        (program_of("x = 1", "movej([x, x, x], a=1)"), "3:9 movej: Parameter 'q' must be"),
        (program_of("set_tcp([0, 0, 0, 0, 0, 0])"), "2:11 set_tcp: Parameter must be a Pose on the form p[x,y,z,a,b,c]"),
        (program_of('sleep("1")'), "2:9 sleep: Parameter 't' must be a number"),
        (program_of("set_standard_digital_out(9, True)"), "2:28 set_standard_digital_out: Parameter 'n' must be in the range 0 to 7, got 9"),
        (program_of("set_standard_digital_out(0, 1)"), "2:31 set_standard_digital_out: Parameter 'b' must be True or False, got the int 1"),
    ],
    "W119": [
        (program_of("def f(a, b=0):", "return a", "end", "if False:", "x = f()", "end"), "6:7 f takes exactly 1 or 2 arguments (0 given)"),
        (program_of("def f():", "end", "f(1)"), "4:3 f takes exactly 0 arguments (1 given)"),
    ],
    "W117": [
        (program_of("movej([90, -90, 0, 0, 0, 0])"), "2:9 movej: joint 0 at 90 rad is 5157 degrees"),
        (program_of("home = [0, -90, 0, 0, 0, 0]", "movej(home)"), "3:9 movej: joint 1 at -90 rad is -5157 degrees"),
        (program_of("def f():", "local q = [0, 0, 0, 0, 0, 45]", "servoj(q)", "end", "f()"), "4:10 servoj: joint 5 at 45 rad is 2578 degrees"),
        (program_of("movej([0, -1.57, 0, 0, 0, 0], v=60)"), "2:35 movej: 60 rad/s is faster than any joint"),
        (program_of("speedj([0, -30, 0, 0, 0, 0], 1.4)"), "2:10 speedj: -30 rad/s is faster than any joint"),
        (program_of("movel(p[0.4, 0, 0.2, 0, 180, 0])"), "2:9 movel: a rotation vector with 180 rad is more than a turn"),
    ],
    "W118": [
        (program_of("movel(p[400, -100, 200, 0, 3.14, 0])"), "2:9 movel: 400 m is farther than any arm reaches"),
        (program_of("movej(p[0.4, -100, 0.2, 0, 3.14, 0])"), "2:9 movej: -100 m is farther than any arm reaches"),
        (program_of("set_tcp(p[0, 0, 120, 0, 0, 0])"), "2:11 set_tcp: 120 m is farther than any arm reaches"),
        (program_of("set_payload(1.5, [0, 0, 50])"), "2:20 set_payload: 50 m is farther than any arm reaches"),
        (program_of("movel(p[0.4, 0, 0.2, 0, 3.14, 0], v=250)"), "2:39 movel: 250 m/s is faster than any arm"),
        (program_of("movel(p[0.4, 0, 0.2, 0, 3.14, 0], r=50)"), "2:39 movel: 50 m is farther than any arm reaches"),
        (program_of("speedl([100, 0, 0, 0, 0, 0], 0.5)"), "2:10 speedl: 100 m/s is faster than any arm"),
    ],
    "W120": [
        (program_of("servoj([0, 0, 0, 0, 0, 0], t=0.002)"), "2:32 servoj: 0.002 s is shorter than a control cycle of 0.008 s"),
        (program_of("speedj([0, 0, 0, 0, 0, 0], 1, 0.004)"), "2:33 speedj: 0.004 s is shorter than a control cycle of 0.008 s"),
    ],
    "W115": [(program_of("x = [1]", "x.append(2)"), "3:3 nothing in this program has a method 'append'")],
    "W113": [("def f():\n  sync()\nend\nf()\n", "4:1 'f' runs when it is defined; this call is a program of its own and fails")],
}  # fmt: skip

FINE = {
    "W101": [
        program_of("x = 1", "textmsg(x)"),
        program_of("x = 1", "def f(a=x):", "return a", "end", "f()"),
        program_of("x = 1", "thread t():", "x = x + 1", "end", "run t()"),
        program_of("i = 0", "x = [1]", "x[i] = 2", "textmsg(x)"),
        program_of("_x = 1"),
    ],
    "W102": [program_of("def f():", "x = [1]", "x[0] = 2", "return x", "end", "f()")],
    "W103": [program_of("def f(a, _b):", "return a", "end", "f(1, 2)")],
    "W104": [program_of("f()", "def f():", "g()", "end", "def g():", "end"), program_of("def f(a=g()):", "return a", "end", "def g():", "return 1", "end", "f()")],
    "W105": [program_of("h = run t()", "thread t():", "run u()", "end", "thread u():", "end", "join h")],
    "W106": [
        program_of("while True:", "sync()", "end"),
        program_of("while True:", "if get_flag(0):", "sleep(1)", "end", "end"),
        program_of("x = 0", "while x < 3:", "x = x + 1", "end"),
        program_of("x = 0", "while True:", "x = x + 1", "if x > 3:", "break", "end", "end"),
        program_of("def f():", "g()", "end", "def g():", "sync()", "end", "while True:", "f()", "end"),
        program_of("while not get_flag(0):", "set_flag(0, True)", "end"),
        program_of("while random() < 0.5:", "end"),
        program_of('while "":', "end", "while False:", "end"),
        program_of("while get_flag(0):", "if get_flag(1):", "halt", "else:", "break", "end", "end"),
        program_of("thread t():", "end", "while True:", "h = run t()", "join h", "end"),
        program_of('x = rpc_factory("xmlrpc", "http://a")', "while True:", "x.f()", "end"),
    ],
    "W107": [
        program_of("r = socket_read_ascii_float(2)", "if r[0] == 2:", "textmsg(r[1])", "end"),
        program_of("r = socket_read_ascii_float(2)", "if r == [1, 2]:", "textmsg(r[1])", "end"),
        program_of("def f(r):", "return r[0]", "end", "r = socket_read_ascii_float(2)", "f(r)", "textmsg(r[1])"),
        program_of("socket_read_ascii_float(2)"),
        program_of("def socket_read_ascii_float(n):", "return [n, n]", "end", "r = socket_read_ascii_float(2)", "textmsg(r[1])"),
        program_of("textmsg(socket_read_byte_list(2)[0])"),
    ],
    "W108": [
        program_of("def f(a):", "if a:", "return 1", "end", "return 2", "end", "f(True)"),
        program_of("while True:", "if get_flag(0):", "break", "end", "sync()", "end", "textmsg(1)"),
        program_of("halt", "def f():", "end", "$ 2"),
        program_of("while get_flag(0):", "sync()", "end", "textmsg(1)"),
    ],
    "W109": [program_of("t = 1", "type = 2", "textmsg(t, type)")],
    "W110": [
        program_of("if (False):", "global x = 0", "end"),
        program_of("if random() < 0.5:", "elif random() < 0.5:", "end"),
        program_of("if get_flag(0):", "elif True:", "end"),
    ],
    "W111": [program_of("def f():", "def g():", "end", "g()", "end", "def h():", "def g():", "end", "g()", "end", "f()", "h()")],
    "W112": [program_of("thread t():", "end", "run t()")],
    "W114": [program_of("x = [1]", "x[0] == 1 textmsg(x)".replace("==", "=")), program_of("def f():", "return 1", "end", "f()"), program_of("thread t():", "end", "run t()")],
    "W116": [
        program_of("x = 1", "movej([x, x, x, x, x, x])", "movel(p[x, 0, 0, 0, 0, 0], t=x)", "set_tcp(p[0, 0, 0, 0, 0, 0])"),
        program_of("def sleep(t):", "return t", "end", 'sleep("1")'),
        program_of('set_tcp(p["a", 0, 0, 0, 0, 0])'),  # not a pose: the run says so
        program_of("speedl([0, 0, 0, 0, 0, 0], 1, t=0.1)", "set_payload(0.5)", "set_payload(0.5, [0, 0, 0])", "textmsg([[1, 2], [3, 4]])"),
    ],
    "W117": [
        program_of("movej([6.28, -6.33, 0, 0, 0, -7.3])", "movej([d2r(90), 0, 0, 0, 0, 0], v=10)", "movel(p[0.4, 0, 0.2, 0, 4.5, 4.4])"),
        program_of("q = [0, 0, 0, 0, 0, 0]", "q[0] = d2r(90)", "movej(q)"),
        program_of("q = [90, 0, 0, 0, 0, 0]", "q = [1, 0, 0, 0, 0, 0]", "movej(q)"),
        program_of("q = [90, 0, 0, 0, 0, 0]", "def f(q):", "movej(q)", "end", "f([0, 0, 0, 0, 0, d2r(q[0])])"),
        program_of("force_mode(p[0, 0, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0], [0, 0, 20, 0, 0, 0], 2, [0.1, 0.1, 15, 10, 0.3, 0.3])", "sleep(90)"),
    ],
    "W119": [program_of("def f(a, b=0):", "return a + b", "end", "textmsg(f(1), f(b=2, a=1))")],
    "W118": [program_of("movel(p[0.4, -1.8, 0.2, 0, 3.14, 0], a=15, v=3, r=0.5)", "set_payload(20, [0, 0, 0.3])")],
    "W120": [program_of("servoj([0, 0, 0, 0, 0, 0], t=0.008)", "speedl([0, 0, 0, 0, 0, 0], 1, get_steptime())", "sleep(0.001)")],
    "W115": [program_of('x = rpc_factory("xmlrpc", "http://a")', "x.append(2)")],
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
    assert check_program(program_of(*lines), catalogue=catalogue_for("5.12")) == ((), [])


def test_programs_with_errors_get_no_warnings_that_may_follow_from_them():
    errors, warnings = check_program(program_of("global x = 1", "nothing()"))
    assert len(errors) == 1
    assert warnings == []


PAGE = Path(__file__).parents[2] / "docs" / "urscript-tool.md"


def test_the_table_of_warnings_is_that_of_the_rules():
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    table = [line for line in lines if re.match(r"\| W\d+ \|", line)]
    assert table == [f"| {rule.code} | {rule.meaning} | {rule.reason} |" for rule in RULES]


# --- the command -----------------------------------------------------------------------------------------

WARNED_TEXT = program_of("global gr\u00f6n = 1", "x = 2").replace("\u00f6", "oe") + "# \u00fc\n"


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


def test_errors_and_warnings_are_shown_in_the_order_of_the_text(tmp_path):
    file = tmp_path / "a.script"
    file.write_text(
        program_of("movej([90, 0, 0, 0, 0, 0])", "halt()", "movel(p[400, 0, 0, 0, 0, 0])", "texmsg(1)")
    )
    shown = CliRunner().invoke(app, ["check", str(file)]).output
    assert re.findall(r"script:(\d+):\d+: (\w+)", shown) == [
        ("2", "Warning"),
        ("3", "Syntax"),
        ("4", "Warning"),
        ("5", "Compile"),
    ]
    shown = CliRunner().invoke(app, ["check", "--json", "--ignore", "W118", str(file)]).output
    assert [one["line"] for one in json.loads(shown)["diagnostics"]] == [2, 3, 5]


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


def test_the_same_words_when_a_wrong_program_is_run_or_laid_out(tmp_path):
    file = tmp_path / "a.script"
    file.write_text(program_of("x = 1", "if x == 1", "  sync()", "end"))
    for command in ("check", "run", "fmt"):
        result = CliRunner().invoke(app, [command, str(file)])
        assert result.exit_code == 1
        assert "a.script:3:11: Syntax error: a ':' is missing after '1'" in result.output
