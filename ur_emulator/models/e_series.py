"""The e-Series generation: UR3e to UR30 with software 5.x."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from math import pi, radians

from protocol.dashboard.commands import COMMANDS
from protocol.primary.layout import SUB_PACKAGES
from protocol.realtime.columns import COLUMNS, VERSIONS
from protocol.rtde.fields import INPUTS, OUTPUTS
from protocol.ur_types import SoftwareVersion
from ur_emulator.models.fidelity import FIDELITIES
from ur_emulator.models.robot_generation import Builds, RobotGeneration, SafetyLimits
from urscript.catalogue import ALL_ROWS, STEP_TIME, Generation

_BUILDS: Builds = (
    (SoftwareVersion(5, 0), 101000, datetime(2018, 6, 1)),  # chosen
    (SoftwareVersion(5, 8), 10253, datetime(2020, 2, 11)),  # chosen
    (SoftwareVersion(5, 24), 0, datetime(2025, 10, 4, 0, 25, 33)),  # date: UR client library's test bytes
)

# Ends of the joint ranges [rad]. Source: configuration data of a UR5e capture, 2 pi + 3 degrees.
RANGE_END = 2.0 * pi + radians(3.0)

E_SERIES = RobotGeneration(
    name=Generation.E_SERIES.value,
    period_us=round(STEP_TIME[Generation.E_SERIES] * 1e6),
    substep_us=2_000,
    major=5,
    default_version="5.15.0",
    builds=_BUILDS,
    limits=SafetyLimits(
        reduced_share=0.5,  # chosen: the manual's defaults were not at hand
        recovery_speed=radians(30.0),  # PolyScope X manual
        speed_margin=0.2,  # configuration data of a UR5e capture: pi + .2 rad/s
        acceleration=40.0,  # the same capture
    ),
    fidelities=tuple(
        replace(
            fidelity,
            dead_time=fidelity.dead_time / 4.0,
            dead_time_spread=fidelity.dead_time_spread / 4.0,
            drive_lag=fidelity.drive_lag / 4.0,
            feedback_age=fidelity.feedback_age / 4.0,
        )
        for fidelity in FIDELITIES
    ),
    robot_subtype=3,
    dashboard=COMMANDS,
    realtime=COLUMNS,
    frame_sizes=VERSIONS,
    sub_packages=SUB_PACKAGES,
    rtde_outputs=OUTPUTS,
    rtde_inputs=INPUTS,
    builtins=ALL_ROWS,
)
