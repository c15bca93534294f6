"""A gripper of OnRobot: its state, and the three ways by which clients and programs reach it."""

import json
import socket
import xmlrpc.client

import pytest
from finger_support import PERIOD, DrivenFingers, program_file, tool_box
from pymodbus.client import ModbusTcpClient

from protocol.modbus_rtu import encode_rtu
from ur_emulator.host.ports.onrobot import METHODS
from ur_emulator.machine.controller.io.lines import TOOL
from ur_emulator.machine.tools.onrobot import OnRobotGripper
from ur_hil.tools import TOOLS

RG2, RG6 = TOOLS["onrobot-rg2"], TOOLS["onrobot-rg6"]
BUSY, GRIPPED = 1, 2


class Fingers(DrivenFingers):
    def __init__(self, tool=RG2, unit=65):
        super().__init__(OnRobotGripper(tool, PERIOD, unit), width=0.05)
        self.run(PERIOD)

    def get(self, *names):
        return tuple(self.gripper.values()[name] for name in names)

    def word(self, value, n_cycles=1):
        for i in reversed(range(17)):
            self.io.write_digital_outputs((1 | (not value >> i & 1) << 1) << TOOL.first, TOOL.mask)
            self.run(PERIOD * n_cycles)
            self.io.write_digital_outputs(0, 1 << TOOL.first)
            self.run(PERIOD * n_cycles)


@pytest.fixture
def fingers():
    return Fingers()


# --- the state


def test_it_is_busy_until_it_is_there(fingers):
    fingers.gripper.grip(20.0, 40.0)
    assert fingers.get("busy", "status") == (True, BUSY)
    fingers.run(1.0)
    assert fingers.get("width", "status") == (pytest.approx(20.0, abs=0.3), 0)
    fingers.gripper.grip(20.0, 40.0)  # where it is: a program that waits for the beginning sees it
    fingers.run(0.08)
    assert fingers.get("busy") == (True,)
    fingers.run(0.1)
    assert fingers.get("busy") == (False,)


def test_a_grip_is_what_it_presses_on_and_its_loss_is_seen(fingers):
    fingers.block = 0.03
    fingers.gripper.grip(0.0, 40.0)
    fingers.run(1.0)
    assert fingers.get("width", "status") == (pytest.approx(30.0, abs=0.1), GRIPPED)
    fingers.block = 0.01
    fingers.run(2 * PERIOD)
    assert fingers.get("grip_detected") == (False,)
    fingers.gripper.grip(60.0, 40.0)
    fingers.run(1.0)
    assert fingers.get("status") == (0,)
    fingers.block = 0.0
    fingers.gripper.grip(0.0, 40.0)
    fingers.run(1.0)
    assert fingers.get("status") == (GRIPPED,)  # jaws closed on nothing, as measured


def test_a_new_command_supersedes_and_stop_stops(fingers):
    fingers.gripper.grip(0.0, 40.0)
    fingers.run(0.1)
    fingers.gripper.grip(90.0, 40.0)
    fingers.run(0.2)
    fingers.gripper.stop()
    width = fingers.width
    fingers.run(0.5)
    assert fingers.width == width
    assert 0.05 < width < 0.09
    assert fingers.get("busy") == (False,)


@pytest.mark.parametrize(("width", "depth"), [(59.0, 7.1), (80.0, 14.8)])
def test_the_depth_is_that_measured(fingers, width, depth):
    fingers.gripper.set_offset(0.0)
    fingers.gripper.grip(width, 40.0)
    fingers.run(2.0)
    assert fingers.get("width", "depth") == (pytest.approx(width, abs=0.3), pytest.approx(depth, abs=0.2))


def test_angles_are_those_of_the_table_at_both_ends():
    for tool, ends in ((RG2, (-0.0455, 1.268)), (RG6, (-0.0525, 1.245))):
        linkage, angles = tool.linkage, []
        for width in (-2.0 * linkage.tip, tool.stroke):
            fingers = Fingers(tool)
            fingers.width = width
            fingers.run(PERIOD)
            angles += fingers.get("angle")
        assert angles == pytest.approx(ends, abs=0.002)


def test_without_power_it_does_nothing_and_afterwards_it_waits(fingers):
    fingers.gripper.grip(0.0, 40.0)
    fingers.run(0.1)
    fingers.has_power = False
    fingers.run(0.1)
    width = fingers.width
    fingers.run(0.5)
    assert (fingers.width, fingers.gripper.is_busy) == (width, False)
    assert fingers.io.digital_in & TOOL.mask == 0
    assert fingers.io.tool_analog_in[0].value == 0.0
    with pytest.raises(LookupError):
        fingers.gripper.read_registers(0x010B, 1)
    fingers.has_power = True
    fingers.run(0.5)
    assert (fingers.width, *fingers.get("status")) == (width, 0)
    fingers.gripper.cycle_power()
    fingers.run(0.1)
    assert (fingers.gripper.has_power, fingers.gripper.is_busy) == (False, True)
    fingers.run(1.0)
    assert (fingers.gripper.has_power, fingers.gripper.is_busy) == (True, False)


# --- registers


def test_registers_set_targets_and_give_what_is_measured(fingers):
    gripper, (offset,) = fingers.gripper, fingers.get("fingertip_offset")
    gripper.write_registers(0, (200, 300, 16))
    assert gripper.read_registers(0x010C, 1) == [BUSY]
    gripper.write_registers(0, (200, 900, 16))  # ignored
    fingers.run(1.0)
    assert gripper.read_registers(0x0113, 1)[0] == pytest.approx(300, abs=3)
    assert gripper.read_registers(0x010B, 1)[0] == pytest.approx(300 + 20 * offset, abs=3)
    gripper.write_registers(1, (300, 1))  # between the metal tips
    fingers.run(1.0)
    assert gripper.read_registers(0x010B, 1)[0] == pytest.approx(300, abs=3)
    gripper.write_registers(0x0407, (0xFFF6,))
    assert gripper.read_registers(0x0102, 1) == [0xFFF6]
    assert gripper.read_registers(0x0100, 32)[2] == 0xFFF6
    gripper.write_registers(0, (200, 0, 16))
    gripper.write_registers(2, (8,))
    assert gripper.read_registers(0x010C, 1) == [0]
    for address, values in ((2, (1, 1)), (0x0406, (1,)), (0x0407, (1, 1))):
        with pytest.raises(LookupError):
            gripper.write_registers(address, values)
    for address, count in ((0x00FF, 1), (0x011F, 2), (0, 1)):
        with pytest.raises(LookupError):
            gripper.read_registers(address, count)


# --- words by tool outputs


@pytest.mark.parametrize(
    ("tool", "value", "width", "force"),
    [
        (RG2, 32768 + 4 * 59 + 444 * 10, 59 - 8.9, 20.0),
        (RG2, 4 * 110 + 444 * 20, 110 - 8.9, 40.0),
        (RG6, 32768 + 4 * 100 + 644 * 24, 100 - 10.0, 120.0),
    ],
)
def test_a_word_is_a_command(tool, value, width, force):
    fingers = Fingers(tool)
    fingers.word(value)
    assert fingers.io.digital_in & TOOL.mask == 0  # busy
    assert fingers.gripper._command.force == force
    fingers.run(2.0)
    assert fingers.get("width") == (pytest.approx(width, abs=0.3),)
    assert fingers.io.digital_in & TOOL.mask == 2 << TOOL.first
    assert fingers.io.tool_analog_in[0].value == pytest.approx(
        0.026 + 2.976 * (fingers.get("angle")[0] + tool.linkage.least_angle) / 1.5708, abs=0.005
    )


def test_a_word_with_a_pause_is_none_and_one_for_another_gripper_is_not_taken(fingers):
    fingers.word(32768 + 444 * 10, n_cycles=14)
    assert not fingers.gripper.is_busy
    fingers.run(0.2)
    fingers.word(32768 + 16384 + 444 * 10)
    assert not fingers.gripper.is_busy
    second = Fingers(unit=67)
    assert second.io.digital_in == 0
    second.word(32768 + 16384 + 444 * 10)
    assert second.gripper.is_busy


# --- XML-RPC


@pytest.fixture(scope="module")
def box():
    with tool_box("onrobot-rg2") as box:
        yield box


@pytest.fixture(scope="module")
def server(box):
    with xmlrpc.client.ServerProxy(f"http://{box.host}:{box.ports.onrobot}/") as server:
        yield server


def until_free(server):
    while server.rg_get_busy(0):
        pass


def test_a_client_grips(server):
    for width in (100.0, 20.0):
        assert server.rg_grip(0, width, 40.0) == 0
        until_free(server)
        assert server.rg_get_width(0) == pytest.approx(width, abs=0.5)
    assert server.rg_stop(0) == 0
    assert server.rg_set_fingertip_offset(0, 0.0) == 0
    assert server.rg_get_width(0) == pytest.approx(28.9, abs=0.5)
    server.rg_set_fingertip_offset(0, 4.45)
    every = server.rg_get_all_variables(0)
    assert {f"rg_get_{name}" for name in every} == {
        name for name in METHODS if name.startswith("rg_get_") and name != "rg_get_all_variables"
    }
    assert {name: type(value) for name, value in every.items()} == {
        name: {"double": float, "boolean": bool, "int": int}[METHODS[f"rg_get_{name}"][0]] for name in every
    }


def test_it_says_what_it_is_and_can(server):
    assert server.system.listMethods() == list(METHODS)
    assert server.system.methodSignature("rg_grip") == [["int", "int", "double", "double"]]
    assert server.system.methodHelp("rg_stop") == "stops"
    assert server.cb_is_device_connected(0, 0x20) is True
    assert server.cb_is_device_connected(0, 0x21) is False
    assert server.cb_is_device_connected(1, 0x20) is False
    assert server.cb_report_robot_type(3) == 0
    (device,) = json.loads(server.get_discovery())["devices"]
    assert (device["deviceId"], device["productCode"], device["status"]) == (0, 0x20, 0)


@pytest.mark.parametrize(
    ("name", "arguments", "code"),
    [
        ("rg_grip", (0, 20, 40.0), -501),
        ("rg_grip", (0, 20.0), -501),
        ("rg_grip", (0, float("nan"), 40.0), -501),
        ("rg_stop", (True,), -501),
        ("rg_fly", (0,), -506),
        ("system.methodHelp", ("rg_fly",), -506),
    ],
)
def test_types_and_names_are_strict(server, name, arguments, code):
    with pytest.raises(xmlrpc.client.Fault) as fault:
        getattr(server, name)(*arguments)
    assert fault.value.faultCode == code


def test_devices_that_are_not_there_answer_with_what_cannot_be(server):
    samples = {"int": 0, "double": 1.0, "boolean": True, "string": "rg_stop"}
    for name, (result, arguments, _) in METHODS.items():
        if name.startswith(("rg_", "twofg_", "vg10_")):
            given = [samples[kind] for kind in arguments.split()]
            given[0] = 1
            answer = getattr(server, name)(*given)
            does_something = result == "int" and "_get_" not in name
            expected = {"int": -4 if does_something else -1, "double": -999.0, "array": [-999.0, -999.0]}
            assert answer == expected.get(result, answer)
            assert type(answer) is {"boolean": bool, "struct": dict}.get(result, type(answer))


def post(box, body, path="/", method="POST", **headers):
    with socket.create_connection((box.host, box.ports.onrobot), timeout=10.0) as client:
        head = f"{method} {path} HTTP/1.1\r\nHost: {box.host}\r\nContent-Length: {len(body)}\r\nConnection: close\r\n"
        head += "".join(f"{name}: {value}\r\n" for name, value in headers.items())
        client.sendall(head.encode() + b"\r\n" + body)
        return client.recv(100_000)


CALL = xmlrpc.client.dumps((0,), "rg_get_status").encode()


def test_other_requests_are_refused(box):
    for path in ("/", "/RPC2"):
        assert b"<int>" in post(box, CALL, path)
    assert b" 405 " in post(box, CALL, method="PUT")
    assert b" 403 " in post(box, CALL, Origin="http://evil.example")
    assert b" 413 " in post(box, CALL + b" " * 9000)
    for body in (b"", b"hello", b"<!DOCTYPE a><methodCall/>", b"<methodCall/>", b"<methodResponse/>",
                 b"<methodCall><params/></methodCall>", b"<value>" * 100,
                 xmlrpc.client.dumps(([0] * 32,), "rg_stop").encode()):  # fmt: skip
        assert b"-503" in post(box, body)


def said(box, program):
    before = len(box.log)
    box.run_program(program, wait=True)
    return [entry.text for entry in box.log[before:] if entry.source == "Program"]


def test_a_program_reaches_it_at_its_usual_port(box):
    texts = [
        text
        for text in said(box, program_file("onrobot_rpc"))
        if text[:4] in ("says", "widt", "with", "busy", "grip")
    ]
    assert texts == ["says 0", "width 40", "without [-999,-1]", "busy True", "grip -4"]


# --- Modbus


def test_modbus_clients_reach_it_by_its_unit(box, server):
    with ModbusTcpClient(box.host, port=box.ports.modbus, timeout=10) as client:
        client.write_registers(0, [200, 500, 16], device_id=65)
        while client.read_holding_registers(0x010C, device_id=65).registers[0] & BUSY:
            pass
        (width,) = client.read_holding_registers(0x0113, device_id=65).registers
        assert width == pytest.approx(500, abs=5)
        assert client.read_holding_registers(0x0200, device_id=65).exception_code == 2
        assert client.read_coils(0, device_id=65).exception_code == 1
        version = client.read_holding_registers(256, count=2, device_id=1).registers
        assert version[0] == 5  # the version of the robot
        assert not client.write_register(0, 2, device_id=63).isError()
        while server.rg_get_status(0) == -1:  # its supply is off, perhaps not any more
            pass


def test_the_serial_line_has_even_parity_from_the_start(box, server):
    # 40 N, 80 mm between the metal tips
    request = bytes.fromhex("41 10 00 00 00 03 06 01 90 03 20 00 01 19 C2")
    assert encode_rtu(0x41, request[1:-2]) == request
    with socket.create_connection((box.host, box.ports.tool_line), timeout=10.0) as line:
        line.sendall(request)
        assert line.recv(100) == encode_rtu(0x41, bytes.fromhex("10 00 00 00 03"))
        until_free(server)
        assert server.rg_get_width(0) == pytest.approx(71.1, abs=0.5)
    assert box.state.grippers[0].keys() == {"unit", "width", "status"}


# --- programs of the old software


@pytest.mark.parametrize("robot", ["ur5", pytest.param("ur5e", marks=pytest.mark.nightly)])
def test_a_program_of_the_old_software(robot):
    with tool_box("onrobot-rg2", robot) as old:
        texts = [
            text
            for text in said(old, program_file("onrobot_words"))
            if text[:5] in ("began", "width", "grip ")
        ]
        assert texts == ["began True", "width 80", "grip False", "began True", "width 0", "grip True"]


def test_two_of_them_have_places_and_units_of_their_own():
    with (
        tool_box("onrobot-rg2,onrobot-rg6") as two,
        xmlrpc.client.ServerProxy(f"http://{two.host}:{two.ports.onrobot}/") as server,
    ):
        assert server.rg_get_status(0) == -1
        assert server.rg_grip(2, 140.0, 100.0) == 0
        while server.rg_get_busy(2):
            pass
        assert server.rg_get_width(2) == pytest.approx(140.0, abs=0.5)
        assert [server.cb_is_device_connected(*at) for at in ((1, 0x20), (2, 0x21))] == [True, True]
        assert [gripper["unit"] for gripper in two.state.grippers] == [66, 67]
