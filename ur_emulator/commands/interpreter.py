"""Interpreter mode: what clients of its port do with the running program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ur_emulator.controller.command import Box

if TYPE_CHECKING:
    from urscript.compile.statements import CompiledStatements


@dataclass(frozen=True, slots=True)
class AppendStatements:
    """Add a compiled line to what the program runs in interpreter mode.

    Attributes:
        statements: compiled.
        epoch: of the queue, when its names were taken.
    """

    statements: CompiledStatements
    epoch: int

    def apply(self, box: Box) -> dict[str, int]:
        """Return its id; 0 if its names do not hold any more."""
        return {"id": box.state.interpreter.append(self.statements, self.epoch)}


@dataclass(frozen=True, slots=True)
class SkipStatements:
    """Drop the lines that have not begun."""

    def apply(self, box: Box) -> None:
        box.state.interpreter.skip()


@dataclass(frozen=True, slots=True)
class AbortMove:
    """End a movej or movel of any program; the instruction returns."""

    def apply(self, box: Box) -> None:
        box.state.motion.abort()
