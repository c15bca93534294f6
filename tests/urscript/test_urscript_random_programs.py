"""Random trees print and parse to themselves; random texts compile or are refused at a place; random programs end.

`RANDOM_PROGRAMS=20000 pytest tests/urscript/test_urscript_random_programs.py` tries that many of each.
"""

import os
import threading

from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from random_trees import WORDS, expressions, node_classes, programs
from tree_printer import print_expression, print_program

from urscript.catalogue import CB3_3_15
from urscript.check.checking import check_program
from urscript.dialect import Dialect
from urscript.errors import ScriptCompileError
from urscript.program import ProgramStatus, compile_program
from urscript.recording_host import RecordingHost
from urscript.source import Source
from urscript.syntax import nodes
from urscript.syntax.parser import parse

EXAMPLES = int(os.environ.get("RANDOM_PROGRAMS", "60"))
some = settings(max_examples=EXAMPLES, suppress_health_check=list(HealthCheck), print_blob=True)
SMALL = Dialect(statement_budget=300, recursion_limit=20)


# --- trees -------------------------------------------------------------------------------------------------


@some
@given(programs)
def test_a_tree_prints_to_a_text_that_parses_to_it(tree):
    text = print_program(tree)
    assert parse(Source(text)) == tree
    assert print_program(parse(Source(text))) == text
    assert parse(Source(text.replace("\n", "\r\n"))) == tree


@some
@given(expressions)
def test_an_expression_needs_no_more_brackets_than_it_gets(tree):
    (statement,) = parse(Source(f"x = {print_expression(tree)}"))
    assert statement.value == tree


def test_the_trees_have_every_kind_of_node():
    kinds = {
        kind
        for kind in vars(nodes).values()
        if isinstance(kind, type) and issubclass(kind, nodes.Node) and "__dataclass_fields__" in vars(kind)
    } - {nodes.Node}
    seen = set()

    @settings(max_examples=60, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
    @given(programs)
    def look(tree):
        seen.update(node_classes(tree))

    look()
    assert seen == kinds


# --- texts -------------------------------------------------------------------------------------------------


def compile_error(text):
    """The error that compiling gives; None if there is none, anything else flies on."""
    try:
        compile_program(text)
    except ScriptCompileError as error:
        return error
    return None


def assert_compiles_or_is_refused_at_a_place(text):
    errors, _ = check_program(text)
    error = compile_error(text)
    if error is None:
        assert errors == ()
        return
    assert (error.line, error.column) == (errors[0].line, errors[0].column)
    assert 1 <= error.line <= text.count("\n") + 1
    assert error.column >= 1
    assert error.wire_text
    assert "\n" not in error.wire_text
    assert error.render()


@some
@given(st.lists(st.sampled_from(WORDS), max_size=30).map(" ".join))
def test_random_words_compile_or_are_refused_at_a_place(text):
    assert_compiles_or_is_refused_at_a_place(text)


@some
@given(st.binary(max_size=80).map(lambda data: data.decode("latin-1")))
@example("\x00")
@example('"')
@example("\xff\xfe")
@example("$")
@example("1.")
def test_random_bytes_compile_or_are_refused_at_a_place(text):
    assert_compiles_or_is_refused_at_a_place(text)


@some
@given(programs)
def test_random_trees_compile_or_are_refused_at_a_place(tree):
    assert_compiles_or_is_refused_at_a_place(print_program(tree))


# --- programs ----------------------------------------------------------------------------------------------

PRELUDE = """
a = 1
b = 2.5
c = [1, 2, 3]
d = "text"
e = True
m = [[1, 2], [3, 4]]
h = 0
q = [0, 0, 0]
p = p[1, 2, 3, 4, 5, 6]
"""
BUILTINS = sorted(row.name for row in CB3_3_15)
atoms = st.sampled_from(
    ["a", "b", "c", "d", "e", "m", "h", "q", "p", "0", "1", "-7", "2.5", '"s"', "True", "None", "[1, 2, 3]"]
)


def _text(form, *parts):
    return st.tuples(*parts).map(lambda values: form.format(*values))


def _larger(e):
    operator = st.sampled_from(
        ["+", "-", "*", "/", "%", "==", "!=", "<", ">", "<=", ">=", "and", "or", "xor"]
    )
    return st.one_of(
        _text("({} {} {})", e, operator, e),
        _text("(not {})", e),
        _text("{}[{}]", st.sampled_from("cpmq"), e),
        _text("m[{}, {}]", e, e),
        _text("f({})", e),
        _text("g({}, c={})", e, e),
        _text("{}({})", st.sampled_from(BUILTINS), st.lists(e, max_size=4).map(", ".join)),
        _text("[{}, {}]", e, e),
        _text("p[{}, 0, 0, 0, 0, {}]", e, e),
        st.sampled_from(["run t()", "run u()"]),
    )


values = st.recursive(atoms, _larger, max_leaves=5)
variables = st.sampled_from("abcdemhqp")
lines = st.one_of(
    _text("{} = {}", variables, values),
    _text("{}[{}] = {}", st.sampled_from("cpq"), values, values),
    _text("{} {} = {}", st.sampled_from(["local", "global"]), variables, values),
    _text("return {}", values),
    _text("{} {}", st.sampled_from(["kill", "join"]), st.sampled_from(["h", "q[0]", "q[2]", "run t()", "0"])),
    _text("textmsg({}, {})", values, values),
    _text("{}({})", st.sampled_from(BUILTINS), st.lists(values, max_size=4).map(", ".join)),
    st.sampled_from(
        ["sync()", "sleep(0.02)", "halt", "h = run t()", "q[1] = run t()", "q[2] = run u()", "f(a)"]
    ),
    st.sampled_from(["enter_critical", "exit_critical", '$ 4 "label"']),
)
blocks = st.recursive(
    lines,
    lambda inner: st.one_of(
        _text("{}\n{}", inner, inner),
        _text("if {} == {}:\n{}\nelif e:\n{}\nelse:\n{}\nend", values, values, inner, inner, inner),
        _text("while {}:\n{}\nend", st.sampled_from(["True", "e", "a < 5", "b > a"]), inner),
        _text("while True:\n{}\nbreak\nend", inner),
        _text("while True:\n{}\nsync()\nend", inner),
        _text("enter_critical\n{}\nexit_critical", inner),
    ),
    max_leaves=6,
)


@settings(some, max_examples=3 * EXAMPLES)
@given(blocks, blocks, blocks, blocks, blocks, st.integers(0, 30))
def test_a_random_program_ends_or_runs_on_and_leaves_no_thread(f, g, t, u, body, cycles):
    text = (
        f"{PRELUDE}\ndef f(x):\n{f}\nend\ndef g(x, c=b):\n{g}\nend\nthread t():\n{t}\nend\n"
        f"thread u():\nthread t():\n{u}\nend\nh = run t()\n{t}\nend\n{body}\n"
    )
    if check_program(text, dialect=SMALL)[0]:
        assert_compiles_or_is_refused_at_a_place(text)
        return
    system_threads = threading.active_count()
    host = RecordingHost()
    running = host.run(compile_program(text, dialect=SMALL), max_cycles=cycles)
    if running.status is ProgramStatus.FAILED:
        assert running.error.line >= 1
        assert "internal error" not in running.error.message, running.error.render()
    running.kill()
    assert running.threads == []
    assert len(host.ended_threads) == len({thread.thread_id for thread in host.ended_threads})
    assert host.ended_programs == 1
    assert threading.active_count() == system_threads
