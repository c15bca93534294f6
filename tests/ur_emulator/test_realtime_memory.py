"""What boxes hold: of the user's process nothing; in a process of their own one total, for which pays who made it grow."""

import gc
import sys
import weakref
from types import SimpleNamespace

import psutil
import pytest

from ur_emulator import ControlBox
from ur_emulator.budgets import BUDGETS, MIB
from ur_emulator.host import memory
from ur_emulator.host.memory import MemoryWatch

FULL = BUDGETS.memory // MIB
MANY_LISTS = "def p():\n" + "".join(f"  global g{k} = make_list(65536, 0)\n" for k in range(1100)) + "end\n"
ENDED = f"the program was ended: box and programs hold more than {FULL} MiB of memory"
LOOP = "def loop():\n  while True:\n    sync()\n  end\nend\n"


# --- in the process of the user


def test_a_box_that_is_gone_leaves_nothing():
    with ControlBox(in_process=True, pace="lockstep", port_base=None) as box:
        gone = weakref.ref(box)
    del box
    gc.collect()
    assert gone() is None


def test_a_process_has_its_own_settings_again_after_its_last_box():
    before = gc.get_threshold(), sys.getswitchinterval()
    frozen = gc.get_freeze_count()
    with ControlBox(in_process=True, pace="lockstep", port_base=None):
        with ControlBox(in_process=True, pace="lockstep", port_base=None):
            assert (gc.get_threshold(), sys.getswitchinterval()) != before
        assert (gc.get_threshold(), sys.getswitchinterval()) != before
    assert (gc.get_threshold(), sys.getswitchinterval()) == before
    assert gc.get_freeze_count() <= frozen  # what was frozen before may have gone
    assert gc.isenabled()


# --- the watch, with figures instead of memory


class Programs:
    """What runs on a box: each of `needs` is what it makes the process hold until it ends [MiB]."""

    def __init__(self, system, *needs):
        self.system, self.needs, self.ended, self.kept = system, list(needs), [], 0
        self.controller = SimpleNamespace(programs=self)
        self.machine = SimpleNamespace(forget_ended=lambda: self.forget())
        self.commands = []
        system.append(self)

    is_any_running = property(lambda self: bool(self.needs))
    is_releasing = False

    def submit_quietly(self, command):
        self.commands.append(command)

    def tick(self):
        for command in self.commands:
            self.end_for_memory(command.text)
        self.commands.clear()

    def end_for_memory(self, text):
        self.kept += self.needs.pop()
        self.ended.append(text)

    def forget(self):
        self.kept = 0


class Tasks:
    """A worker process."""

    size, ended = 0, 0

    def memory(self):
        return self.size * MIB

    def end_for_memory(self):
        self.size, self.ended = 0, self.ended + 1


@pytest.fixture
def system(monkeypatch):
    """The boxes of a process, whose memory is what they need."""
    boxes = []
    monkeypatch.setattr(
        memory, "resident", lambda: (90 + sum(sum(box.needs) + box.kept for box in boxes)) * MIB
    )
    return boxes


def look(watch, *boxes, time=0.0):
    for box in boxes:
        box.tick()
        watch.look(box, time)


def test_the_programs_pay_that_made_the_process_grow(system):
    watch, small, big = MemoryWatch(Tasks()), Programs(system), Programs(system)
    small.needs, big.needs = [30], [30]
    look(watch, small, big)
    for k in range(1, FULL):
        small.needs[:] = [40] if k > 10 else [30]
        look(watch, small, time=k)
        big.needs[:] = [30 + 5 * k]
        look(watch, big, time=k)
        if big.commands:
            break
    look(watch, small, time=k)
    assert not small.commands, "one has to end already"
    big.tick()
    assert big.ended == [ENDED]
    assert small.ended == []
    assert 70 + 5 * k > FULL >= 70 + 5 * (k - 1)
    big.is_releasing = True
    look(watch, small, big, time=k + 1)
    assert big.kept > 0, "it releases its values one after the other"
    big.is_releasing = False
    look(watch, small, big, time=k + 2)
    assert (big.kept, big.ended, small.ended) == (0, [ENDED], [])


def test_a_task_pays_when_it_is_the_larger_part(system):
    tasks = Tasks()
    watch, box = MemoryWatch(tasks), Programs(system, 0)
    for time, size in enumerate((10, FULL - 50, FULL - 30)):
        box.needs[:], tasks.size = [40], size
        look(watch, box, time=time)
    assert (tasks.ended, box.ended) == (1, [])


def test_what_a_program_held_is_given_back_when_none_runs_any_more(system):
    watch, box = MemoryWatch(Tasks()), Programs(system, 0)
    box.needs[:] = [50]
    look(watch, box, time=1.0)
    box.end_for_memory("by its user")
    look(watch, box, time=1.001)
    assert box.kept == 50  # a moment later
    look(watch, box, time=2.0)
    assert box.kept == 0


def test_garbage_is_looked_for_as_often_as_the_process_grows(system, monkeypatch):
    watch, box, collected = MemoryWatch(Tasks()), Programs(system, 0), []
    monkeypatch.setattr(memory.gc, "collect", collected.append)
    monkeypatch.setattr(memory.gc, "get_count", lambda: (0, 0, 0))
    for time, size in enumerate((1, 2, 3, 4, 5, 1, 3, 4)):
        box.needs[:] = [size]
        look(watch, box, time=time)
        look(watch, box, time=time)
    assert collected == [1, 1]  # at 3 MiB, and at 4 after it had less


def test_what_cannot_be_given_back_is_tried_once(system, monkeypatch):
    watch, box, tried = MemoryWatch(Tasks()), Programs(system, 0), []
    box.end_for_memory("by its user")
    box.kept, box.forget = 20, lambda: tried.append(1)
    for time in range(1, 9):
        look(watch, box, time=time)
    assert len(tried) == 1


# --- the real thing


@pytest.fixture
def boxes():
    with ControlBox.many(2, robot="ur5e", version="5.25.1", pace="lockstep", port_base=None) as boxes:
        yield boxes


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells what a process holds")
def test_a_program_that_fills_the_memory_ends_and_its_neighbour_goes_on(boxes):
    boxes[1].run_program(LOOP)
    boxes[0]._rack._child.look()
    process = psutil.Process(boxes[0]._rack._child.pid)
    at_rest = process.memory_info().rss
    boxes[0].run_program(MANY_LISTS)
    boxes[0].wait_until(program_state="STOPPED", timeout=60)
    for _ in range(1000):  # what it held is released in the next cycles
        if process.memory_info().rss - at_rest < 40 * MIB:
            break
        assert boxes[0].state.program_state == "STOPPED"
    assert process.memory_info().rss - at_rest < 40 * MIB
    errors = [entry.text for entry in boxes[0].log if "Runtime error" in entry.text]
    assert [text.partition(": ")[2] for text in errors] == [ENDED]
    assert boxes[1].state.program_state == "PLAYING"
