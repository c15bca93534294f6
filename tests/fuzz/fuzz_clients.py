"""Clients of the ports under fire: real sockets that never wait, and readers that check what a port says byte by byte.

What a `Wire` sends has arrived when the loop turns next. A reader takes a stream in pieces and fails on what is not
whole.
"""

import json
import re
import socket
import struct

from pymodbus.pdu import DecodePDU

from protocol.dashboard.commands import GREETING
from protocol.dashboard.connection import MAX_LINE
from protocol.frame_buffer import FrameBuffer
from protocol.modbus import take_frame
from protocol.modbus_rtu import crc16
from protocol.primary.framing import MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE, PackageType
from protocol.primary.packages import RobotState, decode_package
from protocol.realtime.layout import layout_for_version
from protocol.rtde.codec import Role, decode_message
from protocol.rtde.codec import RtdePackageType as RtdeType

_TIMEOUT = 20.0  # s; a limit for hangs
_RESET = struct.pack("ii", 1, 0)


class Wire:
    """One end of a TCP connection to a box.

    Attributes:
        number: of the client's TCP port.
        is_open: the box has not closed the connection, as far as this end has seen.
        reads: what comes is taken; False lets the buffers of the box fill.
    """

    @classmethod
    def to(cls, address):
        """Connect to a port."""
        return cls(socket.create_connection(address, timeout=_TIMEOUT))

    def __init__(self, sock):
        self.sock = sock
        self.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.sock.setblocking(False)
        self.number = self.sock.getsockname()[1]
        self.is_open = True
        self.reads = True

    def send(self, data):
        """Send what the kernel takes."""
        if self.is_open:
            try:
                self.sock.send(data)
            except BlockingIOError:
                pass
            except OSError:  # closed by the box, or ended by this client
                pass

    def end(self):
        """Say no more, and listen on."""
        if self.is_open:
            try:
                self.sock.shutdown(socket.SHUT_WR)
            except OSError:
                self.close()

    def reset(self):
        """Go without a word."""
        if self.is_open:
            self.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
            self.close()

    def close(self):
        self.is_open = False
        self.sock.close()

    def take(self):
        """Return what has come since."""
        taken = bytearray()
        while self.is_open and self.reads:
            try:
                data = self.sock.recv(1 << 16)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            if not data:
                self.close()
            taken += data
        return bytes(taken)


# pymodbus's decoder of answers.
_MODBUS = DecodePDU(is_server=False)


class RealtimeReader:
    """Counts frames, decodes every tenth."""

    def __init__(self, version):
        self.buffer = FrameBuffer(2000)
        self.layout = layout_for_version(version)
        self.n_frames = 0

    def feed(self, data):
        self.buffer.feed(data)
        while (frame := self.buffer.next_frame()) is not None:
            self.n_frames += 1
            if self.n_frames % 10 == 1:
                self.layout.decode(frame)

    def finish(self):
        assert not self.buffer.pending


class PrimaryReader:
    """Decodes every message, and every fourth state: those of a box differ little."""

    def __init__(self, version):
        self.version = version
        self.buffer = FrameBuffer(MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE)
        self.n_states = 0
        self.messages = []

    def feed(self, data):
        self.buffer.feed(data)
        while (frame := self.buffer.next_frame()) is not None:
            if frame[4] == PackageType.ROBOT_STATE:
                self.n_states += 1
                if self.n_states % 4:
                    continue
            package = decode_package(frame, self.version)
            if not isinstance(package, RobotState):
                self.messages.append(package)
                del self.messages[:-50]

    def finish(self):
        assert not self.buffer.pending


class RtdeReader:
    """Takes packages apart without knowing what was asked."""

    def __init__(self, version):
        self.buffer = bytearray()
        self.n_replies = 0

    def feed(self, data):
        self.buffer += data
        while len(self.buffer) >= 3:
            size = int.from_bytes(self.buffer[:2], "big")
            assert size >= 3, "an RTDE package without a header"
            if len(self.buffer) < size:
                return
            kind, payload = self.buffer[2], bytes(self.buffer[3:size])
            del self.buffer[:size]
            RtdeType(kind)
            if kind != RtdeType.DATA_PACKAGE:
                self.n_replies += 1
                assert any(_decodes(kind, payload, version) for version in (1, 2)), (kind, payload)

    def finish(self):
        assert not self.buffer


def _decodes(kind, payload, version):
    try:
        return decode_message(kind, payload, Role.ROBOT, version) is not None
    except Exception:
        return False


class DashboardReader:
    """Keeps the last lines after the greeting."""

    def __init__(self, version):
        self.buffer = b""
        self.answers = []
        self.n_lines = 0

    def feed(self, data):
        *lines, self.buffer = (self.buffer + data).split(b"\n")
        for line in lines:
            assert len(line) <= MAX_LINE
            assert b"\r" not in line
            if not self.n_lines:
                assert line.decode() == GREETING
            else:
                self.answers.append(line.decode("latin-1"))
                del self.answers[:-50]
            self.n_lines += 1

    def finish(self):
        assert not self.buffer


_INTERPRETER = re.compile(r"(ack: \d+: .*|discard: .*: .*|state: -?\d+: \w+)", re.DOTALL)


class InterpreterReader:
    """Keeps the last lines."""

    def __init__(self, version):
        self.buffer = b""
        self.answers = []

    def feed(self, data):
        *lines, self.buffer = (self.buffer + data).split(b"\n")
        for line in lines:
            text = line.decode("latin-1")
            assert _INTERPRETER.fullmatch(text), text
            self.answers.append(text)
            del self.answers[:-50]

    def finish(self):
        assert not self.buffer


class ModbusReader:
    """Takes answers apart; every one is a value, an echo or an exception."""

    def __init__(self, version):
        self.buffer = bytearray()
        self.answers = []

    def feed(self, data):
        self.buffer += data
        while (frame := take_frame(self.buffer)) is not None:
            function = frame.pdu[0]
            assert function & 0x80 or function in (1, 2, 3, 4, 5, 6, 15, 16), frame
            assert len(frame.pdu) == 2 if function & 0x80 else _MODBUS.decode(frame.pdu) is not None, frame
            self.answers.append(frame)
            del self.answers[:-50]

    def finish(self):
        assert not self.buffer


class GripperReader:
    """Looks at answers of a gripper: bare values have no end, so letters, digits and some signs are all there is."""

    def __init__(self, version):
        self.answers = []

    def feed(self, data):
        assert re.fullmatch(rb"[A-Za-z0-9_.?, \[\]\n-]*", data), data
        self.answers.append(data)
        del self.answers[:-50]

    def finish(self):
        pass


class ToolLineReader:
    """Takes answers of the serial line apart by their checksums."""

    def __init__(self, version):
        self.buffer = bytearray()
        self.answers = []

    def feed(self, data):
        self.buffer += data
        for size in range(5, len(self.buffer) + 1):
            if crc16(bytes(self.buffer[:size])) == 0:  # of a frame and its checksum
                self.answers.append(bytes(self.buffer[:size]))
                del self.buffer[:size]
                del self.answers[:-50]
                self.feed(b"")
                break

    def finish(self):
        assert not self.buffer


# An encoding or a version of HTTP that does not exist; every other one above 500 is a defect of the box.
NOT_OURS = (501, 505)
_STATUS = re.compile(rb"HTTP/1\.1 (\d{3}) [\x20-\x7e]*\r\n")


class HttpReader:
    """Takes responses apart; each is JSON or a file, or says that the rest may be sent."""

    def __init__(self, version):
        self.buffer = b""
        self.answers = []

    def feed(self, data):
        self.buffer += data
        while b"\r\n\r\n" in self.buffer:
            head, _, rest = self.buffer.partition(b"\r\n\r\n")
            match = _STATUS.match(head + b"\r\n")
            assert match, head
            status = int(match[1])
            size = 0 if status in (100, 204) else int(re.search(rb"(?i)content-length: *(\d+)", head)[1])
            if len(rest) < size:
                return
            body, self.buffer = rest[:size], rest[size:]
            if status == 100:
                continue
            assert status < 500 or status in NOT_OURS, (status, body)
            is_json = b"application/json" in head
            self.answers.append((status, json.loads(body) if is_json else body))
            del self.answers[:-20]

    def finish(self):
        assert not self.buffer


READERS = {
    "gripper": GripperReader,
    "onrobot": HttpReader,
    "tool_line": ToolLineReader,
    "realtime": RealtimeReader,
    "realtime_ro": RealtimeReader,
    "primary": PrimaryReader,
    "primary_ro": PrimaryReader,
    "secondary": PrimaryReader,
    "secondary_ro": PrimaryReader,
    "rtde": RtdeReader,
    "dashboard": DashboardReader,
    "modbus": ModbusReader,
    "control": HttpReader,
    "interpreter": InterpreterReader,
    "robot_api": HttpReader,
}
