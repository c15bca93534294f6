"""A short fuzz run of every port on every test run.

The long run is `python tests/fuzz/campaign.py --cases 1000000`.
"""

import random
import socket

import fuzz_box
import pytest
from box_support import inside
from dashboard_support import write_programs
from fuzz_box import CB3, E_SERIES, POLYSCOPE_X, FuzzBox, run
from fuzz_corpus import MESSAGES

from ur_emulator.budgets import BUDGETS

KINDS = {"cb3": CB3, "e-series": E_SERIES, "polyscope-x": POLYSCOPE_X}
# Ports that a box does not have.
TOOL = {"gripper", "tool_line"}
NOT_THERE = {
    "cb3": {"interpreter", "robot_api"} | TOOL,
    "e-series": {"robot_api", "onrobot"},
    "polyscope-x": {"dashboard", "onrobot"} | TOOL,
}
PORTS = sorted(MESSAGES.keys() - NOT_THERE["cb3"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_programs(tmp_path_factory.mktemp("programs"))


@pytest.fixture
def fuzz(folder):
    fuzz = FuzzBox(random.Random(1), folder, lively=False)
    yield fuzz
    fuzz.close()


def repeat(do, n_times):
    for _ in range(n_times):
        do()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lively", [False, pytest.param(True, marks=pytest.mark.nightly)])
def test_no_bytes_harm_a_box_or_move_its_arm_unless_it_is_lively(folder, kind, lively):
    cases = run(random.Random(0), folder, 700, lively=lively, kind=KINDS[kind])
    assert set(cases) >= set(MESSAGES) - NOT_THERE[kind]


def test_the_harness_notices_an_arm_that_moves(fuzz):
    client, _ = fuzz.join("secondary")
    fuzz.send("secondary", client, b"movej([0, -1.57, 1.57, 0, 0, 0])\n")
    with pytest.raises(AssertionError, match="the arm moved"):
        repeat(fuzz.cycle, 200)


def test_the_harness_notices_an_error_of_a_port(fuzz, monkeypatch):
    monkeypatch.setattr(inside(fuzz.box)._port_set._ports["rtde"], "_find_streams", lambda: 1 / 0)
    with pytest.raises(AssertionError, match="ZeroDivisionError"):
        repeat(lambda: fuzz.attack("rtde"), 2000)


def test_the_harness_notices_what_is_not_released(fuzz, monkeypatch):
    monkeypatch.setattr(fuzz_box, "_LONGEST_QUEUE", 0.08)
    kept = socket.socket()
    with pytest.raises(AssertionError, match="descriptors"):
        fuzz.settle()
    kept.close()


def test_a_flood_of_rtde_requests_is_answered_over_many_cycles(fuzz):
    """64 KiB of the shortest request once held the loop for half a second."""
    (client, reader), n_requests = fuzz.join("rtde"), 2000
    client.send(b"\x00\x03P" * n_requests)
    fuzz.turn()
    reader.feed(client.take())
    assert 0 < reader.n_replies < 100
    for _ in range(n_requests // reader.n_replies + 5):
        fuzz.cycle()
    assert reader.n_replies == n_requests


def test_rtde_packages_that_come_faster_than_they_are_answered_are_not_read(fuzz):
    client, _ = fuzz.join("rtde")
    client.send(b"\x00\x03P" * 200_000)
    for _ in range(100):
        fuzz.turn()
        for session in inside(fuzz.box)._port_set._ports["rtde"]._sessions.values():
            assert len(session.protocol._buffer) <= 2 * BUDGETS.read_bytes
    client.take()
    assert client.is_open
    fuzz.cycle()


def test_little_is_taken_from_a_client_in_a_turn(fuzz, monkeypatch):
    """64 KiB of line breaks on a script port once kept a cycle waiting for 100 ms and more."""
    for port in PORTS:
        served, taken = inside(fuzz.box)._port_set._ports[port], []

        def count(client, data, taken=taken, received=served.received):
            taken.append(len(data))
            received(client, data)

        monkeypatch.setattr(served, "received", count)
        client, _ = fuzz.join(port)
        client.send(b"\n" * 65_536)
        fuzz.turn()
        assert 0 < sum(taken) <= BUDGETS.read_bytes, port
        client.close()
