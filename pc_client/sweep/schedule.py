"""All cases of a sweep, one after the other or side by side; outcomes come as they get ready."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import BrokenExecutor, Future, as_completed
from contextlib import suppress

from pc_client.executors import open_executor, usable_cores
from pc_client.sweep.case import Case
from pc_client.sweep.outcome import Outcome, failed

Job = Callable[[Case, bool], Outcome]
Outcomes = Generator[tuple[Case, Outcome], None, None]


def run_in_turn(cases: Sequence[Case], keep_recordings: bool, job: Job) -> Outcomes:
    """One case after the other in this process, as one robot must; ends after the first that fails.

    After a failure someone has to look at the arm before it moves again.
    """
    for case in cases:
        outcome = job(case, keep_recordings)
        yield case, outcome
        if outcome.status == "failed":
            return


def run_side_by_side(
    cases: Sequence[Case], keep_recordings: bool, job: Job, *, workers: int | None, dask: str | None
) -> Outcomes:
    """All cases over processes of this machine or a Dask cluster.

    When a worker process dies (out of memory, killed), the others are lost with it. Those cases that may have
    been its are then run alone: one that kills its worker again has failed, the others go on.

    Args:
        cases: what to do.
        keep_recordings: given to the job.
        job: does one case; must be picklable and raise nothing for errors of the case.
        workers: as `open_executor`.
        dask: as `open_executor`.
    """
    # The pool hands a job more than it has workers to its queue.
    n_begun = 1 + (usable_cores() if workers is None else workers)
    waiting = list(cases)
    while waiting:
        lost = yield from _round(waiting, keep_recordings, job, workers, dask)
        suspects, waiting = lost[:n_begun], lost[n_begun:]
        for case in suspects:
            if (yield from _round([case], keep_recordings, job, 1, None)):
                yield case, failed("the worker process died, also when the case ran alone: is memory short?")


def _round(
    cases: Sequence[Case], keep_recordings: bool, job: Job, workers: int | None, dask: str | None
) -> Generator[tuple[Case, Outcome], None, list[Case]]:
    """Run cases in a fresh executor; returns those that were lost with a worker process, in order."""
    lost: set[str] = set()
    with open_executor(workers, dask) as executor:
        futures: dict[Future[Outcome], Case] = {}
        with suppress(BrokenExecutor):  # died while we were still handing out: the rest counts as lost
            for case in cases:
                futures[executor.submit(job, case, keep_recordings)] = case
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
