"""Statements of interpreter mode -> Python code that is linked into a running program.

They are compiled like a program whose variables and functions exist already (`names.living_scope`).
"""

import pickle
from dataclasses import dataclass, field

from urscript.catalogue import Catalogue
from urscript.compile.compiler import CompiledCode, compile_resolved
from urscript.dialect import dialect_for
from urscript.errors import ScriptSyntaxError
from urscript.names.living_scope import LivingScope, new_names
from urscript.names.resolver import resolve
from urscript.source import Source, as_bytes
from urscript.syntax.parser import parse

NO_NAMES = pickle.dumps(LivingScope())
"""What no statement has added yet."""


@dataclass(frozen=True, slots=True)
class CompiledStatements:
    """A line of statements, ready to be linked once; a record that can be pickled.

    Attributes:
        source: The line.
        entry: Python name of the function that runs them.
        depth: Calls inside one another that they allow, recursive ones aside.
        variables: Python names of the variables that they add.
        added: The names that the statements so far have added, these included; pickled, because they are only
            passed on to the next compilation.
        n_added: How many they are.
    """

    source: Source = field(repr=False)
    compiled: CompiledCode = field(repr=False)
    entry: str
    depth: int
    builtins: frozenset[str]
    variables: tuple[str, ...]
    added: bytes = field(repr=False)
    n_added: int


def compile_statements(
    text: str, number: int, scope: bytes, added: bytes, catalogue: Catalogue
) -> CompiledStatements:
    """Compile one line of statements.

    Args:
        text: The line, one character a byte.
        number: No other line of the same program has it.
        scope: The names at the call of `interpreter_mode`, a pickled `LivingScope`.
        added: The names that earlier statements have added, pickled.

    Raises:
        ScriptCompileError: The first error in the line.
    """
    source = Source(as_bytes(text), "<interpreter>")
    before: LivingScope = pickle.loads(scope)
    earlier: LivingScope = pickle.loads(added)
    visible = before.with_names(earlier)
    try:
        block = parse(source)
        program = visible.open(source, block, f"i{number}_")
        program, errors = resolve(block, source, catalogue, dialect_for(catalogue.version), program)
        forbidden = visible.find_forbidden(program)
        if errors or forbidden is not None:
            raise errors[0] if errors else forbidden  # type: ignore[misc]
        new = new_names(program, visible)
        program.interpreted |= new.variables
        compiled = compile_resolved(program, catalogue, f"<interpreter {number}>")
    except RecursionError:
        text = "the statements are nested too deeply"
        raise ScriptSyntaxError(text, line=1, column=1, source=source) from None
    now = earlier.with_names(new)
    return CompiledStatements(
        source=source,
        compiled=compiled,
        entry=program.main.python_name,
        depth=program.main.depth,
        builtins=frozenset(program.builtins),
        variables=tuple(map(program.python_name, sorted(new.variables))),
        added=pickle.dumps(now),
        n_added=len(now),
    )
