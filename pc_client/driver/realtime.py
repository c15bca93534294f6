"""Frames of the realtime port: in order, decoded, each known to be new or a heartbeat; and waiting for one.

A heartbeat is a frame that repeats the last time stamp: the robot's time stands still while it waits for us.
Of a robot that does not say that its time waits it is as good as no frame. New frames are never dropped here;
the caller decides what to do with late ones. Waiting looks at every single frame, so that no short state is
missed.

Time-outs count the running time of this process: with a box faster than real time they are longer. Where the
robot's time waits for its clients they are longer, since it may wait for another one that is stopped.
"""

from collections.abc import Callable
from typing import NamedTuple

from pc_client.driver.transport import MOST_WAITING, TcpNetwork, TcpTransport
from pc_client.driver.watchdog import is_at_rest
from pc_client.errors import DriverError
from protocol.errors import RemoteProtocolError
from protocol.frame_buffer import FrameBuffer
from protocol.realtime.layout import MAX_FRAME_SIZE, RealtimeFrame, RealtimeLayout, layout_for_size
from ur_hil.patience import LONGEST_STEP, Patience

FRAME_TIMEOUT = 1.0
"""Without a new frame for this long [s] the robot counts as gone."""

_STOPPED_TIMEOUT = 120.0
"""The same for a robot whose time waits for its clients [s]: its arm does not move unattended, so a box that
is stopped or gets no processor is sat out. Longer than the box itself has patience with others."""

_LATEST_STAMP = 1e9
"""No controller has been on for longer [s]: 30 years."""

_STEP = 0.5 * LONGEST_STEP
"""How long one look at the connection waits [s]: all of it counts as patience."""


class Arrival(NamedTuple):
    """What came from the realtime port.

    Attributes:
        new: frames with a time stamp of their own, oldest first.
        latest: the last frame of all, possibly a heartbeat.
        n_heartbeats: how many frames repeated a time stamp.
    """

    new: list[RealtimeFrame]
    latest: RealtimeFrame
    n_heartbeats: int

    @property
    def stands_still(self) -> bool:
        """The last frame repeats the time stamp of the one before."""
        return not self.new or self.latest is not self.new[-1]


class RealtimeClient:
    """Reads one realtime connection.

    Args:
        time_waits: the robot says that its time waits for its clients, as in lockstep.

    Attributes:
        last_stamp: newest time stamp seen [s], or None before the first frame.
    """

    def __init__(self, transport: TcpTransport, network: TcpNetwork, *, time_waits: bool) -> None:
        self._transport = transport
        self._network = network
        self._buffer = FrameBuffer(MAX_FRAME_SIZE)
        self._layout: RealtimeLayout | None = None
        self.last_stamp: float | None = None
        self.time_waits = time_waits
        self._n_repeated = 0  # frames that are not reported yet

    @property
    def layout(self) -> RealtimeLayout:
        """Columns of this robot's frames; waits for the first frame if none came yet.

        Raises:
            DriverError: no frame comes, or it is none of a known size.
        """
        if self._layout is None:
            self.receive()
        assert self._layout is not None
        return self._layout

    @property
    def local_address(self) -> str:
        """Our address as the robot sees it."""
        return self._transport.local_address

    @property
    def robot_address(self) -> str:
        """The robot's address."""
        return self._transport.peer_address

    def receive(self) -> Arrival:
        """Wait for at least one frame, a new one unless time waits, and take all that are there.

        Raises:
            DriverError: no such frame in time, the stream ended, it is no such stream, or time runs back.
        """
        data = self._transport.receive(_STEP)
        return self._take(data) or self._receive_slowly(data)  # usually it is exactly one frame

    def patience(self, timeout: float) -> float:
        """How long to wait for what a robot whose time runs by itself does within `timeout` [s]."""
        return max(timeout, _STOPPED_TIMEOUT) if self.time_waits else timeout

    def drain(self) -> Arrival | None:
        """Take what has arrived, without waiting; None when nothing has. Errors are those of `receive`."""
        taken: Arrival | None = None
        n_bytes = 0
        while data := self._transport.receive(0.0):
            n_bytes += len(data)
            if n_bytes > MOST_WAITING:
                raise DriverError(
                    f"the realtime port floods us: more than {MOST_WAITING >> 20} MiB at once; a robot sends "
                    "150 kB a second: restart it, or look what else answers there"
                )
            if (arrival := self._take(data)) is None:
                continue
            if taken is not None:
                taken.new.extend(arrival.new)
                arrival = Arrival(taken.new, arrival.latest, taken.n_heartbeats + arrival.n_heartbeats)
            taken = arrival
        return taken

    def close(self) -> None:
        """Close the connection."""
        self._transport.close()

    def _receive_slowly(self, data: bytes | None) -> Arrival:
        """Go on until there is such a frame."""
        waited, timeout = Patience(), self.patience(FRAME_TIMEOUT)
        waited.spent(self._network.now() - (_STEP if data is None else 0.0))
        while True:
            if data == b"":
                raise DriverError("the robot closed the realtime connection")
            if waited.spent(self._network.now()) > timeout:
                raise DriverError(
                    f"no new realtime frame for {timeout:g} s: the robot or the network to it is gone"
                )
            data = self._transport.receive(_STEP)
            if (arrival := self._take(data)) is not None:
                return arrival

    def _take(self, data: bytes | None) -> Arrival | None:
        """The frames that are whole now; None if none is, or none is new of a robot whose time runs."""
        if not data:
            return None
        try:
            self._buffer.feed(data)
            first = self._buffer.next_frame()
            if first is None:
                return None
            arrival = self._sort(first)
        except RemoteProtocolError as error:
            raise DriverError(f"the realtime port sends no realtime frames: {error}") from error
        if arrival.new or self.time_waits:
            return arrival
        self._n_repeated = arrival.n_heartbeats
        return None

    def _sort(self, first: bytes) -> Arrival:
        """Decode this frame and all that follow in the buffer; separate new ones from heartbeats."""
        layout = self._layout
        if layout is None:
            layout = self._layout = layout_for_size(len(first))
        new: list[RealtimeFrame] = []
        n_heartbeats, self._n_repeated = self._n_repeated, 0
        raw: bytes | None = first
        while raw is not None:
            frame = layout.decode(raw)
            stamp: float = frame.timestamp
            if not 0.0 <= stamp <= _LATEST_STAMP:  # NaN is not
                raise DriverError(
                    f"the robot's frame has the time stamp {stamp:g} s, allowed are "
                    f"0 to {_LATEST_STAMP:g} s: restart the control box"
                )
            if self.last_stamp is None or stamp > self.last_stamp:
                new.append(frame)
                self.last_stamp = stamp
            elif stamp < self.last_stamp:
                raise DriverError(
                    f"the robot's frames jump back from {self.last_stamp:.6f} s to {stamp:.6f} s, time must "
                    "grow: restart the control box"
                )
            else:
                n_heartbeats += 1
            raw = self._buffer.next_frame()
        return Arrival(new, frame, n_heartbeats)


REST_TIMEOUT = 5.0
"""An arm that gets a stop command rests within this [s]; UR's safety stops take 0.4 s."""

_REST_TIME = 0.5
"""The arm rests after this [s] of frames without motion, or at once when time itself stands still."""


def wait_until(
    condition: Callable[[RealtimeFrame], bool],
    frames: RealtimeClient,
    network: TcpNetwork,
    timeout: float,
    complaint: str,
    check: Callable[[RealtimeFrame], None] | None = None,
) -> None:
    """Read frames until one meets a condition.

    Args:
        timeout: [s]; of a robot whose time runs by itself.
        complaint: message of the error when it takes longer.
        check: called with the newest frame before the condition is looked at; raises what ends the waiting.

    Raises:
        DriverError: it took too long, or the frames ended.
    """
    waited, longest = Patience(), frames.patience(timeout)
    while True:
        arrival = frames.receive()
        if check is not None:  # first: what went wrong may also meet the condition, e.g. end the program
            check(arrival.latest)
        if any(condition(frame) for frame in arrival.new) or condition(arrival.latest):
            return
        if waited.spent(network.now()) > longest:
            raise DriverError(complaint)


def wait_for_rest(frames: RealtimeClient, network: TcpNetwork) -> RealtimeFrame:
    """Wait until the arm has been at rest for a while, or rests while time itself stands still; its state.

    Raises:
        DriverError: it took longer than REST_TIMEOUT, or the frames ended.
    """
    at_rest_since: float | None = None

    def has_rested(frame: RealtimeFrame) -> bool:
        nonlocal at_rest_since
        stamp: float = frame.timestamp
        if not is_at_rest(frame):
            at_rest_since = None
            return False
        if at_rest_since is None:
            at_rest_since = stamp
        return stamp - at_rest_since >= _REST_TIME

    # Frames come all the time here: an arm that moves while time stands still does not rest by waiting.
    waited = Patience()
    while True:
        arrival = frames.receive()
        rested = [has_rested(frame) for frame in arrival.new]
        if (rested and rested[-1]) or (
            frames.time_waits and arrival.stands_still and is_at_rest(arrival.latest)
        ):
            return arrival.latest
        if waited.spent(network.now()) > REST_TIMEOUT:
            raise DriverError(f"the arm did not come to rest within {REST_TIMEOUT:g} s")
