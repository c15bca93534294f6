"""How long measurements are: in full, or so short that they only show that they run."""

from __future__ import annotations

import os
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Length:
    """The length of all measurements of a run.

    Attributes:
        minutes: of one client in real time.
        share: of the rounds, boxes and connections of the others.
    """

    minutes: float
    share: float

    @property
    def seconds(self) -> float:
        """Of many clients in real time: at most a minute [s]."""
        return 60.0 * min(self.minutes, 1.0)

    @property
    def is_whole(self) -> bool:
        """Whether nothing is left out."""
        return self.share == 1.0

    def part_of(self, number: int) -> int:
        """So many of that many rounds, boxes or connections, at least one."""
        return max(1, round(self.share * number))


FULL = Length(minutes=float(os.environ.get("BENCH_MINUTES", "10")), share=1.0)
SHORT = Length(minutes=0.02, share=0.001)
