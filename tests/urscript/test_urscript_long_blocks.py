"""Long program bodies are compiled in pieces; nobody must see it."""

import ast

import pytest

import urscript.compile.long_blocks
from urscript.commands.tracing import LineTracer
from urscript.compile.compiler import compile_resolved
from urscript.compile.long_blocks import LONGEST, pieces
from urscript.program import ProgramStatus, compile_program
from urscript.recording_host import RecordingHost
from urscript.source import Source
from urscript.syntax.parser import parse

FILLING = "  x = x + 1\n" * (2 * LONGEST)

PROGRAM = f"""def p():
  x = 0
{FILLING}
  textmsg("a ", x)
  thread t():
    y = x
    sync()
    textmsg(y, x)
  end
  h = run t()
{FILLING}
  while True:
{FILLING}
    if x > {8 * LONGEST}:
      break
    elif x == 1:
      return 1
    end
    sync()
{FILLING}
  end
  join h
  textmsg("b ", x)
{FILLING}
  movej([0, 0, 0, 0, 0, 0])
  textmsg("c ", x)
  halt
end
"""


def run(text, longest, monkeypatch):
    monkeypatch.setattr(urscript.compile.long_blocks, "LONGEST", longest)
    program = compile_program(text)
    host = RecordingHost()
    lines = []
    with LineTracer(program, lambda it: lines.append(it), lambda: None, 100_000):
        running = host.run(program)
    error = running.error and (running.error.line, running.error.column, running.error.stack)
    return running.status, host.cycle, host.messages, host.calls, error, lines


@pytest.mark.parametrize(
    "text",
    [
        PROGRAM,
        PROGRAM.replace("movej", "x = [1]\n  x[5] = 1\n  movej"),
        PROGRAM.replace('textmsg("c ", x)', "def f(a):\n    return [1][a]\n  end\n  textmsg(f(7))"),
        PROGRAM.replace("sync()", "x = x"),
    ],
    ids=["runs to its end", "fails in a piece", "fails in a function", "takes too long"],
)
def test_in_pieces_a_program_does_what_it_does_in_one(text, monkeypatch):
    whole = run(text, 10**9, monkeypatch)
    assert run(text, LONGEST, monkeypatch) == whole
    assert run(text, 3, monkeypatch) == whole
    assert whole[0] in (ProgramStatus.FINISHED, ProgramStatus.FAILED)


def test_where_a_thread_stands_is_seen_through_the_pieces():
    program = compile_program(PROGRAM)
    running = program.start(RecordingHost())
    running.step()
    line = 1 + PROGRAM[: PROGRAM.index("    sync()\n  ", PROGRAM.index("return 1"))].count("\n")
    assert running.position(running.threads[0]) == (line, 5)


def test_no_piece_is_long_and_none_is_left_from_inside():
    def check(block, in_loop):
        made = list(pieces(block))
        assert tuple(statement for piece in made for statement in piece) == block
        for piece in made:
            assert len(piece) <= LONGEST
            if len(piece) > 1 and len(made) > 1:
                assert not any(urscript.compile.long_blocks._leaves(statement) for statement in piece)

    body = parse(Source(PROGRAM))[0].body
    check(body, False)
    assert len(list(pieces(body))) > 5
    loop = next(item for item in body if type(item).__name__ == "While")
    check(loop.body, True)


def test_nothing_that_python_compiles_at_once_is_long(monkeypatch):
    sizes = []

    def counting(tree, *arguments, **options):
        sizes.append(sum(isinstance(node, ast.stmt) for node in ast.walk(tree)))
        return compile(tree, *arguments, **options)

    monkeypatch.setitem(compile_resolved.__globals__, "compile", counting)
    compile_program("def p():\n  x = 0\n" + "  x = x + 1\n" * 5_000 + "end\n")
    assert len(sizes) > 5_000 / LONGEST
    # The whole is what calls the pieces.
    assert max(sizes) < 2.5 * LONGEST
