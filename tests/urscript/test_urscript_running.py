"""Running programs: what a box sees of them, cycle by cycle; where instructions stand; the limits."""

import gc
import marshal
from types import CodeType

import pytest

from urscript import NEXT_CYCLE, Blocked, ProgramStatus, RecordingHost, ScriptRuntimeError, compile_program
from urscript.catalogue import catalogue_for
from urscript.dialect import Dialect
from urscript.errors import ScriptCompileError, ScriptContextError
from urscript.run.variables import UNDEFINED


class Host(RecordingHost):
    """A recording host with a few builtins of its own."""

    def __init__(self, **functions):
        super().__init__()
        self.functions = functions

    def builtins(self):
        return {**super().builtins(), **self.functions}


def start(text, **functions):
    host = Host(**functions)
    return compile_program(text).start(host), host


def test_nothing_happens_before_the_first_step():
    running, host = start('textmsg("x")')
    assert host.messages == []
    assert running.status is ProgramStatus.RUNNING
    assert running.step() is ProgramStatus.FINISHED
    assert running.step() is ProgramStatus.FINISHED
    assert (host.messages, host.ended_programs) == (["x"], 1)


def test_program_kinds_and_names():
    texts = ("sec b():\nend", "movej([0,0,0,0,0,0])", "halt", '$ 1 "Program"\ndef c():\nend')
    programs = [compile_program(text) for text in texts]
    kinds = [("sec", "b"), ("statement", "movej"), ("statement", "halt"), ("def", "c")]
    assert [(program.kind, program.name) for program in programs] == kinds


def test_one_compiled_program_runs_many_times():
    program = compile_program("def p():\n  x = [1]\n  x[0] = x[0] + 1\n  textmsg(x)\nend")
    for _ in range(3):
        host = RecordingHost()
        assert host.run(program).status is ProgramStatus.FINISHED
        assert host.messages == ["[2]"]


def test_a_thread_waits_outside_until_its_condition_holds():
    box = []

    def read(thread, number, name, timeout):
        if not box:
            yield Blocked(lambda: bool(box), outside=True)
        return [1, box.pop()]

    running, host = start("x = socket_read_binary_integer(1)\ntextmsg(x)", socket_read_binary_integer=read)
    assert not running.waits_outside
    for _ in range(3):
        assert running.step() is ProgramStatus.RUNNING
        assert running.waits_outside
    box.append(7)
    assert not running.waits_outside
    assert running.step() is ProgramStatus.FINISHED
    assert host.messages == ["[1,7]"]


def test_an_inner_wait_does_not_hold_up_time():
    running, _ = start("def p():\n  thread t():\n    sleep(1)\n  end\n  h = run t()\n  join h\nend")
    running.step()
    assert running.status is ProgramStatus.RUNNING
    assert not running.waits_outside


def read_at_once(thread, number, name, timeout):
    yield Blocked(lambda: True, outside=True)
    return [1, 5]


def test_a_condition_that_holds_at_once_costs_no_cycle():
    text = "i = 0\nwhile i < 10:\n  x = socket_read_binary_integer(1)\n  i = i + 1\nend"
    running, _ = start(text, socket_read_binary_integer=read_at_once)
    assert running.step() is ProgramStatus.FINISHED


def test_calls_that_never_have_to_wait_give_way_before_the_budget_is_used_up():
    reads = []

    def read(thread, number, name, timeout):
        yield Blocked(lambda: True, outside=True)
        reads.append(number)
        return [1, 5]

    program = compile_program("while True:\n  x = socket_read_binary_integer(1)\nend")
    running = program.start(Host(socket_read_binary_integer=read))
    per_cycle = []
    for _ in range(3):
        assert running.step() is ProgramStatus.RUNNING
        per_cycle.append(len(reads))
        reads.clear()
    assert 1_000 < min(per_cycle) <= max(per_cycle) < Dialect().statement_budget
    running.kill()


def test_what_a_program_does_between_such_calls_still_counts():
    text = "while True:\n  x = socket_read_binary_integer(1)\n  i = 0\n  while i < 200000:\n    i = i + 1\n  end\nend"
    running, _ = start(text, socket_read_binary_integer=read_at_once)
    assert running.step() is ProgramStatus.FAILED
    assert "too much time" in running.error.message


def test_the_budget_is_a_switch():
    budget = 10
    text = f"i = 0\nwhile i < {budget - 3}:\n  i = i + 1\nend"
    assert RecordingHost().run(compile_program(text, dialect=Dialect(statement_budget=budget))).error is None
    text = f"i = 0\nwhile i < {budget + 1}:\n  i = i + 1\nend"
    running = RecordingHost().run(compile_program(text, dialect=Dialect(statement_budget=budget)))
    assert "too much time" in running.error.message


def test_kill_closes_what_the_threads_are_in():
    closed = []

    def movej(thread, *arguments):
        try:
            while True:
                yield NEXT_CYCLE
        finally:
            closed.append(thread.name)

    text = "def p():\n  thread t():\n    movej([0,0,0,0,0,0])\n  end\n  run t()\n  movej([0,0,0,0,0,0])\nend"
    running, host = start(text, movej=movej)
    running.step()
    assert [thread.name for thread in running.threads] == ["p", "t"]
    running.kill()
    running.kill()
    assert closed == ["t", "p"]
    assert running.threads == []
    assert [thread.name for thread in host.ended_threads] == ["t", "p"]
    assert (running.status, host.ended_programs) == (ProgramStatus.FINISHED, 1)


def test_a_host_may_kill_the_program_from_within():
    def powerdown(thread):
        running.kill()

    running, host = start("powerdown()\nsync()\ntextmsg(1)", powerdown=powerdown)
    assert running.step() is ProgramStatus.FINISHED
    assert host.messages == []


def test_an_error_of_the_host_gets_the_place_of_the_call_and_the_calls_on_the_way():
    def movel(thread, *arguments):
        yield NEXT_CYCLE
        raise ScriptRuntimeError("no way")

    text = "def p():\n  def go(n):\n    x = n\n    movel(p[0,0,0,0,0,0])\n  end\n  sync()\n  go(3)\nend"
    running, host = start(text, movel=movel)
    while running.step() is ProgramStatus.RUNNING:
        pass
    error = running.error
    assert (error.line, error.column, error.message) == (4, 5, "no way")
    assert error.log_text == "Runtime error (4:5): no way"
    assert error.wire_text == "no way"
    assert error.stack == (("p", 7, 3), ("go", 4, 5))
    assert error.render().splitlines()[1:] == ["        movel(p[0,0,0,0,0,0])", "        ^"]
    assert host.ended_programs == 1


def test_a_fault_of_the_host_is_reported_as_such_and_keeps_its_cause():
    def set_flag(thread, n, value):
        return {}["missing"]

    running, _ = start("set_flag(1, True)", set_flag=set_flag)
    assert running.step() is ProgramStatus.FAILED
    assert running.error.message.startswith("internal error of this box: KeyError")
    assert isinstance(running.error.__cause__, KeyError)


def chain(n):
    """A body that calls, and `n` functions that call one another."""
    functions = "".join(f"def f{i}():\n  return f{i + 1}()\nend\n" for i in range(1, n))
    return f"{functions}def f{n}():\n  return 1\nend\nx = f1()\n"


def test_functions_may_call_one_another_two_hundred_deep_and_not_deeper():
    assert RecordingHost().run(compile_program(chain(199))).error is None
    for n in (200, 400):
        with pytest.raises(ScriptContextError) as caught:
            compile_program(chain(n))
        assert caught.value.message == "functions call one another 201 deep from here on; allowed: 200"
        # The body of a program without `def` has no place of its own.
        assert (caught.value.line, caught.value.column) == ((1, 1) if n == 200 else (3 * (n - 201) + 1, 1))


def test_recursive_functions_count_for_the_depth_of_a_chain_when_they_run():
    loop = "def a(n):\n  if n > 0:\n    b(n - 1)\n  end\n  f1()\nend\ndef b(n):\n  a(n)\nend\n"
    program = compile_program(loop + chain(198) + "a(50)\n")
    assert program.depth == 199  # the body, and those that are not recursive
    assert RecordingHost().run(program).error is None


def test_what_a_program_held_is_given_back_at_its_end():
    text = 'a = 1\nb = make_list(4000, 0)\nc = make_list(65536, 0)\nd = "0123456789abcdef"\n'
    text += "while str_len(d) < 32768:\n  d = d + d\nend\n"
    running = compile_program(text, catalogue=catalogue_for("5.15")).start(RecordingHost())
    assert running.step() is ProgramStatus.FINISHED
    assert (running.read_global("a"), running.read_global("b")) == (1, [0] * 4000)
    assert running.read_global("c") is running.read_global("d") is UNDEFINED


@pytest.mark.parametrize("software", ["3.15", "5.25"])
def test_handles_have_methods_that_may_wait_and_may_be_named_like_those_of_lists(software):
    class Handle:
        script_type = "rpc handle"

        def call_method(self, thread, method, arguments, named):
            yield NEXT_CYCLE
            if method == "nope":
                raise ScriptRuntimeError(f"no method {method}")
            return sum(arguments) + named.get("more", 0)

    text = (
        'h = rpc_factory("xmlrpc", "127.0.0.1:8080")\ntextmsg(h.add(1, 2, more=3))\n'
        "textmsg(h.append(4) + h.pop())\nh.clear()\nh.nope()"
    )
    host = Host(rpc_factory=lambda thread, kind, url: Handle())
    running = compile_program(text, catalogue=catalogue_for(software)).start(host)
    while running.step() is ProgramStatus.RUNNING:
        pass
    assert host.messages == ["6", "4"]
    assert (running.error.line, running.error.message) == (5, "no method nope")


def test_a_run_leaves_nothing_for_the_garbage_collector():
    text = "def p():\n  thread t():\n    while True:\n      sync()\n    end\n  end\n  run t()\n  sync()\nend"
    program = compile_program(text)
    RecordingHost().run(program)
    gc.collect()
    gc.disable()
    try:
        for _ in range(5):
            program.start(host := RecordingHost()).step()
            host.run(program)
            host.ended_threads.clear()
        assert gc.collect() < 1250
    finally:
        gc.enable()


# --- positions


TEXT = """def p():
  def far(a, b=1):
    x = [a, b, a + b]
    return x[2] / (a - b)
  end
  thread t():
    while True:
      sync()
    end
  end
  $ 4 "Run" "breakAfter"
  run t()
  i = 0
  while i < 3:
    i = i + 1
    sync()
    i = i + far(i, 9)
  end
end
"""


def test_all_instructions_have_the_position_that_python_reports():
    program = compile_program(TEXT)
    module = marshal.loads(program.compiled.code)
    functions = [constant for constant in module.co_consts if isinstance(constant, CodeType)]
    assert {function.co_name for function in functions} == set(program.compiled.positions)
    for function in functions:
        table = program.compiled.positions[function.co_name]
        for i, (line, _, column, _) in enumerate(function.co_positions()):
            assert table.at(2 * i) == (line or 1, 1 if column is None else column + 1)


def test_a_suspended_thread_stands_where_it_waits():
    running = compile_program(TEXT).start(RecordingHost())
    assert running.step() is ProgramStatus.RUNNING
    assert [running.position(thread) for thread in running.threads] == [(16, 5), (8, 7)]
    assert [thread.label for thread in running.threads] == ['4 "Run" "breakAfter"', ""]


# --- limits


def _error_of(text):
    """The error that compiling `text` gives, None if there is none; anything else flies on."""
    try:
        compile_program(text)
    except ScriptCompileError as error:
        return error
    return None


@pytest.mark.parametrize(
    "text",
    [
        "x = " + "(" * 1500 + "1" + ")" * 1500,
        "x = " + "[" * 1500 + "]" * 1500,
        "x = " + "not " * 1500 + "True",
        "x = 1" + " + 1" * 1500,
        "x = " + "norm(" * 1500 + "1" + ")" * 1500,
        "x = [1]\ny = x" + "[0]" * 1500,
        "if True:\n" * 1500 + "end\n" * 1500,
        "while True:\n" * 30 + "end\n" * 30,
        "def f():\n" * 1500 + "end\n" * 1500,
        "x = 0\nif x == 0:\n" + "".join(f"elif x == {n}:\n" for n in range(1, 1000)) + "end",
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


def test_a_message_shows_no_more_of_a_line_than_a_client_can_hold():
    text = "x = [" + "1, " * 1_000 + "@"
    assert _error_of(text).wire_text == f"syntax_error_on_line:1:{text[:1_000]}:"


@pytest.mark.parametrize("form", ["{} = 1", "global {} = 1", "def {}():\nend", "thread {}():\nend"])
def test_every_name_has_a_longest_length(form):
    assert _error_of(form.format("n" * 255)) is None
    error = _error_of(form.format("n" * 256))
    assert error.message == "a name of 256 characters; allowed: up to 255"
    assert (error.line, error.column, error.width) == (1, 1 + form.index("{"), 256)


def test_a_string_literal_is_no_longer_than_a_string():
    assert _error_of(f'x = "{"a" * 65_536}"') is None
    assert _error_of(f'x = "{"a" * 65_537}"').message == "a string of 65537 characters; allowed: up to 65536"
