"""Which robot answers: firmware, model, serial number, and whether it is simulated, real or unknown."""

from __future__ import annotations

import re
from dataclasses import dataclass

from pc_client.driver.dashboard_query import ask_dashboard
from pc_client.driver.package_stream import PackageStream
from pc_client.driver.transport import Network
from pc_client.errors import DriverError
from pc_client.recording.origin import Source, origin_of
from protocol.errors import RemoteProtocolError
from protocol.primary.layout import ConfigurationData, KinematicsInfo
from protocol.serial_numbers import SerialNumber, parse_serial
from protocol.ur_types import (
    LOCKSTEP_MASTERBOARD,
    SIMULATED_MASTERBOARD,
    SIMULATOR_CHECKSUM,
    RobotType,
    SoftwareVersion,
)

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
            no mark of a simulator; None when this is not certain.
        seed: of an emulated arm; None for another, and when the robot does not report it.
        lockstep: the robot says that its time waits for its clients, as that of an emulated box may.
        has_calibration: False when its calibration checksums are all ones, as on the maker's simulator.
    """

    version: SoftwareVersion
    model: str
    serial: str
    simulated: bool | None
    seed: int | None
    lockstep: bool
    has_calibration: bool = True

    @property
    def period(self) -> float:
        """Control cycle [s]. Source: UR realtime client interface: 125 Hz on CB3, 500 Hz on e-Series."""
        return _E_SERIES_PERIOD if self.version.major >= 5 else _CB3_PERIOD

    def check_same(self, model: str, serial: str) -> None:
        """Refuse another robot than the one of this arm and serial number.

        Raises:
            DriverError: it is another one.
        """
        if (self.model, self.serial) != (model, serial):
            raise DriverError(
                f"another robot answers: {self.model}, serial number {self.serial}, must be {model}, "
                f"serial number {serial}; look which robot has this address, and connect again"
            )

    @property
    def source(self) -> Source:
        """Columns of a table of the robot's data."""
        names = ("robot", "software", "serial", "simulated")
        return dict(zip(names, (self.model, str(self.version), self.serial, self.simulated), strict=True))

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
    kinematics = primary.newest(KinematicsInfo)
    has_calibration = kinematics is None or set(kinematics.checksum) != {SIMULATOR_CHECKSUM}
    return RobotInfo(
        version,
        arm_name(model if _MODEL_NAME.fullmatch(model) else _model_in(configuration), version),
        UNKNOWN if serial is None else serial.text,
        _is_simulated(serial, configuration, has_calibration),
        None if serial is None else serial.seed,
        configuration is not None and configuration.masterboard_version == LOCKSTEP_MASTERBOARD,
        has_calibration,
    )


def _is_simulated(
    serial: SerialNumber | None, configuration: ConfigurationData | None, has_calibration: bool
) -> bool | None:
    """Whether the robot is a simulated one; None when neither is certain.

    A missing calibration proves nothing: a real arm may have lost its own.
    """
    marks = (SIMULATED_MASTERBOARD, LOCKSTEP_MASTERBOARD)
    if configuration is not None and configuration.masterboard_version in marks:
        return True
    if serial is not None and serial.simulated:
        return True
    return None if serial is None or configuration is None or not has_calibration else False


def _model_in(configuration: ConfigurationData | None) -> str:
    try:
        return UNKNOWN if configuration is None else RobotType(configuration.robot_type).name
    except ValueError:  # an arm that was built after this was written
        return UNKNOWN


def arm_name(reported: str, version: SoftwareVersion) -> str:
    """The name of an arm that a robot calls `UR5`, for example: `UR5e` with software of the e-Series."""
    return f"{reported}e" if version.major >= 5 and reported in _E_SERIES else reported
