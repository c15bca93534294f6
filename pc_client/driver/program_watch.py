"""Our program on the robot: start it, watch what the robot reports of it, say why it has ended."""

from __future__ import annotations

from collections.abc import Callable

from pc_client.driver.connections import Connections
from pc_client.driver.package_stream import raise_on_error
from pc_client.driver.robot_report import reported_slider
from pc_client.driver.waiting import wait_until
from pc_client.driver.watchdog import ProgramEndedError, check_safety, check_slider, control, is_stopped
from pc_client.errors import DriverError, RobotStoppedError
from protocol.primary.messages import ErrorCodeMessage, TextMessage
from protocol.realtime.layout import RealtimeFrame

_START_TIMEOUT = 5.0
"""A program that does not show as running within this [s] was not accepted."""
_READ_ONLY = 210
"""Error code for a program that came in local control. Source: test of the maker's client library."""


class ProgramWatch:
    """Watches one program after the other on one robot."""

    def __init__(self, robot: Connections) -> None:
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
        """Wait for a frame; raise on safety stops and on errors that the robot reports.

        Raises:
            DriverError: see `wait_until` and `check`.
        """

        def check(frame: RealtimeFrame) -> None:
            check_safety(frame)
            self.check()

        wait_until(condition, self._robot.frames, self._robot.network, timeout, complaint, check)

    def check(self) -> None:
        """Read both script ports; raise what the robot reports about our program, or a moved speed slider.

        Raises:
            RobotStoppedError: the program failed.
            DriverError: the speed slider was moved, or a connection broke.
        """
        self._robot.scripts.poll()
        messages = self._robot.primary.poll()
        for message in messages:
            if isinstance(message, TextMessage):
                self._last_text = message.text
            self._is_read_only |= isinstance(message, ErrorCodeMessage) and message.code == _READ_ONLY
        raise_on_error(messages, self._program)
        check_slider(reported_slider(self._robot.primary))

    def look_after(self) -> None:
        """Read everything that has come, while waiting for something else; at least one frame comes.

        Raises:
            DriverError: see `check`; the robot is in a safety stop.
        """
        check_safety(self._robot.frames.receive().latest)
        self.check()

    def explain(self, error: ProgramEndedError) -> DriverError:
        """Say why our program has ended, as far as the robot reports it."""
        try:
            self.check()
        except DriverError as reason:
            return reason
        said = "the pendant or another client stopped it"
        if self._last_text:
            said = f'the robot\'s last message is "{self._last_text}"'
        return ProgramEndedError(f"{error}; {said}")

    def _has_started(self, frame: RealtimeFrame) -> bool:
        if self._is_read_only:
            raise RobotStoppedError(control(remote=False).complaint)
        return not is_stopped(frame)
