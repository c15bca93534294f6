"""The log of interpreter mode, as the files of a controller hold it.

Source: script manual 5.11: a line `e: <id_e> c: <id_a> : <statement>` for each acknowledged line, with the id
of the last one that had begun and its own; the names of the files, and what moves them. The first line of a
file is chosen.
"""

from __future__ import annotations

from typing import Final

_CURRENT: Final = "interpreter.log"
_BEFORE: Final = "interpreter.0.log"
_SAVED: Final = "interpreter.saved.log"
_FIRST_LINE: Final = "interpreter log\n"
# Characters that a file keeps; the oldest go.
_MOST: Final = 1 << 18


class InterpreterLog:
    """The three files."""

    def __init__(self) -> None:
        self._text: dict[str, str] = {}

    @property
    def files(self) -> dict[str, str]:
        """The text of each file that there is."""
        return dict(self._text)

    def add(self, last_executed: int, number: int, statements: str) -> None:
        """Append a line that was acknowledged."""
        self._append(_CURRENT, f"e: {last_executed} c: {number} : {statements}\n")

    def move(self) -> None:
        """All was cleared: the file takes the place of the one before."""
        if _CURRENT in self._text:
            self._text[_BEFORE] = self._text.pop(_CURRENT)

    def save(self) -> None:
        """The mode ended without clearing: the file is appended to what is saved."""
        if _CURRENT in self._text:
            self._append(_SAVED, self._text.pop(_CURRENT).removeprefix(_FIRST_LINE))

    def _append(self, name: str, text: str) -> None:
        self._text[name] = (self._text.get(name, _FIRST_LINE) + text)[-_MOST:]
