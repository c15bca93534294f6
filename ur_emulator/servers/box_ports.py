"""Which ports a box has: those that send every cycle, and those that answer. `port_set` opens them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ur_emulator.budgets import BUDGETS
from ur_emulator.servers.box_access import BoxAccess
from ur_emulator.servers.dashboard.answers import DashboardAnswers
from ur_emulator.servers.dashboard.port import DashboardPort
from ur_emulator.servers.interpreter.intake import InterpreterIntake, InterpreterPort
from ur_emulator.servers.modbus.server import ModbusPort
from ur_emulator.servers.port_set import ROBOT_API
from ur_emulator.servers.primary.port import PrimaryPort
from ur_emulator.servers.primary.robot_state import StateEncoder
from ur_emulator.servers.programs.intake import ProgramIntake
from ur_emulator.servers.programs.player import ProgramPlayer
from ur_emulator.servers.realtime_port import RealtimePort
from ur_emulator.servers.reports.report_writer import ReportWriter
from ur_emulator.servers.rtde_port import RtdePort
from ur_emulator.servers.tcp.listener import Port


@dataclass(frozen=True, slots=True)
class SendingPorts:
    """The ports that send in cycles, also to clients that ask for nothing.

    Attributes:
        realtime: frames, then the same without scripts.
        rtde: what clients have subscribed to.
        messengers: primary and secondary port, then the same without scripts.
    """

    realtime: tuple[RealtimePort, RealtimePort]
    rtde: RtdePort
    messengers: tuple[PrimaryPort, ...]

    @classmethod
    def make(cls, access: BoxAccess, intake: ProgramIntake) -> SendingPorts:
        """Make the ports; scripts that clients send go to the intake."""
        software, controller = access.identity.software, access.controller
        states = StateEncoder(
            software, controller.state.arm, controller.state.safety, access.identity.masterboard
        )
        return cls(
            (RealtimePort(software.realtime, intake), RealtimePort(software.realtime, None)),
            RtdePort(access),
            tuple(
                PrimaryPort(software, controller, takes, states, all_messages=all_messages)
                for takes in (intake, None)
                for all_messages in (True, False)
            ),
        )

    @property
    def in_order(self) -> tuple[RealtimePort | RtdePort | PrimaryPort, ...]:
        """All of them, first those whose clients act on a cycle."""
        realtime, realtime_ro = self.realtime
        primary, secondary, *read_only = self.messengers
        return (realtime, self.rtde, primary, secondary, realtime_ro, *read_only)

    @property
    def by_name(self) -> dict[str, Port]:
        """All of them by their names in `Ports`."""
        names = ("realtime", "rtde", "primary", "secondary", "realtime_ro", "primary_ro", "secondary_ro")
        return dict(zip(names, self.in_order, strict=True))


def answering_ports(
    access: BoxAccess,
    player: ProgramPlayer,
    reports: ReportWriter,
    shut_down: Callable[[], None],
    host: str,
) -> dict[str, Port]:
    """Make the ports that answer requests, by their names in `Ports`: those that the software has.

    Args:
        access: to the box.
        player: holds the loaded program.
        reports: writes the log and reports.
        shut_down: closes the box.
        host: address that the box is bound to.
    """
    software = access.identity.software
    ports: dict[str, Port] = {"modbus": ModbusPort(access)}
    if software.dashboard:
        ports["dashboard"] = DashboardPort(access, DashboardAnswers(access, player, reports, shut_down))
    if software.has_interpreter:
        ports["interpreter"] = InterpreterPort(InterpreterIntake(access))
    if software.robot_api:
        # A box without HTTP does not load it.
        from ur_emulator.servers.http.port import HttpPort
        from ur_emulator.servers.robot_api.answers import RobotApiAnswers

        answers = RobotApiAnswers(access, player, reports, shut_down, host)
        ports[ROBOT_API] = HttpPort(access, answers, BUDGETS.upload_bytes)
    return ports
