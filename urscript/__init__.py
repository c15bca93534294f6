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
    from urscript.check.checking import check_program as check_program
    from urscript.errors import ScriptCompileError as ScriptCompileError
    from urscript.errors import ScriptError as ScriptError
    from urscript.errors import ScriptNameError as ScriptNameError
    from urscript.errors import ScriptRuntimeError as ScriptRuntimeError
    from urscript.errors import ScriptSyntaxError as ScriptSyntaxError
    from urscript.program import CompiledProgram as CompiledProgram
    from urscript.program import ProgramStatus as ProgramStatus
    from urscript.program import RunningProgram as RunningProgram
    from urscript.program import compile_program as compile_program
    from urscript.recording_host import RecordingHost as RecordingHost
    from urscript.run.host import Host as Host
    from urscript.run.host import HostFunction as HostFunction
    from urscript.run.threads import ScriptThread as ScriptThread
    from urscript.run.waits import NEXT_CYCLE as NEXT_CYCLE
    from urscript.run.waits import Blocked as Blocked
    from urscript.run.waits import Outside as Outside
    from urscript.values import Matrix as Matrix
    from urscript.values import Pose as Pose

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
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'urscript' has no attribute {name!r}")
    return getattr(import_module(f"urscript.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return __all__
