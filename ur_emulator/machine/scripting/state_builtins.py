"""Builtins that read the robot: state, clock, kinematics and dynamics. They take no robot time.

Actual and target values are those at the end of the last cycle, constant while the scripts of a cycle run. So
the target that a script reads is the one that the packages of its cycle show.

Jacobian, mass matrix and Coriolis torques are those of the controller's model. Source: URScript manual
e-Series 5.23, module internals. Chosen: the model carries the declared payload; where a program gives no
angles or speeds, the measured ones are taken.
"""

import math
from typing import Any

from ur_emulator.machine.controller.arm_dynamics import ArmDynamics
from ur_emulator.machine.controller.clock import CLOCK_EPOCH, Clock
from ur_emulator.machine.controller.past_cycles import PastCycles
from ur_emulator.machine.models.robot_model import ZERO6, Vector6, six
from ur_emulator.machine.scripting.builtin_group import BuiltinGroup, ScriptArm, builtin, floats
from urscript import HostFunction, ScriptRuntimeError, ScriptThread
from urscript.values import Matrix, Pose, Struct

# is_steady(): zero target velocity for this long [s]. Source: URScript manual, later text of is_steady.
STEADY_TIME = 0.5
# Mode of `time`. Source: script manual e-Series 5.19, time: modes, seconds since 1970.
_SYSTEM_CLOCK = 2
# Units of work of an iteration of the inverse kinematics (32 µs): 2 or 3 along a path, 160 for a pose that is
# just out of reach.
_ITERATION = 650
# So many are in what a call costs anyway, see `urscript.catalogue.costs`.
_INCLUDED = 5


class StateBuiltins(BuiltinGroup):
    """State and clock, kinematics and dynamics of the arm."""

    def __init__(self, arm: ScriptArm, dynamics: ArmDynamics, past: PastCycles, clock: Clock) -> None:
        self._arm = arm
        self._dynamics = dynamics
        self._past = past
        self._clock = clock

    def functions(self) -> dict[str, HostFunction]:
        """Return the builtins."""
        arm, past, settings, step_time = self._arm, self._past, self._arm.settings, self._clock.period_s
        model, motion, dynamics = arm.model, arm.motion, self._dynamics
        joints, speeds, tool = self._joints, self._speeds, self._tool
        return super().functions() | {
            "get_actual_joint_positions": lambda thread: list(past.sensed.actual_q),
            "get_target_joint_positions": lambda thread: list(motion.target.q),
            "get_joint_positions": lambda thread: list(motion.path.q),
            "get_joint_speeds": lambda thread: list(past.sensed.actual_qd),
            "get_actual_joint_speeds": lambda thread: list(past.sensed.actual_qd),
            "get_target_joint_speeds": lambda thread: list(motion.target.qd),
            "get_actual_joint_accelerations": lambda thread: list(past.joint_accelerations()),
            "get_target_joint_accelerations": lambda thread: list(motion.target.qdd),
            "get_target_waypoint": lambda thread: Pose.of(arm.tcp_pose(motion.goal)),
            "get_joint_temp": lambda thread, j: past.sensed.joint_temperatures[j],
            "get_tool_temp": lambda thread: past.sensed.joint_temperatures[-1],
            "get_controller_temp": lambda thread: past.snapshot.masterboard_temperature,
            "get_actual_tcp_pose": lambda thread: Pose.of(arm.tcp_pose(past.sensed.actual_q)),
            "tool_pose": lambda thread: Pose.of(arm.tcp_pose(past.sensed.actual_q)),
            "get_target_tcp_pose": lambda thread: Pose.of(arm.tcp_pose(motion.target.q)),
            "get_actual_tool_flange_pose": lambda thread: Pose.of(model.fk(past.sensed.actual_q)),
            "get_actual_tcp_speed": lambda thread: Pose.of(
                arm.tcp_speed(past.sensed.actual_q, past.sensed.actual_qd)
            ),
            "get_target_tcp_speed": lambda thread: Pose.of(arm.tcp_speed(motion.target.q, motion.target.qd)),
            "get_tcp_force": lambda thread: Pose.of(past.snapshot.actual_tcp_force),
            "force": lambda thread: math.hypot(*past.snapshot.actual_tcp_force[:3]),
            "get_tcp_offset": lambda thread: Pose.of(settings.tcp_offset),
            "get_tool_accelerometer_reading": lambda thread: list(past.sensed.actual_tool_accelerometer),
            "get_tool_current": lambda thread: past.snapshot.tool_output_current,
            "get_steptime": lambda thread: step_time,
            "get_target_payload": lambda thread: settings.payload.mass,
            "get_target_payload_cog": lambda thread: list(settings.payload.cog),
            "get_target_payload_inertia": lambda thread: list(settings.payload.inertia),
            "get_gravity": lambda thread: list(settings.gravity),
            "get_base_acceleration": lambda thread: list(settings.base_acceleration),
            "is_steady": lambda thread: past.steady_cycles * step_time >= STEADY_TIME,
            "get_forward_kin": lambda thread, q, tcp: Pose.of(model.fk(joints(q), tool(tcp))),
            "get_jacobian": lambda thread, q, tcp: Matrix(model.jacobian(joints(q), tool(tcp)).tolist()),
            "get_jacobian_time_derivative": lambda thread, q, qd, tcp: Matrix(
                model.jacobian_rate(joints(q), speeds(qd), tool(tcp)).tolist()
            ),
            "get_mass_matrix": lambda thread, q, with_rotors: Matrix(
                dynamics.mass_matrix(joints(q), with_rotors=with_rotors).tolist()
            ),
            "get_coriolis_and_centrifugal_torques": lambda thread, q, qd: dynamics.velocity_torque(
                joints(q), speeds(qd)
            ).tolist(),
        }

    @builtin("time")
    def _time(self, thread: object, mode: float = 0) -> Struct:
        seconds, rest = divmod(self._clock.tick * self._clock.generation.period_us, 1_000_000)
        if mode == _SYSTEM_CLOCK:
            seconds += int(CLOCK_EPOCH.timestamp())
        return Struct({"sec": seconds, "nanosec": rest * 1000})

    @builtin("get_actual_joint_positions_history")
    def _joint_positions_history(self, thread: object, steps: int) -> list[float]:
        history = self._past.q_history
        if not steps < len(history):
            raise ScriptRuntimeError(
                f"get_actual_joint_positions_history: {steps} steps back; allowed: 0 to {len(history) - 1}"
            )
        return list(history[steps])

    @builtin("get_joint_torques")
    def _joint_torques(self, thread: object) -> list[float]:
        sensed = self._past.sensed
        return [
            k * (actual - target)
            for k, actual, target in zip(
                self._arm.robot.torque_constant, sensed.actual_current, sensed.target_current, strict=True
            )
        ]

    @builtin("get_inverse_kin")
    def _inverse_kin(
        self, thread: ScriptThread, x: Pose, qnear: Any, position_error: float, turn_error: float, tcp: Any
    ) -> list[float]:
        solution = self._inverse(thread, x, qnear, tcp)
        if solution is None:
            raise ScriptRuntimeError(
                "get_inverse_kin: unable to find an inverse kinematics solution for the requested pose"
            )
        return list(solution)

    @builtin("get_inverse_kin_has_solution")
    def _has_inverse_kin(
        self, thread: ScriptThread, x: Pose, qnear: Any, position_error: float, turn_error: float, tcp: Any
    ) -> bool:
        return self._inverse(thread, x, qnear, tcp) is not None

    @builtin("is_within_safety_limits")
    def _is_within_safety_limits(self, thread: ScriptThread, pose: Any, qnear: Any) -> bool:
        q = self._inverse(thread, pose, qnear, None) if isinstance(pose, Pose) else tuple(pose)
        boundaries = self._arm.safety.boundaries
        if q is None or not self._arm.safety.limits.allow(q):
            return False
        return (
            not boundaries
            or boundaries.find_crossed(self._arm.model.state(q, ZERO6, self._arm.settings.tcp_offset)) is None
        )

    def _inverse(self, thread: ScriptThread, pose: Pose, q_near: Any, tcp: Any) -> tuple[float, ...] | None:
        model = self._arm.model
        solution = model.inverse(tuple(pose), self._joints(q_near), self._tool(tcp))
        thread.charge(0, _ITERATION * max(0, model.n_iterations - _INCLUDED))
        return solution

    def _joints(self, q: Any) -> Vector6:
        return self._past.sensed.actual_q if q is None else floats(q)

    def _speeds(self, qd: Any) -> Vector6:
        return self._past.sensed.actual_qd if qd is None else floats(qd)

    def _tool(self, tcp: Any) -> Vector6:
        return self._arm.settings.tcp_offset if tcp is None else six(tcp)
