"""Port 502: the robot's Modbus map for Modbus TCP clients.

Reads are answered at once, from the state at the end of the last cycle. Writes are commands: a client gets
its answer, and its next request is looked at, once the cycle in which they act is over, so that it reads what
it has written. The unit number is not looked at. A request that names an address that does not exist, or
writes one that can only be read, is refused as a whole with exception 2.
Source: UR "Modbus server" article (protocol notes, section 9); exceptions: Modbus application protocol.
"""

from __future__ import annotations

from collections.abc import Callable

from protocol.errors import RemoteProtocolError
from protocol.modbus import (
    ExceptionCode,
    ModbusFrame,
    ModbusRequest,
    ModbusRequestError,
    decode_request,
    encode_answer,
    encode_exception,
    encode_frame,
    take_frame,
)
from ur_emulator.commands.client_writes import WriteModbus
from ur_emulator.controller.command import Command
from ur_emulator.controller.controller import Controller
from ur_emulator.controller.modbus.robot_map import MapAddressError, can_write, read_coil, read_register
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.servers.tcp.connection import Connection

# Requests of one client that are answered in one go; the rest waits for the next cycle.
MAX_AT_ONCE = 32
# Bytes of requests that may wait; a client that sends more without reading answers is cut off.
MAX_INBOX = 16 * 1024


class ModbusPort:
    """Answers Modbus requests."""

    def __init__(self, controller: Controller, submit: Callable[[Command], None]) -> None:
        """Prepare for clients.

        Args:
            controller: whose state is read.
            submit: takes a command for the next cycle.
        """
        self._controller = controller
        self._submit = submit
        self._sessions: dict[Connection, _Session] = {}
        self._unfinished: dict[_Session, None] = {}

    def opened(self, connection: Connection) -> None:
        """The client speaks first."""
        self._sessions[connection] = _Session(connection)

    def received(self, connection: Connection, data: bytes) -> None:
        """Answer requests in order."""
        session = self._sessions[connection]
        session.inbox += data
        if len(session.inbox) > MAX_INBOX:
            connection.close()
        else:
            self._serve(session)

    def closed(self, connection: Connection) -> None:
        """Forget the client."""
        session = self._sessions.pop(connection, None)
        if session is not None:
            self._unfinished.pop(session, None)

    def publish(self, snapshot: Snapshot) -> None:
        """A cycle is over: answer the writes that acted in it, and go on with what waited."""
        if self._unfinished:
            for session in tuple(self._unfinished):
                if session.answer is not None and snapshot.tick > session.written_at:
                    answer, session.answer = session.answer, None
                    self._send(session, answer)
                self._serve(session)

    # --- requests

    def _serve(self, session: _Session) -> None:
        """Answer what can be answered now."""
        self._unfinished.pop(session, None)
        try:
            for _ in range(MAX_AT_ONCE):
                if session.answer is not None or not session.connection.is_open:
                    break
                frame = take_frame(session.inbox)
                if frame is None:
                    return
                self._answer(session, frame)
        except RemoteProtocolError:
            session.connection.close()
        if session.connection.is_open:
            self._unfinished[session] = None

    def _answer(self, session: _Session, frame: ModbusFrame) -> None:
        try:
            request = decode_request(frame.pdu)
            if request.function.is_read:
                pdu = encode_answer(request, self._read(request))
            else:
                self._write(request)
                session.answer = encode_frame(frame.transaction, frame.unit, encode_answer(request))
                session.written_at = self._controller.snapshot.tick
                return
        except MapAddressError:
            pdu = encode_exception(frame.pdu[0], ExceptionCode.ILLEGAL_DATA_ADDRESS)
        except ModbusRequestError as error:
            pdu = encode_exception(frame.pdu[0], error.code)
        self._send(session, encode_frame(frame.transaction, frame.unit, pdu))

    def _read(self, request: ModbusRequest) -> list[int]:
        state, read = self._controller.state, read_coil if request.function.is_bits else read_register
        return [int(read(state, request.address + i)) for i in range(request.count)]

    def _write(self, request: ModbusRequest) -> None:
        is_bits, first = request.function.is_bits, request.address
        if not all(can_write(is_bits, first + i) for i in range(request.count)):
            raise ModbusRequestError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        self._submit(WriteModbus(is_bits, first, request.values))

    def _send(self, session: _Session, answer: bytes) -> None:
        if not session.connection.send(answer):
            session.connection.close()  # without its answer, a client takes the next one for it


class _Session:
    """One client.

    Attributes:
        inbox: requests that were not looked at yet.
        answer: to a write that has not acted yet; nothing else is answered before.
        written_at: tick of the last cycle before that write.
    """

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.inbox = bytearray()
        self.answer: bytes | None = None
        self.written_at = -1
