"""A session with one robot: connect, stream, and always leave the arm stopped.

It uses the real protocol only. Whatever moves the arm is streamed, so that the program on the robot stops it
when commands stop. Every end of a motion (done, refused, Ctrl-C, lost robot) goes through
`stop`: first the stop word to the program, then a program of our own that stops the arm.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pc_client.driver.package_stream import PackageStream, raise_on_error
from pc_client.driver.realtime_client import RealtimeClient
from pc_client.driver.receiver_script import receiver_script
from pc_client.driver.reverse_server import DIAL_TIMEOUT, ReverseServer
from pc_client.driver.robot_info import RobotInfo, read_robot_info
from pc_client.driver.robot_report import RobotReport, check_arm, make_report, reported_slider
from pc_client.driver.stop_script import STOP_WORD, stop_script
from pc_client.driver.transport import Network, TcpNetwork, Transport
from pc_client.driver.velocity_stream import (
    CommandSource,
    RowSink,
    S,
    StreamReport,
    VelocityStream,
    collector_paused,
)
from pc_client.driver.waiting import REST_TIMEOUT, wait_for_rest, wait_until
from pc_client.driver.watchdog import (
    ProgramEndedError,
    check_angles,
    check_idle,
    check_safety,
    check_slider,
    control,
    has_ended,
    is_stopped,
    software,
)
from pc_client.errors import DriverError, RobotStoppedError
from protocol.primary.messages import ErrorCodeMessage, TextMessage
from protocol.realtime.layout import RealtimeFrame, RealtimeLayout
from protocol.ur_types import Ports
from protocol.velocity_stream import VelocityMode, encode_velocity

CONNECT_TIMEOUT = 5.0
_START_TIMEOUT = 5.0
"""A program that does not show as running within this [s] was not accepted."""
_READ_ONLY = 210
"""Error code for a program that came in local control. Source: test of the maker's client library."""


class UrDriver:
    """A session with one robot.

    Use as a context manager; leaving it stops the arm if it is still moving and closes all connections.

    Args:
        host: the robot's name or address.
        ports: its ports.
        reverse_port: where its programs dial back; see ReverseServer.
        network: tests hand in a network in memory.

    Attributes:
        info: which robot answered.
        layout: columns of its realtime frames.
        time_waits: the robot's time stood still at the start of every stream so far, as in lockstep; a robot
            in real time that repeats a frame now and then does not do so each time.
    """

    info: RobotInfo
    layout: RealtimeLayout
    _primary: PackageStream
    _scripts: PackageStream
    _frames: RealtimeClient
    _server: ReverseServer

    def __init__(
        self,
        host: str,
        ports: Ports | None = None,
        *,
        reverse_port: int | None = None,
        network: Network | None = None,
    ) -> None:
        self._host = host
        self._ports = ports or Ports.standard()
        self._reverse_port = reverse_port
        self._network: Network = network or TcpNetwork()
        self._open: list[RealtimeClient | PackageStream | ReverseServer] = []
        self._in_motion = False
        self.time_waits = True
        self._program = self._last_text = ""
        self._is_read_only = False
        try:
            self._connect()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Stop the arm if we left it in motion, and close all connections."""
        try:
            if self._in_motion:
                self.stop(None)
        finally:
            for connection in self._open:
                connection.close()
            self._open.clear()

    def read_frame(self) -> RealtimeFrame:
        """The state of the robot now.

        Raises:
            DriverError: no frames come.
        """
        self._frames.drain()
        return self._frames.receive().latest

    def actual_q(self) -> NDArray[np.float64]:
        """Joint positions (6,) as reported now [rad].

        Raises:
            DriverError: no frames come, or one reports what is no angle.
        """
        frame = self.read_frame()
        check_angles(frame)
        q: NDArray[np.float64] = frame.actual_q
        return q.copy()

    def report(self) -> RobotReport:
        """What the robot reports of itself now.

        Raises:
            DriverError: no frames come, or a connection broke.
        """
        self._primary.poll()
        return make_report(
            self._network, self._host, self._ports, self.info, self.read_frame(), self._primary
        )

    def check_ready(self) -> RealtimeFrame:
        """Refuse a robot that may not move now; returns its state.

        Raises:
            RobotStoppedError: safety mode or robot mode forbids it.
            DriverError: a program is running, the speed slider was moved, or the ports name different arms.
        """
        frame = self.read_frame()
        check_safety(frame)
        check_idle(frame)
        self._primary.poll()
        check_arm(self.info, self._primary)
        check_slider(reported_slider(self._primary))
        return frame

    def stream(self, source: CommandSource[S], on_row: RowSink[S], *, acceleration: float) -> StreamReport:
        """Stream the commands of one source: start the receiver program, stream, stop, wait for rest.

        Args:
            source: a fresh one; the arm must stand where its run begins.
            on_row: takes every new frame with the command sent; what it raises ends the run.
            acceleration: of the robot's `speedj` [rad/s2].

        Returns:
            What happened on the wire; the arm rests and no program runs.

        Raises:
            RobotStoppedError: the robot stopped, or its program failed.
            DriverError: anything else that ended the run; the arm has been stopped.
        """
        self.check_ready()
        server = self._server
        server.forget_callers()
        reverse: Transport | None = None
        try:
            with _AlwaysStopped(self) as guard:
                period = self.info.period
                text = receiver_script(server.address, server.port, acceleration=acceleration, period=period)
                self._start(text)
                reverse = server.accept_program(self._look_after, self._frames.patience(DIAL_TIMEOUT))
                guard.reverse = reverse
                stream = VelocityStream(
                    self._frames, reverse, self._network, period, self._raise_robot_errors
                )
                try:
                    with collector_paused():
                        report = stream.run(source, on_row)
                except ProgramEndedError as error:
                    raise self._explain(error) from error
                self._wait(is_stopped, REST_TIMEOUT, "the robot's program did not end after the stop word")
                wait_for_rest(self._frames, self._network)
        finally:
            if reverse is not None:
                reverse.close()
        self.time_waits &= report.time_waits
        return report

    def stop(self, reverse: Transport | None) -> None:
        """Bring the arm to rest, by every available method.

        Args:
            reverse: connection to the receiver program, when one runs.

        Raises:
            DriverError: the arm could not be seen to come to rest.
        """
        if reverse is not None and self._attempt(
            lambda: reverse.send(encode_velocity(VelocityMode.STOP_PROGRAM))
        ):
            return
        if self._attempt(self._send_stop_program):
            return
        raise DriverError("the arm was not seen to come to rest: PRESS THE EMERGENCY STOP if it still moves")

    def _attempt(self, act: Callable[[], object]) -> bool:
        """Try one method to stop; True when the arm then rests and no program runs."""
        try:
            act()
            wait_until(has_ended, self._frames, self._network, REST_TIMEOUT, "the robot's program goes on")
            if not is_stopped(wait_for_rest(self._frames, self._network)):
                self._end_paused_program()
        except (DriverError, KeyboardInterrupt):  # a second Ctrl-C must not keep us from stopping the arm
            return False
        self._in_motion = False
        return True

    def _end_paused_program(self) -> None:
        """End the program that a safety stop has paused, so that it cannot be resumed without this client.

        A robot that does not answer keeps it; nothing moves meanwhile, and the next run reports it.
        """
        with suppress(DriverError):
            self._scripts.send_program(STOP_WORD)
            wait_until(is_stopped, self._frames, self._network, REST_TIMEOUT, "the paused program stays")

    def _send_stop_program(self) -> None:
        """Replace whatever runs by a program that stops the arm.

        It uses new connections: the present ones may be broken.
        """
        for connection in (self._scripts, self._frames):
            connection.close()
        self._scripts = self._open_packages(self._ports.secondary, "secondary")
        self._frames = self._open_frames()
        self._scripts.send_program(stop_script())

    def _open_packages(self, port: int, name: str) -> PackageStream:
        transport = self._network.connect(self._host, port, CONNECT_TIMEOUT)
        stream = PackageStream(transport, self._network, name)
        self._open.append(stream)
        return stream

    def _open_frames(self) -> RealtimeClient:
        transport = self._network.connect(self._host, self._ports.realtime, CONNECT_TIMEOUT)
        frames = RealtimeClient(transport, self._network)
        self._open.append(frames)
        return frames

    def _connect(self) -> None:
        self._primary = self._open_packages(self._ports.primary, "primary")
        self._scripts = self._open_packages(self._ports.secondary, "secondary")
        self.info = read_robot_info(self._network, self._host, self._ports.dashboard, self._primary)
        if not (condition := software(self.info.version)).holds:
            raise DriverError(condition.complaint)
        self._frames = self._open_frames()
        self.layout = self._frames.layout
        self._server = ReverseServer(
            self._network, self._frames.local_address, self._frames.robot_address, self._reverse_port
        )
        self._open.append(self._server)

    def _start(self, text: str) -> None:
        """Send a program and wait until it shows as running; what was reported before is of no interest."""
        self._frames.drain()
        self._primary.poll()
        self._scripts.poll()
        self._program, self._last_text, self._is_read_only = text, "", False
        self._scripts.send_program(text)
        self._wait(
            self._has_started, _START_TIMEOUT, "the robot did not start the program in time: see its log"
        )

    def _has_started(self, frame: RealtimeFrame) -> bool:
        if self._is_read_only:
            raise RobotStoppedError(control(remote=False).complaint)
        return not is_stopped(frame)

    def _raise_robot_errors(self) -> None:
        """Read both script ports; raise what the robot reports about our program, or a moved speed slider."""
        self._scripts.poll()
        messages = self._primary.poll()
        for message in messages:
            if isinstance(message, TextMessage):
                self._last_text = message.text
            self._is_read_only |= isinstance(message, ErrorCodeMessage) and message.code == _READ_ONLY
        raise_on_error(messages, self._program)
        check_slider(reported_slider(self._primary))

    def _explain(self, error: ProgramEndedError) -> DriverError:
        """Say why our program has ended, as far as the robot reports it."""
        try:
            self._raise_robot_errors()
        except DriverError as reason:
            return reason
        said = "the pendant or another client stopped it"
        if self._last_text:
            said = f'the robot\'s last message is "{self._last_text}"'
        return ProgramEndedError(f"{error}; {said}")

    def _look_after(self) -> None:
        """Read everything that has come, while waiting for something else; at least one frame comes."""
        check_safety(self._frames.receive().latest)
        self._raise_robot_errors()

    def _wait(self, condition: Callable[[RealtimeFrame], bool], timeout: float, complaint: str) -> None:
        """Wait for a frame; raise on safety stops and on errors that the robot reports."""

        def check(frame: RealtimeFrame) -> None:
            check_safety(frame)
            self._raise_robot_errors()

        wait_until(condition, self._frames, self._network, timeout, complaint, check)


class _AlwaysStopped:
    """Stops the arm when the block is left by an exception of any kind, Ctrl-C included."""

    def __init__(self, driver: UrDriver) -> None:
        self._driver = driver
        self.reverse: Transport | None = None

    def __enter__(self) -> Self:
        self._driver._in_motion = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self._driver._in_motion = False
            return
        try:
            self._driver.stop(self.reverse)
        except DriverError as not_stopped:
            error.add_note(str(not_stopped))
        finally:
            # Tried once with everything there is; closing the session would only try the same again.
            self._driver._in_motion = False
