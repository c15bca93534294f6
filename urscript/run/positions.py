"""Positions in the script: of Python exceptions, which become errors of the script, and of suspended threads.

Compiled code carries lines and columns of the script, see `compile.python_tree`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import islice
from types import CodeType, FrameType, TracebackType
from typing import Any

from urscript.errors import ScriptRuntimeError, StackEntry
from urscript.run import elements
from urscript.run.threads import ScriptThread
from urscript.source import Source


def script_error(
    error: Exception, file_name: str, names: Mapping[str, str], source: Source
) -> ScriptRuntimeError:
    """The run-time error of the program for `error`, with its place and call stack.

    Where static types are known, compiled code uses Python's operators; their exceptions are translated here.

    Args:
        error: Exception of a thread.
        file_name: The pseudo file name of the compiled program.
        names: Python function name -> name in the script.
        source: The text of the program.
    """
    stack, innermost = _stack(error.__traceback__, file_name, names)
    if isinstance(error, ScriptRuntimeError):
        found = error
    elif innermost is not None and isinstance(error, IndexError):
        found = ScriptRuntimeError(_bad_index(innermost, stack[-1], source))
    elif innermost is not None and isinstance(error, ZeroDivisionError):
        found = ScriptRuntimeError("division by zero")
    elif isinstance(error, RecursionError):
        found = ScriptRuntimeError("calls are nested too deeply")
    else:
        found = ScriptRuntimeError(f"internal error of this box: {type(error).__name__}: {error}")
        found.__cause__ = error
    found.stack = tuple(stack)
    return found


def _bad_index(frame: FrameType, place: StackEntry, source: Source) -> str:
    """The message for an IndexError of a subscript, which is always a variable with a constant index."""
    form = re.match(r"(\w+)\s*\[\s*(\d+)", source.line(place.line)[place.column - 1 :])
    if form is not None:
        variable = frame.f_locals.get(f"v_{form[1]}", frame.f_globals.get(f"g_{form[1]}"))
        try:
            elements.item(variable, int(form[2]))
        except ScriptRuntimeError as error:
            return error.message
    return "index is out of range"


def _stack(
    traceback: TracebackType | None, file_name: str, names: Mapping[str, str]
) -> tuple[list[StackEntry], FrameType | None]:
    """The call stack in the script, outermost first, and the innermost frame if it is in the script."""
    stack: list[StackEntry] = []
    innermost = None
    while traceback is not None:
        innermost = traceback.tb_frame
        code = innermost.f_code
        if code.co_filename == file_name:
            line, column = _position(code, traceback.tb_lasti)
            stack.append(StackEntry(names.get(code.co_name, code.co_name), line, column))
        else:
            innermost = None
        traceback = traceback.tb_next
    return stack, innermost


def _position(code: CodeType, instruction: int) -> tuple[int, int]:
    """Line and column (from 1) of the instruction at byte offset `instruction`."""
    line, _, column, _ = next(islice(code.co_positions(), instruction // 2, None), (None,) * 4)
    return line or 1, 1 if column is None else column + 1


def thread_line(thread: ScriptThread, file_name: str) -> int:
    """The line of a suspended thread in the script, of the innermost call.

    Quick enough for every cycle; a position takes long in a long function.
    """
    frame = _script_frame(thread, file_name)
    return 1 if frame is None else frame.f_lineno


def thread_position(thread: ScriptThread, file_name: str) -> tuple[int, int]:
    """Line and column of a suspended thread."""
    frame = _script_frame(thread, file_name)
    return (1, 1) if frame is None else _position(frame.f_code, frame.f_lasti)


def _script_frame(thread: ScriptThread, file_name: str) -> FrameType | None:
    """The innermost frame of the script in a suspended thread."""
    innermost: FrameType | None = None
    body: Any = thread.body
    while body is not None and hasattr(body, "gi_frame"):
        frame = body.gi_frame
        if frame is not None and frame.f_code.co_filename == file_name:
            innermost = frame
        body = body.gi_yieldfrom
    return innermost
