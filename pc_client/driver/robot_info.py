"""Which robot answers: firmware, model, serial number, and whether it is simulated, real or unknown."""

from __future__ import annotations

import re
from dataclasses import dataclass

from pc_client.driver.dashboard_query import ask_dashboard
from pc_client.driver.package_stream import PackageStream
from pc_client.driver.transport import Network
from pc_client.recording.origin import origin_of
from protocol.errors import RemoteProtocolError
from protocol.primary.setup import ConfigurationData, KinematicsInfo
from protocol.serial_numbers import SerialNumber, parse_serial
from protocol.ur_types import SIMULATED_MASTERBOARD, SIMULATOR_CHECKSUM, RobotType, SoftwareVersion

_MODEL_NAME = re.compile(r"UR[0-9]{1,3}[a-zA-Z]{0,10}")
_SERIAL, _MODEL = "get serial number", "get robot model"

UNKNOWN = "unknown"
"""Stands for what a robot does not report."""

_CB3_PERIOD = 0.008
_E_SERIES_PERIOD = 0.002

_E_SERIES = ("UR3", "UR5", "UR10", "UR16")
"""What e-Series arms report without their "e". Source: UR's client library: type 1 with software 5 is a UR5e;
a UR7e reports the type of a UR5, a UR12e that of a UR10."""


@dataclass(frozen=True, slots=True)
class RobotInfo:
    """What a robot says about itself.

    Attributes:
        version: controller software.
        model: e.g. `UR3` or `UR5e`, or "unknown" when the robot does not report it.
        serial: serial number, or "unknown" when the dashboard server does not report it.
        simulated: True when the robot says so; False when its serial number is that of a real arm and it has
            no mark of a simulator; None when it does not report this.
        seed: of an emulated arm; None for another, and when the robot does not report it.
    """

    version: SoftwareVersion
    model: str
    serial: str
    simulated: bool | None
    seed: int | None

    @property
    def period(self) -> float:
        """Control cycle [s]. Source: UR realtime client interface: 125 Hz on CB3, 500 Hz on e-Series."""
        return _E_SERIES_PERIOD if self.version.major >= 5 else _CB3_PERIOD

    def __str__(self) -> str:
        origin = origin_of(self.simulated).name
        return f"{self.model}, software {self.version}, serial number {self.serial}, {origin}"


def read_robot_info(network: Network, host: str, dashboard_port: int, primary: PackageStream) -> RobotInfo:
    """Ask the robot for its identity; what it does not answer stays unknown.

    Args:
        network: makes the connection.
        host: the robot.
        dashboard_port: its dashboard port.
        primary: a fresh connection to the primary port: its greeting names the software; its first state the
            marks of a simulator, and the arm when the dashboard server, before 3.12, does not.

    Raises:
        DriverError: the primary port does not report its version.
    """
    version = primary.wait_for_version()
    answers = ask_dashboard(network, host, dashboard_port, (_SERIAL, _MODEL))
    configuration = primary.wait_for_configuration()
    try:
        serial = parse_serial(answers.get(_SERIAL, ""))
    except RemoteProtocolError:  # software before 3.12 does not know the question
        serial = None
    model = answers.get(_MODEL, "")
    return RobotInfo(
        version,
        arm_name(model if _MODEL_NAME.fullmatch(model) else _model_in(configuration), version),
        UNKNOWN if serial is None else serial.text,
        _is_simulated(serial, configuration, primary.newest(KinematicsInfo)),
        None if serial is None else serial.seed,
    )


def _is_simulated(
    serial: SerialNumber | None, configuration: ConfigurationData | None, kinematics: KinematicsInfo | None
) -> bool | None:
    """Whether the robot is a simulated one; None when neither is certain."""
    if configuration is not None and configuration.masterboard_version == SIMULATED_MASTERBOARD:
        return True
    if kinematics is not None and set(kinematics.checksum) == {SIMULATOR_CHECKSUM}:
        return True
    if serial is None:
        return None
    return True if serial.simulated else None if configuration is None else False


def _model_in(configuration: ConfigurationData | None) -> str:
    try:
        return UNKNOWN if configuration is None else RobotType(configuration.robot_type).name
    except ValueError:  # an arm that was built after this was written
        return UNKNOWN


def arm_name(reported: str, version: SoftwareVersion) -> str:
    """The name of an arm that a robot calls `UR5`, for example: `UR5e` with software of the e-Series."""
    return f"{reported}e" if version.major >= 5 and reported in _E_SERIES else reported
