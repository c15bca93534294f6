"""`run_program`: a program from its text or from a file in the folder of programs."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ur_emulator.commands.parameters import Kind, parameter
from ur_emulator.commands.programs import StartProgram
from ur_emulator.control.step_operation import Context, StepOperation
from ur_emulator.errors import ArgumentError, RefusedError

if TYPE_CHECKING:
    from ur_emulator.servers.steps import Steps


def read_script(path: Path) -> str:
    """Return the text of a program file of this machine.

    Raises:
        ArgumentError: it is UTF-16.
        OSError: it cannot be read.
    """
    from urscript.source import as_utf8, program_text

    try:
        return as_utf8(program_text(path.read_bytes(), str(path)))
    except ValueError as error:
        raise ArgumentError(str(error)) from None


class RunProgram(StepOperation[int]):
    """Run a program in place of the one that runs.

    In Python the script may also be the path of a file of this machine.

    Raises:
        ArgumentError: the program does not compile.
        RefusedError: the box does not run programs now, or cannot use the file.
    """

    script: str | Path | None = parameter(
        "text of a program, as sent to port 30002", kind=Kind.SCRIPT, default=None
    )
    file: str | None = parameter("or a file in the folder of programs, as for `load`", default=None)
    result: ClassVar[str] = "`program`: its name, and `tick`: the cycle in which it began"

    def steps(self, context: Context) -> Steps[Any]:
        """Compile and start a text, or play a file as the dashboard does; what runs is stopped before."""
        access, player = context.access, context.player
        if (self.script is None) == (self.file is None):
            raise ArgumentError("run_program needs either script, the text, or file, a name")
        if self.file is not None:
            with suppress(RefusedError):  # when the controller is not up, `play` refuses
                yield from player.stop()
            yield from player.load(self.file)
            yield from player.play("127.0.0.1")
            name = access.controller.programs.name
        else:
            # The command line loads this module, too: nothing heavy at its top.
            from ur_emulator.controller.events import ScriptFailed
            from ur_emulator.programs.compiling import compile_text

            catalogue = access.identity.software.catalogue
            program = yield from access.in_worker(compile_text, str(self.script), catalogue)
            if isinstance(program, ScriptFailed):
                raise ArgumentError(f"the program does not compile: {program.log_text or program.text}")
            yield from access.apply(StartProgram(program))
            name = program.name
        return {"program": name, "tick": access.snapshot.tick}
