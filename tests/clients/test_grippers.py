"""Public clients of Robotiq grippers, as they are, on an e-Series arm with one: port 63352, and the serial line at 54321."""

import asyncio
import json
import os
import select
import shutil
import socket
import subprocess
import sys
import threading
import tty
from contextlib import contextmanager, suppress
from pathlib import Path
from unittest.mock import ANY

import pytest
from clients_support import TIMEOUT, wait_until
from gripper_support import BLOCK, block_between_pads, move_to_place

from ur_emulator import ControlBox
from ur_hil.tools import TOOLS

HAND = TOOLS["robotiq-2f85"]


@pytest.fixture(scope="module")
def box():
    with ControlBox("ur5e", pace="lockstep", port_base=None, seed=7, tool=HAND.name) as box:
        move_to_place(box, HAND)
        yield box


@pytest.fixture
def line(box):
    """Address of the serial line, when the software of port 63352 has given it back."""
    address = box.host, box.ports.tool_line

    def answers():
        with socket.create_connection(address, timeout=0.5) as client, suppress(TimeoutError):
            client.sendall(bytes.fromhex("09 04 07 D0 00 01 30 0F"))
            return bool(client.recv(100))
        return False

    wait_until(answers, "an answer on the serial line")
    return address


# --- port 63352


def test_airo_robots(box):
    airo = pytest.importorskip("airo_robots.grippers.hardware.robotiq_2f85_urcap")
    gripper = airo.Robotiq2F85(box.host, box.ports.gripper)
    assert gripper.gripper_is_active()
    assert gripper.speed == gripper.gripper_specs.max_speed
    gripper.move(0.02).wait()
    assert gripper.get_current_width() == pytest.approx(0.02, abs=0.002)
    gripper.speed, gripper.max_grasp_force = 0.1, 100.0
    assert gripper.speed == pytest.approx(0.1, abs=0.001)
    assert gripper.max_grasp_force == pytest.approx(100.0, abs=1.0)
    gripper.open().wait()
    assert gripper.get_current_width() == pytest.approx(0.084, abs=0.001)
    gripper.close().wait()
    assert gripper.get_current_width() < 0.002
    assert not gripper.is_an_object_grasped()
    asyncio.run(gripper.asyncio_move(0.06, speed=0.15, force=50.0))
    assert not gripper.is_gripper_moving()
    with block_between_pads(box):
        gripper.close().wait()
        assert gripper.is_an_object_grasped()
        assert gripper.get_current_width() == pytest.approx(BLOCK, abs=0.002)
        gripper.open().wait()
    gripper._deactivate_gripper()
    assert not gripper.gripper_is_active()


def ur_rtde(box, *calls):
    """Have ur_rtde's client do this on a connection of its own; return the results, and what it has printed."""
    pytest.importorskip("rtde_control")
    child = Path(__file__).with_name("ur_rtde_gripper.py")
    command = [sys.executable, str(child), box.host, str(box.ports.gripper)]
    calls = (("connect", 2000), *calls)
    said = subprocess.run(
        [*command, json.dumps(calls)], capture_output=True, text=True, timeout=TIMEOUT, check=False
    )
    results = [json.loads(text[3:]) for text in said.stdout.splitlines() if text.startswith("=> ")]
    assert len(results) == len(calls) or said.returncode, said.stderr
    return results[1:], said.stdout + said.stderr


START, WAIT = 0, 1  # move modes
POSITION, SPEED = 0, 1
DEVICE, NORMALIZED, PERCENT, MILLIMETERS = range(4)
OPEN = 0


def test_ur_rtde(box):
    story = (
        (("isConnected",), True),
        (("activate", False), None),
        (("isActive",), True),
        (("autoCalibrate", 1.0), None),
        (("getNativePositionRange",), [3, 230]),
        (("getOpenPosition",), 227 / 255),
        (("getClosedPosition",), 0.0),
        (("setSpeed", 1.0), 1.0),
        (("setForce", 0.25), 64 / 255),
        (("close", -1, -1, WAIT), 3),
        (("isClosed",), True),
        (("setUnit", POSITION, PERCENT), None),
        (("move", 50, -1, -1, WAIT), 3),
        (("getCurrentPosition",), 50),
        (("setUnit", POSITION, MILLIMETERS), None),
        (("setPositionRange_mm", 85), None),
        (("move", 70, 1.0, 0.5, WAIT), 3),
        (("getCurrentPosition",), 70),
        (("setUnit", POSITION, DEVICE), None),
        (("getCurrentPosition",), 20),
        (("open", -1, -1, START), ANY),  # 0 on the way; 3 where a quick box is there already
        (("waitForMotionComplete",), 3),
        (("isOpen",), True),
        (("getVars", "STA", "OBJ", "ACT", "POS", "SPE", "FOR"), [3, 3, 1, 3, 255, 64]),
        (("setVar", "MSC", 45), True),
        (("setVar", "MSC", 999), False),
        (("emergencyRelease", OPEN, WAIT), None),
        (("faultStatus",), 15),
        (("isActive",), False),
        (("setNativePositionRange", 0, 255), None),
        (("disconnect",), None),
        (("isConnected",), False),
    )
    calls, expected = zip(*story, strict=True)
    results, _ = ur_rtde(box, *calls)
    for call, result, wanted in zip(calls, results, expected, strict=True):
        # Positions are whole counts.
        close = pytest.approx(wanted, abs=0.5) if call == ("getCurrentPosition",) else wanted
        assert result == (pytest.approx(wanted) if isinstance(wanted, float) else close), call


def test_ur_rtde_is_told_that_there_is_no_power(box):
    box.power_off()
    results, said = ur_rtde(box, ("isActive",), ("disconnect",))
    assert results == []
    assert "GripperStateException" in said
    box.power_on()
    box.release_brakes()
    box.wait_until(robot_mode="RUNNING")
    results, _ = ur_rtde(box, ("getVar", "STA"), ("getVar", "FLT"))
    assert results == [0, 0]


# --- the serial line


def test_pyrobotiqgripper(box, line, capsys):
    client = pytest.importorskip("pyrobotiqgripper")
    host, port = line
    gripper = client.RobotiqGripper(
        connection_type=client.GRIPPER_MODE_RTU_VIA_TCP, tcp_host=host, tcp_port=port
    )
    gripper.reset()
    assert not gripper.isActivated()
    with pytest.raises(client.GripperFaultError) as fault:
        gripper.start()
    assert fault.value.code == 7
    gripper.activate(start=False)
    assert gripper.isActivated()
    assert not gripper.isStarted()
    gripper.start()
    assert gripper.isStarted()
    gripper.close()
    assert gripper.objectDetection() == 3
    gripper.open()
    assert gripper.position() == 3
    gripper.move(100, speed=200, force=10)
    asked = gripper.positionCommand(), gripper.speed(), gripper.force()
    assert (gripper.position(), *asked) == (100, 100, 200, 10)
    assert gripper.lastMoveDirection() == 1
    gripper.move(200, speed=None, force=None, readStatus=False, wait=False)
    gripper.stop()
    assert not gripper.isStarted()
    gripper.move(60, start=True)
    assert gripper.position() == 60
    gripper.move(200, wait=False)
    gripper.moveToCurrentPosition()
    assert gripper.isStarted()
    gripper.calibrate_bit()
    gripper.calibrate_mm(closemm=0, openmm=85)
    gripper.calibrate_speed(minSpeedClosingTime=4.25, maxSpeedClosingTime=0.57)
    assert (gripper.open_mm(), gripper.close_mm()) == (85, 0)
    assert gripper.positioningResolution() == pytest.approx(85 / 227)
    assert gripper.minSpeedMmSecond() == pytest.approx(20.0)
    assert gripper.maxSpeedMmSecond() == pytest.approx(149.1, abs=0.1)
    gripper.move_mm(60)
    assert gripper.position_mm() == pytest.approx(60, abs=0.4)
    gripper.realTimePositionMove(0.9)
    gripper.realTimeSpeedMove(-0.5)
    gripper.open()
    with block_between_pads(box):
        gripper.close(force=100)
        gripper.printObjectDetection()
        assert gripper.objectDetection() == 2
        assert gripper.position_mm() == pytest.approx(1e3 * BLOCK, abs=1.0)
        gripper.open()
    status = gripper.status()
    del status["time"]
    assert list(status) == ["gOBJ", "gSTA", "gGTO", "gACT", "kFLT", "gFLT", "gPR", "gPO", "gCU"]
    assert list(status.values()) == [3, 3, 1, 1, 0, 0, 0, 3, 0]
    gripper.printStatus()
    said = capsys.readouterr().out
    assert "stopped due to a contact while closing" in said
    assert "Activation is completed" in said
    columns = *client.COMMAND_HISTORY_COLUMNS_ID_2_NAME, *client.STATUS_HISTORY_COLUMNS_ID_2_NAME
    assert gripper.historyNumpy().shape[1] == len(columns) - 1
    gripper.disconnect()


@contextmanager
def serial_port(address):
    """A serial port that leads to a TCP port, as socat makes it; gives its name and all bytes that have passed."""
    passed = bytearray()
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    wake, woken = os.pipe()

    def pass_on(peer):
        while True:
            ready, _, _ = select.select([ours, peer, wake], [], [])
            if wake in ready:
                return
            for source in ready:
                data = os.read(ours, 256) if source is ours else peer.recv(256)
                passed.extend(data)
                os.write(ours, data) if source is peer else peer.sendall(data)

    with socket.create_connection(address, timeout=TIMEOUT) as peer:
        thread = threading.Thread(target=pass_on, args=(peer,), daemon=True)
        thread.start()
        try:
            yield os.ttyname(theirs), passed
        finally:
            os.write(woken, b"x")
            thread.join(TIMEOUT)
            for descriptor in (ours, theirs, wake, woken):
                os.close(descriptor)


def test_minimalmodbus(line):
    client = pytest.importorskip("minimalmodbus")
    with serial_port(line) as (port, passed):
        gripper = client.Instrument(port, 9)
        gripper.serial.baudrate, gripper.serial.timeout = 115200, TIMEOUT

        def passes(frames, call, *arguments, **options):
            """Return what a call returns, which exchanges these frames of the maker's manual."""
            passed.clear()
            result = call(*arguments, **options)
            assert bytes(passed) == bytes.fromhex(frames)
            return result

        reset = "09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30  09 10 03 E8 00 03 01 30"
        passes(reset, gripper.write_registers, 0x03E8, [0, 0, 0])
        activate = "09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1  09 10 03 E8 00 03 01 30"
        passes(activate, gripper.write_registers, 0x03E8, [0x0100, 0, 0])
        activating = "09 03 07 D0 00 01 85 CF  09 03 02 11 00 55 D5"
        assert passes(activating, gripper.read_register, 0x07D0) == 0x1100
        while gripper.read_register(0x07D0, functioncode=4) != 0x3100:
            pass
        passes("09 04 07 D0 00 01 30 0F  09 04 02 31 00 4D 61", gripper.read_register, 0x07D0, functioncode=4)
        close = "09 10 03 E8 00 03 06 09 00 00 FF FF FF 42 29  09 10 03 E8 00 03 01 30"
        passes(close, gripper.write_registers, 0x03E8, [0x0900, 0x00FF, 0xFFFF])
        assert gripper.read_registers(0x07D0, 2) == [0x3900, 0x00FF]
        while gripper.read_registers(0x07D0, 3, functioncode=4) != [0xF900, 0x00FF, 0xE600]:
            pass
        gripper.write_register(0x03E9, 100)
        gripper.write_register(0x03EA, 0x4020, functioncode=6)
        assert gripper.read_registers(0x03E8, 3) == [0x0900, 100, 0x4020]
        gripper.write_long(0x03E9, 0x0000FFFF)
        assert gripper.read_long(0x03E9) == 0x0000FFFF
        gripper.serial.timeout = 1.0  # it waits for as many bytes as it wants
        with pytest.raises(client.SlaveReportedException, match="illegal data address"):
            gripper.read_register(0)
        gripper.serial.close()


@pytest.mark.nightly
def test_minimalmodbus_through_socat(line, tmp_path):
    """As the maker's script for tool communication does it: a serial port that socat makes of a connection."""
    client = pytest.importorskip("minimalmodbus")
    if shutil.which("socat") is None:
        pytest.skip("needs socat")
    port, (host, number) = tmp_path / "ttyUR", line
    socat = ["socat", f"pty,link={port},raw,ignoreeof,waitslave", f"tcp:{host}:{number}"]
    with subprocess.Popen(socat) as process:
        try:
            wait_until(port.exists, "the serial port")
            gripper = client.Instrument(str(port), 9)
            gripper.serial.baudrate, gripper.serial.timeout = 115200, TIMEOUT
            gripper.write_registers(0x03E8, [0, 0, 0])
            gripper.write_registers(0x03E8, [0x0100, 0, 0])
            while gripper.read_register(0x07D0, functioncode=4) != 0x3100:
                pass
            gripper.write_registers(0x03E8, [0x0900, 0x00FF, 0xFFFF])
            while gripper.read_registers(0x07D0, 3, functioncode=4) != [0xF900, 0x00FF, 0xE600]:
                pass
            gripper.serial.close()
        finally:
            process.terminate()
