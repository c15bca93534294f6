"""A second generation, unlike CB3 in every field: what the box decides by its generation shows on it."""

from dataclasses import replace
from datetime import datetime

from protocol.dashboard.commands import COMMANDS
from protocol.primary.layout import ForceModeData
from protocol.robot_api import CALLS
from protocol.ur_types import SoftwareVersion
from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.models.robot_generation import Electrics, ForceSensing, RobotGeneration
from ur_emulator.machine.models.safety_limits import ArmLimits, SafetyLimits

MISSING_BUILTIN = "popup"

SECOND = RobotGeneration(
    name="second series",
    period_us=4_000,
    substep_us=1_000,
    major=5,
    default_version="5.1.0",
    builds=((SoftwareVersion(5, 0), 77, datetime(2031, 2, 3)),),
    limits=SafetyLimits(
        reduced_share=0.25,
        recovery_speed=0.1,
        speed_margin=0.1,
        acceleration=55.0,
        reduced=ArmLimits(tool_speed=0.5),
        recovery=ArmLimits(tool_speed=0.2, force=90.0, power=70.0, momentum=9.0),
        manual=ArmLimits(tool_speed=0.3),
        has_programs_in_recovery=False,
        brakes_within_torque=True,
    ),
    electrics=Electrics(
        main_voltage=47.0,
        robot_voltage=46.0,
        joint_voltage=45.0,
        idle_current=0.4,
        joint_temperatures=(21.0, 22.0, 23.0, 24.0, 25.0, 26.0),
    ),
    force_sensing=ForceSensing(
        has_sensor=True,
        bandwidth=50.0,
        precision=(4.0, 0.3),
        contact_force=6.0,
        least_averaging=0.04,
        filter_time=0.02,
        control_rate=9.0,
        most_averaging=0.2,
    ),
    execution_time=1.5,
    run_up_time=0.2,
    gravity=9.83,
    reports_control_as_target=True,
    has_operational_modes=True,
    has_remote_control=True,
    has_remote_in_manual=False,
    fidelities=tuple(
        replace(it, dead_time=it.dead_time + 0.004, force_sigma=0.15)
        for it in CB3.fidelities
        if it.name != "poor"
    ),
    robot_subtype=3,
    dashboard=tuple(
        replace(row, replies={"ok": f"second: {row.replies['ok']}"})
        for row in COMMANDS
        if row.name in ("PolyscopeVersion", "robotmode", "running", "power off", "quit")
    ),
    robot_api=CALLS,
    services={"radio": ()},
    realtime=tuple(column for column in CB3.realtime if column.since_size <= 1060),
    frame_sizes=((SoftwareVersion(5, 0), 1044), (SoftwareVersion(5, 1), 1060)),
    sub_packages=tuple(record for record in CB3.sub_packages if record is not ForceModeData),
    rtde_outputs=tuple(field for field in CB3.rtde_outputs if field.name != "actual_momentum"),
    rtde_inputs=tuple(field for field in CB3.rtde_inputs if field.name != "speed_slider_mask"),
    builtins=tuple(row for row in CB3.builtins if row.name != MISSING_BUILTIN),
    interpreter_since=SoftwareVersion(5, 1),
)
