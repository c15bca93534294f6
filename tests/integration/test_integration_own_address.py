"""A box has one address: it is called there, and its programs call from there, as a robot's do."""

import socket

import numpy as np
import pytest

from pc_client.control.controller import APPROACH
from pc_client.control.reference import ReferenceTable
from pc_client.control.tracker import Tracker
from pc_client.driver.session import UrDriver
from pc_client.kinematics.robot_model import robot_model
from pc_client.planning.approach import JointLines
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
        goal = q + np.array([0.05, 0, 0, 0, 0, 0])
        lines = JointLines([q, goal], v=0.5, a=1.0)
        table = ReferenceTable(lines, period=driver.info.period, lead=0.0, settle=0.8)
        driver.stream(
            Tracker(table, APPROACH, robot_model("ur3")), lambda frame, step: None, acceleration=5.0
        )
        assert driver.actual_q()[0] == pytest.approx(goal[0], abs=1e-3)
