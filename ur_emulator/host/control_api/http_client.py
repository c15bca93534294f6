"""Asks the control port of a box that runs somewhere: for the command line, and for `ControlBox.attach`."""

from __future__ import annotations

import http.client
import json
import socket
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from urllib.parse import urlencode

from protocol.primary.messages import ReportLevel
from protocol.ur_types import Ports
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ArgumentError, ControlError, RefusedError, WaitTimeoutError
from ur_emulator.host.box_log import LogEntry
from ur_emulator.host.box_options import ServedAt
from ur_emulator.host.control_api import operations  # noqa: F401  # gives operations the names that are sent
from ur_emulator.host.control_api.box_state import BoxState, Question
from ur_emulator.host.control_api.step_operations import ReadIdentity, ReadLog, ReadState, WaitUntil
from ur_emulator.machine.commands.operation import Operation
from ur_emulator.machine.models.things import BodyShape, Contact, ThingNow

if TYPE_CHECKING:
    from ur_emulator.machine.controller.command import Command, Done

DEFAULT_HOST = "127.0.0.1"
DEFAULT_PORT = 29900
# How long an answer may take beyond what is waited for [s]: compiling a long program takes seconds.
PATIENCE = 60.0


class ControlClient:
    """One box, one connection for every question."""

    def __init__(self, host: str = DEFAULT_HOST, port: int = DEFAULT_PORT, token: str | None = None) -> None:
        """Ask a box; the token is that of its port, None if it has none."""
        self.host = host
        self.port = port
        self._headers = {} if token is None else {"Authorization": f"Bearer {token}"}

    def perform(self, operation: Operation[Any]) -> dict[str, Any]:
        """Have an operation done; return its result.

        ArgumentError and RefusedError are those of the box; ControlError: it was not done for another reason,
        such as that no box answers.
        """
        name = operation.api_name
        given = {key: value for key, value in operation.as_given.items() if value is not None}
        body = json.dumps(given)
        if len(body) > BUDGETS.body_bytes:
            raise ArgumentError(
                f"{name} with {len(body)} bytes: the control API takes {BUDGETS.body_bytes}; "
                "send a longer program to port 30002, or put its file into the folder of programs"
            )
        patience = None if given.get("wait") else PATIENCE + float(given.get("timeout", 0.0))
        connection = http.client.HTTPConnection(self.host, self.port, timeout=patience)
        try:
            if operation.only_reads:
                query = f"?{urlencode(given)}" if given else ""
                connection.request("GET", f"/v1/{name}{query}", headers=self._headers)
            else:
                headers = {"Content-Type": "application/json", **self._headers}
                connection.request("POST", f"/v1/{name}", body, headers)
            response = connection.getresponse()
            result = json.loads(response.read())
        except (socket.gaierror, UnicodeError):
            raise ControlError(
                f"{self.host} cannot be looked up: check the name or address of the box"
            ) from None
        except (OSError, http.client.HTTPException, ValueError) as error:
            raise ControlError(
                f"no box answers at {self.host}:{self.port} ({_reason(error)}): "
                "start one with `ur-emulator serve --control-port N`"
            ) from None
        finally:
            connection.close()
        if response.status == 200 and isinstance(result, dict):
            return result
        text = str(result.get("error", result)) if isinstance(result, dict) else str(result)
        raise _ERRORS.get(response.status, ControlError)(text)

    def whole_log(self, asked: ReadLog) -> dict[str, Any]:
        """Return all entries of the log as one result of `log`; the box gives some at a time."""
        entries: list[Any] = []
        while True:
            result = self.perform(asked)
            entries += result["entries"]
            if len(result["entries"]) < BUDGETS.log_entries:
                return {**result, "entries": entries}
            asked = replace(asked, after=result["next"])


_ERRORS = {400: ArgumentError, 408: WaitTimeoutError, 409: RefusedError}


def log_entry(values: Mapping[str, Any]) -> LogEntry:
    """Return an entry of the log from JSON."""
    return LogEntry(**{**values, "level": ReportLevel[values["level"]]})


class AttachedBox:
    """A box that somebody else serves; it goes on when this process ends.

    Its methods are those of a rack with one box (`ur_emulator.emulator`); `served` says where that is.
    """

    def __init__(self, host: str, port: int, token: str | None) -> None:
        """Ask it who it is; ControlError if no box answers there, or not without its token."""
        self._client = ControlClient(host, port, token)
        facts = self._client.perform(ReadIdentity())
        numbers = Ports.of({name: number for name, number in facts["ports"].items() if name != "control"})
        title = f"{facts['robot']} {facts['software']}"
        self.served = [ServedAt(title, facts["serial_number"], host, numbers, control_port=port)]

    def perform(self, index: int, operation: Operation[Any]) -> Any:
        """Have an operation done; return its result."""
        result = self._client.perform(operation)
        return _state_of(result) if isinstance(operation, ReadState | WaitUntil) else result

    def submit(self, index: int, command: Command, done: Done | None) -> None:
        """Raise ControlError: it takes operations only."""
        raise ControlError("a box that was attached takes operations only, no commands: see docs/control.md")

    def log(self, index: int) -> tuple[LogEntry, ...]:
        """Return the last entries of the log, the oldest first."""
        return tuple(map(log_entry, self._client.whole_log(ReadLog())["entries"]))

    def follow_log(self, index: int, follower: Callable[[LogEntry], None]) -> None:
        """Raise ControlError: its log is read with operations."""
        raise ControlError("the log of a box that was attached cannot be followed: use `ctl log --follow`")

    def end_of(self, index: int) -> tuple[bool, Exception | None]:
        """Tell that it has not ended: nobody says so."""
        return False, None


# Fields of the state that are tuples of records.
_RECORDS: dict[str, Callable[..., Any]] = {
    "things": ThingNow,
    "shapes": BodyShape,
    "contacts": Contact,
    "questions": Question,
}


def _state_of(result: Mapping[str, Any]) -> BoxState:
    state = _frozen(result)
    for name, record in _RECORDS.items():
        state[name] = tuple(record(**fields) for fields in state[name])
    return BoxState(**state)


def _frozen(value: Any) -> Any:
    """Return a value of JSON with tuples in place of lists."""
    if isinstance(value, dict):
        return {name: _frozen(inner) for name, inner in value.items()}
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def _reason(error: Exception) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())
