"""Clock: the time of the controller, counted in control cycles."""

from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

from ur_emulator.machine.models.robot_generation import RobotGeneration

# Date at which the controller starts: chosen, a box reads no clock, so that equal runs are equal.
CLOCK_EPOCH = datetime(2021, 11, 30, tzinfo=UTC)


@dataclass(slots=True)
class Clock:
    """Counts the cycles of the controller, and those in which a primary program ran and was not paused.

    Attributes:
        tick: number of the present cycle.
        period_s: duration of a control cycle [s].
    """

    generation: RobotGeneration
    tick: int
    program_tick: int = 0
    period_s: float = field(init=False)

    def __post_init__(self) -> None:
        self.period_s = self.generation.period_s

    @property
    def time(self) -> float:
        """Seconds since the controller started, at the end of the present cycle."""
        return self.generation.seconds(self.tick)


def clock_time(timestamp: float) -> datetime:
    """Return date and time of the controller, to the second, from the time of a cycle [s]."""
    return CLOCK_EPOCH + timedelta(seconds=int(timestamp))
