"""A box has one address: it is called there, and its programs call from there, as a robot's do."""

import socket

import pytest

from pc_client.driver.ur_driver import UrDriver
from ur_emulator import ControlBox

ELSEWHERE = "127.0.37.1"


@pytest.fixture
def box():
    with ControlBox(pace="lockstep", seed=7, host=ELSEWHERE, port_base=None) as box:
        yield box


def dial(box, host, port):
    with socket.create_connection((box.host, box.ports.secondary), timeout=10) as client:
        client.sendall(f'def p():\n  socket_open("{host}", {port})\n  sleep(0.1)\nend\n'.encode())


@pytest.mark.parametrize("listening", ["127.0.0.1", ELSEWHERE])
def test_programs_call_from_the_address_of_the_box(box, listening):
    with socket.create_server((listening, 0)) as server:
        server.settimeout(10)
        dial(box, listening, server.getsockname()[1])
        caller, (address, _) = server.accept()
        caller.close()
    assert address == ELSEWHERE


def test_a_name_is_called_from_there_too(box):
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(10)
        dial(box, "localhost", server.getsockname()[1])
        caller, (address, _) = server.accept()
        caller.close()
    assert address == ELSEWHERE


def test_the_client_moves_an_arm_at_any_loopback_address(box):
    with UrDriver(ELSEWHERE, box.ports) as driver:
        q = driver.actual_q()
        goal = [q[0] + 0.05, *q[1:]]
        driver.move_to(goal, speed=0.5, acceleration=1.0, expected=1.0)
        assert driver.actual_q()[0] == pytest.approx(goal[0], abs=1e-3)
