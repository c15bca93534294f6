"""Builtins of interpreter mode: statements that arrive one by one while a program runs (e-Series only)."""

from __future__ import annotations

from .chapter import MANUAL_E, Chapter
from .types import Builtin, Param, ParamType, TimeClass
from .versions import NOT_CB3

_row = Chapter("interpreter_mode").row
# The release that brought it is not known; it is documented in 5.11.
_SOURCE = f"{MANUAL_E}, chapter Interpreter mode"

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
        since=NOT_CB3,
        source=_SOURCE,
    ),
    _row("end_interpreter", (), "None", "leave interpreter mode", since=NOT_CB3, source=_SOURCE),
    _row("clear_interpreter", (), "None", "drop all interpreted statements", since=NOT_CB3, source=_SOURCE),
)
