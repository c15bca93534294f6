"""Long tasks of a loop, with the real process: results, errors, deaths, and what is left of them."""

import operator
import os
import signal
import subprocess
import sys
import threading
import time

import psutil
import pytest
from box_support import TIMEOUT

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import WorkerError
from ur_emulator.host.runtime import processes
from ur_emulator.host.runtime import worker as module
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.runtime.worker import TaskQueue, Ticket
from ur_emulator.program_files.compiling import compile_text
from urscript.catalogue import catalogue_for
from urscript.program import ProgramStatus, compile_program
from urscript.recording_host import RecordingHost


class Bench:
    """A loop with a queue of tasks, run in the test's thread."""

    def __init__(self):
        self.loop = EventLoop()
        self.tasks = TaskQueue(self.loop)
        self.results = []
        self.n_wanted = None

    def submit(self, function, *arguments):
        return self.submit_at(Ticket(object()), function, *arguments)

    def submit_at(self, place, function, *arguments):
        return self.tasks.submit(lambda *it: self._note(*it), pytest.fail, place, function, *arguments)

    def _note(self, result, error):
        self.results.append(result if error is None else error)
        if self.tasks.is_idle or len(self.results) == self.n_wanted:
            self.loop.stop()

    def run(self, n_wanted=None):
        """Run until all, or so much, is done; return what has come of it."""
        self.n_wanted = n_wanted
        self.loop.run()
        self.loop._stopping = False
        results, self.results = self.results, []
        return results

    def ask(self, function, *arguments):
        self.submit(function, *arguments)
        return self.run()[0]


@pytest.fixture
def bench():
    bench = Bench()
    yield bench
    bench.tasks.close()
    bench.loop.close()


def has_ended(pid):
    """Wait until nothing of a process is left, not even its entry in the system's table."""
    end = time.monotonic() + TIMEOUT
    while time.monotonic() < end:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.001)
    return False


def test_tasks_are_done_in_order_and_what_they_raise_is_reported(bench):
    for function, *arguments in (
        (operator.add, 1, 2),
        (operator.truediv, 1, 0),
        (open, "/no such file"),
        (threading.Lock,),
        (operator.add, "a", "b"),
    ):
        bench.submit(function, *arguments)
    three, division, missing, no_result, text = bench.run()
    assert (three, text) == (3, "ab")
    assert "ZeroDivisionError" in str(division)
    assert isinstance(missing, FileNotFoundError)
    assert "cannot pickle" in str(no_result)
    data = bytes(range(256)) * (1 << 14)
    assert bench.ask(operator.add, data, data) == data + data


def test_all_is_done_by_one_process_that_no_ctrl_c_reaches(bench):
    pid = bench.ask(os.getpid)
    assert pid != os.getpid()
    assert bench.ask(os.getsid, 0) != os.getsid(0)
    assert bench.ask(signal.raise_signal, signal.SIGINT) is None
    assert bench.ask(os.getpid) == pid


def test_a_process_that_dies_costs_one_task(bench):
    pid = bench.ask(os.getpid)
    bench.submit(os._exit, 3)
    bench.submit(os.getpid)
    bench.submit(signal.raise_signal, signal.SIGKILL)
    exited, other, killed = bench.run()
    assert str(exited) == "the process that did it was ended with exit code 3: try again"
    assert str(killed) == "the process that did it was ended by SIGKILL: try again"
    assert has_ended(pid)
    assert has_ended(other)


def test_a_process_that_is_stopped_costs_one_task_and_does_not_outlive_the_loop(bench):
    pid = bench.ask(os.getpid)
    os.kill(pid, signal.SIGSTOP)
    bench.submit(operator.add, 1, 2)
    bench.submit(os.getpid)
    stopped, other = bench.run()
    assert isinstance(stopped, WorkerError)
    assert str(stopped) == "the process that did it was stopped: try again"
    assert has_ended(pid)
    os.kill(other, signal.SIGSTOP)
    bench.tasks.close()
    bench.loop.close()
    assert has_ended(other)


def test_a_task_does_not_take_long_while_its_process_has_not_begun(bench, monkeypatch):
    bench.ask(os.getpid)  # there is a server
    server = processes._server.process.pid
    other = Bench()

    def go_on():
        monkeypatch.undo()
        os.kill(server, signal.SIGCONT)

    monkeypatch.setattr(module, "LONG", 0.1)
    os.kill(server, signal.SIGSTOP)
    other.loop.call_later(0.6, go_on, pytest.fail)
    for number in range(3):
        other.submit(operator.add, number, 1)
    assert other.run() == [1, 2, 3]
    other.tasks.close()
    other.loop.close()


def test_a_task_that_never_ends_is_given_up(bench, monkeypatch):
    pid = bench.ask(os.getpid)
    monkeypatch.setattr(module, "_FOR_EVER", 0.0)
    assert str(bench.ask(signal.pause)) == "it takes more than 0 s: make it shorter"
    assert has_ended(pid)


def test_a_task_that_takes_much_processor_time_loses_its_priority_and_may_take_so_much_and_no_more(bench):
    """Not one that only waits for a busy machine."""
    before = bench.ask(os.nice, 0)
    for timer, most in ((signal.ITIMER_VIRTUAL, module.LONG), (signal.ITIMER_PROF, BUDGETS.task_seconds)):
        assert 0.0 < bench.ask(signal.getitimer, timer)[0] < 1.1 * most
    bench.ask(signal.raise_signal, signal.SIGVTALRM)
    assert bench.ask(os.nice, 0) == min(19, before + 10)
    error = bench.ask(signal.raise_signal, signal.SIGPROF)
    assert isinstance(error, WorkerError)
    assert str(error) == "it takes more than 10 s of processor time: make it shorter"


def test_a_task_may_need_so_much_memory_and_no_more(bench):
    pid = bench.ask(os.getpid)
    error = bench.ask(bytes, BUDGETS.task_memory)
    assert isinstance(error, WorkerError)
    assert str(error) == "it needs more than 96 MiB of memory: make it shorter"
    assert (
        str(bench.ask(bytes, BUDGETS.task_result_bytes)) == "its result has more than 16 MiB: make it shorter"
    )
    assert bench.ask(os.getpid) == pid


def test_tasks_are_done_by_their_turns_then_in_the_order_of_arrival(bench):
    for name, turn, arrived in (("a", 0, 9), ("b", 1, 3), ("c", 0, 5), ("d", 1, 2), ("e", 0, 4)):
        bench.submit_at(Ticket(name, turn, arrived), str.lower, name)
    assert bench.run() == ["a", "e", "c", "d", "b"]


def test_a_task_that_takes_long_does_not_hold_up_the_next_of_others(bench):
    pid = bench.ask(os.getpid)
    long = bench.submit_at(Ticket("a"), time.sleep, 1e6)
    bench.submit_at(Ticket("a"), operator.add, 1, 2)
    for function, *arguments in ((os.getpid,), (os.getpid,), (time.sleep, 1e6)):
        bench.submit(function, *arguments)
    first, second, too_many = bench.run(3)
    assert first == second != pid
    assert str(too_many).startswith("it takes long, and so does what another client has sent: ")
    bench.tasks.drop(long)
    assert bench.run() == [3]
    bench.tasks.close()
    bench.loop.close()
    assert has_ended(pid)


def test_a_task_that_is_dropped_does_not_hold_up_the_next(bench):
    pid = bench.ask(os.getpid)
    running, waiting = bench.submit(signal.pause), bench.submit(operator.add, 1, 2)
    bench.submit(os.getpid)
    bench.tasks.drop(waiting)
    bench.tasks.drop(running)
    (other,) = bench.run()
    assert other != pid
    bench.tasks.drop(running)
    bench.tasks.close()
    bench.loop.close()
    assert has_ended(pid)


def test_a_process_that_cannot_be_started_is_reported_and_tried_again(bench, monkeypatch):
    def fail(role):
        raise OSError("too many")

    with monkeypatch.context() as patch:
        patch.setattr(module, "start_child", fail)
        bench.tasks.start()
        bench.submit(operator.add, 1, 2)
        bench.submit(operator.add, 3, 4)
        first, second = bench.run()
    assert str(first) == str(second) == "the process for it cannot be started (too many): try again later"
    assert bench.ask(operator.add, 1, 2) == 3


@pytest.mark.parametrize(
    ("how", "stopped"),
    [pytest.param(signal.SIGINT, "", marks=pytest.mark.nightly), (signal.SIGKILL, "worker")],
)
def test_the_process_ends_with_the_one_that_started_it(how, stopped):
    """So do the box and the server of both: they hold the pipe for errors open as long as they live."""
    code = (
        "from ur_emulator import ControlBox\n"
        "import signal\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell may ignore it in the background
        "with ControlBox(pace='lockstep', port_base=None) as box:\n"
        "    print(box.run_program('textmsg(1)'), flush=True)\n"
        "    signal.pause()\n"
    )
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", code], **pipes) as parent:
        parent.stdout.readline()
        children = psutil.Process(parent.pid).children(recursive=True)
        if stopped:
            children[-1].suspend()
        os.kill(parent.pid, how)
        errors = parent.stderr.read()
    assert len(children) == 3
    assert not psutil.wait_procs(children, timeout=TIMEOUT)[1]
    assert errors.count("Traceback") == (how is signal.SIGINT)


def test_a_fork_leaves_the_process_to_its_parent(bench):
    """A copy of the user's process keeps no end of theirs, and has a server of its own."""
    pid = bench.ask(os.getpid)
    child = os.fork()
    if not child:
        mine = processes.start_child(processes.WORKER)
        os._exit(set(processes._children) != {mine})
    assert os.waitpid(child, 0)[1] == 0
    assert bench.ask(os.getpid) == pid


@pytest.mark.nightly
def test_a_script_without_a_main_guard_is_not_run_again(tmp_path):
    script = tmp_path / "mine.py"
    script.write_text(
        "from ur_emulator import ControlBox\n"
        "print('once')\n"
        "with ControlBox(pace='lockstep', port_base=None) as box:\n"
        "    print(box.run_program('def p():\\n  sync()\\nend'))\n"
    )
    result = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path)
    assert (result.stdout.count("once"), result.returncode, result.stderr) == (1, 0, "")


def test_a_program_that_comes_from_the_process_is_the_one_that_is_compiled_here(bench):
    text = "def p():\n  x = p[0, 0, 0.1, 0, 0, 0]\n  def f(a, b=[1, 2]):\n    return a + b[1]\n  end\n  textmsg(f(40), x)\nend"
    program = bench.ask(compile_text, text, catalogue_for("3.15"), "p.script")
    assert program == compile_program(text, catalogue=catalogue_for("3.15"), name="p.script")
    assert program.catalogue is catalogue_for("3.15")
    host = RecordingHost()
    assert host.run(program).status is ProgramStatus.FINISHED
    assert host.messages == ["42p[0,0,0.1,0,0,0]"]
