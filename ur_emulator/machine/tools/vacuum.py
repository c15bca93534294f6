"""A suction cup: a digital output turns it on, a digital input says that its vacuum has been reached.

The vacuum builds up while the cup is on something, within `BUILD_UP`, and ends at once where it is not, or
when the output goes off. The cup holds in proportion to it.
"""

from ur_emulator.machine.controller.io.lines import InputOutput
from ur_emulator.machine.plant.hand import FingerCommand, FingerState
from ur_emulator.machine.tools.gripper import Gripper
from ur_hil.tools import ToolModel

BUILD_UP = 0.15  # s; to the full vacuum; programs wait .1 to .3 s for it (reference `grippers.md` 4)
_REACHED = 0.8  # share of the full vacuum from which the input is on; chosen


class VacuumGripper(Gripper):
    """The valve, which is a load of the output and not of the supply, and the pressure switch."""

    def __init__(self, tool: ToolModel, period: float) -> None:
        super().__init__(tool, period, unit=0)
        self._vacuum = 0.0

    def summary(self) -> dict[str, float]:
        """The vacuum as a share of the full one."""
        return {"vacuum": self._vacuum}

    def step(self, fingers: FingerState, has_power: bool, io: InputOutput) -> FingerCommand | None:
        """Advance by a cycle."""
        tool = self.tool
        sucks = has_power and io.read_digital_out(tool.output)
        on_object = sucks and fingers.share > 0.0
        self._vacuum = min(1.0, self._vacuum + self._period / BUILD_UP) if on_object else 0.0
        self.is_busy = on_object and self._vacuum < 1.0
        reached = self._vacuum >= _REACHED
        if io.read_digital_in(tool.input) is not reached:
            io.write_digital_in(tool.input, reached)
        return FingerCommand(0.0, 0.0, self._vacuum * tool.force[1])
