"""`urscript run`: run a program on an emulated robot, or on a host that only records its calls."""

import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from types import FrameType
from typing import Annotated, Any, Final, NamedTuple, Self

import typer

from ur_hil.command_line import ExitCode
from urscript.catalogue import Catalogue
from urscript.catalogue.types import Generation, Version
from urscript.check.checking import with_advice
from urscript.check.unused import nothing_runs
from urscript.commands.run_output import JsonOutput, MoveWatch, RunOutput, TextOutput
from urscript.commands.support import AsJson, catalogue_of, read_program, show, shown_name
from urscript.errors import ScriptCompileError
from urscript.program import CompiledProgram, ProgramStatus, compile_program
from urscript.recording_host import RecordedCall, RecordingHost
from urscript.robot import Report, ReportKind, RobotMaker, RunStatus, ScriptRobot, find_makers
from urscript.source import Source
from urscript.syntax.parser import parse

NO_ROBOT: Final = "none"
DEFAULT_SOFTWARE: Final = "3.15"
EXIT_CODES: Final = {
    RunStatus.FINISHED: ExitCode.DONE,
    RunStatus.RUNNING: ExitCode.DONE,
    RunStatus.FAILED: ExitCode.FAILED,
    RunStatus.STOPPED: ExitCode.FAILED,
    RunStatus.INTERRUPTED: ExitCode.INTERRUPTED,
}


def run(
    file: Annotated[Path, typer.Argument(help="Program to run; - reads it.", show_default=False)],
    software: Annotated[
        str | None,
        typer.Option(
            "--software",
            help="Software version of the robot, e.g. 3.15 or 5.11.",
            show_default="that of the arm",
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            help="Arm to run it on, e.g. ur3, or FILE.toml; none only records the calls.",
            show_default="the first that runs the software",
        ),
    ] = None,
    fidelity: Annotated[
        str | None, typer.Option(help="How true the arm is, e.g. ideal.", show_default="typical")
    ] = None,
    seed: Annotated[int, typer.Option(help="Which arm it is: calibration, friction, noise.", min=0)] = 0,
    limit: Annotated[
        float, typer.Option(help="Robot seconds after which to stop a program.", min=0.0)
    ] = 60.0,
    answer: Annotated[
        list[str] | None,
        typer.Option(help="What the operator answers; once for each question.", show_default=False),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show texts of textmsg and errors only.")] = False,
    as_json: AsJson = False,
    trace: Annotated[
        bool, typer.Option("--trace", help="Show each line before it is executed: cycle, thread, line.")
    ] = False,
    trace_lines: Annotated[int, typer.Option(help="Lines after which --trace stops.", min=1)] = 1000,
) -> None:
    """Run a program on an emulated robot, as fast as it goes; exit 1 if it is wrong or fails."""
    if trace and as_json:
        raise typer.BadParameter("--trace shows lines, --json one document: choose one")
    maker, name, usual = _find_robot(robot, software)
    catalogue = catalogue_of(software or usual)
    if maker:
        _check_options(maker, name, usual, fidelity, catalogue)
    source = Source(read_program(file), shown_name(file))
    output: RunOutput = JsonOutput(source, str(file)) if as_json else TextOutput(source, quiet=quiet)
    try:
        program = compile_program(source.text, catalogue=catalogue, name=source.name)
    except ScriptCompileError as error:
        output.compile_error(with_advice(error))
        raise typer.Exit(ExitCode.FAILED) from None
    if warning := nothing_runs(parse(source), source):
        warning.source = source
        output.warning(warning)
    n_lines = trace_lines if trace else 0
    if maker is None:
        status = _run_without_robot(program, catalogue, limit, output, n_lines)
    else:
        made = maker.make(
            name,
            fidelity=fidelity or maker.fidelities[0],
            seed=seed,
            software=catalogue.version,
            answers=answer or (),
        )
        status = _run_on(made, program, limit, output, n_lines)
    if EXIT_CODES[status]:
        raise SystemExit(EXIT_CODES[status])  # all that is to be said stands in the output


def _find_robot(name: str | None, software: str | None) -> tuple[RobotMaker | None, str, str]:
    """The maker of the robot of that name or file, the name, and its usual software; None for no robot.

    Without a name it is the first robot whose generation runs the software.
    """
    makers = find_makers()
    if name == NO_ROBOT or (name is None and not makers):
        return None, NO_ROBOT, DEFAULT_SOFTWARE
    if name is not None and name.endswith(".toml") and makers:
        try:
            return makers[0], name, makers[0].software_of(name)
        except ValueError as error:
            raise typer.BadParameter(str(error), param_hint="--robot") from None
    robots = {robot: maker for maker in reversed(makers) for robot in maker.robots}
    if name is not None:
        maker = robots.get(name.lower())
        if maker is None:
            known = ", ".join([*(robot for maker in makers for robot in maker.robots), NO_ROBOT])
            raise typer.BadParameter(
                f"no robot {name!r} is installed; there are {known}", param_hint="--robot"
            )
        return maker, name.lower(), maker.robots[name.lower()]
    for maker in makers:
        for robot, usual in maker.robots.items():
            if software is None or _runs(usual, catalogue_of(software)):
                return maker, robot, usual
    return makers[0], *next(iter(makers[0].robots.items()))


def _runs(usual: str, catalogue: Catalogue) -> bool:
    """Whether a robot that usually runs the software `usual` can run another; PolyScope X is for e-Series."""
    of_e_series = {Generation.E_SERIES, Generation.POLYSCOPE_X}
    generations = {Version.of(usual).generation, catalogue.version.generation}
    return len(generations) == 1 or generations == of_e_series


def _check_options(
    maker: RobotMaker, name: str, usual: str, fidelity: str | None, catalogue: Catalogue
) -> None:
    if fidelity is not None and fidelity not in maker.fidelities:
        known = ", ".join(maker.fidelities)
        raise typer.BadParameter(f"no fidelity {fidelity!r}; there are {known}", param_hint="--fidelity")
    given = catalogue.version
    if not _runs(usual, catalogue):
        raise typer.BadParameter(
            f"software {given} is of {given.generation.value}, which {name} does not run; "
            f"give software such as {usual}, or another robot",
            param_hint="--software",
        )


def _run_on(
    robot: ScriptRobot, program: CompiledProgram, limit: float, output: RunOutput, trace_lines: int
) -> RunStatus:
    watch = MoveWatch(program, robot.step_time, lambda: robot.time, output.move)

    def report(report: Report) -> None:
        watch.flush(all_streams=False)
        output.report(report)

    with _tracer(program, lambda: round(robot.time / robot.step_time), trace_lines):
        end = robot.run(watch.program, limit, report)
    watch.flush()
    output.end(end.status, end.robot_time, robot.title, end)
    return end.status


def _run_without_robot(
    program: CompiledProgram, catalogue: Catalogue, limit: float, output: RunOutput, trace_lines: int
) -> RunStatus:
    def seconds() -> float:
        return host.cycle * host.step_time

    def report_call(call: RecordedCall) -> None:
        output.call(seconds(), call.thread, call.name, call.arguments)

    def report_text(text: str) -> None:
        output.report(Report(seconds(), ReportKind.TEXT, text))

    host = RecordingHost(catalogue=catalogue, on_message=report_text, on_call=report_call)
    status = RunStatus.FINISHED
    try:
        with _tracer(program, lambda: host.cycle, trace_lines):
            running = host.run(program, max_cycles=int(min(limit / host.step_time, 1e15)))
    except KeyboardInterrupt:
        status = RunStatus.INTERRUPTED
    else:
        if running.error is not None:
            status = RunStatus.FAILED
            error = running.error
            failure = Report(seconds(), ReportKind.FAILURE, error.message, error.line, error.column)
            output.report(failure)
        elif running.status is ProgramStatus.RUNNING:
            status = RunStatus.RUNNING
            running.kill()
    output.end(status, seconds(), "no robot", None)
    return status


def _tracer(program: CompiledProgram, cycle: Callable[[], int], limit: int) -> AbstractContextManager[Any]:
    """Prints up to `limit` lines while they are executed; none for 0."""
    if not limit:
        return nullcontext()

    def show_line(traced: TracedLine) -> None:
        show(f"{cycle():6d}  {traced.thread}:{traced.line}: {traced.text}")

    def stop() -> None:
        show(f"trace stops after {limit} lines (--trace-lines)", error=True)

    return LineTracer(program, show_line, stop, limit)


# --- --trace: line by line what a program executes ------------------------------------------------------
#
# Compiled programs carry the lines of their script, so Python's own tracing shows them; without it nothing is
# slower. One tracer a process at a time.


class TracedLine(NamedTuple):
    """A line about to be executed: name of the thread, number from 1, text without surrounding spaces."""

    thread: str
    line: int
    text: str


class LineTracer:
    """While its `with` block lasts, reports every line of `program` before it is executed.

    A line with two statements is reported once, the head of a loop once a round, that of a function once a
    call. After `limit` lines it calls `on_limit` and is silent: an endless loop would fill any disk.
    """

    def __init__(
        self,
        program: CompiledProgram,
        on_line: Callable[[TracedLine], None],
        on_limit: Callable[[], None],
        limit: int,
    ) -> None:
        self._program = program
        self._on_line = on_line
        self._on_limit = on_limit
        self._left = limit
        self._earlier: Any = None
        self._last: tuple[int, int] | None = None

    def __enter__(self) -> Self:
        self._earlier = sys.gettrace()
        sys.settrace(self._enter_frame)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(self._earlier)

    def _enter_frame(self, frame: FrameType, event: str, argument: Any) -> Any:
        """Called by Python for every frame that is entered or resumed: only the script's are followed."""
        if frame.f_code.co_filename != self._program.compiled.file_name:
            return None
        self._last = None
        return self._line

    def _line(self, frame: FrameType, event: str, argument: Any) -> Any:
        # The module itself only defines the functions.
        if event != "line" or frame.f_code.co_name == "<module>":
            return self._line
        # The code of one line comes in pieces.
        place = id(frame), frame.f_lineno
        if place == self._last:
            return self._line
        self._last = place
        if self._left <= 0:
            self._on_limit()
            sys.settrace(self._earlier)
            return None
        self._left -= 1
        text = self._program.source.line(frame.f_lineno).strip()
        self._on_line(TracedLine(frame.f_globals["_T"].name, frame.f_lineno, text))
        return self._line
