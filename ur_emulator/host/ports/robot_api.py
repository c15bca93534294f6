"""The Robot API of PolyScope X: a method for each call; `protocol.robot_api` lists the calls."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from html import escape
from http import HTTPStatus
from typing import Any

from protocol import robot_api
from protocol.primary.messages import RequestedType
from protocol.ur_types import RobotMode, SafetyMode
from ur_emulator.errors import ArgumentError, EmulatorError, FileMissingError, RefusedError
from ur_emulator.host.player.player import MissingFileRefusal, ProgramPlayer
from ur_emulator.host.ports import robot_api_files as files
from ur_emulator.host.ports.http import HttpAnswer, HttpError, HttpRequest, check_origin
from ur_emulator.host.reports.report_files import flight_report, flight_report_archive
from ur_emulator.host.reports.report_writer import ReportWriter
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps, result_of
from ur_emulator.machine.commands.power import PowerOff, PowerOn, ReleaseBrakes
from ur_emulator.machine.commands.programs import ClosePopup, ShowPopup
from ur_emulator.machine.commands.safety import RestartSafety, UnlockProtectiveStop
from ur_emulator.machine.controller.clock import clock_time
from ur_emulator.machine.controller.command import Command
from ur_emulator.machine.controller.events import LogAdded
from ur_emulator.machine.controller.safety.inputs import OperationalMode


def openapi(calls: Iterable[robot_api.ApiCall], version: str) -> dict[str, Any]:
    """Return the OpenAPI document of some calls; `version` is that of the API."""
    paths: dict[str, dict[str, Any]] = {}
    for call in calls:
        described = paths.setdefault(call.path, {})[call.method.lower()] = {"summary": call.does}
        if name := call.path.partition("{")[2].rstrip("}"):
            schema = {"schema": {"type": "string"}}
            described["parameters"] = [{"name": name, "in": "path", "required": True, **schema}]
        described["responses"] = {"200": {"description": "done"}}
    info = {"title": "Robot API", "version": version}
    return {"openapi": "3.0.3", "info": info, "servers": [{"url": robot_api.BASE}], "paths": paths}


def page(calls: Iterable[robot_api.ApiCall], version: str) -> bytes:
    """Return the same as a page in HTML."""
    rows = "\n".join(
        f"<tr><td><code>{call.method} {escape(call.path)}</code></td><td>{escape(call.does)}</td>"
        f"<td>{'remote' * call.needs_remote}</td></tr>"
        for call in calls
    )
    return (
        f"<!DOCTYPE html>\n<html lang=en><meta charset=utf-8><title>Robot API {escape(version)}</title>\n"
        f"<h1>Robot API {escape(version)}</h1>\n<p>Below <code>{robot_api.BASE}</code>; "
        f'<a href="{robot_api.BASE}/openapi.json">openapi.json</a> is for programs.</p>\n'
        f"<table>\n<tr><th>call</th><th>does</th><th>control</th></tr>\n{rows}\n</table>\n</html>\n"
    ).encode()


# Name of the program of a box that has loaded none. Source: a fresh simulator.
DEFAULT_PROGRAM = "Default program"
# Source: the maker's API document as the client library's tests quote it.
_LOCAL = "Not authorized to perform this operation under the current robot control mode."
_NOT_CLOSED = HttpAnswer(409, {"closed": False, "message": "there is no such popup"})
# Modes in which an action starts, or has happened already.
_RESTS = frozenset({RobotMode.IDLE, RobotMode.RUNNING})
_POWERED_FROM = {"POWER_ON": _RESTS | {RobotMode.POWER_OFF}, "BRAKE_RELEASE": _RESTS}
_COMMANDS: dict[str, Callable[[], Command]] = {
    "POWER_ON": PowerOn,
    "BRAKE_RELEASE": ReleaseBrakes,
    "POWER_OFF": PowerOff,
    "UNLOCK_PROTECTIVE_STOP": UnlockProtectiveStop,
    "RESTART_SAFETY": RestartSafety,
}
# The first that an error is; the status of others is 422.
_STATUS = (
    (MissingFileRefusal, 404),
    (FileMissingError, 404),
    (RefusedError, 409),
    (ArgumentError, 400),
    (EmulatorError, 422),
)
# The answer to a call, or steps that end in it; what is no `HttpAnswer` is sent with status 200, None as {}.
_Method = Callable[[HttpRequest, str], object]


class RobotApiAnswers:
    """Finds the answer to a request; `own_host` is the address that the port is bound to."""

    def __init__(
        self,
        box: ServedBox,
        player: ProgramPlayer,
        reports: ReportWriter,
        shut_down: Callable[[], None],
        own_host: str,
    ) -> None:
        self._box = box
        self._player = player
        self._reports = reports
        self._shut_down = shut_down
        self._own_host = own_host
        software, identity = box.identity.software, box.identity
        calls = self._calls = software.robot_api
        version = robot_api.api_version(software.version)
        self._methods: dict[str, _Method] = {
            "GET /openapi.json": lambda *_: openapi(calls, version),
            "GET /docs": lambda *_: HttpAnswer(200, page(calls, version), (), "text/html; charset=utf-8"),
            "GET /system/v1/system-time": lambda *_: {"time": clock_time(box.snapshot.timestamp).isoformat()},
            "PUT /robotstate/v1/state": self._change_robot_state,
            "GET /robotstate/v1/robotmode": lambda *_: {
                "mode": robot_api.ROBOT_MODE_NAMES[RobotMode(box.snapshot.robot_mode)],
                "message": "",
            },
            "GET /robotstate/v1/safetymode": lambda *_: {
                "mode": robot_api.SAFETY_MODE_NAMES[SafetyMode(box.snapshot.safety_mode)],
                "message": "",
            },
            "PUT /program/v1/state": self._change_program_state,
            "GET /program/v1/state": lambda *_: {"state": self._program_state, "message": "", "details": ""},
            "PUT /program/v1/load": lambda request, _: self._load(request.text("programName")),
            "PUT /program/v1/loaded": lambda request, _: self._load(request.text("name")),
            "GET /program/v1/loaded": lambda *_: {"name": self._loaded_name},
            "GET /system/v1/controlmode": lambda *_: {"mode": "REMOTE" if box.remote_period else "LOCAL"},
            "GET /system/v1/operationalmode": lambda *_: {"mode": self._operational_mode()},
            "GET /programs/v1": self._list_programs,
            "POST /programs/v1": lambda request, _: self._store_program(request, is_new=True),
            "PUT /programs/v1": lambda request, _: self._store_program(request, is_new=False),
            "GET /programs/v1/{name}": lambda _, name: box.in_worker(files.read_program, player.folder, name),
            "POST /popup/v1": lambda request, _: box.apply(ShowPopup(request.text("message"))),
            "DELETE /popup/v1": self._close_popups,
            "DELETE /popup/v1/safety": lambda *_: _NOT_CLOSED,
            "GET /versions/v1": lambda *_: {"marketingVersion": str(software.version), "baselineVersion": ""},
            "GET /system/v1/information": lambda *_: {
                "robotType": identity.wire_model,
                "serialNumber": identity.serial_number,
            },
            "PUT /system/v1/shutdown": self._shutdown,
            "POST /system/v1/log": self._add_to_log,
            "POST /supportfiles/v1": self._flight_report,
            "GET /supportfiles/v1": self._support_files,
        }

    def answer(self, request: HttpRequest, connection: Connection) -> Steps[HttpAnswer]:
        """Answer a request; local control forbids some."""
        try:
            return (yield from self._answer(request))
        except HttpError as error:
            return HttpAnswer(error.status, _error_body(error.status, str(error)), error.headers)
        except EmulatorError as error:
            status = next(status for kind, status in _STATUS if isinstance(error, kind))
            return HttpAnswer(status, _error_body(status, str(error)))

    def _answer(self, request: HttpRequest) -> Steps[HttpAnswer]:
        check_origin(request.headers, self._own_host)
        call, argument = robot_api.match_call(request.method, request.path, self._calls)
        if call is None:
            if argument:
                raise HttpError(405, f"{request.path} is asked with {argument}", ("Allow", argument))
            raise HttpError(404, f"there is no {ascii(request.path)[:80]}: see {robot_api.BASE}/openapi.json")
        if call.needs_remote and not self._box.remote_period:
            raise HttpError(403, _LOCAL)
        answer = yield from result_of(self._methods[f"{call.method} {call.path}"](request, argument))
        if not isinstance(answer, HttpAnswer):
            answer = HttpAnswer(200, {} if answer is None else answer)
        return replace(answer, result={"message": call.message} | answer.result) if call.message else answer

    # --- robot

    def _change_robot_state(self, request: HttpRequest, _: str) -> Steps[None]:
        """Do an action; where it powers the arm or opens its brakes, answer when that is done."""
        action, mode = request.word("action", _COMMANDS), RobotMode(self._box.snapshot.robot_mode)
        if mode not in _POWERED_FROM.get(action, RobotMode):
            raise RefusedError(f"{action} given: the robot is in {mode.name}")
        yield from self._box.apply(_COMMANDS[action]())
        while action in _POWERED_FROM and self._box.controller.state.mode.is_changing:
            yield

    def _operational_mode(self) -> str:
        mode = self._box.controller.state.operational.mode
        return "MANUAL" if mode is OperationalMode.MANUAL else "AUTOMATIC"

    def _shutdown(self, *_: object) -> Steps[HttpAnswer]:
        yield from self._box.apply(PowerOff())
        self._shut_down()
        return HttpAnswer(202, {"message": None})

    # --- the loaded program

    @property
    def _program_state(self) -> str:
        if self._player.is_paused:
            return "PAUSED"
        return "PLAYING" if self._player.is_running else "STOPPED"

    @property
    def _loaded_name(self) -> str:
        loaded = self._player.loaded
        return loaded.file_name.rpartition(".")[0] if loaded else DEFAULT_PROGRAM

    def _change_program_state(self, request: HttpRequest, _: str) -> Steps[dict[str, Any]]:
        """Play, pause, resume or stop, and answer when that is done."""
        player = self._player
        actions: dict[str, Callable[[], Steps[None]]] = {
            "play": lambda: player.play(""),
            "pause": player.pause,
            "resume": lambda: player.play(""),
            "stop": player.stop,
        }
        action = request.word("action", actions)
        if action == "resume" and not player.is_paused:
            raise RefusedError(f"resume given: the program is {self._program_state}")
        yield from actions[action]()
        return {"state": self._program_state, "details": ""}

    def _load(self, name: str) -> Steps[dict[str, Any]]:
        folder = self._player.folder
        yield from self._player.load(folder.wire_path(files.find_program(folder, name)))
        return {"name": name}

    # --- program files

    def _list_programs(self, *_: object) -> Steps[dict[str, Any]]:
        programs = yield from self._box.in_worker(files.list_programs, self._player.folder)
        return {"programs": programs, "message": ""}

    def _store_program(self, request: HttpRequest, *, is_new: bool) -> Steps[dict[str, Any]]:
        """Take the file of a program, a new one or one that exists."""
        kind = request.headers.get("content-type", "")
        in_use = self._loaded_name if self._player.is_running else ""
        name = yield from self._box.in_worker(
            files.write_program, self._player.folder, kind, request.body, is_new, in_use
        )
        return {"programName": name}

    # --- popups, log, reports

    def _close_popups(self, *_: object) -> Steps[HttpAnswer]:
        operator = self._box.controller.state.pendant
        if not operator.shown and not any(popup.kind is RequestedType.NONE for popup in operator.requests):
            return _NOT_CLOSED
        yield from self._box.apply(ClosePopup())
        return HttpAnswer(200, {"closed": True})

    def _add_to_log(self, request: HttpRequest, _: str) -> None:
        self._box.announce(LogAdded("Robot API", request.text("message")))

    def _flight_report(self, *_: object) -> Steps[dict[str, Any]]:
        yield from self._reports.write(flight_report, "")
        return {"details": None}

    def _support_files(self, *_: object) -> Steps[HttpAnswer]:
        archive = yield from self._reports.write(flight_report_archive)
        return HttpAnswer(200 if archive else 204, archive, content_type="application/zip")


def _error_body(status: int, text: str) -> dict[str, Any]:
    """Return the body of an error; 422 has the form of the web library that the maker uses."""
    if status == HTTPStatus.UNPROCESSABLE_ENTITY:
        return {"detail": [{"loc": ["body"], "msg": text, "type": "value_error"}]}
    return {"message": HTTPStatus(status).phrase, "details": text}
