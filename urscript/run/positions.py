"""Positions in the script: of Python exceptions, which become errors of the script, and of suspended threads.

Compiled code carries lines and columns of the script, see `compile.python_tree`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import FrameType, TracebackType
from typing import Any

from urscript.compile.compiler import CompiledCode
from urscript.errors import ScriptRuntimeError, StackEntry
from urscript.run import elements
from urscript.run.threads import ScriptThread
from urscript.source import Source

Texts = Mapping[str, tuple[CompiledCode, Source]]
"""Code and text of a program and of what is linked into it, by pseudo file name."""


def script_error(error: Exception, texts: Texts) -> ScriptRuntimeError:
    """The run-time error of the program for `error`, with its place and call stack.

    Where static types are known, compiled code uses Python's operators; their exceptions are translated here.

    Args:
        error: Exception of a thread.
        texts: That the thread runs.
    """
    stack, innermost, source = _stack(error.__traceback__, texts)
    if isinstance(error, ScriptRuntimeError):
        found = error
    elif innermost is not None and isinstance(error, IndexError):
        assert source is not None
        found = ScriptRuntimeError(_bad_index(innermost, stack[-1], source))
    elif innermost is not None and isinstance(error, ZeroDivisionError):
        found = ScriptRuntimeError("division by zero")
    elif isinstance(error, RecursionError):
        found = ScriptRuntimeError("calls are nested too deeply")
    else:
        found = ScriptRuntimeError(f"internal error of this box: {type(error).__name__}: {error}")
        found.__cause__ = error
    found.stack = tuple(stack)
    found.source = source
    return found


def _bad_index(frame: FrameType, place: StackEntry, source: Source) -> str:
    """The message for an IndexError of a subscript, which is always a variable with a constant index."""
    form = re.match(r"(\w+)\s*\[\s*(\d+)", source.line(place.line)[place.column - 1 :])
    if form is not None:
        names = f"v_{form[1]}", f"l_{form[1]}", f"g_{form[1]}"
        found = {**frame.f_globals, **frame.f_locals}
        variable = next((found[name] for name in names if name in found), None)
        try:
            elements.item(variable, int(form[2]))
        except ScriptRuntimeError as error:
            return error.message
    return "index is out of range"


def _stack(
    traceback: TracebackType | None, texts: Texts
) -> tuple[list[StackEntry], FrameType | None, Source | None]:
    """The call stack in the script, outermost first, the innermost frame if it is in the script, its text."""
    stack: list[StackEntry] = []
    innermost = source = None
    while traceback is not None:
        innermost = traceback.tb_frame
        code = innermost.f_code
        if code.co_filename in texts:
            program, source = texts[code.co_filename]
            name = code.co_name
            line, column = program.positions[name].at(traceback.tb_lasti)
            stack.append(StackEntry(program.function_names.get(name, name), line, column))
        else:
            innermost = None
        traceback = traceback.tb_next
    return stack, innermost, source


def thread_position(thread: ScriptThread, program: CompiledCode) -> tuple[int, int]:
    """Line and column of a suspended thread, of the innermost call in the script."""
    innermost: FrameType | None = None
    body: Any = thread.body
    while body is not None and hasattr(body, "gi_frame"):
        frame = body.gi_frame
        if frame is not None and frame.f_code.co_filename == program.file_name:
            innermost = frame
        body = body.gi_yieldfrom
    if innermost is None:
        return 1, 1
    return program.positions[innermost.f_code.co_name].at(innermost.f_lasti)
