"""Waiting for something to show in the frames. Looks at every single frame, so that no short state is missed.

Time-outs count the running time of this process: with a box faster than real time they are longer. Where the
robot's time waits for its clients they are longer, since it may wait for another one that is stopped.
"""

from __future__ import annotations

from collections.abc import Callable

from pc_client.driver.realtime_client import RealtimeClient
from pc_client.driver.transport import Network
from pc_client.driver.watchdog import is_at_rest
from pc_client.errors import DriverError
from protocol.patience import Patience
from protocol.realtime.layout import RealtimeFrame

REST_TIMEOUT = 5.0
"""An arm that gets a stop command rests within this [s]; UR's safety stops take 0.4 s."""

_REST_TIME = 0.5
"""The arm rests after this [s] of frames without motion, or at once when time itself stands still."""


def wait_until(
    condition: Callable[[RealtimeFrame], bool],
    frames: RealtimeClient,
    network: Network,
    timeout: float,
    complaint: str,
    check: Callable[[RealtimeFrame], None] | None = None,
) -> None:
    """Read frames until one meets a condition.

    Args:
        condition: what to wait for.
        frames: the realtime port.
        network: the clock.
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


def wait_for_rest(frames: RealtimeClient, network: Network) -> RealtimeFrame:
    """Wait until the arm has been at rest for a while, or rests while time itself stands still.

    Returns:
        The state at rest.

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
