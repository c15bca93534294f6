"""Several boxes in one process, each on its own address with the same ports, none knowing of the others.

A box is called at its address, and its programs call from there, as a robot's do.
"""

import signal
import socket
import sys
import threading
from dataclasses import asdict, replace

import numpy as np
import pytest
from box_support import inside
from integration_support import (
    LAYOUT,
    TIMEOUT,
    Frames,
    connect,
    finish,
    free_port_base,
    is_closed,
    send,
    serving,
)

from pc_client.control.controller import APPROACH
from pc_client.control.reference import ReferenceTable, RunRecipe
from pc_client.control.tracker import Tracker
from pc_client.driver.session import UrDriver
from pc_client.kinematics.model import robot_model
from pc_client.planning.approach import JointLines
from protocol.ur_types import Ports, ProgramState
from ur_emulator import BoxRack, ControlBox
from ur_emulator.errors import EmulatorError, PortError
from ur_emulator.host.box_options import MAX_BOXES
from ur_emulator.host.runtime import event_loop

own_addresses = pytest.mark.skipif(
    sys.platform == "darwin", reason="only 127.0.0.1 is an address of a Mac unless others are added"
)
MOVE = "def p():\n  movej([0.1, -1.5, -1.5, 0, 1, 0])\nend\n"


def run_move(box):
    """Run a move; return all frames from its start on as bytes, heartbeats left out."""
    frames = {}
    with Frames(box) as reader:
        reader.raw()
        send(box, "secondary", MOVE)

        def keep():
            frame = reader.raw()
            frames[reader.stamps[-1]] = frame
            return LAYOUT.decode(frame)

        begin = reader.until(lambda f: f.runtime_state == ProgramState.PLAYING, keep).timestamp
        reader.until(lambda f: f.runtime_state == ProgramState.STOPPED and not any(f.target_qd), keep)
        assert reader.lost() == 0
    return [frame for stamp, frame in frames.items() if stamp >= begin]


def test_a_box_among_others_does_to_the_byte_what_it_does_alone():
    with ControlBox.many(2, seed=20, pace="lockstep", port_base=None) as boxes:
        together = {}
        threads = [
            threading.Thread(target=lambda box=box: together.update({box: run_move(box)})) for box in boxes
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        together = [together[box] for box in boxes]
    assert together[0] != together[1]
    for k, frames in enumerate(together):
        with ControlBox(in_process=True, seed=20 + k, pace="lockstep", port_base=None) as alone:
            assert run_move(alone) == frames


def test_boxes_in_real_time_take_turns_and_one_alone_computes_its_cycle_before_the_deadline():
    for count, calls, may_tick_early in ((1, [10.008], True), (4, [10.008, 10.002, 10.004, 10.006], False)):
        rack = ControlBox.many(count, in_process=True, port_base=None)
        served = [inside(box)._box for box in rack]
        pacers = [each._pacer for each in served]
        turns = [pacer.may_tick(10.0, each) for pacer, each in zip(pacers, served, strict=True)]
        assert turns == [True] + [False] * (count - 1)
        if count > 1:
            assert [pacer.next_call(10.0) for pacer in pacers] == pytest.approx(calls)
        assert pacers[0].may_tick(10.008 - 0.0003, served[0]) == may_tick_early
        rack.close()


def test_boxes_may_differ_and_when_one_is_closed_the_others_go_on():
    options = [{"port_base": None, "version": "3.4.0"}, {"port_base": None, "fidelity": "ideal", "seed": 9}]
    with BoxRack(options, in_process=True) as (one, two):
        assert [box.serial_number for box in (one, two)] == ["20993000000", "20993000009"]
        with connect(one, "realtime") as gone, Frames(two) as frames:
            assert int.from_bytes(gone.recv(4), "big") == 1060
            assert gone.recv(1060 - 4, socket.MSG_WAITALL)
            inside(one)._loop.call_soon_threadsafe(inside(one).close, pytest.fail)
            while gone.recv(1 << 16):
                pass
            for _ in range(20):
                frames.new()
            assert frames.lost() == 0
        assert inside(one)._box not in inside(one)._loop._services
        with pytest.raises(ConnectionRefusedError):
            connect(one, "dashboard")


def test_an_error_ends_its_own_box_only_and_is_raised_at_the_end():
    rack = ControlBox.many(2, in_process=True, pace="realtime", port_base=None)
    one, two = rack.__enter__()
    with connect(one, "dashboard") as gone, Frames(two) as frames:
        assert gone.recv(100).startswith(b"Connected")
        inside(one)._loop.call_soon_threadsafe(
            lambda: setattr(inside(one)._box.controller, "tick", lambda _: 1 // 0), pytest.fail
        )
        assert is_closed(gone)
        assert any("the box has ended: ZeroDivisionError" in str(entry) for entry in one.log)
        for _ in range(20):
            frames.new()
        assert frames.lost() == 0
        assert two.failure is None
    with pytest.raises(ZeroDivisionError):
        rack.__exit__(None, None, None)


def test_a_box_that_compiles_is_closed_without_waiting_for_it():
    """Another box of the loop would miss its cycles meanwhile; its programs wait no longer either."""
    with ControlBox.many(2, in_process=True, pace="lockstep", port_base=None) as (one, two):
        endless = inside(one)._box.in_worker(signal.pause)
        inside(one)._loop.call_soon_threadsafe(lambda: inside(one)._box.start_alone(endless), pytest.fail)
        inside(one)._loop.call_soon_threadsafe(inside(one).close, pytest.fail)
        with Frames(two) as frames:
            frames.raw()
            send(two, "secondary", MOVE)
            frames.until(lambda f: f.runtime_state == ProgramState.PLAYING)


@own_addresses
def test_a_taken_port_of_one_box_leaves_no_port_open():
    base = free_port_base()
    ports = Ports.standard(base)
    with socket.create_server(("127.0.0.3", ports.rtde)):
        rack = ControlBox.many(3, host="127.0.0.2", port_base=base)
        with pytest.raises(PortError, match=rf"127\.0\.0\.3:{ports.rtde}"):
            rack.__enter__()
    for host in ("127.0.0.2", "127.0.0.3"):
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((host, ports.realtime), timeout=TIMEOUT)


@pytest.mark.parametrize(
    ("count", "options", "words"),
    [
        (0, {}, f"0 boxes asked for: 1 to {MAX_BOXES}"),
        (MAX_BOXES + 1, {}, f"1 to {MAX_BOXES}"),
        (2, {"host": "localhost"}, "'localhost' given for 2 boxes"),
        (2, {"host": "0.0.0.0"}, r"'0\.0\.0\.0' given for 2 boxes"),
        (2, {"host": "255.255.255.255"}, r"'255\.255\.255\.255' given for 2 boxes"),
        (2, {"host": ""}, "'' given for 2 boxes"),
        (2, {"fidelity": "perfect"}, "perfect"),
        (2, {"seed": -1}, "seed -1"),
        (1, {"port_base": 100_000}, "port offset 100000 leaves the TCP ports: use"),
    ],
)
def test_what_cannot_be_counted_is_one_line(count, options, words):
    with pytest.raises(EmulatorError, match=words) as error:
        ControlBox.many(count, **options)
    assert "\n" not in str(error.value)


@own_addresses
def test_the_command_serves_several_boxes(tmp_path):
    with serving(tmp_path, "--boxes", 3, "--host", "127.0.0.2", "--seed", 5, "--log") as first:
        boxes = first.facts["boxes"]
        assert [box["host"] for box in boxes] == ["127.0.0.2", "127.0.0.3", "127.0.0.4"]
        assert [box["serial_number"] for box in boxes] == ["20993000005", "20993000006", "20993000007"]
        assert {key: first.facts[key] for key in boxes[0]} == boxes[0]
        ports = asdict(replace(Ports.standard(first.base), interpreter=0, robot_api=0))
        assert all(box["ports"] == ports for box in boxes)
        for k, box in enumerate(boxes[1:], 1):
            assert (
                f"ready at {box['host']}, realtime, typical, seed {5 + k}" in first.process.stdout.readline()
            )
        for box in boxes:
            with socket.create_connection((box["host"], box["ports"]["dashboard"]), timeout=TIMEOUT) as sock:
                assert sock.recv(100) == b"Connected: Universal Robots Dashboard Server\n"
        first.process.send_signal(signal.SIGINT)
        done = finish(first.process)
    assert done.code == 0
    assert {line.split()[0] for line in done.err.splitlines()} == {box["host"] for box in boxes}


def test_the_loop_waits_also_where_select_cannot(monkeypatch):
    """A process with a thousand open files: the loop's own descriptor is out of select()'s range."""
    monkeypatch.setattr(event_loop, "_SELECT_LIMIT", 0)
    with ControlBox(in_process=True, pace="realtime", port_base=None) as box, Frames(box) as frames:
        for _ in range(20):
            frames.raw()
        assert frames.lost() == 0
        with connect(box, "dashboard") as sock:
            assert sock.recv(100).startswith(b"Connected")


ELSEWHERE = "127.0.37.1"


@pytest.fixture
def box():
    with ControlBox(pace="lockstep", seed=7, host=ELSEWHERE, port_base=None) as box:
        yield box


@pytest.mark.parametrize(
    ("called", "listening"), [("127.0.0.1",) * 2, ("localhost", "127.0.0.1"), (ELSEWHERE,) * 2]
)
def test_programs_call_from_the_address_of_the_box(box, called, listening):
    with socket.create_server((listening, 0)) as server:
        server.settimeout(TIMEOUT)
        call = f'socket_open("{called}", {server.getsockname()[1]})'
        send(box, "secondary", f"def p():\n  {call}\n  sleep(0.1)\nend\n")
        caller, (address, _) = server.accept()
        caller.close()
    assert address == ELSEWHERE


def test_the_client_moves_an_arm_at_any_loopback_address(box):
    with UrDriver(ELSEWHERE, box.ports) as driver:
        q = driver.actual_q()
        goal = q + np.array([0.05, 0, 0, 0, 0, 0])
        lines = JointLines([q, goal], v=0.5, a=1.0)
        table = ReferenceTable(lines, RunRecipe.first(APPROACH, driver.info.period), lead=0.0, settle=0.8)
        driver.stream(
            Tracker(table, APPROACH, robot_model("ur3")), lambda frame, step: None, acceleration=5.0
        )
        assert driver.actual_q()[0] == pytest.approx(goal[0], abs=1e-3)
