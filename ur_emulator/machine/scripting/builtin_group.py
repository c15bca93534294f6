"""What all groups of builtins share: the decorator, the parts that move an arm, and checks of arguments.

A group is a class whose marked methods are builtins. It gets only the parts of the controller that it acts
on. Signatures, versions and costs of builtins are in `urscript.catalogue`.
"""

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import Any, ClassVar, TypeVar

from protocol.pose import Pose
from ur_emulator.machine.controller.safety.safety_state import ConfiguredLimits, SafetyState
from ur_emulator.machine.controller.settings import ToolSettings
from ur_emulator.machine.kinematics.arm_model import ArmModel
from ur_emulator.machine.models.robot_model import RobotModel, Vector3, Vector6, six
from ur_emulator.machine.motion.arm_motion import ArmMotion, OwnershipError
from ur_emulator.machine.motion.generators import Generator as MotionGenerator
from ur_emulator.machine.motion.generators import StopJ
from ur_emulator.machine.motion.ownership import Command
from ur_emulator.machine.motion.tool import Tool
from ur_emulator.machine.motion.tool_streams import StopL
from urscript import NEXT_CYCLE, HostFunction, ScriptRuntimeError

_Method = TypeVar("_Method", bound=Callable[..., Any])

# A motion builtin is a generator that yields once for each cycle that it lasts.
Cycles = Generator[Any, None, None]

# Smallest limit [SI units]: squares of smaller ones underflow.
MIN_LIMIT = 1e-9


def builtin(*names: str) -> Callable[[_Method], _Method]:
    """Mark a method of a `BuiltinGroup` as the builtin of these names."""

    def mark(method: _Method) -> _Method:
        method.builtin_names = names  # type: ignore[attr-defined]  # functions take any attribute
        return method

    return mark


class BuiltinGroup:
    """Builtins of one subject."""

    _methods: ClassVar[Mapping[str, str]]  # builtin -> its method

    def __init_subclass__(cls) -> None:
        cls._methods = {
            name: attribute
            for attribute, method in vars(cls).items()
            for name in getattr(method, "builtin_names", ())
        }

    def functions(self) -> dict[str, HostFunction]:
        """Return the builtins by URScript name; a group adds those of its tables."""
        return {name: getattr(self, attribute) for name, attribute in self._methods.items()}


@dataclass(frozen=True, slots=True)
class ScriptArm:
    """The parts of the controller that move an arm; `safety` has the ranges of the joints."""

    robot: RobotModel
    model: ArmModel
    motion: ArmMotion
    settings: ToolSettings
    safety: SafetyState

    @property
    def tool(self) -> Tool:
        """The tool with the present TCP."""
        return Tool(self.model, self.settings.tcp_offset)

    def tcp_pose(self, q: Vector6) -> Pose:
        """Return the pose of the TCP at joint angles [rad]."""
        return self.model.fk(q, self.settings.tcp_offset)

    def tcp_speed(self, q: Vector6, qd: Vector6) -> Vector6:
        """Return the twist of the TCP at joint angles [rad] and speeds [rad/s]."""
        return self.model.state(q, qd, self.settings.tcp_offset).tcp_speed

    def stop(self, thread: object, ramp: StopJ | StopL) -> Cycles:
        """Bring the arm to rest for `thread`, and wait until it rests, or something else has the arm."""
        yield from until_over(self.take(thread, ramp))

    def take(self, thread: object, generator: MotionGenerator) -> Command:
        """Let `thread` move the arm with `generator` from the next cycle on."""
        try:
            return self.motion.command(thread, generator)
        except OwnershipError:
            raise ScriptRuntimeError("Another thread is already controlling the robot") from None


def refusing(functions: Mapping[str, HostFunction], refusal: type[Exception]) -> dict[str, HostFunction]:
    """Return builtins where an exception of this kind is a run-time error that begins with the name."""
    return {name: _refusing(name, function, refusal) for name, function in functions.items()}


def _refusing(name: str, function: HostFunction, refusal: type[Exception]) -> HostFunction:
    @wraps(function)
    def call(*arguments: Any) -> Any:
        try:
            return function(*arguments)
        except refusal as error:
            raise ScriptRuntimeError(f"{name}: {error}") from None

    return call


def until_over(command: Command) -> Cycles:
    """Wait until a motion has come to its end, or was taken away."""
    while not command.is_over:
        yield NEXT_CYCLE


def require_positive(function: str, **limits: float) -> None:
    """Raise a runtime error for a limit that is not above 0, or too small to have an effect."""
    for name, value in limits.items():
        if not value > 0.0:
            raise ScriptRuntimeError(f"{function}: {name} must be above 0, got {value:g}")
        if value < MIN_LIMIT:
            raise ScriptRuntimeError(f"{function}: {name} must be at least {MIN_LIMIT:g}, got {value:g}")


def require_range(function: str, q: Vector6, limits: ConfiguredLimits) -> None:
    """Raise a runtime error for a joint angle [rad] beyond the range of its joint."""
    for i, (x, low, high) in enumerate(zip(q, limits.q_min, limits.q_max, strict=True)):
        if not low <= x <= high:
            raise ScriptRuntimeError(
                f"{function}: joint {i} cannot be at {x:g} rad; allowed: {low:.4f} to {high:.4f}"
            )


def floats(values: Iterable[float]) -> Vector6:
    """Return six values, also those of a pose, as floats; a script may write whole numbers."""
    return six(list(map(float, values)))


def vector(values: Sequence[float]) -> Vector3:
    """Return three values as floats."""
    x, y, z = map(float, values)
    return (x, y, z)
