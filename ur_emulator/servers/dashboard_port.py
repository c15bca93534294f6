"""Port 29999: the dashboard server. How commands are spelt stands in `protocol`; what they do, here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from protocol.dashboard_commands import USER_ROLES, unknown_command_reply
from protocol.dashboard_connection import MAX_LINE, CommandReceived, DashboardConnection, Role, UnknownCommand
from protocol.errors import ProtocolError
from protocol.ur_types import ProgramState, RobotMode, SafetyMode, SafetyStatus, SoftwareVersion
from ur_emulator.controller import commands as cmd
from ur_emulator.controller.controller import Controller
from ur_emulator.controller.events import Event, LogAdded, PopupShown
from ur_emulator.controller.safety import MOVING_MODES
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.controller.status_bits import RUNNING_STATES
from ur_emulator.servers.connection import Connection

# Name that a simulator gives when nothing is loaded. Source: replies of URSim 3.14 as the public client
# library expects them.
UNNAMED = "<unnamed>"
# PolyscopeVersion carries four numbers and a date; clients search for the numbers. The date is that of CB3
# 3.15.8's manual.
BUILD = 106339
BUILD_DATE = "Nov 30 2021"


@dataclass(frozen=True, slots=True)
class BoxIdentity:
    """What the box says of itself.

    Attributes:
        version: of its software.
        model: as people write it, "UR3".
        serial_number: digits; see protocol.ur_types.simulated_serial.
    """

    version: SoftwareVersion
    model: str
    serial_number: str


class DashboardPort:
    """Answers dashboard lines."""

    def __init__(
        self, identity: BoxIdentity, controller: Controller, submit: Callable[[cmd.Command], None]
    ) -> None:
        """Bind the commands to a box.

        Args:
            identity: names and numbers of the box.
            controller: asked for its state, never changed directly.
            submit: takes a command for the next cycle.
        """
        self._identity = identity
        self._controller = controller
        self._submit = submit
        self._user_role = "NONE"
        self._sessions: dict[Connection, DashboardConnection] = {}
        self._answers: dict[str, Callable[[CommandReceived], str]] = {
            "quit": lambda event: event.command.reply(),
            "running": lambda event: event.command.reply(running=str(self._is_running()).lower()),
            "robotmode": lambda event: event.command.reply(mode=RobotMode(self._snapshot.robot_mode).name),
            "safetymode": lambda event: event.command.reply(mode=SafetyMode(self._snapshot.safety_mode).name),
            "safetystatus": lambda event: event.command.reply(
                status=SafetyStatus(self._snapshot.safety_status).name
            ),
            "programState": lambda event: event.command.reply(state=self._program_state(), program=UNNAMED),
            "isProgramSaved": lambda event: event.command.reply(saved="true", program=UNNAMED),
            "get loaded program": lambda event: event.command.reply("none"),
            "load": lambda event: event.command.reply("not_found", name=event.argument),
            "load installation": lambda event: event.command.reply("not_found", name=event.argument),
            "play": self._play,
            "pause": self._pause,
            "stop": lambda event: self._after(event, cmd.StopProgram()),
            "power on": lambda event: self._after(event, cmd.PowerOn()),
            "power off": lambda event: self._after(event, cmd.PowerOff()),
            "brake release": lambda event: self._after(event, cmd.ReleaseBrakes()),
            "unlock protective stop": self._unlock,
            "close safety popup": lambda event: event.command.reply(),
            "popup": self._popup,
            "close popup": lambda event: self._after(event, cmd.ClosePopup()),
            "addToLog": self._add_to_log,
            "setUserRole": self._set_user_role,
            "getUserRole": lambda event: event.command.reply(role=self._user_role),
            "PolyscopeVersion": lambda event: event.command.reply(
                version=str(self._identity.version._replace(build=BUILD)), date=BUILD_DATE
            ),
            "get serial number": lambda event: event.command.reply(serial=self._identity.serial_number),
            "get robot model": lambda event: event.command.reply(model=self._identity.model),
        }

    @property
    def _snapshot(self) -> Snapshot:
        return self._controller.snapshot

    @property
    def clients(self) -> tuple[Connection, ...]:
        """Connected clients."""
        return tuple(self._sessions)

    def opened(self, connection: Connection) -> None:
        """Send the greeting line."""
        session = DashboardConnection(Role.ROBOT, self._identity.version)
        self._sessions[connection] = session
        connection.send(session.greet())

    def received(self, connection: Connection, data: bytes) -> None:
        """Answer every whole line, in order; a client that sends no lines is cut off."""
        session = self._sessions[connection]
        try:
            session.receive_data(data)
        except ProtocolError:
            connection.close()
            return
        while (event := session.next_event()) is not None:
            match event:
                case CommandReceived(command):
                    answer = self._answers.get(command.name)
                    text = unknown_command_reply(command.name) if answer is None else answer(event)
                case UnknownCommand(_, text):
                    pass
                case _:
                    continue
            # A reply may repeat what the client sent, and must stay one line of allowed length.
            connection.send(session.reply(text.replace("\r", " ")[: MAX_LINE - 1]))
        if session.is_closed:
            connection.close_when_sent()

    def closed(self, connection: Connection) -> None:
        """Forget the client."""
        self._sessions.pop(connection, None)

    def publish(self, snapshot: Snapshot) -> None:
        """Nothing is streamed on this port."""

    def say(self, event: Event) -> None:
        """Nothing is said unasked on this port."""

    # --- commands

    def _is_running(self) -> bool:
        return self._snapshot.runtime_state in RUNNING_STATES

    def _program_state(self) -> str:
        if self._snapshot.runtime_state == ProgramState.PAUSED:
            return "PAUSED"
        return "PLAYING" if self._is_running() else "STOPPED"

    def _after(self, event: CommandReceived, command: cmd.Command) -> str:
        self._submit(command)
        return event.command.reply()

    def _play(self, event: CommandReceived) -> str:
        """Resume a paused program; program files cannot be loaded yet, so there is nothing else to play."""
        snapshot = self._snapshot
        if (
            snapshot.runtime_state not in (ProgramState.PAUSING, ProgramState.PAUSED)
            or snapshot.safety_mode not in MOVING_MODES
            or snapshot.robot_mode != RobotMode.RUNNING
        ):
            return event.command.reply("failed")
        return self._after(event, cmd.ResumeProgram())

    def _pause(self, event: CommandReceived) -> str:
        if not self._is_running():
            return event.command.reply("failed")
        return self._after(event, cmd.PauseProgram())

    def _add_to_log(self, event: CommandReceived) -> str:
        if not event.argument:
            return event.command.reply("empty")
        self._controller.state.events.append(LogAdded("Dashboard", event.argument))
        return event.command.reply()

    def _unlock(self, event: CommandReceived) -> str:
        state = self._controller.state
        if state.safety.mode is SafetyMode.PROTECTIVE_STOP and not state.safety.may_unlock(
            self._snapshot.timestamp
        ):
            return event.command.reply("too_early")
        return self._after(event, cmd.UnlockProtectiveStop())

    def _popup(self, event: CommandReceived) -> str:
        self._controller.state.events.append(PopupShown("Popup", event.argument, False, False, False))
        return event.command.reply()

    def _set_user_role(self, event: CommandReceived) -> str:
        if event.argument.upper() not in USER_ROLES:
            return event.command.reply("failed", role=event.argument)
        self._user_role = event.argument.upper()
        return event.command.reply(role=event.argument)
