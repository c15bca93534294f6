"""PolyScope X: the arms of the e-Series with software 10.x. A Robot API takes the place of the dashboard."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from types import MappingProxyType

from protocol.robot_api import CALLS
from protocol.ur_types import SoftwareVersion
from ur_emulator.models.e_series import E_SERIES
from urscript.catalogue import Generation

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
    services=MappingProxyType(
        {
            "primary": ("primary", "secondary", "realtime", "primary_ro", "secondary_ro", "realtime_ro"),
            "rtde": ("rtde",),
        }
    ),
)
