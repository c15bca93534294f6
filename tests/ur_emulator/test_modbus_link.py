"""The connection to a Modbus unit: a socket whose other end is the test, and a clock that the test moves."""

import pytest
from box_support import FakeSocket
from hypothesis import given
from hypothesis import strategies as st

from protocol.modbus import ExceptionCode, encode_frame
from ur_emulator.budgets import BUDGETS
from ur_emulator.host.script_network.modbus_units import (
    ANSWER_TIMEOUT,
    CONNECT_TIMEOUT,
    FIRST_RETRY,
    LAST_RETRY,
    MAX_UNDER_WAY,
    MAX_UNEXPECTED,
    TOLERANCE,
    ModbusLink,
)
from ur_emulator.machine.controller.io.network import (
    DISCONNECTED,
    NO_ANSWER,
    ModbusSignal,
    SignalType,
    UnitAddress,
)

UNIT = UnitAddress("10.0.0.2")
PERIOD = 0.008


class Wire:
    """A link, the sockets that it has opened, and the time."""

    def __init__(self, *, refuse=False, connecting=False):
        self.link = ModbusLink(str(UNIT), self._connect, PERIOD)
        self.sockets = []
        self.refuse = refuse
        self.connecting = connecting
        self.now = 100.0
        self.next_call = None

    def _connect(self):
        sock = FakeSocket()
        sock.is_open = not self.refuse and not self.connecting
        sock.is_connecting = self.connecting
        self.sockets.append(sock)
        return sock

    @property
    def sock(self):
        return self.sockets[-1]

    def advance(self, seconds=0.0):
        self.now += seconds
        self.next_call = self.link.advance(self.now)

    def want(self, *signals):
        for signal in signals:
            self.link.want(signal)
        self.advance()

    def asked(self):
        """Return the requests that have been sent and not looked at yet, as (transaction, rest)."""
        requests = []
        data = self.sock.sent
        while data:
            size = 6 + int.from_bytes(data[4:6], "big")
            requests.append((int.from_bytes(data[:2], "big"), bytes(data[6:size])))
            del data[:size]
        return requests

    def answer(self, transaction, pdu, slave=255):
        self.sock.inbox += encode_frame(transaction, slave, pdu)
        self.advance()


def signal(kind=2, address=5, name="s", slave=255, **kwargs):
    return ModbusSignal(name, UNIT, slave, address, SignalType(kind), **kwargs)


@pytest.fixture
def wire():
    return Wire()


def read_7(wire, wanted):
    """Want a signal that reads, and answer with 7."""
    wire.want(wanted)
    wire.answer(wire.asked()[-1][0], bytes.fromhex("04020007"))
    assert (wanted.values, wanted.trouble) == ((7,), "")
    assert wanted.device_error == wanted.connection_error == 0


# --- what is asked for, what the answers mean


@pytest.mark.parametrize(
    ("kind", "count", "pdu", "answer", "values"),
    [
        (0, 1, "0200050001", "020101", (1,)),
        (0, 3, "0200050003", "020105", (1, 0, 1)),
        (1, 1, "0100050001", "010101", (1,)),
        (2, 1, "0400050001", "0402ffff", (65535,)),
        (2, 2, "0400050002", "040400010002", (1, 2)),
        (3, 1, "0300050001", "030204d2", (1234,)),
        (15, 1, "0100050001", "010101", (1,)),
        (16, 2, "0300050002", "0304000affff", (10, 65535)),
        (23, 2, "0300050002", "0304000affff", (10, 65535)),
    ],
)
def test_each_type_is_read_with_its_function(wire, kind, count, pdu, answer, values):
    s = signal(kind, count=count, slave=17)
    assert s.values == (0,) * count
    wire.want(s)
    [(transaction, request)] = wire.asked()
    assert request.hex() == "11" + pdu
    wire.answer(transaction, bytes.fromhex(answer), slave=17)
    assert s.values == values


@pytest.mark.parametrize(
    ("kind", "output", "pdu", "answer"),
    [
        (1, (1,), "050005ff00", "050005ff00"),
        (1, (0,), "0500050000", "0500050000"),
        (1, (1, 0, 1), "0f000500030105", "0f00050003"),
        (3, (513,), "0600050201", "0600050201"),
        (3, (1, 2), "10000500020400010002", "1000050002"),
        (15, (1,), "0f000500010101", "0f00050001"),
        (16, (7,), "1000050001020007", "1000050001"),
    ],
)
def test_outputs_are_written_with_their_function(wire, kind, output, pdu, answer):
    s = signal(kind, output=output, count=len(output))
    wire.want(s)
    [(transaction, request)] = wire.asked()
    assert request.hex() == "ff" + pdu
    wire.answer(transaction, bytes.fromhex(answer))
    wire.advance(2 * TOLERANCE)
    assert not s.trouble


def test_once_set_a_signal_that_writes_and_reads_does_both_in_one_request(wire):
    s = signal(23, output=(513,), count=2, write_address=9, write_count=1)
    wire.want(s)
    [(transaction, request)] = wire.asked()
    assert request.hex() == "ff170005000200090001020201"
    wire.answer(transaction, bytes.fromhex("170400010002"))
    assert s.values == (1, 2)


def test_a_signal_is_asked_for_once_while_its_answer_is_awaited(wire):
    s = signal()
    wire.want(s)
    wire.want(s)
    wire.advance(3 * PERIOD)
    [(transaction, _)] = wire.asked()
    wire.answer(transaction, bytes.fromhex("04020001"))
    assert len(wire.asked()) == 1  # the second wish


def test_an_output_that_changes_while_it_is_written_is_written_again(wire):
    s = signal(3, output=(1,))
    wire.want(s)
    s.output = (2,)
    wire.want(s)
    [(transaction, _)] = wire.asked()
    wire.answer(transaction, bytes.fromhex("0600050001"))
    assert [request.hex() for _, request in wire.asked()] == ["ff0600050002"]


def test_an_answer_to_a_read_does_not_undo_an_output_that_was_set_meanwhile(wire):
    s = signal(3)
    wire.want(s)
    [(transaction, _)] = wire.asked()
    s.output = s.values = (9,)
    wire.answer(transaction, bytes.fromhex("03020001"))
    assert s.values == (9,)


def test_signals_of_a_unit_share_one_connection_and_are_served_in_order_by_consecutive_numbers(wire):
    signals = [signal(address=i, name=str(i)) for i in range(3)]
    wire.link._transaction = 0xFFFE
    wire.want(*signals)
    for i, (s, number) in enumerate(zip(signals, (0xFFFF, 1, 2), strict=True)):
        [(transaction, request)] = wire.asked()
        assert (transaction, request[3]) == (number, i)
        wire.answer(transaction, bytes([4, 2, 0, 40 + i]))
        assert s.values == (40 + i,)
    assert len(wire.sockets) == 1


def test_a_slow_unit_gets_the_next_request_after_a_cycle_and_may_answer_in_any_order(wire):
    a, b = signal(address=1, name="a"), signal(address=2, name="b")
    wire.want(a, b)
    wire.advance(PERIOD)
    first, second = (transaction for transaction, _ in wire.asked())
    wire.answer(second, bytes([4, 2, 0, 22]))
    wire.answer(first, bytes([4, 2, 0, 11]))
    assert (a.values, b.values) == ((11,), (22,))


@pytest.mark.parametrize(("is_sequential", "most"), [(True, 1), (False, MAX_UNDER_WAY)])
def test_a_unit_that_is_not_in_a_hurry_never_has_more_than_a_few_requests(wire, is_sequential, most):
    wire.want(*(signal(address=i, name=str(i), sequential=is_sequential and i == 99) for i in range(100)))
    for _ in range(40):
        wire.advance(PERIOD)
    assert len(wire.asked()) == most


def test_a_forgotten_signal_takes_no_answer(wire):
    s, other = signal(), signal(name="other")
    wire.want(s)
    [(transaction, _)] = wire.asked()
    wire.link.forget(s)
    wire.answer(transaction, bytes.fromhex("04020009"))
    assert s.values == (0,)
    wire.want(other)
    assert len(wire.asked()) == 1
    assert len(wire.sockets) == 1


# --- own requests


def test_own_requests_are_sent_as_they_are_and_their_answer_is_dropped(wire):
    wire.link.send(103, 6, bytes([17, 32, 2, 88]))
    wire.link.is_released = True
    wire.advance()
    [(transaction, request)] = wire.asked()
    assert request == bytes([103, 6, 17, 32, 2, 88])
    assert not wire.link.is_idle
    wire.answer(transaction, bytes([0x86, 1]), slave=103)
    assert wire.link.is_idle


def test_own_requests_are_lost_when_nobody_is_there_and_bounded_before():
    wire = Wire(refuse=True)
    for i in range(BUDGETS.modbus_requests + 5):
        wire.link.send(1, 6, bytes([i]))
    assert len(wire.link._own_requests) == BUDGETS.modbus_requests
    wire.link.is_released = True
    wire.advance()
    assert wire.link.is_idle


# --- units that are not there, break off, or are silent


def test_a_connection_that_is_refused_is_tried_again_and_again_more_and_more_rarely():
    wire = Wire(refuse=True)
    s = signal()
    wire.want(s)
    pauses = []
    for _ in range(8):
        assert wire.next_call > wire.now
        pauses.append(wire.next_call - wire.now)
        wire.advance(0.5 * pauses[-1])
        n = len(wire.sockets)
        wire.now = wire.next_call
        wire.advance()
        assert len(wire.sockets) == n + 1
    assert pauses[0] == pytest.approx(FIRST_RETRY)
    assert pauses == sorted(pauses)
    assert pauses[-1] == pytest.approx(LAST_RETRY)
    assert s.trouble == "10.0.0.2:502 refuses the connection"
    assert s.connection_error == DISCONNECTED
    wire.link.reset()
    wire.advance()
    assert wire.next_call - wire.now == pytest.approx(FIRST_RETRY)
    wire.refuse = False
    wire.advance(LAST_RETRY)
    read_7(wire, s)


def test_a_connection_that_nobody_takes_is_given_up():
    wire = Wire(connecting=True)
    s = signal()
    wire.want(s)
    wire.advance(CONNECT_TIMEOUT)
    assert len(wire.sockets) == 1
    wire.advance(LAST_RETRY)
    assert len(wire.sockets) == 2
    assert s.trouble == "10.0.0.2:502 cannot be connected within 2 s"


def test_a_silent_unit_is_left_and_the_signal_is_lost_after_the_tolerance(wire):
    s = signal()
    wire.want(s)
    assert wire.next_call <= wire.now + ANSWER_TIMEOUT
    wire.advance(ANSWER_TIMEOUT)
    assert not wire.sock.is_open
    assert (s.trouble, s.connection_error) == ("", NO_ANSWER)
    wire.advance(TOLERANCE)
    wire.advance(0.01)
    assert s.trouble == "10.0.0.2:502 does not answer"
    assert len(wire.sockets) > 1


def test_a_value_stays_while_its_unit_is_away(wire):
    s = signal()
    read_7(wire, s)
    wire.sock.close()
    wire.refuse = True
    wire.want(s)
    wire.advance(0.9 * TOLERANCE)
    assert (s.values, s.trouble) == ((7,), "")
    wire.advance(0.2 * TOLERANCE)
    assert s.values == (7,)
    assert s.trouble == "10.0.0.2:502 refuses the connection"


def test_an_idle_connection_that_is_closed_is_nobodys_trouble(wire):
    s = signal()
    read_7(wire, s)
    wire.sock.close()
    wire.advance(10 * TOLERANCE)
    assert not s.trouble
    assert len(wire.sockets) == 1
    wire.want(s)
    wire.advance(LAST_RETRY)
    assert len(wire.sockets) == 2


def test_an_answer_counts_although_the_unit_has_closed_behind_it(wire):
    s = signal()
    wire.want(s)
    [(transaction, _)] = wire.asked()
    wire.sock.is_open = False
    wire.answer(transaction, bytes.fromhex("04020007"))
    assert s.values == (7,)


def test_one_lost_answer_does_not_cost_the_connection(wire):
    a, b = signal(address=1, name="a"), signal(address=2, name="b")
    wire.want(a, b)
    wire.advance(PERIOD)
    (lost, _), (second, _) = wire.asked()
    wire.answer(second, bytes([4, 2, 0, 22]))
    wire.advance(ANSWER_TIMEOUT)
    [(again, request)] = wire.asked()
    assert request[3] == 1
    wire.answer(lost, bytes([4, 2, 0, 99]))  # too late
    assert a.values == (0,)
    wire.answer(again, bytes([4, 2, 0, 11]))
    assert (a.values, b.values) == ((11,), (22,))
    assert len(wire.sockets) == 1


# --- units that say wrong things


@pytest.mark.parametrize(
    ("data", "closes"),
    [(b"HTTP/1.1 400 Bad Request\r\n\r\n", False), (bytes.fromhex("000100000005ff04"), True)],
    ids=["no Modbus", "a frame cut off by the end of the connection"],
)
def test_what_is_no_answer_ends_the_connection(wire, data, closes):
    s = signal()
    wire.want(s)
    wire.sock.inbox += data
    if closes:
        wire.sock.close()
    wire.advance()
    assert not wire.sock.is_open
    assert s.values == (0,)
    wire.advance(FIRST_RETRY)
    read_7(wire, s)


def test_answers_with_wrong_transaction_numbers_are_dropped_then_end_the_connection(wire):
    s = signal()
    wire.want(s)
    [(transaction, _)] = wire.asked()
    for i in range(MAX_UNEXPECTED):
        wire.answer(transaction + 1 + i, bytes.fromhex("04020063"))
    assert s.values == (0,)
    assert wire.sock.is_open
    wire.answer(transaction, bytes.fromhex("04020007"))
    assert s.values == (7,)
    for i in range(MAX_UNEXPECTED + 1):
        wire.answer(transaction + 1 + i, bytes.fromhex("04020063"))
    assert not wire.sock.is_open
    assert s.values == (7,)
    wire.want(s)
    wire.advance(FIRST_RETRY)
    wire.answer(transaction, bytes.fromhex("04020063"))  # it counts anew
    assert wire.sock.is_open


@pytest.mark.parametrize(("code", "name"), [(2, "illegal data address"), (99, "unknown")])
def test_an_exception_is_named_once_the_tolerance_is_over_and_forgiven_by_an_answer(wire, code, name):
    s = signal()
    for _ in range(3):
        wire.want(s)
        wire.answer(wire.asked()[0][0], bytes([0x84, code]))
        wire.advance(0.4 * TOLERANCE)
    assert s.trouble == f"10.0.0.2:502 answers with exception E{code} ({name})"
    assert (s.device_error, s.connection_error) == (code, 0)
    assert len(wire.sockets) == 1
    read_7(wire, s)


@pytest.mark.parametrize(
    ("output", "pdu"),
    [
        (None, "04"),  # nothing behind the function code
        (None, "0402aa"),
        (None, "040400010002"),  # two registers
        (None, "03020001"),  # another function
        ((1,), "0600050002"),  # another value
        ((1,), "0600060001"),  # another address
    ],
)
def test_a_wrong_answer_spoils_one_answer_and_no_more(wire, output, pdu):
    s = signal(2 if output is None else 3, output=output)
    wire.want(s)
    wire.answer(wire.asked()[0][0], bytes.fromhex(pdu))
    assert s.values == (0,)
    assert (s.device_error, s.connection_error) == (ExceptionCode.SLAVE_DEVICE_FAILURE, 0)
    wire.advance(TOLERANCE)
    wire.advance(0.01)
    assert s.trouble == "10.0.0.2:502 gives an answer that makes no sense"
    assert len(wire.sockets) == 1


@given(st.lists(st.binary(max_size=40), max_size=12))
def test_no_bytes_break_it_and_a_good_unit_is_heard_afterwards(pieces):
    wire = Wire()
    s = signal()
    wire.want(s)
    for piece in pieces:
        wire.sock.inbox += piece
        wire.want(s)
        wire.advance(0.01)
    wire.advance(ANSWER_TIMEOUT)
    for _ in range(20):
        wire.want(s)
        wire.advance(LAST_RETRY)
        wire.sock.inbox.clear()
        for transaction, _ in wire.asked():
            wire.answer(transaction, bytes.fromhex("040204d2"))
    assert (s.values, s.trouble) == ((1234,), "")


def test_a_signal_has_its_own_tolerance(wire):
    patient, hasty = signal(name="a", tolerance=3 * TOLERANCE), signal(name="b", tolerance=0.5)
    wire.want(patient, hasty)
    wire.advance(1.0)
    wire.advance(1.0)
    assert hasty.trouble
    assert not patient.trouble
    wire.advance(3 * TOLERANCE)
    assert patient.trouble


def test_a_reset_connects_anew_and_asks_again(wire):
    it = signal()
    wire.want(it)
    wire.asked()
    wire.link.reset()
    assert not wire.sock.is_open
    assert it.connection_error == DISCONNECTED
    wire.advance()
    assert len(wire.sockets) == 2
    wire.answer(wire.asked()[0][0], bytes.fromhex("04020005"))
    assert (it.connection_error, it.values) == (0, (5,))
