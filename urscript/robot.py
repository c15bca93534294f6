"""What `urscript run` needs of a robot, and how it finds the robots that are installed.

The language knows no robot. A package that has one announces a `RobotMaker` as an entry point of the group
`urscript.robots`; nothing of it is imported before a program is to run on it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

if TYPE_CHECKING:
    from urscript.program import CompiledProgram

GROUP: Final = "urscript.robots"


class ReportKind(Enum):
    """What a robot has to say while a program runs."""

    TEXT = "text"
    POPUP = "popup"
    QUESTION = "question"
    CODE = "code"
    FAILURE = "failure"
    NOTICE = "notice"


class Report(NamedTuple):
    """Something a robot said.

    Attributes:
        time: Seconds of robot time since the program began.
        kind: TEXT of textmsg, a POPUP or QUESTION to the operator, a CODE of the controller such as C204A3,
            the FAILURE of the program, a NOTICE of the robot to whoever watches.
        text: One line.
        line: Line of the program it is about, from 1; 0 if it is about none.
        column: Column there, from 1.
    """

    time: float
    kind: ReportKind
    text: str
    line: int = 0
    column: int = 0


class RunStatus(Enum):
    """How a run ended."""

    FINISHED = "finished"
    FAILED = "failed"
    STOPPED = "stopped"
    RUNNING = "running"
    INTERRUPTED = "interrupted"


class RunEnd(NamedTuple):
    """What a run has come to, the arm at rest.

    Attributes:
        status: The program FINISHED or FAILED, a protective stop STOPPED it, it was still RUNNING at the
            limit, or somebody pressed Ctrl-C.
        robot_time: Seconds of robot time from the start to the end of the program.
        real_time: Seconds it took.
        joints: Measured joint angles (rad), (6,).
        tcp_pose: Measured pose of the tool centre point in the base frame (m, rad), (6,).
    """

    status: RunStatus
    robot_time: float
    real_time: float
    joints: Sequence[float]
    tcp_pose: Sequence[float]


class ScriptRobot(Protocol):
    """A robot to try a program on: its time runs as fast as it can, and stands still between runs."""

    title: str
    """One line: which robot it is."""

    step_time: float
    """Length of a control cycle (s)."""

    @property
    def time(self) -> float:
        """Seconds of robot time since the program began."""
        ...

    def run(self, program: CompiledProgram, limit: float, report: Callable[[Report], None]) -> RunEnd:
        """Run `program` to its end and the arm to rest, for `limit` seconds of robot time at most.

        Ctrl-C ends the run; what `report` raises goes through.
        """
        ...


class RobotMaker(Protocol):
    """Makes robots: the object that an entry point names."""

    names: Sequence[str]
    """The robots it knows, the usual one first."""

    fidelities: Sequence[str]
    """How true they can be made, by name, the usual one first."""

    def make(
        self, name: str, *, fidelity: str, seed: int, software: Sequence[int], answers: Sequence[str]
    ) -> ScriptRobot:
        """A robot at rest, ready to move.

        Args:
            name: One of `names`.
            fidelity: One of `fidelities`.
            seed: Of everything random in it.
            software: The version it runs, e.g. (3, 15).
            answers: What the operator answers to the questions of the program, in order.
        """
        ...


def find_makers() -> list[RobotMaker]:
    """The makers of all installed robots."""
    return [entry.load() for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name)]
