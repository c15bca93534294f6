"""The control loop of one run: a new frame comes, a command goes out, a row is logged.

Paced by frames alone. A heartbeat (repeated time stamp) is neither answered nor logged; when several new
frames wait, we were late: all are logged, the newest is answered. So at most one command is in flight.
A pause so long that the robot's program has ended also ends the run: no command is computed from frames
before it.
"""

import gc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np

from pc_client.arrays import Array
from pc_client.driver.realtime import RealtimeClient
from pc_client.driver.receiver import MISSED_ALLOWED, READ_TIMEOUT
from pc_client.driver.transport import TcpNetwork, TcpTransport
from pc_client.driver.watchdog import check_angles, check_streaming, is_at_full_speed
from pc_client.errors import DriverError
from protocol.realtime.layout import RealtimeFrame
from protocol.velocity_stream import VelocityMode, encode_velocity
from ur_hil.patience import Patience


class Step(Protocol):
    """What a source returns for one frame."""

    @property
    def qd_cmd(self) -> list[float]:
        """(6,) velocities to send [rad/s]."""

    @property
    def finished(self) -> bool:
        """True: the run is over, the stop word is sent instead of `qd_cmd`."""


S = TypeVar("S", bound=Step)
S_co = TypeVar("S_co", bound=Step, covariant=True)


class CommandSource(Protocol[S_co]):
    """Where the commands of one run come from; `Tracker` is one."""

    @property
    def qd_max(self) -> tuple[float, ...]:
        """(6,) the largest speeds that a step can command [rad/s]."""

    def answer(self, frame: RealtimeFrame) -> S_co:
        """Answer a new frame with a command; what it raises ends the run."""

    def observe(self, stamp: float) -> S_co:
        """Describe a frame [s] that gets no command of its own because a newer one is already here."""

    def check_report(self, q: Sequence[float], pose: Sequence[float]) -> None:
        """Refuse a report whose joint angles (6,) [rad] and TCP pose (6,) [m, rad] do not belong together."""


RowSink = Callable[[RealtimeFrame, S], None]
"""Takes every new frame with what the source made of it."""

_FRAMES_BEFORE_START = 3
"""New frames after which a robot counts as one whose time runs by itself."""

_LONGEST_RISE = 1.0
"""Time in which the speed scaling must have reached 1 after the program started [s]."""

_HOUSEKEEPING = 0.128
"""Time between two looks at the other connections, and at whether angles and pose belong together [s]: an
eighth of a second, as robot states come."""

_SHORTEST_GAP = 0.1
"""Time stamps are at least this share of a cycle apart; rows of a run are as many as its time allows."""


_MOST_STOPS, _STOPS_WITHIN = 10, 5.0
"""An arm that stops and goes on so often within this time [s] follows nothing; a busy computer has a few."""

_MOST_LATE = 0.05
"""Share of frames without a command of their own beyond which a person is told."""


@dataclass(slots=True)
class StreamReport:
    """What happened on the wire during one run.

    Attributes:
        period: control cycle [s].
        n_commands: commands sent, the stop word not counted.
        late_frames: new frames that got no command of their own because a newer one was already there.
        lost_frames: cycles whose frame never came.
        stops: robot times [s] when its program had begun to stop the arm, because no command came.
        robot_time: [s] from the first to the last frame, by the robot's stamps.
        wall_time: [s] of the same by our clock.
        computing_time: [s] of it in which commands were computed.
        slowest_command: longest time for one [s].
    """

    period: float = 0.008
    n_commands: int = 0
    late_frames: int = 0
    lost_frames: int = 0
    stops: list[float] = field(default_factory=list)
    robot_time: float = 0.0
    wall_time: float = 0.0
    computing_time: float = 0.0
    slowest_command: float = 0.0

    @property
    def trouble(self) -> str:
        """One line about commands that came late; empty when hardly any did."""
        without = self.late_frames + self.lost_frames
        if not self.stops and without <= _MOST_LATE * (self.n_commands + without):
            return ""
        mean, most = self.computing_time / max(self.n_commands, 1), self.slowest_command
        is_slow = mean > self.period or most > MISSED_ALLOWED
        return (
            f"the arm stopped and went on {len(self.stops)} times; beside {self.n_commands} commands "
            f"{self.late_frames} frames came late, {self.lost_frames} never; a command took "
            f"{1e3 * mean:.1f} ms to compute, at most {1e3 * most:.0f}, a cycle is {1e3 * self.period:g} ms: "
            + ("make the law faster" if is_slow else "give this computer less to do, or look at the network")
        )

    def check_silence(self, answered: float, newest: float) -> None:
        """Refuse to go on when the robot had no command for too long, or too often for long.

        The time stamps are those of the last frame that was answered and of the newest one [s].
        """
        silence = newest - answered
        if silence > READ_TIMEOUT:
            why = "this computer or the network stood still"
            if self.slowest_command > READ_TIMEOUT:
                why = f"the controller or law took {self.slowest_command:.2f} s to compute one, or {why}"
            raise DriverError(
                f"the robot had no command for {silence:.2f} s, allowed is {READ_TIMEOUT} s: "
                f"{why}; the robot's program has stopped the arm"
            )
        if silence > (round(MISSED_ALLOWED / self.period) + 1.5) * self.period:
            self.stops.append(newest)
            recent = self.stops[-_MOST_STOPS:]
            if len(recent) == _MOST_STOPS and newest - recent[0] < _STOPS_WITHIN:
                raise DriverError(self.trouble)


class StreamLog(Generic[S]):
    """A row sink that keeps all rows."""

    def __init__(self) -> None:
        self.frames: list[RealtimeFrame] = []
        self.steps: list[S] = []

    def __call__(self, frame: RealtimeFrame, step: S) -> None:
        """Take a row."""
        self.frames.append(frame)
        self.steps.append(step)

    def columns(self, *names: str) -> list[Array]:
        """Columns of the frames by their names, (n,) or (n, 6), and the commands (n, 6) [rad/s]."""
        rows = [[getattr(frame, name) for frame in self.frames] for name in names]
        return [np.array(row, dtype=np.float64) for row in (*rows, [step.qd_cmd for step in self.steps])]


@dataclass(frozen=True, slots=True)
class VelocityStream:
    """Streams velocities to a program that has just connected.

    Attributes:
        reverse: the program's connection.
        network: the clock that bounds standstill.
        period: control cycle of the robot [s].
        housekeeping: called now and then; raises when the robot reports an error.
    """

    frames: RealtimeClient
    reverse: TcpTransport
    network: TcpNetwork
    period: float
    housekeeping: Callable[[], None]

    def run(self, source: CommandSource[S], on_row: RowSink[S]) -> StreamReport:
        """Stream until a fresh source has finished; then the stop word is sent. `on_row` takes every row.

        Returns:
            What happened on the wire. The arm may still be coming to rest.

        Raises:
            RobotStoppedError: safety stop, or the program ended.
            DriverError: silence of either side, closed sockets, a command that is not safe to send.
        """
        report = StreamReport(self.period)
        each = round(_HOUSEKEEPING / self.period)
        frame = self._wait_for_trigger()
        now = self.network.now
        began = now()
        receive, send, limits = self.frames.receive, self.reverse.send, source.qd_max
        first_stamp = last_stamp = frame.timestamp
        while True:
            stamp = frame.timestamp
            check_streaming(frame)
            asked = now()
            step = source.answer(frame)
            report.computing_time += (spent := now() - asked)
            report.slowest_command = max(report.slowest_command, spent)
            if step.finished:
                break
            if report.n_commands % each == 0:
                source.check_report(frame.actual_q.tolist(), frame.actual_tcp_pose.tolist())
            check_command(step.qd_cmd, limits)
            try:
                send(encode_velocity(VelocityMode.VELOCITY, step.qd_cmd))
            except DriverError:
                self._check_waiting(stamp, report)  # more precise than a lost connection
                raise
            on_row(frame, step)
            report.n_commands += 1
            if report.n_commands % each == 0:
                self.housekeeping()

            arrival = receive()
            new = arrival.new
            if not new:
                new = self._wait_for_new()
            if len(new) > 1 and (waiting := self.frames.drain()) is not None:
                new = new + waiting.new
            last_stamp = self._count_gaps(new, last_stamp, report)
            if len(new) > 1:
                report.late_frames += len(new) - 1
                for late in new[:-1]:
                    check_angles(late)
                    on_row(late, source.observe(late.timestamp))
            frame = new[-1]
            report.check_silence(stamp, last_stamp)
        send(encode_velocity(VelocityMode.STOP_PROGRAM))  # the program ramps the arm down and ends
        report.robot_time = last_stamp - first_stamp
        report.wall_time = now() - began
        return report

    def _wait_for_trigger(self) -> RealtimeFrame:
        """Find the frame that the first command answers.

        After its hello the program waits for a command. A robot whose time waits too repeats its last frame:
        that one is the trigger, whenever the hello came between the frames. A robot whose time
        runs on sends new frames: the third is the trigger, or a later one if the controller raises the speed
        scaling when a program starts; it gets the word to rest until then.
        """
        self.frames.drain()
        n_new, longest = 0, round(_LONGEST_RISE / self.period)
        while True:
            arrival = self.frames.receive()
            n_new += len(arrival.new)
            stands_still = self.frames.time_waits and arrival.stands_still
            if stands_still or n_new >= _FRAMES_BEFORE_START:
                if stands_still or is_at_full_speed(arrival.latest) or n_new >= longest:
                    return arrival.latest
                self.reverse.send(encode_velocity(VelocityMode.HOLD))

    def _wait_for_new(self) -> list[RealtimeFrame]:
        """Skip heartbeats until time goes on."""
        waited, longest = Patience(), self.frames.patience(READ_TIMEOUT)
        while True:
            arrival = self.frames.receive()
            if arrival.new:
                return arrival.new
            check_streaming(arrival.latest)
            if waited.spent(self.network.now()) > longest:
                raise DriverError(
                    f"the robot's time has stood still for {longest:g} s although it has a command"
                )

    def _check_waiting(self, answered: float, report: StreamReport) -> None:
        """Look for the reason of a broken connection in the frames that wait; raise it if there is one."""
        waiting = self.frames.drain()
        if waiting is not None:
            report.check_silence(answered, waiting.latest.timestamp)
            check_streaming(waiting.latest)

    def _count_gaps(self, new: list[RealtimeFrame], last_stamp: float, report: StreamReport) -> float:
        """Count the cycles that are missing; returns the newest stamp."""
        for frame in new:
            stamp = frame.timestamp
            gap = stamp - last_stamp
            if gap < _SHORTEST_GAP * self.period:
                raise DriverError(
                    f"the robot's frames jump from {last_stamp:.6f} s to {stamp:.6f} s, a cycle is "
                    f"{self.period:g} s: the stream is broken"
                )
            if gap > 1.5 * self.period:
                report.lost_frames += round(gap / self.period) - 1
            last_stamp = stamp
        return last_stamp


@contextmanager
def collector_paused() -> Iterator[None]:
    """Keep the garbage collector out of the control loop, where one pass may cost more than a cycle."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def check_command(qd: Sequence[float], limits: Sequence[float]) -> None:
    """The last check of a command (6,) [rad/s] against the largest speeds (6,) [rad/s], before it is sent.

    Raises:
        DriverError: a velocity is NaN or beyond its limit; a controller must never produce that.
    """
    for value, limit in zip(qd, limits, strict=True):
        if not -limit <= value <= limit:  # NaN fails too
            raise DriverError(
                f"a command of {[round(v, 3) for v in qd]} rad/s is not safe to send: "
                f"allowed is +-{[round(v, 3) for v in limits]}"
            )
