"""A session with one robot: connect, stream, and always leave the arm stopped.

It uses the real protocol only. Whatever moves the arm is streamed, so that the program on the robot stops it
when commands stop. Every end of a motion (done, refused, Ctrl-C, lost robot) goes through
`stop`: first the stop word to the program, then a program of our own that stops the arm.
"""

from __future__ import annotations

from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pc_client.driver.connections import Connections
from pc_client.driver.program_watch import ProgramWatch
from pc_client.driver.receiver_script import receiver_script
from pc_client.driver.reverse_server import DIAL_TIMEOUT
from pc_client.driver.robot_report import RobotReport, check_arm, make_report, reported_slider
from pc_client.driver.stopping import stop_arm
from pc_client.driver.transport import Network, TcpNetwork, Transport
from pc_client.driver.velocity_stream import (
    CommandSource,
    RowSink,
    S,
    StreamReport,
    VelocityStream,
    collector_paused,
)
from pc_client.driver.waiting import REST_TIMEOUT, wait_for_rest
from pc_client.driver.watchdog import (
    ProgramEndedError,
    check_angles,
    check_idle,
    check_safety,
    check_slider,
    is_stopped,
)
from pc_client.errors import DriverError, RobotStoppedError, full_message
from protocol.realtime.layout import RealtimeFrame
from protocol.ur_types import Ports


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
    """

    def __init__(
        self,
        host: str,
        ports: Ports | None = None,
        *,
        reverse_port: int | None = None,
        network: Network | None = None,
    ) -> None:
        self._robot = robot = Connections(network or TcpNetwork(), host, ports or Ports.standard())
        self._watch = ProgramWatch(robot)
        self._in_motion = False
        try:
            robot.open(reverse_port)
        except BaseException:
            robot.close()
            raise
        self.info = robot.info
        self.layout = robot.frames.layout

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
            self._robot.close()

    def read_frame(self) -> RealtimeFrame:
        """The state of the robot now.

        Raises:
            DriverError: no frames come.
        """
        self._robot.frames.drain()
        return self._robot.frames.receive().latest

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
        self._robot.primary.poll()
        robot = self._robot
        return make_report(
            robot.network, robot.host, robot.ports, self.info, self.read_frame(), robot.primary
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
        self._robot.primary.poll()
        check_arm(self.info, self._robot.primary)
        check_slider(reported_slider(self._robot.primary))
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
        robot, watch = self._robot, self._watch
        server, frames, period = robot.server, robot.frames, self.info.period
        server.forget_callers()
        reverse: Transport | None = None
        try:
            with _AlwaysStopped(self) as guard:
                text = receiver_script(server.address, server.port, acceleration=acceleration, period=period)
                watch.start(text)
                reverse = server.accept_program(watch.look_after, frames.patience(DIAL_TIMEOUT))
                guard.reverse = reverse
                stream = VelocityStream(frames, reverse, robot.network, period, watch.check)
                try:
                    with collector_paused():
                        report = stream.run(source, on_row)
                except ProgramEndedError as error:
                    raise watch.explain(error) from error
                watch.wait(is_stopped, REST_TIMEOUT, "the robot's program did not end after the stop word")
                wait_for_rest(frames, robot.network)
        except RobotStoppedError:
            raise
        except DriverError as error:
            self._raise_safety_stop(error)
            raise
        finally:
            if reverse is not None:
                reverse.close()
        return report

    def _raise_safety_stop(self, error: DriverError) -> None:
        """Raise a safety stop that the robot reports now: it may be the cause of an error, or its effect."""
        try:
            check_safety(self.read_frame())
        except RobotStoppedError as stop:
            raise RobotStoppedError(f"{stop}; before that: {full_message(error)}") from error
        except DriverError:
            pass  # a robot that is gone reports nothing

    def stop(self, reverse: Transport | None) -> None:
        """Bring the arm to rest, by every available method.

        Args:
            reverse: connection to the receiver program, when one runs.

        Raises:
            DriverError: the arm could not be seen to come to rest.
        """
        stop_arm(self._robot, reverse)
        self._in_motion = False


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
