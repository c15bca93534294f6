"""ScriptArm: the arm as the builtins that move it see it, and what they demand of their arguments."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any

from protocol.pose import Pose
from ur_emulator.controller.tool_settings import ToolSettings
from ur_emulator.kinematics.arm_model import ArmModel
from ur_emulator.models.robot_model import RobotModel, Vector6, six
from ur_emulator.motion.arm_motion import ArmMotion
from ur_emulator.motion.generators import Generator as MotionGenerator
from ur_emulator.motion.path_motion import OwnershipError
from ur_emulator.motion.tool import Tool
from urscript.errors import ScriptRuntimeError

# What a motion builtin is to the interpreter: a generator that yields once per cycle it lasts.
Cycles = Generator[Any, None, None]

# With less than this [SI units] no arm moves in a lifetime, and squares of it leave the floats.
LEAST_LIMIT = 1e-9


@dataclass(frozen=True, slots=True)
class ScriptArm:
    """The parts of the controller that move an arm.

    Attributes:
        robot: numbers of the arm.
        model: kinematics of the arm.
        motion: where the joints are asked to go, and by which thread.
        settings: TCP and payload.
    """

    robot: RobotModel
    model: ArmModel
    motion: ArmMotion
    settings: ToolSettings

    @property
    def tool(self) -> Tool:
        """The tool with the present TCP."""
        return Tool(self.model, self.settings.tcp_offset)

    def tcp_pose(self, q: Vector6) -> Pose:
        """Return the pose of the TCP at joint angles [rad]."""
        return self.model.fk(q, self.settings.tcp_offset)

    def take(self, thread: object, generator: MotionGenerator) -> None:
        """Let `thread` move the arm with `generator` from the next cycle on."""
        try:
            self.motion.command(thread, generator)
        except OwnershipError:
            raise ScriptRuntimeError("Another thread is already controlling the robot") from None


def require_positive(function: str, **limits: float) -> None:
    """Raise a runtime error for a limit that is not above 0, or not by anything that counts."""
    for name, value in limits.items():
        if not value > 0.0:
            raise ScriptRuntimeError(f"{function}: {name} must be above 0, got {value:g}")
        if value < LEAST_LIMIT:
            raise ScriptRuntimeError(f"{function}: {name} must be at least {LEAST_LIMIT:g}, got {value:g}")


def floats(values: Sequence[float]) -> Vector6:
    """Return six values as floats; a script may write whole numbers."""
    return six(list(map(float, values)))
