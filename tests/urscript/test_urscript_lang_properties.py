"""What must hold for every program, however odd."""

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from tree_printer import print_program

from urscript.dialect import Dialect
from urscript.errors import ScriptCompileError, ScriptSyntaxError
from urscript.program import ProgramStatus, check_program, compile_program
from urscript.recording_host import RecordingHost
from urscript.source import Source
from urscript.syntax import nodes
from urscript.syntax.parser import parse

several = settings(suppress_health_check=list(HealthCheck), max_examples=80)

# --- random trees --------------------------------------------------------------------------------------

VARIABLES = ["a", "b", "c", "d", "e", "p"]
FUNCTIONS = ["f", "g", "sync", "sleep", "norm", "length", "to_str", "str_cat", "movej", "textmsg", "size"]

OPERATORS = ["+", "-", "*", "/", "%", "==", "!=", "<", ">", "<=", ">=", "and", "or", "xor"]

names = st.sampled_from(VARIABLES).map(nodes.Name)
literals = st.one_of(
    st.integers(0, 2**31 - 1).map(nodes.IntLiteral),
    st.floats(0, 1e30).map(nodes.FloatLiteral),
    st.booleans().map(nodes.BoolLiteral),
    st.text(st.characters(max_codepoint=255, exclude_characters='"\n'), max_size=5).map(nodes.StringLiteral),
    st.just(nodes.NoneLiteral()),
    names,
)


def _arguments(values):
    positional = st.lists(values.map(nodes.Argument), max_size=3)
    named = st.lists(st.builds(nodes.Argument, values, st.sampled_from(VARIABLES)), max_size=1)
    return st.tuples(positional, named).map(lambda parts: tuple(parts[0] + parts[1]))


def _compound(values):
    some = st.lists(values, max_size=4).map(tuple)
    return st.one_of(
        st.builds(nodes.ListLiteral, some),
        st.builds(nodes.PoseLiteral, st.lists(values, min_size=6, max_size=6).map(tuple)),
        st.builds(nodes.Prefix, st.sampled_from(["-", "+", "not"]), values),
        st.builds(
            nodes.Binary,
            st.sampled_from(OPERATORS),
            values,
            values,
        ),
        st.builds(nodes.Call, st.sampled_from(FUNCTIONS), _arguments(values)),
        st.builds(nodes.MethodCall, values, st.just("method"), _arguments(values)),
        st.builds(nodes.Member, values, st.just("member")),
        st.builds(nodes.Index, values, st.lists(values, min_size=1, max_size=2).map(tuple)),
        st.just(nodes.Run("t")),
    )


expressions = st.recursive(literals, _compound, max_leaves=8)
targets = st.one_of(
    names, st.builds(nodes.Index, names, st.lists(expressions, min_size=1, max_size=2).map(tuple))
)
# Effects start with a name: a bracket or sign would continue the statement before.
simple_statements = st.one_of(
    st.builds(nodes.Assign, targets, expressions),
    st.builds(nodes.Assign, names, expressions, st.sampled_from(["global", "local"])),
    st.builds(nodes.Evaluate, st.builds(nodes.Call, st.sampled_from(FUNCTIONS), _arguments(expressions))),
    st.builds(nodes.Return, expressions),
    st.builds(nodes.Kill, expressions),
    st.builds(nodes.Join, expressions),
    st.sampled_from(["halt", "enter_critical", "exit_critical"]).map(nodes.Simple),
    st.builds(nodes.Declare, st.sampled_from(VARIABLES), st.sampled_from(["global", "local"])),
    st.just(nodes.Label('3 "MoveJ"')),
)


def _blocks(statements):
    block = st.lists(statements, max_size=3).map(tuple)
    arms = st.lists(st.builds(nodes.Arm, expressions, block), min_size=1, max_size=3).map(tuple)
    return st.one_of(
        st.builds(nodes.If, arms, st.none() | block),
        st.builds(
            nodes.While,
            expressions,
            st.lists(
                st.one_of(statements, st.sampled_from(["break", "continue"]).map(nodes.Simple)), max_size=3
            ).map(tuple),
        ),
    )


statements = st.recursive(simple_statements, _blocks, max_leaves=6)
blocks = st.lists(statements, max_size=6).map(tuple)
functions = st.builds(
    nodes.Function,
    st.just("def"),
    st.sampled_from(["f", "g"]),
    st.lists(
        st.builds(nodes.Parameter, st.sampled_from(VARIABLES), st.none() | expressions),
        max_size=2,
        unique_by=lambda parameter: parameter.name,
    ).map(tuple),
    blocks,
)
threads = st.builds(nodes.Function, st.just("thread"), st.just("t"), st.just(()), blocks)


@several
@given(st.lists(st.one_of(statements, functions, threads), max_size=6).map(tuple))
def test_a_printed_tree_parses_to_the_same_tree(tree):
    text = print_program(tree)
    again = parse(Source(text))
    assert again == tree
    assert print_program(again) == text


# --- random programs -----------------------------------------------------------------------------------

PRELUDE = """
a = 1
b = 2.5
c = [1, 2, 3]
d = "text"
e = True
m = [[1, 2], [3, 4]]
h = 0
p = p[1, 2, 3, 4, 5, 6]
"""
SMALL = Dialect(statement_budget=500)

atoms = st.sampled_from(
    ["a", "b", "c", "d", "e", "m", "h", "p", "0", "1", "7", "2.5", '"s"', "True", "None", "[1, 2, 3]"]
)


def _larger(e):
    def shape(form, *parts):
        return st.tuples(*parts).map(lambda values: form.format(*values))

    operator = st.sampled_from(
        ["+", "-", "*", "/", "%", "==", "!=", "<", ">", "<=", ">=", "and", "or", "xor"]
    )
    return st.one_of(
        shape("({} {} {})", e, operator, e),
        shape("(not {})", e),
        shape("(-{})", e),
        shape("{}[{}]", st.sampled_from("cpm"), e),
        shape("m[{}, {}]", e, e),
        shape("f({})", e),
        shape("g({}, c={})", e, e),
        shape("{}({})", st.sampled_from(["norm", "length", "to_str", "sin", "floor", "size"]), e),
        shape("get_inverse_kin({})", e),
        shape("[{}, {}]", e, e),
        shape("p[{}, 0, 0, 0, 0, 1]", e),
        st.just("run t()"),
    )


programs_e = st.recursive(atoms, _larger, max_leaves=5)
variables = st.sampled_from("abcdemhp")


def _lines(form, *parts):
    return st.tuples(*parts).map(lambda values: form.format(*values))


one_line = st.one_of(
    _lines("{} = {}", variables, programs_e),
    _lines("{}[{}] = {}", st.sampled_from("cp"), programs_e, programs_e),
    _lines("local {} = {}", variables, programs_e),
    _lines("global {} = {}", variables, programs_e),
    _lines("return {}", programs_e),
    _lines("{} h", st.sampled_from(["kill", "join"])),
    _lines("textmsg({}, {})", programs_e, programs_e),
    _lines("movej({})", programs_e),
    _lines("sleep({})", programs_e),
    st.sampled_from(
        ["sync()", "halt", "h = run t()", "h = run t()", "f(a)", "enter_critical", "exit_critical"]
    ),
)
more_lines = st.recursive(
    one_line,
    lambda inner: st.one_of(
        _lines("{}\n{}", inner, inner),
        _lines("if {} == {}:\n{}\nelse:\n{}\nend", programs_e, programs_e, inner, inner),
        _lines("while {}:\n{}\nend", st.sampled_from(["True", "e", "a < 5", "b > a"]), inner),
        _lines("while True:\n{}\nbreak\nend", inner),
    ),
    max_leaves=5,
)


@settings(several, max_examples=300)
@given(more_lines, more_lines, more_lines, more_lines)
def test_a_random_program_ends_or_runs_on_but_never_breaks_the_interpreter(f, g, t, body):
    text = f"{PRELUDE}\ndef f(x):\n{f}\nend\ndef g(x, c=b):\n{g}\nend\nthread t():\n{t}\nend\n{body}\n"
    errors, _ = check_program(text, dialect=SMALL)
    assert not errors, text
    host = RecordingHost()
    running = host.run(compile_program(text, dialect=SMALL), max_cycles=20)
    if running.status is ProgramStatus.FAILED:
        assert running.error.line >= 1
        assert "internal error" not in running.error.message, running.error.render()
    running.kill()
    assert running.threads == []
    assert host.ended_programs == 1


# --- random text ---------------------------------------------------------------------------------------

WORDS = """
def sec thread end if elif else while break continue return run kill join halt global local and or not
enter_critical exit_critical True None ( ) [ ] : , = == < + - * / % . ! x p foo sync() 1 2.5 .5 $ #
"""


def _error_of(text):
    """The error that compiling `text` gives, None if there is none; anything else flies on."""
    try:
        compile_program(text)
    except ScriptCompileError as error:
        return error
    return None


def _assert_has_a_place(error, text):
    assert 1 <= error.line <= text.count("\n") + 1
    assert error.column >= 1
    assert error.wire_text
    assert error.render()
    all_errors, _ = check_program(text)
    assert (all_errors[0].line, all_errors[0].column) == (error.line, error.column)


@several
@given(st.text(st.characters(max_codepoint=255), max_size=60))
@example("\x00")
@example('"')
@example("\xff\xfe")
@example("$")
@example("1.")
def test_random_bytes_give_an_error_with_a_place(text):
    error = _error_of(text)
    if error is not None:
        _assert_has_a_place(error, text)


@several
@given(st.lists(st.sampled_from([*WORDS.split(), "\n"]), max_size=25).map(" ".join))
def test_random_words_give_an_error_with_a_place(text):
    error = _error_of(text)
    if error is not None:
        _assert_has_a_place(error, text)


@pytest.mark.parametrize(
    "text",
    [
        "x = " + "(" * 5000 + "1" + ")" * 5000,
        "x = " + "[" * 3000 + "]" * 3000,
        "x = " + "-" * 5000 + "1",
        "x = " + "not " * 5000 + "True",
        "x = 1" + " + 1" * 5000,
        "x = " + "norm(" * 3000 + "1" + ")" * 3000,
        "x = [1]\ny = x" + "[0]" * 5000,
        "if True:\n" * 3000 + "end\n" * 3000,
        "while True:\n" * 30 + "end\n" * 30,
        "def f():\n" * 2000 + "end\n" * 2000,
        "(" * 10000,
        "x = 0\nif x == 0:\n" + "".join(f"elif x == {n}:\n" for n in range(1, 3000)) + "end",
    ],
    ids=lambda text: text[:12],
)
def test_deep_nesting_compiles_or_is_refused_in_words(text):
    error = _error_of(text)
    assert error is None or error.line >= 1


def test_a_chain_of_many_arms_needs_no_nesting():
    arms = "".join(f"elif x == {n}:\n  textmsg({n})\n" for n in range(1, 300))
    host = RecordingHost()
    host.run(compile_program(f"x = 299\nif x == 0:\n{arms}end"))
    assert host.messages == ["299"]


def test_all_syntax_errors_are_found_in_one_pass():
    text = 'def f():\n  textmsg("a"\n  x = 3 +\n  while x\n    y = 1\n  end\n  a += 1\n  z = 2 @\nend\n'
    errors, _ = check_program(text)
    found = [(error.line, error.column) for error in errors]
    assert found == [(3, 3), (4, 3), (5, 5), (7, 6), (8, 9)]


def test_a_syntax_error_in_the_middle_of_garbage_names_its_line():
    with pytest.raises(ScriptSyntaxError) as caught:
        compile_program("def f():\n  textmsg(1)\n  @@@\nend\n")
    assert (caught.value.line, caught.value.column) == (3, 3)
    assert caught.value.wire_text == "syntax_error_on_line:3:  @@@:"
