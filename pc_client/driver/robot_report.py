"""What a robot reports of itself: the record that `experiment.preflight` judges. Only reads."""

from __future__ import annotations

from dataclasses import dataclass

from pc_client.driver.dashboard_query import ask_dashboard
from pc_client.driver.package_stream import PackageStream
from pc_client.driver.realtime_client import RealtimeClient
from pc_client.driver.robot_info import UNKNOWN, RobotInfo, arm_name, read_robot_info
from pc_client.driver.rtde_query import RtdeAnswer, ask_rtde
from pc_client.driver.transport import Network
from pc_client.errors import DriverError
from protocol.primary.layout import CartesianInfo, ConfigurationData, KinematicsInfo, RobotModeData
from protocol.realtime.layout import RealtimeFrame
from protocol.ur_types import Ports, RobotType

_CONNECT_TIMEOUT = 2.0

_REMOTE, _MODE = "is in remote control", "get operational mode"
_ANSWERS = {"true": True, "false": False}
_OPERATIONAL_MODES = ("NONE", "MANUAL", "AUTOMATIC")


@dataclass(frozen=True, slots=True)
class RobotReport:
    """What a robot reports. None stands for what it does not report.

    Attributes:
        info: which robot it is.
        configured: the arm by the configuration data of port 30001, e.g. `UR3` or `UR5e`.
        frame: its state on port 30003.
        slider: speed slider, 0 to 1, from port 30001.
        tcp_offset: (6,) pose of the TCP in the flange frame [m, rad], from port 30001.
        rtde: software, joints, TCP pose and (since 3.11) payload on port 30004; None without RTDE.
        calibration: name of the arm's calibration in the maker's drivers, from port 30001.
        remote_control: clients may command the robot, from the dashboard server; e-Series, since 5.6.
        operational_mode: `NONE`, `MANUAL` or `AUTOMATIC`, from the dashboard server; e-Series, since 5.6.
    """

    info: RobotInfo
    configured: str | None
    frame: RealtimeFrame
    slider: float | None
    tcp_offset: tuple[float, ...] | None
    rtde: RtdeAnswer | None
    calibration: str | None
    remote_control: bool | None
    operational_mode: str | None

    @property
    def payload(self) -> float | None:
        """Mass [kg]. Only RTDE reports it on a CB3: frames of port 30003 have it from 5.10 on."""
        value = None if self.rtde is None else self.rtde.values.get("payload")
        return value if isinstance(value, float) else None


def read_report(network: Network, host: str, ports: Ports) -> RobotReport:
    """Ask a robot, on connections of its own.

    Raises:
        DriverError: nothing answers on the primary or the realtime port, or something else than a robot.
    """
    primary = PackageStream(network.connect(host, ports.primary, _CONNECT_TIMEOUT), network, "primary")
    try:
        info = read_robot_info(network, host, ports.dashboard, primary)
        connection = network.connect(host, ports.realtime, _CONNECT_TIMEOUT)
        frames = RealtimeClient(connection, network, time_waits=info.lockstep)
        try:
            frame = frames.receive().latest
        finally:
            frames.close()
        return make_report(network, host, ports, info, frame, primary)
    finally:
        primary.close()


def make_report(
    network: Network,
    host: str,
    ports: Ports,
    info: RobotInfo,
    frame: RealtimeFrame,
    primary: PackageStream,
) -> RobotReport:
    """Put together what open connections have reported, and ask RTDE and dashboard server for the rest.

    Args:
        network: makes the connections.
        host: the robot.
        ports: its ports.
        info: which robot it is.
        frame: its state.
        primary: its primary port; what has come is to be polled by the caller.

    Raises:
        DriverError: a state on the primary port makes no sense.
    """
    configuration = primary.newest(ConfigurationData)
    cartesian = primary.newest(CartesianInfo)
    kinematics = primary.newest(KinematicsInfo)
    asked = (_REMOTE, _MODE) if info.version.major == 5 else ()
    answers = ask_dashboard(network, host, ports.dashboard, asked) if asked else {}
    mode = answers.get(_MODE, "").upper()
    return RobotReport(
        info=info,
        configured=None if configuration is None else _configured(configuration, info),
        frame=frame,
        slider=reported_slider(primary),
        tcp_offset=None if cartesian is None else cartesian.tcp_offset,
        rtde=ask_rtde(network, host, ports.rtde, ("actual_q", "actual_TCP_pose", "payload")),
        calibration=None if kinematics is None else kinematics.calibration,
        remote_control=_ANSWERS.get(answers.get(_REMOTE, "").lower()),
        operational_mode=mode if mode in _OPERATIONAL_MODES else None,
    )


def check_arm(info: RobotInfo, primary: PackageStream) -> None:
    """Refuse a robot that calls itself one arm on the dashboard server and another on port 30001.

    Raises:
        DriverError: they differ.
    """
    configuration = primary.newest(ConfigurationData)
    if configuration is None or info.model in (UNKNOWN, configured := _configured(configuration, info)):
        return
    raise DriverError(
        f"the robot's arm is {info.model} (dashboard), {configured} (port 30001), must be one of them; "
        "look which arm it is, and set it so in the installation"
    )


def reported_slider(primary: PackageStream) -> float | None:
    """The speed slider, 0 to 1, as the port was last polled; None when it was not reported."""
    mode = primary.newest(RobotModeData)
    return None if mode is None else mode.target_speed_fraction


def _configured(configuration: ConfigurationData, info: RobotInfo) -> str:
    try:
        return arm_name(RobotType(configuration.robot_type).name, info.version)
    except ValueError:  # an arm that was built after this was written
        return f"type {configuration.robot_type}"
