"""The names that statements of interpreter mode find: those of a running program at the place of the call.

Source: script manual 5.11, interpreter mode: the scope is inherited from where `interpreter_mode` is called,
and no new global variables are allowed. A plain assignment to a new name makes a variable of the interpreter
(U): later statements and the functions among them see it until all is cleared.
"""

from __future__ import annotations

from dataclasses import dataclass

from urscript.errors import ScriptCompileError, ScriptContextError
from urscript.names.scopes import FunctionScope, ResolvedProgram
from urscript.source import Source
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, all_expressions, all_statements, own_expressions

CALL = "interpreter_mode"
"""The builtin at whose call statements are accepted."""


@dataclass(frozen=True, slots=True)
class VisibleFunction:
    """A function or thread of the running program, or of an earlier statement.

    Attributes:
        python_name: Of what it is compiled to.
        kind: "def" or "thread".
        optional: Parameters that have a default.
        depth: Calls inside one another at most, from its own on.
    """

    name: str
    python_name: str
    kind: str
    parameters: tuple[str, ...]
    optional: frozenset[str]
    depth: int

    def as_scope(self) -> FunctionScope:
        """A scope without a body, for calls of it."""
        parameters = tuple(
            nodes.Parameter(name, nodes.NoneLiteral() if name in self.optional else None)
            for name in self.parameters
        )
        node = nodes.Function(self.kind, self.name, parameters, ())  # type: ignore[arg-type]
        return FunctionScope(self.name, node, None, (), self.python_name, depth=self.depth)


@dataclass(frozen=True, slots=True)
class LivingScope:
    """Names that statements can use.

    Attributes:
        functions: A later one hides an earlier one of the same name.
        variables: Locals of the function that calls `interpreter_mode`, and variables of the interpreter.
    """

    globals: frozenset[str] = frozenset()
    functions: tuple[VisibleFunction, ...] = ()
    variables: frozenset[str] = frozenset()

    def __len__(self) -> int:
        return len(self.globals) + len(self.functions) + len(self.variables)

    def with_names(self, added: LivingScope) -> LivingScope:
        """These names, and those of others, which hide them."""
        return LivingScope(
            self.globals | added.globals, self.functions + added.functions, self.variables | added.variables
        )

    def open(self, source: Source, block: Block, prefix: str) -> ResolvedProgram:
        """A program of these statements, to be resolved; Python names in it begin with `prefix`."""
        main = FunctionScope(CALL, None, None, block, f"{prefix}main")
        main.functions.update((function.name, function.as_scope()) for function in self.functions)
        return ResolvedProgram(
            source,
            "statements",
            CALL,
            main,
            globals=set(self.globals | self.variables),
            prefix=prefix,
            interpreted=set(self.variables),
        )

    def find_forbidden(self, program: ResolvedProgram) -> ScriptCompileError | None:
        """What statements must not do, although a program may."""
        for scope in program.scopes():
            for statement in all_statements(scope.body):
                if isinstance(statement, (nodes.Assign, nodes.Declaration)) and statement.scope == "global":
                    new = program.declared_globals.keys() - (self.globals - self.variables)
                    if new:
                        why = "interpreter mode has no new global variables"
                        text = f"'{min(new)}' cannot be declared: {why}"
                        return ScriptContextError(text).locate(program.source, *statement.span[:2])
                if _calls(statement) and scope.find_function(CALL) is None:
                    text = f"{CALL} cannot be called in interpreter mode: it cannot be nested"
                    return ScriptContextError(text).locate(program.source, *statement.span[:2])
        return None


def living_scopes(program: ResolvedProgram) -> dict[str, LivingScope]:
    """What statements find that arrive while a function of the program is in its call of `interpreter_mode`.

    Returns:
        The names by the Python name of the function; nothing for a program without such calls.
    """
    return {scope.python_name: _names_in(scope, program) for scope in calling_scopes(program)}


def calling_scopes(program: ResolvedProgram) -> list[FunctionScope]:
    """The functions that call `interpreter_mode`."""
    if CALL not in program.builtins:
        return []
    return [scope for scope in program.scopes() if any(map(_calls, all_statements(scope.body)))]


def new_names(program: ResolvedProgram, before: LivingScope) -> LivingScope:
    """What the statements of a resolved program add: their functions, and variables of the interpreter."""
    own = [function for function in program.functions if function.parent is program.main]
    functions = tuple(_visible(function) for function in own)
    return LivingScope(
        functions=functions, variables=frozenset(program.globals - before.globals - before.variables)
    )


def _names_in(scope: FunctionScope, program: ResolvedProgram) -> LivingScope:
    visible: dict[str, FunctionScope] = {}
    around: FunctionScope | None = scope
    while around is not None:
        visible = {**around.functions, **visible}
        around = around.parent
    functions = tuple(map(_visible, visible.values()))
    return LivingScope(frozenset(program.globals), functions, frozenset(scope.locals))


def _visible(scope: FunctionScope) -> VisibleFunction:
    assert scope.node is not None
    parameters = scope.node.parameters
    return VisibleFunction(
        scope.name,
        scope.python_name,
        scope.node.kind,
        tuple(item.name for item in parameters),
        frozenset(item.name for item in parameters if item.default is not None),
        scope.depth,
    )


def _calls(statement: nodes.Statement) -> bool:
    return any(
        isinstance(part, nodes.Call) and part.function == CALL
        for expression in own_expressions(statement)
        for part in all_expressions(expression)
    )
