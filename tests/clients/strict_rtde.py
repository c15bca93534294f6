"""A client of the RTDE protocol written from the protocol alone, which forgives nothing.

Every request has exactly one reply of its own type, sizes are exact, nothing comes unasked before START was
answered, and what was asked for is what the types say.
"""

import struct

from clients_support import TIMEOUT, connect, receive_exactly

VERSION, CONTROLLER, MESSAGE, DATA, OUTPUTS, INPUTS, START, PAUSE = map(ord, "VvMUOISP")
FORMATS = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}


class Recipe:
    """Names and types of a data package.

    Attributes:
        number: its id.
        names: of the variables.
        types: as the box named them.
    """

    def __init__(self, number, names, types):
        self.number, self.names, self.types = number, names, types
        self._widths = [struct.calcsize(">" + FORMATS[t]) for t in types]
        self.size = sum(self._widths)

    def unpack(self, data):
        assert len(data) == self.size, "a data package has exactly the size of its recipe"
        values, at = {}, 0
        for name, kind, width in zip(self.names, self.types, self._widths, strict=True):
            value = struct.unpack_from(">" + FORMATS[kind], data, at)
            values[name] = value[0] if len(value) == 1 else value
            at += width
        return values

    def pack(self, **values):
        assert set(values) == set(self.names)
        data = b""
        for name, kind in zip(self.names, self.types, strict=True):
            value = values[name]
            data += struct.pack(
                ">" + FORMATS[kind], *(value if isinstance(value, tuple | list) else (value,))
            )
        return bytes([self.number]) + data


class StrictRtde:
    """One connection; protocol version 2 unless told otherwise."""

    def __init__(self, box, protocol=2):
        self.sock = connect(box, "rtde")
        self.sock.settimeout(TIMEOUT)
        self.protocol = protocol
        self.output = None
        self.messages = []
        self.is_streaming = False
        assert self.ask(VERSION, struct.pack(">H", protocol)) == b"\1"

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
            assert answered in (DATA, MESSAGE)

    def controller(self):
        """Return major, minor, bugfix, build."""
        return struct.unpack(">4I", self.ask(CONTROLLER))

    def types_of_outputs(self, names, frequency=125.0):
        """Ask for outputs; return recipe id and types."""
        head = struct.pack(">d", frequency) if self.protocol == 2 else b""
        reply = self.ask(OUTPUTS, head + ",".join(names).encode())
        number, types = (reply[0], reply[1:]) if self.protocol == 2 else (None, reply)
        types = types.decode("ascii").split(",")
        assert len(types) == len(names)
        return number, types

    def want(self, *names, frequency=125.0):
        """Set up the outputs."""
        number, types = self.types_of_outputs(names, frequency)
        assert number in (None, 1)
        self.output = Recipe(number, names, types)
        return self.output

    def inputs(self, *names):
        """Set up inputs; return their recipe, or the types if the box refused one."""
        reply = self.ask(INPUTS, ",".join(names).encode())
        types = reply[1:].decode("ascii").split(",")
        assert len(types) == len(names)
        if {"IN_USE", "NOT_FOUND"} & set(types):
            return types
        return Recipe(reply[0], names, types)

    def start(self):
        reply = self.ask(START)
        assert len(reply) == 1
        self.is_streaming = reply == b"\1"
        return self.is_streaming

    def pause(self):
        reply = self.ask(PAUSE)
        assert reply == b"\1"
        self.is_streaming = False

    def catch_up(self):
        """Begin the stream anew: what has come meanwhile is thrown away."""
        self.pause()
        assert self.start()

    def data(self):
        """Return the next data package as values by name; texts are kept aside."""
        while True:
            kind, payload = self.receive()
            if kind == MESSAGE:
                self.messages.append(payload)
                continue
            assert kind == DATA
            if self.protocol == 2:
                assert payload[0] == self.output.number
                payload = payload[1:]
            return self.output.unpack(payload)

    def until(self, condition):
        """Return the first data package that fulfils the condition."""
        for _ in range(int(TIMEOUT * 125)):
            values = self.data()
            if condition(values):
                return values
        raise AssertionError("what was waited for did not come")

    def write(self, recipe, **values):
        self.send(DATA, recipe.pack(**values))
