"""Which robot answers: firmware, model, serial number, and whether it says of itself that it is simulated."""

from __future__ import annotations

from dataclasses import dataclass

from pc_client.driver.dashboard_query import ask_dashboard
from pc_client.driver.package_stream import PackageStream
from pc_client.driver.transport import Network
from protocol.errors import RemoteProtocolError
from protocol.ur_types import SerialNumber, SoftwareVersion, parse_serial

_SERIAL, _MODEL = "get serial number", "get robot model"

UNKNOWN = "unknown"
"""Stands for what a robot does not tell."""

_CB3_PERIOD = 0.008
_E_SERIES_PERIOD = 0.002


@dataclass(frozen=True, slots=True)
class RobotInfo:
    """What a robot says about itself.

    Attributes:
        version: controller software.
        model: e.g. `UR3`, or "unknown" when the robot does not tell.
        serial: serial number; its text is "unknown" when the dashboard server does not tell.
    """

    version: SoftwareVersion
    model: str
    serial: SerialNumber

    @property
    def period(self) -> float:
        """Control cycle [s]. Source: UR realtime client interface: 125 Hz on CB3, 500 Hz on e-Series."""
        return _E_SERIES_PERIOD if self.version.major >= 5 else _CB3_PERIOD

    def __str__(self) -> str:
        kind = "simulated" if self.serial.simulated else "serial number"
        return f"{self.model}, software {self.version}, {kind} {self.serial.text}"


def read_robot_info(network: Network, host: str, dashboard_port: int, primary: PackageStream) -> RobotInfo:
    """Ask the robot who it is; what it does not answer stays "unknown".

    Args:
        network: makes the connection.
        host: the robot.
        dashboard_port: its dashboard port.
        primary: a fresh connection to the primary port: its greeting tells the software, its first state the
            arm when the dashboard server, before 3.12, does not.

    Raises:
        DriverError: the primary port does not tell its version.
    """
    version = primary.wait_for_version()
    answers = ask_dashboard(network, host, dashboard_port, (_SERIAL, _MODEL))
    try:
        serial = parse_serial(answers.get(_SERIAL, ""))
    except RemoteProtocolError:  # software before 3.12 does not know the question
        serial = SerialNumber(UNKNOWN, simulated=False, seed=None)
    model = answers.get(_MODEL, "")
    if not model.startswith("UR"):
        robot_type = primary.wait_for_robot_type()
        model = UNKNOWN if robot_type is None else robot_type.name
    return RobotInfo(version, model, serial)
