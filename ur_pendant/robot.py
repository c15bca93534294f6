"""What a robot reports, as a window shows it: read by threads of its own, which begin again after a loss.

RTDE gives the signals below, the primary port says who it is and what it logs, and the control API of an
emulated box has what no port of a robot has. Nothing here makes a robot do something.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Mapping
from itertools import count
from types import MappingProxyType
from typing import NamedTuple

from pc_client.driver.primary import PackageStream
from pc_client.driver.report import RobotInfo, StatePorts
from pc_client.driver.rtde import RtdeStream, RtdeValues
from pc_client.driver.transport import TcpNetwork
from pc_client.errors import ClientError
from protocol.primary.layout import KinematicsInfo
from protocol.primary.messages import (
    ErrorCodeMessage,
    KeyMessage,
    PopupMessage,
    ProgramThreadsMessage,
    RequestedType,
    RequestValueMessage,
    RobotMessage,
    RuntimeExceptionMessage,
    TextMessage,
)
from protocol.primary.values import TypedValue
from protocol.ur_types import JOINT_NAMES, Ports
from ur_emulator.errors import EmulatorError
from ur_emulator.host.control_api.box_state import BoxState, Question
from ur_emulator.host.control_api.http_client import AttachedBox
from ur_emulator.host.control_api.step_operations import ReadLog, ReadState

RATE = 30.0
"""Packages a second that RTDE is asked for: a screen shows twice as many at best."""

_SLOWLY, _LOG_EVERY = (
    0.2,
    3,
)  # Between two questions to the control API [s]; how often one is for the log, too.
_PAUSE = 1.0  # Before the next try when a robot does not answer [s].
_HISTORY = 60.0  # How long signals are kept [s].
_LOG_LINES = 200
_LONGEST = 160  # Of a text that is shown [characters].


class Signal(NamedTuple):
    """A variable of RTDE that the window shows; `parts` name the numbers of a vector."""

    name: str
    unit: str
    parts: tuple[str, ...] = ()


_POSE = ("x", "y", "z", "rx", "ry", "rz")

PLOTTED = (
    Signal("actual_q", "rad", JOINT_NAMES),
    Signal("target_q", "rad", JOINT_NAMES),
    Signal("actual_qd", "rad/s", JOINT_NAMES),
    Signal("target_qd", "rad/s", JOINT_NAMES),
    Signal("actual_current", "A", JOINT_NAMES),
    Signal("joint_temperatures", "°C", JOINT_NAMES),
    Signal("actual_TCP_pose", "m, rad", _POSE),
    Signal("target_TCP_pose", "m, rad", _POSE),
    Signal("actual_TCP_speed", "m/s, rad/s", _POSE),
    Signal("actual_TCP_force", "N, Nm", _POSE),
    Signal("speed_scaling", ""),
    Signal("actual_robot_current", "A"),
    Signal("actual_momentum", "kg m/s"),
)
"""Signals that are numbers over time."""

OUTPUTS = (
    "timestamp",
    *(signal.name for signal in PLOTTED),
    "robot_mode",
    "safety_mode",
    "safety_status",
    "runtime_state",
    "target_speed_fraction",
    "tcp_offset",
    "payload",
    "actual_digital_input_bits",
    "actual_digital_output_bits",
    *(f"standard_analog_{way}{k}" for way in ("input", "output") for k in range(2)),
    "tool_output_voltage",
    "script_control_line",
    *(f"output_{kind}_register_{k}" for kind in ("int", "double") for k in range(4)),
)
"""What RTDE is asked for; a robot leaves out what its software does not know."""


class Address(NamedTuple):
    """Where a robot is; `control_port` and `token` are of the control API of an emulated box that has one."""

    host: str
    ports: Ports
    control_port: int = 0
    token: str | None = None


class Sample(NamedTuple):
    """Values of one cycle, and when they came [s of `time.monotonic`]."""

    time: float
    values: RtdeValues


class Robot:
    """One robot; all attributes are the newest that is known, and only read by others.

    Attributes:
        problem: why nothing comes, "" while the robot answers.
        info: who it is; None before it has answered.
        kinematics: its DH table; None where it is not reported.
        values: signals by name; empty before the first.
        history: samples of the last minute, the oldest first.
        state: of an emulated box with a control port, without which it is None.
        log: times [s] and texts of the last lines, the oldest first.
        popups: texts of the popups that are shown.
        questions: of programs, which wait for an answer.
        program: name of the program that runs, "" without one.
        variables: globals of the program, by name, also of the last that ran.
        label: where in its program tree the program is, "" where that is not reported.
    """

    def __init__(self, address: Address, *, view_only: bool = False) -> None:
        """Begin to read; `view_only`: nobody may do something to it, whatever it is."""
        self.address = address
        self.view_only = view_only
        self.problem = "connecting"
        self.info: RobotInfo | None = None
        self.kinematics: KinematicsInfo | None = None
        self.values: RtdeValues = MappingProxyType({})
        self.history: deque[Sample] = deque(maxlen=round(RATE * _HISTORY))
        self.state: BoxState | None = None
        self.log: deque[tuple[float, str]] = deque(maxlen=_LOG_LINES)
        self.popups: tuple[str, ...] = ()
        self.questions: tuple[Question, ...] = ()
        self.program = ""
        self.label = ""
        self.variables: Mapping[str, TypedValue] = {}
        self._closed = threading.Event()
        self._threads = [threading.Thread(target=self._read_signals, daemon=True)]
        if address.control_port:
            self._threads.append(threading.Thread(target=self._read_state, daemon=True))
        for thread in self._threads:
            thread.start()

    @property
    def refusal(self) -> str:
        """Why people may do nothing to it; "" if they may: it says that it is simulated."""
        if self.view_only:
            return "the robot is only shown"
        is_simulated = self.info is not None and self.info.simulated is True
        return "" if is_simulated else "the robot does not say that it is simulated"

    @property
    def title(self) -> str:
        """What it is called."""
        where = self.address.host
        return where if self.info is None else f"{self.info.model} {self.info.version} at {where}"

    def close(self) -> None:
        """Read no more."""
        self._closed.set()
        for thread in self._threads:
            thread.join()

    # --- threads

    def _read_signals(self) -> None:
        while not self._closed.is_set():
            try:
                self._read_ports()
            except ClientError as error:
                self.problem = str(error)
                self._closed.wait(_PAUSE)

    def _read_ports(self) -> None:
        """Read RTDE and the primary port until one of them is lost."""
        address, network = self.address, TcpNetwork()
        ports = StatePorts(network, address.host, address.ports)
        try:
            info = ports.identify()
            self.variables = ports.primary.variables
            self.kinematics = ports.primary.newest(KinematicsInfo)
            self.info = info
            with RtdeStream(network, address.host, address.ports.rtde, OUTPUTS, RATE) as stream:
                while not self._closed.is_set():
                    values = stream.receive()
                    self.history.append(Sample(time.monotonic(), values))
                    self.values = values
                    self._take_messages(ports.primary)
                    self.problem = ""
        finally:
            ports.close()

    def _take_messages(self, primary: PackageStream) -> None:
        has_state = self.state is not None  # which knows more, and what was closed elsewhere
        for message in primary.poll():
            text = _line_of(message)
            if text is not None and not has_state:
                self.log.append((1e-6 * message.timestamp, text))
            match message:
                case KeyMessage(title=KeyMessage.STARTED, text=name):
                    self.program, self.label = name, ""
                case KeyMessage(title=KeyMessage.STOPPED):
                    self.program, self.label, self.popups, self.questions = "", "", (), ()
                case ProgramThreadsMessage(threads=(first, *_)):
                    self.label = first.text
                case PopupMessage(requested_type=RequestedType.NONE) if not has_state:
                    self.popups = (*self.popups, text or "")
                case PopupMessage() | RequestValueMessage() if not has_state:
                    kind = RequestedType(message.requested_type).name
                    self.questions = (*self.questions, Question(message.request_id, kind, message.text))

    def _read_state(self) -> None:
        """Ask the control API for the state and for new lines of the log."""
        box: AttachedBox | None = None
        seen, turns = 0, count()
        while not self._closed.wait(_SLOWLY):
            try:
                if box is None:
                    at = self.address
                    box, seen = AttachedBox(at.host, at.control_port, at.token), 0
                    self.log.clear()
                    # Which ports it has: that of the dashboard server is not there with PolyScope X.
                    self.address = at._replace(ports=box.served[0].ports)
                state: BoxState = box.perform(0, ReadState())
                if next(turns) % _LOG_EVERY == 0:
                    news = box.perform(0, ReadLog(after=seen))
                    seen = news["next"]
                    self.log.extend((entry["time"], entry["text"]) for entry in news["entries"])
            except EmulatorError:
                self.state, box = None, None
                self._closed.wait(_PAUSE)
                continue
            self.state, self.program = state, state.program
            self.popups, self.questions = state.popups, state.questions


def _line_of(message: RobotMessage) -> str | None:
    """Return a message as a line of the log; None if it is not for people."""
    match message:
        case TextMessage(text=text):
            return text
        case ErrorCodeMessage():
            return f"C{message.code}A{message.argument} {message.text}".rstrip()
        case RuntimeExceptionMessage():
            return f"line {message.line}, column {message.column}: {message.text}"
        case KeyMessage():
            return f"{message.title.removeprefix('PROGRAM_XXX_').lower()}: {message.text}"
        case PopupMessage():
            return f"{message.title}: {message.text}"
    return None


def numbers(values: RtdeValues, name: str) -> tuple[float, ...]:
    """Return a signal as numbers; none if it is not reported."""
    value = values.get(name, ())
    return tuple(map(float, value)) if isinstance(value, tuple) else (float(value),)


def plain(text: str) -> str:
    """Return text on one line, without what does not print, and cut."""
    cut = text[:_LONGEST] + "…" * (len(text) > _LONGEST)
    return cut if cut.isprintable() else "".join(c if c.isprintable() else " " for c in cut)
