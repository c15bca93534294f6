"""Public clients of OnRobot grippers, as they are: onrobot by XML-RPC, and modbus-serial for Node.js."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from clients_support import TIMEOUT
from gripper_support import BLOCK, block_between_pads, move_to_place

from ur_emulator import ControlBox
from ur_hil.tools import TOOLS

HERE = Path(__file__).parent
TOOL = TOOLS["onrobot-rg2"]
GRIPPED = 2  # of the status
RESTS = 0


def run(*command, **environment):
    """Run a command to its end."""
    options = {"capture_output": True, "text": True, "timeout": 5 * TIMEOUT}
    return subprocess.run(command, check=False, env=os.environ | environment, **options)


def printed(*command, **environment):
    """Return the JSON that a command prints."""
    said = run(*command, **environment)
    assert said.returncode == 0, said.stderr
    return json.loads(said.stdout)


# --- onrobot

ADDRESS = "192.168.0.99"  # fixed in the package
# A network of its own in which the machine has that address; it takes no privileges.
SET_UP = f'ip link set lo up && ip address add {ADDRESS}/32 dev lo && exec "$@"'
IN_NETWORK = ("unshare", "--user", "--map-root-user", "--net", "sh", "-c", SET_UP, "sh")


def test_onrobot():
    pytest.importorskip("onRobot.gripper")
    # Users often have no administrator's commands in their path; a proxy is not in that network.
    environment = {"PATH": f"{os.environ['PATH']}:/usr/sbin:/sbin", "NO_PROXY": "*"}
    if missing := [name for name in ("unshare", "ip") if not shutil.which(name, path=environment["PATH"])]:
        pytest.skip(f"a network of its own needs {' and '.join(missing)} (util-linux, iproute2)")
    if (said := run(*IN_NETWORK, "true", **environment)).returncode:
        pytest.skip(f"this machine allows no network of its own: {said.stderr.strip()}")
    results = printed(*IN_NETWORK, sys.executable, str(HERE / "onrobot_rg2.py"), ADDRESS, **environment)

    def about(width):
        return pytest.approx(width, abs=0.5)

    assert results == {
        "at first": about(1e3 * TOOL.stroke / 2),
        "by default": [True, about(100.0), RESTS],
        "on a block": [True, about(1e3 * BLOCK), GRIPPED],
        "too much": [True, about(100.0), RESTS],  # it never asks for more
        "whole numbers": [True, about(60.0), RESTS],
        "less than nothing": [True, about(0.0), GRIPPED],
        "of another place": [True, -999.0],
        "without power": [True, -999.0, -1],  # it does not look at the answer
        "with power again": [True, about(50.0), RESTS],
    }


# --- modbus-serial

FORCE, WIDTH, COMMAND, SET_OFFSET = 0, 1, 2, 0x0407
OFFSET, METAL_WIDTH_NOW, STATUS, WIDTH_NOW = 0x0102, 0x010B, 0x010C, 0x0113
GRIP, STOP, GRIP_WITH_OFFSET = 1, 8, 16
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, NO_POWER = ({"exception": code} for code in (1, 2, 4))


@pytest.fixture(scope="module")
def box():
    with ControlBox("ur5e", pace="lockstep", port_base=None, seed=7, tool=TOOL.name) as box:
        move_to_place(box, TOOL)
        yield box


@pytest.fixture(scope="module")
def exchange(box):
    """Function that makes calls of the client over a connection of its own, each with what it returns."""
    modules = Path(sys.prefix, "node", "node_modules")
    if not shutil.which("node") or not (modules / "modbus-serial").is_dir():
        pytest.skip("no modbus-serial: `make setup` installs it where Node.js and npm are")

    def compare(connect, port, *story):
        calls, expected = zip(*story, strict=True)
        script = str(HERE / "modbus_serial_calls.js")
        command = "node", script, connect, box.host, str(port), json.dumps(calls)
        results = printed(*command, NODE_PATH=str(modules))
        for call, result, wanted in zip(calls, results, expected, strict=True):
            assert result == wanted, call

    return compare


def starts(width):
    """A command with 40 N, and what it returns; widths in 0.1 mm."""
    return ("writeRegisters", FORCE, [400, width, GRIP_WITH_OFFSET]), {"address": FORCE, "length": 3}


def goes(width, status=RESTS):
    """The same until its end."""
    return starts(width), (("untilFree",), status)


def is_at(width, register=WIDTH_NOW, call="readHoldingRegisters"):
    return (call, register, 1), [pytest.approx(width, abs=5)]


def writes(register, value):
    return ("writeRegister", register, value), {"address": register, "value": value}


GRIPPER = ("setID", 65), None


@pytest.mark.parametrize(("connect", "port"), [("connectTCP", "modbus"), ("connectTelnet", "tool_line")])
def test_modbus_serial(box, exchange, connect, port):
    """Port 502, and the serial line: what the client calls Telnet are the bytes of Modbus RTU."""
    port = getattr(box.ports, port)
    exchange(
        connect,
        port,
        GRIPPER,
        (("getID",), 65),
        *goes(500),
        is_at(500),
        is_at(589, METAL_WIDTH_NOW, "readInputRegisters"),
        writes(WIDTH, 300),
        writes(COMMAND, GRIP),
        (("untilFree",), RESTS),
        is_at(300, METAL_WIDTH_NOW),
        writes(SET_OFFSET, 0),
        is_at(300),
        writes(SET_OFFSET, 44),
        (("readHoldingRegisters", OFFSET, 1), [44]),
        starts(1000),
        writes(COMMAND, STOP),
        (("readInputRegisters", STATUS, 1), [RESTS]),
        (("readHoldingRegisters", 0x0200, 1), ILLEGAL_ADDRESS),
        (("readCoils", 16, 8), ILLEGAL_FUNCTION),
        (("readDiscreteInputs", 0, 8), ILLEGAL_FUNCTION),
        (("writeCoil", 16, True), ILLEGAL_FUNCTION),
        (("writeCoils", 16, [True, False]), ILLEGAL_FUNCTION),
        *goes(1000),
    )
    with block_between_pads(box):
        exchange(connect, port, GRIPPER, *goes(200, GRIPPED), is_at(1e4 * BLOCK), *goes(1000))


def test_modbus_serial_over_tcp(box, exchange):
    """What the client does over TCP only, and the units beside the gripper's."""
    unsupported = (
        ("maskWriteRegister", WIDTH, 0xFFFF, 0),
        ("reportServerID", 0, 0),  # it takes arguments and does not use them
        ("readDeviceIdentification", 1, 0),
        ("readFileRecords", 1, 1),
        ("customFunction", 65, [1, 2]),
    )
    both = "readWriteRegisters", WIDTH_NOW, 1, FORCE, 3, [400, 300, STOP]
    with block_between_pads(box):
        exchange(
            "connectTCP",
            box.ports.modbus,
            GRIPPER,
            *((call, ILLEGAL_FUNCTION) for call in unsupported),
            *goes(200, GRIPPED),
            (both, [pytest.approx(1e4 * BLOCK, abs=5)]),
            (("setID", 63), None),
            writes(0, 2),  # the supply goes off and on: it forgets the grip
            GRIPPER,
            (("untilFree",), RESTS),
            *goes(1000),
            # The robot's own map.
            (("setID", 1), None),
            (("writeCoils", 16, [True, False, True]), {"address": 16, "length": 3}),
            (("writeCoil", 17, True), {"address": 17, "state": True}),
            (("readCoils", 16, 4), [True, True, True, False, False, False, False, False]),
            (("readDiscreteInputs", 16, 1), [True] + [False] * 7),
            (("writeRegisters", 128, [7, 8]), {"address": 128, "length": 2}),
            (("readInputRegisters", 128, 2), [7, 8]),
        )
    box.run_program("set_tool_voltage(0)\nsleep(0.1)\n", wait=True)
    exchange("connectTCP", box.ports.modbus, GRIPPER, (("readHoldingRegisters", STATUS, 1), NO_POWER))
    box.run_program("set_tool_voltage(24)\nsleep(0.1)\n", wait=True)
    exchange("connectTCP", box.ports.modbus, GRIPPER, (("readHoldingRegisters", STATUS, 1), [RESTS]))
