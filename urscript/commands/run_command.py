"""`urscript run`: run a program on an emulated robot, or on a host that only records its calls."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Annotated, Any, Final

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

    with _tracing(program, lambda: round(robot.time / robot.step_time), trace_lines):
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
        with _tracing(program, lambda: host.cycle, trace_lines):
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


@contextmanager
def _tracing(program: CompiledProgram, cycle: Callable[[], int], limit: int) -> Iterator[None]:
    """Show every line of `program` before it is executed, `limit` of them, or an endless loop fills the disk.

    A line with two statements is shown once, the head of a loop once a round, that of a function once a call.
    Compiled programs carry the lines of their script, so Python's own tracing shows them; without it nothing
    is slower. One tracer a process at a time.
    """
    earlier: Any = sys.gettrace()
    last: tuple[int, int] | None = None
    n_shown = 0

    def enter_frame(frame: FrameType, event: str, argument: Any) -> Any:
        # Called by Python for every frame that is entered or resumed: only the script's are followed.
        nonlocal last
        last = None
        return show_line if frame.f_code.co_filename == program.compiled.file_name else None

    def show_line(frame: FrameType, event: str, argument: Any) -> Any:
        nonlocal last, n_shown
        place = id(frame), frame.f_lineno
        # The module itself only defines the functions. The code of one line comes in pieces.
        if event != "line" or frame.f_code.co_name == "<module>" or place == last:
            return show_line
        last = place
        if n_shown == limit:
            show(f"trace stops after {limit} lines (--trace-lines)", error=True)
            sys.settrace(earlier)
            frame.f_trace = None
            return None
        n_shown += 1
        text = program.source.line(frame.f_lineno).strip()
        show(f"{cycle():6d}  {frame.f_globals['_T'].name}:{frame.f_lineno}: {text}")
        return show_line

    if limit:
        sys.settrace(enter_frame)
    try:
        yield
    finally:
        sys.settrace(earlier)
