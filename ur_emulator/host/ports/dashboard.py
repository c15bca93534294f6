"""Port 29999, the dashboard server: the lines of a client are answered in order, one after the other.

What the commands do stands here; how they and their replies are spelt stands in `protocol`.
"""

from collections.abc import Callable

from protocol.dashboard.commands import OPERATIONAL_MODES, REMOTE_CONTROL_ONLY, USER_ROLES, DashboardCommand
from protocol.dashboard.connection import MAX_LINE, CommandReceived, DashboardConnection
from protocol.errors import ProtocolError
from protocol.ur_types import ProgramState, RobotMode, SafetyMode, SafetyStatus
from ur_emulator.errors import EmulatorError, FileMissingError, RefusedError
from ur_emulator.host.player.player import MissingFileRefusal, ProgramPlayer
from ur_emulator.host.ports.session import Session, SessionPort
from ur_emulator.host.reports.report_writer import ReportWriter
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps
from ur_emulator.machine.commands import power, programs, safety
from ur_emulator.machine.controller.command import Command
from ur_emulator.machine.controller.events import LogAdded
from ur_emulator.machine.controller.safety.inputs import OperationalMode

# Name that a simulator gives when nothing is loaded. Source: replies of URSim 3.14 as the public client
# library expects them.
UNNAMED = "<unnamed>"

# From a row, its argument and the client's address: a reply, or steps that end in one (see `host.steps`).
_Action = Callable[[DashboardCommand, str, str], str | Steps[str]]


class DashboardAnswers:
    """Finds the answer to a command."""

    def __init__(
        self, box: ServedBox, player: ProgramPlayer, reports: ReportWriter, shut_down: Callable[[], None]
    ) -> None:
        """Bind the commands to a box."""
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
            "quit": lambda row, *_: row.reply(),
            "shutdown": self._shutdown,
            "running": lambda row, *_: row.reply(running=str(player.is_running).lower()),
            "robotmode": lambda row, *_: row.reply(mode=RobotMode(box.snapshot.robot_mode).name),
            "get loaded program": self._loaded_program,
            "popup": lambda row, text, _: self._applied(row, programs.ShowPopup(text)),
            "close popup": lambda row, *_: self._applied(row, programs.ClosePopup()),
            "addToLog": self._add_to_log,
            "isProgramSaved": lambda row, *_: row.reply(saved="true", program=self._file_name),
            "programState": lambda row, *_: row.reply(state=self._state_word(), program=self._file_name),
            "PolyscopeVersion": lambda row, *_: row.reply(version=str(software.version), date=software.day),
            "version": lambda row, *_: row.reply(version=str(software.version)),
            "setUserRole": self._set_user_role,
            "getUserRole": lambda row, *_: row.reply(role=self._user_role),
            "set operational mode": self._set_operational_mode,
            "get operational mode": lambda row, *_: self._mode_reply(row),
            "clear operational mode": lambda row, *_: self._choose_mode(row, None),
            "is in remote control": lambda row, *_: row.reply(remote=str(box.remote_period > 0).lower()),
            "power on": lambda row, *_: self._applied(row, power.PowerOn()),
            "power off": lambda row, *_: self._applied(row, power.PowerOff()),
            "brake release": lambda row, *_: self._applied(row, power.ReleaseBrakes()),
            "safetymode": lambda row, *_: row.reply(mode=SafetyMode(box.snapshot.safety_mode).name),
            "safetystatus": lambda row, *_: row.reply(status=SafetyStatus(box.snapshot.safety_status).name),
            "unlock protective stop": self._unlock,
            "close safety popup": lambda row, *_: row.reply(),
            "load installation": self._load_installation,
            "restart safety": lambda row, *_: self._applied(row, safety.RestartSafety()),
            "get serial number": lambda row, *_: row.reply(serial=box.identity.serial_number),
            "get robot model": lambda row, *_: row.reply(model=box.identity.wire_model),
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
            answer = self._actions[row.name](row, argument, client)
            return answer if isinstance(answer, str) else (yield from answer)
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

    def _load(self, row: DashboardCommand, name: str, _: str) -> Steps[str]:
        loading = self._player.load(name)
        if row.replies_when_done(self._box.identity.software.version):
            yield from loading
            installation = _path_of(self._player.installation)
            return row.reply(path=_path_of(self._player.loaded), installation=installation)
        path = self._player.folder.wire_path(self._player.folder.find(name))
        self._box.start_alone(loading)
        return row.reply(path=path)

    def _load_installation(self, row: DashboardCommand, name: str, _: str) -> Steps[str]:
        yield from self._player.load_installation(name)
        return row.reply(path=_path_of(self._player.installation))

    def _done(self, row: DashboardCommand, action: Steps[None]) -> Steps[str]:
        """Answer when an action is done, or, in older software, when it has begun."""
        if row.replies_when_done(self._box.identity.software.version):
            yield from action
            return row.reply()
        try:
            next(action)
        except StopIteration:
            return row.reply()
        self._box.start_alone(action)
        return row.reply()

    # --- the box

    def _applied(self, row: DashboardCommand, command: Command) -> Steps[str]:
        yield from self._box.apply(command)
        return row.reply()

    def _unlock(self, row: DashboardCommand, *_: str) -> str | Steps[str]:
        state, now = self._box.controller.state.safety, self._box.snapshot.timestamp
        if state.mode is SafetyMode.PROTECTIVE_STOP and not state.may_unlock(now):
            return row.reply("too_early")
        return self._applied(row, safety.UnlockProtectiveStop())

    def _mode_reply(self, row: DashboardCommand) -> str:
        return row.reply(mode=self._box.controller.state.operational.mode.name)

    def _set_operational_mode(self, row: DashboardCommand, mode: str, _: str) -> Steps[str]:
        if mode.upper() not in OPERATIONAL_MODES:
            raise RefusedError(f"operational mode {mode}: choose from {', '.join(OPERATIONAL_MODES)}")
        return self._choose_mode(row, OperationalMode[mode.upper()])

    def _choose_mode(self, row: DashboardCommand, mode: OperationalMode | None) -> Steps[str]:
        yield from self._box.apply(power.ChooseModeByDashboard(mode))
        return self._mode_reply(row)

    def _shutdown(self, row: DashboardCommand, _: str, client: str) -> Steps[str]:
        self._box.note(f"Shut down by {client}")
        yield from self._box.apply(power.PowerOff())
        self._shut_down()
        return row.reply()

    def _add_to_log(self, row: DashboardCommand, text: str, _: str) -> str:
        if not text:
            return row.reply("empty")
        self._box.announce(LogAdded("Dashboard", text))
        return row.reply()

    def _set_user_role(self, row: DashboardCommand, role: str, _: str) -> str:
        if role.upper() not in USER_ROLES:
            return row.reply("failed", role=role)
        self._user_role = role.upper()
        return row.reply(role=role)

    # --- files

    def _flight_report(self, row: DashboardCommand, kind: str, _: str) -> Steps[str]:
        return row.reply(id=(yield from self._reports.flight_report(kind)))

    def _support_file(self, row: DashboardCommand, directory: str, _: str) -> Steps[str]:
        return row.reply(file=(yield from self._reports.support_file(directory)))

    def _save_log(self, row: DashboardCommand, *_: str) -> Steps[str]:
        try:
            path = yield from self._reports.save_log()
        except EmulatorError as error:
            self._box.note(f"saveLog failed: {error}")
            raise
        self._box.note(f"Log saved to {path}")
        return row.reply()


def _path_of(thing: object) -> str:
    return getattr(thing, "wire_path", "")


# Units of work for a line, and for so many bytes of it.
_LINE_COST, _BYTES_PER_UNIT = 2, 1024


class DashboardPort(SessionPort["_DashboardSession"]):
    """Answers dashboard lines."""

    def __init__(self, box: ServedBox, answers: DashboardAnswers) -> None:
        """Serve a box."""
        super().__init__(box)
        self._answers = answers

    def _begin(self, connection: Connection) -> "_DashboardSession":
        # A client that has closed its sending side still gets its answers.
        connection.allow_half_close(self.ended)
        session = _DashboardSession(connection, self._box, self._answers)
        connection.send(session.lines.greet())
        return session

    def ended(self, connection: Connection) -> None:
        """A client sends nothing more: close it when all its lines are answered."""
        self._sessions[connection].answer_requests()


class _DashboardSession(Session):
    """A client; `lines` is what it has sent, and how answers are written."""

    # Programs send `pause` and `popup` to their own box and close at once, without reading an answer.
    most_of_the_gone = 4

    def __init__(self, connection: Connection, box: ServedBox, answers: DashboardAnswers) -> None:
        super().__init__(connection, box)
        self.lines = DashboardConnection(box.identity.software.dashboard)
        self._answers = answers
        self._remote_period = box.remote_period

    def _take(self, data: bytes) -> None:
        try:
            self.lines.receive_data(data)
        except ProtocolError:
            self.connection.close()

    def _answer_next(self) -> Steps[int]:
        event = self.lines.next_event()
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
        self.connection.send(self.lines.reply(line))
        if self.connection.dropped:
            self.connection.close()  # it does not read, and a reply less would shift all that follow
        if self.lines.is_closed:
            self.connection.close_when_sent()
        return _LINE_COST + len(text) // _BYTES_PER_UNIT
