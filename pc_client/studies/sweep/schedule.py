"""The cases of a sweep: batch by batch, in turn or side by side, each from its content to its figures.

`Sweep` knows which cases are left, `in_turn` and `side_by_side` run them, and `run_case` is the job that
workers do. Whatever goes wrong in a case is part of its outcome: a sweep is not ended by one case.

A case may have a simulated arm of its own: `ur-emulator serve` as a process, in lockstep, on free ports. Only
the command line is used: the client never imports the box. The process hangs on a guard (`guard.py`) that
ends it together with whoever started it.
"""

from __future__ import annotations

import logging
import os
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, as_completed
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from pc_client.analysis.run import analyse_run
from pc_client.driver.session import UrDriver
from pc_client.driver.watchdog import require
from pc_client.errors import LOG, ClientError, GainMarginError, SweepError, full_message
from pc_client.experiment.excitation import Identification
from pc_client.experiment.experiment import Experiment
from pc_client.experiment.preflight import preflight
from pc_client.experiment.run import ExperimentRunner
from pc_client.kinematics.model import robot_model
from pc_client.movements.library_sets import library_name_of
from pc_client.movements.movement import load_movement
from pc_client.planning.plan import Plan, make_plan
from pc_client.recording.recording import load_recording
from pc_client.results.tables import finite
from pc_client.studies.executors import open_executor, usable_cores
from pc_client.studies.sweep.case import (
    FIGURES,
    Case,
    GivenRobot,
    MovementFile,
    Outcome,
    Row,
    SimulatedArm,
    all_cases,
    failed,
)
from pc_client.studies.sweep.guard import ENDED_FILE
from protocol.errors import ProtocolError
from protocol.ur_types import Ports
from ur_hil.cell import NO_CELL, Cell

if TYPE_CHECKING:
    from pc_client.studies.sweep.settings import SweepConfig
    from pc_client.studies.sweep.store import ResultStore


_Job = Callable[[Case], Outcome]
"""Does one case."""

_Runner = Callable[[Sequence[Case]], Iterator[tuple[Case, Outcome]]]
"""Does cases; outcomes come as they get ready, in any order."""


class Sweep:
    """All cases of a sweep, batch by batch.

    Attributes:
        waiting: cases of the first batch that is not settled; empty: nothing is left to run.
    """

    def __init__(
        self, config: SweepConfig, arms: Sequence[SimulatedArm] | Sequence[GivenRobot], store: ResultStore
    ) -> None:
        self._store = store
        self._cases: list[Case] = []
        self._batches = (
            all_cases(config.movements, arms, controllers, config.file.repeat)
            for controllers in config.batches(lambda: store.table(self._cases))
        )
        self._advance()

    def run(self, run: _Runner) -> Generator[Outcome, None, None]:
        """Run and settle what is not settled.

        The first failure of a robot that is there ends the sweep: somebody has to look at the arm before it
        moves again.

        Yields:
            Each outcome, when it is on disk.

        Raises:
            SweepError: the folder cannot be written.
        """
        while self.waiting:
            for case, outcome in run(self.waiting):
                self._store.settle(case, outcome)
                yield outcome
                if outcome.status == "failed" and isinstance(case.arm, GivenRobot):
                    return
            self._advance()

    def _advance(self) -> None:
        """Go on to the next batch that has cases to run. A search makes it from the results of the last."""
        for cases in self._batches:
            self._cases = cases
            self.waiting = self._store.waiting(cases)
            if self.waiting:
                return
        self.waiting = []


def in_turn(job: _Job) -> _Runner:
    """One case after the other in this process, as one robot must."""
    return lambda cases: ((case, job(case)) for case in cases)


@contextmanager
def side_by_side(job: _Job, *, workers: int | None, dask: str | None) -> Iterator[_Runner]:
    """Cases over processes of this machine or a Dask cluster, which are started with the first case.

    When a worker process dies (out of memory, killed), the others are lost with it. The cases that may have
    killed it, the first ones that got no outcome, are then run alone: one that kills its worker again has
    failed, the others go on. The job must be picklable and raise nothing for errors of the case.
    """
    # The pool hands a job more than it has workers to its queue.
    n_begun = 1 + (usable_cores() if workers is None else workers)
    executor: Executor | None = None

    def run(cases: Sequence[Case]) -> Iterator[tuple[Case, Outcome]]:
        nonlocal executor
        waiting = list(cases)
        while waiting:
            if executor is None:
                executor = opened.enter_context(open_executor(workers, dask))
            lost = yield from _round(executor, waiting, job)
            if lost:
                opened.close()
                executor = None
            suspects, waiting = lost[:n_begun], lost[n_begun:]
            for case in suspects:
                with open_executor(1) as alone:
                    dies_again = yield from _round(alone, [case], job)
                if dies_again:
                    why = "the worker process died, also when the case ran alone: is memory short?"
                    yield case, failed(why)

    with ExitStack() as opened:
        yield run


def _round(
    executor: Executor, cases: Sequence[Case], job: _Job
) -> Generator[tuple[Case, Outcome], None, list[Case]]:
    """Run cases; returns those that were lost with a worker process, in order."""
    lost: set[str] = set()
    futures: dict[Future[Outcome], Case] = {}
    with suppress(BrokenExecutor):  # died while we were still handing out: the rest counts as lost
        for case in cases:
            futures[executor.submit(job, case)] = case
    lost.update(case.identity for case in cases[len(futures) :])
    for future in as_completed(list(futures)):
        case = futures.pop(future)  # with its recordings, which may be large
        try:
            outcome = future.result()
        except BrokenExecutor:
            lost.add(case.identity)
            continue
        except Exception as error:
            outcome = failed(f"{type(error).__name__}: {error}")
        yield case, outcome
    return [case for case in cases if case.identity in lost]


def run_case(case: Case, keep_recordings: bool) -> Outcome:
    """Do one case; with `keep_recordings` the recordings are part of the answer.

    Errors of robot, plan or disk are in the outcome, and the recordings of a case that failed.
    """
    incident: tuple[tuple[str, bytes], ...] = ()
    level = LOG.level
    LOG.setLevel(logging.ERROR)  # of hundreds of cases the table shows what warnings are about
    try:
        with _robot_of(case.arm) as (host, ports, reverse_port, folder):
            experiment = plan_case(case, folder / "recordings")
            try:
                with UrDriver(host, ports, reverse_port=reverse_port) as driver:
                    if isinstance(case.arm, GivenRobot):
                        driver.info.check_same(experiment.model.title, case.arm.serial)
                    require(preflight(driver.report(), experiment.model))
                    report = ExperimentRunner(driver, experiment, case.controller).run()
                rows = tuple(_row(path, report.delay) for path in report.paths)
            except (ClientError, ProtocolError, OSError) as error:
                incident = _contents(experiment.out.glob("*.mcap"))
                notes = getattr(error, "__notes__", ())  # of a folder that will be gone
                error.__notes__ = [note.replace(str(experiment.out), case.incidents) for note in notes]
                raise
            return Outcome("done", rows=rows, recordings=_contents(report.paths) if keep_recordings else ())
    except GainMarginError as error:
        row = {"delay_ms": 1e3 * error.delay, "gain_margin": error.margin}
        return Outcome("refused", full_message(error), (row,))
    except (ClientError, ProtocolError, OSError) as error:
        return failed(full_message(error), incident)
    finally:
        LOG.setLevel(level)


def plan_case(case: Case, out: Path = Path()) -> Experiment:
    """The experiment of a case, checked and planned; its recordings go to a folder.

    Raises:
        PlanningError: the arm cannot do the movement.
        MovementError: the movement makes no sense.
    """
    cell = NO_CELL if isinstance(case.arm, SimulatedArm) else case.arm.cell
    planned = _planned(case.movement, case.arm.robot, cell)
    # A model of its own: it carries scratch data, and workers of a cluster may be threads.
    return Experiment(robot_model(case.arm.robot, cell), (planned,), case.repeat, out)


@lru_cache(maxsize=64)
def _planned(movement: MovementFile, robot: str, cell: Cell) -> Plan:
    """Plan a movement, once for all cases of this worker; a plan is never changed."""
    with tempfile.TemporaryDirectory(prefix="ur-sweep-") as folder:
        path = Path(folder) / movement.file_name
        path.write_text(movement.text, encoding="utf-8")
        loaded = load_movement(library_name_of(movement.text) or path)
    return make_plan(loaded, robot_model(robot, cell))


@contextmanager
def _robot_of(arm: SimulatedArm | GivenRobot) -> Iterator[tuple[str, Ports, int | None, Path]]:
    """Host, ports and reverse port of a robot, a simulated one just started, and a scratch folder."""
    if isinstance(arm, SimulatedArm):
        with simulated_box(arm) as box:
            yield box.host, box.ports, 0, box.folder
    else:
        with tempfile.TemporaryDirectory(prefix="ur-sweep-") as folder:
            yield arm.host, Ports.standard(arm.port_base), arm.reverse_port, Path(folder)


def _row(path: Path, found: Identification) -> Row:
    """The figures of a recording, and of the loop that was identified before.

    Infinity (no error at all, no feedback) becomes None: tables do not agree on how to write it.

    Raises:
        RecordingError: the recording cannot be judged.
    """
    run = analyse_run(load_recording(path))
    measured = {**run.figures, **run.recording.summary}  # the summary has late and lost frames
    loop = {"delay_ms": 1e3 * found.delay, "gain_margin": found.margins.gain}
    row: Row = finite(
        {column.name: measured[column.name] for column in FIGURES if column.name in measured} | loop
    )
    return row


def _contents(paths: Iterable[Path]) -> tuple[tuple[str, bytes], ...]:
    return tuple((path.name, path.read_bytes()) for path in paths)


HOST = "127.0.0.1"

_START_TIMEOUT = 60.0
"""A box is ready after about a second [s]; a machine that is busy may take its time."""

_NOTICE = 0.5
"""The end of a box is noted within this [s] after it broke off."""

_ATTEMPTS = 5
"""Another program may take a port between our look and the box's start."""

# All ports of a box between 10000 and 29600: above those of common services, below those that kernels give
# to clients, where they would be taken and freed while we look.
_OFFSETS = range(-19_980, -400, 20)


@dataclass(frozen=True, slots=True)
class SimulatedBox:
    """A box that is ready: its address and ports, and a scratch folder that goes away with it."""

    host: str
    ports: Ports
    folder: Path


@contextmanager
def simulated_box(arm: SimulatedArm) -> Iterator[SimulatedBox]:
    """Start a box and end it on leaving; SweepError if it does not start, or dies while it is used."""
    for left in reversed(range(_ATTEMPTS)):
        try:
            with _started(arm, _free_offset()) as box:
                yield box
                return
        except _PortTakenError:
            if not left:
                raise


class _PortTakenError(SweepError):
    """Another program has taken a port."""


@contextmanager
def _started(arm: SimulatedArm, offset: int) -> Iterator[SimulatedBox]:
    folder = Path(tempfile.mkdtemp(prefix="ur-sweep-"))
    ready, ended, log = folder / "ready.json", folder / ENDED_FILE, folder / "box.log"
    box = _command(arm, offset, ready)
    try:
        with log.open("wb") as errors:
            guard = subprocess.Popen(
                [sys.executable, "-m", "pc_client.studies.sweep.guard", str(folder), *box],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,  # Ctrl-C on the terminal is not for the box
            )
    except OSError as error:
        shutil.rmtree(folder, ignore_errors=True)
        raise SweepError(f"a simulated box cannot be started: {error.strerror or error}") from error
    with guard:  # leaving it closes the guard's standard input and waits for it
        if not _comes(ready, _START_TIMEOUT, is_over=lambda: ended.exists() or guard.poll() is not None):
            if not ended.exists() and guard.poll() is None:
                raise SweepError(f"the simulated box is not ready after {_START_TIMEOUT:.0f} s")
            words = _last_words(folder)
            kind = _PortTakenError if "in use" in words else SweepError
            raise kind(f"the simulated box does not start{words}")
        try:
            yield SimulatedBox(HOST, Ports.standard(offset), folder)
        except (ClientError, ProtocolError) as error:
            # Its connections close a moment before its end is noted.
            if not _comes(ended, _NOTICE):
                raise
            raise SweepError(f"the simulated box died{_last_words(folder)}: {full_message(error)}") from error


def _command(arm: SimulatedArm, offset: int, ready: Path) -> list[str]:
    words = [sys.executable, "-m", "ur_emulator", "serve", "--pace", "lockstep", "--host", HOST]
    words += ["--robot", arm.robot, "--fidelity", arm.fidelity, "--seed", str(arm.seed)]
    return [*words, "--port-base", str(offset), "--ready-file", str(ready)]


def _comes(file: Path, within: float, is_over: Callable[[], bool] = lambda: False) -> bool:
    """Wait for a file; False if it is over before, or the time [s] has passed."""
    deadline = time.monotonic() + within
    while not file.exists():
        if is_over() or time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def _last_words(folder: Path) -> str:
    """The exit code of a box that ended, and the last line that it wrote."""
    try:
        code = (folder / ENDED_FILE).read_text()
        lines = (folder / "box.log").read_text(errors="replace").split("\n")
    except OSError:
        return ""
    line = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f" (exit code {code}{': ' if line else ''}{line})"


def _free_offset() -> int:
    """A port offset at which nothing listens; SweepError if there is none."""
    offsets = list(_OFFSETS)
    random.Random(os.urandom(8)).shuffle(offsets)  # workers beside this one look at the same moment
    for offset in offsets:
        ports = Ports.standard(offset)
        if all(_is_free(getattr(ports, field.name)) for field in fields(ports)):
            return offset
    raise SweepError(f"no ports for a simulated box are free at {HOST}: end what holds them")


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError:
            return False
        return True
