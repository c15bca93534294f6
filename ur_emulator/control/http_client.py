"""Asks the control port of a box that runs somewhere; for the command line and for tests."""

from __future__ import annotations

import http.client
import json
import socket
from collections.abc import Mapping
from typing import Any
from urllib.parse import urlencode

from ur_emulator.budgets import BUDGETS
from ur_emulator.control.operations import OPERATIONS, make
from ur_emulator.errors import ArgumentError, ControlError, RefusedError

DEFAULT_HOST = "127.0.0.1"
DEFAULT_PORT = 29900
# How long an answer may take beyond what is waited for [s]: compiling a long program takes seconds.
PATIENCE = 60.0


class ControlClient:
    """One box, one connection for every question."""

    def __init__(self, host: str = DEFAULT_HOST, port: int = DEFAULT_PORT, token: str | None = None) -> None:
        """Ask a box.

        Args:
            host: its address.
            port: its control port.
            token: of that port, None if it has none.
        """
        self.host = host
        self.port = port
        self._headers = {} if token is None else {"Authorization": f"Bearer {token}"}

    def perform(self, name: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Have an operation done; return its result.

        Raises:
            ArgumentError: it was given something that it does not take.
            RefusedError: the state of the box stands against it.
            ControlError: it was not done for another reason, such as that no box answers.
        """
        make(name, arguments)
        given = {key: value for key, value in arguments.items() if value is not None}
        body = json.dumps(given)
        if len(body) > BUDGETS.body_bytes:
            raise ArgumentError(
                f"{name} with {len(body)} bytes: the control API takes {BUDGETS.body_bytes}; "
                "send a longer program to port 30002, or put its file into the folder of programs"
            )
        patience = PATIENCE + float(given.get("timeout", 0.0))
        connection = http.client.HTTPConnection(self.host, self.port, timeout=patience)
        try:
            if OPERATIONS[name].only_reads:
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
        raise {400: ArgumentError, 409: RefusedError}.get(response.status, ControlError)(text)


def _reason(error: Exception) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())
