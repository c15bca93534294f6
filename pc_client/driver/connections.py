"""The connections of one session with a robot: state and messages, programs, frames, and the way back."""

from __future__ import annotations

from pc_client.driver.package_stream import PackageStream
from pc_client.driver.realtime_client import RealtimeClient
from pc_client.driver.reverse_server import ReverseServer
from pc_client.driver.robot_info import RobotInfo, read_robot_info
from pc_client.driver.transport import Network
from pc_client.driver.watchdog import software
from pc_client.errors import DriverError
from protocol.ur_types import Ports

CONNECT_TIMEOUT = 5.0  # s


class Connections:
    """All connections to one robot; `close` must follow, also when making them has failed.

    Args:
        network: opens them.
        host: the robot's name or address.
        ports: its ports.

    Attributes:
        info: which robot answered.
        primary: states and messages.
        scripts: the secondary port; takes programs.
        frames: the realtime port.
        server: where its programs dial back.
    """

    info: RobotInfo
    primary: PackageStream
    scripts: PackageStream
    frames: RealtimeClient
    server: ReverseServer

    def __init__(self, network: Network, host: str, ports: Ports) -> None:
        self.network = network
        self.host = host
        self.ports = ports
        self._open: list[RealtimeClient | PackageStream | ReverseServer] = []

    def open(self, reverse_port: int | None) -> None:
        """Connect to the robot and listen for its programs.

        Args:
            reverse_port: see ReverseServer.

        Raises:
            DriverError: a port does not answer, or the robot's software is not one that we drive.
        """
        self.primary = self._open_packages(self.ports.primary, "primary")
        self.scripts = self._open_packages(self.ports.secondary, "secondary")
        self.info = read_robot_info(self.network, self.host, self.ports.dashboard, self.primary)
        if not (condition := software(self.info.version)).holds:
            raise DriverError(condition.complaint)
        self.frames = self._open_frames()
        self.server = ReverseServer(
            self.network, self.frames.local_address, self.frames.robot_address, reverse_port
        )
        self._open.append(self.server)

    def renew(self) -> None:
        """Make new connections for programs and frames: the present ones may be broken.

        Raises:
            DriverError: a port does not answer.
        """
        for connection in (self.scripts, self.frames):
            connection.close()
        self.scripts = self._open_packages(self.ports.secondary, "secondary")
        self.frames = self._open_frames()

    def close(self) -> None:
        """Close all; harmless if closed already."""
        for connection in self._open:
            connection.close()
        self._open.clear()

    def _open_packages(self, port: int, name: str) -> PackageStream:
        transport = self.network.connect(self.host, port, CONNECT_TIMEOUT)
        stream = PackageStream(transport, self.network, name)
        self._open.append(stream)
        return stream

    def _open_frames(self) -> RealtimeClient:
        transport = self.network.connect(self.host, self.ports.realtime, CONNECT_TIMEOUT)
        frames = RealtimeClient(transport, self.network, time_waits=self.info.lockstep)
        self._open.append(frames)
        return frames
