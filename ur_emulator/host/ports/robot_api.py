"""The Robot API of PolyScope X: a method for each call; `protocol.robot_api` lists the calls."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from html import escape
from http import HTTPStatus
from typing import Any

from protocol import robot_api
from protocol.primary.messages import RequestedType
from protocol.ur_types import RobotMode, SafetyMode
from ur_emulator.errors import EmulatorError, FileMissingError, RefusedError
from ur_emulator.host.player.player import MissingFileRefusal, ProgramPlayer
from ur_emulator.host.ports import robot_api_files
from ur_emulator.host.ports.http import HttpAnswer, HttpError, HttpRequest, check_origin
from ur_emulator.host.reports.report_writer import ReportWriter
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps
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
        paths.setdefault(call.path, {})[call.method.lower()] = _described(call)
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


def _described(call: robot_api.ApiCall) -> dict[str, Any]:
    name = call.path.partition("{")[2].rstrip("}")
    parameter = {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
    return {
        "summary": call.does,
        **({"parameters": [parameter]} if name else {}),
        "responses": {"200": {"description": "done"}},
    }


# Name of the program of a box that has loaded none. Source: a fresh simulator.
DEFAULT_PROGRAM = "Default program"


class ProgramCalls:
    """Answers these calls."""

    def __init__(self, box: ServedBox, player: ProgramPlayer) -> None:
        self._box = box
        self._player = player

    # --- the loaded one

    def state(self) -> str:
        """Return PLAYING, PAUSED or STOPPED."""
        if self._player.is_paused:
            return "PAUSED"
        return "PLAYING" if self._player.is_running else "STOPPED"

    def loaded_name(self) -> str:
        """Return the name of the loaded program."""
        loaded = self._player.loaded
        return loaded.file_name.rpartition(".")[0] if loaded else DEFAULT_PROGRAM

    def change_state(self, request: HttpRequest) -> Steps[HttpAnswer]:
        """Play, pause, resume or stop, and answer when that is done."""
        player = self._player
        actions: dict[str, Callable[[], Steps[None]]] = {
            "play": lambda: player.play(""),
            "pause": player.pause,
            "resume": self._resume,
            "stop": player.stop,
        }
        yield from actions[request.word("action", actions)]()
        return HttpAnswer(200, {"state": self.state(), "details": ""})

    def _resume(self) -> Steps[None]:
        if not self._player.is_paused:
            raise RefusedError(f"resume given: the program is {self.state()}")
        yield from self._player.play("")

    def load(self, request: HttpRequest, key: str) -> Steps[HttpAnswer]:
        """Load the program that the body names under a key."""
        name = request.text(key)
        file = robot_api_files.find_program(self._player.folder, name)
        yield from self._player.load(file.wire_path)
        return HttpAnswer(200, {"name": name})

    # --- files

    def list_all(self) -> Steps[HttpAnswer]:
        """Name all programs."""
        programs = yield from self._box.in_worker(robot_api_files.list_programs, self._player.folder)
        return HttpAnswer(200, {"programs": programs, "message": ""})

    def send(self, name: str) -> Steps[HttpAnswer]:
        """Send the file of a program."""
        data = yield from self._box.in_worker(robot_api_files.read_program, self._player.folder, name)
        return HttpAnswer(200, data)

    def store(self, request: HttpRequest, *, is_new: bool) -> Steps[HttpAnswer]:
        """Take the file of a program, a new one or one that exists."""
        in_use = self.loaded_name() if self._player.is_running else ""
        name, outcome = yield from self._box.in_worker(
            robot_api_files.write_program,
            self._player.folder,
            request.headers.get("content-type", ""),
            request.body,
            is_new,
            in_use,
        )
        match outcome:
            case robot_api_files.StoreResult.EXISTS:
                raise HttpError(400, f"there is a program {name!r} already: PUT replaces it")
            case robot_api_files.StoreResult.MISSING:
                raise HttpError(404, f"there is no program {name!r} yet: POST makes it")
            case robot_api_files.StoreResult.IN_USE:
                raise RefusedError(f"{name} is loaded and plays: stop it first")
        return HttpAnswer(200, {"programName": name})


# Source: the maker's API document as the client library's tests quote it.
_LOCAL = "Not authorized to perform this operation under the current robot control mode."
_NOT_CLOSED = {"closed": False, "message": "there is no such popup"}
# Modes in which an action starts, or has happened already, and the effect.
_RESTS = frozenset({RobotMode.IDLE, RobotMode.RUNNING})
_POWER: dict[str, tuple[frozenset[RobotMode], type[Command]]] = {
    "POWER_ON": (_RESTS | {RobotMode.POWER_OFF}, PowerOn),
    "BRAKE_RELEASE": (_RESTS, ReleaseBrakes),
}


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
        programs = ProgramCalls(box, player)
        self._reports = reports
        self._shut_down = shut_down
        self._own_host = own_host
        self._calls = box.identity.software.robot_api
        version = robot_api.api_version(box.identity.software.version)
        self._methods: dict[str, Callable[[HttpRequest, str], Steps[HttpAnswer]]] = {
            "GET /openapi.json": lambda *_: _at_once(openapi(self._calls, version)),
            "GET /docs": lambda *_: _at_once(page(self._calls, version), "text/html; charset=utf-8"),
            "GET /system/v1/system-time": lambda *_: _at_once(
                {"time": clock_time(box.snapshot.timestamp).isoformat()}
            ),
            "PUT /robotstate/v1/state": self._change_robot_state,
            "GET /robotstate/v1/robotmode": lambda *_: _at_once(
                {"mode": robot_api.ROBOT_MODE_NAMES[RobotMode(box.snapshot.robot_mode)], "message": ""}
            ),
            "GET /robotstate/v1/safetymode": lambda *_: _at_once(
                {"mode": robot_api.SAFETY_MODE_NAMES[SafetyMode(box.snapshot.safety_mode)], "message": ""}
            ),
            "PUT /program/v1/state": lambda request, _: programs.change_state(request),
            "GET /program/v1/state": lambda *_: _at_once(
                {"state": programs.state(), "message": "", "details": ""}
            ),
            "PUT /program/v1/load": lambda request, _: programs.load(request, "programName"),
            "PUT /program/v1/loaded": lambda request, _: programs.load(request, "name"),
            "GET /program/v1/loaded": lambda *_: _at_once({"name": programs.loaded_name()}),
            "GET /system/v1/controlmode": lambda *_: _at_once(
                {"mode": "REMOTE" if box.controller.state.pendant.remote_period else "LOCAL"}
            ),
            "GET /system/v1/operationalmode": lambda *_: _at_once({"mode": self._operational_mode()}),
            "GET /programs/v1": lambda *_: programs.list_all(),
            "POST /programs/v1": lambda request, _: programs.store(request, is_new=True),
            "PUT /programs/v1": lambda request, _: programs.store(request, is_new=False),
            "GET /programs/v1/{name}": lambda _, name: programs.send(name),
            "POST /popup/v1": self._show_popup,
            "DELETE /popup/v1": self._close_popups,
            "DELETE /popup/v1/safety": lambda *_: _at_once(_NOT_CLOSED, status=409),
            "GET /versions/v1": lambda *_: _at_once(
                {"marketingVersion": str(box.identity.software.version), "baselineVersion": ""}
            ),
            "GET /system/v1/information": lambda *_: _at_once(
                {"robotType": box.identity.wire_model, "serialNumber": box.identity.serial_number}
            ),
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

    def _answer(self, request: HttpRequest) -> Steps[HttpAnswer]:
        check_origin(request.headers, self._own_host)
        call, argument = robot_api.match_call(request.method, request.path, self._calls)
        if call is None:
            if argument:
                raise HttpError(405, f"{request.path} is asked with {argument}", ("Allow", argument))
            raise HttpError(404, f"there is no {ascii(request.path)[:80]}: see {robot_api.BASE}/openapi.json")
        if call.needs_remote and not self._box.controller.state.pendant.remote_period:
            raise HttpError(403, _LOCAL)
        try:
            answer = yield from self._methods[f"{call.method} {call.path}"](request, argument)
        except (MissingFileRefusal, FileMissingError) as error:
            raise HttpError(404, str(error)) from None
        except RefusedError as error:
            raise HttpError(409, str(error)) from None
        except EmulatorError as error:
            raise HttpError(422, str(error)) from None
        if call.message:
            answer = replace(answer, result={"message": call.message} | answer.result)
        return answer

    # --- robot

    def _change_robot_state(self, request: HttpRequest, _: str) -> Steps[HttpAnswer]:
        actions: dict[str, Callable[[], Steps[HttpAnswer]]] = {
            **{action: partial(self._power, action) for action in _POWER},
            "POWER_OFF": lambda: self._applied(PowerOff()),
            "UNLOCK_PROTECTIVE_STOP": lambda: self._applied(UnlockProtectiveStop()),
            "RESTART_SAFETY": lambda: self._applied(RestartSafety()),
        }
        action = request.word("action", actions)
        return (yield from actions[action]())

    def _power(self, action: str) -> Steps[HttpAnswer]:
        """Power the arm or open its brakes; answer when that is done."""
        possible, command = _POWER[action]
        mode = RobotMode(self._box.snapshot.robot_mode)
        if mode not in possible:
            raise RefusedError(f"{action} given: the robot is in {mode.name}")
        yield from self._box.apply(command())
        while self._box.controller.state.mode.is_changing:
            yield
        return HttpAnswer(200, {})

    def _operational_mode(self) -> str:
        mode = self._box.controller.state.operational.mode
        return "MANUAL" if mode is OperationalMode.MANUAL else "AUTOMATIC"

    def _shutdown(self, *_: object) -> Steps[HttpAnswer]:
        yield from self._box.apply(PowerOff())
        self._shut_down()
        return HttpAnswer(202, {"message": None})

    # --- popups, log, reports

    def _show_popup(self, request: HttpRequest, _: str) -> Steps[HttpAnswer]:
        return (yield from self._applied(ShowPopup(request.text("message"))))

    def _close_popups(self, *_: object) -> Steps[HttpAnswer]:
        operator = self._box.controller.state.pendant
        if not operator.shown and not any(popup.kind is RequestedType.NONE for popup in operator.requests):
            return HttpAnswer(409, _NOT_CLOSED)
        yield from self._box.apply(ClosePopup())
        return HttpAnswer(200, {"closed": True})

    def _add_to_log(self, request: HttpRequest, _: str) -> Steps[HttpAnswer]:
        self._box.announce(LogAdded("Robot API", request.text("message")))
        return (yield from _at_once({}))

    def _flight_report(self, *_: object) -> Steps[HttpAnswer]:
        yield from self._reports.flight_report()
        return HttpAnswer(200, {"details": None})

    def _support_files(self, *_: object) -> Steps[HttpAnswer]:
        archive = yield from self._reports.archive()
        return HttpAnswer(200 if archive else 204, archive, content_type="application/zip")

    def _applied(self, command: Command) -> Steps[HttpAnswer]:
        yield from self._box.apply(command)
        return HttpAnswer(200, {})


def _at_once(result: object, content_type: str = "", status: int = 200) -> Steps[HttpAnswer]:
    """Answer without a wait."""
    return HttpAnswer(status, result, content_type=content_type)
    yield


def _error_body(status: int, text: str) -> dict[str, Any]:
    """Return the body of an error; 422 has the form of the web library that the maker uses."""
    if status == HTTPStatus.UNPROCESSABLE_ENTITY:
        return {"detail": [{"loc": ["body"], "msg": text, "type": "value_error"}]}
    return {"message": HTTPStatus(status).phrase, "details": text}
