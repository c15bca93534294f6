"""Valid messages of every port, from the project's own encoders."""

import json
import struct
import xmlrpc.client
from pathlib import Path

from protocol import robotiq
from protocol.dashboard.commands import COMMANDS
from protocol.interpreter import Word
from protocol.modbus import ModbusFunction, encode_read, encode_write
from protocol.modbus_rtu import encode_rtu
from protocol.robot_api import BASE, CALLS
from protocol.robotiq import SID, VARIABLES
from protocol.rtde.codec import (
    GetControllerVersion,
    Pause,
    RequestProtocolVersion,
    Role,
    RtdeTextMessage,
    SetupInputs,
    SetupOutputs,
    Start,
    encode_message,
)
from protocol.rtde.fields import INPUTS, OUTPUTS
from protocol.script_channel import CONTROLLER_WORDS
from ur_emulator.host.control_api.operations import OPERATIONS
from ur_emulator.host.ports.onrobot import METHODS
from ur_emulator.machine.commands.operation import Kind

# Words and operations by which something else than a program may move the arm.
MOVING_WORDS = {"set robotmode freedrive"}
MOVING_OPERATIONS = {"push", "attach_payload"}


def _programs(name):
    """Return the programs of a file, which a line --- separates; before the first one is what they are."""
    return tuple((Path(__file__).parent / "programs" / f"{name}.script").read_text().split("---\n")[1:])


STILL_PROGRAMS, DIALLING_PROGRAMS, MOVING_PROGRAMS = map(_programs, ("still", "dialling", "moving"))

# What port 30020 gets beside words; some hundred of the first kind are too many.
STILL_STATEMENTS = (
    "x = 1", 'textmsg("said ", x)', "sleep(0.01)", "sync()", "set_digital_out(1, True)", "clear_interpreter()",
    "end_interpreter()", "x = [1, 2", "def f(): return 1 end y = f()", "while True: sync() end", "x = nothing()",
    "if x > 0: z = 2 end", "halt", "x = 1 / 0",
)  # fmt: skip


def script_message(rng, lively):
    if rng.random() < 0.35:
        word = rng.choice([w for w in CONTROLLER_WORDS if lively or w.text not in MOVING_WORDS])
        numbers = ("0.5", "1", "0", "-1", "nan", "1e999", "0.01")
        return (word.text + (f" {rng.choice(numbers)}" if word.takes_number else "") + "\n").encode()
    programs = STILL_PROGRAMS + DIALLING_PROGRAMS + (MOVING_PROGRAMS if lively else ())
    return rng.choice(programs).encode()


_OUTPUTS = [*(field.name for field in OUTPUTS), "nope", ""]
_INPUTS = [*(field.name for field in INPUTS), "nope", "timestamp"]
_NASTY = (b"\x7f\xf8", b"\x7f\xf0", b"\xff\xf0", b"\0\0", b"\xff\xff", b"\x80\0", b"\x3f\xf0")


def rtde_message(rng, lively):
    version = rng.choice((1, 2, 2, 2))
    kind = rng.randrange(11)
    if kind < 3:
        names = tuple(rng.choice(_OUTPUTS) for _ in range(rng.choice((0, 1, 2, 5, 20))))
        rate = rng.choice((125.0, 10.0, 1.0, 1000.0, 0.0, -1.0, float("nan"), float("inf"), 1e-300))
        message = SetupOutputs(names, rate if version == 2 else None)
    elif kind < 5:
        message = SetupInputs(tuple(rng.choice(_INPUTS) for _ in range(rng.choice((0, 1, 2, 5)))))
    elif kind == 5:
        message = Start()
    elif kind == 6:
        message = Pause()
    elif kind == 7:
        message = RequestProtocolVersion(rng.choice((1, 2, 2, 3, 0, 65535)))
    elif kind == 8:
        message = GetControllerVersion()
    elif kind == 9 and rng.random() < 0.2:
        message = RtdeTextMessage("text", "fuzz" if version == 2 else "", 1)
    else:
        values = bytes([rng.choice((1, 1, 2, 3, 0, 255))]) + b"".join(
            rng.choice(_NASTY) + rng.randbytes(rng.choice((2, 6))) for _ in range(rng.randrange(6))
        )
        return struct.pack(">HB", len(values) + 3, ord("U")) + values
    try:
        return encode_message(message, Role.PC, version)
    except Exception:  # what our client would not send: names that no list can carry
        return encode_message(Start(), Role.PC, version)


_ARGUMENTS = ("wait.urp", "hello.urp", "strange.urp", "broken.script", "cell/count me.script", "../../etc/passwd",
              "other.installation", "odd.installation", "", "x" * 300, "\xe9\x00", "programmer", "none")  # fmt: skip


def dashboard_message(rng, lively):
    row = rng.choice(COMMANDS)
    argument = f" {rng.choice(_ARGUMENTS)}" if row.argument or rng.random() < 0.1 else ""
    if row.name in ("generate support file", "generate flight report"):
        return b"robotmode\n"  # they write files for a second and more
    return (row.name + argument + rng.choice(("\n", "\r\n"))).encode("latin-1")


def modbus_message(rng, lively):
    function = rng.choice((1, 2, 3, 4, 5, 6, 15, 16, 7, 0, 23, 43, 128, 255))
    address = rng.choice((0, 1, 16, 30, 128, 255, 256, 258, 270, 300, 400, 65535, rng.randrange(1024)))
    count = rng.choice((0, 1, 2, 8, 16, 123, 125, 126, 2000, 2001, 65535))
    if function in (15, 16):
        size = rng.choice((0, 1, 2, (count + 7) // 8, 2 * count)) % 256
        pdu = struct.pack(">BHHB", function, address, count, size) + rng.randbytes(min(size, 246))
    else:
        pdu = struct.pack(">BHH", function, address, rng.choice((count, 0, 0xFF00)))
    return struct.pack(">HHHB", rng.randrange(65536), 0, len(pdu) + 1, rng.choice((0, 1, 255))) + pdu


def _argument(rng, parameter):
    if rng.random() < 0.15:
        return rng.choice((None, 1e999, -1, 10**400, "x", [], {}, [1, 2, 3], True, "\ud800"))
    match parameter.kind:
        case Kind.CHOICE:
            return rng.choice(parameter.choices)
        case Kind.NUMBER:
            return rng.choice((0, 0.5, 1.0, parameter.low or 0))
        case Kind.INTEGER:
            return rng.choice((0, 1, 7, -1, 8))
        case Kind.BOOLEAN:
            return rng.random() < 0.5
        case Kind.VECTOR:
            return [rng.uniform(-5, 5) for _ in range(3)]
        case Kind.SCRIPT:
            return rng.choice(STILL_PROGRAMS)
        case _:
            return rng.choice(("text", "1", "\n\r\x00", "wait.urp"))


def control_message(rng, lively):
    name = rng.choice([name for name in OPERATIONS if lively or name not in MOVING_OPERATIONS])
    operation = OPERATIONS[name]
    arguments = {
        p.name: _argument(rng, p) for p in operation.parameters if p.is_required or rng.random() < 0.5
    }
    host = rng.choice(("127.0.0.1", "localhost", "127.0.0.1", "evil.example", ""))
    if operation.only_reads and rng.random() < 0.8:
        query = "&".join(f"{k}={v}" for k, v in arguments.items() if v is not None)
        query = "".join(c if 32 < ord(c) < 127 else "%20" for c in query)
        return f"GET /v1/{name}?{query} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()
    body = json.dumps(arguments).encode()
    extra = rng.choice(("", "", "", "Expect: 100-continue\r\n", "Connection: close\r\n"))
    if rng.random() < 0.2:
        head = f"POST /v1/{name} HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\n{extra}Transfer-Encoding: chunked\r\n\r\n"
        return head.encode() + b"%x\r\n%s\r\n0\r\n\r\n" % (len(body), body)
    head = f"POST /v1/{name} HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\n{extra}Content-Length: {len(body)}\r\n\r\n"
    return head.encode() + body


def peer_message(rng):
    """What a peer of a script sends."""
    kind = rng.randrange(6)
    if kind == 5:
        body = (
            b"<methodResponse><params><param><value>%s</value></param></params></methodResponse>"
            % rng.choice((b"<int>1</int>", b"text", b"<array><data/></array>", b"<nil/>", b""))
        )
        size = len(body) - rng.choice((0, 0, 0, 1))
        return b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n%s" % (size, body)
    if kind == 0:
        numbers = [
            rng.choice(("1", "2.5", "-1e9", "nan", "1e999", "x", ""))
            for _ in range(rng.choice((3, 3, 0, 31)))
        ]
        return f"({', '.join(numbers)})\n".encode()
    if kind == 1:
        return bytes([rng.choice((2, 2, 0, 31, 255))]) + rng.randbytes(8)
    if kind == 2:
        return rng.choice((b">text<", b"a 7\n", b"line\r\n", b"\xff\0\n", b"<" * 300, b"GET b\n", b""))
    return rng.randbytes(rng.choice((1, 40, 4000, 60_000)))


def interpreter_message(rng, lively):
    if rng.random() < 0.3:
        return rng.choice(tuple(Word)).value.encode() + b"\n"
    lines = STILL_STATEMENTS + (tuple(p for p in MOVING_PROGRAMS if p.count("\n") == 1) if lively else ())
    ends = rng.choice(("\n", "\r\n", "\n\n"))
    return "".join(rng.choice(lines).rstrip() + ends for _ in range(rng.choice((1, 1, 1, 5, 60)))).encode()


_API_WORDS = ("POWER_ON", "POWER_OFF", "BRAKE_RELEASE", "UNLOCK_PROTECTIVE_STOP", "RESTART_SAFETY", "play", "pause",
              "resume", "stop", "hello", "wait", "strange", "../../etc/passwd", "", None, 7, [], {})  # fmt: skip
_FORM = '--cut\r\nContent-Disposition: form-data; name="file"; filename="{}"\r\n\r\n{}\r\n--cut--\r\n'


def robot_api_message(rng, lively):
    call = rng.choice(CALLS)
    path = BASE + call.path.replace("{name}", rng.choice(("wait", "hello.urp", "..%2f..", "%00", "x" * 300)))
    host, kind = rng.choice(("127.0.0.1", "localhost", "evil.example", "")), "application/json"
    keys = ("action", "name", "programName", "title", "message")
    body = json.dumps({key: rng.choice(_API_WORDS) for key in rng.sample(keys, rng.choice((0, 1, 1, 5)))})
    if call.path == "/programs/v1" and call.method != "GET":
        name = rng.choice(("a.urpx", "b.urp", "c.script", "../d.urpx", "", "hello.urp"))
        kind, body = "multipart/form-data; boundary=cut", _FORM.format(name, rng.choice(STILL_PROGRAMS))
    head = f"{call.method} {path} HTTP/1.1\r\nHost: {host}\r\n"
    if call.method == "GET":
        return f"{head}\r\n".encode()
    return f"{head}Content-Type: {kind}\r\nContent-Length: {len(body.encode())}\r\n\r\n{body}".encode()


def gripper_message(rng, lively):
    """A request for a variable, or one that sets some; nothing activates the gripper."""
    names = [name for name in VARIABLES if name != "ACT"]
    if rng.random() < 0.5:
        return f"GET {rng.choice([*names, 'ACT', SID])}{rng.choice(['', chr(10)])}".encode()
    pairs = " ".join(
        f"{rng.choice(names)} {rng.choice([0, 1, 9, 255, 256])}" for _ in range(rng.randint(1, 4))
    )
    return f"SET {pairs}\n".encode()


def onrobot_message(rng, lively):
    """A call of a method, often with wrong types; the fingers move only in a lively box."""
    names = [name for name in METHODS if lively or name != "rg_grip"]
    values = [
        rng.choice([0, 1, 2**31 - 1, 20.0, -1e308, float("nan"), True, "rg_grip", [1], {"a": 2}])
        for _ in range(3)
    ]
    body = xmlrpc.client.dumps(
        tuple(values[: rng.randrange(4)]), rng.choice([*names, "rg_fly", "<"])
    ).encode()
    if rng.random() < 0.2:
        body = rng.choice(
            (b"", b"<methodCall>", b"<!DOCTYPE a>", b"<a>" * 900, b"\xff" * 40, b"<methodResponse/>")
        )
    head = f"{rng.choice(('POST', 'POST', 'POST', 'GET'))} {rng.choice(('/', '/RPC2'))} HTTP/1.1"
    return f"{head}\r\nHost: 127.0.0.1\r\nContent-Length: {len(body)}\r\n\r\n".encode() + body


def tool_line_message(rng, lively):
    """A request of Modbus RTU to the gripper; nothing activates it."""
    address = rng.choice([robotiq.OUTPUTS, robotiq.INPUTS + 1, robotiq.INPUTS + 2, rng.randrange(1 << 16)])
    read = ModbusFunction(rng.choice([3, 4]))
    pdu = rng.choice(
        [
            encode_read(read, address, rng.randint(1, 6)),
            encode_write(ModbusFunction(16), robotiq.INPUTS + 1, [7]),
        ]
    )
    return encode_rtu(rng.choice([9, 9, 9, 1]), pdu)


MESSAGES = {
    "gripper": gripper_message,
    "onrobot": onrobot_message,
    "tool_line": tool_line_message,
    "realtime": script_message,
    "realtime_ro": script_message,
    "primary": script_message,
    "primary_ro": script_message,
    "secondary": script_message,
    "secondary_ro": script_message,
    "rtde": rtde_message,
    "dashboard": dashboard_message,
    "modbus": modbus_message,
    "control": control_message,
    "interpreter": interpreter_message,
    "robot_api": robot_api_message,
}
