"""`run_program`: a program from its text or from a file in the folder of programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from protocol.ur_types import ProgramState
from ur_emulator.commands.operation import Kind, parameter
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
        RefusedError: the box does not run programs now, cannot use the file, or has begun a newer program;
            with `wait`: the program ended with an error.
    """

    script: str | Path | None = parameter(
        "text of a program, as sent to port 30002", kind=Kind.SCRIPT, default=None
    )
    file: str | None = parameter("or a file in the folder of programs, as for `load`", default=None)
    wait: bool = parameter("return when the program has ended, with its error if it has one", default=False)
    result: ClassVar[str] = "`program`: its name, and `tick`: the cycle in which it began"

    def steps(self, context: Context) -> Steps[Any]:
        """Compile and start a text, or play a file as the dashboard does; what runs is stopped before."""
        access, player, asked = context.access, context.player, context.clock()
        programs = access.controller.programs
        if (self.script is None) == (self.file is None):
            raise ArgumentError("run_program needs either script, the text, or file, a name")
        if self.file is not None:
            yield from player.load(self.file, stops=True)
            yield from player.play("127.0.0.1")
            assert programs.latest is not None
            program = programs.latest.program
        else:
            # The command line loads this module, too: nothing heavy at its top.
            from ur_emulator.controller.events import ScriptFailed
            from ur_emulator.program_files.compiling import compile_text

            catalogue = access.identity.software.catalogue
            outcome = yield from access.in_worker(compile_text, str(self.script), catalogue)
            if isinstance(outcome, ScriptFailed):
                raise ArgumentError(f"the program does not compile: {outcome.log_text or outcome.text}")
            program = outcome
            yield from access.start(program, asked)
        name, tick, run = program.name, access.snapshot.tick, programs.latest
        if self.wait and run is not None and run.program is program:  # a `sec` has ended already
            while programs.latest is run and access.snapshot.runtime_state != ProgramState.STOPPED:
                yield
            if run.error is not None:
                raise RefusedError(f"program {name} ended with an error: {run.error}")
        return {"program": name, "tick": tick}
