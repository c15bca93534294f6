"""Builtins that read the robot: state, clock, kinematics and dynamics. They take no robot time.

Actual and target values are those at the end of the last cycle, constant while the scripts of a cycle run. So
the target that a script reads is the one that the packages of its cycle show.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.controller.arm_dynamics import ArmDynamics
from ur_emulator.controller.clock import CLOCK_EPOCH, Clock
from ur_emulator.controller.past_cycles import PastCycles
from ur_emulator.models.robot_model import ZERO6, six
from ur_emulator.scripting.script_arm import ScriptArm
from urscript.errors import ScriptRuntimeError
from urscript.values import Matrix, Pose, Struct

# --- the builtin `time`. Source: script manual e-Series 5.19, time: modes, seconds since 1970

_SYSTEM_CLOCK = 2


def clock_functions(clock: Clock) -> Mapping[str, Callable[..., Any]]:
    """Return the builtin that reads the controller's clock."""

    def time(thread: object, mode: float = 0) -> Struct:
        seconds, rest = divmod(clock.tick * clock.generation.period_us, 1_000_000)
        if mode == _SYSTEM_CLOCK:
            seconds += int(CLOCK_EPOCH.timestamp())
        return Struct({"sec": seconds, "nanosec": rest * 1000})

    return {"time": time}


# is_steady(): zero target velocity for this long [s]. Source: URScript manual, later text of is_steady.
STEADY_TIME = 0.5


def state_functions(arm: ScriptArm, past: PastCycles, step_time: float) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins that read the robot.

    Args:
        arm: with its settings.
        past: end of the last cycle, and positions before it.
        step_time: duration of a cycle [s].
    """
    model, motion, settings = arm.model, arm.motion, arm.settings

    def joints(value: Any) -> tuple[float, ...]:
        return past.sensed.actual_q if value is None else six([float(x) for x in value])

    def tool(value: Any) -> tuple[float, ...]:
        return settings.tcp_offset if value is None else tuple(value)

    def get_forward_kin(thread: object, q: Any, tcp: Any) -> Pose:
        return Pose.of(model.fk(joints(q), tool(tcp)))

    def inverse(pose: Pose, q_near: Any, tcp: Any) -> tuple[float, ...] | None:
        return model.inverse(tuple(pose), joints(q_near), tool(tcp))

    def get_inverse_kin(
        thread: object, x: Pose, qnear: Any, max_position_error: float, max_orientation_error: float, tcp: Any
    ) -> list[float]:
        solution = inverse(x, qnear, tcp)
        if solution is None:
            raise ScriptRuntimeError(
                "get_inverse_kin: unable to find an inverse kinematics solution for the requested pose"
            )
        return list(solution)

    def get_inverse_kin_has_solution(
        thread: object,
        pose: Pose,
        qnear: Any,
        max_position_error: float,
        max_orientation_error: float,
        tcp: Any,
    ) -> bool:
        return inverse(pose, qnear, tcp) is not None

    def get_actual_tool_flange_pose(thread: object) -> Pose:
        return Pose.of(model.fk(past.sensed.actual_q))

    def is_within_safety_limits(thread: object, pose: Any, qnear: Any) -> bool:
        q = inverse(pose, qnear, None) if isinstance(pose, Pose) else tuple(pose)
        limits, boundaries = arm.safety.limits, arm.safety.boundaries
        if q is None or not all(
            low <= x <= high for x, low, high in zip(q, limits.q_min, limits.q_max, strict=True)
        ):
            return False
        return not boundaries or boundaries.find_crossed(model.state(q, ZERO6, settings.tcp_offset)) is None

    def get_actual_joint_positions_history(thread: object, steps: float) -> list[float]:
        if not steps < len(past.q_history):
            raise ScriptRuntimeError(
                f"get_actual_joint_positions_history: {steps:g} steps back; "
                f"allowed: 0 to {len(past.q_history) - 1}"
            )
        return list(past.q_history[int(steps)])

    def get_joint_torques(thread: object) -> list[float]:
        sensed = past.sensed
        return [
            k * (actual - target)
            for k, actual, target in zip(
                arm.robot.torque_constant, sensed.actual_current, sensed.target_current, strict=True
            )
        ]

    def get_actual_tcp_pose(thread: object) -> Pose:
        return Pose.of(arm.tcp_pose(past.sensed.actual_q))

    def get_actual_tcp_speed(thread: object) -> Pose:
        return Pose.of(arm.tcp_speed(past.sensed.actual_q, past.sensed.actual_qd))

    return {
        "get_actual_joint_positions": lambda thread: list(past.sensed.actual_q),
        "get_target_joint_positions": lambda thread: list(motion.target.q),
        "get_joint_positions": lambda thread: list(motion.path.q),
        "get_actual_joint_speeds": lambda thread: list(past.sensed.actual_qd),
        "get_target_joint_speeds": lambda thread: list(motion.target.qd),
        "get_actual_joint_accelerations": lambda thread: list(past.joint_accelerations()),
        "get_target_joint_accelerations": lambda thread: list(motion.target.qdd),
        "get_actual_joint_positions_history": get_actual_joint_positions_history,
        "get_target_waypoint": lambda thread: Pose.of(arm.tcp_pose(motion.goal)),
        "get_joint_torques": get_joint_torques,
        "get_joint_temp": lambda thread, j: past.sensed.joint_temperatures[int(j)],
        "get_tool_temp": lambda thread: past.sensed.joint_temperatures[-1],
        "get_controller_temp": lambda thread: past.snapshot.masterboard_temperature,
        "get_actual_tcp_pose": get_actual_tcp_pose,
        "tool_pose": get_actual_tcp_pose,
        "get_target_tcp_pose": lambda thread: Pose.of(arm.tcp_pose(motion.target.q)),
        "get_actual_tool_flange_pose": get_actual_tool_flange_pose,
        "get_actual_tcp_speed": get_actual_tcp_speed,
        "get_target_tcp_speed": lambda thread: Pose.of(arm.tcp_speed(motion.target.q, motion.target.qd)),
        "get_tcp_force": lambda thread: Pose.of(past.snapshot.actual_tcp_force),
        "force": lambda thread: math.hypot(*past.snapshot.actual_tcp_force[:3]),
        "get_tcp_offset": lambda thread: Pose.of(settings.tcp_offset),
        "get_tool_accelerometer_reading": lambda thread: list(past.sensed.tool_accelerometer),
        "get_tool_current": lambda thread: past.snapshot.tool_output_current,
        "get_steptime": lambda thread: step_time,
        "get_target_payload": lambda thread: settings.payload.mass,
        "get_target_payload_cog": lambda thread: list(settings.payload.cog),
        "get_target_payload_inertia": lambda thread: list(settings.payload.inertia),
        "get_gravity": lambda thread: list(settings.gravity),
        "get_base_acceleration": lambda thread: list(settings.base_acceleration),
        "get_forward_kin": get_forward_kin,
        "get_inverse_kin": get_inverse_kin,
        "get_inverse_kin_has_solution": get_inverse_kin_has_solution,
        "is_steady": lambda thread: past.steady_cycles * step_time >= STEADY_TIME,
        "is_within_safety_limits": is_within_safety_limits,
    }


# --- builtins that ask the controller's model of the arm: Jacobian, mass matrix, Coriolis torques
#
# Source: URScript manual e-Series 5.23, module internals. Chosen: the model carries the declared payload;
# where a program gives no angles or speeds, the measured ones are taken.


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
