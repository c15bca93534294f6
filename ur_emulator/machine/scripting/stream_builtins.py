"""Builtins that stream: velocities, positions and torques that a script renews every cycle, and the stops."""

from collections.abc import Sequence
from typing import Any

from ur_emulator.machine.controller.events import EventQueue, LogAdded
from ur_emulator.machine.controller.past_cycles import PastCycles
from ur_emulator.machine.models.robot_model import ZERO6, Vector6
from ur_emulator.machine.motion import generators
from ur_emulator.machine.motion.tool_streams import SpeedL, StopL
from ur_emulator.machine.scripting.builtin_group import (
    MIN_LIMIT,
    BuiltinGroup,
    Cycles,
    ScriptArm,
    builtin,
    floats,
    require_positive,
)
from urscript import NEXT_CYCLE, ScriptRuntimeError
from urscript.values import log_form


class StreamBuiltins(BuiltinGroup):
    """Streams of velocities and positions, and the stops."""

    def __init__(self, arm: ScriptArm, step_time: float) -> None:
        """`step_time` is the duration of a cycle [s]."""
        self._arm = arm
        self._motion = arm.motion
        self._step_time = step_time

    @builtin("speedj")
    def _speedj(self, thread: object, qd: list[float], a: float, t: float | None) -> Cycles:
        if not a >= MIN_LIMIT:
            a = _limit("speedj", t, "a", a)
        return self._stream(thread, generators.SpeedJ(floats(qd), a), t)

    @builtin("speedl")
    def _speedl(self, thread: object, xd: Any, a: float, t: float | None, aRot: float | None) -> Cycles:
        a_rot = _limit("speedl", t, "aRot", a if aRot is None else aRot)
        a = _limit("speedl", t, "a", a)
        twist = floats(xd)
        return self._stream(thread, SpeedL(twist, a, a_rot, self._arm.tool), t)

    @builtin("servoj")
    def _servoj(
        self, thread: object, q: list[float], a: float, v: float, t: float, lookahead_time: float, gain: float
    ) -> Cycles:
        require_positive("servoj", t=t, lookahead_time=lookahead_time, gain=gain)
        return self._stream(
            thread, generators.ServoJ(floats(q), lookahead_time, gain, self._arm.robot.qd_max), t
        )

    @builtin("stopj")
    def _stopj(self, thread: object, a: float) -> Cycles:
        require_positive("stopj", a=a)
        return self._arm.stop(thread, generators.StopJ(a))

    @builtin("stopl")
    def _stopl(self, thread: object, a: float, aRot: float | None) -> Cycles:
        a_rot = a if aRot is None else aRot
        require_positive("stopl", a=a, aRot=a_rot)
        return self._arm.stop(thread, StopL(a, a_rot, self._arm.tool))

    def _stream(self, thread: object, generator: generators.Streamed, t: float | None) -> Cycles:
        """Renew a motion for the time t [s] of the speed slider, or until it is done."""
        motion, step_time = self._motion, self._step_time
        command = self._arm.take(thread, generator)
        if t is not None and t > 0.0:
            left = t - generator.surplus
            yield NEXT_CYCLE
            # Exactly one cycle for t = step time at full speed, whatever the rounding.
            while (left := left - motion.scale * step_time) > 1e-6 * step_time and not command.is_over:
                command.is_renewed = True
                yield NEXT_CYCLE
            # A slow cycle is not lost or gained in the sum of many short commands.
            generator.surplus = -left if motion.scale < 1.0 else 0.0
        else:
            while not (generator.done or command.is_over):
                command.is_renewed = True
                yield NEXT_CYCLE


def _limit(function: str, t: float | None, name: str, value: float) -> float:
    """The acceleration to use.

    A stream whose speed does not change asks for zero acceleration, or for a rounding error of it. Source:
    splines of the maker's driver script. Without a time such a command would never be done.
    """
    if t is not None and t > 0.0 and 0.0 <= value < MIN_LIMIT:
        return MIN_LIMIT
    require_positive(function, **{name: value})
    return value


# Shares of the modelled friction that direct_torque compensates. Source: script manual 5.25.1, direct_torque.
_VISCOUS_SCALE = (0.9, 0.9, 0.8, 0.9, 0.9, 0.9)
_COULOMB_SCALE = (0.8, 0.8, 0.7, 0.8, 0.8, 0.8)


class TorqueBuiltins(BuiltinGroup):
    """The torque control of one program.

    Source: URScript manual e-Series 5.25.1, direct_torque: range and defaults of the scales; friction_comp is
    the former argument, which does not count beside a scale and is logged once. Chosen: True means the
    default scales, False none, before 5.25 too.
    """

    def __init__(self, arm: ScriptArm, past: PastCycles, events: EventQueue) -> None:
        self._arm = arm
        self._past = past
        self._events = events
        self._has_logged = False

    @builtin("direct_torque")
    def _direct_torque(
        self,
        thread: object,
        torque: Sequence[float],
        friction_comp: bool | None,
        *scales: Sequence[float] | None,
    ) -> Cycles:
        viscous, coulomb = scales or (None, None)  # none before 5.25
        if scales and friction_comp is not None and not self._has_logged:
            self._has_logged = True
            text = "direct_torque: friction_comp is deprecated, use viscous_scale and coulomb_scale"
            self._events.append(LogAdded("Program", text))
        compensates = friction_comp is not False or viscous is not None or coulomb is not None
        command = generators.TorqueCommand(
            floats(torque),
            _scale("viscous_scale", viscous, _VISCOUS_SCALE) if compensates else ZERO6,
            _scale("coulomb_scale", coulomb, _COULOMB_SCALE) if compensates else ZERO6,
        )
        self._arm.take(thread, generators.DirectTorque(command, self._past.measured))
        yield NEXT_CYCLE


def _scale(name: str, given: Sequence[float] | None, default: Vector6) -> Vector6:
    scale = default if given is None else floats(given)
    if not all(0.0 <= share <= 1.0 for share in scale):
        raise ScriptRuntimeError(f"direct_torque: {name} must have shares from 0 to 1, got {log_form(given)}")
    return scale
