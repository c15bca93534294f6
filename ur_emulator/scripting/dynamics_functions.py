"""Builtins that ask the controller's model of the arm: Jacobian, mass matrix, Coriolis torques.

Source: URScript manual e-Series 5.23, module internals. Chosen: the model carries the declared payload; where
a program gives no angles or speeds, the measured ones are taken.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.controller.arm_dynamics import ArmDynamics
from ur_emulator.controller.past_cycles import PastCycles
from ur_emulator.scripting.script_arm import ScriptArm
from urscript.values import Matrix


def dynamics_functions(
    arm: ScriptArm, dynamics: ArmDynamics, past: PastCycles
) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins that ask the controller's model of the arm.

    Args:
        arm: kinematics, and the active TCP.
        dynamics: masses.
        past: measured angles and speeds.
    """

    def angles(q: Any) -> Any:
        return past.sensed.actual_q if q is None else q

    def speeds(qd: Any) -> Any:
        return past.sensed.actual_qd if qd is None else qd

    def tool(tcp: Any) -> Any:
        return arm.settings.tcp_offset if tcp is None else tuple(tcp)

    def get_jacobian(thread: object, q: Any, tcp: Any) -> Matrix:
        return Matrix(arm.model.jacobian(angles(q), tool(tcp)).tolist())

    def get_jacobian_time_derivative(thread: object, q: Any, qd: Any, tcp: Any) -> Matrix:
        return Matrix(arm.model.jacobian_rate(angles(q), speeds(qd), tool(tcp)).tolist())

    def get_mass_matrix(thread: object, q: Any, include_rotors_inertia: bool) -> Matrix:
        return Matrix(dynamics.mass_matrix(angles(q), with_rotors=include_rotors_inertia).tolist())

    def get_coriolis_and_centrifugal_torques(thread: object, q: Any, qd: Any) -> list[float]:
        torques: list[float] = dynamics.velocity_torque(angles(q), speeds(qd)).tolist()
        return torques

    return {
        "get_jacobian": get_jacobian,
        "get_jacobian_time_derivative": get_jacobian_time_derivative,
        "get_mass_matrix": get_mass_matrix,
        "get_coriolis_and_centrifugal_torques": get_coriolis_and_centrifugal_torques,
    }
