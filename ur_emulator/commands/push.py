"""External forces on the flange, and a payload that no program has declared.

No client of a real box can send these; they are for tests and for people at the emulator.
"""

from __future__ import annotations

from ur_emulator.commands.operation import CommandOperation
from ur_emulator.commands.parameters import parameter
from ur_emulator.controller.command import Box
from ur_emulator.models.robot_model import Vector3

# The largest force limit of the safety settings [N]; about the length of a tool [m].
MAX_FORCE, MAX_LEVER = 250.0, 0.3


class Push(CommandOperation):
    """Push the flange as a hand would; a zero force ends it."""

    force: Vector3 = parameter("in base axes", "N", high=MAX_FORCE)
    point: Vector3 = parameter(
        "where it acts, in the flange frame", "m", high=MAX_LEVER, default=(0.0, 0.0, 0.0)
    )
    duration: float | None = parameter(
        "for so long in robot time; until the next push if left out", "s", 0.0, 600.0, default=None
    )

    def apply(self, box: Box) -> None:
        box.push.begin(self.force, self.point, self.duration)


class AttachPayload(CommandOperation):
    """Hang a load on the flange that no program has declared."""

    mass: float = parameter("of the load", "kg", 0.0, 20.0)
    cog: Vector3 = parameter(
        "centre of gravity in the flange frame", "m", high=MAX_LEVER, default=(0.0, 0.0, 0.0)
    )

    def apply(self, box: Box) -> None:
        box.plant.attach_load(self.mass, self.cog)
