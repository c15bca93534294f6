"""The generations: CB3 with software 3.x, the e-Series with 5.x, and PolyScope X with 10.x.

Sources of the electrics and fidelities of the e-Series, cited by letter below:
 A  Rows of a real UR3e (dsn-2022-rad-artifact, 25 Hz RTDE, 2021).
 B  The same and records of a real UR10e (dynamic_calibration of S. Mamedov).
 C  Chosen.
 D  Universal_Robots_ROS_Driver issue 633: 1.3 and 4.1 N within five minutes; ROS2_Driver issue 447: a few
    newtons.
"""

from dataclasses import replace
from datetime import datetime
from math import radians
from typing import Any

from protocol.robot_api import CALLS
from protocol.ur_types import SoftwareVersion
from ur_emulator.machine.models.fidelity import EXACT, IDEAL, POOR, REVERSAL_SPEED, TYPICAL, Ripple
from ur_emulator.machine.models.robot_generation import Builds, Electrics, ForceSensing, RobotGeneration
from ur_emulator.machine.models.safety_limits import ArmLimits, SafetyLimits
from urscript.catalogue import STEP_TIME, Generation

_CB3_BUILDS: Builds = (
    (SoftwareVersion(3, 0), 15547, datetime(2014, 6, 1)),  # build: public issues name 3.0.15547; date chosen
    (SoftwareVersion(3, 2), 19171, datetime(2016, 1, 1)),  # chosen
    (SoftwareVersion(3, 3), 60, datetime(2016, 7, 8, 16, 7, 20)),  # capture of 3.3.1
    (SoftwareVersion(3, 10), 76000, datetime(2019, 5, 3, 6, 39)),  # date: capture of 3.10.0; build chosen
    (SoftwareVersion(3, 15), 106339, datetime(2021, 11, 30)),  # 3.15.8; date of its manual, time chosen
)


CB3 = RobotGeneration(
    name=Generation.CB3.value,
    period_us=round(STEP_TIME[Generation.CB3] * 1e6),
    substep_us=2_000,
    major=3,
    default_version="3.15.8",
    builds=_CB3_BUILDS,
    limits=SafetyLimits(
        reduced_share=0.5,  # chosen: the manual's defaults were not at hand
        recovery_speed=radians(30.0),  # UR3 and UR5/CB3 user manuals
        speed_margin=0.2,  # safety blocks of real installations: 191.5 and 371.5 deg/s
        acceleration=40.0,  # not known; that of a UR5e capture
        # Chosen: in reduced and recovery mode only joint speeds are limited.
        has_programs_in_recovery=True,  # chosen
    ),
    electrics=Electrics(
        main_voltage=48.13,  # recordings of a resting arm
        robot_voltage=48.13,
        joint_voltage=47.92,  # the same: 47.81 to 48.02
        # Chosen: with a tenth of the joints' currents a resting UR3 takes .29 A, as in the same recordings.
        idle_current=0.11,
        joint_temperatures=(28.0, 29.0, 31.0, 36.0, 38.0, 39.0),  # production log of a UR3 (plant.py)
    ),
    force_sensing=ForceSensing(
        has_sensor=False,
        bandwidth=None,
        precision=(10.0, 5.0),  # UR3/CB3 manual
        contact_force=40.0,  # recordings: in moves without contact the estimate of a real UR3 rises to 39 N
        least_averaging=0.2,  # chosen: the drives settle after a motion
        most_averaging=1.0,  # chosen
        filter_time=0.008,  # chosen: a resting arm's estimate has .2 to .4 N of noise
        # The whole loop takes about 30 ms: 16 * .03 leaves more than 60 degrees of phase, and scaling 2 is
        # stable. At half of it an impact at 50 mm/s keeps a wrist at its torque limit until C157.
        control_rate=16.0,
    ),
    execution_time=0.0,  # chosen: the unit is not known
    run_up_time=0.16,  # recordings of a real UR3 and of the maker's simulator: .05 in each of 20 cycles
    gravity=9.82,  # recordings of a real UR3: `target_moment` at rest
    fidelities=(EXACT, IDEAL, TYPICAL, POOR),
    robot_subtype=2,
)


_E_SERIES_BUILDS: Builds = (
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

# The signals of a UR3e at 500 Hz (A of `fidelity.py`), of a UR5e where said (G there).
_SMALLEST_SPEED = 1.4e-45  # smallest float32: the joints filter in float32, whose decay ends there
_SIGNALS: dict[str, Any] = {
    "encoder_sigma": (1.9e-5,) * 6,  # a UR5e: with the step 1.8 to 2.1e-5; the UR3e's log has 1.1 to 1.8e-5
    "speed_sigma": 1e-3,  # what is left of 2-6 mrad/s after the ripple
    "speed_filter_hz": (368.0, 368.0, 217.0, 138.0, 138.0, 138.0),  # by joint size 2, 1, 0
    "speed_dead_band": 1e-3,  # chosen
    "speed_least": _SMALLEST_SPEED,
    "current_sigma": (0.026, 0.026, 0.026, 0.0075, 0.0075, 0.0075),  # a UR5e at rest
    "current_ripple": (0.0,) * 6,  # chosen, as the next two: nothing is known of them
    "servo_dead_band": 0.0,
    "friction_rise": REVERSAL_SPEED,
}
_TYPICAL = replace(
    TYPICAL,
    dead_time=0.0,  # A: the drives add no dead time that shows
    drive_lag=0.0005,  # A: actual_q is .50 ms behind target_q
    ripples=(Ripple(cycles=101.0, rms=0.008), Ripple(cycles=202.0, rms=0.006)),
    feedback_age=0.002,  # the package carries the state of one cycle before
    # Before the first zero; means of a resting UR5e that lie 3 to 6 N apart.
    force_offset=5.0,
    force_drift=0.006,  # -10 N in 1,800 s on a UR10e, linear; D
    force_sigma=0.15,  # A
    force_ratio=30.0,  # A: .003-.005 Nm
    voltage_offset=0.15,  # A: 47.5-47.8
    **_SIGNALS,
)
_IDEAL = replace(IDEAL, feedback_age=0.002, force_sigma=0.01, speed_least=_SMALLEST_SPEED)
_EXACT = replace(EXACT, feedback_age=0.002)
_POOR = replace(  # C
    POOR,
    dead_time=0.004,
    ripples=(Ripple(cycles=101.0, rms=0.016), Ripple(cycles=202.0, rms=0.012)),
    feedback_age=0.004,
    force_offset=10.0,
    force_drift=0.012,
    force_sigma=0.3,
    force_ratio=30.0,
    voltage_offset=0.15,
    **_SIGNALS,
)

E_SERIES = RobotGeneration(
    name=Generation.E_SERIES.value,
    period_us=round(STEP_TIME[Generation.E_SERIES] * 1e6),
    substep_us=2_000,
    major=5,
    default_version="5.15.0",
    builds=_E_SERIES_BUILDS,
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
        clamping_distance=0.028,  # the maker by a user of a UR5e, 5.8; of CB3 arms no report was found
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
        filter_time=0.008,  # C
        control_rate=24.0,  # C: the loop takes about 20 ms
    ),
    execution_time=0.82,  # A: mean while a program runs; .59 to 1.04
    run_up_time=0.0,  # chosen: no recording shows the start of a program
    gravity=9.82,  # B: `target_moment` at rest
    reports_control_as_target=True,  # A
    has_operational_modes=True,
    has_remote_control=True,
    fidelities=(_EXACT, _IDEAL, _TYPICAL, _POOR),
    robot_subtype=3,
    interpreter_since=SoftwareVersion(5, 10),  # UR support page of interpreter mode: "SW 5.10 above"
)


# The arms of the e-Series with software 10.x. A Robot API takes the place of the dashboard.
POLYSCOPE_X = replace(
    E_SERIES,
    name=Generation.POLYSCOPE_X.value,
    major=10,
    default_version="10.11.0",
    builds=((SoftwareVersion(10, 0), 0, datetime(2025, 6, 1)),),  # chosen
    has_remote_in_manual=False,  # PolyScope X manual SW 10.6; README of "Remote Robot Controller"
    dashboard=(),
    robot_api=CALLS,
    # Switched off until somebody enables them under Security, Services. To which 30002 and 30003 belong is
    # chosen.
    services={
        "primary": ("primary", "secondary", "realtime", "primary_ro", "secondary_ro", "realtime_ro"),
        "rtde": ("rtde",),
    },
)
