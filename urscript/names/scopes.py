"""The symbol tables of a program: its functions, the scope of each name, what may block.

`resolver` makes these records; `inference`, `compiler` and `check` read them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from urscript.catalogue.calls import CallSignature
from urscript.errors import ScriptTypeError
from urscript.source import Source
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Function, Statement


@dataclass(eq=False, slots=True)
class FunctionScope:
    """The program body, a function or a thread, and its names.

    Attributes:
        name: As in the program; the body of the program has its name.
        node: The definition; None for a program without `def` around it.
        parent: The enclosing scope; None for the program body.
        python_name: Name of the Python function it is compiled to.
        functions: Functions and threads defined directly in it.
        locals: Its local variables; the program body has none, its variables are global.
        maybe_unassigned: Locals that may be read before a value is assigned to them.
        callees: User functions it calls.
        blocks: A call may take time.
        recursive: It can call itself, directly or through others.
        depth: Calls inside one another at most, from its own on; recursive ones are counted as they happen.
    """

    name: str
    node: Function | None
    parent: FunctionScope | None
    body: Block
    python_name: str
    functions: dict[str, FunctionScope] = field(default_factory=dict)
    locals: set[str] = field(default_factory=set)
    maybe_unassigned: set[str] = field(default_factory=set)
    callees: set[FunctionScope] = field(default_factory=set)
    blocks: bool = False
    recursive: bool = False
    depth: int = 1

    @property
    def is_thread(self) -> bool:
        """Whether it is a `thread` definition."""
        return self.node is not None and self.node.kind == "thread"

    def default_scope(self) -> FunctionScope:
        """The scope of the defaults of its parameters: functions of the enclosing scope, globals only."""
        return FunctionScope(self.name, None, self.parent, (), f"{self.python_name}_default")

    def find_function(self, name: str) -> FunctionScope | None:
        """The visible function of that name: in this scope, then in the enclosing ones."""
        scope: FunctionScope | None = self
        while scope is not None:
            if name in scope.functions:
                return scope.functions[name]
            scope = scope.parent
        return None

    def visible_functions(self) -> Iterator[str]:
        """Names of all functions that can be called here, for suggestions."""
        scope: FunctionScope | None = self
        while scope is not None:
            yield from scope.functions
            scope = scope.parent


@dataclass(eq=False, slots=True)
class ResolvedProgram:
    """A program with its symbol tables.

    Attributes:
        kind: "def", "sec", or "statement" for text without a definition around it.
        name: The `def` name; for a statement the function it calls.
        calls_after: Calls of the program below its definition; they are not part of it.
        functions: All functions and threads, in the order of the text.
        declared_globals: Those that are declared with `global` (the keys), in the order of the text.
        maybe_unassigned_globals: Those that may be read before a value is assigned to them.
        prefix: Of the Python names of its functions and values.
        interpreted: Variables of interpreter mode, and locals of the function that called it; the statements
            of interpreter mode see them as globals.
    """

    source: Source
    kind: str
    name: str
    main: FunctionScope
    calls_after: tuple[Statement, ...] = ()
    functions: list[FunctionScope] = field(default_factory=list)
    globals: set[str] = field(default_factory=set)
    declared_globals: dict[str, None] = field(default_factory=dict)
    maybe_unassigned_globals: set[str] = field(default_factory=set)
    builtins: set[str] = field(default_factory=set)
    prefix: str = ""
    interpreted: set[str] = field(default_factory=set)

    @property
    def is_open(self) -> bool:
        """Whether other statements use its variables and functions too, or it uses those of others."""
        return self.kind == "statements" or "interpreter_mode" in self.builtins

    def python_name(self, name: str) -> str:
        """What the global variable `name` is called in Python."""
        return f"l_{name}" if name in self.interpreted else f"g_{name}"

    def is_variable(self, name: str, scope: FunctionScope) -> bool:
        """Whether `name` is a variable of the program in `scope`, so that it hides a builtin."""
        return name in scope.locals or name in self.globals

    def scopes(self) -> list[FunctionScope]:
        """The program body and all functions."""
        return [self.main, *self.functions]


def shape_of(arguments: tuple[nodes.Argument, ...]) -> tuple[int, tuple[str, ...]]:
    """Number of positional arguments, names of the named ones."""
    keywords = tuple(argument.name for argument in arguments if argument.name is not None)
    return len(arguments) - len(keywords), keywords


def signature_of(callee: FunctionScope) -> CallSignature:
    """Return the signature of a function of the program."""
    assert callee.node is not None
    names = [parameter.name for parameter in callee.node.parameters]
    optional = {parameter.name for parameter in callee.node.parameters if parameter.default is not None}
    return CallSignature(callee.node.name, names, optional)


def wrong_count(call: nodes.Call, callee: FunctionScope) -> str:
    """Return why a call has too many or too few arguments; an empty text if they fit.

    That is an error when the call is reached, not before: working programs of 3.15.8 have such calls. A wrong
    name of an argument is an error of the compiler.
    """
    try:
        signature_of(callee).check(*shape_of(call.arguments))
    except ScriptTypeError as error:
        return error.message
    return ""
