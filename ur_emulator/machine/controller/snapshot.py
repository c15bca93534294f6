"""Everything that any port can publish at the end of a cycle, frozen.

A snapshot has the records of its owners one after the other: the target of the motion, the measurements of
the plant, the state of the box; and the arm in space, which is computed when it is read. Names are those of
the realtime columns, lower-cased (`actual_TCP_pose` on the wire is `actual_tcp_pose` here), so that a frame
is a pure function of a snapshot and a layout table.
"""

import math
from typing import Any, NamedTuple

from protocol.realtime.layout import SNAPSHOT_FIELDS
from protocol.rtde.types import RobotStatusBits, TimeScaleSource
from protocol.ur_types import JointMode
from ur_emulator.machine.controller import electrics
from ur_emulator.machine.controller.arm_in_space import ArmInSpace
from ur_emulator.machine.controller.io.lines import CONFIGURABLE, STANDARD, TOOL, ToolLine
from ur_emulator.machine.controller.io.registers import RegisterValues
from ur_emulator.machine.controller.robot_mode import POWERED
from ur_emulator.machine.controller.safety.limit_checks import MAX_POSITION_DEVIATION, torque_shares
from ur_emulator.machine.controller.status_words import RUNNING_STATES, safety_status_bits
from ur_emulator.machine.models.robot_generation import Electrics
from ur_emulator.machine.models.robot_model import ZERO6, Vector3, Vector6, six

_BOX_OUTPUTS = STANDARD.mask | CONFIGURABLE.mask

# The tool has fewer modes than a joint: what it reports when the last joint is in one of the others.
TOOL_MODES: dict[int, JointMode] = {
    JointMode.BACKDRIVE: JointMode.RUNNING,
    JointMode.FREEDRIVE: JointMode.RUNNING,
    JointMode.READY_FOR_POWER_OFF: JointMode.SHUTTING_DOWN,
    JointMode.VIOLATION: JointMode.FAULT,
}


class _Fields(NamedTuple):
    """The fields of a snapshot."""

    tick: int
    timestamp: float  # since the start of the controller [s]
    # --- JointTarget
    target_q: Vector6
    target_qd: Vector6
    target_qdd: Vector6
    # --- PlantState
    actual_q: Vector6
    actual_qd: Vector6
    actual_current: Vector6
    joint_voltage: Vector6
    actual_tool_accelerometer: Vector3
    estimated_force: Vector6
    joint_temperatures: Vector6
    target_current: Vector6
    target_moment: Vector6
    joint_control_output: Vector6
    torque_saturated: bool
    position_error: Vector6
    # --- the box; analogue lines in the order standard inputs, standard outputs, tool inputs
    robot_mode: int
    joint_mode: tuple[int, ...]
    safety_mode: int
    safety_status: int
    enabling_bit: int
    speed_scaling: float
    target_speed_fraction: float
    runtime_state: int
    program_name: str
    script_control_line: int
    control_mode: int
    is_guided_by_input: bool
    buttons: int
    payload: float
    payload_cog: Vector3
    payload_inertia: Vector6
    tcp_offset: Vector6
    actual_digital_input_bits: int
    actual_digital_output_bits: int
    analog_values: tuple[float, ...]
    analog_domains: tuple[int, ...]
    tool_output_voltage: int
    gripper_current: float
    tool_output_modes: tuple[int, int, int]
    tool_line: ToolLine
    euromap_inputs: int
    euromap_outputs: int
    registers: RegisterValues
    encoder_counts: tuple[int, int]
    gravity: Vector3
    base_acceleration: Vector3
    energy_consumed: float
    actual_execution_time: float
    # --- computed when it is read
    space: ArmInSpace
    supply: Electrics


class Snapshot(_Fields):
    """State of the box at the end of a control cycle; SI units, base frame, vectors as tuples of floats."""

    __slots__ = ()

    def as_dict(self) -> dict[str, Any]:
        """Return all fields and all columns of the realtime interface by name."""
        fields = dict(zip(self._fields, self, strict=True))
        del fields["space"], fields["supply"]
        return fields | {name: getattr(self, name) for name in SNAPSHOT_FIELDS}

    # --- the arm in space

    @property
    def actual_tcp_pose(self) -> Vector6:
        """Pose of the tool centre point [m, rad]."""
        return self.space.actual.tcp_pose

    @property
    def actual_tcp_speed(self) -> Vector6:
        """Twist of the tool centre point [m/s, rad/s]."""
        return self.space.actual.tcp_speed

    @property
    def actual_tcp_force(self) -> Vector6:
        """Wrench at the tool centre point, on arms with a force sensor at the flange [N, Nm]."""
        return self.space.reported_force

    @property
    def ft_raw_wrench(self) -> Vector6:
        """What a sensor at the flange measures, without a zero and with the payload, its axes [N, Nm]."""
        return self.space.in_flange_axes(self.estimated_force, self.payload, self.payload_cog, self.gravity)

    @property
    def target_tcp_pose(self) -> Vector6:
        """Pose of the tool centre point at the target [m, rad]."""
        return self.space.target.tcp_pose

    @property
    def target_tcp_speed(self) -> Vector6:
        """Twist of the tool centre point at the target [m/s, rad/s]."""
        return self.space.target.tcp_speed

    @property
    def elbow_position(self) -> Vector3:
        """Of the measured arm [m]."""
        return self.space.actual.elbow_position

    @property
    def elbow_velocity(self) -> Vector3:
        """Of the measured arm [m/s]."""
        return self.space.actual.elbow_velocity

    @property
    def actual_momentum(self) -> float:
        """Norm of the linear momentum of the measured arm [kg m/s]."""
        return self.space.actual.momentum

    # --- power

    @property
    def actual_main_voltage(self) -> float:
        """Voltage of the box [V]."""
        return self.supply.main_voltage

    @property
    def actual_robot_voltage(self) -> float:
        """Voltage of the arm's bus [V]."""
        return self.supply.robot_voltage if self.robot_mode in POWERED else 0.0

    @property
    def actual_robot_current(self) -> float:
        """Current on the arm's bus [A]."""
        if self.robot_mode not in POWERED:
            return 0.0
        return electrics.arm_current(self.supply, self.actual_current)

    @property
    def actual_joint_voltage(self) -> Vector6:
        """Supply voltages of the joints [V]."""
        return self.joint_voltage if self.robot_mode in POWERED else ZERO6

    # --- words and values that follow from others

    @property
    def robot_status_bits(self) -> int:
        """Power, program and buttons, as RobotStatusBits."""
        power = RobotStatusBits.POWER_ON if self.robot_mode in POWERED else 0
        running = RobotStatusBits.PROGRAM_RUNNING if self.runtime_state in RUNNING_STATES else 0
        return int(power | running) | self.buttons

    @property
    def safety_status_bits(self) -> int:
        """The safety status and the enabling device, as SafetyStatusBits."""
        return safety_status_bits(self.safety_status) | self.enabling_bit

    @property
    def tcp_force_scalar(self) -> float:
        """Norm of the force part of `actual_tcp_force` [N]."""
        return math.hypot(*self.actual_tcp_force[:3])

    @property
    def tool_mode(self) -> int:
        """JointMode of the tool."""
        return int(TOOL_MODES.get(self.joint_mode[-1], self.joint_mode[-1]))

    @property
    def io_current(self) -> float:
        """Current of the box's outputs [A]."""
        return electrics.OUTPUT_CURRENT * (self.actual_digital_output_bits & _BOX_OUTPUTS).bit_count()

    @property
    def tool_output_current(self) -> float:
        """Current out of the tool's supply [A]; 0 while it is off."""
        if not self.tool_output_voltage:
            return 0.0
        switched = electrics.OUTPUT_CURRENT * (self.actual_digital_output_bits & TOOL.mask).bit_count()
        return self.tool_output_voltage / electrics.TOOL_RESISTANCE + switched + self.gripper_current

    @property
    def tool_temperature(self) -> float:
        """Temperature of the tool's board [degree C]: that of the last joint, on which it sits."""
        return self.joint_temperatures[-1]

    @property
    def masterboard_temperature(self) -> float:
        """Temperature inside the box [degree C]."""
        return electrics.board_temperature(self.timestamp)

    @property
    def analog_io_types(self) -> int:
        """Bits 0, 1: domains of the standard inputs; 2, 3: of the standard outputs."""
        return sum(domain << i for i, domain in enumerate(self.analog_domains[:4]))

    @property
    def tool_analog_input_types(self) -> int:
        """Bits 0, 1: domains of the tool inputs."""
        return sum(domain << i for i, domain in enumerate(self.analog_domains[4:]))

    @property
    def configurable_inputs(self) -> int:
        """The configurable inputs, bit 0 the first."""
        return CONFIGURABLE.levels(self.actual_digital_input_bits)

    @property
    def configurable_outputs(self) -> int:
        """The configurable outputs, bit 0 the first."""
        return CONFIGURABLE.levels(self.actual_digital_output_bits)

    @property
    def target_base_acceleration(self) -> Vector6:
        """Of the base [m/s^2, rad/s^2]; programs can set the linear part only."""
        return (*self.base_acceleration, 0.0, 0.0, 0.0)

    @property
    def target_base_wrench(self) -> Vector6:
        """What holds the base of the arm, with the declared payload, at the target [N, Nm]."""
        return self.space.target_base_wrench(self.gravity, self.payload, self.payload_cog)

    # --- how far the joints are from protective stops

    @property
    def actual_current_window(self) -> Vector6:
        """By how much the currents may differ from their targets [A]: here only torques are limited."""
        robot = self.space.arm.robot
        return six([tau / k for tau, k in zip(robot.tau_max, robot.torque_constant, strict=True)])

    @property
    def actual_current_as_torque(self) -> Vector6:
        """The joints' currents as torques [Nm]."""
        constants = self.space.arm.robot.torque_constant
        return six([k * current for k, current in zip(constants, self.actual_current, strict=True)])

    @property
    def joint_position_deviation_ratio(self) -> float:
        """Greatest deviation of a joint, as a share of what the limit checks allow."""
        return max(map(abs, self.position_error)) / MAX_POSITION_DEVIATION

    @property
    def collision_detection_ratio(self) -> float:
        """Greatest torque that a drive is asked for, as a share of what it has."""
        return max(torque_shares(self.space.arm.robot, self.joint_control_output))

    @property
    def time_scale_source(self) -> int:
        """TimeScaleSource: the limits of a safety mode are those of joint speeds before all."""
        if self.runtime_state not in RUNNING_STATES:
            return TimeScaleSource.PROGRAM_NOT_RUNNING
        return TimeScaleSource.NOT_SCALED if self.speed_scaling == 1.0 else TimeScaleSource.JOINT_SPEED
