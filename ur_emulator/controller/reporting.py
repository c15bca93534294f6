"""The snapshot of a cycle: the records of target, sensors and box one after the other."""

from __future__ import annotations

from protocol.rtde.types import SafetyStatusBits
from ur_emulator.controller.arm_in_space import ArmInSpace
from ur_emulator.controller.compliance.external_sensor import VARIABLE
from ur_emulator.controller.programs import Programs
from ur_emulator.controller.robot_mode import JOINT_VECTORS
from ur_emulator.controller.safety.enabling_device import ACTIVE
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.controller.state import ControllerState
from ur_emulator.models.robot_model import ZERO6
from ur_emulator.plant.plant_state import PlantState

# Run time of a unit of work [ms]. Source: urscript.catalogue.costs.
_UNIT_TIME = 50e-6
_ENABLING_BIT = int(SafetyStatusBits.THREE_POSITION_ENABLING_INPUT_ACTIVE)


def make_snapshot(state: ControllerState, programs: Programs, sensed: PlantState) -> Snapshot:
    """Return everything that any port may publish of this cycle.

    The target is the one with which the cycle began: target and measurements are of the same moment.

    Args:
        state: after commands, scripts, motion and safety.
        programs: for the program state and line.
        sensed: state of the arm, as `Plant.report` gives it.
    """
    target = state.past.target
    arm, clock, sensor, wrench = state.arm, state.clock, state.force_sense.sensor, sensed.tcp_force
    if sensor is not None:
        wrench = sensor.wrench_at_flange(state.client_inputs.get(VARIABLE, ZERO6), arm.fk(sensed.actual_q))
    wrench = state.force_sense.measure(wrench)
    tcp = state.tool.tcp_offset
    space = ArmInSpace(
        arm,
        (target.q, target.qd),
        target.qdd,
        (sensed.actual_q, sensed.actual_qd),
        wrench,
        tcp if any(tcp) else None,
        force_at_flange=state.force_sense.refers_to_flange,
    )
    mode, safety_mode = state.mode.mode, state.safety.mode
    speed, tool, io, compliance = state.speed, state.tool, state.io, state.compliance
    payload, own_time = tool.payload, clock.generation.execution_time
    analog, euromap = io.analog, io.euromap
    return Snapshot(
        clock.tick,
        clock.time,
        *target,
        *sensed,  # type: ignore[arg-type]  # mypy takes the second tuple for one of any length
        robot_mode=int(mode),
        joint_mode=JOINT_VECTORS[mode, safety_mode],
        safety_mode=int(safety_mode),
        safety_status=int(state.safety.status),
        enabling_bit=_ENABLING_BIT if state.enabling_device.state in ACTIVE else 0,
        speed_scaling=speed.share,
        target_speed_fraction=speed.slider,
        runtime_state=int(programs.runtime_state),
        program_name=programs.name,
        script_control_line=programs.line if programs.reports_line else 0,
        control_mode=int(compliance.mode),
        is_guided_by_input=compliance.by_input,
        buttons=state.operator.buttons,
        payload=payload.mass,
        payload_cog=payload.cog,
        payload_inertia=payload.inertia,
        tcp_offset=tool.tcp_offset,
        actual_digital_input_bits=io.digital_in,
        actual_digital_output_bits=io.digital_out,
        analog_values=analog.values,
        analog_domains=analog.domains,
        tool_output_voltage=io.tool_voltage,
        tool_output_modes=io.tool_output_modes,
        tool_line=io.tool_line,
        euromap_inputs=euromap.inputs,
        euromap_outputs=euromap.outputs,
        registers=state.registers.values(),
        encoder_counts=state.encoders.counts,
        gravity=tool.gravity,
        base_acceleration=tool.base_acceleration,
        energy_consumed=state.energy.consumed,
        actual_execution_time=own_time + _UNIT_TIME * programs.work if own_time else 0.0,
        space=space,
        supply=arm.robot.generation.electrics,
    )
