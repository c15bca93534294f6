"""What people do to a box through a window: what a pendant can, and what only an emulated box has.

A pendant's keys are lines for the dashboard server, or the operation of the control API that does the same
where there is no dashboard (PolyScope X); the arm is moved by a program that is sent to port 30002. All else
is operations of the control API. Every way begins with `_check`: a robot that does not say that it is
simulated takes nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from importlib import resources
from threading import Lock, Thread
from typing import Any

import numpy as np

from pc_client.arrays import Array
from pc_client.driver.questions import ask_dashboard
from pc_client.driver.rtde import RtdeStream, RtdeValues
from pc_client.driver.transport import TcpNetwork
from pc_client.errors import ClientError
from protocol.ur_types import ProgramState, RobotMode, SoftwareVersion
from ur_emulator.host.control_api.http_client import ControlClient
from ur_emulator.host.control_api.operations import make
from ur_pendant.robot import Robot, numbers, plain
from ur_pendant.server import Events

Errand = Callable[[], object]


class HandError(Exception):
    """What was asked for was not done; one line for people."""


_REFUSALS = ("could not", "cannot", "failed", "not allowed", "unable", "no such", "error", "not found")
"""What a reply of the dashboard has when the command was not carried out."""

SPEED, ACCELERATION = 0.6, 1.5
"""Of a joint that follows [rad/s, rad/s²]: a third of what a UR3 may, so that TCP limits hold, too."""

_SILENCE = 0.3  # The arm stops when no target comes for so long [s].
_THERE = 1e-3  # A joint whose target is so near its goal has reached it [rad].
_REST = 3.0  # So long after the arm has reached its goal the program ends [s]: others may want the arm.
_START = 2.0  # A program that has not begun after so long [s] does not run: in local control, for example.
_MOVE = "pendant_move"  # The program that moves a box in lockstep.
_AGAIN = 2.0  # Before the same is told again [s]: a button that is held may have the same answer often.
_RATE = 30.0
_UPPER_SINCE = (SoftwareVersion(3, 9), SoftwareVersion(5, 3))
"""First software with registers from 24 on, which fieldbuses leave alone."""


class Hands:
    """All that is done to one robot.

    What was not done raises HandError, or ClientError or EmulatorError with what the robot says: one line.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._follower: Follower | None = None
        self._moves = False

    # --- keys of a pendant

    def press(self, line: str, operation: str) -> str:
        """Tell the dashboard server the line of a key, or have the operation done where there is none."""
        if not self._robot.address.ports.dashboard:
            self.operate(operation)
            return ""
        return self.tell_dashboard(line)

    def tell_dashboard(self, line: str) -> str:
        """Have a command of the dashboard server done; return its reply. HandError if it was refused."""
        self._check()
        address = self._robot.address
        reply = ask_dashboard(TcpNetwork(), address.host, address.ports.dashboard, (line,)).get(line)
        if reply is None:
            raise HandError(f"the dashboard server does not answer to {line!r}")
        if any(word in reply.lower() for word in _REFUSALS):
            raise HandError(reply)
        return reply

    def run(self, program: str) -> None:
        """Send a program; what becomes of it the log says."""
        self._check()
        address = self._robot.address
        connection = TcpNetwork().connect(address.host, address.ports.secondary, 2.0)
        connection.send(program.encode("latin-1", "replace") + b"\n")
        connection.close()

    # --- an emulated box

    def operate(self, operation: str, **arguments: Any) -> dict[str, Any]:
        """Have an operation of the control API done."""
        self._check()
        address = self._robot.address
        client = ControlClient(address.host, address.control_port, address.token)
        return client.perform(make(operation, arguments))

    def let_pass(self, seconds: float) -> None:
        """Let time of a box in lockstep pass, which stands still while nothing moves."""
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
        return np.array(follower.goal) if follower is not None and follower.is_alive() else None

    def _check(self) -> None:
        if self._robot.refusal:
            raise HandError(self._robot.refusal)


class Errands:
    """What people have a robot do, in other threads than that of the window, which waits for no robot.

    All but `begin` is called by the window's thread; the end of an errand is an event for it, like others.
    """

    def __init__(self, events: Events) -> None:
        self._events = events
        self._others, self._lane = ThreadPoolExecutor(), ThreadPoolExecutor(1)
        self._waiting: dict[str, Errand] = {}
        self._running: Future[object] | None = None
        self._told: tuple[Any, str] = (None, "")
        self._told_at = 0.0

    def begin(self, client: Any, errand: Errand) -> None:
        """Begin an errand in a thread of its own, whatever else is done, and forget those that wait."""
        self._events.put(self._waiting.clear)
        Thread(target=self._run, args=(client, errand), daemon=True).start()

    def ask(self, client: Any, errand: Errand, kind: str = "") -> None:
        """Have an errand done; `client` is told what the robot says to it.

        Errands with a kind follow each other, and one that waits gives way to a newer one of its kind: the
        last is never lost, nor late. Others wait for none of them.
        """
        if kind:
            self._waiting[kind] = partial(self._run, client, errand)
            self._next()
        else:
            self._others.submit(self._run, client, errand)

    def tell(self, client: Any, title: str, text: str) -> None:
        """Tell somebody once."""
        now, before, self._told = time.monotonic(), self._told, (client, text)
        if client is not None and (before != self._told or now - self._told_at > _AGAIN):
            client.add_notification(title, plain(text), auto_close_seconds=6.0)
        self._told_at = now

    def _next(self) -> None:
        """Begin the errand with a kind that waits longest, if none runs."""
        if self._waiting and (self._running is None or self._running.done()):
            self._running = self._lane.submit(self._waiting.pop(next(iter(self._waiting))))
            self._running.add_done_callback(lambda _: self._events.put(self._next))

    def _run(self, client: Any, errand: Errand) -> None:
        """Do an errand, in a thread of its own."""
        title = "Robot"
        try:
            said = errand()
        except Exception as error:
            title, said = "Not done", str(error) or repr(error)
        if said and isinstance(said, str):
            self._events.put(partial(self.tell, client, title, said))


class Follower(Thread):
    """A program in the box that goes to `goal`, and the stream of its targets.

    It ends when the arm has been at an unchanged goal for `_REST`, and when its program has ended, as by a
    stop. From then on it takes no goal.
    """

    def __init__(self, robot: Robot, run: Callable[[str], None], goal: tuple[float, ...]) -> None:
        """Begin where the arm is. HandError if no program may run now."""
        super().__init__(daemon=True)
        assert robot.info is not None
        self.goal = goal
        self._lock, self._is_ending = Lock(), False
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
            except ClientError:
                _check_rest(robot.values)  # as another window, which writes to the inputs: its program runs
                raise
            failing.pop_all()
        self.start()

    def take(self, goal: tuple[float, ...]) -> bool:
        """Go to another goal; return False if it is too late for one."""
        with self._lock:
            if not self._is_ending:
                self.goal = goal
            return not self._is_ending

    def run(self) -> None:
        """Send the goal until the end."""
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
