"""Clients of RTDE and of the primary port written from the protocols alone, byte for byte, which forgive nothing.

Every RTDE request has exactly one reply of its own type, sizes are exact, nothing comes unasked before START was
answered, and what was asked for is what the types say.
"""

import struct

from clients_support import TIMEOUT, connect, receive_exactly

# --- RTDE

VERSION, CONTROLLER, TEXT_MESSAGE, DATA, OUTPUTS, INPUTS, START, PAUSE = map(ord, "VvMUOISP")
FORMATS = {
    "BOOL": "?", "UINT8": "B", "UINT32": "I", "UINT64": "Q", "INT32": "i", "DOUBLE": "d", "VECTOR3D": "3d",
    "VECTOR6D": "6d", "VECTOR6INT32": "6i", "VECTOR6UINT32": "6I",
}  # fmt: skip


class Recipe:
    """Names and types of a data package, as the box named them."""

    def __init__(self, number, names, types):
        self.number, self.names = number, names
        self._formats = [">" + FORMATS[kind] for kind in types]

    def unpack(self, data):
        assert len(data) == sum(map(struct.calcsize, self._formats)), "a package has the size of its recipe"
        values, at = {}, 0
        for name, form in zip(self.names, self._formats, strict=True):
            value = struct.unpack_from(form, data, at)
            values[name] = value[0] if len(value) == 1 else value
            at += struct.calcsize(form)
        return values


class StrictRtde:
    """One connection in protocol version 2."""

    def __init__(self, box):
        self.sock = connect(box, "rtde")
        self.output = None
        self.is_streaming = False
        assert self.ask(VERSION, struct.pack(">H", 2)) == b"\1"

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.sock.close()

    def send(self, kind, payload=b""):
        self.sock.sendall(struct.pack(">HB", 3 + len(payload), kind) + payload)

    def receive(self):
        """Return type and payload of the next package."""
        size, kind = struct.unpack(">HB", receive_exactly(self.sock, 3))
        assert size >= 3
        return kind, receive_exactly(self.sock, size - 3)

    def ask(self, kind, payload=b""):
        """Send a request and return its reply; only a stream may come in between."""
        self.send(kind, payload)
        while True:
            answered, data = self.receive()
            if answered == kind:
                return data
            assert self.is_streaming, f"{chr(answered)} came unasked"
            assert answered in (DATA, TEXT_MESSAGE)

    def controller(self):
        """Return major, minor, bugfix, build."""
        return struct.unpack(">4I", self.ask(CONTROLLER))

    def types_of_outputs(self, names, frequency):
        """Ask for outputs; return recipe id and types."""
        reply = self.ask(OUTPUTS, struct.pack(">d", frequency) + ",".join(names).encode())
        types = reply[1:].decode("ascii").split(",")
        assert len(types) == len(names)
        return reply[0], types

    def want(self, *names, frequency=125.0):
        """Set up the outputs."""
        number, types = self.types_of_outputs(names, frequency)
        assert number == 1
        self.output = Recipe(number, names, types)

    def inputs(self, *names):
        """Set up inputs that are free; return the id of their recipe."""
        reply = self.ask(INPUTS, ",".join(names).encode())
        types = reply[1:].decode("ascii").split(",")
        assert len(types) == len(names)
        assert set(types) <= FORMATS.keys()
        return reply[0]

    def start(self):
        assert self.ask(START) == b"\1"
        self.is_streaming = True

    def pause(self):
        assert self.ask(PAUSE) == b"\1"
        self.is_streaming = False

    def catch_up(self):
        """Begin the stream anew: what has come meanwhile is thrown away."""
        self.pause()
        self.start()

    def data(self):
        """Return the next data package as values by name."""
        while True:
            kind, payload = self.receive()
            if kind == TEXT_MESSAGE:
                continue
            assert kind == DATA
            assert payload[0] == self.output.number
            return self.output.unpack(payload[1:])

    def until(self, condition):
        """Return the first data package that fulfils the condition."""
        for _ in range(int(TIMEOUT * 125)):
            values = self.data()
            if condition(values):
                return values
        raise AssertionError("what was waited for did not come")


# --- primary and secondary port

ROBOT_STATE, ROBOT_MESSAGE = 16, 20
TEXT, VERSION_MESSAGE, SAFETY_MODE, ERROR, KEY, EXCEPTION = 0, 3, 5, 6, 7, 10
MODE, MASTERBOARD, KINEMATICS, CONFIGURATION = 0, 3, 5, 6


class PrimaryWire:
    """A connection to a primary or secondary port."""

    def __init__(self, box, port="primary"):
        self.sock = connect(box, port)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.sock.close()

    def write(self, text):
        self.sock.sendall(text.encode())

    def package(self):
        """Return type and payload of the next package."""
        size, kind = struct.unpack(">iB", receive_exactly(self.sock, 5))
        assert 5 <= size <= 4096, "URCL reads packages of at most 4096 bytes"
        return kind, receive_exactly(self.sock, size - 5)

    def message(self, *kinds):
        """Return type and body of the next message, or of the next of these types."""
        while True:
            package, payload = self.package()
            if package == ROBOT_MESSAGE and (not kinds or payload[9] in kinds):
                return payload[9], payload[10:]

    def titles_and_texts(self, count):
        """Return the next key and text messages: title and text of a key message, the text alone."""
        found = []
        for _ in range(count):
            kind, body = self.message(KEY, TEXT)
            if kind == KEY:
                end = 9 + body[8]
                found.append((body[9:end].decode(), body[end:].decode()))
            else:
                found.append(body.decode())
        return found

    def state(self, wanted=MODE):
        """Return the sub-packages of the next state that has one of this type, by their types."""
        while True:
            kind, payload = self.package()
            if kind != ROBOT_STATE:
                continue
            parts, at = {}, 0
            while at < len(payload):
                size, number = struct.unpack_from(">iB", payload, at)
                assert 5 <= size <= len(payload) - at
                parts[number] = payload[at + 5 : at + size]
                at += size
            if wanted in parts:
                return parts
