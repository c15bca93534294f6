"""Memory of a process with boxes: how much it holds, who pays for it, and when garbage is collected.

A process that only serves boxes is watched: what it holds beyond what it had when it began, with its worker
processes, is one total (`memory` of the budgets), measured where the system tells it (Linux). When there is
too much, the programs of the box, or the task, that made it grow most end. The system's own limit stands
behind that. Such a process also decides when the garbage collector runs: between cycles, and never over more
than what is new, unless no program runs.

A process of the user keeps its collector and its limits.
"""

from __future__ import annotations

import ctypes
import gc
from contextlib import suppress
from typing import TYPE_CHECKING

from ur_emulator.budgets import BUDGETS, MIB
from ur_emulator.host.runtime.processes import limit_memory, resident
from ur_emulator.machine.commands.programs import EndPrograms

if TYPE_CHECKING:
    from ur_emulator.host.runtime.worker import TaskQueue
    from ur_emulator.host.served_box import ServedBox

# Objects that are new when the collector looks at them [1]: so many take a fifth of a millisecond.
_NEW = 2_000
# The same where few objects are long [bytes]: the collector looks at all elements of new lists, half a
# millisecond for a MiB.
_GROWN = 2 * MIB
# Generation of the collector with all objects.
_ALL = 2
# How often the memory is measured [s]: a program makes 5 MiB in that time.
_PERIOD = 0.01
# What is given back when no program runs [bytes]: less is not worth the time.
_WORTH_IT = 8 * MIB
# Between the limit of the watch and that of the system [bytes]: a single statement makes less.
_MARGIN = 64 * MIB
# `M_MMAP_THRESHOLD` of mallopt(3): longer blocks go back to the system when they are freed [bytes].
_MMAP_THRESHOLD, _LONG_BLOCK = -3, 64 * 1024


def own_process() -> None:
    """Take over the collector and the limits of a process that only serves boxes; all of them exist."""
    gc.collect()
    gc.freeze()
    gc.disable()
    with suppress(OSError, AttributeError):  # long blocks go back when they are freed, where that can be set
        ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, _LONG_BLOCK)
    limit_memory(BUDGETS.memory + _MARGIN)


class MemoryWatch:
    """Watches the memory of a process that only serves boxes."""

    def __init__(self, tasks: TaskQueue) -> None:
        self._tasks = tasks
        self._at_rest = self._now = self._collected = resident()
        # What it holds when nothing can be given back.
        self._floor = 0
        # How much each box has made it grow since it held half of what is allowed.
        self._grown: dict[ServedBox, int] = {}
        # The box whose programs had to end last, until what they held is given back.
        self._ended: ServedBox | None = None
        self._next_look = 0.0

    def look(self, box: ServedBox, now: float) -> None:
        """Measure, after a cycle of a box; let pay who must."""
        if gc.get_count()[0] > _NEW or self._now - self._collected > _GROWN:
            gc.collect(1)
            self._collected = self._now
        if now < self._next_look or any(one.controller.programs.is_releasing for one in (box, *self._grown)):
            return
        if self._ended is not None:
            if self._ended is not box:
                return  # its next cycle ends them
            self._give_back(box)
            self._ended = None
        before, self._now = self._now, resident()
        self._collected = min(self._collected, self._now)
        held = self._now - self._at_rest
        if 2 * held < BUDGETS.memory:
            self._next_look = now + _PERIOD
            self._grown.clear()
            if held - self._floor > _WORTH_IT and not box.controller.programs.is_any_running:
                self._give_back(box)
            held = max(0, held)
        else:
            self._grown[box] = self._grown.get(box, 0) + self._now - before
        tasks = self._tasks.memory()
        if held + tasks > BUDGETS.memory:
            self._end_somebody(held, tasks)

    def _end_somebody(self, held: int, tasks: int) -> None:
        if tasks > held:
            self._tasks.end_for_memory()
            return
        box = max(self._grown, key=lambda one: (one.controller.programs.is_any_running, self._grown[one]))
        text = f"the program was ended: box and programs hold more than {BUDGETS.memory // MIB} MiB of memory"
        box.submit_quietly(EndPrograms(text))
        self._ended = box

    def _give_back(self, box: ServedBox) -> None:
        """Give back what programs held that have ended."""
        box.machine.forget_ended()
        gc.collect(_ALL)
        with suppress(OSError, AttributeError):  # only some systems can
            ctypes.CDLL(None).malloc_trim(0)
        self._grown.clear()
        self._now = resident()
        self._floor = self._now - self._at_rest
