"""Software: one version of a generation's software: its identity, and its tables of ports and builtins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from protocol.ur_types import SoftwareVersion

if TYPE_CHECKING:
    from protocol.dashboard.commands import DashboardCommand
    from protocol.primary.framing import SubPackage
    from protocol.realtime.layout import RealtimeLayout
    from protocol.robot_api import ApiCall
    from protocol.rtde.fields import RtdeField
    from urscript.catalogue import Catalogue


@dataclass(frozen=True, slots=True, eq=False)
class Software:
    """One version of the software; `RobotGeneration.software` makes it.

    Attributes:
        version: four numbers; the last is the build.
        built: when; in the time of the box.
        dashboard: commands of the dashboard server, by name.
        robot_api: calls of the Robot API.
        realtime: layout of the frames on port 30003.
        sub_packages: of the robot state on ports 30001 and 30002, in the order of the wire.
        rtde_outputs: variables that a client can subscribe to, by name.
        rtde_inputs: variables that a client can write, by name.
        catalogue: the builtins of URScript.
        has_interpreter: statements can be sent to a program in interpreter mode.
    """

    version: SoftwareVersion
    built: datetime
    dashboard: Mapping[str, DashboardCommand]
    robot_api: tuple[ApiCall, ...]
    realtime: RealtimeLayout
    sub_packages: tuple[type[SubPackage], ...]
    rtde_outputs: Mapping[str, RtdeField]
    rtde_inputs: Mapping[str, RtdeField]
    catalogue: Catalogue
    has_interpreter: bool

    @property
    def day(self) -> str:
        """The date as the dashboard writes it, "Nov 30 2021"."""
        return self.built.strftime("%b %d %Y")
