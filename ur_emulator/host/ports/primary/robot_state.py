"""The robot state of the primary and secondary ports as a function of a snapshot."""

import zlib
from collections.abc import Iterable

import numpy as np

from protocol.primary import layout
from protocol.primary.framing import SubPackage
from protocol.primary.packages import encode_state
from protocol.rtde.types import RobotStatusBits
from protocol.ur_types import SIMULATED_MASTERBOARD, ControlMode, ProgramState, RobotMode, SafetyMode
from ur_emulator.machine.controller.robot_mode import POWERED
from ur_emulator.machine.controller.safety.modes import EMERGENCY_MODES, MOVING_MODES
from ur_emulator.machine.controller.safety.safety_state import ConfiguredLimits, SafetyState
from ur_emulator.machine.controller.snapshot import Snapshot
from ur_emulator.machine.controller.status_words import RUNNING_STATES
from ur_emulator.machine.kinematics.arm_model import ArmModel
from ur_emulator.machine.models.robot_generation import Software
from ur_emulator.machine.models.robot_model import DhRow, RobotModel

# Radius of the sphere around the elbow that the safety system watches [m]. Source: a UR5e capture.
ELBOW_RADIUS = 0.13

# Modes in which the box gets no data of its arm.
_UNCONNECTED = frozenset({RobotMode.NO_CONTROLLER, RobotMode.DISCONNECTED})
_TEACH = int(RobotStatusBits.TEACH_BUTTON_PRESSED)


def safety_checksum(robot: RobotModel, limits: ConfiguredLimits) -> int:
    """Return a checksum of the safety settings: those of the arm and its installation."""
    values = (limits.q_min, limits.q_max, limits.speed, robot.tau_max, robot.payload_max)
    in_space = repr(limits.boundaries) if limits.boundaries else ""
    return zlib.crc32((repr(values) + in_space).encode())


def dexterity(arm: ArmModel, snapshot: Snapshot) -> float:
    """Return the squared determinant of the TCP's Jacobian.

    Source: the only value seen, 0.0035351144, is that of the captured UR5e in the captured pose.
    """
    return float(np.linalg.det(arm.jacobian(snapshot.actual_q, snapshot.tcp_offset)) ** 2)


def state_records(snapshot: Snapshot, checksum: int = 0, dexterity: float = 0.0) -> tuple[SubPackage, ...]:
    """Return the sub-packages that change from state to state."""
    snap = snapshot
    powered = snap.robot_mode in POWERED
    running = snap.runtime_state in RUNNING_STATES
    domains, analog = snap.analog_domains, snap.analog_values
    return (
        layout.RobotModeData(
            timestamp=round(snap.timestamp * 1e6),
            is_real_robot_connected=snap.robot_mode not in _UNCONNECTED,
            is_real_robot_enabled=powered,
            is_robot_power_on=powered,
            is_emergency_stopped=snap.safety_mode in EMERGENCY_MODES,
            is_protective_stopped=snap.safety_mode == SafetyMode.PROTECTIVE_STOP,
            is_program_running=running,
            is_program_paused=snap.runtime_state == ProgramState.PAUSED,
            robot_mode=RobotMode(snap.robot_mode),
            control_mode=ControlMode(snap.control_mode),
            target_speed_fraction=snap.target_speed_fraction,
            speed_scaling=snap.speed_scaling,
        ),
        layout.JointData(
            q_actual=snap.actual_q,
            q_target=snap.target_q,
            qd_actual=snap.actual_qd,
            current_actual=snap.actual_current,
            voltage_actual=snap.actual_joint_voltage,
            temperature_motor=snap.joint_temperatures,
            joint_mode=snap.joint_mode,
        ),
        layout.CartesianInfo(tcp_pose=snap.actual_tcp_pose, tcp_offset=snap.tcp_offset),
        layout.CalibrationData(),
        layout.MasterboardData(
            digital_input_bits=snap.actual_digital_input_bits,
            digital_output_bits=snap.actual_digital_output_bits,
            analog_input_range0=domains[0],
            analog_input_range1=domains[1],
            analog_input0=analog[0],
            analog_input1=analog[1],
            analog_output_domain0=domains[2],
            analog_output_domain1=domains[3],
            analog_output0=analog[2],
            analog_output1=analog[3],
            masterboard_temperature=snap.masterboard_temperature,
            robot_voltage_48v=snap.actual_robot_voltage,
            robot_current=snap.actual_robot_current,
            master_io_current=snap.io_current,
            safety_mode=SafetyMode(snap.safety_mode),
            in_reduced_mode=snap.safety_mode == SafetyMode.REDUCED,
            safety_checksum=checksum,
        ),
        layout.ToolData(
            analog_input_range2=domains[4],
            analog_input_range3=domains[5],
            analog_input2=analog[4],
            analog_input3=analog[5],
            tool_voltage_48v=snap.actual_joint_voltage[-1],
            tool_output_voltage=snap.tool_output_voltage,
            tool_current=snap.tool_output_current,
            tool_temperature=snap.tool_temperature,
            tool_mode=snap.tool_mode,
        ),
        layout.ForceModeData(wrench=snap.actual_tcp_force, robot_dexterity=dexterity),
        layout.AdditionalInfo(
            teach_button_state=int(bool(snap.buttons & _TEACH)),
            freedrive_button_enabled=(
                snap.robot_mode == RobotMode.RUNNING and snap.safety_mode in MOVING_MODES and not running
            ),
            io_enabled_freedrive=snap.is_guided_by_input,
        ),
        layout.SafetyData(safety_checksum=checksum, elbow_sphere=(*snap.elbow_position, ELBOW_RADIUS)),
        layout.ToolCommunicationInfo(*snap.tool_line),
        layout.ToolModeInfo(*snap.tool_output_modes),
        layout.SingularityInfo(),
    )


class StateEncoder:
    """Encodes states for all ports of a box: each snapshot once, however many ports ask for it."""

    def __init__(
        self, software: Software, arm: ArmModel, safety: SafetyState, masterboard: int = SIMULATED_MASTERBOARD
    ) -> None:
        """Prepare what stays; clients know the box by the version of its masterboard."""
        self._software = software
        self._arm = arm
        self._safety = safety
        self._masterboard = masterboard
        self._limits: ConfiguredLimits | None = None
        self._checksum = 0
        self._snapshot: Snapshot | None = None
        self._package = b""

    def encode(self, snapshot: Snapshot) -> bytes:
        """Return the state package of a snapshot."""
        if snapshot is not self._snapshot:
            self._package = self._encode(self._records(snapshot))
            self._snapshot = snapshot
        return self._package

    def encode_first(self, snapshot: Snapshot) -> bytes:
        """Return the longer state, which also has kinematics and configuration."""
        setup = setup_records(self._arm.robot, self._arm.dh, self._safety.limits, self._masterboard)
        return self._encode((*self._records(snapshot), *setup))

    def _encode(self, records: Iterable[SubPackage]) -> bytes:
        return encode_state(records, self._software.version, self._software.sub_packages)

    def _records(self, snapshot: Snapshot) -> tuple[SubPackage, ...]:
        if self._safety.limits is not self._limits:
            self._limits = self._safety.limits
            self._checksum = safety_checksum(self._arm.robot, self._limits)
        return state_records(snapshot, self._checksum, dexterity(self._arm, snapshot))


def setup_records(
    robot: RobotModel,
    calibrated_dh: tuple[DhRow, ...],
    limits: ConfiguredLimits,
    masterboard: int = SIMULATED_MASTERBOARD,
) -> tuple[SubPackage, ...]:
    """Return the sub-packages of the first state of a connection; clients know the box by its masterboard."""
    checksum = zlib.crc32(repr(calibrated_dh).encode())  # of the calibration, the same for every joint
    return (
        layout.KinematicsInfo(
            checksum=(checksum,) * 6,
            dh_theta=tuple(row.theta for row in calibrated_dh),
            dh_a=tuple(row.a for row in calibrated_dh),
            dh_d=tuple(row.d for row in calibrated_dh),
            dh_alpha=tuple(row.alpha for row in calibrated_dh),
        ),
        layout.ConfigurationData(
            joint_min_limit=limits.q_min,
            joint_max_limit=limits.q_max,
            joint_max_speed=limits.speed,
            joint_max_acceleration=(robot.generation.limits.acceleration,) * 6,
            dh_a=tuple(row.a for row in robot.dh),
            dh_d=tuple(row.d for row in robot.dh),
            dh_alpha=tuple(row.alpha for row in robot.dh),
            dh_theta=tuple(row.theta for row in robot.dh),
            masterboard_version=masterboard,
            controller_box_type=robot.box_type,
            robot_type=robot.robot_type,
            robot_sub_type=robot.generation.robot_subtype,
        ),
    )
