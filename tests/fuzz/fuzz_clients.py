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
from protocol.modbus import take_frame
from protocol.modbus_rtu import crc16
from protocol.primary.framing import MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE, PackageType
from protocol.primary.packages import decode_package
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


class Reader:
    """Takes a stream apart, checks what is whole, and keeps the last answers.

    Attributes:
        answers: what `check` has returned, None left out; at most the last fifty.
    """

    def __init__(self, version):
        self.version, self.buffer, self.answers = version, bytearray(), []

    def feed(self, data):
        self.buffer += data
        while (one := self.take()) is not None:
            if (answer := self.check(one)) is not None:
                self.answers.append(answer)
                del self.answers[:-50]

    def take(self):
        """Cut what is whole off the beginning of the buffer; None while nothing is."""
        raise NotImplementedError

    def check(self, one):
        """Fail on what a port must not say; return what is kept."""
        return one

    def finish(self):
        assert not self.buffer

    def cut(self, size):
        """Return so many bytes as soon as they are there."""
        if len(self.buffer) < size:
            return None
        one = bytes(self.buffer[:size])
        del self.buffer[:size]
        return one

    def cut_frame(self, size_bytes, least, most):
        """Return a frame that begins with its size."""
        if len(self.buffer) < size_bytes:
            return None
        size = int.from_bytes(self.buffer[:size_bytes], "big")
        assert least <= size <= most, f"a frame of {size} bytes"
        return self.cut(size)


class RealtimeReader(Reader):
    """Counts frames, decodes every tenth."""

    def __init__(self, version):
        super().__init__(version)
        self.layout = layout_for_version(version)
        self.n_frames = 0

    def take(self):
        return self.cut_frame(4, self.layout.size, self.layout.size)

    def check(self, frame):
        self.n_frames += 1
        if self.n_frames % 10 == 1:
            self.layout.decode(frame)


class PrimaryReader(Reader):
    """Decodes every message, and every fourth state: those of a box differ little."""

    n_states = 0

    def take(self):
        return self.cut_frame(4, MIN_PACKAGE_SIZE, MAX_PACKAGE_SIZE)

    def check(self, frame):
        is_state = frame[4] == PackageType.ROBOT_STATE
        self.n_states += is_state
        if not is_state or self.n_states % 4 == 0:
            decode_package(frame, self.version)


class RtdeReader(Reader):
    """Takes packages apart without knowing what was asked."""

    n_replies = 0

    def take(self):
        return self.cut_frame(2, 3, 1 << 16)

    def check(self, package):
        kind = RtdeType(package[2])
        if kind != RtdeType.DATA_PACKAGE:
            self.n_replies += 1
            assert any(_decodes(kind, package[3:], version) for version in (1, 2)), package


def _decodes(kind, payload, version):
    try:
        return decode_message(kind, payload, Role.ROBOT, version) is not None
    except Exception:
        return False


class LineReader(Reader):
    """Lines, without their ends."""

    def take(self):
        end = self.buffer.find(b"\n")
        return None if end < 0 else self.cut(end + 1)[:-1].decode("latin-1")


class DashboardReader(LineReader):
    """Answers after the greeting."""

    is_greeted = False

    def check(self, line):
        assert len(line) <= MAX_LINE
        assert "\r" not in line
        if not self.is_greeted:
            assert line == GREETING
            self.is_greeted = True
            return None
        return line


class InterpreterReader(LineReader):
    """Answers of interpreter mode."""

    def check(self, line):
        assert re.fullmatch(r"(ack: \d+: .*|discard: .*: .*|state: -?\d+: \w+)", line, re.DOTALL), line
        return line


# pymodbus's decoder of answers.
_MODBUS = DecodePDU(is_server=False)


class ModbusReader(Reader):
    """Takes answers apart; every one is a value, an echo or an exception."""

    def take(self):
        return take_frame(self.buffer)

    def check(self, frame):
        function = frame.pdu[0]
        assert function & 0x80 or function in (1, 2, 3, 4, 5, 6, 15, 16), frame
        assert len(frame.pdu) == 2 if function & 0x80 else _MODBUS.decode(frame.pdu) is not None, frame
        return frame


class GripperReader(Reader):
    """Looks at answers of a gripper: bare values have no end, so letters, digits and some signs are all there is."""

    def take(self):
        return self.cut(len(self.buffer)) or None

    def check(self, data):
        assert re.fullmatch(rb"[A-Za-z0-9_.?, \[\]\n-]*", data), data


class ToolLineReader(Reader):
    """Takes answers of the serial line apart by their checksums."""

    def take(self):
        sizes = (size for size in range(5, len(self.buffer) + 1) if crc16(bytes(self.buffer[:size])) == 0)
        size = next(sizes, None)  # of a frame and its checksum
        return None if size is None else self.cut(size)


# An encoding or a version of HTTP that does not exist; every other one above 500 is a defect of the box.
NOT_OURS = (501, 505)
_STATUS = re.compile(rb"HTTP/1\.1 (\d{3}) [\x20-\x7e]*\r\n")


class HttpReader(Reader):
    """Takes responses apart; each is JSON or a file, or says that the rest may be sent."""

    def take(self):
        head, end, _ = self.buffer.partition(b"\r\n\r\n")
        if not end:
            return None
        match = _STATUS.match(head + b"\r\n")
        assert match, head
        status = int(match[1])
        size = 0 if status in (100, 204) else int(re.search(rb"(?i)content-length: *(\d+)", head)[1])
        whole = self.cut(len(head) + 4 + size)
        return None if whole is None else (status, b"application/json" in head, whole[len(head) + 4 :])

    def check(self, response):
        status, is_json, body = response
        if status == 100:
            return None
        assert status < 500 or status in NOT_OURS, (status, body)
        return status, json.loads(body) if is_json else body


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
