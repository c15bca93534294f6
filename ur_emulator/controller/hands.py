"""What hands do to the arm, as commands: push the flange, hang something on it, ask to guide it.

No client of a real box can send the first two; they are for tests and for people at the emulator. They are
checked when they are made, so that nothing absurd ever reaches the physics.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isfinite

from ur_emulator.errors import PlantError
from ur_emulator.models.robot_model import Vector3

# What an arm is made to stand: the largest force limit of the safety settings [N], about a tool's length [m].
MAX_PUSH, MAX_LEVER = 250.0, 0.3
MAX_LOAD = 20.0  # kg
MAX_PUSH_TIME = 600.0  # s


@dataclass(frozen=True, slots=True)
class Push:
    """Push the flange from now on; a zero force ends it.

    Attributes:
        force: in base axes [N], up to MAX_PUSH.
        point: where it acts, in the flange frame [m], up to MAX_LEVER away.
        duration: for so long [s], up to MAX_PUSH_TIME; None until the next push.

    Raises:
        PlantError: for anything else.
    """

    force: Vector3
    point: Vector3 = (0.0, 0.0, 0.0)
    duration: float | None = None

    def __post_init__(self) -> None:
        if self.duration is not None and not 0.0 <= self.duration <= MAX_PUSH_TIME:
            raise PlantError(f"push of {self.duration:g} s given: allowed are 0 to {MAX_PUSH_TIME:g} s")
        _check("push", "N", self.force, MAX_PUSH)
        _check("push at", "m", self.point, MAX_LEVER)


@dataclass(frozen=True, slots=True)
class HangLoad:
    """Hang a payload on the flange without a word to the controller; from then on programs only declare one.

    Attributes:
        mass: [kg], up to MAX_LOAD.
        cog: centre of gravity in the flange frame [m], up to MAX_LEVER away.

    Raises:
        PlantError: for anything else.
    """

    mass: float
    cog: Vector3 = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not 0.0 <= self.mass <= MAX_LOAD:
            raise PlantError(f"load of {self.mass:g} kg given: allowed are 0 to {MAX_LOAD:g} kg")
        _check("load at", "m", self.cog, MAX_LEVER)


@dataclass(frozen=True, slots=True)
class GuideByHand:
    """Go into freedrive, as `set robotmode freedrive` asks; `set robotmode run` ends it."""


def _check(what: str, unit: str, vector: Vector3, most: float) -> None:
    if not (len(vector) == 3 and all(map(isfinite, vector)) and hypot(*vector) <= most):
        raise PlantError(
            f"{what} {list(vector)} {unit} given: three numbers are needed, together at most {most:g} {unit}"
        )
