"""Builtins that change what the controller assumes or ask it for something: TCP, payload, stops."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.controller.state import ControllerState, Payload
from ur_emulator.models.robot_model import Vector3, six
from urscript.builtins.text import wire_text
from urscript.errors import ScriptRuntimeError

# No tool is longer than this [m], no rotation vector either [rad]; beyond, poses would lose all their digits.
MAX_TCP_OFFSET = 100.0
# No payload has its centre of gravity further away than this from the flange along an axis [m]; far beyond,
# the simulated arm would have no numbers left.
MAX_COG = 1.0


def settings_functions(state: ControllerState) -> Mapping[str, Callable[..., Any]]:
    """Return the setting builtins bound to one controller."""

    def set_tcp(thread: object, pose: Any) -> None:
        offset = six([float(x) for x in pose])
        if max(map(abs, offset)) > MAX_TCP_OFFSET:
            raise ScriptRuntimeError(
                f"set_tcp: {wire_text(pose)} is no tool, allowed are numbers up to {MAX_TCP_OFFSET:g}"
            )
        if state.payload.at_tcp:
            state.payload = Payload(state.payload.mass, cog_of(offset[:3]), at_tcp=True)
        state.tcp_offset = offset

    def cog_of(value: Any) -> Vector3:
        x, y, z = map(float, value)
        if max(abs(x), abs(y), abs(z)) > MAX_COG:
            raise ScriptRuntimeError(
                f"a centre of gravity at {wire_text([x, y, z])} m was given, "
                f"allowed are numbers up to {MAX_COG:g} m from the flange"
            )
        return (x, y, z)

    def mass_of(mass: float) -> float:
        if not 0.0 <= mass <= state.robot.payload_max:
            raise ScriptRuntimeError(
                f"a payload of {mass:g} kg was given, allowed are 0 to {state.robot.payload_max:g} kg"
            )
        return float(mass)

    def set_payload(thread: object, m: float, cog: Any) -> None:
        # Left out, the centre of gravity is the TCP, also that of a later set_tcp. Source: URScript manual.
        at_tcp = cog is None
        state.payload = Payload(mass_of(m), cog_of(state.tcp_offset[:3] if at_tcp else cog), at_tcp)

    def set_payload_mass(thread: object, m: float) -> None:
        state.payload = Payload(mass_of(m), state.payload.cog, state.payload.at_tcp)

    def set_payload_cog(thread: object, cog: Any) -> None:
        state.payload = Payload(state.payload.mass, cog_of(cog))

    def set_gravity(thread: object, d: Any) -> None:
        x, y, z = d
        state.gravity = (float(x), float(y), float(z))

    def protective_stop(thread: object) -> None:
        state.stop_requested = True

    return {
        "set_tcp": set_tcp,
        "set_payload": set_payload,
        "set_payload_mass": set_payload_mass,
        "set_payload_cog": set_payload_cog,
        "set_gravity": set_gravity,
        "protective_stop": protective_stop,
    }
