"""Commands to grippers, which are known by their unit; they are applied before the grippers' own cycle."""

from dataclasses import dataclass

from ur_emulator.errors import ArgumentError
from ur_emulator.machine.controller.command import BoxParts, Result

# What changes a gripper: of Robotiq `set`, of OnRobot the others.
OPERATIONS = frozenset({"set", "grip", "stop", "set_offset", "cycle_power"})


@dataclass(frozen=True, slots=True)
class OperateGrippers:
    """Have each gripper with one of the units do something; `values` are the arguments of the operation."""

    units: tuple[int, ...]
    operation: str
    values: tuple[object, ...] = ()

    def __post_init__(self) -> None:
        if self.operation not in OPERATIONS:
            raise ArgumentError(f"operation {self.operation!r} given: allowed are {sorted(OPERATIONS)}")

    def apply(self, box: BoxParts) -> None:
        for gripper in box.state.grippers:
            if gripper.unit in self.units:
                getattr(gripper, self.operation)(*self.values)


@dataclass(frozen=True, slots=True)
class ExchangeRegisters:
    """A request of Modbus to the gripper with that unit; its answer is the `pdu` of the result.

    An empty one is a cycle in which a request is on its way; it has no answer.
    """

    unit: int
    pdu: bytes

    def apply(self, box: BoxParts) -> Result:
        for gripper in box.state.grippers:
            if gripper.unit == self.unit and self.pdu:
                return {"pdu": gripper.answer(self.pdu)}
        return None
