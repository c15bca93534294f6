"""Parses texts without errors, several times as fast as lark does: the same grammar, table and tree builder.

lark generates the table and words the errors; this is only another loop over it. A text with an error is left
to lark, which says what is wrong and goes on behind it. What makes it quick: one regular expression for all
tokens, and chains of rules that only hand a value on (a number is a term is a sum is a comparison ...) are
followed once and remembered.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urscript.courtesy import give_way
from urscript.errors import ScriptSyntaxError
from urscript.source import Span

if TYPE_CHECKING:
    from lark import Lark

Reduction = tuple[int, str, Callable[[list[Any]], Any]]
"""How many values a rule takes, its name, what makes one value of them."""


class QuickToken(str):
    """A token: its text and its place."""

    __slots__ = ("span",)

    span: Span


class QuickParser:
    """The table of a lark parser with a basic lexer, ready for `parse`."""

    def __init__(self, lark: Lark) -> None:
        """Args: a parser with a transformer built in."""
        machine: Any = lark.parser.parser.parser
        table = machine.parse_table
        n_states = 1 + max(table.states)
        self._actions: list[dict[str, int | Reduction]] = [{} for _ in range(n_states)]
        self._handing_on: list[dict[str, str]] = [{} for _ in range(n_states)]
        self._followers: list[dict[str, int]] = [{} for _ in range(n_states)]
        self._chains: dict[tuple[int, int, str], int] = {}
        self._start, self._end = table.start_states["start"], table.end_states["start"]
        terminals = {item.name for item in lark.terminals} | {"$END"}
        for state, row in table.states.items():
            for token, (action, argument) in row.items():
                # Plain strings: lark's own compare more slowly.
                symbol = str(token)
                if symbol not in terminals:
                    self._followers[state][symbol] = argument
                elif action.name == "Shift":
                    self._actions[state][symbol] = argument
                elif _hands_on(argument):
                    self._handing_on[state][symbol] = str(argument.origin.name)
                else:
                    build = machine.callbacks[argument]
                    self._actions[state][symbol] = (len(argument.expansion), str(argument.origin.name), build)
        self._pattern, self._words = _pattern(lark)

    def parse(self, text: str) -> Any:
        """What the rule `start` makes of `text`; None if there is an error in it."""
        try:
            return self._parse(text)
        except ScriptSyntaxError:
            return None

    def _parse(self, text: str) -> Any:
        states = [self._start]
        values: list[Any] = []
        line, line_start = 1, 0
        step = give_way()
        words, feed = self._words, self._feed
        make_span = tuple.__new__  # what Span(...) does, without a call in between
        for match in self._pattern.finditer(text):
            kind = match.lastgroup
            start, end = match.span()
            if kind == "BLANK":
                n_lines = text.count("\n", start, end)
                if n_lines:
                    line += n_lines
                    line_start = text.rfind("\n", start, end) + 1
                continue
            if kind is None:
                return None
            if kind == "COMMENT":
                continue
            if step is not None and not start & 15:
                step()
            token = QuickToken(match[0])
            if kind == "NAME":
                kind = words.get(token, kind)
            token.span = make_span(Span, (line, start - line_start + 1, line, end - line_start + 1))
            if not feed(states, values, kind):
                return None
            values.append(token)
        return values[0] if feed(states, values, "$END") else None

    def _feed(self, states: list[int], values: list[Any], kind: str) -> bool:
        """Apply rules until `kind` can be shifted, and shift it; False if it cannot stand here."""
        actions, followers, chains = self._actions, self._followers, self._chains
        while True:
            state = states[-1]
            action = actions[state].get(kind)
            if action is None:
                if kind not in self._handing_on[state]:
                    return False
                key = states[-2], state, kind
                following = chains.get(key)
                if following is None:
                    following = chains[key] = self._follow(*key)
                states[-1] = following
            elif isinstance(action, int):
                states.append(action)
                return True
            else:
                size, name, build = action
                if size:
                    taken = values[-size:]
                    del values[-size:], states[-size:]
                else:
                    taken = []
                values.append(build(taken))
                following = followers[states[-1]][name]
                states.append(following)
                if following == self._end and kind == "$END":
                    return True

    def _follow(self, below: int, state: int, kind: str) -> int:
        """The state at the end of a chain of rules that hand one value on."""
        while kind in self._handing_on[state]:
            state = self._followers[below][self._handing_on[state][kind]]
        return state


def _hands_on(rule: Any) -> bool:
    """Whether a rule is `?name: other` and no more: its value is that of the other."""
    return len(rule.expansion) == 1 and rule.options.expand1 and rule.alias is None


def _pattern(lark: Lark) -> tuple[re.Pattern[str], dict[str, str]]:
    """One expression for all tokens, in lark's order of preference, and the words that are no names."""
    by_name = {item.name: item for item in lark.terminals}
    name = re.compile(by_name["NAME"].pattern.to_regexp())
    words = {
        item.pattern.value: item.name
        for item in lark.terminals
        if item.pattern.type == "str" and name.fullmatch(item.pattern.value)
    }
    others = [item for item in lark.terminals if item.name not in words.values()]
    others.sort(key=lambda it: (-it.priority, -it.pattern.max_width, -len(it.pattern.value), it.name))
    parts = [f"(?P<{item.name}>{item.pattern.to_regexp()})" for item in others]
    return re.compile("|".join([*parts, r"[\s\S]"])), words
