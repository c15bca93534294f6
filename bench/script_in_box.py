"""What scripts cost a box without its ports: threads that wait, a burst of statements, long texts."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable

from bench.length import FULL, Length
from bench.script import SYNC_THREADS
from ur_emulator.machine.commands.programs import StartProgram
from ur_emulator.machine.controller.controller import Controller
from ur_emulator.machine.machine import Machine
from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.models.robots import robot_by_name
from urscript import CompiledProgram, compile_program
from urscript.syntax.parser import prepare

ROUNDS, FEW_ROUNDS = 20, 3  # of short and long measurements; the best one counts, the others were disturbed
N_THREADS = 20
CYCLES = 200
N_LOCALS = 20_000

_BURST = """
def p():
  n = 0
  sync()
  while True:
    n = n + 1
  end
end
"""


def measure_script_in_box(length: Length = FULL) -> dict[str, float]:
    """Everything this module measures, in some five seconds."""
    prepare()
    alone, crowded = _box_running(0), _box_running(N_THREADS)
    # Taking turns: what disturbs one disturbs the other.
    cycles = [(_cycles(alone), _cycles(crowded)) for _ in range(length.part_of(ROUNDS))]
    one, all_of_them = (min(times) for times in zip(*cycles, strict=True))
    statements, seconds = _burst(length)
    text = _locals(length.part_of(N_LOCALS))
    gc.disable()  # as in the box's worker process
    compiling = min(_timed(lambda: compile_program(text)) for _ in range(length.part_of(FEW_ROUNDS)))
    gc.enable()
    return {
        "script_sync_thread_us": 1e6 * (all_of_them - one) / N_THREADS,
        "statements_in_a_cycle": float(statements),
        "statement_burst_ms": 1e3 * seconds,
        "compile_20000_locals_s": compiling,
    }


def _box() -> Controller:
    return Machine(robot_by_name("ur3"), CB3.fidelity("typical"), 7).controller


def _box_running(n_threads: int) -> Controller:
    """A box in whose program so many threads, and main, do nothing but sync()."""
    box = _box()
    runs = "  run idle()\n" * n_threads
    box.tick([StartProgram(compile_program(SYNC_THREADS.format(runs=runs)))])
    return box


def _cycles(box: Controller) -> float:
    """Seconds that a cycle takes."""

    def some() -> None:
        for _ in range(CYCLES):
            box.tick(())

    return _timed(some) / CYCLES


def _burst(length: Length) -> tuple[int, float]:
    """How often `n = n + 1` runs in a cycle before the program is stopped, and how long that takes [s]."""
    program: CompiledProgram = compile_program(_BURST)
    seconds = []
    for _ in range(length.part_of(FEW_ROUNDS)):
        box = _box()
        box.tick([StartProgram(program)])
        seconds.append(_timed(lambda box=box: box.tick(())))  # type: ignore[misc]
        assert box.programs.latest is not None
        statements = int(box.programs.latest.read_global("n"))
    return statements, min(seconds)


def _locals(n: int) -> str:
    lines = "".join(f"    local x{k} = {k}\n" for k in range(n))
    return f"def p():\n  def f():\n{lines}  end\n  f()\nend\n"


def _timed(action: Callable[[], object]) -> float:
    began = time.perf_counter()
    action()
    return time.perf_counter() - began
