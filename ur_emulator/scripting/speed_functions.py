"""Builtins that stream: velocities and positions that a script renews every cycle, and the stops."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.motion.generators import SpeedJ, StopJ, Streamed
from ur_emulator.motion.servo_j import ServoJ
from ur_emulator.motion.speed_l import SpeedL, StopL
from ur_emulator.scripting.script_arm import MIN_LIMIT, Cycles, ScriptArm, floats, require_positive
from urscript.run.waits import NEXT_CYCLE


def speed_functions(arm: ScriptArm, step_time: float) -> Mapping[str, Callable[..., Any]]:
    """Return the streaming builtins and the stops.

    Args:
        arm: that they move.
        step_time: duration of a cycle [s].
    """
    motion = arm.motion

    def stream(thread: object, generator: Streamed, t: float | None) -> Cycles:
        """Renew a motion for the time t [s], or until it is done."""
        arm.take(thread, generator)
        if t is not None and t > 0.0:
            # Exactly one cycle for t = step time, whatever the rounding of the division.
            for _ in range(max(1, math.ceil(t / step_time - 1e-6))):
                motion.renew()
                yield NEXT_CYCLE
        else:
            while not generator.done:
                motion.renew()
                yield NEXT_CYCLE

    def stop(thread: object, generator: StopJ | StopL) -> Cycles:
        arm.take(thread, generator)
        while not generator.done:
            yield NEXT_CYCLE

    def speedj(thread: object, qd: list[float], a: float, t: float | None) -> Cycles:
        if not a >= MIN_LIMIT:
            a = _limit("speedj", t, a=a)
        return stream(thread, SpeedJ(floats(qd), a), t)

    def speedl(thread: object, xd: Any, a: float, t: float | None, aRot: float | None) -> Cycles:
        a_rot = _limit("speedl", t, aRot=a if aRot is None else aRot)
        a = _limit("speedl", t, a=a)
        twist = floats(tuple(xd))
        return stream(thread, SpeedL(twist, a, a_rot, arm.tool), t)

    def servoj(
        thread: object, q: list[float], a: float, v: float, t: float, lookahead_time: float, gain: float
    ) -> Cycles:
        require_positive("servoj", t=t, lookahead_time=lookahead_time, gain=gain)
        return stream(thread, ServoJ(floats(q), lookahead_time, gain, arm.robot.qd_max), t)

    def stopj(thread: object, a: float) -> Cycles:
        require_positive("stopj", a=a)
        return stop(thread, StopJ(a))

    def stopl(thread: object, a: float, aRot: float | None) -> Cycles:
        a_rot = a if aRot is None else aRot
        require_positive("stopl", a=a, aRot=a_rot)
        return stop(thread, StopL(a, a_rot, arm.tool))

    return {"speedj": speedj, "speedl": speedl, "servoj": servoj, "stopj": stopj, "stopl": stopl}


def _limit(function: str, t: float | None, **limit: float) -> float:
    """The acceleration to use.

    A stream whose speed does not change asks for zero acceleration, or for a rounding error of it. Source:
    splines of the maker's driver script. Without a time such a command would never be done.
    """
    ((_, value),) = limit.items()
    if t is not None and t > 0.0 and 0.0 <= value < MIN_LIMIT:
        return MIN_LIMIT
    require_positive(function, **limit)
    return value
