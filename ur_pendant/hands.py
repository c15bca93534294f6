"""What people do to a box through a window: what a pendant can, and what only an emulated box has.

A pendant's keys are lines for the dashboard server, or the operation of the control API that does the same
where there is no dashboard (PolyScope X); the arm is moved by a program that is sent to port 30002. All else
is operations of the control API. Every way begins with `_check`: a robot that does not say that it is
simulated takes nothing.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from importlib import resources
from typing import Any, NamedTuple

import numpy as np

from pc_client.arrays import Array
from pc_client.driver.questions import ask_dashboard
from pc_client.driver.rtde import RtdeStream, RtdeValues
from pc_client.driver.transport import TcpNetwork
from pc_client.errors import ClientError
from protocol.ur_types import ProgramState, RobotMode, SoftwareVersion
from ur_emulator.errors import EmulatorError
from ur_emulator.host.control_api.http_client import ControlClient
from ur_emulator.host.control_api.operations import make
from ur_pendant.robot import Robot, numbers


class HandError(Exception):
    """What was asked for was not done; one line for people."""


class Key(NamedTuple):
    """A key of a pendant: the line for the dashboard server, and the operation that does the same."""

    label: str
    line: str
    operation: str


KEYS = (
    Key("Power on", "power on", "power_on"),
    Key("Release brakes", "brake release", "release_brakes"),
    Key("Power off", "power off", "power_off"),
    Key("Play", "play", "resume_program"),
    Key("Pause", "pause", "pause_program"),
    Key("Stop", "stop", "stop_program"),
    Key("Unlock protective stop", "unlock protective stop", "unlock_protective_stop"),
    Key("Restart safety", "restart safety", "restart_safety"),
    Key("Close popup", "close popup", "close_popups"),
)
"""Of a real pendant; replies of the dashboard are shown as they come."""

_REFUSALS = ("could not", "cannot", "failed", "not allowed", "unable", "no such", "error", "not found")
"""What a reply of the dashboard has when the command was not carried out."""

SPEED, ACCELERATION = 0.6, 1.5
"""Of a joint that follows [rad/s, rad/s²]: a third of what a UR3 may, so that TCP limits hold, too."""

_SILENCE = 0.3
"""The arm stops when no target comes for so long [s]."""

_THERE = 1e-3
"""A joint whose target is so near its goal has reached it [rad]."""

_REST = 3.0
"""A program that nobody moves ends so long after the arm has reached its goal [s]: others may want it."""

_START = 2.0
"""A program that has not begun after so long [s] does not run: in local control, for example."""

_MOVE = "pendant_move"
"""The program that moves a box in lockstep."""

_RATE = 30.0
_UPPER_SINCE = (SoftwareVersion(3, 9), SoftwareVersion(5, 3))
"""First software with registers from 24 on, which fieldbuses leave alone."""


class Hands:
    """All that is done to one robot."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._follower: Follower | None = None
        self._moves = False

    # --- keys of a pendant

    def press(self, key: Key) -> str:
        """Press a key; return what the robot says. HandError if it was not done."""
        if not self._robot.address.ports.dashboard:
            self.operate(key.operation)
            return ""
        return self.tell_dashboard(key.line)

    def tell_dashboard(self, line: str) -> str:
        """Have a command of the dashboard server done; return its reply. HandError if it was refused."""
        self._check()
        address = self._robot.address
        try:
            answers = ask_dashboard(TcpNetwork(), address.host, address.ports.dashboard, (line,))
        except ClientError as error:
            raise HandError(str(error)) from None
        reply = answers.get(line)
        if reply is None:
            raise HandError(f"the dashboard server does not answer to {line!r}")
        if any(word in reply.lower() for word in _REFUSALS):
            raise HandError(reply)
        return reply

    def run(self, program: str) -> None:
        """Send a program. HandError if it was not sent; what becomes of it the log says."""
        self._check()
        address = self._robot.address
        try:
            connection = TcpNetwork().connect(address.host, address.ports.secondary, 2.0)
            connection.send(program.encode("latin-1", "replace") + b"\n")
            connection.close()
        except ClientError as error:
            raise HandError(str(error)) from None

    # --- an emulated box

    @property
    def has_control_api(self) -> bool:
        """Whether `operate` works."""
        return bool(self._robot.address.control_port)

    def operate(self, operation: str, **arguments: Any) -> dict[str, Any]:
        """Have an operation of the control API done. HandError if it was not, with what the box says."""
        self._check()
        address = self._robot.address
        if not address.control_port:
            raise HandError("only the control API of a box can do this: serve it with --control-port")
        client = ControlClient(address.host, address.control_port, address.token)
        try:
            return client.perform(make(operation, arguments))
        except EmulatorError as error:
            raise HandError(str(error)) from None

    def let_pass(self, seconds: float) -> None:
        """Let time of a box in lockstep pass, which stands still while nothing moves. HandError if not."""
        state = self._robot.state
        if state is not None:
            self.operate("wait_until", time=state.time + seconds)

    # --- moving the arm

    def follow(self, q: Sequence[float] | Array) -> None:
        """Let the arm go to a posture (6,) [rad] from where it is, until it rests there or a loss.

        A box in lockstep, whose time would run away from a hand, gets a move to each posture; a posture that
        comes meanwhile takes the place of the one before.

        HandError if no program may run now.
        """
        self._check()
        goal = tuple(map(float, q))
        if self._robot.info is not None and self._robot.info.lockstep:
            if not (self._moves and self._robot.program in ("", _MOVE)):
                _check_rest(self._robot.values)
            self.run(f"def {_MOVE}():\n  movej({list(goal)}, a={ACCELERATION}, v={SPEED})\nend")
            self._moves = True
        elif self._follower is None or not self._follower.take(goal):
            if self._follower is not None:
                self._follower.join()
            self._follower = Follower(self._robot, self.run, goal)

    @property
    def goal(self) -> Array | None:
        """Where the arm goes (6,) [rad]; None while it follows nobody."""
        follower = self._follower
        return np.array(follower.goal) if follower is not None and follower.is_alive else None

    def _check(self) -> None:
        """Raise HandError for a robot that is only shown."""
        if not self._robot.is_held:
            raise HandError(
                "this window only shows the robot: it does not say that it is simulated"
                if not self._robot.view_only
                else "this window only shows the robot"
            )


class Follower:
    """A program in the box that goes to `goal`, and the stream of its targets.

    It ends when the arm has been at an unchanged goal for `_REST`, and when its program has ended, as by a
    stop. From then on it takes no goal.
    """

    def __init__(self, robot: Robot, run: Callable[[str], None], goal: tuple[float, ...]) -> None:
        """Begin where the arm is. HandError if no program may run now."""
        assert robot.info is not None
        self.goal = goal
        self._lock, self._is_ending = threading.Lock(), False
        address, version = robot.address, robot.info.version
        first = 24 if version >= _UPPER_SINCE[version.major >= 5] else 0
        inputs = [f"input_int_register_{first}", *(f"input_double_register_{first + k}" for k in range(6))]
        outputs = ("runtime_state", "robot_mode", "target_q")
        with ExitStack() as failing:
            try:
                stream = RtdeStream(TcpNetwork(), address.host, address.ports.rtde, outputs, _RATE, inputs)
                self._stream = failing.enter_context(stream)
                values = stream.receive()
                _check_rest(values)
                # The program must find where the arm is, not the targets of the last time.
                for counter in (1, 2):
                    stream.send((counter, *numbers(values, "target_q")))
                    stream.receive()
                run(_program(first))
            except ClientError as error:
                _check_rest(robot.values)  # as another window, which writes to the inputs: its program runs
                raise HandError(str(error)) from None
            failing.pop_all()
        self._thread = threading.Thread(target=self._feed, daemon=True)
        self._thread.start()

    @property
    def is_alive(self) -> bool:
        """Whether the program still follows."""
        return self._thread.is_alive()

    def take(self, goal: tuple[float, ...]) -> bool:
        """Go to another goal; return False if it is too late for one."""
        with self._lock:
            if not self._is_ending:
                self.goal = goal
            return not self._is_ending

    def join(self) -> None:
        """Wait for the end."""
        self._thread.join()

    def _feed(self) -> None:
        counter, resting, has_run = 2, 0.0, False
        last: tuple[float, ...] = ()
        try:
            while True:
                values = self._stream.receive()  # 30 times a second
                runs = values["runtime_state"] == ProgramState.PLAYING
                with self._lock:
                    goal = self.goal
                    is_there = (
                        not runs or np.abs(np.subtract(goal, numbers(values, "target_q"))).max() < _THERE
                    )
                    resting = resting + 1.0 / _RATE if is_there and goal == last else 0.0
                    self._is_ending = resting >= _REST if runs else has_run or resting > _START
                if self._is_ending:
                    break
                has_run, last, counter = has_run or runs, goal, counter + 1
                self._stream.send((counter, *last))
            self._stream.send((0, *goal))
            for _ in range(round(_START * _RATE)):  # until the next one may begin
                if self._stream.receive()["runtime_state"] == ProgramState.STOPPED:
                    break
        except ClientError:
            pass  # the program ends by itself
        finally:
            with self._lock:
                self._is_ending = True
            self._stream.close()


def _check_rest(values: RtdeValues) -> None:
    """Raise HandError if the arm cannot be moved by hand now."""
    if values.get("robot_mode") != RobotMode.RUNNING:
        raise HandError("the arm has no power or its brakes are closed: power it on, release the brakes")
    if values.get("runtime_state") != ProgramState.STOPPED:
        raise HandError("a program runs: stop it before you move the arm")


def _program(register: int) -> str:
    """The program with its numbers."""
    text = resources.files(__package__).joinpath("follow.script").read_text("utf-8")
    numbers = {"REGISTER": register, "SPEED": SPEED, "ACCELERATION": ACCELERATION, "SILENCE": _SILENCE}
    for name, number in numbers.items():
        text = text.replace(name, str(number))
    return text
