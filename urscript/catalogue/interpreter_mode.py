"""Builtins of interpreter mode: statements that arrive one by one while a program runs (e-Series only)."""

from __future__ import annotations

from .chapter import MANUAL_E, Chapter
from .types import Builtin, Param, ParamType, Support, TimeClass
from .versions import releases

_row = Chapter("interpreter_mode").row
_SOURCE = f"{MANUAL_E}, chapter Interpreter mode; first release: UR support page of interpreter mode"
_SINCE = releases(None, "5.10", "10.0")

ROWS: tuple[Builtin, ...] = (
    _row(
        "interpreter_mode",
        (
            Param("clearQueueOnEnter", ParamType.BOOL, True),
            Param("clearOnEnd", ParamType.BOOL, True),
        ),
        "None",
        "run the statements that arrive on port 30020",
        time=TimeClass.BLOCKING,
        since=_SINCE,
        support=Support.APPROXIMATE,
        note="most reasons of a discard, and the limits, are chosen",
        source=_SOURCE,
    ),
    _row(
        "end_interpreter",
        (),
        "None",
        "leave interpreter mode",
        since=_SINCE,
        support=Support.EXACT,
        source=_SOURCE,
    ),
    _row(
        "clear_interpreter",
        (),
        "None",
        "drop all interpreted statements",
        since=_SINCE,
        support=Support.EXACT,
        source=_SOURCE,
    ),
)
