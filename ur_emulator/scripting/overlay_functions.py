"""Builtins that displace the arm from its path: path offset, conveyor tracking and its encoders."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import hypot
from typing import Any

from ur_emulator.controller.clock import Clock
from ur_emulator.controller.io.encoders import PULSE_INPUTS, RANGES, Decoder, Encoders
from ur_emulator.controller.io.lines import InputOutput
from ur_emulator.models.robot_model import ZERO6
from ur_emulator.motion.generators import StopJ
from ur_emulator.motion.overlay import CircularBelt, Conveyor, LinearBelt, OffsetType, PathOffset
from ur_emulator.scripting.script_arm import Cycles, ScriptArm, floats, require_positive
from urscript.errors import ScriptRuntimeError
from urscript.run.waits import NEXT_CYCLE
from urscript.values import Pose, wrap_int


class ProgramPathOffset:
    """The path offset of one program."""

    def __init__(self, arm: ScriptArm) -> None:
        self._arm = arm
        self._offset = PathOffset(arm.tool)

    def end(self) -> None:
        """Disable it; the arm ramps to rest."""
        self._arm.motion.remove_overlay(self._offset)

    def functions(self) -> Mapping[str, Callable[..., Any]]:
        """Return the builtins."""
        arm, motion, path_offset = self._arm, self._arm.motion, self._offset

        def enable(thread: object) -> None:
            if not motion.has_overlay(path_offset):
                path_offset.begin(arm.tool)
                motion.add_overlay(path_offset)

        def disable(thread: object, a: float) -> Cycles:
            require_positive("path_offset_disable", a=a)
            arm.take(thread, ramp := StopJ(a))
            self.end()
            while not ramp.done:
                yield NEXT_CYCLE

        def set_offset(thread: object, offset: Any, kind: float) -> None:
            path_offset.set(floats(tuple(offset)), OffsetType(int(kind)))

        def get_offset(thread: object, kind: float) -> Pose:
            is_on = motion.has_overlay(path_offset)
            return Pose.of(path_offset.applied(OffsetType(int(kind))) if is_on else ZERO6)

        def set_alpha_filter(thread: object, alpha: float) -> None:
            path_offset.alpha = float(alpha)

        def set_max_offset(thread: object, translation: float, rotation: float) -> None:
            require_positive("path_offset_set_max_offset", transLimit=translation, rotLimit=rotation)
            path_offset.limits = (float(translation), float(rotation))

        return {
            "path_offset_enable": enable,
            "path_offset_disable": disable,
            "path_offset_set": set_offset,
            "path_offset_get": get_offset,
            "path_offset_set_alpha_filter": set_alpha_filter,
            "path_offset_set_max_offset": set_max_offset,
        }


# --- builtins for the conveyor encoders, and their old forms for the first one

# The encoder of the old forms.
_CONVEYOR = 0


def encoder_functions(encoders: Encoders, io: InputOutput) -> Mapping[str, Callable[..., Any]]:
    """Return the encoder builtins."""

    def pin(number: float) -> int:
        bit = PULSE_INPUTS.get(int(number))
        if bit is None:
            allowed = ", ".join(map(str, PULSE_INPUTS))
            raise ScriptRuntimeError(
                f"digital input {number:g} cannot take encoder pulses; allowed: {allowed}"
            )
        return bit

    def enable_pulse_decode(thread: object, index: float, decoder: float, a: float, b: float) -> None:
        encoders.decode(int(index), Decoder(int(decoder)), pin(a), pin(b), io.digital_in)

    def enable_set_tick_count(thread: object, index: float, range_id: float) -> None:
        encoders.feed(int(index), int(range_id))

    def set_tick_count(thread: object, index: float, count: float) -> None:
        encoder = encoders.encoders[int(index)]
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

    def get_tick_count(thread: object, index: float, opt: str = "") -> float:
        count = encoders.encoders[int(index)].count
        if opt not in ("", "raw"):
            raise ScriptRuntimeError(
                f'encoder_get_tick_count: opt "{opt}" does not exist; allowed: "" and "raw"'
            )
        return wrap_int(int(count)) if opt else count

    def unwind(thread: object, index: float, delta: float) -> float | None:
        encoder = encoders.encoders[int(index)]
        return encoder.unwind(float(delta)) if encoder.is_enabled else None

    def set_conveyor(thread: object, count: float, resolution: float) -> None:
        if resolution not in RANGES:
            raise ScriptRuntimeError(
                f"set_conveyor_tick_count: resolution {resolution:g} does not exist; allowed: 0 to 4"
            )
        encoder = encoders.encoders[_CONVEYOR]
        if not encoder.is_fed or encoder.range_id != resolution:
            encoders.feed(_CONVEYOR, int(resolution))
        set_tick_count(thread, _CONVEYOR, count)

    return {
        "encoder_enable_pulse_decode": enable_pulse_decode,
        "encoder_enable_set_tick_count": enable_set_tick_count,
        "encoder_set_tick_count": set_tick_count,
        "encoder_get_tick_count": get_tick_count,
        "encoder_unwind_delta_tick_count": unwind,
        "conveyor_pulse_decode": lambda thread, kind, a, b: enable_pulse_decode(
            thread, _CONVEYOR, kind, a, b
        ),
        "get_conveyor_tick_count": lambda thread: encoders.encoders[_CONVEYOR].count,
        "set_conveyor_tick_count": set_conveyor,
    }


# --- builtins of conveyor tracking: moves follow a conveyor; the path without the conveyor can be read

# Range of the resolution of an encoder [ticks per metre or revolution].
MIN_TICKS, MAX_TICKS = 1e-3, 1e9
# Deceleration where a program gives none [rad/s^2]. Source: URScript manual, stop_conveyor_tracking.
STOP_DECELERATION = 20.0


class ProgramConveyor:
    """The conveyor that one program tracks."""

    def __init__(self, arm: ScriptArm, encoders: Encoders, clock: Clock) -> None:
        self._arm = arm
        self._encoders = encoders
        self._clock = clock
        self._tracked: Conveyor | None = None

    def end(self) -> None:
        """End the tracking; the arm ramps to rest."""
        if self._tracked is not None:
            self._arm.motion.remove_overlay(self._tracked)
            self._tracked = None

    def functions(self) -> Mapping[str, Callable[..., Any]]:
        """Return the conveyor builtins."""
        arm, motion = self._arm, self._arm.motion

        def track(belt: LinearBelt | CircularBelt, encoder_index: float) -> None:
            self.end()
            encoder, clock = self._encoders.encoders[int(encoder_index)], self._clock
            self._tracked = Conveyor(belt, arm.tool, lambda: encoder.travel, lambda: clock.time)
            motion.add_overlay(self._tracked)

        def track_linear(
            thread: object, direction: Pose, ticks_per_meter: float, encoder_index: float
        ) -> None:
            _require_ticks("track_conveyor_linear", "ticks_per_meter", ticks_per_meter)
            x, y, z = floats(tuple(direction))[:3]
            if not hypot(x, y, z) > 0.0:
                raise ScriptRuntimeError(
                    f"track_conveyor_linear: direction ({x:g}, {y:g}, {z:g}) leads nowhere, "
                    "give its x, y, z in the base frame"
                )
            track(LinearBelt((x, y, z), float(ticks_per_meter)), encoder_index)

        def track_circular(
            thread: object, center: Pose, ticks_per_revolution: float, rotate_tool: bool, encoder_index: float
        ) -> None:
            _require_ticks("track_conveyor_circular", "ticks_per_revolution", ticks_per_revolution)
            belt = CircularBelt(floats(tuple(center)), float(ticks_per_revolution), bool(rotate_tool))
            track(belt, encoder_index)

        def stop(thread: object, a: float) -> Cycles:
            a = a or STOP_DECELERATION  # field programs write 0
            require_positive("stop_conveyor_tracking", a=a)
            arm.take(thread, ramp := StopJ(a))
            self.end()
            while not ramp.done:
                yield NEXT_CYCLE

        def speed_along_path(thread: object) -> Pose:
            path = motion.path
            return Pose.of(arm.tool.twist(path.q, path.qd))

        return {
            "track_conveyor_linear": track_linear,
            "track_conveyor_circular": track_circular,
            "stop_conveyor_tracking": stop,
            "get_target_tcp_pose_along_path": lambda thread: Pose.of(arm.tool.pose(motion.path.q)),
            "get_target_tcp_speed_along_path": speed_along_path,
        }


def _require_ticks(function: str, name: str, value: float) -> None:
    if not MIN_TICKS <= abs(value) <= MAX_TICKS:
        raise ScriptRuntimeError(
            f"{function}: {name} must be {MIN_TICKS:g} to {MAX_TICKS:g}, or as much below 0, got {value:g}"
        )
