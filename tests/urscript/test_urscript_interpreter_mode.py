"""Lines of interpreter mode do what the same lines do in the program, whatever they are."""

from chunk_runner import InterpretingHost
from hypothesis import given, settings
from hypothesis import strategies as st
from test_urscript_random_programs import PRELUDE, blocks, lines, some

from urscript.catalogue import catalogue_for
from urscript.errors import ScriptBudgetError, ScriptCompileError
from urscript.program import ProgramStatus, compile_program
from urscript.recording_host import RecordingHost

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


@settings(some)
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


@settings(some)
@given(st.lists(st.one_of(statements, st.text(st.characters(max_codepoint=255)), st.text("()[]=,. xf1"))))
def test_any_line_is_run_or_discarded(body):
    host = InterpretingHost(CATALOGUE, body)
    running = host.run(compile_program(program("interpreter_mode()"), catalogue=CATALOGUE), max_cycles=CYCLES)
    assert running.error is None or "internal error" not in running.error.message
    running.kill()
    assert running.threads == []
