"""Builtins for TCP, payload and mounting, and the protective stop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.controller.compliance.force_sense import ForceSense
from ur_emulator.controller.program_requests import ProgramRequests
from ur_emulator.controller.tool_settings import Payload, ToolSettings
from ur_emulator.models.robot_model import RobotModel, Vector3, six
from urscript.errors import ScriptRuntimeError
from urscript.values import log_form

# Greatest length of a tool [m] and of its rotation vector [rad]: beyond it poses lose precision.
MAX_TCP_OFFSET = 100.0
# Greatest distance of a centre of gravity from the flange along an axis [m]: far beyond it the simulation
# diverges.
MAX_COG = 1.0
# Largest moment of inertia [kg m^2]. Source: URScript manual e-Series, set_target_payload.
MAX_INERTIA = 133.0


def settings_functions(
    robot: RobotModel,
    tool: ToolSettings,
    force_sense: ForceSense,
    requests: ProgramRequests,
    step_time: float,
) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins for TCP, payload and mounting, and the protective stop.

    Args:
        robot: has the greatest payload.
        tool: what they set.
        force_sense: a sensor is zeroed with the payload.
        requests: get the protective stop.
        step_time: duration of a cycle [s].
    """

    def set_tcp(thread: object, pose: Any, name: str = "") -> None:
        offset = six([float(x) for x in pose])
        if max(map(abs, offset)) > MAX_TCP_OFFSET:
            raise ScriptRuntimeError(
                f"set_tcp: {log_form(pose)} is not a valid TCP; allowed: numbers up to {MAX_TCP_OFFSET:g}"
            )
        if tool.payload.at_tcp:
            cog_of(offset[:3])
        tool.set_tcp(offset)

    def cog_of(value: Any) -> Vector3:
        cog = _vector(value)
        if max(map(abs, cog)) > MAX_COG:
            raise ScriptRuntimeError(
                f"a centre of gravity at {log_form(list(cog))} m is out of range; "
                f"allowed: numbers up to {MAX_COG:g} m from the flange"
            )
        return cog

    def mass_of(mass: float) -> float:
        if not 0.0 <= mass <= robot.payload_max:
            raise ScriptRuntimeError(
                f"a payload of {mass:g} kg is out of range; allowed: 0 to {robot.payload_max:g} kg"
            )
        return float(mass)

    def set_payload(thread: object, m: float, cog: Any) -> None:
        mass, place = mass_of(m), cog_of(tool.tcp_offset[:3] if cog is None else cog)
        tool.set_payload(mass, None if cog is None else place)
        force_sense.payload_declared()

    def set_payload_mass(thread: object, m: float) -> None:
        tool.set_payload_mass(mass_of(m))

    def set_payload_cog(thread: object, cog: Any) -> None:
        tool.set_payload_cog(cog_of(cog))

    def set_target_payload(
        thread: object, m: float, cog: Any, inertia: Any, transition_time: float = 0.0
    ) -> None:
        if (
            len(inertia) != 6
            or not all(abs(moment) <= MAX_INERTIA for moment in inertia)
            or min(inertia[:3]) < 0.0
        ):
            raise ScriptRuntimeError(
                f"set_target_payload: inertia must be six moments of inertia up to {MAX_INERTIA:g} kg m^2, "
                "the first three not below 0"
            )
        payload = Payload(mass_of(m), cog_of(cog), inertia=six(list(map(float, inertia))))
        tool.change_payload(payload, round(transition_time / step_time))

    def set_gravity(thread: object, d: Any) -> None:
        tool.set_gravity(_vector(d))

    return {
        "set_tcp": set_tcp,
        "set_payload": set_payload,
        "set_payload_mass": set_payload_mass,
        "set_payload_cog": set_payload_cog,
        "set_target_payload": set_target_payload,
        "set_base_acceleration": lambda thread, a: tool.set_base_acceleration(_vector(a)),
        "set_gravity": set_gravity,
        "protective_stop": lambda thread: requests.protective_stop(),
    }


def _vector(values: Any) -> Vector3:
    x, y, z = map(float, values)
    return (x, y, z)
