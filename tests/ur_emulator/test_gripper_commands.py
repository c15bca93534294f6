"""What ports ask of grippers: records of plain data, when they act, and what is answered meanwhile."""

import xmlrpc.client
from ast import literal_eval
from dataclasses import astuple

import pytest
from box_support import FakeConnection, machine_of
from e_series_support import ESeriesBench

from protocol import modbus
from protocol.modbus_rtu import encode_rtu
from protocol.ur_types import SoftwareVersion
from ur_emulator.errors import ModelError
from ur_emulator.host.pacing import RealtimePacer
from ur_emulator.host.ports.http import HttpRequest
from ur_emulator.host.ports.modbus import ModbusSession
from ur_emulator.host.ports.onrobot import OnRobotAnswers
from ur_emulator.host.ports.robotiq import RobotiqPort
from ur_emulator.host.ports.session import SessionPort
from ur_emulator.host.ports.tool_line import ToolLinePort
from ur_emulator.host.served_box import BoxIdentity, ServedBox
from ur_emulator.machine.commands.grippers import ExchangeRegisters, OperateGrippers
from ur_emulator.machine.models.generations import E_SERIES
from ur_hil.tools import tools_by_name

ROBOTIQ, ONROBOT = 9, 65
BUSY, NO_POWER = 1, 4


def bench_with_tools():
    bench = ESeriesBench(version=(5, 25), tools=tools_by_name("robotiq-2f85,onrobot-rg2", ModelError))
    bench.tick()  # the grippers have their supply
    return bench


class Served(ServedBox):
    """A box whose cycles the test begins, with the ports of its grippers.

    Attributes:
        journal: the commands of each cycle.
    """

    def __init__(self):
        self.bench = bench_with_tools()
        controller = self.bench.controller
        software = E_SERIES.software(SoftwareVersion(5, 25))
        identity = BoxIdentity(software, "UR5e", "UR5", "20993000007")
        super().__init__(machine_of(controller), identity, RealtimePacer(controller.period_s), None, None)
        self.attach((self.steps,))
        self.journal = []
        robotiq, onrobot = controller.state.grippers
        self.robotiq, self.modbus = RobotiqPort(self, [robotiq]), SessionPort(self, ModbusSession)
        self.tool_line = ToolLinePort(self, [self.robotiq])
        self._calls = OnRobotAnswers(self, [onrobot], "127.0.0.1")

    def cycle(self, n=1):
        for _ in range(n):
            self.journal.append([command for command, _ in self._commands.values()])
            self.advance(len(self.journal) * (self.controller.period_s + 1e-9))  # a little after its deadline

    def call(self, name, *arguments):
        """Call a method by XML-RPC; return a list that gets its result."""
        body, results = xmlrpc.client.dumps(arguments, name).encode(), []

        def finished(answer, error):
            assert error is None
            results.extend(xmlrpc.client.loads(answer.result)[0])

        request = HttpRequest("POST", "/", {}, {"host": "127.0.0.1"}, body)
        self.steps.start(self._calls.answer(request, None), finished)
        return results

    def report(self, what, error):
        raise error


@pytest.fixture
def box():
    return Served()


def frame(pdu, unit=ONROBOT):
    return modbus.encode_frame(1, unit, pdu)


def write(address, *values):
    return frame(modbus.encode_write(modbus.ModbusFunction.WRITE_REGISTERS, address, values))


def read(address):
    return frame(modbus.encode_read(modbus.ModbusFunction.READ_HOLDING_REGISTERS, address))


STATUS, CYCLE_POWER = 0x010C, frame(bytes.fromhex("060000 0002"), unit=63)
GRIP = write(0, 200, 300, 16)


def is_plain(value):
    if isinstance(value, tuple):
        return all(map(is_plain, value))
    return value is None or type(value) in (bool, int, float, str, bytes)


def test_what_ports_ask_for_is_plain_data_that_does_the_same_to_another_box(box):
    client, master, line = (FakeConnection(port) for port in (box.robotiq, box.modbus, box.tool_line))
    client.say(b"SET ACT 1 SPE 255\n")
    box.cycle(5)
    box.call("rg_set_fingertip_offset", 0, 1.5)
    box.call("rg_grip", 0, 40.0, 20.0)
    box.cycle(50)
    master.say(GRIP)
    box.cycle(100)
    box.call("rg_stop", 0)
    client.close()
    line.say(encode_rtu(ROBOTIQ, bytes.fromhex("10 03E8 0003 06 0900 00FF FFFF")))
    box.cycle(1000)
    master.say(CYCLE_POWER)
    box.cycle(100)
    box.call("cb_reset_tool_power")
    box.cycle(600)
    asked = [command for commands in box.journal for command in commands]
    assert {(type(command), getattr(command, "operation", "")) for command in asked} == {
        (ExchangeRegisters, ""),
        *((OperateGrippers, name) for name in ("set", "grip", "stop", "set_offset", "cycle_power")),
    }
    assert all(is_plain(astuple(command)) for command in asked)
    copies = [
        [type(command)(*literal_eval(repr(astuple(command)))) for command in commands]
        for commands in box.journal
    ]
    assert copies == box.journal
    other = bench_with_tools()
    for commands in copies:
        other.tick(1, *commands)
    assert other.now == box.snapshot
    ours, theirs = (
        [gripper.summary() for gripper in controller.state.grippers]
        for controller in (box.controller, other.controller)
    )
    assert ours == theirs
    robotiq, onrobot = ours
    assert (robotiq["STA"], robotiq["FLT"], onrobot["status"]) == (3, 0, 0)
    assert robotiq["width"] < 0.01


def test_a_modbus_client_reads_what_it_has_written(box):
    client = FakeConnection(box.modbus)
    client.say(GRIP + read(STATUS))
    assert client.sent == []
    box.cycle()
    client.next_turns()
    written, status = (answer[7:] for answer in client.sent)
    assert written == bytes.fromhex("10 0000 0003")
    assert status == bytes((3, 2, 0, BUSY))


def test_a_modbus_client_that_only_reads_is_answered_at_once(box):
    writer, reader = FakeConnection(box.modbus), FakeConnection(box.modbus)
    writer.say(GRIP)
    reader.say(read(STATUS))
    assert reader.sent.pop()[7:] == bytes((3, 2, 0, 0))  # the other one's grip has not begun
    box.cycle()
    reader.say(read(STATUS))
    assert reader.sent.pop()[7:] == bytes((3, 2, 0, BUSY))
    assert len(writer.sent) == 1


def test_after_a_power_cycle_the_next_question_finds_no_power(box):
    client = FakeConnection(box.modbus)
    client.say(CYCLE_POWER + read(STATUS))
    box.cycle()
    client.next_turns()
    off, status = (answer[7:] for answer in client.sent)
    assert off == bytes.fromhex("0600000002")
    assert status == bytes((0x83, NO_POWER))


def test_a_call_is_answered_when_it_has_acted(box):
    result = box.call("rg_grip", 0, 20.0, 40.0)
    assert (result, box.call("rg_get_busy", 0)) == ([], [False])
    box.cycle()
    assert (result, box.call("rg_get_busy", 0)) == ([0], [True])
    box.call("rg_grip", 0, 90.0, 40.0)
    box.call("rg_grip", 0, 30.0, 40.0)  # the later of two clients
    box.cycle(600)
    assert box.call("rg_get_width", 0) == [pytest.approx(30.0, abs=0.5)]


def test_sets_of_two_clients_between_two_cycles_are_one_command_in_their_order(box):
    first, second = FakeConnection(box.robotiq), FakeConnection(box.robotiq)
    for _ in range(100):
        first.say(b"SET ACT 1 POS 100\nGET SPE\n")
        second.say(b"SET POS 50 GTO 1\n")
    assert first.sent == [b"ackSPE 255\n"] * 100  # nobody waits
    assert second.sent == [b"ack"] * 100
    box.cycle()
    (commands,) = box.journal
    assert commands == [OperateGrippers((ROBOTIQ,), "set", (("ACT", 1), ("POS", 50), ("GTO", 1)))]
    first.say(b"SET POS 200\n")
    box.cycle()
    assert box.journal[-1] == [OperateGrippers((ROBOTIQ,), "set", (("POS", 200),))]
    box.cycle(20)
    first.say(b"GET ACT\nGET PRE\n")
    assert first.sent[-1] == b"ACT 1\nPRE 200\n"


WAITS = """def p():
  socket_open("peer", 1, "s")
  socket_read_byte_list(1, "s", 0)
end
"""


def test_a_set_is_a_reason_for_time_to_pass_but_not_past_a_script_that_waits(box):
    client = FakeConnection(box.robotiq)
    while box.is_active:
        box.cycle()
    client.say(b"SET ACT 1\n")
    assert box.is_active
    assert not box.waits_outside
    while box.is_active:
        box.cycle()
    box.bench.start(WAITS)
    box.cycle(10)
    client.say(b"SET ACT 0\n")
    assert (client.sent.pop(), box.is_active, box.waits_outside) == (b"ack", True, True)
    box.call("rg_stop", 0)  # it waits for a cycle, so the script must not keep time from passing
    assert not box.waits_outside
    box.cycle()
    assert box.waits_outside
