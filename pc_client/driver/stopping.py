"""Bringing the arm to rest, by every available method: the stop word, then a program of our own."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from pc_client.driver.connections import Connections
from pc_client.driver.stop_script import STOP_WORD, stop_script
from pc_client.driver.transport import Transport
from pc_client.driver.waiting import REST_TIMEOUT, wait_for_rest, wait_until
from pc_client.driver.watchdog import has_ended, is_stopped
from pc_client.errors import DriverError
from protocol.velocity_stream import VelocityMode, encode_velocity


def stop_arm(robot: Connections, reverse: Transport | None) -> None:
    """Bring the arm to rest, and end the program that moves it.

    Args:
        robot: the connections; those for programs and frames are made anew if the stop word does not help.
        reverse: connection to the receiver program, when one runs.

    Raises:
        DriverError: the arm could not be seen to come to rest.
    """
    if reverse is not None and _attempt(
        robot, lambda: reverse.send(encode_velocity(VelocityMode.STOP_PROGRAM))
    ):
        return
    if not _attempt(robot, lambda: _send_stop_program(robot)):
        raise DriverError("the arm was not seen to come to rest: PRESS THE EMERGENCY STOP if it still moves")


def _attempt(robot: Connections, act: Callable[[], object]) -> bool:
    """Try one method to stop; True when the arm then rests and no program runs."""
    try:
        act()
        wait_until(has_ended, robot.frames, robot.network, REST_TIMEOUT, "the robot's program goes on")
        if not is_stopped(wait_for_rest(robot.frames, robot.network)):
            _end_paused_program(robot)
    except (DriverError, KeyboardInterrupt):  # a second Ctrl-C must not keep us from stopping the arm
        return False
    return True


def _end_paused_program(robot: Connections) -> None:
    """End the program that a safety stop has paused, so that it cannot be resumed without this client.

    A robot that does not answer keeps it; nothing moves meanwhile, and the next run reports it.
    """
    with suppress(DriverError):
        robot.scripts.send_program(STOP_WORD)
        wait_until(is_stopped, robot.frames, robot.network, REST_TIMEOUT, "the paused program stays")


def _send_stop_program(robot: Connections) -> None:
    """Replace whatever runs by a program that stops the arm."""
    robot.renew()
    robot.scripts.send_program(stop_script())
