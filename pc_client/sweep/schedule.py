"""All cases of a sweep, one after the other or side by side; outcomes come as they get ready."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, as_completed
from contextlib import ExitStack, contextmanager, suppress

from pc_client.executors import open_executor, usable_cores
from pc_client.sweep.case import Case, GivenRobot, SimulatedArm, all_cases
from pc_client.sweep.config import SweepConfig
from pc_client.sweep.outcome import Outcome, failed
from pc_client.sweep.result_store import ResultStore

Job = Callable[[Case], Outcome]
_Outcomes = Iterator[tuple[Case, Outcome]]
_Runner = Callable[[Sequence[Case]], _Outcomes]


class Sweep:
    """All cases of a sweep, batch by batch.

    Args:
        config: the file.
        arms: simulated ones, or the robot that is there.
        store: knows what is settled, and takes the outcomes.

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

        Args:
            run: runs cases.

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
        """Go on to the next batch that has cases to run."""
        for cases in self._batches:
            self._cases = cases
            self.waiting = self._store.waiting(cases)
            if self.waiting:
                return
        self.waiting = []


def in_turn(job: Job) -> _Runner:
    """One case after the other in this process, as one robot must."""
    return lambda cases: ((case, job(case)) for case in cases)


@contextmanager
def side_by_side(job: Job, *, workers: int | None, dask: str | None) -> Iterator[_Runner]:
    """Cases over processes of this machine or a Dask cluster, which are started with the first case.

    When a worker process dies (out of memory, killed), the others are lost with it. Those cases that may have
    been its are then run alone: one that kills its worker again has failed, the others go on.

    Args:
        job: does one case; must be picklable and raise nothing for errors of the case.
        workers: as `open_executor`.
        dask: as `open_executor`.
    """
    # The pool hands a job more than it has workers to its queue.
    n_begun = 1 + (usable_cores() if workers is None else workers)
    executors: list[Executor] = []

    def run(cases: Sequence[Case]) -> _Outcomes:
        waiting = list(cases)
        while waiting:
            if not executors:
                executors.append(opened.enter_context(open_executor(workers, dask)))
            lost = yield from _round(executors[0], waiting, job)
            if lost:
                opened.close()
                executors.clear()
            suspects, waiting = lost[:n_begun], lost[n_begun:]
            for case in suspects:
                with open_executor(1) as alone:
                    dies_again = yield from _round(alone, [case], job)
                if dies_again:
                    yield (
                        case,
                        failed("the worker process died, also when the case ran alone: is memory short?"),
                    )

    with ExitStack() as opened:
        yield run


def _round(
    executor: Executor, cases: Sequence[Case], job: Job
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
