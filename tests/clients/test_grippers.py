"""Public clients of Robotiq grippers, as they are, on an e-Series arm with one: port 63352, and the serial line at 54321."""

import asyncio
import json
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from clients_support import TIMEOUT

from ur_emulator import ControlBox
from ur_hil.tools import TOOLS

HAND = TOOLS["robotiq-2f85"]
BLOCK = 0.04  # m
PLACE = (0.5, 0.2, 0.0)  # m; a block that stands on the table is there
TO_PLACE = (
    f"movej(get_inverse_kin(p[{PLACE[0]}, {PLACE[1]}, {PLACE[2] + HAND.length}, 3.14159, 0, 0]), a=8, v=2)\n"
)


@pytest.fixture(scope="module")
def box():
    with ControlBox("ur5e", pace="lockstep", port_base=None, seed=7, tool=HAND.name) as box:
        box.run_program(TO_PLACE, wait=True)
        yield box


@pytest.fixture
def line(box):
    """Address of the serial line, which the software of port 63352 has given back."""
    peers = {}
    for words in (entry.text.split() for entry in box.log if " gripper port " in entry.text):
        peers[words[0]] = words[1]
    for peer, last in peers.items():
        if last == "connected":
            box.wait_until(log=f"{peer} disconnected from gripper port")
    return box.host, box.ports.tool_line


@contextmanager
def block_between_pads(box):
    """Put a block on the table where the pads are; they must be open."""
    box.add_thing("block", "box", (BLOCK, BLOCK, BLOCK), 0.1, (*PLACE, 0, 0, 0))
    yield
    box.remove_thing("block")


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
        (("open", -1, -1, START), 0),
        (("objectDetectionStatus",), 0),
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
