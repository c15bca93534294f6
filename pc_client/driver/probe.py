"""What answers at an address: every port, the rhythm of the frames, and what the robot reports of itself.

It only reads; it sends nothing that could move an arm.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from pc_client.driver.package_stream import PackageStream
from pc_client.driver.realtime_client import RealtimeClient
from pc_client.driver.robot_info import RobotInfo, read_robot_info
from pc_client.driver.robot_report import RobotReport, make_report
from pc_client.driver.transport import NO_ROUTE, Network
from pc_client.errors import DriverError, UnknownHostError
from protocol.realtime.layout import RealtimeFrame
from protocol.ur_types import Ports

_CONNECT_TIMEOUT = 2.0


@dataclass(frozen=True, slots=True)
class FrameRhythm:
    """How the realtime frames came in.

    Attributes:
        frame_size: bytes of a frame.
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


def probe(network: Network, host: str, ports: Ports, seconds: float) -> Diagnosis:
    """Look at everything that a session would need.

    Args:
        network: makes the connections.
        host: the robot.
        ports: its ports.
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
    info: RobotInfo | None = None
    rhythm: FrameRhythm | None = None
    report: RobotReport | None = None
    obstacle = ""
    try:
        primary = PackageStream(network.connect(host, ports.primary, _CONNECT_TIMEOUT), network, "primary")
        try:
            info = read_robot_info(network, host, ports.dashboard, primary)
            rhythm, frame = _listen(network, host, ports.realtime, seconds, time_waits=info.lockstep)
            primary.poll()
            report = make_report(network, host, ports, info, frame, primary)
        finally:
            primary.close()
    except DriverError as error:
        obstacle = str(error)
    if report is not None and report.rtde is None and states["rtde"] == "open":
        states["rtde"] = "open, but it does not answer as RTDE"
    if not obstacle and states["secondary"] != "open":
        obstacle = f"the secondary port {ports.secondary} takes no programs"
    numbered = tuple((name, getattr(ports, name), state) for name, state in states.items())
    return Diagnosis(numbered, info, rhythm, report, obstacle)


def _state(error: DriverError) -> str:
    """Of a port that accepts no connection."""
    match error.__cause__:
        case TimeoutError():
            return "no answer"
        case OSError(errno=number) if number in NO_ROUTE:
            return "no route"
    return "closed"


def _listen(
    network: Network, host: str, port: int, seconds: float, *, time_waits: bool
) -> tuple[FrameRhythm, RealtimeFrame]:
    frames = RealtimeClient(network.connect(host, port, _CONNECT_TIMEOUT), network, time_waits=time_waits)
    stamps: list[float] = []
    arrivals: list[float] = []
    n_heartbeats = 0
    try:
        size = frames.layout.size
        deadline = network.now() + seconds
        while True:
            arrival = frames.receive()
            arrivals.append(network.now())
            stamps += [frame.timestamp for frame in arrival.new]
            n_heartbeats += arrival.n_heartbeats
            if arrivals[-1] > deadline:
                break
    finally:
        frames.close()
    steps, waits = np.diff(stamps), np.diff(arrivals)
    cycle = float(np.median(steps)) if len(steps) else None
    lost = 0 if cycle is None else int(np.sum(np.rint(steps / cycle) - 1))
    spread = (float(waits.std()), float(waits.max())) if len(waits) else (0.0, 0.0)
    return FrameRhythm(size, len(stamps), n_heartbeats, cycle, lost, *spread), arrival.latest
