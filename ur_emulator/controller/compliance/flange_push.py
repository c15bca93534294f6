"""FlangePush: an external force on the flange, for a time or until the next one."""

from __future__ import annotations

from ur_emulator.models.robot_model import Vector3
from ur_emulator.plant.plant import Plant

_NOTHING: Vector3 = (0.0, 0.0, 0.0)


class FlangePush:
    """Applies an external force and counts the cycles of one with a duration.

    Args:
        plant: the arm.
        period_s: duration of a cycle [s].
    """

    __slots__ = ("_cycles_left", "_period_s", "_plant")

    def __init__(self, plant: Plant, period_s: float) -> None:
        self._plant = plant
        self._period_s = period_s
        self._cycles_left = 0

    @property
    def will_end(self) -> bool:
        """True during a push with a duration."""
        return self._cycles_left > 0

    def begin(self, force: Vector3, point: Vector3, duration: float | None) -> None:
        """Push from this cycle on.

        Args:
            force: in base axes [N]; zero ends the push before.
            point: where it acts, in the flange frame [m].
            duration: of the push [s]; None: until the next one.
        """
        n_cycles = 0 if duration is None else round(duration / self._period_s)
        self._plant.push(force if duration is None or n_cycles else _NOTHING, point)
        self._cycles_left = n_cycles

    def step(self) -> None:
        """Count a cycle of a push with a duration; end it after the last."""
        self._cycles_left -= 1
        if not self._cycles_left:
            self._plant.push(_NOTHING)
