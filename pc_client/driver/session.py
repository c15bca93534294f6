"""A session with one robot: connect, stream, and always leave the arm stopped.

It uses the real protocol only. Whatever moves the arm is streamed, so that the program on the robot stops it
when commands stop. A session is in one of the states of `_NEXT`; a motion that ends early (refused, Ctrl-C,
lost robot) is stopped by the ways of `_WAYS_TO_STOP`, the next one when the arm is not seen to rest.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from enum import StrEnum
from types import TracebackType
from typing import Self

from pc_client.arrays import Array
from pc_client.driver import velocity_stream, watchdog
from pc_client.driver.primary import PackageStream, raise_on_error
from pc_client.driver.realtime import REST_TIMEOUT, wait_for_rest, wait_until
from pc_client.driver.receiver import DIAL_TIMEOUT, STOP_DECELERATION, ReverseServer, receiver_script
from pc_client.driver.report import UNKNOWN, RobotReport, StatePorts
from pc_client.driver.transport import TcpNetwork, TcpTransport
from pc_client.driver.velocity_stream import CommandSource, RowSink, S, StreamReport, VelocityStream
from pc_client.errors import DriverError, RobotStoppedError, full_message
from protocol.primary.layout import RobotModeData
from protocol.primary.messages import ErrorCodeMessage, TextMessage
from protocol.realtime.layout import RealtimeFrame
from protocol.ur_types import Ports
from protocol.velocity_stream import VelocityMode, encode_velocity
from ur_hil.patience import Patience

_CONNECT_TIMEOUT = 5.0  # s

_START_TIMEOUT = 5.0
"""A program that does not show as running within this [s] was not accepted."""
_READ_ONLY = 210
"""Error code for a program that came in local control. Source: test of the maker's client library."""

_NO_REST = "the arm was not seen to come to rest: PRESS THE EMERGENCY STOP if it still moves"

_STOP_WORD = "stop program\n"
"""A controller's own word, no program: ends what runs or is paused. Source: public client library."""


class SessionState(StrEnum):
    """Of a session; what it says of the arm holds for motions of this session."""

    READY = "ready"  # no program of ours runs, the arm rests
    STARTING = "starting a motion"  # our program was sent, it has not dialled back
    STREAMING = "in motion"  # our program follows our velocities
    LOST = "broken: the arm was not seen to come to rest"
    CLOSED = "closed"


class _Event(StrEnum):
    START = "start a motion"
    DIALLED = "take a program's call"
    REST = "come to rest"
    NO_REST = "be lost"


_NEXT: Mapping[SessionState, Mapping[_Event, SessionState]] = {
    SessionState.READY: {_Event.START: SessionState.STARTING},
    SessionState.STARTING: {
        _Event.DIALLED: SessionState.STREAMING,
        _Event.REST: SessionState.READY,
        _Event.NO_REST: SessionState.LOST,
    },
    SessionState.STREAMING: {_Event.REST: SessionState.READY, _Event.NO_REST: SessionState.LOST},
    SessionState.LOST: {},
    SessionState.CLOSED: {},
}
"""The state after each event; an event that is not there is refused. From any state a session can be closed:
without a client the robot's program stops the arm by itself."""


class UrDriver:
    """A session with one robot.

    Use as a context manager; leaving it closes all connections. The arm rests then: whatever ends a motion
    stops it.

    Args:
        reverse_port: where its programs dial back; see ReverseServer.
        network: tests hand in a network in memory.

    Attributes:
        layout: columns of its realtime frames.
        state: of the session.
    """

    def __init__(
        self,
        host: str,
        ports: Ports | None = None,
        *,
        reverse_port: int | None = None,
        network: TcpNetwork | None = None,
    ) -> None:
        self._robot = robot = _SessionPorts(network or TcpNetwork(), host, ports or Ports.standard())
        self._watch = _ProgramWatch(robot)
        self.state = SessionState.READY
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
        """Close all connections."""
        self.state = SessionState.CLOSED
        self._robot.close()

    def _after(self, event: _Event) -> SessionState:
        """The state after an event; DriverError for one that cannot be now."""
        if (after := _NEXT[self.state].get(event)) is None:
            raise DriverError(f"the session is {self.state}, it cannot {event}: connect again")
        return after

    def actual_q(self) -> Array:
        """Joint positions (6,) as reported now [rad].

        Raises:
            DriverError: no frames come, or one reports what is no angle.
        """
        frame = self._robot.read_frame()
        watchdog.check_angles(frame)
        q: Array = frame.actual_q
        return q.copy()

    def report(self) -> RobotReport:
        """What the robot reports of itself now; DriverError if no frames come, or a connection broke."""
        return self._robot.report(self._robot.read_frame())

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
        self._after(_Event.START)
        self.check_ready()
        self._robot.server.forget_callers()
        try:
            return self._stream_and_stop(source, on_row, acceleration)
        except RobotStoppedError:
            raise
        except DriverError as error:
            self._raise_safety_stop(error)
            raise

    def set_payload(self, mass: float, centre_of_gravity: tuple[float, float, float]) -> None:
        """Set what the flange carries [kg, m]; DriverError if the robot reports another mass afterwards."""
        robot, waited = self._robot, Patience()
        setting = f"  set_payload({mass}, {list(centre_of_gravity)})"
        robot.scripts.send_program(f"sec ur_client_payload():\n{setting}\nend\n")
        while (reported := self.report().payload) is not None and abs(reported - mass) > 1e-3:
            if waited.spent(robot.network.now()) > _START_TIMEOUT:
                raise DriverError(f"the robot's payload is {reported:.2f} kg after {setting}: see its log")

    def check_ready(self) -> RealtimeFrame:
        """Refuse a robot that may not move now; returns its state.

        Raises:
            RobotStoppedError: safety mode or robot mode forbids it.
            DriverError: a program is running, the speed slider was moved, the arm is guided by hand, or the
                ports name different arms.
        """
        robot, model = self._robot, self.info.model
        frame = robot.read_frame()
        watchdog.check_safety(frame)
        robot.primary.poll()
        configured = robot.configured
        if configured is not None and model not in (UNKNOWN, configured):
            raise DriverError(
                f"the robot's arm is {model} (dashboard), {configured} (port 30001), must be one of them; "
                "look which arm it is, and set it so in the installation"
            )
        mode = robot.primary.newest(RobotModeData)
        conditions = watchdog.program_state(frame), watchdog.speed_slider(mode), watchdog.control_mode(mode)
        watchdog.require(conditions)
        return frame

    def _stream_and_stop(
        self, source: CommandSource[S], on_row: RowSink[S], acceleration: float
    ) -> StreamReport:
        """Run the receiver program for one stream; any exception, Ctrl-C included, stops the arm."""
        robot, watch, period = self._robot, self._watch, self.info.period
        server, frames = robot.server, robot.frames
        text = receiver_script(server.address, server.port, acceleration=acceleration, period=period)
        reverse: TcpTransport | None = None
        self.state = self._after(_Event.START)
        try:
            watch.start(text)
            reverse = server.accept_program(watch.look_after, frames.patience(DIAL_TIMEOUT))
            self.state = self._after(_Event.DIALLED)
            stream = VelocityStream(frames, reverse, robot.network, period, watch.check)
            try:
                with velocity_stream.collector_paused():
                    report = stream.run(source, on_row)
            except watchdog.ProgramEndedError as error:
                raise watch.explain(error) from error
            complaint = "the robot's program did not end after the stop word"
            watch.wait(watchdog.is_stopped, REST_TIMEOUT, complaint)
            wait_for_rest(frames, robot.network)
        except BaseException as error:
            rests = any(_attempt(way, robot, reverse) for way in _WAYS_TO_STOP[self.state])
            self.state = self._after(_Event.REST if rests else _Event.NO_REST)
            if not rests:
                error.add_note(_NO_REST)
            raise
        finally:
            if reverse is not None:
                reverse.close()
        self.state = self._after(_Event.REST)
        return report

    def _raise_safety_stop(self, error: DriverError) -> None:
        """Raise a safety stop that the robot reports now: it may be the cause of an error, or its effect."""
        try:
            watchdog.check_safety(self._robot.read_frame())
        except RobotStoppedError as stop:
            raise RobotStoppedError(f"{stop}; before that: {full_message(error)}") from error
        except DriverError:
            pass  # a robot that is gone reports nothing


class _SessionPorts(StatePorts):
    """All connections of a session: those that report, the one that takes programs, and the way back.

    Attributes:
        scripts: the secondary port.
        server: where the robot's programs dial back.
    """

    scripts: PackageStream
    server: ReverseServer

    def __init__(self, network: TcpNetwork, host: str, ports: Ports) -> None:
        super().__init__(network, host, ports, timeout=_CONNECT_TIMEOUT)

    def open(self, reverse_port: int | None) -> None:
        """Connect to the robot and listen for its programs; the reverse port is that of ReverseServer.

        Raises:
            DriverError: a port does not answer, or the robot's software is not one that we drive.
        """
        watchdog.require((watchdog.software(self.identify().version),))
        self.scripts = self._open_packages(self.ports.secondary, "secondary")
        self.open_frames()
        frames = self.frames
        self.server = ReverseServer(self.network, frames.local_address, frames.robot_address, reverse_port)
        self._closing.append(self.server.close)

    def renew(self) -> None:
        """Connect anew for programs and frames: the present connections may be broken."""
        for connection in (self.scripts, self.frames):
            connection.close()
        self.scripts = self._open_packages(self.ports.secondary, "secondary")
        self.open_frames()


class _ProgramWatch:
    """Watches one program after the other on one robot."""

    def __init__(self, robot: _SessionPorts) -> None:
        self._robot = robot
        self._program = self._last_text = ""
        self._is_read_only = False

    def start(self, text: str) -> None:
        """Send a program and wait until it shows as running; what was reported before is of no interest.

        Raises:
            RobotStoppedError: the robot is in local control, in a safety stop, or reports an error.
            DriverError: the program did not start in time.
        """
        robot = self._robot
        robot.frames.drain()
        robot.primary.poll()
        robot.scripts.poll()
        self._program, self._last_text, self._is_read_only = text, "", False
        robot.scripts.send_program(text)
        self.wait(
            self._has_started, _START_TIMEOUT, "the robot did not start the program in time: see its log"
        )

    def wait(self, condition: Callable[[RealtimeFrame], bool], timeout: float, complaint: str) -> None:
        """Wait for a frame; raise on safety stops and on errors that the robot reports."""

        def check(frame: RealtimeFrame) -> None:
            watchdog.check_safety(frame)
            self.check()

        wait_until(condition, self._robot.frames, self._robot.network, timeout, complaint, check)

    def check(self) -> None:
        """Read both script ports; raise what the robot reports about our program, or a moved speed slider."""
        self._robot.scripts.poll()
        messages = self._robot.primary.poll()
        for message in messages:
            if isinstance(message, TextMessage):
                self._last_text = message.text
            self._is_read_only |= isinstance(message, ErrorCodeMessage) and message.code == _READ_ONLY
        raise_on_error(messages, self._program)
        watchdog.require((watchdog.speed_slider(self._robot.primary.newest(RobotModeData)),))

    def look_after(self) -> None:
        """Read everything that has come, while waiting for something else; at least one frame comes."""
        watchdog.check_safety(self._robot.frames.receive().latest)
        self.check()

    def explain(self, error: watchdog.ProgramEndedError) -> DriverError:
        """Say why our program has ended, as far as the robot reports it."""
        try:
            self.check()
        except DriverError as reason:
            return reason
        said = "the pendant or another client stopped it"
        if self._last_text:
            said = f'the robot\'s last message is "{self._last_text}"'
        return watchdog.ProgramEndedError(f"{error}; {said}")

    def _has_started(self, frame: RealtimeFrame) -> bool:
        if self._is_read_only:
            raise RobotStoppedError(watchdog.control(remote=False).complaint)
        return not watchdog.is_stopped(frame)


def _attempt(
    way: Callable[[_SessionPorts, TcpTransport | None], None],
    robot: _SessionPorts,
    reverse: TcpTransport | None,
) -> bool:
    """Try one way to stop; True when the arm then rests and no program runs."""
    try:
        way(robot, reverse)
        complaint = "the robot's program goes on"
        wait_until(watchdog.has_ended, robot.frames, robot.network, REST_TIMEOUT, complaint)
        if not watchdog.is_stopped(wait_for_rest(robot.frames, robot.network)):
            _end_paused_program(robot)
    except (Exception, KeyboardInterrupt):  # nothing, and no second Ctrl-C, keeps us from the next way
        return False
    return True


def _end_paused_program(robot: _SessionPorts) -> None:
    """End the program that a safety stop has paused, so that it cannot be resumed without this client.

    A robot that does not answer keeps it; nothing moves meanwhile, and the next run reports it.
    """
    with suppress(DriverError):
        robot.scripts.send_program(_STOP_WORD)
        wait_until(watchdog.is_stopped, robot.frames, robot.network, REST_TIMEOUT, "the paused program stays")


def _send_stop_word(robot: _SessionPorts, reverse: TcpTransport | None) -> None:
    """End the program that follows our velocities."""
    assert reverse is not None  # a program streams
    reverse.send(encode_velocity(VelocityMode.STOP_PROGRAM))


def _send_stop_program(robot: _SessionPorts, reverse: TcpTransport | None) -> None:
    """Replace whatever runs by a program that stops the arm."""
    robot.renew()
    robot.scripts.send_program(stop_script())


_WAYS_TO_STOP = {
    SessionState.STARTING: (_send_stop_program,),
    SessionState.STREAMING: (_send_stop_word, _send_stop_program),
}
"""What ends a motion, in order, each tried until the arm is seen to rest."""


def stop_script() -> str:
    """A program that replaces whatever runs and brings the arm to rest."""
    return f"def ur_client_stop():\n  stopj({STOP_DECELERATION})\nend\n"
