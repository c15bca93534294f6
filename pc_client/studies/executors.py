"""Where many equal jobs run: in processes of this machine or on a Dask cluster, behind one `Executor`.

    with open_executor(workers=None, dask=None) as executor:
        futures = [executor.submit(job, item) for item in items]

Jobs and what they take and give must be picklable, and importable where they run. A worker process ignores
Ctrl-C: the process that opened the executor decides. It lives as long as that process holds its end of a
pipe, so nothing is left behind, not even after `kill -9`.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from multiprocessing.connection import Connection

from pc_client.errors import ClientError

# One thread a worker: the workers themselves fill the cores, and a sum over threads is not repeatable.
_ONE_THREAD_EACH = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
    "POLARS_MAX_THREADS": "1",
}

_DASK_TIMEOUT = "10s"


def open_executor(workers: int | None = None, dask: str | None = None) -> AbstractContextManager[Executor]:
    """Open a place to run jobs; it is closed on leaving.

    On a regular end, jobs that were submitted are finished first. After an exception (Ctrl-C, an error of
    the caller) they are given up: waiting ones never begin, running processes are ended at once.

    Args:
        workers: processes on this machine; None: as many as this process may use cores.
        dask: address of a Dask scheduler, "tcp://host:8786"; the cluster has its own number of workers.

    Raises:
        ClientError: no workers, both kinds at once, or no scheduler answers at the address.
        ModuleNotFoundError: `dask` is given and the extra `cluster` is not installed.
    """
    if dask is not None:
        if workers is not None:
            raise ClientError(f"{workers} workers and a Dask cluster: the cluster has its own, give only one")
        return _dask_cluster(dask)
    if workers is not None and workers < 1:
        raise ClientError(f"{workers} workers cannot do anything; give at least 1")
    return _processes(usable_cores() if workers is None else workers)


def usable_cores() -> int:
    """How many cores this process may use, at least 1."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def _processes(workers: int) -> Iterator[Executor]:
    context = multiprocessing.get_context("spawn")  # fork would copy threads and locks of the caller
    held_by_workers, lifeline = context.Pipe(duplex=False)
    with held_by_workers, lifeline:
        pool = ProcessPoolExecutor(
            workers, mp_context=context, initializer=_begin_work, initargs=(held_by_workers,)
        )
        try:
            # The pool starts a process with each of the first jobs. It does so here, where the children
            # inherit what they must have from their first instruction on.
            with _worker_state():
                for _ in range(workers):
                    pool.submit(_nothing)
            yield pool
        except BaseException:
            lifeline.close()
            pool.shutdown(cancel_futures=True)
            raise
        pool.shutdown()


@contextmanager
def _dask_cluster(address: str) -> Iterator[Executor]:
    from distributed import Client

    try:
        client = Client(address, timeout=_DASK_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:  # no answer; no such address
        raise ClientError(
            f"no Dask scheduler answers at {address!r} ({error}); start one with `dask scheduler`, "
            "and give its address, tcp://HOST:8786"
        ) from error
    with client:
        # Not "pure": a job that failed is done again when it is submitted again.
        executor: Executor = client.get_executor(pure=False)
        try:
            yield executor
        except BaseException:
            executor.shutdown(wait=False)
            raise
        executor.shutdown()


def _begin_work(lifeline: Connection) -> None:
    """Run in a new worker before its first job."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(lifeline,), name="lifeline", daemon=True).start()


def _end_with(lifeline: Connection) -> None:
    """End this process when the other end of the pipe is closed, whatever its main thread is doing."""
    try:
        lifeline.recv_bytes()
    except (EOFError, OSError):
        os._exit(1)


def _nothing() -> None:
    """A job that lets the pool start a process."""


@contextmanager
def _worker_state() -> Iterator[None]:
    """Set for a while what new processes inherit: one thread each, and Ctrl-C is ignored.

    Only the main thread may ignore Ctrl-C; in others the workers do so themselves when they begin.
    """
    added = {name: value for name, value in _ONE_THREAD_EACH.items() if name not in os.environ}
    in_main_thread = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN) if in_main_thread else None
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)
        if in_main_thread:
            signal.signal(signal.SIGINT, before)
