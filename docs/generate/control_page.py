"""The page docs/control.md, made from the operations of the control API."""

from __future__ import annotations

from typing import Any

from ur_emulator.budgets import BUDGETS, KIB
from ur_emulator.commands.operation import Operation
from ur_emulator.commands.parameters import Kind, Parameter
from ur_emulator.control.http_client import DEFAULT_PORT
from ur_emulator.control.operations import OPERATIONS
from ur_emulator.control.token import TOKEN_VARIABLE

_INTRODUCTION = f"""\
# The control API

What a real arm has hands, wires and buttons for, the box has operations for: set an input, press the emergency
stop, push the arm, answer a question, read the log. The same operations, with the same names, in three places:

| from | how |
|---|---|
| Python | `box.push(force=(0, 0, 20), duration=0.5)` on a `ControlBox`, from any thread; reading ones are properties: `box.state.q` |
| HTTP | `POST /v1/push` with `{{"force": [0, 0, 20], "duration": 0.5}}`; reading ones are `GET /v1/state` |
| command line | `ur-emulator ctl push --force 0 0 20 --duration 0.5` |

An operation returns after the cycle in which it was applied, with the number of that cycle. Its effect may take
longer: `wait_until` waits for it. What changes something is written into the box's log, source `Control`.

In lockstep, time stands still while nothing goes on. An operation gets its cycle all the same; what needs time to
happen (a push without duration, a wait for something that nobody brings about) waits for a program or a move.

## Python

Methods raise `ArgumentError` for what they do not take, `RefusedError` when the state of the box stands against
it (`WaitTimeoutError`, also a `TimeoutError`, for a wait in vain), and `NotRunningError` when the box does not run;
all are `EmulatorError`s with one line that says what to do. They return the number of the cycle.
`box.log` is a tuple of all entries that are kept.

## HTTP

Off unless asked for: `ur-emulator serve --control-port {DEFAULT_PORT}`, or `ControlBox(control_port=0)` for a free port,
whose number is `box.control_port` then. It listens on the host of the box. With a token, every request must show it
in the header `Authorization: Bearer TOKEN` (401 otherwise): `ur-emulator serve --token TOKEN`,
`ControlBox(control_token="TOKEN")`, or the environment variable `{TOKEN_VARIABLE}` of `ur-emulator serve` and
`ur-emulator ctl`, which other users of the machine do not see. On a loopback address the token may be left out:
whoever reaches the port controls the box then. On any other address a control port needs one.

- `GET /v1/operations` lists everything below as JSON.
- `POST` takes a JSON object (content type `application/json`); without a body all defaults are taken.
- The answer is a JSON object; an error is `{{"error": "one line"}}` with status 400 (does not fit), 401 (no token),
  403 (see below), 404 (no such operation), 405 (GET and POST confused), 409 (the box is not in a state for it), 413 (too long:
  {BUDGETS.body_bytes // KIB} KiB of body; longer programs go to port 30002) or 431 (16 KiB of header).
- Connections are kept alive; one request of a client is answered after the other. The box keeps {BUDGETS.control_clients} connections and
  closes the one that has been silent longest for a new one.
- Pages in a browser cannot reach the box: `Host` must be the address that it listens on, or `localhost` (403
  otherwise, against DNS rebinding), and requests of foreign origins are refused (`Origin`, `Sec-Fetch-Site`).
- Scripts of the box cannot reach it either. What else was tried: [security.md](security.md).

```sh
curl http://127.0.0.1:{DEFAULT_PORT}/v1/state
curl -H 'Content-Type: application/json' -d '{{"group": "standard", "n": 3, "level": true}}' http://127.0.0.1:{DEFAULT_PORT}/v1/set_digital_input
```

## Command line

`ur-emulator ctl OPERATION [--option value ...] [--host H] [--control-port {DEFAULT_PORT}] [--token TOKEN] [--json]`. Exit code 0:
done; 1: refused, or no box answers; 2: wrong usage. `ctl log --follow` goes on until Ctrl-C; `ctl run_program --script-file FILE` sends a
file of this machine; `ctl OPERATION --help` lists the options.

## Operations
"""  # noqa: E501 - the lines of a page


def render() -> str:
    """Return the page."""
    return "\n".join([_INTRODUCTION, *(_section(*row) for row in OPERATIONS.items())])


def _section(name: str, operation: type[Operation[Any]]) -> str:
    verb = "GET" if operation.only_reads else "POST"
    lines = [f"### {name}\n", f"{operation.meaning} ({verb})\n"]
    if operation.parameters:
        lines += ["| parameter | is | allowed | default |", "|---|---|---|---|"]
        lines += [_row(parameter) for parameter in operation.parameters]
        lines.append("")
    lines.append(f"Returns {operation.result}.\n")
    return "\n".join(lines)


def _row(parameter: Parameter) -> str:
    default = (
        "required" if parameter.is_required else "" if parameter.default is None else f"{parameter.default}"
    )
    if parameter.kind is Kind.BOOLEAN and default != "required":
        default = default.lower()
    return f"| `{parameter.name}` | {parameter.meaning} | {parameter.allowed} | {default} |"
