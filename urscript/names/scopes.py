"""What the resolver finds out about a program: its functions, where each name lives, what may block.

Plain records, filled by `resolver`, read by `inference` and `compiler`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from urscript.source import Source
from urscript.syntax.nodes import Block, Function, Statement


@dataclass(eq=False, slots=True)
class FunctionScope:
    """The program body, a function or a thread, and the names that live in it.

    Attributes:
        name: As in the program; the body of the program has its name.
        node: The definition; None for a program without `def` around it.
        parent: The scope the definition stands in; None for the program body.
        body: Its statements.
        python_name: Name of the Python function it is compiled to.
        functions: Functions and threads defined directly in it.
        locals: Variables that live in one call of it; the program body has none, its variables are global.
        unsure: Locals that may be read before anything was assigned to them.
        callees: User functions it calls.
        blocks: A call of it may take time.
        recursive: It can call itself, directly or through others.
    """

    name: str
    node: Function | None
    parent: FunctionScope | None
    body: Block
    python_name: str
    functions: dict[str, FunctionScope] = field(default_factory=dict)
    locals: set[str] = field(default_factory=set)
    unsure: set[str] = field(default_factory=set)
    callees: set[FunctionScope] = field(default_factory=set)
    blocks: bool = False
    recursive: bool = False

    @property
    def is_thread(self) -> bool:
        """Whether it is a `thread` definition."""
        return self.node is not None and self.node.kind == "thread"

    def around(self) -> FunctionScope:
        """Where the defaults of its parameters are looked up: functions of the scope around, globals only."""
        return FunctionScope(self.name, None, self.parent, (), f"{self.python_name}_default")

    def find_function(self, name: str) -> FunctionScope | None:
        """The function of that name visible here: own ones, then those of the scopes around."""
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
    """A program whose names are all known.

    Attributes:
        kind: "def", "sec", or "statement" for text without a definition around it.
        name: The `def` name; for a statement the function it calls.
        main: The program body.
        calls_after: Calls of the program itself below its definition; they are no part of it.
        functions: All functions and threads, in the order of the text.
        globals: All global variables.
        declared_globals: Those that the word `global` makes (the keys), in the order of the text.
        unsure_globals: Those that may be read before anything was assigned to them.
        builtins: Builtin functions the program uses.
    """

    source: Source
    kind: str
    name: str
    main: FunctionScope
    calls_after: tuple[Statement, ...] = ()
    functions: list[FunctionScope] = field(default_factory=list)
    globals: set[str] = field(default_factory=set)
    declared_globals: dict[str, None] = field(default_factory=dict)
    unsure_globals: set[str] = field(default_factory=set)
    builtins: set[str] = field(default_factory=set)

    def scopes(self) -> list[FunctionScope]:
        """The program body and all functions."""
        return [self.main, *self.functions]
