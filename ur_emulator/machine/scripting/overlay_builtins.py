"""Builtins that displace the arm from its path: path offset, conveyor tracking and its encoders."""

from collections.abc import Sequence
from math import hypot
from typing import Any

from ur_emulator.machine.controller.clock import Clock
from ur_emulator.machine.controller.io.encoders import PULSE_INPUTS, RANGES, Decoder, Encoder
from ur_emulator.machine.controller.io.lines import InputOutput
from ur_emulator.machine.models.robot_model import ZERO6
from ur_emulator.machine.motion.conveyor import Belt, CircularBelt, Conveyor, LinearBelt
from ur_emulator.machine.motion.generators import StopJ
from ur_emulator.machine.motion.path_offset import OffsetType, PathOffset
from ur_emulator.machine.scripting.builtin_group import (
    BuiltinGroup,
    Cycles,
    ScriptArm,
    builtin,
    floats,
    require_positive,
    until_over,
)
from urscript import HostFunction, ScriptRuntimeError
from urscript.values import Pose, wrap_int

# The encoder of the old builtins that give none.
_CONVEYOR = 0
# Range of the resolution of an encoder [ticks per metre or revolution].
MIN_TICKS, MAX_TICKS = 1e-3, 1e9
# Deceleration where a program gives none [rad/s^2]. Source: URScript manual, stop_conveyor_tracking.
STOP_DECELERATION = 20.0


class PathOffsetBuiltins(BuiltinGroup):
    """The path offset of one program."""

    def __init__(self, arm: ScriptArm) -> None:
        self._arm = arm
        self._motion = arm.motion
        self._offset = PathOffset(arm.tool)

    def end(self) -> None:
        """Disable it; the arm ramps to rest."""
        self._motion.remove_overlay(self._offset)

    @builtin("path_offset_enable")
    def _enable(self, thread: object) -> None:
        if self._offset not in self._motion.overlays:
            self._offset.begin(self._arm.tool)
            self._motion.add_overlay(self._offset)

    @builtin("path_offset_disable")
    def _disable(self, thread: object, a: float) -> Cycles:
        require_positive("path_offset_disable", a=a)
        command = self._arm.take(thread, StopJ(a))
        self.end()
        yield from until_over(command)

    @builtin("path_offset_set")
    def _set(self, thread: object, offset: Any, kind: float) -> None:
        self._offset.set(floats(offset), OffsetType(int(kind)))

    @builtin("path_offset_get")
    def _get(self, thread: object, kind: float) -> Pose:
        is_on = self._offset in self._motion.overlays
        return Pose.of(self._offset.applied(OffsetType(int(kind))) if is_on else ZERO6)

    @builtin("path_offset_set_alpha_filter")
    def _set_alpha_filter(self, thread: object, alpha: float) -> None:
        self._offset.alpha = float(alpha)

    @builtin("path_offset_set_max_offset")
    def _set_max_offset(self, thread: object, translation: float, rotation: float) -> None:
        require_positive("path_offset_set_max_offset", transLimit=translation, rotLimit=rotation)
        self._offset.limits = (float(translation), float(rotation))


class EncoderBuiltins(BuiltinGroup):
    """The conveyor encoders, and the old builtins for the first one."""

    def __init__(self, encoders: Sequence[Encoder], io: InputOutput) -> None:
        self._encoders = encoders
        self._io = io

    def functions(self) -> dict[str, HostFunction]:
        """Return the builtins."""
        encoders, decode = self._encoders, self._decode
        return super().functions() | {
            "encoder_enable_set_tick_count": lambda thread, index, kind: encoders[int(index)].feed(int(kind)),
            "conveyor_pulse_decode": lambda thread, kind, a, b: decode(thread, _CONVEYOR, kind, a, b),
            "get_conveyor_tick_count": lambda thread: encoders[_CONVEYOR].count,
        }

    @builtin("encoder_enable_pulse_decode")
    def _decode(self, thread: object, index: float, decoder: float, a: float, b: float) -> None:
        encoder = self._encoders[int(index)]
        encoder.decode(Decoder(int(decoder)), _bit(a), _bit(b), self._io.digital_in)

    @builtin("encoder_set_tick_count")
    def _set_count(self, thread: object, index: float, count: float) -> None:
        encoder = self._encoders[int(index)]
        if not encoder.is_fed:
            raise ScriptRuntimeError(
                f"encoder {index:g} does not take counts, call encoder_enable_set_tick_count first"
            )
        low, size = RANGES[encoder.range_id]
        if not low <= count < low + size:
            raise ScriptRuntimeError(
                f"encoder count {count:g} is out of range; allowed: {low} to {low + size - 1}"
            )
        encoder.set_count(float(count))

    @builtin("encoder_get_tick_count")
    def _get_count(self, thread: object, index: float, opt: str = "") -> float:
        count = self._encoders[int(index)].count
        if opt not in ("", "raw"):
            raise ScriptRuntimeError(
                f'encoder_get_tick_count: opt "{opt}" does not exist; allowed: "" and "raw"'
            )
        return wrap_int(int(count)) if opt else count

    @builtin("encoder_unwind_delta_tick_count")
    def _unwind(self, thread: object, index: float, delta: float) -> float | None:
        encoder = self._encoders[int(index)]
        return encoder.unwind(float(delta)) if encoder.is_enabled else None

    @builtin("set_conveyor_tick_count")
    def _set_conveyor_count(self, thread: object, count: float, resolution: float) -> None:
        if resolution not in RANGES:
            raise ScriptRuntimeError(
                f"set_conveyor_tick_count: resolution {resolution:g} does not exist; allowed: 0 to 4"
            )
        encoder = self._encoders[_CONVEYOR]
        if not encoder.is_fed or encoder.range_id != resolution:
            encoder.feed(int(resolution))
        self._set_count(thread, _CONVEYOR, count)


def _bit(pin: float) -> int:
    bit = PULSE_INPUTS.get(int(pin))
    if bit is None:
        allowed = ", ".join(map(str, PULSE_INPUTS))
        raise ScriptRuntimeError(f"digital input {pin:g} cannot take encoder pulses; allowed: {allowed}")
    return bit


class ConveyorBuiltins(BuiltinGroup):
    """The conveyor that one program tracks: moves follow it; the path without it can be read."""

    def __init__(self, arm: ScriptArm, encoders: Sequence[Encoder], clock: Clock) -> None:
        self._arm = arm
        self._motion = arm.motion
        self._encoders = encoders
        self._clock = clock
        self._tracked: Conveyor | None = None

    def end(self) -> None:
        """End the tracking; the arm ramps to rest."""
        if self._tracked is not None:
            self._motion.remove_overlay(self._tracked)
            self._tracked = None

    @builtin("track_conveyor_linear")
    def _track_linear(
        self, thread: object, direction: Pose, ticks_per_meter: float, encoder_index: float
    ) -> None:
        _require_ticks("track_conveyor_linear", "ticks_per_meter", ticks_per_meter)
        x, y, z = floats(direction)[:3]
        if not hypot(x, y, z) > 0.0:
            raise ScriptRuntimeError(
                f"track_conveyor_linear: direction ({x:g}, {y:g}, {z:g}) leads nowhere, "
                "give its x, y, z in the base frame"
            )
        self._track(LinearBelt((x, y, z), float(ticks_per_meter)), encoder_index)

    @builtin("track_conveyor_circular")
    def _track_circular(
        self,
        thread: object,
        center: Pose,
        ticks_per_revolution: float,
        rotate_tool: bool,
        encoder_index: float,
    ) -> None:
        _require_ticks("track_conveyor_circular", "ticks_per_revolution", ticks_per_revolution)
        belt = CircularBelt(floats(center), float(ticks_per_revolution), bool(rotate_tool))
        self._track(belt, encoder_index)

    @builtin("stop_conveyor_tracking")
    def _stop(self, thread: object, a: float) -> Cycles:
        a = a or STOP_DECELERATION  # field programs write 0
        require_positive("stop_conveyor_tracking", a=a)
        command = self._arm.take(thread, StopJ(a))
        self.end()
        yield from until_over(command)

    @builtin("get_target_tcp_pose_along_path")
    def _pose_along_path(self, thread: object) -> Pose:
        return Pose.of(self._arm.tool.pose(self._motion.path.q))

    @builtin("get_target_tcp_speed_along_path")
    def _speed_along_path(self, thread: object) -> Pose:
        path = self._motion.path
        return Pose.of(self._arm.tool.twist(path.q, path.qd))

    def _track(self, belt: Belt, encoder_index: float) -> None:
        self.end()
        encoder, clock = self._encoders[int(encoder_index)], self._clock
        self._tracked = Conveyor(belt, self._arm.tool, lambda: encoder.travel, lambda: clock.time)
        self._motion.add_overlay(self._tracked)


def _require_ticks(function: str, name: str, value: float) -> None:
    if not MIN_TICKS <= abs(value) <= MAX_TICKS:
        raise ScriptRuntimeError(
            f"{function}: {name} must be {MIN_TICKS:g} to {MAX_TICKS:g}, or as much below 0, got {value:g}"
        )
