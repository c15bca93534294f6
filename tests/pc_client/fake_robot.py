"""A control box in memory for the driver's tests: ports, programs, an arm; no sockets, no time.

It is a `Network` to the driver. Whenever the driver reads a frame, the robot lives on: in lockstep it
advances only while nothing is missing (else it repeats its last frame), otherwise with every frame.
Tests spoil it through `on_tick`, or by setting its attributes.
"""

from __future__ import annotations

import dataclasses
import struct
from collections import deque, namedtuple
from types import SimpleNamespace

from pc_client.driver.transport import PortTakenError
from pc_client.errors import DriverError
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import robot_model, tcp_pose
from protocol.pose import T_to_pose, pose_trans
from protocol.primary.layout import CartesianInfo, ConfigurationData, RobotModeData
from protocol.primary.messages import (
    ErrorCodeMessage,
    ReportLevel,
    RuntimeExceptionMessage,
    encode_message,
    version_message,
)
from protocol.primary.packages import encode_state
from protocol.realtime.layout import SNAPSHOT_FIELDS, layout_for_version
from protocol.rtde.fields import input_fields, output_fields
from protocol.rtde.server_connection import RtdeServerConnection
from protocol.ur_types import LOCKSTEP_MASTERBOARD, Ports, RobotType, SoftwareVersion
from protocol.velocity_stream import VelocityMode

VERSION = SoftwareVersion(3, 15, 8)
PERIOD = 0.008
LAYOUT = layout_for_version(VERSION)
_ENCODE = LAYOUT.encoder()
_COUNTS = {column.attribute: column.count for column in LAYOUT.columns}
_ALL_ZERO = {name: 0.0 if _COUNTS.get(name, 1) == 1 else (0.0,) * _COUNTS[name] for name in SNAPSHOT_FIELDS}
VelocityCommand = namedtuple("VelocityCommand", ("mode", "qd"))
STOPPED, PLAYING, PAUSED = 1, 2, 4
CYCLES_PER_STATE = 13


class Pipe:
    """The driver's end of one connection; the robot's end are the two queues."""

    def __init__(self, robot, kind, peer="10.0.0.2"):
        self.robot, self.kind, self.peer_address = robot, kind, peer
        self.local_address = "10.0.0.1"
        self.incoming = deque()
        self.outgoing = deque()
        self.closed = self.broken = False

    def send(self, data):
        if self.closed or self.broken:
            raise DriverError(f"{self.kind}: the other end closed the connection")
        self.outgoing.append(data)
        self.robot.took(self, data)

    def receive(self, timeout):
        assert not self.closed, "read after close"
        if not self.incoming and not self.broken and self.kind == "realtime" and timeout > 0:
            self.robot.live()
        if self.incoming:
            # all that is there comes at once, as from a socket
            data = b"".join(self.incoming)
            self.incoming.clear()
            return data
        if self.broken:
            return b""
        self.robot.clock += timeout
        return None

    def close(self):
        if not self.closed:
            self.closed = True
            self.robot.closed.append(self.kind)


class Listener:
    def __init__(self, robot, port):
        self.robot = robot
        self.port = port or 50123
        self.callers = deque()
        self.closed = False

    def accept(self, timeout):
        if self.callers:
            return self.callers.popleft()
        self.robot.clock += timeout
        return None

    def close(self):
        self.closed = True


class FakeRobot:
    def __init__(
        self, *, lockstep=True, delay=3, on_tick=None, hello=None, dials=True, has_dashboard=True, model="UR3"
    ):
        self.lockstep, self.delay, self.on_tick = lockstep, delay, on_tick
        self.hello = b"\0\0\0\x01" if hello is None else hello
        self.dials, self.has_dashboard = dials, has_dashboard
        self.model = model
        self.clock = 0.0
        self.tick = 1000
        self.q = [0.0] * 6
        self.qd = [0.0] * 6
        self.robot_mode, self.safety_mode = 7, 1
        self.serial = "20993000007"  # None: software that does not know the question
        self.remote = self.operational = None  # None: software that does not know the question
        self.version = VERSION
        self.greeting = None  # instead of the version message: bytes
        self.slider, self.scaling = 1.0, 1.0
        self.tcp_offset = (0.0,) * 6
        self.payload = 0.0  # None: no RTDE port
        self.payload_cog = (0.0, 0.0, 0.0)
        self.state = None  # instead of the state that script ports send: bytes
        self.program = None  # None, "receiver", "stop"
        self.programs = []
        self.listener = None
        self.taken_ports = ()
        self.reverse = None
        self.commands = deque()
        self.received = []  # every velocity message
        self.closed = []
        self.pipes = {}
        self.hold = 0  # frames to hold back, so that they come together
        self.skip = 0  # frames to lose
        self.silent = False
        self.refuses = False
        self.deaf_to_stop = False
        self.error_in = None
        self.arm = robot_model(model.lower() if model.lower() in ROBOTS else "ur3")
        self.pauses = False  # a safety stop pauses the program, as on a real controller

    # ---- Network
    def now(self):
        return self.clock

    def connect(self, host, port, timeout):
        kind = {v: k for k, v in dataclasses.asdict(Ports.standard()).items()}[port]
        if kind == "dashboard" and not self.has_dashboard:
            raise DriverError(f"{host}:{port} refuses the connection")
        pipe = self.pipes[kind] = Pipe(self, kind)
        if kind in ("primary", "secondary"):
            greeting = package(encode_message(version_message(self.version), self.version))
            pipe.incoming.append(self.greeting or greeting)
            pipe.incoming.append(self.robot_state())
        elif kind == "realtime":
            pipe.incoming.append(self.frame())
        elif kind == "rtde":
            if self.payload is None:
                raise DriverError(f"{host}:{port} refuses the connection")
            pipe.rtde = RtdeServerConnection(
                self.version, output_fields(self.version), input_fields(self.version)
            )
        elif kind == "dashboard":
            pipe.incoming.append(b"Connected: Universal Robots Dashboard Server\n")
        return pipe

    def listen(self, address, port):
        if port in self.taken_ports:
            raise PortTakenError(f"cannot listen on {address}:{port}: taken")
        self.listener = Listener(self, port)
        return self.listener

    # ---- what the driver sends
    def took(self, pipe, data):
        if pipe.kind == "secondary":
            self.load(data.decode())
        elif pipe.kind == "reverse":
            mode, *steps = struct.unpack(">7i", data)
            self.commands.append(VelocityCommand(VelocityMode(mode), tuple(step / 1e6 for step in steps)))
            self.received.append(self.commands[-1])
        elif pipe.kind == "rtde":
            pipe.rtde.receive_data(data)
            while pipe.rtde.next_event() is not None:
                pipe.incoming.append(pipe.rtde.reply())
            if pipe.rtde.encoder is not None:
                pipe.incoming.append(pipe.rtde.encoder(self))
        elif pipe.kind == "dashboard":
            answers = {
                "get serial number": self.serial,
                "get robot model": self.model,
                "is in remote control": self.remote,
                "get operational mode": self.operational,
            }
            answer = answers.get(data.decode().strip())
            if answer:
                pipe.incoming.append(answer.encode() + b"\n")

    @property
    def timestamp(self):
        return self.tick * PERIOD

    @property
    def actual_q(self):
        return tuple(self.q)

    @property
    def actual_tcp_pose(self):
        return pose_trans(T_to_pose(tcp_pose(self.arm, self.q)), self.tcp_offset)

    def robot_state(self):
        """What the script ports send ten times a second."""
        robot_type = RobotType[self.model] if self.model in RobotType.__members__ else RobotType.UR3
        return self.state or encode_state(
            [
                RobotModeData(target_speed_fraction=self.slider, speed_scaling=self.scaling),
                CartesianInfo(tcp_offset=self.tcp_offset),
                ConfigurationData(
                    robot_type=robot_type, masterboard_version=LOCKSTEP_MASTERBOARD if self.time_waits else 6
                ),
            ],
            self.version,
        )

    def load(self, text):
        if text == "stop program\n":
            self.program = None
            return
        assert text.endswith("end\n"), text
        self.programs.append(text)
        if self.refuses:
            if self.remote == "false":
                self.report(ErrorCodeMessage(code=210, report_level=ReportLevel.WARNING))
            return
        if self.error_in and self.error_in in text:
            self.report(RuntimeExceptionMessage(line=2, column=3, text="compile_error_name_not_found:foo:"))
            return
        if self.reverse is not None:
            self.reverse.broken = True
        self.commands.clear()
        if "socket_open" in text:
            self.program = "receiver"
            self.pipeline = deque([[0.0] * 6] * self.delay)
            if self.dials:
                self.reverse = Pipe(self, "reverse")
                self.reverse.incoming.append(self.hello)
                self.listener.callers.append(self.reverse)
        elif "stopj" in text:
            self.program = "stop"

    def report(self, message):
        self.pipes["primary"].incoming.append(package(encode_message(message, VERSION)))

    # ---- life
    def live(self):
        """One read of a frame by the driver."""
        if self.silent:
            return
        frames = self.pipes["realtime"].incoming
        while True:
            waits = self.program is None or (
                self.program == "receiver" and not self.commands and self.safety_mode == 1
            )
            if self.time_waits and waits:
                self.clock += PERIOD
                frames.append(self.frame())
                return
            self.advance()
            if self.skip:
                self.skip -= 1
                continue
            if self.silent:
                return
            frames.append(self.frame())
            if not self.hold:
                return
            self.hold -= 1

    def advance(self):
        self.tick += 1
        self.clock += PERIOD
        if self.on_tick is not None:
            self.on_tick(self)
        if self.tick % CYCLES_PER_STATE == 0:
            for pipe in (self.pipes["primary"], self.pipes["secondary"]):
                pipe.incoming.append(self.robot_state())
        if self.safety_mode != 1:
            self.qd = [0.0] * 6
            if not self.pauses:
                self.program = None
        elif self.program == "receiver":
            self.follow()
        elif self.program == "stop":
            self.qd = [0.0] * 6
            self.program = None
        if self.program != "receiver":
            self.qd = [0.0] * 6

    def follow(self):
        if self.commands:
            command = self.commands.popleft()
            if command.mode is VelocityMode.STOP_PROGRAM and not self.deaf_to_stop:
                self.program, self.qd = None, [0.0] * 6
                return
            self.pipeline.append(list(command.qd))
        else:
            self.pipeline.append(list(self.pipeline[-1]) if self.pipeline else self.qd)
        self.qd = self.pipeline.popleft()
        self.q = [q + qd * PERIOD for q, qd in zip(self.q, self.qd, strict=True)]

    def frame(self):
        values = dict(_ALL_ZERO)
        values.update(
            timestamp=self.timestamp,
            target_q=tuple(self.q),
            actual_q=self.actual_q,
            actual_qd=tuple(self.qd),
            robot_mode=self.robot_mode,
            safety_mode=self.safety_mode,
            runtime_state=STOPPED if self.program is None else PAUSED if self.safety_mode != 1 else PLAYING,
        )
        values["speed_scaling"] = self.scaling
        values["actual_tcp_pose"] = self.actual_tcp_pose
        return _ENCODE(SimpleNamespace(**values))

    # ---- what tests look at
    @property
    def time_waits(self):
        """In lockstep, as only a robot is that can say so: an emulated one."""
        return self.lockstep and self.has_dashboard and (self.serial or "").startswith("2099")

    @property
    def at_rest(self):
        return self.program is None and not any(self.qd)

    def report_error(self, level=3):
        self.report(ErrorCodeMessage(code=153, argument=2, report_level=level, text="position deviates"))


def package(body):
    return (len(body) + 5).to_bytes(4, "big") + b"\x14" + body
