"""The CB3 generation: UR3, UR5 and UR10 with software 3.x."""

from __future__ import annotations

from datetime import datetime
from math import radians

from protocol.dashboard.commands import COMMANDS
from protocol.primary.layout import SUB_PACKAGES
from protocol.realtime.columns import COLUMNS, VERSIONS
from protocol.rtde.fields import INPUTS, OUTPUTS
from protocol.ur_types import SoftwareVersion
from ur_emulator.models.fidelity import FIDELITIES
from ur_emulator.models.measuring import Electrics, ForceSensing
from ur_emulator.models.robot_generation import Builds, RobotGeneration
from ur_emulator.models.safety_limits import UNLIMITED, SafetyLimits
from urscript.catalogue import ALL_ROWS, STEP_TIME, Generation

_BUILDS: Builds = (
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
    builds=_BUILDS,
    limits=SafetyLimits(
        reduced_share=0.5,  # chosen: the manual's defaults were not at hand
        recovery_speed=radians(30.0),  # UR3 and UR5/CB3 user manuals
        speed_margin=0.2,  # safety blocks of real installations: 191.5 and 371.5 deg/s
        acceleration=40.0,  # not known; that of a UR5e capture
        reduced=UNLIMITED,  # chosen: only joint speeds are limited
        recovery=UNLIMITED,  # likewise
        manual=UNLIMITED,
        has_programs_in_recovery=True,  # chosen
        brakes_within_torque=False,
    ),
    electrics=Electrics(
        main_voltage=48.0,  # captures of resting arms
        robot_voltage=48.0,
        joint_voltage=48.0,  # its drop along the arm's cable is small and left out
        idle_current=0.25,  # chosen from the same captures
        joint_temperatures=(28.0, 29.0, 31.0, 36.0, 38.0, 39.0),  # production log of a UR3 (thermometers.py)
    ),
    force_sensing=ForceSensing(
        has_sensor=False,
        bandwidth=None,
        precision=(10.0, 5.0),  # UR3/CB3 manual
        # The friction offset of the estimate changes its sign with the motion, by 8 N for a poor arm, and
        # noise leaves 2 N in the mean of a contact.
        contact_force=15.0,
        least_averaging=0.2,  # leaves 0.6 N of 3 N
        most_averaging=1.0,  # leaves 0.3 N
        filter_time=0.024,  # leaves little of 3 N of noise
        # The whole loop takes about 60 ms (poor fidelity 75): 8 * .075 leaves more than 50 degrees of phase,
        # and scaling 2 is still stable.
        control_rate=8.0,
    ),
    execution_time=0.0,  # chosen: the unit is not known
    gravity=9.81,
    reports_control_as_target=False,
    has_operational_modes=False,
    has_remote_control=False,
    fidelities=FIDELITIES,
    robot_subtype=2,
    dashboard=COMMANDS,
    realtime=COLUMNS,
    frame_sizes=VERSIONS,
    sub_packages=SUB_PACKAGES,
    rtde_outputs=OUTPUTS,
    rtde_inputs=INPUTS,
    builtins=ALL_ROWS,
    interpreter_since=None,
)
