"""The cases of a sweep: batch by batch, in turn or side by side, each from its content to its figures.

`Sweep` knows which cases are left, `in_turn` and `side_by_side` run them, and `run_case` is the job that
workers do. Whatever goes wrong in a case is part of its outcome: a sweep is not ended by one case.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, as_completed
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from pc_client.analysis.run import analyse_run
from pc_client.driver.session import UrDriver
from pc_client.errors import ClientError, GainMarginError, full_message
from pc_client.experiment.experiment import Experiment
from pc_client.experiment.identification import Identification
from pc_client.experiment.runner import ExperimentRunner
from pc_client.kinematics.cell import NO_CELL, Cell
from pc_client.kinematics.model import robot_model
from pc_client.movements.library_sets import library_name_of
from pc_client.movements.movement import load_movement
from pc_client.planning.plan import Plan, make_plan
from pc_client.recording.recording import load_recording
from pc_client.results.tables import finite
from pc_client.studies.executors import open_executor, usable_cores
from pc_client.studies.sweep.box import simulated_box
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
from protocol.errors import ProtocolError
from protocol.ur_types import Ports

if TYPE_CHECKING:  # both load polars, which workers do without
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
    try:
        with _robot_of(case.arm) as (host, ports, reverse_port, folder):
            experiment = plan_case(case, folder / "recordings")
            try:
                with UrDriver(host, ports, reverse_port=reverse_port) as driver:
                    if isinstance(case.arm, GivenRobot):
                        driver.info.check_same(experiment.model.title, case.arm.serial)
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
    with TemporaryDirectory(prefix="ur-sweep-") as folder:
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
        with TemporaryDirectory(prefix="ur-sweep-") as folder:
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
