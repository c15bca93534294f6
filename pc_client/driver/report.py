"""Which robot answers and what it reports of itself: the record that `experiment.preflight` judges.

`read_report` asks for it, `probe` looks at every port and at the rhythm of the frames, too. Everything here
only reads: nothing is sent that could move an arm. What a robot does not report stays unknown.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from pc_client.driver.primary import PackageStream
from pc_client.driver.questions import RtdeAnswer, ask_dashboard, ask_rtde
from pc_client.driver.realtime import RealtimeClient
from pc_client.driver.transport import NO_ROUTE, TcpNetwork
from pc_client.errors import DriverError, UnknownHostError
from pc_client.recording.provenance import Source, origin_of, source_of
from protocol import ur_types
from protocol.errors import RemoteProtocolError
from protocol.primary.layout import CartesianInfo, ConfigurationData, KinematicsInfo, RobotModeData
from protocol.realtime.layout import RealtimeFrame
from protocol.serial_numbers import SerialNumber, parse_serial
from protocol.ur_types import Ports, RobotType, SoftwareVersion

UNKNOWN = "unknown"
"""Stands for what a robot does not report."""

_CONNECT_TIMEOUT = 2.0

_SERIAL, _MODEL = "get serial number", "get robot model"
_REMOTE, _MODE = "is in remote control", "get operational mode"
_ANSWERS = {"true": True, "false": False}
_ASKED = ("actual_q", "actual_TCP_pose", "payload", "payload_cog")
_OPERATIONAL_MODES = ("NONE", "MANUAL", "AUTOMATIC")
_MODEL_NAME = re.compile(r"UR[0-9]{1,3}[a-zA-Z]{0,10}")

_E_SERIES = ("UR3", "UR5", "UR10", "UR16")
"""What e-Series arms report without their "e". Source: UR's client library: type 1 with software 5 is a UR5e;
a UR7e reports the type of a UR5, a UR12e that of a UR10."""

_CB3_PERIOD = 0.008
_E_SERIES_PERIOD = 0.002


@dataclass(frozen=True, slots=True)
class RobotInfo:
    """What a robot says about itself.

    Attributes:
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
        """Raise DriverError for another robot than the one of this arm and serial number."""
        if (self.model, self.serial) != (model, serial):
            raise DriverError(
                f"another robot answers: {self.model}, serial number {self.serial}, must be {model}, "
                f"serial number {serial}; look which robot has this address, and connect again"
            )

    @property
    def source(self) -> Source:
        """Columns of a table of the robot's data."""
        return source_of(self.model, str(self.version), self.serial, self.simulated)

    def __str__(self) -> str:
        origin = origin_of(self.simulated).name
        return f"{self.model}, software {self.version}, serial number {self.serial}, {origin}"


@dataclass(frozen=True, slots=True)
class RobotReport:
    """What a robot reports. None stands for what it does not report.

    Attributes:
        configured: the arm by the configuration data of port 30001, e.g. `UR3` or `UR5e`.
        frame: its state on port 30003.
        mode: speed slider and control mode, from port 30001.
        tcp_offset: (6,) pose of the TCP in the flange frame [m, rad], from port 30001.
        rtde: software, joints, TCP pose and (since 3.11) payload on port 30004; None without RTDE.
        calibration: name of the arm's calibration in the maker's drivers, from port 30001.
        remote_control: clients may command the robot, from the dashboard server; e-Series, since 5.6.
        operational_mode: `NONE`, `MANUAL` or `AUTOMATIC`, from the dashboard server; e-Series, since 5.6.
    """

    info: RobotInfo
    configured: str | None
    frame: RealtimeFrame
    mode: RobotModeData | None
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

    @property
    def payload_cog(self) -> tuple[float, ...] | None:
        """Its centre of gravity in the flange frame [m]; likewise."""
        value = None if self.rtde is None else self.rtde.values.get("payload_cog")
        return value if isinstance(value, tuple) and len(value) == 3 else None


class StatePorts:
    """The ports that tell which robot answers and how it stands: primary and realtime.

    `close` must follow, also when connecting has failed. As a context manager it connects, and closes.

    Args:
        timeout: for each connection [s].

    Attributes:
        primary: states and messages; there from `identify` on.
        info: which robot answered; likewise.
        frames: the realtime port; there from `open_frames` on.
    """

    primary: PackageStream
    info: RobotInfo
    frames: RealtimeClient

    def __init__(
        self, network: TcpNetwork, host: str, ports: Ports, *, timeout: float = _CONNECT_TIMEOUT
    ) -> None:
        self.network = network
        self.host = host
        self.ports = ports
        self._timeout = timeout
        self._closing: list[Callable[[], None]] = []

    def __enter__(self) -> Self:
        try:
            self.identify()
            self.open_frames()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close all; harmless if closed already."""
        for close in self._closing:
            close()
        self._closing.clear()

    def identify(self) -> RobotInfo:
        """Connect to the primary port, and ask the robot for its identity.

        Raises:
            DriverError: the primary port does not answer, or does not report its version.
        """
        self.primary = self._open_packages(self.ports.primary, "primary")
        version = self.primary.wait_for_version()
        answers = self._ask_dashboard(_SERIAL, _MODEL)
        # The first state has the marks of a simulator, and the arm: before 3.12 the dashboard server does not
        # report it.
        configuration = self.primary.wait_for_configuration()
        try:
            serial = parse_serial(answers.get(_SERIAL, ""))
        except RemoteProtocolError:  # software before 3.12 does not know the question
            serial = None
        kinematics = self.primary.newest(KinematicsInfo)
        has_calibration = kinematics is None or set(kinematics.checksum) != {ur_types.SIMULATOR_CHECKSUM}
        model = answers.get(_MODEL, "")
        self.info = RobotInfo(
            version,
            _arm_name(model, version)
            if _MODEL_NAME.fullmatch(model)
            else _configured_arm(configuration, version) or UNKNOWN,
            UNKNOWN if serial is None else serial.text,
            _is_simulated(serial, configuration, has_calibration),
            None if serial is None else serial.seed,
            configuration is not None and configuration.masterboard_version == ur_types.LOCKSTEP_MASTERBOARD,
            has_calibration,
        )
        return self.info

    def open_frames(self) -> None:
        """Connect to the realtime port, after `identify`; DriverError if the port does not answer."""
        transport = self.network.connect(self.host, self.ports.realtime, self._timeout)
        self.frames = RealtimeClient(transport, self.network, time_waits=self.info.lockstep)
        self._closing.append(self.frames.close)

    def read_frame(self) -> RealtimeFrame:
        """The state of the robot now; DriverError if no frames come."""
        self.frames.drain()
        return self.frames.receive().latest

    def report(self, frame: RealtimeFrame) -> RobotReport:
        """Put together what the robot reports of itself, with this frame as its state.

        Raises:
            DriverError: a connection broke, or a state on the primary port makes no sense.
        """
        self.primary.poll()
        cartesian = self.primary.newest(CartesianInfo)
        kinematics = self.primary.newest(KinematicsInfo)
        answers = self._ask_dashboard(_REMOTE, _MODE) if self.info.version.major == 5 else {}
        operational = answers.get(_MODE, "").upper()
        return RobotReport(
            info=self.info,
            configured=self.configured,
            frame=frame,
            mode=self.primary.newest(RobotModeData),
            tcp_offset=None if cartesian is None else cartesian.tcp_offset,
            rtde=ask_rtde(self.network, self.host, self.ports.rtde, _ASKED),
            calibration=None if kinematics is None else kinematics.calibration,
            remote_control=_ANSWERS.get(answers.get(_REMOTE, "").lower()),
            operational_mode=operational if operational in _OPERATIONAL_MODES else None,
        )

    @property
    def configured(self) -> str | None:
        """The arm by the configuration data of the primary port; None when it was not reported."""
        configuration = self.primary.newest(ConfigurationData)
        if configuration is None:
            return None
        return _configured_arm(configuration, self.info.version) or f"type {configuration.robot_type}"

    def _ask_dashboard(self, *questions: str) -> dict[str, str]:
        return ask_dashboard(self.network, self.host, self.ports.dashboard, questions)

    def _open_packages(self, port: int, name: str) -> PackageStream:
        transport = self.network.connect(self.host, port, self._timeout)
        stream = PackageStream(transport, self.network, name)
        self._closing.append(stream.close)
        return stream


def read_report(network: TcpNetwork, host: str, ports: Ports) -> RobotReport:
    """Ask a robot, on connections of its own.

    Raises:
        DriverError: nothing answers on the primary or the realtime port, or something else than a robot.
    """
    with StatePorts(network, host, ports) as robot:
        return robot.report(robot.frames.receive().latest)


@dataclass(frozen=True, slots=True)
class FrameRhythm:
    """How the realtime frames came in.

    Attributes:
        n_new: frames with a new time stamp.
        n_heartbeats: frames that repeated one: the robot's time stands still between programs.
        cycle: median step of the time stamps [s]; None when time stood still.
        lost: cycles whose frame never came.
        arrival_sd: standard deviation of the time between two arrivals [s].
        arrival_worst: longest time between two arrivals [s].
    """

    frame_size: int
    n_new: int
    n_heartbeats: int
    cycle: float | None
    lost: int
    arrival_sd: float
    arrival_worst: float


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """What answers at an address.

    Attributes:
        ports: name, number and state of every port: `open`, `closed`, `no answer`, `no route`.
        info: which robot; None when its primary port does not answer.
        rhythm: of the frames; None when none come.
        report: what `experiment.preflight` judges; None when the robot does not report enough.
        obstacle: which connection prevents a session, or "".
    """

    ports: tuple[tuple[str, int, str], ...]
    info: RobotInfo | None
    rhythm: FrameRhythm | None
    report: RobotReport | None
    obstacle: str


def probe(network: TcpNetwork, host: str, ports: Ports, seconds: float) -> Diagnosis:
    """Look at everything that a session would need.

    Args:
        seconds: how long to listen to the frames [s].

    Raises:
        UnknownHostError: there is no such robot to ask.
    """
    states: dict[str, str] = {}
    for item in fields(ports):
        try:
            network.connect(host, getattr(ports, item.name), _CONNECT_TIMEOUT).close()
            states[item.name] = "open"
        except UnknownHostError:
            raise
        except DriverError as error:
            states[item.name] = _state(error)
    robot = StatePorts(network, host, ports)
    info = rhythm = report = None
    obstacle = ""
    try:
        info = robot.identify()
        robot.open_frames()
        rhythm, frame = _listen(robot, seconds)
        report = robot.report(frame)
    except DriverError as error:
        obstacle = str(error)
    finally:
        robot.close()
    if report is not None and report.rtde is None and states["rtde"] == "open":
        states["rtde"] = "open, but it does not answer as RTDE"
    if not obstacle and states["secondary"] != "open":
        obstacle = f"the secondary port {ports.secondary} takes no programs"
    numbered = tuple((name, getattr(ports, name), state) for name, state in states.items())
    return Diagnosis(numbered, info, rhythm, report, obstacle)


def _listen(robot: StatePorts, seconds: float) -> tuple[FrameRhythm, RealtimeFrame]:
    """The rhythm of the frames, and the last one."""
    frames = robot.frames
    size = frames.layout.size
    stamps: list[float] = []
    arrivals: list[float] = []
    n_heartbeats = 0
    deadline = robot.network.now() + seconds
    while True:
        arrival = frames.receive()
        arrivals.append(robot.network.now())
        stamps += [frame.timestamp for frame in arrival.new]
        n_heartbeats += arrival.n_heartbeats
        if arrivals[-1] > deadline:
            break
    steps, waits = np.diff(stamps), np.diff(arrivals)
    cycle = float(np.median(steps)) if len(steps) else None
    lost = 0 if cycle is None else int(np.sum(np.rint(steps / cycle) - 1))
    spread = (float(waits.std()), float(waits.max())) if len(waits) else (0.0, 0.0)
    return FrameRhythm(size, len(stamps), n_heartbeats, cycle, lost, *spread), arrival.latest


def _state(error: DriverError) -> str:
    """Of a port that accepts no connection."""
    match error.__cause__:
        case TimeoutError():
            return "no answer"
        case OSError(errno=number) if number in NO_ROUTE:
            return "no route"
    return "closed"


def _is_simulated(
    serial: SerialNumber | None, configuration: ConfigurationData | None, has_calibration: bool
) -> bool | None:
    """Whether the robot is a simulated one; None when neither is certain.

    A missing calibration proves nothing: a real arm may have lost its own.
    """
    marks = (ur_types.SIMULATED_MASTERBOARD, ur_types.LOCKSTEP_MASTERBOARD)
    if configuration is not None and configuration.masterboard_version in marks:
        return True
    if serial is not None and serial.simulated:
        return True
    return None if serial is None or configuration is None or not has_calibration else False


def _configured_arm(configuration: ConfigurationData | None, version: SoftwareVersion) -> str | None:
    """The arm that the configuration data name; None without data, and for an arm that is newer than this."""
    try:
        return None if configuration is None else _arm_name(RobotType(configuration.robot_type).name, version)
    except ValueError:
        return None


def _arm_name(reported: str, version: SoftwareVersion) -> str:
    """The name of an arm that a robot calls `UR5`, for example: `UR5e` with software of the e-Series."""
    return f"{reported}e" if version.major >= 5 and reported in _E_SERIES else reported
