"""What came of a case, as it travels from worker to folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Status = Literal["done", "refused", "failed"]
Value = float | int | str | bool | None
Row = Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a case.

    Attributes:
        status: done; refused, because its gains are too large for the loop; or failed, and worth another try.
        error: why it is not done, one line.
        rows: figures of each repetition by column; of a refused case one with its delay and gain margin.
        recordings: file name and content of each recording that shall stay; of a failed case: all.
    """

    status: Status
    error: str = ""
    rows: tuple[Row, ...] = ()
    recordings: tuple[tuple[str, bytes], ...] = field(default=(), repr=False)


def failed(error: str, recordings: tuple[tuple[str, bytes], ...] = ()) -> Outcome:
    """A case that came to nothing."""
    return Outcome("failed", " ".join(error.split()), recordings=recordings)
