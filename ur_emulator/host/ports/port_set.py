"""All ports of one box: which there are, opened together, closed together with their connections."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import PortPermissionError
from ur_emulator.host.player.player import ProgramPlayer
from ur_emulator.host.ports.dashboard import DashboardAnswers, DashboardSession
from ur_emulator.host.ports.interpreter import InterpreterPort
from ur_emulator.host.ports.modbus import ModbusSession
from ur_emulator.host.ports.primary.port import PrimaryPort
from ur_emulator.host.ports.primary.robot_state import StateEncoder
from ur_emulator.host.ports.realtime import RealtimePort
from ur_emulator.host.ports.robotiq import RobotiqPort
from ur_emulator.host.ports.rtde import RtdePort
from ur_emulator.host.ports.script_intake import ProgramIntake
from ur_emulator.host.ports.session import SessionPort
from ur_emulator.host.ports.tool_line import ToolLinePort
from ur_emulator.host.reports.report_writer import ReportWriter
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.runtime.listener import ClientLimits, ClientLines, Listener, Port, SpareDescriptor
from ur_emulator.host.served_box import ServedBox

CONTROL, MODBUS, ROBOT_API = "control", "modbus", "robot_api"
TOOL_LINE = "tool_line"
# Ports whose numbers need privileges, and what the box lacks without them.
_PRIVILEGED = {MODBUS: "Modbus server", ROBOT_API: "Robot API"}
# Ports that read what a browser sends: web servers, and RTDE, for which its first letters are the size of a
# package that is too long: it says so and closes.
_READS_HTTP = frozenset({CONTROL, ROBOT_API, "onrobot", "rtde"})


def _onrobot_port(box: ServedBox, grippers: Sequence[Any], host: str) -> Port:
    # A box without HTTP does not load it.
    from ur_emulator.host.ports.http import HttpPort
    from ur_emulator.host.ports.onrobot import MOST_BYTES, OnRobotAnswers

    return HttpPort(box, OnRobotAnswers(box, grippers, host).answer, MOST_BYTES)


# Kinds of tools, the port of their maker's software, and what makes it for tools and the address of the port.
SOFTWARE_OF: dict[str, tuple[str, Callable[[ServedBox, Sequence[Any], str], Port]]] = {
    "robotiq": ("gripper", lambda box, grippers, host: RobotiqPort(box, grippers)),
    "onrobot": ("onrobot", _onrobot_port),
}


class PortSet:
    """The ports of a box by name.

    Attributes:
        notices: warnings for the user, one line each; the box runs all the same.
    """

    def __init__(self, loop: EventLoop, host: str, box: ServedBox, ports: Mapping[str, Port]) -> None:
        self._loop = loop
        self._host = host
        self._box = box
        self._ports = dict(ports)
        self._listeners: dict[str, Listener] = {}
        self._spare = SpareDescriptor()
        self._limits = ClientLimits()
        self._lines = ClientLines(box.notice)
        self.notices: list[str] = []

    @property
    def is_open(self) -> bool:
        """True once the ports listen."""
        return bool(self._listeners)

    def open(self, wanted: Mapping[str, int]) -> dict[str, int]:
        """Listen on all wanted ports.

        Args:
            wanted: numbers by name; 0 takes a free one, a port that is not named stays closed.

        Returns:
            The numbers. Those that need privileges may be missing.

        Raises:
            PortError: one of them cannot be opened; `close` closes the others.
        """
        self._spare.take()
        for name, port in self._ports.items():
            if name not in wanted:
                continue
            try:
                self._listeners[name] = self._listener(name, port, wanted[name])
            except PortPermissionError as error:
                if name not in _PRIVILEGED:
                    raise
                self.notices.append(f"no {_PRIVILEGED[name]}: {error}")
        self._box.listeners = tuple(open for name, open in self._listeners.items() if name != CONTROL)
        return {name: listener.number for name, listener in self._listeners.items()}

    def close(self) -> None:
        """Close all ports and connections; harmless if closed already."""
        self._spare.close()
        for listener in self._listeners.values():
            listener.close()

    def _listener(self, name: str, port: Port, number: int) -> Listener:
        """Listen; lockstep does not wait for clients of the control API, and they do not fill the log.

        They are counted apart: a box whose other ports are full can still be controlled.
        """
        box, limits, backlog, notice = self._box, self._limits, self._box.backlog, self._lines.write
        if name == CONTROL:
            limits, backlog, notice = ClientLimits(), set(), lambda text: None
        return Listener(
            self._loop,
            self._host,
            number,
            port,
            backlog,
            notice,
            box.report,
            name,
            limits,
            self._spare,
            reads_http=name in _READS_HTTP,
        )


def sending_ports(box: ServedBox, intake: ProgramIntake) -> dict[str, RealtimePort | RtdePort | PrimaryPort]:
    """Make the ports that send in cycles, also to clients that ask for nothing, by their names in `Ports`.

    First those whose clients act on a cycle. Scripts that clients send go to the intake; the ports `_ro` take
    none.
    """
    software, controller = box.identity.software, box.controller
    states = StateEncoder(software, controller.state.arm, controller.state.safety, box.identity.masterboard)
    return {
        "realtime": RealtimePort(software.realtime, intake),
        "rtde": RtdePort(box),
        "primary": PrimaryPort(software, controller, intake, states, all_messages=True),
        "secondary": PrimaryPort(software, controller, intake, states, all_messages=False),
        "realtime_ro": RealtimePort(software.realtime, None),
        "primary_ro": PrimaryPort(software, controller, None, states, all_messages=True),
        "secondary_ro": PrimaryPort(software, controller, None, states, all_messages=False),
    }


def answering_ports(
    box: ServedBox, player: ProgramPlayer, reports: ReportWriter, shut_down: Callable[[], None], host: str
) -> dict[str, Port]:
    """Make the ports that answer requests, by their names in `Ports`: those that the software has."""
    software = box.identity.software
    ports: dict[str, Port] = {}
    if software.dashboard:
        commands = DashboardAnswers(box, player, reports, shut_down)
        ports["dashboard"] = SessionPort(box, partial(DashboardSession, answers=commands))
    if software.has_interpreter:
        ports["interpreter"] = InterpreterPort(box)
    grippers = box.controller.state.grippers
    for kind, (name, make) in SOFTWARE_OF.items():
        if tools := [gripper for gripper in grippers if gripper.tool.kind == kind]:
            ports[name] = make(box, tools, host)
    if software.has_tool_line and any(gripper.unit for gripper in grippers):
        users = [port for port in ports.values() if isinstance(port, RobotiqPort)]
        ports[TOOL_LINE] = ToolLinePort(box, users)
    if software.robot_api:
        from ur_emulator.host.ports.http import HttpPort
        from ur_emulator.host.ports.robot_api import RobotApiAnswers

        answers = RobotApiAnswers(box, player, reports, shut_down, host)
        ports[ROBOT_API] = HttpPort(box, answers.answer, BUDGETS.upload_bytes)
    ports[MODBUS] = SessionPort(box, ModbusSession)  # after the one that matters more where both are missing
    return ports
