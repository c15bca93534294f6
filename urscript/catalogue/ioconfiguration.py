"""Builtins of the module "ioconfiguration": domains, input actions, outputs that follow the program."""

from __future__ import annotations

from .chapter import FIELD_USE, POLYSCOPE_EXPORT, Chapter
from .types import Builtin, Param, ParamType, Support
from .versions import CB3_ONLY, NOT_CB3, Generation, PerGeneration

_row = Chapter("ioconfiguration").row

EXACT, APPROXIMATE = Support.EXACT, Support.APPROXIMATE
INT, NUMBER, STRING, LIST = ParamType.INT, ParamType.NUMBER, ParamType.STRING, ParamType.LIST

_KEPT = "kept as configuration; without effect, since the arm is not guided by hand"
_ACTION = Param("action", STRING, choices=("default", "freedrive"))
_DOMAIN = Param("domain", INT, unit="0 current 4-20 mA, 1 voltage 0-10 V", low=0, high=1)
_RUNSTATE_UNIT = "0 keep, 1 low when stopped, 2 high when stopped, 3 high running and low stopped"


def _port(last: int, name: str = "port") -> Param:
    return Param(name, INT, unit=f"0 to {last}", low=0, high=last)


_ACTIONS: tuple[Builtin, ...] = (
    _row(
        "set_standard_analog_input_domain",
        (_port(1), _DOMAIN),
        "None",
        "current or voltage input",
        support=EXACT,
    ),
    _row(
        "set_tool_analog_input_domain",
        (_port(1), _DOMAIN),
        "None",
        "current or voltage input of the tool",
        support=EXACT,
    ),
    _row(
        "set_analog_outputdomain",
        (_port(1), _DOMAIN),
        "None",
        "current or voltage output",
        support=EXACT,
    ),
    _row(
        "set_input_actions_to_default",
        (),
        "None",
        "no input does anything beside being read",
        support=APPROXIMATE,
        note=_KEPT,
    ),
    _row(
        "set_standard_digital_input_action",
        (_port(7), _ACTION),
        "None",
        "what an input does",
        support=APPROXIMATE,
        note=_KEPT,
    ),
    _row(
        "set_configurable_digital_input_action",
        (_port(7), _ACTION),
        "None",
        "what an input does",
        support=APPROXIMATE,
        note=_KEPT,
    ),
    _row(
        "set_tool_digital_input_action",
        (_port(1), _ACTION),
        "None",
        "what an input does",
        support=APPROXIMATE,
        note=_KEPT,
    ),
    _row(
        "set_gp_boolean_input_action",
        (_port(127), _ACTION),
        "None",
        "what an input register does",
        support=APPROXIMATE,
        note=_KEPT,
    ),
)


def _runstate_rows(since: PerGeneration, last_choice: int) -> tuple[Builtin, ...]:
    """The output rules; e-Series adds 4 (low on unscheduled stop) and 5 (high from start)."""
    state = Param("state", INT, unit=_RUNSTATE_UNIT, low=0, high=last_choice)
    outputs = (
        ("standard_digital_output", 7),
        ("configurable_digital_output", 7),
        ("tool_digital_output", 1),
        ("standard_analog_output", 1),
        ("gp_boolean_output", 127),
    )
    return (
        *tuple(
            _row(
                f"set_runstate_{output}_to_value",
                (_port(last, "outputId"), state),
                "None",
                "what an output does when programs start and stop",
                since=since,
                support=EXACT,
            )
            for output, last in outputs
        ),
        _row(
            "modbus_set_runstate_dependent_choice",
            (
                Param("signal_name", STRING),
                Param("runstate_choice", INT, unit=_RUNSTATE_UNIT, low=0, high=last_choice),
            ),
            "None",
            "what a Modbus output does when programs start and stop",
            since=since,
            support=EXACT,
        ),
    )


_REGISTERS: tuple[Builtin, ...] = tuple(
    _row(
        f"set_runstate_gp_{kind}_output_to_value",
        (_port(47, "outputId"), Param("state", NUMBER, unit="0 keep, 1 zero when stopped, 2 or 3 one")),
        "None",
        "what an output register does when programs start and stop",
        since=CB3_ONLY,
        support=EXACT,
    )
    for kind in ("integer", "float")
)

_UNDOCUMENTED: tuple[Builtin, ...] = tuple(
    _row(
        name,
        (Param("outputs", LIST),),
        "None",
        "which outputs follow the program",
        support=APPROXIMATE,
        note="listed outputs go low when the program stops; chosen: the others follow nothing",
        undocumented=(Generation.CB3, Generation.E_SERIES),
        source=source,
    )
    for name, source in (
        ("set_runstate_standard_digital_outputs", POLYSCOPE_EXPORT),
        ("set_runstate_configurable_digital_outputs", POLYSCOPE_EXPORT),
        ("set_runstate_outputs", FIELD_USE),
    )
)

ROWS: tuple[Builtin, ...] = (
    _ACTIONS + _runstate_rows(CB3_ONLY, 3) + _runstate_rows(NOT_CB3, 5) + _REGISTERS + _UNDOCUMENTED
)
