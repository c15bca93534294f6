"""Analyses of the call graph: which functions may block, which are recursive.

Both visit every call once, so that the time is linear in the length of the program.
"""

from __future__ import annotations

from collections.abc import Iterator

from urscript.names.scopes import FunctionScope, ResolvedProgram


def spread_blocking(program: ResolvedProgram) -> None:
    """Mark the functions that may block because one that they call may."""
    callers: dict[FunctionScope, list[FunctionScope]] = {}
    for scope in program.scopes():
        for callee in scope.callees:
            callers.setdefault(callee, []).append(scope)
    todo = [scope for scope in program.scopes() if scope.blocks]
    while todo:
        for caller in callers.get(todo.pop(), ()):
            if not caller.blocks:
                caller.blocks = True
                todo.append(caller)


def mark_recursion(program: ResolvedProgram) -> None:
    """Mark the functions that can call themselves, directly or through others."""
    search = _Components()
    for scope in program.functions:
        search.visit(scope)


class _Components:
    """Tarjan's search for functions that all reach one another, without recursion of its own."""

    def __init__(self) -> None:
        self._number: dict[FunctionScope, int] = {}
        # The oldest open function that can be reached from each.
        self._low: dict[FunctionScope, int] = {}
        self._open: list[FunctionScope] = []
        self._is_open: set[FunctionScope] = set()
        self._path: list[tuple[FunctionScope, Iterator[FunctionScope]]] = []

    def visit(self, root: FunctionScope) -> None:
        """Visit `root` and everything it calls that was not visited yet."""
        if root in self._number:
            return
        self._enter(root)
        while self._path:
            scope, callees = self._path[-1]
            for callee in callees:
                if callee not in self._number:
                    self._enter(callee)
                    break
                if callee in self._is_open:
                    self._low[scope] = min(self._low[scope], self._number[callee])
            else:
                self._leave()

    def _enter(self, scope: FunctionScope) -> None:
        self._number[scope] = self._low[scope] = len(self._number)
        self._open.append(scope)
        self._is_open.add(scope)
        self._path.append((scope, iter(scope.callees)))

    def _leave(self) -> None:
        scope, _ = self._path.pop()
        if self._path:
            caller = self._path[-1][0]
            self._low[caller] = min(self._low[caller], self._low[scope])
        if self._low[scope] != self._number[scope]:
            return
        alone = self._open[-1] is scope
        while True:
            member = self._open.pop()
            self._is_open.discard(member)
            member.recursive = not alone or member in member.callees
            if member is scope:
                return
