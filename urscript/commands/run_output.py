"""Output of `urscript run`: lines while the program runs, or one JSON document after it."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from typing import Any, Protocol

from urscript.commands.move_watch import WatchedMove
from urscript.commands.support import echo_json, show
from urscript.diagnostics import diagnostic_of
from urscript.errors import ScriptError, ScriptRuntimeError
from urscript.robot import Report, ReportKind, RunEnd, RunStatus
from urscript.source import Source, as_utf8
from urscript.values import Matrix, Pose, str_form

TARGETS = ("q", "pose", "pose_to", "qd", "xd")
"""Parameters of moves that give the target position or speed, in order of preference."""

LAST_LINES = {
    RunStatus.FINISHED: "finished after {robot:g} s of robot time",
    RunStatus.FAILED: "failed after {robot:g} s of robot time",
    RunStatus.STOPPED: "stopped by the robot after {robot:g} s of robot time",
    RunStatus.RUNNING: "stopped: still running after {robot:g} s of robot time (--limit)",
    RunStatus.INTERRUPTED: "interrupted after {robot:g} s of robot time",
}
"""The last line, by how the run ended."""


class RunOutput(Protocol):
    """Receives the events of a run."""

    def compile_error(self, error: ScriptError) -> None:
        """The program does not compile."""
        ...

    def report(self, report: Report) -> None:
        """The robot reported something."""
        ...

    def move(self, move: WatchedMove) -> None:
        """A move has ended."""
        ...

    def call(self, time: float, thread: str, name: str, arguments: Sequence[Any]) -> None:
        """A builtin with an effect was called on the recording host."""
        ...

    def end(self, status: RunStatus, robot_time: float, robot: str, run: RunEnd | None) -> None:
        """The run has ended; `robot` is its title, `run` its final state if there was one."""
        ...


class TextOutput:
    """Prints lines at once: what the program does to standard output, errors and the result to the other."""

    def __init__(self, source: Source, *, quiet: bool) -> None:
        """Print what a program reports.

        Args:
            source: the program.
            quiet: print texts of textmsg and errors only.
        """
        self._source = source
        self._quiet = quiet

    def compile_error(self, error: ScriptError) -> None:
        """Print the error with its place."""
        show(error.render(), error=True)

    def report(self, report: Report) -> None:
        """Print a text unchanged, errors with their place, everything else with its time."""
        kind, text = report.kind, report.text
        if kind is ReportKind.TEXT:
            show(text)
        elif kind is ReportKind.FAILURE:
            show(_located(ScriptRuntimeError(text), self._source, report).render(), error=True)
        elif kind is ReportKind.CODE:
            show(_located(_RobotError(text), self._source, report).render(), error=True)
        elif kind is ReportKind.NOTICE:
            place = f" (line {report.line})" if report.line else ""
            show(f"{report.time:9.3f} s  {text}{place}", error=True)
        elif not self._quiet:
            show(f"{report.time:9.3f} s  {kind.value} {text}")

    def move(self, move: WatchedMove) -> None:
        """Print its target and duration."""
        if self._quiet:
            return
        goal = next((move.arguments[name] for name in TARGETS if name in move.arguments), None)
        where = f" {_rounded(goal)}" if goal is not None else ""
        calls = f" in {move.calls} calls" if move.calls > 1 else ""
        broken = "" if move.completed else ", interrupted"
        thread = f" ({move.thread})" if not move.in_main else ""
        what = f"line {move.line}{thread}: {move.name}{where}, {move.duration:g} s{calls}{broken}"
        show(f"{move.start:9.3f} s  {what}")

    def call(self, time: float, thread: str, name: str, arguments: Sequence[Any]) -> None:
        """Print the call."""
        if not self._quiet:
            show(f"{time:9.3f} s  {thread}: {name}({', '.join(map(_argument, arguments))})")

    def end(self, status: RunStatus, robot_time: float, robot: str, run: RunEnd | None) -> None:
        """Print the position of the arm, and the times."""
        if run is not None and not self._quiet:
            joints = ", ".join(f"{_decimal(degrees(angle), 2)}" for angle in run.joints)
            show(f"joints {_rounded(list(run.joints))} rad, [{joints}] deg")
            show(f"TCP    {_rounded(Pose.of(run.tcp_pose))} m, rad")
        # The error of a failed program is printed already.
        if status is RunStatus.RUNNING or status is RunStatus.INTERRUPTED or not self._quiet:
            last = LAST_LINES[status].format(robot=round(robot_time, 3))
            real = f", {run.real_time:.1f} s of real time" if run is not None else ""
            show(f"{last}{real} ({robot})", error=True)


class JsonOutput:
    """Collects everything and prints it at the end, as one JSON document."""

    def __init__(self, source: Source, file: str) -> None:
        """Collect what a program reports.

        Args:
            source: the program.
            file: name of its file.
        """
        self._source = source
        self._file = file
        self._events: list[dict[str, Any]] = []
        self._errors: list[ScriptError] = []

    def compile_error(self, error: ScriptError) -> None:
        """Keep the error; there is no run."""
        self._errors.append(error)
        self._print("failed", None, "", None)

    def report(self, report: Report) -> None:
        """Keep it; the failure of the program is a diagnostic too."""
        if report.kind is ReportKind.FAILURE:
            self._errors.append(_located(ScriptRuntimeError(report.text), self._source, report))
        text = as_utf8(report.text)
        self._add(report.kind.value, report.time, report.line, column=report.column or None, text=text)

    def move(self, move: WatchedMove) -> None:
        """Keep it."""
        self._add(
            "move",
            move.start,
            move.line,
            name=move.name,
            thread=move.thread,
            arguments={name: _json_value(value) for name, value in move.arguments.items()},
            duration=round(move.duration, 6),
            calls=move.calls,
            completed=move.completed,
        )

    def call(self, time: float, thread: str, name: str, arguments: Sequence[Any]) -> None:
        """Keep it."""
        self._add("call", time, 0, name=name, thread=thread, arguments=list(map(_json_value, arguments)))

    def end(self, status: RunStatus, robot_time: float, robot: str, run: RunEnd | None) -> None:
        """Print the document."""
        self._print(status.value, round(robot_time, 6), robot, run)

    def _add(self, kind: str, time: float, line: int, **more: Any) -> None:
        self._events.append({"kind": kind, "time": round(time, 6), "line": line or None, **more})

    def _print(self, status: str, robot_time: float | None, robot: str, run: RunEnd | None) -> None:
        echo_json(
            file=self._file,
            robot=robot,
            status=status,
            robot_time=robot_time,
            real_time=run and round(run.real_time, 3),
            joints=run and list(run.joints),
            tcp_pose=run and list(run.tcp_pose),
            events=self._events,
            diagnostics=[diagnostic_of(error, self._file)._asdict() for error in self._errors],
        )


class _RobotError(ScriptError):
    """An error that the controller reports with a code."""

    kind = "Robot"


def _located(error: ScriptError, source: Source, report: Report) -> ScriptError:
    return error.locate(source, report.line, report.column) if report.line else error


def _argument(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else str_form(value)


def _rounded(value: Any) -> str:
    """A target with four decimals at most."""
    if isinstance(value, (list, Pose)) and all(isinstance(item, (int, float)) for item in value):
        items = ", ".join(_decimal(item, 4) for item in value)
        return f"p[{items}]" if isinstance(value, Pose) else f"[{items}]"
    return _argument(value)


def _decimal(value: float, decimals: int) -> str:
    """A rounded number without trailing zeros and without a negative zero."""
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _json_value(value: Any) -> Any:
    if isinstance(value, (list, Pose)):
        return [_json_value(item) for item in value]
    if isinstance(value, Matrix):
        return [list(row) for row in value.rows]
    if isinstance(value, str):
        return as_utf8(value)
    return value if isinstance(value, (bool, int, float, type(None))) else str(value)
