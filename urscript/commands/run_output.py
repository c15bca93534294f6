"""Output of `urscript run`: lines while the program runs, or one JSON document after it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from math import degrees
from typing import Any, Final

from urscript.catalogue import TimeClass
from urscript.commands.support import diagnostic_of, echo_json, show
from urscript.errors import ScriptError, ScriptRuntimeError
from urscript.program import CompiledProgram, RunningProgram
from urscript.robot import Report, ReportKind, RunEnd, RunStatus
from urscript.run.host import Host, HostFunction
from urscript.run.metering import WorkBudget
from urscript.run.threads import ScriptThread
from urscript.run.waits import Wait
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


class TextOutput:
    """Prints lines at once: what the program does to standard output, errors and the result to the other.

    `quiet`: texts of textmsg and errors only.
    """

    def __init__(self, source: Source, *, quiet: bool) -> None:
        self._source = source
        self._quiet = quiet

    def compile_error(self, error: ScriptError) -> None:
        """Print the error of a program that does not compile, or a warning about one, with its place."""
        show(error.render(), error=True)

    warning = compile_error

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
        """Print the target and duration of a move that has ended."""
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
        """Print the call of a builtin that has an effect, on the recording host."""
        if not self._quiet:
            show(f"{time:9.3f} s  {thread}: {name}({', '.join(map(_argument, arguments))})")

    def end(self, status: RunStatus, robot_time: float, robot: str, run: RunEnd | None) -> None:
        """Print the final position of the arm, if there was one, and the times; `robot` is its title."""
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
        self._source = source
        self._file = file
        self._events: list[dict[str, Any]] = []
        self._errors: list[ScriptError] = []

    def compile_error(self, error: ScriptError) -> None:
        """Keep the error; there is no run."""
        self._errors.append(error)
        self._print("failed", None, "", None)

    def warning(self, warning: ScriptError) -> None:
        """Keep it."""
        self._errors.append(warning)

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
            diagnostics=[diagnostic_of(error, self._file) for error in self._errors],
        )


RunOutput = TextOutput | JsonOutput
"""Receives the events of a run."""


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


# --- moves: start, arguments, duration ------------------------------------------------------------------
#
# The program runs on a host whose motion builtins are wrapped; everything else runs at its usual speed.

_STREAMS: Final = frozenset({"speedj", "speedl", "servoj", "servoc"})
"""Builtins that are called again every few cycles: consecutive calls are one move."""


@dataclass(slots=True)
class WatchedMove:
    """A move, or a stream of calls.

    Attributes:
        arguments: By parameter, of the last call.
        line: Of its first call, from 1.
        start: Seconds of robot time at which it began.
        end: Seconds at which its instruction ended.
        calls: How many calls it is.
        completed: False when something ended it before it was done.
        in_main: The thread is the body of the program.
    """

    name: str
    arguments: dict[str, Any]
    thread: str
    line: int
    start: float
    end: float
    calls: int = 1
    completed: bool = True
    in_main: bool = True

    @property
    def duration(self) -> float:
        """Seconds from its start to its end."""
        return self.end - self.start


class MoveWatch:
    """Watches one run of a program.

    Args:
        program: The compiled program.
        step_time: Length of a cycle [s].
        clock: Returns the robot time [s].
        on_move: Called with each move that has ended.

    Attributes:
        program: Run this instead of the one that was given.
    """

    def __init__(
        self,
        program: CompiledProgram,
        step_time: float,
        clock: Callable[[], float],
        on_move: Callable[[WatchedMove], None],
    ) -> None:
        inherited = {item.name: getattr(program, item.name) for item in fields(program)}
        self.program: CompiledProgram = _WatchedProgram(**inherited, watch=self)
        self._clock = clock
        self._gap = 1.5 * step_time
        self._on_move = on_move
        self._streams: dict[ScriptThread, WatchedMove] = {}

    def flush(self, *, all_streams: bool = True) -> None:
        """Report the streams that have ended, or all of them."""
        for thread, stream in list(self._streams.items()):
            if all_streams or self._clock() - stream.end > self._gap:
                del self._streams[thread]
                self._on_move(stream)

    def function(self, name: str, function: HostFunction) -> HostFunction:
        """`function`, watched, if the builtin of that name moves the arm."""
        builtin = self.program.catalogue.lookup(name)
        if builtin is None or builtin.time is not TimeClass.MOTION:
            return function
        return partial(self._move, name, [parameter.name for parameter in builtin.params], function)

    def _move(
        self, name: str, parameters: list[str], function: HostFunction, thread: ScriptThread, *values: Any
    ) -> Generator[Wait, None, Any]:
        # The generator is first resumed by the frame of the script that calls the builtin.
        line = sys._getframe(1).f_lineno
        start = self._clock()
        arguments = dict(zip(parameters, values, strict=False))
        move = WatchedMove(
            name, arguments, thread.name, line, start, start, completed=False, in_main=thread.parent is None
        )
        try:
            result = yield from function(thread, *values)
            move.completed = True
        finally:
            move.end = self._clock()
            self._ended(thread, move)
        return result

    def _ended(self, thread: ScriptThread, move: WatchedMove) -> None:
        earlier = self._streams.pop(thread, None)
        if earlier is not None and earlier.name == move.name and move.start - earlier.end < self._gap:
            move.line, move.start, move.calls = earlier.line, earlier.start, earlier.calls + 1
        elif earlier is not None:
            self._on_move(earlier)
        if move.name in _STREAMS and move.completed:
            self._streams[thread] = move
        elif move.completed or move.duration > 0:
            self._on_move(move)


@dataclass(frozen=True, slots=True)
class _WatchedProgram(CompiledProgram):
    watch: MoveWatch

    def start(self, host: Host, work: WorkBudget | None = None) -> RunningProgram:
        return RunningProgram(self, _WatchedHost(host, self.watch), work)


class _WatchedHost:
    def __init__(self, host: Host, watch: MoveWatch) -> None:
        self.step_time = host.step_time
        self.textmsg = host.textmsg
        self.thread_ended = host.thread_ended
        self.program_ended = host.program_ended
        self._builtins = {name: watch.function(name, f) for name, f in host.builtins().items()}

    def builtins(self) -> Mapping[str, HostFunction]:
        return self._builtins
