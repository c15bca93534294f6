"""A short fuzz run of every port on every test run, Hypothesis's own sequences, and the same bytes over sockets.

The long run is `python tests/fuzz/campaign.py --cases 1000000`.
"""

import random
import socket
from itertools import pairwise

import pytest
from box_support import FrameReader, connect
from dashboard_support import Dashboard, write_programs
from fuzz_box import FuzzBox, run
from fuzz_corpus import MESSAGES
from fuzz_mutations import mutate_bytes
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from ur_emulator import ControlBox

PORTS = sorted(MESSAGES)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_programs(tmp_path_factory.mktemp("programs"))


def repeat(do, n_times):
    for _ in range(n_times):
        do()


@pytest.mark.parametrize("seed", range(2))
def test_no_bytes_move_the_arm_or_harm_others(folder, seed):
    cases = run(random.Random(seed), folder, 1500, lively=False)
    assert set(cases) == set(PORTS)


@pytest.mark.parametrize("seed", range(2))
def test_no_bytes_harm_a_box_that_works(folder, seed):
    run(random.Random(seed), folder, 1500, lively=True)


def test_the_harness_notices_an_arm_that_moves(folder):
    fuzz = FuzzBox(random.Random(1), folder, lively=False)
    client, _ = fuzz.join("secondary")
    fuzz.send("secondary", client, b"movej([0, -1.57, 1.57, 0, 0, 0])\n")
    with pytest.raises(AssertionError, match="the arm moved"):
        repeat(fuzz.cycle, 200)
    fuzz.close()


def test_the_harness_notices_an_error_of_a_port(folder, monkeypatch):
    fuzz = FuzzBox(random.Random(1), folder, lively=False)
    monkeypatch.setattr(fuzz.ports["rtde"], "_answer", lambda *args: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        repeat(lambda: fuzz.attack("rtde"), 2000)
    fuzz.close()


def test_a_flood_of_rtde_requests_is_answered_over_many_cycles(folder):
    """64 KiB of the shortest request once held the loop for half a second."""
    fuzz = FuzzBox(random.Random(1), folder, lively=False)
    (client, reader), n_requests = fuzz.join("rtde"), 2000
    client.send(b"\x00\x03P" * n_requests)
    fuzz.turn()
    reader.feed(client.take())
    assert 0 < reader.n_replies < 100
    repeat(fuzz.cycle, n_requests // reader.n_replies + 5)
    assert reader.n_replies == n_requests
    fuzz.close()


def test_rtde_packages_that_come_faster_than_they_are_looked_at_end_the_connection(folder):
    fuzz = FuzzBox(random.Random(1), folder, lively=False)
    client, _ = fuzz.join("rtde")
    client.send(b"\x00\x03P" * 200_000)
    repeat(fuzz.turn, 100)
    assert not client.is_open
    fuzz.cycle()
    fuzz.close()


@pytest.mark.parametrize("port", PORTS)
def test_little_is_taken_from_a_client_in_a_turn(folder, port):
    """64 KiB of line breaks on a script port once kept a cycle waiting for 100 ms and more."""
    fuzz = FuzzBox(random.Random(1), folder, lively=False)
    client, _ = fuzz.join(port)
    client.send(b"\n" * 65_536)
    fuzz.turn()
    assert len(b"".join(client.sock.incoming)) >= 65_536 - 8192
    fuzz.close()


class Sessions(RuleBasedStateMachine):
    """Sequences that Hypothesis finds, and makes short when one fails."""

    fuzz = None

    @initialize()
    def begin(self):
        self.fuzz = FuzzBox(random.Random(1), None, lively=False)

    @rule(port=st.sampled_from(PORTS), seed=st.integers(0, 2**32))
    def attack(self, port, seed):
        self.fuzz.rng = random.Random(seed)
        self.fuzz.attack(port)

    @rule(port=st.sampled_from(PORTS), data=st.binary(max_size=60))
    def bytes(self, port, data):
        for wire in tuple(self.fuzz.hostile[port])[:1]:
            self.fuzz.send(port, wire, data)

    @rule()
    def cycle(self):
        self.fuzz.cycle()

    @rule()
    def heartbeat(self):
        self.fuzz.heartbeat()

    def teardown(self):
        if self.fuzz is not None:
            try:
                self.fuzz.settle()
            finally:
                self.fuzz.close()


Sessions.TestCase.settings = settings(max_examples=15, stateful_step_count=40, derandomize=True)
TestSessions = Sessions.TestCase


@pytest.mark.parametrize("port", PORTS)
def test_the_same_over_sockets(folder, port):
    rng = random.Random(port)
    with (
        ControlBox(pace="lockstep", port_base=None, programs=folder, control_port=0) as box,
        connect(box, "realtime") as honest,
        Dashboard(box) as dashboard,
    ):
        frames = FrameReader(honest)
        first = frames.next()
        number = box.control_port if port == "control" else getattr(box.ports, port)
        for _ in range(60):
            with socket.create_connection((box.host, number)) as sock:
                sock.setblocking(False)
                for _ in range(5):
                    data = mutate_bytes(rng, MESSAGES[port](rng, False), lambda: MESSAGES[port](rng, False))
                    data = data.replace(b"shutdown", b"shut")  # that would be obeyed
                    try:
                        sock.send(data)
                    except OSError:
                        break
        assert dashboard.ask("robotmode").startswith("Robotmode: ")
        now, times = box._box.controller.snapshot, [first.timestamp]
        while (
            times[-1] < now.timestamp
        ):  # time stands still between two cycles: frames repeat themselves then
            frame = frames.next()
            times.append(frame.timestamp)
            assert abs(frame.target_q - first.target_q).max() < 0.02
        assert all(b - a < 0.009 for a, b in pairwise(times))
