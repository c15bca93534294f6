"""URScript: the language of Universal Robots arms, compiled to Python and run one control cycle at a time.

    program = compile_program(text)
    running = program.start(host)
    while running.step() is ProgramStatus.RUNNING: ...

Knows no robot, no socket, no clock: effects come from a `Host`. Names are loaded when first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from ur_hil import check_packages

if TYPE_CHECKING:
    from urscript.check.checking import check_program
    from urscript.errors import (
        ScriptCompileError,
        ScriptError,
        ScriptNameError,
        ScriptRuntimeError,
        ScriptSyntaxError,
    )
    from urscript.program import CompiledProgram, ProgramStatus, RunningProgram, compile_program
    from urscript.recording_host import RecordingHost
    from urscript.run.host import Host, HostFunction
    from urscript.run.threads import ScriptThread
    from urscript.run.waits import NEXT_CYCLE, Blocked, Outside
    from urscript.values import Matrix, Pose

check_packages()

_NAMES: Final = {
    "check.checking": ("check_program",),
    "errors": (
        "ScriptCompileError", "ScriptError", "ScriptNameError", "ScriptRuntimeError", "ScriptSyntaxError"
    ),
    "program": ("CompiledProgram", "ProgramStatus", "RunningProgram", "compile_program"),
    "recording_host": ("RecordingHost",),
    "run.host": ("Host", "HostFunction"),
    "run.threads": ("ScriptThread",),
    "run.waits": ("NEXT_CYCLE", "Blocked", "Outside"),
    "values": ("Matrix", "Pose"),
}  # fmt: skip
_HOME: Final = {name: module for module, names in _NAMES.items() for name in names}
"""Which module each public name lives in."""

__all__ = [
    "NEXT_CYCLE",
    "Blocked",
    "CompiledProgram",
    "Host",
    "HostFunction",
    "Matrix",
    "Outside",
    "Pose",
    "ProgramStatus",
    "RecordingHost",
    "RunningProgram",
    "ScriptCompileError",
    "ScriptError",
    "ScriptNameError",
    "ScriptRuntimeError",
    "ScriptSyntaxError",
    "ScriptThread",
    "check_program",
    "compile_program",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'urscript' has no attribute {name!r}")
    return getattr(import_module(f"urscript.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return __all__
