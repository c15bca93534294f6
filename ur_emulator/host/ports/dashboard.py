"""Port 29999, the dashboard server: the lines of a client are answered in order, one after the other.

What the commands do stands here; how they and their replies are spelt stands in `protocol`.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from protocol.dashboard.commands import OPERATIONAL_MODES, REMOTE_CONTROL_ONLY, USER_ROLES, DashboardCommand
from protocol.dashboard.connection import MAX_LINE, CommandReceived, DashboardConnection
from protocol.errors import ProtocolError
from protocol.ur_types import ProgramState, RobotMode, SafetyMode, SafetyStatus
from ur_emulator.errors import EmulatorError, FileMissingError, RefusedError
from ur_emulator.host.player.player import MissingFileRefusal, ProgramPlayer
from ur_emulator.host.ports.session import Session
from ur_emulator.host.reports.report_files import flight_report, save_log, support_file
from ur_emulator.host.reports.report_writer import ReportWriter
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps, result_of
from ur_emulator.machine.commands import power, programs, safety
from ur_emulator.machine.controller.safety.inputs import OperationalMode

# Name that a simulator gives when nothing is loaded. Source: replies of URSim 3.14 as the public client
# library expects them.
UNNAMED = "<unnamed>"

# A whole reply, or the values that the reply "ok" names.
_Reply = str | Mapping[str, object] | None
# From a row, its argument and the client's address to a reply, or steps that end in one (see `host.steps`).
_Action = Callable[[DashboardCommand, str, str], _Reply | Steps[_Reply]]


class DashboardAnswers:
    """Finds the answer to a command."""

    def __init__(
        self, box: ServedBox, player: ProgramPlayer, reports: ReportWriter, shut_down: Callable[[], None]
    ) -> None:
        self._box = box
        self._player = player
        self._shut_down = shut_down
        self._reports = reports
        self._user_role = "NONE"
        software = box.identity.software
        self._actions: dict[str, _Action] = {
            "load": self._load,
            "play": lambda row, _, client: self._done(row, player.play(client)),
            "stop": lambda row, *_: self._done(row, player.stop()),
            "pause": lambda row, *_: self._done(row, player.pause()),
            "quit": lambda *_: None,
            "shutdown": self._shutdown,
            "running": lambda *_: {"running": str(player.is_running).lower()},
            "robotmode": lambda *_: {"mode": RobotMode(box.snapshot.robot_mode).name},
            "get loaded program": self._loaded_program,
            "popup": lambda _, text, __: box.apply(programs.ShowPopup(text)),
            "close popup": lambda *_: box.apply(programs.ClosePopup()),
            "addToLog": self._add_to_log,
            "isProgramSaved": lambda *_: {"saved": "true", "program": self._file_name},
            "programState": lambda *_: {"state": self._state_word(), "program": self._file_name},
            "PolyscopeVersion": lambda *_: {"version": software.version, "date": software.day},
            "version": lambda *_: {"version": software.version},
            "setUserRole": self._set_user_role,
            "getUserRole": lambda *_: {"role": self._user_role},
            "set operational mode": self._set_operational_mode,
            "get operational mode": lambda *_: {"mode": box.controller.state.operational.mode.name},
            "clear operational mode": lambda *_: self._choose_mode(None),
            "is in remote control": lambda *_: {"remote": str(box.remote_period > 0).lower()},
            "power on": lambda *_: box.apply(power.PowerOn()),
            "power off": lambda *_: box.apply(power.PowerOff()),
            "brake release": lambda *_: box.apply(power.ReleaseBrakes()),
            "safetymode": lambda *_: {"mode": SafetyMode(box.snapshot.safety_mode).name},
            "safetystatus": lambda *_: {"status": SafetyStatus(box.snapshot.safety_status).name},
            "unlock protective stop": self._unlock,
            "close safety popup": lambda *_: None,
            "load installation": self._load_installation,
            "restart safety": lambda *_: box.apply(safety.RestartSafety()),
            "get serial number": lambda *_: {"serial": box.identity.serial_number},
            "get robot model": lambda *_: {"model": box.identity.wire_model},
            "generate flight report": self._flight_report,
            "generate support file": self._support_file,
            "saveLog": self._save_log,
        }

    def answer(self, event: CommandReceived, client: str) -> Steps[str]:
        """Answer a command; `client` is the address of who asks.

        What is refused is answered as failed; a command that has no such reply is answered as done.
        """
        row, argument = event.command, event.argument
        try:
            reply = yield from result_of(self._actions[row.name](row, argument, client))
            return reply if isinstance(reply, str) else row.reply(**(reply or {}))
        except EmulatorError as error:
            missing = isinstance(error, MissingFileRefusal | FileMissingError) and "not_found" in row.replies
            key = "not_found" if missing else "failed" if "failed" in row.replies else "ok"
            return row.reply(key, name=argument, mode=argument, role=argument, reason=error)

    # --- programs

    @property
    def _file_name(self) -> str:
        return self._player.loaded.file_name if self._player.loaded else UNNAMED

    def _state_word(self) -> str:
        if self._box.snapshot.runtime_state == ProgramState.PAUSED:
            return "PAUSED"
        return "PLAYING" if self._player.is_running else "STOPPED"

    def _loaded_program(self, row: DashboardCommand, *_: str) -> str:
        loaded = self._player.loaded
        return row.reply(path=loaded.wire_path) if loaded else row.reply("none")

    def _load(self, row: DashboardCommand, name: str, _: str) -> Steps[_Reply]:
        loading = self._player.load(name)
        if row.replies_when_done(self._box.identity.software.version):
            yield from loading
            loaded, installation = self._player.loaded, self._player.installation
            return {"path": loaded.wire_path if loaded else "", "installation": installation.wire_path}
        path = self._player.folder.wire_path(self._player.folder.find(name))
        self._box.start_alone(loading)
        return {"path": path}

    def _load_installation(self, _: DashboardCommand, name: str, __: str) -> Steps[_Reply]:
        yield from self._player.load_installation(name)
        return {"path": self._player.installation.wire_path}

    def _done(self, row: DashboardCommand, action: Steps[None]) -> Steps[None]:
        """End when an action is done, or, in older software, when it has begun."""
        if row.replies_when_done(self._box.identity.software.version):
            yield from action
            return
        with suppress(StopIteration):
            next(action)
            self._box.start_alone(action)

    # --- the box

    def _unlock(self, row: DashboardCommand, *_: str) -> str | Steps[Any]:
        state, now = self._box.controller.state.safety, self._box.snapshot.timestamp
        if state.mode is SafetyMode.PROTECTIVE_STOP and not state.may_unlock(now):
            return row.reply("too_early")
        return self._box.apply(safety.UnlockProtectiveStop())

    def _set_operational_mode(self, _: DashboardCommand, mode: str, __: str) -> Steps[_Reply]:
        if mode.upper() not in OPERATIONAL_MODES:
            raise RefusedError(f"operational mode {mode}: choose from {', '.join(OPERATIONAL_MODES)}")
        return self._choose_mode(OperationalMode[mode.upper()])

    def _choose_mode(self, mode: OperationalMode | None) -> Steps[_Reply]:
        yield from self._box.apply(power.ChooseModeByDashboard(mode))
        return {"mode": self._box.controller.state.operational.mode.name}

    def _shutdown(self, _: DashboardCommand, __: str, client: str) -> Steps[None]:
        self._box.note(f"Shut down by {client}")
        yield from self._box.apply(power.PowerOff())
        self._shut_down()

    def _add_to_log(self, row: DashboardCommand, text: str, _: str) -> str | None:
        if not text:
            return row.reply("empty")
        self._box.note(text)
        return None

    def _set_user_role(self, row: DashboardCommand, role: str, _: str) -> _Reply:
        if role.upper() not in USER_ROLES:
            return row.reply("failed", role=role)
        self._user_role = role.upper()
        return {"role": role}

    # --- files

    def _flight_report(self, _: DashboardCommand, kind: str, __: str) -> Steps[_Reply]:
        return {"id": (yield from self._reports.write(flight_report, kind))}

    def _support_file(self, _: DashboardCommand, directory: str, __: str) -> Steps[_Reply]:
        return {"file": (yield from self._reports.write(support_file, directory))}

    def _save_log(self, *_: object) -> Steps[None]:
        try:
            path = yield from self._reports.write(save_log)
        except EmulatorError as error:
            self._box.note(f"saveLog failed: {error}")
            raise
        self._box.note(f"Log saved to {path}")


# Units of work for a line, and for so many bytes of it.
_LINE_COST, _BYTES_PER_UNIT = 2, 1024


class DashboardSession(Session):
    """A client of the dashboard server."""

    allows_half_close = True
    # Programs send `pause` and `popup` to their own box and close at once, without reading an answer.
    most_of_the_gone = 4

    def __init__(self, connection: Connection, box: ServedBox, answers: DashboardAnswers) -> None:
        super().__init__(connection, box)
        self._lines = DashboardConnection(box.identity.software.dashboard)
        self._answers = answers
        self._remote_period = box.remote_period
        connection.send(self._lines.greet())

    def _take(self, data: bytes) -> None:
        try:
            self._lines.receive_data(data)
        except ProtocolError:
            self.connection.close()

    def _answer_next(self) -> Steps[int]:
        event = self._lines.next_event()
        if event is None:
            return 0
        if not isinstance(event, CommandReceived):
            text = event.answer
        elif event.command.needs_remote and not 0 < self._remote_period == self._box.remote_period:
            text = REMOTE_CONTROL_ONLY
        else:
            text = yield from self._answers.answer(event, self.connection.host)
        # A reply may repeat what the client sent, and must stay one line of allowed length.
        line = text.replace("\r", " ").replace("\n", " ")[: MAX_LINE - 1]
        self.connection.send(self._lines.reply(line))
        if self.connection.dropped:
            self.connection.close()  # it does not read, and a reply less would shift all that follow
        if self._lines.is_closed:
            self.connection.close_when_sent()
        return _LINE_COST + len(text) // _BYTES_PER_UNIT
