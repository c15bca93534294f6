"""Builtins of conveyor tracking: moves follow a conveyor; the path without the conveyor can be read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import hypot
from typing import Any

from ur_emulator.controller.clock import Clock
from ur_emulator.controller.io.encoders import Encoders
from ur_emulator.motion.conveyor import CircularBelt, Conveyor, LinearBelt
from ur_emulator.motion.generators import StopJ
from ur_emulator.scripting.script_arm import Cycles, ScriptArm, floats, require_positive
from urscript.errors import ScriptRuntimeError
from urscript.run.waits import NEXT_CYCLE
from urscript.values import Pose

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
