"""Where each instruction of a compiled function stands in the script.

Python finds a line or a column by reading the table of a function from its beginning, which takes 40 ms at
the end of 100,000 statements. This one is made once, when the program is compiled, and is searched by halves.
"""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from types import CodeType

_WORD = 2  # bytes of an instruction of Python
_MOST_COLUMNS = 0xFFFF


@dataclass(frozen=True, slots=True)
class PositionTable:
    """The positions of one function.

    Attributes:
        starts: Instructions at which another position begins, ascending.
        lines: In the script, from 1; of each start.
        columns: From 1.
    """

    starts: array[int]
    lines: array[int]
    columns: array[int]

    def at(self, offset: int) -> tuple[int, int]:
        """Line and column of the instruction at byte `offset`."""
        i = bisect_right(self.starts, offset // _WORD) - 1
        return (self.lines[i], self.columns[i]) if i >= 0 else (1, 1)


def position_tables(code: CodeType) -> dict[str, PositionTable]:
    """The table of each function that `code` defines, by the name of the function."""
    return {function.co_name: _table(function) for function in _functions(code)}


def _functions(code: CodeType) -> Iterator[CodeType]:
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield constant


def _table(code: CodeType) -> PositionTable:
    table = PositionTable(array("I"), array("I"), array("H"))
    last: tuple[int | None, int | None] | None = None
    for i, (line, _, column, _) in enumerate(code.co_positions()):
        if (line, column) != last:
            last = line, column
            table.starts.append(i)
            table.lines.append(line or 1)
            table.columns.append(min(_MOST_COLUMNS, 1 if column is None else column + 1))
    return table
