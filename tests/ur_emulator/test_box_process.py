"""Boxes in a process of their own, and boxes that somebody else serves: the same API, and nothing is left of them."""

import gc
import signal
import socket
from pathlib import Path

import psutil
import pytest
from box_support import TIMEOUT
from control_support import control_box
from dashboard_support import Dashboard

from ur_emulator import ControlBox
from ur_emulator.errors import (
    ArgumentError,
    ControlError,
    EmulatorError,
    NotRunningError,
    RefusedError,
    WaitTimeoutError,
)
from ur_emulator.host.runtime import processes
from ur_emulator.machine.commands.programs import ClosePopup

TOKEN = "secret"


def process_of(box):
    box._rack._child.look()
    return psutil.Process(box._rack._child.pid)


def test_a_box_that_is_killed_says_so_and_keeps_its_log():
    box = ControlBox(pace="lockstep", port_base=None)
    box.__enter__()
    box.add_to_log("last words")
    process_of(box).kill()
    with pytest.raises(NotRunningError, match="was ended by SIGKILL: its log shows what it did last"):
        box.wait_until(robot_mode="IDLE", timeout=TIMEOUT)
    with pytest.raises(NotRunningError, match="SIGKILL"):
        box.submit(ClosePopup())
    with pytest.raises(EmulatorError, match="the process of the box was ended by SIGKILL"):
        box.__exit__(None, None, None)
    assert box.log[-1].text == "last words"
    assert "SIGKILL" in str(box.failure)


def test_a_box_that_hangs_is_killed_at_its_end(monkeypatch):
    monkeypatch.setattr("ur_emulator.host.box_process._END_TIMEOUT", 0.1)
    box = ControlBox(pace="lockstep", port_base=None)
    box.__enter__()
    process = process_of(box)
    process.suspend()
    with pytest.raises(EmulatorError, match=r"did not end within 0\.1 s: it was killed"):
        box.__exit__(None, None, None)
    assert not psutil.wait_procs([process], timeout=TIMEOUT)[1]


def test_the_folder_of_a_box_that_was_killed_is_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "_server", None)  # a new one has the environment of this test
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    box = ControlBox(pace="lockstep", port_base=None).__enter__()
    with Dashboard(box) as dashboard:
        assert dashboard.ask("generate flight report").startswith("Flight Report generated")
    assert any(tmp_path.iterdir())
    process_of(box).kill()
    with pytest.raises(EmulatorError):
        box.__exit__(None, None, None)
    assert not any(tmp_path.iterdir())
    processes._server.end()


def test_a_box_that_has_ended_was_never_started_or_is_forgotten_leaves_no_process():
    started = ControlBox(pace="lockstep", port_base=None)
    started.__enter__()
    made = ControlBox(pace="lockstep", port_base=None)
    left = [process_of(started), process_of(made)]
    with ControlBox(pace="lockstep", port_base=None) as ended:
        left.append(process_of(ended))
    del started
    made.close()
    gc.collect()
    assert not psutil.wait_procs(left, timeout=TIMEOUT)[1]


def test_a_server_that_was_killed_is_replaced_and_its_boxes_go_on():
    with ControlBox(pace="lockstep", port_base=None) as box:
        server = processes._server.process
        server.send_signal(signal.SIGKILL)
        server.wait()
        with ControlBox(pace="lockstep", port_base=None) as other:
            assert other.state == box.state
            for each in (box, other):  # the worker of one of them comes from a server of its own
                each.run_program("textmsg(1)")


def test_files_are_relative_to_the_folder_of_the_user(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("hello.script").write_text('textmsg("hello")\n')
    with ControlBox(pace="lockstep", port_base=None, programs=".") as box:
        box.run_program(file="hello.script")
        box.wait_until(log="hello")


def test_what_cannot_be_sent_or_done_is_an_error_of_the_caller():
    with ControlBox(pace="lockstep", port_base=None) as box:
        with pytest.raises(ArgumentError, match="allowed is JSON object"):
            box.at(99, "push", {"force": (x for x in (1, 2, 3))})
        with pytest.raises(ControlError, match="the time has passed"):
            box.at(0.0, "protective_stop")
        assert box.state.steady


# --- boxes that somebody else serves


@pytest.fixture(scope="module")
def served():
    with control_box(control_token=TOKEN, in_process=True) as box:
        yield box


@pytest.fixture
def attached(served):
    return ControlBox.attach(served.host, served.control_port, TOKEN)


def test_an_attached_box_is_used_like_a_box_of_ones_own(served, attached):
    assert (attached.host, attached.ports, attached.serial_number) == (
        served.host,
        served.ports,
        served.serial_number,
    )
    attached.add_thing("ball", "sphere", (0.03,), 0.1, (0.3, 0.3, 0.01, 0.0, 0.0, 0.0))
    attached.run_program('def p():\n  popup("look")\n  movej([0.5, -1.5, -1.8, 0, 1.2, 1.5])\nend\n')
    state = attached.wait_until(program_state="STOPPED", steady=True)
    state = attached.wait_until(time=state.time + 1.0)
    assert state == served.state == attached.state
    assert state.popups == ("look",)
    assert state.things[0].touches_tool is False
    (shape,) = (shape for shape in state.shapes if shape.name == "ball")
    assert (shape.shape, shape.size, shape.is_carried) == ("sphere", (0.03,), False)
    assert shape.pose == state.things[0].pose
    assert {state.contacts[0].first, state.contacts[0].second} == {"ball", "table"}
    attached.remove_thing("ball")
    assert attached.close_popups() == served.state.tick
    assert attached.log == served.log
    assert attached.identity == served.identity


def test_errors_of_an_attached_box_are_those_of_a_box_of_ones_own(attached):
    with pytest.raises(WaitTimeoutError, match="waited 0 s in vain"):
        attached.wait_until(robot_mode="IDLE", timeout=0)
    with pytest.raises(RefusedError, match="no obstacle"):
        attached.remove_obstacle("wall")
    with pytest.raises(ArgumentError, match="force"):
        attached.push(force=3)
    for refused in (lambda: attached.submit(ClosePopup()), lambda: attached.follow_log(print)):
        with pytest.raises(ControlError, match="attached"):
            refused()
    assert (attached.is_shut_down, attached.failure) == (False, None)


def test_whom_nobody_serves_cannot_be_attached(served):
    with pytest.raises(ControlError, match="needs its token"):
        ControlBox.attach(served.host, served.control_port)
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        port = nobody.getsockname()[1]
    with pytest.raises(ControlError, match=f"no box answers at 127.0.0.1:{port}"):
        ControlBox.attach(port=port)
