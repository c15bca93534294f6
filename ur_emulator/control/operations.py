"""The operations of the control API, as one table: names, parameters, ranges, defaults, results.

The methods of `ControlBox`, the HTTP endpoint, `ur-emulator ctl` and docs/control.md all follow it; how an
operation is done stands in `actions`. Nothing heavy is imported here: the command line needs the table only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from protocol.primary_messages import ReportLevel
from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator.control.parameters import REQUIRED, Kind, Parameter
from ur_emulator.controller.hands import MAX_LEVER, MAX_LOAD, MAX_PUSH, MAX_PUSH_TIME
from ur_emulator.controller.wires import ANALOG_GROUPS, DIGITAL_GROUPS, MAX_ANALOG
from ur_emulator.errors import ArgumentError

MAX_WAIT = 3600.0  # s
DEFAULT_WAIT = 10.0  # s

APPLIED = "`tick`: the cycle in which it was applied"


@dataclass(frozen=True, slots=True)
class Operation:
    """Something that can be done to a box, or asked of it.

    Attributes:
        name: of the method, of the path below /v1/, of the sub-command.
        meaning: one sentence.
        parameters: what it takes.
        result: what the JSON object that it returns holds.
        only_reads: it changes nothing: a property in Python, GET in HTTP.
    """

    name: str
    meaning: str
    parameters: tuple[Parameter, ...] = ()
    result: str = APPLIED
    only_reads: bool = False

    def check(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Return all arguments as the action wants them, defaults filled in.

        Raises:
            ArgumentError: one does not fit, is missing, or has an unknown name.
        """
        names = [parameter.name for parameter in self.parameters]
        for name in arguments:
            if name not in names:
                known = f"it takes {', '.join(names)}" if names else "it takes none"
                raise ArgumentError(f"{self.name} has no parameter {ascii(name)[:60]}: {known}")
        checked = {}
        for parameter in self.parameters:
            value = arguments.get(parameter.name, parameter.default)
            if value is REQUIRED:
                raise ArgumentError(f"{self.name} needs {parameter.name}: {parameter.allowed}")
            checked[parameter.name] = parameter.check(value)
        return checked


def _names(
    enum: type[RobotMode] | type[SafetyMode] | type[ProgramState] | type[ReportLevel],
) -> tuple[str, ...]:
    return tuple(member.name for member in enum)


def _choice(name: str, meaning: str, choices: tuple[str, ...], default: Any = REQUIRED) -> Parameter:
    return Parameter(name, Kind.CHOICE, meaning, choices=choices, default=default)


_ACTIVE = Parameter("active", Kind.BOOLEAN, "begin, or end it", default=True)
_COG = Parameter(
    "cog", Kind.VECTOR, "centre of gravity in the flange frame", "m", high=MAX_LEVER, default=(0.0, 0.0, 0.0)
)

OPERATIONS: tuple[Operation, ...] = (
    # --- what is going on
    Operation(
        "state",
        "What the box is doing at the end of its last cycle.",
        result="modes, joints, tool, force, inputs and outputs, program, popups and questions, time",
        only_reads=True,
    ),
    Operation(
        "log",
        "What PolyScope's log tab would show.",
        (
            Parameter(
                "after",
                Kind.INTEGER,
                "leave out so many entries: the `next` of the call before",
                low=0,
                default=0,
            ),
            _choice("level", "leave out what weighs less", _names(ReportLevel), "DEBUG"),
        ),
        "`entries`, the oldest first, and `next`, to be given as `after` in the next call",
        only_reads=True,
    ),
    Operation(
        "identity",
        "What the box is.",
        result="software, robot model, serial number, pace, seed, fidelity, address and ports",
        only_reads=True,
    ),
    Operation(
        "wait_until",
        "Wait until all conditions hold at the end of a cycle, and return the state then.",
        (
            _choice("robot_mode", "the robot mode is this", _names(RobotMode), None),
            _choice("safety_mode", "the safety mode is this", _names(SafetyMode), None),
            _choice("program_state", "the program state is this", _names(ProgramState), None),
            Parameter("steady", Kind.BOOLEAN, "the arm stands still, or not", default=None),
            Parameter("popup", Kind.BOOLEAN, "a popup is shown, or none", default=None),
            Parameter("question", Kind.BOOLEAN, "a program waits for an answer, or none does", default=None),
            Parameter("log", Kind.TEXT, "an entry of the log contains this", default=None),
            Parameter("after", Kind.INTEGER, "entries of the log that do not count", low=0, default=0),
            Parameter(
                "timeout",
                Kind.NUMBER,
                "give up after so long in real time",
                "s",
                0.0,
                MAX_WAIT,
                default=DEFAULT_WAIT,
            ),
        ),
        "the state, as `state` gives it",
    ),
    # --- wires
    Operation(
        "set_digital_input",
        "Let a digital input be high or low from now on.",
        (
            _choice("group", "which inputs", tuple(DIGITAL_GROUPS)),
            Parameter("n", Kind.INTEGER, "number of the input: 0 to 7, of the tool 0 to 1", low=0, high=7),
            Parameter("level", Kind.BOOLEAN, "high or low"),
        ),
    ),
    Operation(
        "set_analog_input",
        "Let an analogue input have a voltage or a current from now on.",
        (
            _choice("group", "which inputs", tuple(ANALOG_GROUPS)),
            Parameter("n", Kind.INTEGER, "number of the input", low=0, high=1),
            Parameter(
                "value",
                Kind.NUMBER,
                "in V, or in A where the input measures current",
                low=0.0,
                high=MAX_ANALOG,
            ),
        ),
    ),
    # --- hands
    Operation(
        "push",
        "Push the flange as a hand would; a zero force ends it.",
        (
            Parameter("force", Kind.VECTOR, "in base axes", "N", high=MAX_PUSH),
            Parameter(
                "point",
                Kind.VECTOR,
                "where it acts, in the flange frame",
                "m",
                high=MAX_LEVER,
                default=(0.0, 0.0, 0.0),
            ),
            Parameter(
                "duration",
                Kind.NUMBER,
                "for so long in robot time; until the next push if left out",
                "s",
                0.0,
                MAX_PUSH_TIME,
                default=None,
            ),
        ),
    ),
    Operation(
        "attach_payload",
        "Hang a load on the flange that no program has declared.",
        (Parameter("mass", Kind.NUMBER, "of the load", "kg", 0.0, MAX_LOAD), _COG),
    ),
    Operation(
        "add_obstacle",
        "Put a fixed obstacle somewhere; one of the same name gives way.",
        (
            Parameter("name", Kind.TEXT, "to remove it by"),
            _choice("shape", "what it is; a plane has no end", ("box", "sphere", "capsule", "plane")),
            Parameter(
                "size",
                Kind.VECTOR,
                "box: three edges; sphere: radius; capsule: radius, length; plane: none",
                "m",
                lengths=(0, 3),
            ),
            Parameter(
                "pose",
                Kind.VECTOR,
                "of its middle in the base frame, position in m and rotation vector in rad",
                lengths=(6, 6),
            ),
        ),
    ),
    Operation(
        "remove_obstacle",
        "Take an obstacle away.",
        (Parameter("name", Kind.TEXT, "of the obstacle"),),
    ),
    # --- safety
    Operation(
        "emergency_stop",
        "Press an emergency stop button.",
        (_choice("kind", "the pendant's button, or that of the surroundings", ("robot", "system"), "robot"),),
    ),
    Operation("release_emergency_stop", "Release all emergency stop buttons; the power stays off."),
    Operation("safeguard_stop", "Open the safeguard, or close it again.", (_ACTIVE,)),
    Operation("reduced_mode", "Switch reduced mode on or off, as its input does.", (_ACTIVE,)),
    Operation("protective_stop", "Stop the arm as a safety function would."),
    Operation("unlock_protective_stop", "End a protective stop at once, without the dashboard's 5 s."),
    Operation(
        "trigger_violation",
        "Let the safety system find a violation.",
        (Parameter("text", Kind.TEXT, "for log and clients", default="Safety violation requested"),),
    ),
    Operation(
        "trigger_fault",
        "Let the safety system find a fault in itself.",
        (Parameter("text", Kind.TEXT, "for log and clients", default="Safety fault requested"),),
    ),
    Operation("restart_safety", "Restart the safety system; the power is off then."),
    # --- power
    Operation("power_on", "Power the joints; the brakes stay closed."),
    Operation("power_off", "Close the brakes and cut the power."),
    Operation("release_brakes", "Go to RUNNING, powering on first if need be."),
    # --- programs
    Operation(
        "run_program",
        "Run a program in place of the one that runs.",
        (
            Parameter("script", Kind.SCRIPT, "text of a program, as sent to port 30002", default=None),
            Parameter("file", Kind.TEXT, "or a file in the folder of programs, as for `load`", default=None),
        ),
        "`program`: its name, and `tick`: the cycle in which it began",
    ),
    Operation("stop_program", "End the program, if one runs."),
    Operation("pause_program", "Let the program stand still, and the arm come to rest on its path."),
    Operation("resume_program", "Let a paused program go on."),
    Operation(
        "set_speed",
        "Set the speed slider.",
        (Parameter("fraction", Kind.NUMBER, "of full speed", low=0.0, high=1.0),),
    ),
    # --- the operator
    Operation(
        "answer",
        "Answer a question of a program.",
        (
            Parameter("value", Kind.ANSWER, "of the type that was asked for"),
            Parameter(
                "id",
                Kind.INTEGER,
                "number of the question; the oldest that fits if left out",
                low=1,
                default=None,
            ),
        ),
        "`id`: number of the question, and `tick`",
    ),
    Operation("close_popups", "Press the button of all popups."),
    Operation(
        "add_to_log",
        "Write a line into the log.",
        (Parameter("text", Kind.TEXT, "the line"),),
    ),
)

BY_NAME: dict[str, Operation] = {operation.name: operation for operation in OPERATIONS}


def describe() -> list[dict[str, Any]]:
    """Return the table as JSON has it."""
    return [
        {
            "name": operation.name,
            "method": "GET" if operation.only_reads else "POST",
            "meaning": operation.meaning,
            "parameters": [
                {
                    "name": parameter.name,
                    "type": parameter.kind.value,
                    "meaning": parameter.meaning,
                    "allowed": parameter.allowed,
                    "required": parameter.is_required,
                    "default": None if parameter.is_required else parameter.default,
                }
                for parameter in operation.parameters
            ],
            "result": operation.result,
        }
        for operation in OPERATIONS
    ]
