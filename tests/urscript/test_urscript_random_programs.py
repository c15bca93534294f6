"""Random trees, words, programs, lines of interpreter mode and lists: what holds for all of them."""

import threading

import pytest
from chunk_runner import InterpretingHost
from hypothesis import example, given, settings
from hypothesis import strategies as st
from program_texts import (
    OPERATORS,
    WORDS,
    expressions,
    node_classes,
    numbers,
    print_expression,
    print_program,
    programs,
)

from urscript.catalogue import CB3_3_15, catalogue_for
from urscript.check.checking import check_program, check_with_advice
from urscript.dialect import Dialect
from urscript.errors import ScriptBudgetError, ScriptCompileError, ScriptSyntaxError
from urscript.program import ProgramStatus, compile_program
from urscript.recording_host import RecordingHost
from urscript.source import Source
from urscript.syntax import nodes
from urscript.syntax.parser import parse
from urscript.values import Struct, log_form, size_of

SMALL = Dialect(statement_budget=300, recursion_limit=20)


# --- trees -------------------------------------------------------------------------------------------------


@pytest.mark.hypothesis
def test_trees_with_every_kind_of_node_print_to_a_text_that_parses_to_them():
    kinds = {
        kind
        for kind in vars(nodes).values()
        if isinstance(kind, type) and issubclass(kind, nodes.Node) and "__dataclass_fields__" in vars(kind)
    } - {nodes.Node}
    seen = set()

    @settings(max_examples=60)  # so many have every kind of node
    @given(programs)
    def prints_to_a_text_that_parses_to_it(tree):
        seen.update(node_classes(tree))
        text = print_program(tree)
        assert parse(Source(text)) == tree
        assert parse(Source(text.replace("\n", "\r\n"))) == tree

    prints_to_a_text_that_parses_to_it()
    assert seen == kinds


@given(expressions)
def test_an_expression_needs_no_more_brackets_than_it_gets(tree):
    (statement,) = parse(Source(f"x = {print_expression(tree)}"))
    assert statement.value == tree


# --- texts -------------------------------------------------------------------------------------------------

FOREIGN = """
elseif for in then do && || += ++ // /* 5s 1,5 lambda \u201c \xe2\x80\x9c \xb0 -> := <>
"""


def compile_error(text):
    """The error that compiling gives; None if there is none, anything else flies on."""
    try:
        compile_program(text)
    except ScriptCompileError as error:
        return error
    return None


def assert_compiles_or_is_refused_at_a_place(text):
    """Compiler, check and advice agree whether it is a program; every error has a place in the text.

    Returns:
        The errors without and with advice.
    """
    errors, _ = check_program(text)
    error = compile_error(text)
    assert (error is None) == (errors == ())
    if error is not None:
        assert (error.line, error.column) == (errors[0].line, errors[0].column)
        assert error.wire_text
        assert "\n" not in error.wire_text
    advised, warnings = check_with_advice(text)
    assert bool(advised) == bool(errors)
    n_lines = text.count("\n") + 1
    for error in (*errors, *advised, *warnings):
        assert 1 <= error.line <= n_lines
        assert error.column >= 1
        assert error.message
        assert error.render()
    lines = [error.line for error in advised if isinstance(error, ScriptSyntaxError)]
    assert lines == sorted(set(lines))
    return errors, advised


@given(st.lists(st.sampled_from([*WORDS, *FOREIGN.split(), "\t"]), max_size=30).map(" ".join))
def test_random_words_compile_or_are_refused_at_a_place(text):
    assert_compiles_or_is_refused_at_a_place(text)


@given(st.binary(max_size=80).map(lambda data: data.decode("latin-1")))
@example("\x00")
@example('"')
@example("\xff\xfe")
@example("$")
@example("1.")
def test_random_bytes_compile_or_are_refused_at_a_place(text):
    assert_compiles_or_is_refused_at_a_place(text)


@given(programs, st.data())
def test_a_random_tree_and_what_is_left_of_it_compile_or_are_refused_at_a_place(tree, data):
    text = print_program(tree)
    errors, advised = assert_compiles_or_is_refused_at_a_place(text)
    # No rule of advice is for a program without syntax errors.
    assert [error.message for error in advised] == [error.message for error in errors]
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(len(text), start + 8)))
    put = data.draw(st.sampled_from(["", " ", "\n", ";", "=", ")", "end", "x"]))
    assert_compiles_or_is_refused_at_a_place(text[:start] + put + text[end:])


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
    return st.one_of(
        _text("({} {} {})", e, st.sampled_from(OPERATORS), e),
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


# --- operators ---------------------------------------------------------------------------------------------


@given(numbers, numbers)
def test_evident_types_and_unknown_types_compute_the_same(a, b):
    """The compiler's shortcuts for known types must not differ from the general operators."""
    left, right = (f"({value!r})" for value in (a, b))
    text = ["def hidden(x):", "  return x", "end", "if False:", '  hidden("")', "end"]
    text += [f"x = {left}", f"y = {right}"]
    for operator in OPERATORS[:11]:  # without those of conditions
        if b == 0 and operator in "/%":
            continue
        text += [
            f"textmsg(to_str(x {operator} y))",
            f"textmsg(to_str(hidden(x) {operator} hidden(y)))",
            f"textmsg(to_str(x {operator} hidden(y)))",
        ]
    text += ["textmsg(to_str(-x))", "textmsg(to_str(-hidden(x)))", "textmsg(to_str(-hidden(x)))"]
    host = RecordingHost()
    running = host.run(compile_program("\n".join(text)))
    assert running.error is None, running.error.render()
    for n in range(0, len(host.messages), 3):
        assert len(set(host.messages[n : n + 3])) == 1, (a, b, n, host.messages[n : n + 3])


# --- lines of interpreter mode -----------------------------------------------------------------------------

CATALOGUE = catalogue_for("5.12")
CYCLES = 60
# A line that returns ends the line only; the mode cannot be entered by a line.
statements = st.one_of(lines, blocks.map(lambda block: block.replace("\n", " "))).filter(
    lambda line: not any(word in line for word in ("return", "interpreter", "$", "break"))
)


def program(*body):
    return (
        f"{PRELUDE}\ndef f(x):\nreturn x\nend\ndef g(x, c=b):\nreturn [x, c]\nend\n"
        "thread t():\nsync()\na = 2\nend\nthread u():\nsync()\nend\n" + "\n".join(body)
    )


def outcome(host, running):
    error = running.error
    if isinstance(error, ScriptBudgetError):
        return running.status  # how often an endless loop runs depends on what ran before it in the cycle
    calls = [(call.name, call.arguments) for call in host.calls if call.name != "interpreter_mode"]
    return host.messages, [str(call) for call in calls], error and error.message, running.status


def test_a_line_counts_the_calls_of_the_functions_that_it_reaches():
    text = "def f1():\nf2()\nend\ndef f2():\nsync()\nend\ninterpreter_mode()\n"
    host = InterpretingHost(CATALOGUE, ["def g(): f1() end", "g()", "sync()"])
    running = compile_program(text, catalogue=CATALOGUE).start(host)
    seen = []
    while running.step() is ProgramStatus.RUNNING:
        seen.append(running.threads[0].open_calls)
    # The body, and in the second line the line itself, g, f1 and f2.
    assert [n for n, before in zip(seen, [0, *seen], strict=False) if n != before] == [5, 2]


@given(st.lists(statements, max_size=6))
def test_lines_do_what_the_same_statements_of_a_program_do(body):
    try:
        whole = compile_program(program(*body), catalogue=CATALOGUE)
    except ScriptCompileError:
        return
    alone = RecordingHost(catalogue=CATALOGUE)
    whole_run = alone.run(whole, max_cycles=CYCLES)
    expected = outcome(alone, whole_run)
    host = InterpretingHost(CATALOGUE, body)
    running = host.run(compile_program(program("interpreter_mode()"), catalogue=CATALOGUE), max_cycles=CYCLES)
    assert host.discarded == []
    if whole_run.status is not ProgramStatus.RUNNING:
        assert outcome(host, running) == expected


@given(st.lists(st.one_of(statements, st.text(st.characters(max_codepoint=255)), st.text("()[]=,. xf1"))))
def test_any_line_is_run_or_discarded(body):
    host = InterpretingHost(CATALOGUE, body)
    running = host.run(compile_program(program("interpreter_mode()"), catalogue=CATALOGUE), max_cycles=CYCLES)
    assert running.error is None or "internal error" not in running.error.message
    running.kill()
    assert running.threads == []


# --- lists with a capacity: against a Python list and a number ---------------------------------------------

NEWEST = catalogue_for("5.25")
NUMBERS = st.integers(-9, 9)
CALLS = st.lists(
    st.one_of(
        st.tuples(st.just("append"), NUMBERS),
        st.tuples(st.just("extend"), st.lists(NUMBERS, max_size=3)),
        st.tuples(st.just("insert"), st.integers(0, 6), NUMBERS),
        st.tuples(st.just("pop")),
        st.tuples(st.just("remove"), st.integers(0, 6)),
        st.tuples(st.just("clear")),
        st.tuples(st.just("store"), st.integers(0, 6), NUMBERS),
        st.tuples(st.just("assign"), st.lists(NUMBERS, max_size=6)),
    ),
    max_size=12,
)
PLACES = st.sampled_from(["l", "s.l", "rows[1].l"])


def apply(model, capacity, name, *arguments):
    """Do a call on the model; False where the language has an error."""
    if name in ("insert", "pop", "remove", "store"):
        index = arguments[0] if arguments else 0
        if index >= len(model) + (name == "insert"):
            return False
    match name:
        case "remove":
            del model[arguments[0]]
        case "store":
            model[arguments[0]] = arguments[1]
        case "assign":
            model[:] = arguments[0]
        case _:
            getattr(model, name)(*arguments)
    return len(model) <= capacity


def statement(place, name, *arguments):
    if name == "assign":
        return f"{place} = {arguments[0]}"
    if name == "store":
        return f"{place}[{arguments[0]}] = {arguments[1]}"
    return f"{place}.{name}({', '.join(map(str, arguments))})"


@given(CALLS, PLACES, st.integers(0, 6), st.booleans())
def test_a_list_is_what_its_model_is_and_fails_where_that_cannot(calls, place, capacity, is_local):
    model, lines, errors = [], [], 0
    for call in calls:
        before = list(model)
        lines.append(statement(place, *call))
        if not apply(model, capacity, *call):
            model, errors = before, 1
            break
        lines.append(f"textmsg({place}, {place}.excess_capacity())")
    body = [
        f"local l = make_list(0, 0, {capacity})" if is_local else f"l = make_list(0, 0, {capacity})",
        "local s = struct(number=1, l=l)",
        "local rows = make_list(2, s)",
        *lines,
    ]
    text = "\n".join(["def p():", "def work():", *body, "end", "work()", "end"])
    host = RecordingHost(catalogue=NEWEST)
    running = host.run(compile_program(text, catalogue=NEWEST))
    assert running.status is (ProgramStatus.FAILED if errors else ProgramStatus.FINISHED), running.error
    assert len(host.messages) == len(calls[: len(lines) // 2]), text
    if host.messages:
        shown = f"{log_form(model)}{capacity - len(model)}"
        assert host.messages[-1] == shown
    if errors:
        assert running.error.line == 2 + 3 + len(lines)
        assert "internal" not in running.error.message


@given(
    st.recursive(
        NUMBERS, lambda inner: st.dictionaries(st.sampled_from("abc"), inner, min_size=1), max_leaves=8
    )
)
def test_the_size_of_a_struct_counts_all_its_values(tree):
    def made(node):
        return Struct({name: made(value) for name, value in node.items()}) if isinstance(node, dict) else node

    def count(node):
        return 1 + sum(map(count, node.values())) if isinstance(node, dict) else 1

    assert size_of(made(tree)) == count(tree)
