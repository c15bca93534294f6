"""How fast the language is: compiling, computing, and what a thread costs that only waits."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Mapping
from typing import Any

from bench.length import FULL, Length
from urscript import NEXT_CYCLE, HostFunction, ProgramStatus, RunningProgram, ScriptThread, compile_program
from urscript.dialect import Dialect
from urscript.syntax.parser import prepare

ROUNDS = 5  # of each measurement; the best one counts, the others were disturbed
N_FUNCTIONS = 60
LOOP_ROUNDS = 200_000
CYCLES = 20_000

# Twenty-one lines: what a driver's control script is made of.
_FUNCTION = """
  def command_{n}(q, mode, limit=1.5, blocking=False):
    # Follow a command of the client, one step of the interpolation.
    local step = [0, 0, 0, 0, 0, 0]
    local i = 0
    while i < 6:
      step[i] = (q[i] - target_{n}[i]) * 0.125
      if step[i] > limit:
        step[i] = limit
      elif step[i] < -limit:
        step[i] = -limit
      end
      i = i + 1
    end
    if mode == {n} and not blocking:
      enter_critical
      target_{n} = step
      exit_critical
    end
    return norm(step)
  end
"""

_SCRIPT_LOOP = """
def p():
  def compute():
    x = 0.0
    y = 1.0
    i = 0
    while i < {rounds}:
      x = x + y * 0.5
      y = x - i
      if y < 0:
        y = -y
      end
      i = i + 1
    end
    return x
  end
  compute()
end
"""
STATEMENTS_A_ROUND = 5  # the head of the loop and the four in it; the branch is hardly ever taken


def _python_loop(rounds: int) -> float:
    x, y, i = 0.0, 1.0, 0
    while i < rounds:
        x = x + y * 0.5
        y = x - i
        if y < 0:
            y = -y
        i = i + 1
    return x


SYNC_THREADS = """
def p():
  thread idle():
    while True:
      sync()
    end
  end
  {runs}
  while True:
    sync()
  end
end
"""


class _QuietHost:
    """A host on which nothing happens but the next cycle."""

    step_time = 0.008

    def builtins(self) -> Mapping[str, HostFunction]:
        return {"sync": self._sync}

    def _sync(self, thread: ScriptThread) -> Generator[Any, None, None]:
        yield NEXT_CYCLE

    def textmsg(self, text: str) -> None:
        pass

    def thread_ended(self, thread: ScriptThread) -> None:
        pass

    def program_ended(self) -> None:
        pass


def driver_like_script() -> str:
    """A control script of more than 1,200 lines."""
    head = "".join(f"  global target_{n} = [0, 0, 0, 0, 0, 0]\n" for n in range(N_FUNCTIONS))
    functions = "".join(_FUNCTION.format(n=n) for n in range(N_FUNCTIONS))
    calls = "".join(f"  command_{n}(get_target_joint_positions(), {n})\n" for n in range(N_FUNCTIONS))
    return f"def control():\n{head}{functions}{calls}end\n"


def measure_script(length: Length = FULL) -> dict[str, float]:
    """Everything this module measures, in about two seconds."""
    prepare()
    text = driver_like_script()
    compiling = _best(lambda: compile_program(text), length)
    n = length.part_of(LOOP_ROUNDS)
    dialect = Dialect(statement_budget=10 * STATEMENTS_A_ROUND * n)
    loop = compile_program(_SCRIPT_LOOP.format(rounds=n), dialect=dialect)
    computing = _best(lambda: _run_to_its_end(loop.start(_QuietHost())), length)
    python = _best(lambda: _python_loop(n), length)
    return {
        "compile_1200_lines_s": compiling * 1200 / text.count("\n"),
        "script_statements_per_s": STATEMENTS_A_ROUND * n / computing,
        "script_vs_cpython": computing / python,
        "sync_thread_cycle_us": 1e6 * (_cycle(2, length) - _cycle(1, length)),
    }


def _run_to_its_end(running: RunningProgram) -> None:
    if running.step() is not ProgramStatus.FINISHED:
        raise AssertionError(f"the measured program did not finish: {running.error}")


def _cycle(n_threads: int, length: Length) -> float:
    """Seconds that a cycle of a program takes whose threads, main among them, only sync()."""
    runs = "  ".join(["run idle()\n"] * (n_threads - 1))
    cycles = length.part_of(CYCLES)
    running = compile_program(SYNC_THREADS.format(runs=runs)).start(_QuietHost())

    def some_cycles() -> None:
        for _ in range(cycles):
            running.step()

    seconds = _best(some_cycles, length) / cycles
    running.kill()
    return seconds


def _best(action: Callable[[], object], length: Length) -> float:
    """Seconds that `action` takes when nothing disturbs it."""
    times = []
    for _ in range(length.part_of(ROUNDS)):
        began = time.perf_counter()
        action()
        times.append(time.perf_counter() - began)
    return min(times)
