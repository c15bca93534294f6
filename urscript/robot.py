"""The interface of robots for `urscript run`, and the search for installed ones.

The language knows no robot. A package that has one declares a `RobotMaker` as an entry point of the group
`urscript.robots`; it is imported when a program is to run on it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

if TYPE_CHECKING:
    from urscript.program import CompiledProgram

GROUP: Final = "urscript.robots"


class ReportKind(Enum):
    """What a robot reports while a program runs."""

    TEXT = "text"
    POPUP = "popup"
    QUESTION = "question"
    CODE = "code"
    FAILURE = "failure"
    NOTICE = "notice"


class Report(NamedTuple):
    """One report of a robot.

    Attributes:
        time: Seconds of robot time since the program began.
        kind: TEXT of textmsg, a POPUP or QUESTION to the operator, a CODE of the controller such as C204A3,
            the FAILURE of the program, or another NOTICE.
        text: One line.
        line: Line of the program that it concerns, from 1; 0 for none.
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
    """The result of a run, the arm at rest.

    Attributes:
        status: The program FINISHED or FAILED, a protective stop STOPPED it, it was still RUNNING at the
            limit, or Ctrl-C INTERRUPTED it.
        robot_time: Seconds of robot time from the start to the end of the program.
        real_time: Seconds that the run took.
        joints: Measured joint angles (rad), (6,).
        tcp_pose: Measured pose of the tool centre point in the base frame (m, rad), (6,).
    """

    status: RunStatus
    robot_time: float
    real_time: float
    joints: Sequence[float]
    tcp_pose: Sequence[float]


class ScriptRobot(Protocol):
    """A robot on which a program runs; its time advances as fast as possible, and only during runs."""

    title: str
    """One line: which robot it is."""

    step_time: float
    """Length of a control cycle (s)."""

    @property
    def time(self) -> float:
        """Seconds of robot time since the program began."""
        ...

    def run(self, program: CompiledProgram, limit: float, report: Callable[[Report], None]) -> RunEnd:
        """Run `program` to its end, then until the arm is at rest, for at most `limit` seconds of robot time.

        Ctrl-C ends the run; exceptions of `report` are not caught.
        """
        ...


class RobotMaker(Protocol):
    """Makes robots; an entry point names an object of this type."""

    robots: Mapping[str, str]
    """Names of the robots, the default first, each with the software that it runs if none is named."""

    fidelities: Sequence[str]
    """Names of the levels of fidelity, the default first."""

    def software_of(self, file: str) -> str:
        """The software that the robot of a file runs if none is named; a file ends in .toml.

        Raises:
            ValueError: The file is wrong; one line says how.
        """
        ...

    def make(
        self, name: str, *, fidelity: str, seed: int, software: Sequence[int], answers: Sequence[str]
    ) -> ScriptRobot:
        """A robot at rest, ready to move.

        Args:
            name: One of `robots`, or a file that `software_of` has read.
            fidelity: One of `fidelities`.
            software: Software version of the generation of that robot, e.g. (3, 15).
            answers: Answers of the operator to the questions of the program, in order.
        """
        ...


def find_makers() -> list[RobotMaker]:
    """The makers of all installed robots."""
    return [entry.load() for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name)]
