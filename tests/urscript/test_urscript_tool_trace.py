import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from urscript.cli import app
from urscript.commands.run_command import LineTracer
from urscript.program import compile_program
from urscript.recording_host import RecordingHost

ROOT = Path(__file__).parents[2]
PROGRAM = """def p():
  def f(x):
    return x + 1
  end
  thread t():
    while True:
      sync()
    end
  end
  h = run t()
  # a comment
  a = 1 b = f(a)
  sync()
  if a == b:
    halt
  elif a < b:
    kill h
  end
end
"""


def traced(text, limit=1000):
    program = compile_program(text)
    host = RecordingHost()
    lines, stops = [], []
    with LineTracer(program, lambda it: lines.append((host.cycle, *it)), lambda: stops.append(1), limit):
        host.run(program, max_cycles=50)
    return lines, stops


def test_every_line_is_shown_once_before_it_is_executed_with_cycle_and_thread():
    lines, stops = traced(PROGRAM)
    assert lines == [
        (0, "p", 1, "def p():"),
        (0, "p", 10, "h = run t()"),
        (0, "p", 12, "a = 1 b = f(a)"),
        (0, "p", 2, "def f(x):"),
        (0, "p", 3, "return x + 1"),
        (0, "p", 13, "sync()"),
        (0, "t", 5, "thread t():"),
        (0, "t", 6, "while True:"),
        (0, "t", 7, "sync()"),
        (1, "p", 14, "if a == b:"),
        (1, "p", 16, "elif a < b:"),
        (1, "p", 17, "kill h"),
    ]
    assert stops == []


def test_a_loop_is_shown_round_by_round():
    lines, _ = traced("i = 0\nwhile i < 2:\n  i = i + 1\nend")
    assert [line for _, _, line, _ in lines] == [1, 2, 3, 2, 3, 2]


def test_an_endless_loop_is_shown_up_to_the_limit_and_runs_on():
    lines, stops = traced("while True:\n  sync()\nend", limit=7)
    assert len(lines) == 7
    assert stops == [1]


@pytest.mark.parametrize("text", ["halt", "x = [1]\ny = x[1]", "while True:\nend"])
def test_the_tracing_of_others_is_as_before_whatever_happens(text):
    before = sys.gettrace()
    traced(text, limit=5)
    assert sys.gettrace() is before


def test_run_trace_mixes_lines_and_effects_in_their_order(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.script").write_text('textmsg("\u00e4")\nset_flag(0, True)\n', encoding="utf-8")
    result = CliRunner().invoke(app, ["run", "--robot", "none", "--trace", "a.script"])
    assert result.stdout == (
        '     0  textmsg:1: textmsg("\u00e4")\n\u00e4\n'
        "     0  textmsg:2: set_flag(0, True)\n    0.000 s  textmsg: set_flag(0, True)\n"
    )


def test_run_ends_quietly_when_nobody_reads_on(tmp_path):
    (tmp_path / "a.script").write_text("while True:\n  sync()\nend\n")
    start = [sys.executable, "-c", "from urscript.cli import main; main()"]
    # Far more than a pipe holds: it cannot end before its reader does.
    words = ["run", "--robot", "none", "--trace", "--trace-lines", "100000", str(tmp_path / "a.script")]
    with subprocess.Popen(
        [*start, *words], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert "while True:" in process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 1
