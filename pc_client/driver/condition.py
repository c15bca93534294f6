"""One thing that a robot must fulfil before it moves: what it reports, what is needed, what to do. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition, held against what the robot reports.

    Attributes:
        name: of the quantity, as on the pendant or in UR's manuals.
        reported: what it is; empty when the robot does not report it.
        needed: what it must be.
        remedy: what to do when it is not.
        holds: whether it is; None when the robot does not report it.
    """

    name: str
    reported: str
    needed: str
    remedy: str
    holds: bool | None

    @property
    def complaint(self) -> str:
        """The one line that refuses the robot: what is, what must be, what to do."""
        return f"the robot's {self.name} is {self.reported}, must be {self.needed}; {self.remedy}"

    @property
    def verdict(self) -> str:
        """In a word or two."""
        return {True: "ok", False: "NOT OK", None: "not reported"}[self.holds]


def conditions_text(conditions: Iterable[Condition]) -> str:
    """All conditions as a table, one a line: name, what the robot reports, what is needed, the verdict."""
    rows = [(c.name, c.reported or "-", f"must be {c.needed}", c.verdict) for c in conditions]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )
