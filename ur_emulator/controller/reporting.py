"""What a cycle has come to, as a snapshot: measured, derived and constant values side by side."""

from __future__ import annotations

from collections.abc import Iterable

from ur_emulator.controller.external_sensor import VARIABLE
from ur_emulator.controller.force_sense import moved_wrench
from ur_emulator.controller.robot_mode import JOINT_VECTORS, POWERED
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.controller.state import ControllerState
from ur_emulator.motion.target import ZERO6, JointTarget
from ur_emulator.plant.plant_state import PlantState
from ur_emulator.scripting.program_slot import ProgramSlot

# Bus voltage and idle current of the box; modelled, chosen from captures of resting arms (48 V bus).
BUS_VOLTAGE = 48.0
IDLE_CURRENT = 0.25


def make_snapshot(
    state: ControllerState, programs: ProgramSlot, target: JointTarget, sensed: PlantState
) -> Snapshot:
    """Return everything that any port may publish of this cycle.

    Args:
        state: after commands, scripts, motion and safety.
        programs: for what runs, and where.
        target: set-point at the end of the cycle.
        sensed: what the box reads from its arm.
    """
    arm = state.arm
    tcp = state.tcp_offset if any(state.tcp_offset) else None
    target_pose, target_speed, _, _ = arm.state(target.q, target.qd, tcp)
    pose, speed, elbow_position, elbow_velocity = arm.state(sensed.actual_q, sensed.actual_qd, tcp)
    sensor, wrench = state.external_sensor, sensed.tcp_force
    if sensor is not None:
        wrench = sensor.wrench_at_flange(state.client_inputs.get(VARIABLE, ZERO6), arm.fk(sensed.actual_q))
    wrench = state.force_sense.take(wrench)
    mode, safety_mode = state.mode.mode, state.safety.mode
    limiter = state.limiter
    powered = mode in POWERED
    return Snapshot(
        tick=state.tick,
        timestamp=state.time,
        target_q=target.q,
        target_qd=target.qd,
        target_qdd=target.qdd,
        target_current=sensed.target_current,
        target_moment=sensed.target_moment,
        actual_q=sensed.actual_q,
        actual_qd=sensed.actual_qd,
        actual_current=sensed.actual_current,
        joint_control_output=sensed.joint_control_output,
        actual_tcp_pose=pose,
        actual_tcp_speed=speed,
        actual_tcp_force=wrench if tcp is None else moved_wrench(wrench, arm.fk(sensed.actual_q), pose),
        target_tcp_pose=target_pose,
        target_tcp_speed=target_speed,
        actual_digital_input_bits=state.io.digital_in,
        joint_temperatures=sensed.joint_temperatures,
        actual_execution_time=0.0,
        robot_mode=int(mode),
        joint_mode=JOINT_VECTORS[mode, safety_mode],
        safety_mode=int(safety_mode),
        actual_tool_accelerometer=sensed.tool_accelerometer,
        speed_scaling=1.0 if limiter is None else limiter.share(state.speed_slider),
        actual_momentum=arm.momentum(),
        actual_main_voltage=BUS_VOLTAGE,
        actual_robot_voltage=BUS_VOLTAGE if powered else 0.0,
        actual_robot_current=IDLE_CURRENT + _bus_current(sensed.actual_current) if powered else 0.0,
        actual_joint_voltage=sensed.joint_voltage if powered else ZERO6,
        actual_digital_output_bits=state.io.digital_out,
        runtime_state=int(programs.runtime_state),
        elbow_position=elbow_position,
        elbow_velocity=elbow_velocity,
        safety_status=int(safety_mode),
        payload=state.payload.mass,
        payload_cog=state.payload.cog,
        payload_inertia=state.payload.inertia,
        target_speed_fraction=state.speed_slider,
        tcp_offset=state.tcp_offset,
        program_name=programs.name,
        analog_values=state.io.analog.values,
        analog_domains=state.io.analog.domains,
        tool_output_voltage=state.io.tool_voltage,
        euromap_inputs=state.io.euromap.inputs,
        euromap_outputs=state.io.euromap.outputs,
        registers=state.registers.values(),
        control_mode=int(state.compliance.mode),
        is_guided_by_input=state.compliance.by_input,
        buttons=state.buttons,
        script_control_line=programs.line if state.wants_script_line else 0,
    )


def _bus_current(currents: Iterable[float]) -> float:
    """Return a plausible current on the 48 V bus for joint currents [A]: the drives chop, a tenth shows."""
    return 0.1 * sum(map(abs, currents))
