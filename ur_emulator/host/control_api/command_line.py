"""`ur-emulator ctl`: every operation of the table as a sub-command, done by a box that runs.

Exit codes: `ur_hil.command_line`; 1 when the box has refused, or none answers. Errors are one line.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ControlError, EmulatorError
from ur_emulator.host.box_log import printable
from ur_emulator.host.box_options import TOKEN_VARIABLE, check_token
from ur_emulator.host.control_api.http_client import DEFAULT_HOST, DEFAULT_PORT, ControlClient, log_entry
from ur_emulator.host.control_api.operations import OPERATIONS, make
from ur_emulator.host.control_api.step_operations import ReadLog, read_script
from ur_emulator.machine.commands.operation import Kind, Parameter
from ur_hil.command_line import ExitCode

PROGRAM = "ur-emulator ctl"
# Pause between two requests of a log that is followed [s].
_FOLLOW_PERIOD = 0.2
_COMMON_OPTIONS = ("--host", "--control-port", "--token", "--json", "--help")


class _Parser(argparse.ArgumentParser):
    """Its errors are one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(ExitCode.WRONG_USAGE, f"{PROGRAM}: {message}; `{self.prog} --help` shows what there is\n")


def main(words: Sequence[str]) -> int:
    """Run one command; return the exit code."""
    given = vars(make_parser().parse_args(words))
    name = given.pop("command")
    token = given.pop("token", os.environ.get(TOKEN_VARIABLE) or None)
    client = ControlClient(given.pop("host", DEFAULT_HOST), given.pop("control_port", DEFAULT_PORT), token)
    as_json, follow = given.pop("json", False), given.pop("follow", False)
    try:
        check_token(token)
        operation = make(name, _arguments(name, given))
    except (EmulatorError, OSError, UnicodeError) as error:
        return _complain(error, ExitCode.WRONG_USAGE)
    try:
        if isinstance(operation, ReadLog):
            result = _follow(client, operation, as_json) if follow else client.whole_log(operation)
        else:
            result = client.perform(operation)
    except KeyboardInterrupt:
        return ExitCode.DONE if follow else ExitCode.INTERRUPTED
    except ControlError as error:
        return _complain(error, ExitCode.FAILED)
    print(json.dumps(result) if as_json else plain(result), flush=True)
    return ExitCode.DONE


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of all sub-commands."""
    common = _Parser(add_help=False, argument_default=argparse.SUPPRESS)
    common.add_argument("--host", help=f"address of the box ({DEFAULT_HOST})")
    common.add_argument("--control-port", type=int, metavar="N", help=f"its control port ({DEFAULT_PORT})")
    common.add_argument("--token", metavar="T", help=f"its token (else that in {TOKEN_VARIABLE})")
    common.add_argument("--json", action="store_true", help="print the result as JSON")
    parser = _Parser(
        prog=PROGRAM,
        description="Do something to a box that runs.",
        epilog=f"example:\n  {example('push')}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        parents=[common],
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="OPERATION")
    for name, operation in OPERATIONS.items():
        command = commands.add_parser(
            name,
            help=operation.meaning,
            description=operation.meaning,
            epilog=f"example:\n  {example(name)}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            parents=[common],
            argument_default=argparse.SUPPRESS,
            allow_abbrev=False,
        )
        for parameter in operation.parameters:
            _add_option(command, parameter)
        if name == "log":
            command.add_argument("--follow", action="store_true", help="go on with what comes, until Ctrl-C")
    return parser


def next_words(words: Sequence[str]) -> tuple[str, ...]:
    """Return what may follow words of a command line, for the completion of shells."""
    name = next((word for word in words if word in OPERATIONS), None)
    if name is None:
        return (*OPERATIONS, *_COMMON_OPTIONS)
    parameters = {_option(parameter): parameter for parameter in OPERATIONS[name].parameters}
    if words[-1] in parameters:
        return parameters[words[-1]].words
    return tuple(option for option in (*parameters, *_COMMON_OPTIONS) if option not in words)


def _option(parameter: Parameter) -> str:
    return f"--{parameter.name.replace('_', '-')}"


def example(name: str) -> str:
    """Return a command line of an operation, to copy."""
    return f"{PROGRAM} {name} {_EXAMPLES.get(name, '')}".rstrip()


# The options in the examples of operations that need some.
_EXAMPLES = {
    "log": "--follow",
    "wait_until": "--steady true",
    "at": """--time 61.5 --operation push --arguments '{"force": [0, 0, 20], "duration": 0.5}'""",
    "set_digital_input": "--group standard --n 3 --level on",
    "set_analog_input": "--group standard --n 0 --value 4.2",
    "push": "--force 0 0 20 --duration 0.5",
    "attach_payload": "--mass 1.5",
    "set_safety_plane": "--name wall --position 0 -0.5 0 --normal 0 1 0",
    "limit_tool_direction": "--axis 0 0 -1 --deviation 0.5",
    "add_obstacle": "--name wall --shape box --size 0.1 1 1 --pose 0.5 0 0.5 0 0 0",
    "remove_obstacle": "--name wall",
    "add_thing": "--name block --shape box --size 0.04 0.04 0.04 --mass 0.2 --pose 0.5 0.2 0 0 0 0",
    "move_thing": "--name block --pose 0.5 -0.2 0 0 0 0",
    "remove_thing": "--name block",
    "require_safeguard_reset": "--required on",
    "assign_safety_input": "--pair 0 --function reduced",
    "set_operational_mode": "--mode manual",
    "enabling_device": "--position pressed",
    "run_program": "--script-file my_program.script",
    "set_speed": "--fraction 0.5",
    "press_button": "--button teach --pressed on",
    "answer": "--value 4",
    "add_to_log": "--text hello",
}


def plain(result: Mapping[str, Any]) -> str:
    """Return a result for people."""
    if set(result) == {"tick"}:
        return f"done in cycle {result['tick']}"
    if "entries" in result:
        return "\n".join(str(log_entry(entry)) for entry in result["entries"])
    lines = list(_lines("", result))
    width = max((len(name) for name, _ in lines), default=0)
    return "\n".join(f"{name:<{width}}  {value}".rstrip() for name, value in lines)


def _add_option(command: argparse.ArgumentParser, parameter: Parameter) -> None:
    default = "" if parameter.default is None else f"; default {_text(parameter.default)}"
    note = "; required" if parameter.is_required else default
    about = f"{parameter.meaning} ({parameter.allowed}{note})".replace("%", "%%")
    more: dict[str, Any] = {}
    if parameter.kind is Kind.BOOLEAN and parameter.default is False:
        more = {"nargs": "?", "const": "true"}
    if parameter.kind is Kind.VECTOR:
        least, most = parameter.lengths
        more = {"nargs": most if least == most else "*"}
    command.add_argument(_option(parameter), dest=parameter.name, help=about, metavar="X", **more)
    if parameter.kind is Kind.SCRIPT:
        command.add_argument(
            f"--{parameter.name}-file", metavar="FILE", help=f"{parameter.name} from a file of this machine"
        )


def _arguments(name: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what was given as JSON has it."""
    arguments: dict[str, Any] = {}
    for parameter in OPERATIONS[name].parameters:
        if (path := given.get(f"{parameter.name}_file")) is not None:
            arguments[parameter.name] = read_script(Path(path))
        elif parameter.name in given:
            value = given[parameter.name]
            arguments[parameter.name] = parameter.parse(value if isinstance(value, str) else " ".join(value))
    return arguments


def _follow(client: ControlClient, asked: ReadLog, as_json: bool) -> NoReturn:
    """Print the log and what is added to it until Ctrl-C."""
    while True:
        result = client.perform(asked)
        for entry in result["entries"]:
            print(json.dumps(entry) if as_json else log_entry(entry), flush=True)
        asked = replace(asked, after=result["next"])
        if len(result["entries"]) < BUDGETS.log_entries:
            time.sleep(_FOLLOW_PERIOD)


def _lines(prefix: str, values: Mapping[str, Any]) -> list[tuple[str, str]]:
    lines: list[tuple[str, str]] = []
    for name, value in values.items():
        if isinstance(value, dict):
            lines += _lines(f"{prefix}{name}.", value)
        else:
            lines.append((f"{prefix}{name}", _text(value)))
    return lines


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{round(value, 5):g}"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_text(item)}" for name, item in value.items())
    if isinstance(value, list | tuple):
        if all(isinstance(item, bool) for item in value):
            return " ".join(str(int(item)) for item in value)
        is_numeric = all(isinstance(item, int | float) for item in value)
        return (" " if is_numeric else "; ").join(map(_text, value))
    return printable(str(value))


def _complain(error: Exception, code: int) -> int:
    sys.stderr.write(f"{PROGRAM}: {printable(' '.join(str(error).split()))}\n")
    return code
