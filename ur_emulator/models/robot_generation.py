"""What a generation of robots has in common: the control cycle and the software; CB3 is one record.

Everything else in the box takes times in seconds, and cycles from here.
"""

from __future__ import annotations

from dataclasses import dataclass

from ur_emulator.errors import ModelError
from ur_emulator.models.software import CB3_BUILDS, Builds


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotGeneration:
    """Numbers of a generation.

    Attributes:
        name: as people write it, "CB3".
        period_us: control cycle [us], a whole multiple of the physics step.
        substep_us: physics step [us].
        major: first number of its software versions.
        default_version: what a box runs if the user names none.
        builds: first version, build and date of each row, oldest first.

    Raises:
        ModelError: the control cycle is no whole multiple of the physics step, or no part of a second.
    """

    name: str
    period_us: int
    substep_us: int
    major: int
    default_version: str
    builds: Builds

    def __post_init__(self) -> None:
        if self.substep_us <= 0 or self.period_us <= 0 or self.period_us % self.substep_us:
            raise ModelError(
                f"control cycle of {self.period_us} us given: a whole multiple of the physics step of "
                f"{self.substep_us} us is needed"
            )
        if 1_000_000 % self.period_us:
            raise ModelError(
                f"control cycle of {self.period_us} us given: a whole number of cycles a second is needed"
            )

    @property
    def period_s(self) -> float:
        """Control cycle [s]."""
        return self.period_us * 1e-6

    @property
    def cycle_rate(self) -> int:
        """Control cycles a second."""
        return 1_000_000 // self.period_us

    @property
    def n_substeps(self) -> int:
        """Physics steps in a control cycle."""
        return self.period_us // self.substep_us

    def cycles(self, duration: float) -> int:
        """Return the number of cycles nearest to a duration [s]."""
        return round(duration * 1_000_000 / self.period_us)

    def seconds(self, tick: int) -> float:
        """Return the seconds of so many cycles, without an accumulated rounding error."""
        return tick * self.period_us / 1e6


CB3 = RobotGeneration(
    name="CB3",
    period_us=8_000,
    substep_us=2_000,
    major=3,
    default_version="3.15.8",
    builds=CB3_BUILDS,
)
