"""The loop itself, with real sockets: who is called, and what an error ends."""

import selectors
import socket
import threading
import time
from itertools import pairwise
from types import SimpleNamespace

import pytest

from ur_emulator.host import rack
from ur_emulator.host.runtime.event_loop import EventLoop


@pytest.fixture
def loop():
    made = EventLoop()
    yield made
    made.close()


@pytest.fixture
def pairs():
    made = [socket.socketpair() for _ in range(2)]
    yield made
    for pair in made:
        for end in pair:
            end.close()


def run_once(loop):
    """Let the loop take one turn."""
    loop.call_soon_threadsafe(loop.stop, pytest.fail)
    loop.run()


@pytest.mark.parametrize("number_is_taken", [False, True])
def test_a_socket_that_was_closed_in_the_same_turn_is_not_called(loop, pairs, number_is_taken):
    called, spare = [], []
    ends = {pair[0]: pair[0].fileno() for pair in pairs}

    def ready(sock):
        called.append(sock)
        for other, number in ends.items():
            if other is not sock:
                loop.unwatch(other)
                other.close()
                if number_is_taken:  # the system gives the lowest free number
                    new, far = socket.socketpair()
                    spare.extend((new, far))
                    assert number in (new.fileno(), far.fileno())
                    loop.watch(
                        new if new.fileno() == number else far,
                        selectors.EVENT_READ,
                        called.append,
                        pytest.fail,
                    )

    for near, far in pairs:
        far.send(b"x")
        loop.watch(near, selectors.EVENT_READ, lambda events, near=near: ready(near), pytest.fail)
    run_once(loop)
    for sock in spare:
        sock.close()
    assert len(called) == 1


class Due:
    """A service that is due so often [s]; stops its loop after so many turns. Notes each turn in a story."""

    def __init__(self, loop, story, period, turns):
        self._loop, self._story, self._period, self._turns = loop, story, period, turns

    def advance(self, now):
        self._story.append("service")
        if self._story.count("service") > self._turns:
            self._loop.stop()
        return now + self._period


def until_due(loop, story, name, period):
    """Return a callback that takes longer than the service may wait."""

    def callback(events=0):
        story.append(name)
        end = time.monotonic() + 2 * period
        while time.monotonic() < end:
            pass

    return callback


@pytest.mark.parametrize("period", [0.002, 0.0], ids=["in time", "late"])
def test_a_service_is_called_between_long_callbacks_and_nobody_has_two_turns_in_a_round(loop, pairs, period):
    story = []
    for name, (near, far) in zip("ab", pairs, strict=True):
        far.send(b"x")  # never read: ready in every round
        loop.watch(near, selectors.EVENT_READ, until_due(loop, story, name, period + 0.001), pytest.fail)
    loop.add(Due(loop, story, period, 9))
    loop.run()
    turns = [name for name in story if name != "service"]
    assert sorted(turns[:2]) == ["a", "b"]
    assert turns == (turns[:2] * 9)[: len(turns)]
    assert all({a, b} != {"a", "b"} for a, b in pairwise(story))


def test_a_late_service_with_a_short_cycle_waits_for_one_callback_of_a_tenth_of_it(loop, pairs):
    story = []
    loop.keep_pace(0.002)
    for name, (near, far) in zip("ab", pairs, strict=True):
        far.send(b"x")
        loop.watch(near, selectors.EVENT_READ, until_due(loop, story, name, 100e-6), pytest.fail)
    loop.add(Due(loop, story, 0.0, 20))
    loop.run()
    assert all("service" in turns for turns in pairwise(story))


def test_calls_that_call_themselves_again_do_not_keep_sockets_and_services_waiting(loop, pairs):
    story = []
    near, far = pairs[0]
    far.send(b"x")
    loop.watch(near, selectors.EVENT_READ, lambda events: story.append("socket"), pytest.fail)

    def again():
        story.append("call")
        loop.call_soon(again, pytest.fail)

    loop.call_soon(again, pytest.fail)
    loop.add(Due(loop, story, 0.0, 50))
    loop.run()
    assert abs(story.count("call") - story.count("socket")) <= 1
    assert story.count("call") > 9


def test_a_loop_that_does_not_end_is_an_error(monkeypatch):
    monkeypatch.setattr(rack, "_JOIN_TIMEOUT", 0.0)
    may_end = threading.Event()
    runner = rack.LoopRack(())
    runner.loop.add(SimpleNamespace(advance=lambda now: may_end.wait(20.0)))
    runner.start()
    assert "its ports are still open; end the process" in str(runner.join())
    may_end.set()
    runner._thread.join()


def test_a_call_for_later_comes_after_its_time_and_in_order(loop):
    called = []
    for delay in (0.002, 0.001, 0.0):
        loop.call_later(delay, lambda delay=delay: called.append(delay), pytest.fail)
    loop.call_later(0.003, loop.stop, pytest.fail)
    loop.run()
    assert called == [0.0, 0.001, 0.002]


# --- what an error ends


def fail(*arguments):
    raise KeyError("defect")


@pytest.fixture
def ready(pairs):
    """A socket with a byte to read."""
    near, far = pairs[0]
    far.send(b"x")
    return near


@pytest.mark.parametrize("closes", [False, True])
def test_the_owner_of_a_socket_is_informed_once_and_the_socket_is_no_longer_watched(loop, ready, closes):
    errors = []

    def close_and_fail(events):
        if closes:
            loop.unwatch(ready)
            ready.close()
        fail()

    loop.watch(ready, selectors.EVENT_READ, close_and_fail, errors.append)
    loop.add(Due(loop, [], 0.0, 5))
    loop.run()
    assert [repr(error) for error in errors] == ["KeyError('defect')"]
    assert closes or ready not in loop._selector.get_map()


def test_a_call_and_a_service_that_fail_keep_no_other_from_its_turn(loop):
    errors, done = [], []
    loop.call_soon(fail, errors.append)
    loop.call_soon_threadsafe(fail, errors.append)
    loop.call_soon(lambda: done.append(1), pytest.fail)
    loop.add(SimpleNamespace(advance=fail, failed=errors.append))  # a service is called no more
    loop.add(Due(loop, [], 0.0, 5))
    loop.run()
    assert (len(errors), done) == (3, [1])


def test_an_error_that_nobody_takes_ends_the_loop(loop):
    loop.call_soon(fail, lambda error: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        loop.run()
