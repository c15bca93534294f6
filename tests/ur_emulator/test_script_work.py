"""What a program may do in a cycle: units of work are bounded, and a program that needs more gets slower itself."""

from dataclasses import replace

import pytest
from box_support import Bench

from ur_emulator.budgets import BUDGETS, of_cycle
from ur_emulator.machine.commands.programs import StartProgram
from ur_emulator.machine.controller.events import ScriptFailed, TextPrinted
from ur_emulator.machine.models.generations import CB3, E_SERIES
from urscript import ProgramStatus, RecordingHost, compile_program
from urscript.catalogue import catalogue_for
from urscript.dialect import STATEMENT_BUDGET
from urscript.recording_host import FakeSocket
from urscript.run.metering import CLOSING, FREE_CALLS, MOST_AT_ONCE, WorkBudget
from urscript.run.waits import CHECKPOINT

NEAR = "p[0.25, -0.25, 0.25, 2.2, -2.2, 0]"
LOOP = "    i = 0\n    while i < {n}:\n      {body}\n      i = i + 1\n    end\n"


def forever(body, n, before=""):
    """A program that does `body` `n` times before each sync."""
    return f"def p():\n{before}  while True:\n{LOOP.format(n=n, body=body)}    sync()\n  end\nend\n"


def units_of_cycles(text, n, work):
    """Units that a program uses in each of `n` cycles, those that it was given included in what it may."""
    running = compile_program(text).start(RecordingHost(), work)
    used = []
    for _ in range(n):
        work.renew()
        before = work.left
        assert running.step() is ProgramStatus.RUNNING, running.error
        used.append(before - work.left)
    running.kill()
    return used


GREEDY = {
    "kinematics": forever(f"x = get_inverse_kin({NEAR})", 300),
    "text": forever('textmsg("hello ", i)', 3_000),
    "statements": forever("x = i", 50_000),
    "lists": forever("y = x + x", 3_000, "  x = [1, 2, 3, 4, 5, 6]\n"),
    "long expressions": forever("y = " + " + ".join(["x[0]"] * 200), 3_000, "  x = [1, 2, 3]\n"),
    "functions": forever("f(f(i))", 10_000, "  def f(x):\n    return [x, x]\n  end\n"),
    "one expression": f"def p():\n  while True:\n    x = [{', '.join([f'get_inverse_kin({NEAR}) == None'] * 200)}]\n"
    "    sync()\n  end\nend\n",
    "threads": "def p():\n  thread t():\n    while True:\n"
    + LOOP.format(n=2_000, body="x = i")
    + "      sync()\n    end\n  end\n  j = 0\n  while j < 100:\n    run t()\n    j = j + 1\n  end\n"
    + "  while True:\n    sync()\n  end\nend\n",
}


@pytest.mark.parametrize("name", GREEDY)
def test_a_greedy_program_uses_what_a_cycle_gives_and_goes_on(name):
    per_cycle, single = 30_000, 6_000  # the longest operation of these programs takes less
    used = units_of_cycles(GREEDY[name], 24, WorkBudget(per_cycle, per_cycle))
    assert max(used) <= per_cycle + single
    assert sum(used) >= 18 * per_cycle  # what is left at a sync() is not used


def test_a_slower_program_computes_the_same():
    text = (
        "def p():\n  global total = 0\n  thread t():\n    while True:\n      total = total * 3 + 1\n"
        + LOOP.format(n=500, body="total = total + i")
        + "      sync()\n    end\n  end\n  run t()\n  run t()\n  k = 0\n  while k < 5:\n"
        + LOOP.format(n=700, body="total = total - i * k")
        + "    textmsg(total)\n    k = k + 1\n    sync()\n  end\nend\n"
    )

    def told(work):
        host = RecordingHost()
        running = compile_program(text).start(host, work)
        cycles = 0
        while running.status is ProgramStatus.RUNNING:
            work.renew()
            running.step()
            cycles += 1
        return host.messages, cycles

    quick, slow = told(WorkBudget()), told(WorkBudget(1_000, 1_000))
    assert quick[0] == slow[0]
    assert quick[1] == 6 < slow[1]


def test_a_debt_is_paid_before_the_program_goes_on():
    n = 1_800
    text = f"def p():\n  x = [{', '.join(['1'] * n)}]\n  while True:\n    y = x + x\n    sync()\n  end\nend\n"
    used = units_of_cycles(text, 40, WorkBudget(3_000, 3_000))
    assert max(used) < 5 * n + 3_000
    assert used.count(0) >= 20
    assert sum(used) <= 41 * 3_000 + max(used)


def test_an_operation_that_would_take_too_long_is_an_error():
    text = f"def p():\n  x = make_list({MOST_AT_ONCE // 5 + 1}, 1)\n  y = x + x\nend\n"
    running = compile_program(text, catalogue=catalogue_for("5.25")).start(RecordingHost())
    assert running.step() is ProgramStatus.FAILED
    assert running.error.line == 3
    assert "too much time" in running.error.message


def in_depth(n_threads, n_calls, body):
    """A program with threads that do `body`, each inside so many calls."""
    functions = "".join(f"  def f{i}():\n    f{i + 1}()\n  end\n" for i in range(1, n_calls))
    return (
        f"def p():\n  global turns = 0\n  thread t():\n    f1()\n  end\n{functions}  def f{n_calls}():\n{body}  end\n"
        f"  global j = 0\n  while j < {n_threads}:\n    h = run t()\n    j = j + 1\n  end\n"
        "  while True:\n    turns = turns + 1\n    sync()\n  end\nend\n"
    )


WAITING = "    while True:\n      sync()\n    end\n"


def test_resuming_a_thread_costs_its_depth():
    shallow, deep = (
        units_of_cycles(in_depth(45, n_calls, WAITING), 20, WorkBudget(1e6, 1e6)) for n_calls in (10, 190)
    )
    assert max(shallow[2:]) < 45 * 20
    assert min(deep[2:]) > 45 * (190 - FREE_CALLS)


def test_deep_threads_make_their_program_slower_not_the_cycle():
    work = WorkBudget(3_000, 3_000)
    running = compile_program(in_depth(45, 190, WAITING)).start(RecordingHost(), work)
    for cycle in range(200):
        work.renew()
        left = work.left
        running.step()
        assert left - work.left <= 3_000 + 400
        if cycle == 100:
            half = running.read_global("turns")
    assert 20 < running.read_global("turns") - half < 100 * 3_000 / (45 * (190 - FREE_CALLS))


def test_a_read_that_never_waits_costs_its_depth_each_time():
    reads = []

    def read(thread, number, name, timeout):
        yield CHECKPOINT
        reads.append(number)
        return [1, 5]

    class Host(RecordingHost):
        def builtins(self):
            return {**super().builtins(), "socket_read_binary_integer": read}

    body = "    while True:\n      x = socket_read_binary_integer(1)\n    end\n"
    work = WorkBudget(30_000, 30_000)
    running = compile_program(in_depth(1, 190, body)).start(Host(), work)
    for _ in range(20):
        work.renew()
        running.step()
    assert 0 < len(reads) <= 20 * 30_000 / (190 - FREE_CALLS)


def test_killing_a_thread_and_the_end_of_a_program_cost_the_depth():
    levels = 190 - FREE_CALLS
    text = in_depth(10, 190, WAITING).replace(
        "turns = turns + 1", "if turns == 9:\n      kill h\n    end\n    turns = turns + 1"
    )
    used = units_of_cycles(text, 20, WorkBudget(1e6, 1e6))
    assert used[9] > used[8] + (CLOSING - 1) * levels
    assert used[10] < used[8] - levels
    work = WorkBudget(1e6, 1e6)
    running = compile_program(in_depth(10, 190, WAITING)).start(RecordingHost(), work)
    running.step()
    before = work.left
    running.kill()
    assert before - work.left >= 10 * CLOSING * levels


def test_what_was_saved_lets_a_program_begin_with_thousands_of_assignments():
    text = f"def p():\n  x = 0\n  while x < {STATEMENT_BUDGET - 10}:\n    x = x + 1\n  end\nend\n"
    work = WorkBudget(30_000, 120_000)
    assert compile_program(text).start(RecordingHost(), work).step() is ProgramStatus.FINISHED
    assert 0 < work.left < 120_000 - STATEMENT_BUDGET + 20


def test_other_threads_do_not_run_while_the_program_stands_still():
    text = (
        "def p():\n  global value = 0\n  global seen = 0\n  thread other():\n    while True:\n      seen = value\n      sync()\n    end\n  end\n"
        "  run other()\n  while True:\n    value = 1\n"
        + LOOP.format(n=20_000, body="x = i")
        + "    value = 0\n    sync()\n  end\nend\n"
    )
    work = WorkBudget(3_000, 3_000)
    running = compile_program(text).start(RecordingHost(), work)
    between = 0
    for _ in range(60):
        work.renew()
        running.step()
        between += running.is_between
        assert running.is_between or running.read_global("seen") == 0
    assert between > 40
    running.kill()
    assert not running.is_between


def test_a_program_in_the_middle_of_its_cycle_does_not_wait_outside():
    text = (
        "def p():\n  thread long():\n"
        + LOOP.format(n=20_000, body="x = i")
        + '  end\n  run long()\n  socket_open("10.0.0.1", 1)\n  r = socket_read_binary_integer(1)\nend\n'
    )
    bench_work = WorkBudget(3_000, 3_000)
    running = compile_program(text).start(RecordingHost(sockets={"socket_0": FakeSocket()}), bench_work)
    outside = []
    for _ in range(30):
        bench_work.renew()
        running.step()
        outside.append(running.waits_outside and running.is_between)
    assert not any(outside)
    assert running.waits_outside


# --- in a box


@pytest.mark.parametrize("call", ['textmsg("hello ", i)', 'popup("hello", blocking=False)'])
def test_messages_of_a_flood_are_bounded(call):
    bench = Bench(fidelity="exact")
    bench.start(forever(call, 3_000))
    bench.tick(20)
    bench.events.clear()
    bench.tick(20)
    assert 20 * 25 < len(bench.events) < 20 * 35


@pytest.mark.parametrize(("generation", "units"), [(CB3, 30_000), (E_SERIES, 7_500)])
def test_a_cycle_has_its_part_of_the_units_of_8_ms(generation, units):
    bench = Bench(fidelity="exact", generation=generation)
    bench.start(forever("x = i", 50_000))
    bench.tick(20)
    used = []
    for _ in range(20):
        bench.tick()
        used.append(bench.controller.programs.work)
    assert sum(used) / len(used) == pytest.approx(units, rel=0.02)


@pytest.mark.parametrize(("period", "part"), [(0.008, 256), (0.002, 64), (0.00001, 1)])
def test_a_cycle_has_its_part_of_a_budget_and_at_least_one(period, part):
    assert of_cycle(256, period) == part


def test_on_an_e_series_a_cycle_takes_the_longer_the_more_programs_do():
    def times(body):
        bench = Bench(fidelity="exact", robot="ur5e", generation=E_SERIES)
        own = bench.now.actual_execution_time
        bench.start(f"def p():\n  while True:\n{body}    sync()\n  end\nend\n")
        bench.tick(5)
        seen = []
        for _ in range(5):
            bench.tick()
            seen.append(bench.now.actual_execution_time)
        return own, seen

    own, idle = times("")
    _, busy = times(LOOP.format(n=1_000, body="x = i"))
    assert own == E_SERIES.execution_time
    assert own < min(idle) <= max(idle) < own + 0.01
    assert min(busy) > own + 0.05
    assert times(LOOP.format(n=1_000, body="x = i")) == (own, busy)


@pytest.fixture
def few_secondary_units(monkeypatch):
    few = replace(BUDGETS, secondary_units=5_000, secondary_units_saved=5_000)
    monkeypatch.setattr("ur_emulator.machine.controller.program_runner.BUDGETS", few)


@pytest.mark.usefixtures("few_secondary_units")
def test_secondary_programs_share_units_of_their_own_and_come_in_turn():
    bench = Bench(fidelity="exact")
    bench.start("def p():\n  while True:\n    sync()\n  end\nend\n")
    for i in range(3):
        bench.start(f"sec s():\n{LOOP.format(n=8_000, body='x = i')}    textmsg({i})\nend\n")
    ticks = {}
    for tick in range(30):
        bench.tick()
        for event in bench.events:
            if isinstance(event, TextPrinted):
                ticks.setdefault(event.text, tick)
    assert list(ticks) == ["0", "1", "2"]
    assert ticks["0"] < ticks["1"] < ticks["2"]
    assert bench.controller.programs.is_running


@pytest.mark.usefixtures("few_secondary_units")
def test_a_secondary_program_that_fails_later_is_reported_and_gone():
    bench = Bench(fidelity="exact")
    bench.start(f"sec s():\n{LOOP.format(n=8_000, body='x = i')}    x = 1 / 0\nend\n")
    bench.tick(10)
    assert [e.text for e in bench.events if type(e).__name__ == "ScriptFailed"] == ["division by zero"]
    assert not bench.controller.programs.has_work


def test_secondary_programs_that_come_faster_than_they_end_are_refused():
    bench = Bench(fidelity="exact")
    sec = StartProgram(compile_program(f"sec s():\n{LOOP.format(n=50_000, body='x = i')}end\n"))
    bench.tick(1, *[sec] * (BUDGETS.secondary_programs + 2))
    refused = [event.text for event in bench.events if isinstance(event, ScriptFailed)]
    assert (
        refused
        == [f"{BUDGETS.secondary_programs} secondary programs wait already: this one is not started"] * 2
    )
    bench.tick(BUDGETS.secondary_programs * 12)
    assert not bench.controller.programs.has_work


def test_an_inverse_that_needs_many_iterations_costs_as_many():
    bench, used = Bench(), {}
    for where, pose in {
        "near": "get_actual_tcp_pose()",
        "out of reach": "p[0.548, 0, 0.15, 0, 3.14, 0]",
    }.items():
        bench.start(f"def p():\n  x = get_inverse_kin_has_solution({pose})\n  sync()\nend\n")
        used[where] = bench.controller.programs.work
    assert 5 * used["near"] < used["out of reach"] < MOST_AT_ONCE
