"""From the text of a program, or from its file, to a program that can be started.

It takes longer than a cycle: these functions run in the worker process (`host.runtime.worker`), and all
that goes in and comes out can be pickled.
"""

from collections.abc import Mapping
from dataclasses import replace

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError
from ur_emulator.machine.controller.events import ScriptFailed
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.header import setup_script
from ur_emulator.program_files.installation import ExternalControlPc, Installation
from ur_emulator.program_files.installation_reader import load_installation
from ur_emulator.program_files.loading import LoadedProgram, load_program
from urscript import CompiledProgram, compile_program
from urscript.catalogue import Catalogue
from urscript.compile.interpreter_mode import CompiledStatements, compile_statements
from urscript.errors import ScriptError, ScriptTypeError

# A program that can be started, or why it cannot.
CompileResult = CompiledProgram | ScriptFailed


def compile_text(
    text: str, catalogue: Catalogue, name: str = "<program>", is_secondary: bool = False
) -> CompileResult:
    """Compile a program, given with one character a byte."""
    try:
        program = compile_program(text, catalogue=catalogue, name=name)
    except ScriptError as error:
        # Arguments are counted when the call runs, so that of a `sec` is one of its exceptions.
        secondary = is_secondary and isinstance(error, ScriptTypeError)
        # The log of a controller has the text only; people also want the place, and what would help.
        hint = f"; {error.hint}" if error.hint else ""
        log_text = f"{error.log_text} (line {error.line}, column {error.column}{hint})"
        return ScriptFailed(error.line, error.column, error.wire_text, secondary, log_text)
    compiled = program.compiled
    values = len(program.globals) + len(compiled.constants)
    for count, limit, what in (
        (len(compiled.code), BUDGETS.program_code, "bytes when compiled"),
        (len(compiled.function_names), BUDGETS.program_functions, "functions"),
        (values, BUDGETS.program_values, "global variables and poses"),
    ):
        if count > limit:
            return ScriptFailed(1, 1, f"the program has {count} {what}: at most {limit} are allowed")
    return program


def compile_line(
    text: str, number: int, scope: bytes, added: bytes, catalogue: Catalogue
) -> CompiledStatements | str:
    """Compile a line of interpreter mode, see `compile_statements`; return why it is discarded if it is."""
    try:
        return compile_statements(text, number, scope, added, catalogue)
    except ScriptError as error:
        return error.log_text


def compile_loaded(
    loaded: LoadedProgram, received: Mapping[ExternalControlPc, str], catalogue: Catalogue
) -> CompileResult:
    """Compile a program from a file, with the parts that PCs have sent."""
    try:
        text = loaded.script(received.__getitem__)
    except ProgramFileError as error:
        return ScriptFailed(1, 1, f"{loaded.file_name} cannot be compiled: {error}")
    outcome = compile_text(text, catalogue, loaded.file_name)
    if loaded.origin and isinstance(outcome, ScriptFailed):
        return replace(outcome, log_text=f"{outcome.log_text or outcome.text}; the script is {loaded.origin}")
    return outcome


def load_and_compile(
    folder: ProgramFolder, name: str, before: Installation, catalogue: Catalogue, skip_unknown: bool = False
) -> tuple[LoadedProgram, CompileResult | None, CompileResult | None]:
    """Read a program and its installation; compile it unless parts are undefined, or fetched when it starts.

    Return the program, what starts it, and what makes its installation effective in place of the one before;
    None if it is already. ProgramFileError: one of the files cannot be used.
    """
    loaded = load_program(folder, name, skip_unknown=skip_unknown)
    ready = None if loaded.pcs or loaded.undefined else compile_loaded(loaded, {}, catalogue)
    return loaded, ready, _set_up(loaded.installation or before, before, catalogue)


def load_installation_and_compile(
    folder: ProgramFolder, name: str, before: Installation, catalogue: Catalogue
) -> tuple[Installation, CompileResult | None]:
    """Read an installation; arguments, result and errors are those of `load_and_compile`."""
    installation = load_installation(folder, name)
    return installation, _set_up(installation, before, catalogue)


def _set_up(installation: Installation, before: Installation, catalogue: Catalogue) -> CompileResult | None:
    if installation == before:
        return None
    return compile_text(setup_script(installation, before), catalogue, "installation", is_secondary=True)
