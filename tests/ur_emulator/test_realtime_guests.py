"""Long work beside a loop waits while the loop is awake, and ends in any case."""

import threading

import pytest

from ur_emulator.realtime import guests as module
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.realtime.guests import Guests
from urscript import compile_program
from urscript.courtesy import giving_way


class Asleep:
    """Stands for the event: says whether the loop sleeps, counts who waits for it."""

    def __init__(self):
        self.is_asleep = False
        self.waits = 0
        self.comes = True

    def is_set(self):
        return self.is_asleep

    def set(self):
        self.is_asleep = True

    def clear(self):
        self.is_asleep = False

    def wait(self, timeout):
        self.waits += 1
        return self.comes


@pytest.fixture
def clock(monkeypatch):
    class Clock:
        now = 100.0

        def perf_counter(self):
            return self.now

    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    return clock


def guests_beside(**more):
    guests = Guests(wait=True, **more)
    guests._asleep = Asleep()
    return guests, guests._asleep


def test_a_guest_works_while_the_loop_sleeps_and_waits_while_it_is_awake(clock):
    guests, asleep = guests_beside()
    with guests.working() as give_way:
        guests.fall_asleep()
        give_way()
        assert asleep.waits == 0
        guests.wake_up()
        give_way()
        assert asleep.waits == 1
        give_way()
        assert asleep.waits == 2


def test_beside_a_loop_that_never_sleeps_a_guest_works_a_little_now_and_then(clock):
    guests, asleep = guests_beside()
    asleep.comes = False
    with guests.working() as give_way:
        for _ in range(100):
            give_way()
        assert asleep.waits == 1
        clock.now += module.FREE_WORK
        for _ in range(100):
            give_way()
        assert asleep.waits == 2


def test_a_loop_without_guests_does_nothing_for_them():
    guests, asleep = guests_beside()
    guests.fall_asleep()
    assert not asleep.is_asleep
    with guests.working(), guests.working():
        guests.fall_asleep()
        assert asleep.is_asleep
    guests.wake_up()
    assert asleep.is_asleep


def test_nobody_waits_for_a_loop_without_deadlines_or_one_that_has_ended():
    free = Guests(wait=False)
    free._asleep = asleep = Asleep()
    with free.working() as give_way:
        give_way()
    assert asleep.waits == 0
    guests = Guests(wait=True)
    guests.leave_alone()
    with guests.working() as give_way:
        guests.wake_up()
        give_way()


def test_a_guest_of_a_running_loop_gets_its_work_done():
    class Ticker:
        def advance(self, now):
            return now + 0.002

    loop = EventLoop()
    loop.add(Ticker())
    done = []

    def work():
        with loop.guests.working() as give_way:
            for step in range(500):
                give_way()
                done.append(step)
        loop.stop()

    thread = threading.Thread(target=work)
    thread.start()
    loop.run()
    thread.join()
    loop.close()
    assert done == list(range(500))


def test_compiling_gives_way_all_along():
    text = "def p():\n  x = 0\n" + "  x = x + 1\n" * 1000 + "  def f(a):\n    return a\n  end\n  f(x)\nend\n"
    calls = []
    program = compile_program(text)
    assert calls == []
    with giving_way(lambda: calls.append(1)):
        again = compile_program(text)
    # At least thrice for each statement: reading, looking at names and types, compiling.
    assert len(calls) > 3 * 1000
    assert [code.co_code for code in again.codes] == [code.co_code for code in program.codes]
    compile_program(text)
    count = len(calls)
    assert len(calls) == count
