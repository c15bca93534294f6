"""Interpreter mode: builtins that begin it, end it and clear what it has added to the program."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from ur_emulator.controller.interpreter_queue import InterpreterQueue
from urscript.errors import ScriptRuntimeError
from urscript.run.host import EnterMode


def interpreter_functions(queue: InterpreterQueue) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins.

    Args:
        queue: of the statements.
    """

    def interpreter_mode(thread: object, clear_queue_on_enter: bool, clear_on_end: bool) -> EnterMode:
        return partial(queue.enter, clear_queue=clear_queue_on_enter, clear_on_end=clear_on_end)

    def end_interpreter(thread: object) -> None:
        queue.end()

    def clear_interpreter(thread: object) -> None:
        if not queue.is_on:
            raise ScriptRuntimeError("clear_interpreter can only be called in interpreter mode")
        queue.clear()

    return {
        "interpreter_mode": interpreter_mode,
        "end_interpreter": end_interpreter,
        "clear_interpreter": clear_interpreter,
    }
