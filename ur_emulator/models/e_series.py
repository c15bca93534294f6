"""The e-Series generation: UR3e to UR30 with software 5.x.

Sources of its electrics and fidelities, cited by letter below:
 A  Rows of a real UR3e (dsn-2022-rad-artifact, 25 Hz RTDE, 2021).
 B  The same and records of a real UR10e (dynamic_calibration of S. Mamedov).
 C  Chosen.
 D  Universal_Robots_ROS_Driver issue 633: 1.3 and 4.1 N within five minutes; ROS2_Driver issue 447: a few
    newtons.
Noise of encoders, speeds and currents: as in `fidelity.py`, whose source is a UR3e at 500 Hz.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from math import radians

from protocol.dashboard.commands import COMMANDS
from protocol.primary.layout import SUB_PACKAGES
from protocol.realtime.columns import COLUMNS, VERSIONS
from protocol.rtde.fields import INPUTS, OUTPUTS
from protocol.ur_types import SoftwareVersion
from ur_emulator.models.fidelity import EXACT, IDEAL, POOR, TYPICAL
from ur_emulator.models.measuring import Electrics, ForceSensing
from ur_emulator.models.robot_generation import Builds, RobotGeneration
from ur_emulator.models.safety_limits import ArmLimits, SafetyLimits
from urscript.catalogue import ALL_ROWS, STEP_TIME, Generation

_BUILDS: Builds = (
    (SoftwareVersion(5, 0), 101000, datetime(2018, 6, 1)),  # chosen
    (SoftwareVersion(5, 8), 10253, datetime(2020, 2, 11)),  # chosen
    (SoftwareVersion(5, 9), 1031110, datetime(2020, 10, 1)),  # build: program files of 5.9.1; date chosen
    (SoftwareVersion(5, 11, 9), 1010452, datetime(2022, 1, 24)),  # a real robot's answer to PolyscopeVersion
    (SoftwareVersion(5, 11, 11), 1010452, datetime(2022, 4, 11, 7, 48, 21)),  # date: capture
    (SoftwareVersion(5, 12), 1101319, datetime(2022, 3, 22)),  # PolyscopeVersion
    (SoftwareVersion(5, 12, 1), 1101497, datetime(2022, 6, 20)),  # log of a real robot
    (SoftwareVersion(5, 12, 2), 1101497, datetime(2022, 6, 28, 11, 30, 43)),  # date: capture
    (SoftwareVersion(5, 15), 126572, datetime(2023, 10, 1)),  # build: folder of URSim 5.15.0; date chosen
    (SoftwareVersion(5, 22, 1), 1214860, datetime(2025, 6, 5)),  # PolyscopeVersion of a real UR12e
    (SoftwareVersion(5, 24), 1214860, datetime(2025, 10, 4, 0, 25, 33)),  # date: UR client library's bytes
)

_TYPICAL = replace(
    TYPICAL,
    dead_time=0.0,  # A: the drives add no dead time that shows
    dead_time_spread=0.0,
    drive_lag=0.0005,  # A: actual_q is .50 ms behind target_q
    feedback_age=0.002,  # the package carries the state of one cycle before
    force_offset=5.0,  # C: before the first zero
    force_bias=4.0,  # D
    force_sigma=0.15,  # A
    force_ratio=30.0,  # A: .003-.005 Nm
    force_friction=0.0,
)
_IDEAL = replace(IDEAL, dead_time=0.0, drive_lag=0.0, feedback_age=0.002, force_sigma=0.01)
_EXACT = replace(EXACT, dead_time=0.0, drive_lag=0.0, feedback_age=0.002)
_POOR = replace(  # C
    POOR,
    dead_time=0.002,
    dead_time_spread=0.002,
    drive_lag=0.002,
    feedback_age=0.004,
    force_offset=10.0,
    force_bias=8.0,
    force_sigma=0.3,
    force_ratio=30.0,
    force_friction=0.0,
)

E_SERIES = RobotGeneration(
    name=Generation.E_SERIES.value,
    period_us=round(STEP_TIME[Generation.E_SERIES] * 1e6),
    substep_us=2_000,
    major=5,
    default_version="5.15.0",
    builds=_BUILDS,
    limits=SafetyLimits(
        holding_deviation=0.3,  # chosen: twice that of a moving arm
        reduced_share=1.0,  # installations: the limits of reduced mode are those of normal mode
        recovery_speed=radians(30.0),  # PolyScope X manual
        speed_margin=0.2,  # configuration data of a UR5e capture: pi + .2 rad/s
        acceleration=40.0,  # the same capture
        reduced=ArmLimits(tool_speed=0.75),  # default of installations
        # UR5e hardware manual 2022
        recovery=ArmLimits(tool_speed=0.25, force=100.0, power=80.0, momentum=10.0),
        manual=ArmLimits(tool_speed=0.25),  # chosen: reduced speed of ISO 10218-1
        has_programs_in_recovery=False,  # UR5e hardware manual 2022
        # Chosen; UR10e manual: the software adjusts accelerations to mass, centre and inertia of the payload.
        brakes_within_torque=True,
    ),
    electrics=Electrics(
        main_voltage=47.8,  # A
        robot_voltage=47.9,  # A
        joint_voltage=47.65,  # A: 47.5-47.8
        idle_current=0.5,  # A: .69-1.28 A in motion
        joint_temperatures=(34.0, 34.5, 36.0, 40.0, 41.0, 42.0),  # A: 34-43, wrists as on the UR3
    ),
    force_sensing=ForceSensing(
        has_sensor=True,
        bandwidth=100.0,  # C: no figure is known
        precision=(3.5, 0.2),  # UR5e data sheet
        contact_force=5.0,  # C: more than noise and drift make of it
        least_averaging=0.02,  # C
        most_averaging=0.1,  # C
        filter_time=0.008,  # C: a third of a CB3's, whose noise is twenty times as great
        control_rate=24.0,  # C: the loop takes a third of the time of a CB3's, about 20 ms
    ),
    execution_time=0.82,  # A: mean while a program runs; .59 to 1.04
    gravity=9.82,  # B: `target_moment` at rest
    reports_control_as_target=True,  # A
    has_operational_modes=True,
    has_remote_control=True,
    fidelities=(_EXACT, _IDEAL, _TYPICAL, _POOR),
    robot_subtype=3,
    dashboard=COMMANDS,
    realtime=COLUMNS,
    frame_sizes=VERSIONS,
    sub_packages=SUB_PACKAGES,
    rtde_outputs=OUTPUTS,
    rtde_inputs=INPUTS,
    builtins=ALL_ROWS,
    interpreter_since=SoftwareVersion(5, 10),  # UR support page of interpreter mode: "SW 5.10 above"
)
