"""What the commands of the dashboard do, each in a method; how they are spelt stands in `protocol`.

An answer is a reply, or steps that end in one (see `box_access`). Steps may yield a reply earlier and go on.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Generator
from importlib.metadata import version as package_version
from typing import TypeVar

from protocol.dashboard_commands import USER_ROLES, DashboardCommand
from protocol.dashboard_connection import CommandReceived
from protocol.ur_types import ProgramState, RobotMode, SafetyMode, SafetyStatus
from ur_emulator.controller import commands as cmd
from ur_emulator.controller.events import LogAdded
from ur_emulator.errors import EmulatorError
from ur_emulator.servers.box_access import BUILD, BUILD_DATE, BoxAccess
from ur_emulator.servers.box_reports import BoxFacts, BoxReports
from ur_emulator.servers.program_desk import Loading, ProgramDesk

# Name that a simulator gives when nothing is loaded. Source: replies of URSim 3.14 as the public client
# library expects them.
UNNAMED = "<unnamed>"

Steps = Generator[str | None, None, str]
Answer = str | Steps
T = TypeVar("T")


class DashboardAnswers:
    """Finds the answer to a command."""

    def __init__(
        self, access: BoxAccess, desk: ProgramDesk, reports: BoxReports, shut_down: Callable[[], None]
    ) -> None:
        """Bind the commands to a box.

        Args:
            access: of the box.
            desk: holds the loaded program.
            reports: writes the log and reports.
            shut_down: closes the box.
        """
        self._access = access
        self._desk = desk
        self._shut_down = shut_down
        self._reports = reports
        self._user_role = "NONE"
        self._methods: dict[str, Callable[[DashboardCommand, str, str], Answer]] = {
            "load": self._load,
            "play": lambda row, _, client: self._done(row, desk.play(client)),
            "stop": lambda row, *_: self._done(row, desk.stop()),
            "pause": lambda row, *_: self._done(row, desk.pause()),
            "quit": lambda row, *_: row.reply(),
            "shutdown": self._shutdown,
            "running": lambda row, *_: row.reply(running=str(desk.is_running).lower()),
            "robotmode": lambda row, *_: row.reply(mode=RobotMode(access.snapshot.robot_mode).name),
            "get loaded program": self._loaded_program,
            "popup": lambda row, text, _: self._applied(row, cmd.ShowPopup(text)),
            "close popup": lambda row, *_: self._applied(row, cmd.ClosePopup()),
            "addToLog": self._add_to_log,
            "isProgramSaved": lambda row, *_: row.reply(saved="true", program=self._file_name),
            "programState": lambda row, *_: row.reply(state=self._state_word(), program=self._file_name),
            "PolyscopeVersion": lambda row, *_: row.reply(
                version=str(access.identity.version._replace(build=BUILD)), date=BUILD_DATE
            ),
            "setUserRole": self._set_user_role,
            "getUserRole": lambda row, *_: row.reply(role=self._user_role),
            "power on": lambda row, *_: self._applied(row, cmd.PowerOn()),
            "power off": lambda row, *_: self._applied(row, cmd.PowerOff()),
            "brake release": lambda row, *_: self._applied(row, cmd.ReleaseBrakes()),
            "safetymode": lambda row, *_: row.reply(mode=SafetyMode(access.snapshot.safety_mode).name),
            "safetystatus": lambda row, *_: row.reply(
                status=SafetyStatus(access.snapshot.safety_status).name
            ),
            "unlock protective stop": self._unlock,
            "close safety popup": lambda row, *_: row.reply(),
            "load installation": self._load_installation,
            "restart safety": lambda row, *_: self._applied(row, cmd.RestartSafety()),
            "get serial number": lambda row, *_: row.reply(serial=access.identity.serial_number),
            "get robot model": lambda row, *_: row.reply(model=access.identity.model),
            "generate flight report": self._flight_report,
            "generate support file": self._support_file,
            "saveLog": self._save_log,
        }

    def answer(self, event: CommandReceived, client: str) -> Answer:
        """Return the answer to a command; `client` is the address of who asks."""
        return self._methods[event.command.name](event.command, event.argument, client)

    # --- programs

    @property
    def _file_name(self) -> str:
        return self._desk.loaded.file_name if self._desk.loaded else UNNAMED

    def _state_word(self) -> str:
        if self._access.snapshot.runtime_state == ProgramState.PAUSED:
            return "PAUSED"
        return "PLAYING" if self._desk.is_running else "STOPPED"

    def _loaded_program(self, row: DashboardCommand, *_: str) -> str:
        loaded = self._desk.loaded
        return row.reply(path=loaded.wire_path) if loaded else row.reply("none")

    def _load(self, row: DashboardCommand, name: str, _: str) -> Steps:
        if not row.replies_when_done(self._access.identity.version):
            if not self._desk.folder.has(name):
                return row.reply("not_found", name=name)
            yield row.reply(path=self._desk.folder.find(name).wire_path)
        outcome = yield from self._desk.load(name)
        return self._loading_reply(row, outcome, name, lambda: _path_of(self._desk.loaded))

    def _load_installation(self, row: DashboardCommand, name: str, _: str) -> Steps:
        outcome = yield from self._desk.load_installation(name)
        return self._loading_reply(row, outcome, name, lambda: _path_of(self._desk.installation))

    @staticmethod
    def _loading_reply(row: DashboardCommand, outcome: Loading, name: str, path: Callable[[], str]) -> str:
        if outcome is Loading.DONE:
            return row.reply(path=path())
        return row.reply("not_found" if outcome is Loading.MISSING else "failed", name=name)

    def _done(self, row: DashboardCommand, action: Generator[None, None, bool]) -> Steps:
        """Answer when an action has come to its end, or, in older software, when it has begun."""
        if row.replies_when_done(self._access.identity.version):
            done = yield from action
            return row.reply("ok" if done else "failed")
        try:
            next(action)
        except StopIteration as end:
            return row.reply("ok" if end.value else "failed")
        yield row.reply()
        yield from action
        return ""

    # --- the box

    def _applied(self, row: DashboardCommand, command: cmd.Command) -> Steps:
        yield from self._access.apply(command)
        return row.reply()

    def _unlock(self, row: DashboardCommand, *_: str) -> Answer:
        safety = self._access.controller.state.safety
        if safety.mode is SafetyMode.PROTECTIVE_STOP and not safety.may_unlock(
            self._access.snapshot.timestamp
        ):
            return row.reply("too_early")
        return self._applied(row, cmd.UnlockProtectiveStop())

    def _shutdown(self, row: DashboardCommand, _: str, client: str) -> Steps:
        self._access.note(f"Shut down by {client}")
        yield from self._access.apply(cmd.PowerOff())
        yield row.reply()
        self._shut_down()
        return ""

    def _add_to_log(self, row: DashboardCommand, text: str, _: str) -> str:
        if not text:
            return row.reply("empty")
        self._access.announce(LogAdded("Dashboard", text))
        return row.reply()

    def _set_user_role(self, row: DashboardCommand, role: str, _: str) -> str:
        if role.upper() not in USER_ROLES:
            return row.reply("failed", role=role)
        self._user_role = role.upper()
        return row.reply(role=role)

    # --- files

    def _flight_report(self, row: DashboardCommand, kind: str, _: str) -> Steps:
        facts = self._facts()
        try:
            number = yield from self._access.in_worker(lambda: self._reports.flight_report(kind, facts))
        except (EmulatorError, OSError) as error:
            return row.reply("failed", reason=error)
        return row.reply(id=number)

    def _support_file(self, row: DashboardCommand, directory: str, _: str) -> Steps:
        facts = self._facts()
        try:
            name = yield from self._access.in_worker(lambda: self._reports.support_file(directory, facts))
        except (EmulatorError, OSError) as error:
            return row.reply("failed", reason=error)
        return row.reply(file=name)

    def _save_log(self, row: DashboardCommand, *_: str) -> Steps:
        facts = self._facts()
        try:
            path = yield from self._access.in_worker(lambda: self._reports.save_log(facts))
        except OSError as error:
            self._access.note(f"saveLog failed: {error}")
            return row.reply("failed")
        self._access.note(f"Log saved to {path}")
        return row.reply()

    def _facts(self) -> BoxFacts:
        access, desk = self._access, self._desk
        return BoxFacts(
            serial_number=access.identity.serial_number,
            versions={
                "software": str(access.identity.version._replace(build=BUILD)),
                "robot": access.identity.model,
                "emulator": package_version("ur-hil"),
                "python": platform.python_version(),
            },
            snapshot=access.snapshot,
            log=access.log,
            programs={
                "program": _path_of(desk.loaded),
                "installation": _path_of(desk.installation),
            },
            script=desk.script,
        )


def _path_of(thing: object) -> str:
    return getattr(thing, "wire_path", "")
