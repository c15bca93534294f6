"""Commands for what surrounds the arm: levels at inputs, forces and loads on the flange, obstacles.

No client of a real box can send these; they are for tests and for people at the emulator.
"""

from collections.abc import Sequence
from math import hypot
from typing import Literal

from ur_emulator.errors import ArgumentError, RefusedError
from ur_emulator.machine.commands.operation import CommandOperation, parameter, within
from ur_emulator.machine.controller.command import BoxParts, refuse
from ur_emulator.machine.controller.io.lines import ANALOG_RANGE, DIGITAL_GROUPS
from ur_emulator.machine.models.robot_model import Vector3, six
from ur_emulator.machine.models.things import SIZES, SLIDING_FRICTION, Thing


class SetDigitalInput(CommandOperation):
    """Let a digital input be high or low from now on."""

    group: Literal["standard", "configurable", "tool"] = parameter("which inputs")
    n: int = parameter("number of the input: 0 to 7, of the tool 0 to 1", low=0, high=7)
    level: bool = parameter("high or low")

    def check_together(self) -> None:
        count = DIGITAL_GROUPS[self.group].count
        if self.n >= count:
            raise ArgumentError(f"{self.group} digital input {self.n} given: allowed are 0 to {count - 1}")

    def apply(self, box: BoxParts) -> None:
        box.state.io.write_digital_in(DIGITAL_GROUPS[self.group].bits[self.n], self.level)


class SetAnalogInput(CommandOperation):
    """Let an analogue input have a voltage or a current from now on."""

    group: Literal["standard", "tool"] = parameter("which inputs")
    n: int = parameter("number of the input", low=0, high=1)
    value: float = parameter("in V, or in A where the input measures current", low=0.0, high=10.0)

    def apply(self, box: BoxParts) -> None:
        io = box.state.io
        line = (io.analog_in if self.group == "standard" else io.tool_analog_in)[self.n]
        low, high = ANALOG_RANGE[line.domain]
        if (value := within(self.value, low, high)) is None:
            raise RefusedError(
                f"{self.value:g} given for {self.group} analog input {self.n}, which measures {low:g} to "
                f"{high:g} {'V' if line.domain else 'A'} now"
            )
        line.value = value


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

    def apply(self, box: BoxParts) -> None:
        box.plant.push(self.force, self.point, self.duration)


class AttachPayload(CommandOperation):
    """Hang a load on the flange that no program has declared."""

    mass: float = parameter("of the load", "kg", 0.0, 20.0)
    cog: Vector3 = parameter(
        "centre of gravity in the flange frame", "m", high=MAX_LEVER, default=(0.0, 0.0, 0.0)
    )

    def apply(self, box: BoxParts) -> None:
        box.plant.attach_load(self.mass, self.cog)


Shape = Literal["box", "sphere", "capsule", "plane"]
_MIDDLE = "of its middle in the base frame, position in m and rotation vector in rad"
# How far away, how small and how large [m].
FARTHEST, SMALLEST, LARGEST = 5.0, 0.001, 5.0


class AddObstacle(CommandOperation):
    """Put a fixed obstacle somewhere; one of the same name is replaced."""

    name: str = parameter("to remove it by")
    shape: Shape = parameter("what it is; a plane has no end")
    size: Sequence[float] = parameter(
        "box: three edges; sphere: radius; capsule: radius, length; plane: none", "m", lengths=(0, 3)
    )
    pose: Sequence[float] = parameter(_MIDDLE, lengths=(6, 6))

    def check_together(self) -> None:
        if not self.name:
            raise ArgumentError("obstacle without a name given: it needs one, to be removed by")
        _check_body(f"obstacle {self.name}", self.shape, self.size, self.pose)

    def apply(self, box: BoxParts) -> None:
        _put(box, Thing(self.name, self.shape, tuple(self.size), 0.0, SLIDING_FRICTION, six(self.pose)))


def _check_body(what: str, shape: str, size: Sequence[float], pose: Sequence[float]) -> None:
    wanted = SIZES[shape]
    if len(size) != len(wanted) or any(within(value, SMALLEST, LARGEST) is None for value in size):
        raise ArgumentError(
            f"{what}: size {list(size)} given: a {shape} needs {len(wanted)} numbers "
            f"({', '.join(wanted) or 'none'}), each {SMALLEST:g} to {LARGEST:g} m"
        )
    _check_distance(what, pose)


def _put(box: BoxParts, thing: Thing) -> None:
    try:
        box.plant.put(thing)
    except RefusedError as refusal:
        refuse(box.state, str(refusal))


def _check_distance(what: str, pose: Sequence[float]) -> None:
    if within(hypot(*pose[:3]), high=FARTHEST) is None:
        raise ArgumentError(
            f"{what}: pose {list(pose)} given: six finite numbers x, y, z, rx, ry, rz are needed, at most "
            f"{FARTHEST:g} m away"
        )


class RemoveObstacle(CommandOperation):
    """Take an obstacle away."""

    name: str = parameter("of the obstacle")

    def apply(self, box: BoxParts) -> None:
        box.plant.physics.scene.remove("obstacle", self.name)


ThingShape = Literal["box", "cylinder", "sphere"]


class AddThing(CommandOperation):
    """Put a body with a mass somewhere, at rest; one of the same name is replaced."""

    name: str = parameter("to move and remove it by")
    shape: ThingShape = parameter("what it is")
    size: Sequence[float] = parameter(
        "box: three edges; cylinder: radius, length; sphere: radius", "m", lengths=(0, 3)
    )
    mass: float = parameter("evenly distributed", "kg", 0.001, 100.0)
    pose: Sequence[float] = parameter(_MIDDLE, lengths=(6, 6))
    friction: float = parameter(
        "coefficient of its surface; the pads of a tool have their own", low=0.0, high=2.0, default=0.5
    )

    def check_together(self) -> None:
        if not (self.name and self.name.isprintable() and len(self.name) <= 60):
            raise ArgumentError(f"name {ascii(self.name)[:60]} of a thing given: 1 to 60 printed characters")
        _check_body(f"thing {self.name}", self.shape, self.size, self.pose)

    def apply(self, box: BoxParts) -> None:
        size, pose = tuple(self.size), six(self.pose)
        _put(box, Thing(self.name, self.shape, size, self.mass, self.friction, pose))


class MoveThing(CommandOperation):
    """Put a thing elsewhere, at rest."""

    name: str = parameter("of the thing")
    pose: Sequence[float] = parameter("as of `add_thing`", lengths=(6, 6))

    def check_together(self) -> None:
        _check_distance(f"thing {self.name}", self.pose)

    def apply(self, box: BoxParts) -> None:
        box.plant.physics.scene.move(self.name, six(self.pose))


class RemoveThing(CommandOperation):
    """Take a thing away."""

    name: str = parameter("of the thing")

    def apply(self, box: BoxParts) -> None:
        box.plant.physics.scene.remove("thing", self.name)
