"""The variables of an installation, which keep the values that programs leave in them."""

from __future__ import annotations

from collections.abc import Mapping

from ur_emulator.controller.programs import Programs
from ur_emulator.programs.variables_file import literal
from ur_emulator.servers.steps import Steps


def values_at_end(programs: Programs, variables: Mapping[str, str]) -> Steps[dict[str, str]]:
    """Wait for the end of the program that runs; return the values that the variables have then.

    Args:
        programs: of the box.
        variables: name and value, as a literal; one that the program does not declare keeps it.
    """
    run = programs.latest
    while programs.is_running and programs.latest is run:
        yield
    if run is None:
        return dict(variables)
    declared = set(run.program.declared_globals)
    return {
        name: (literal(run.read_global(name)) if name in declared else "") or old
        for name, old in variables.items()
    }
