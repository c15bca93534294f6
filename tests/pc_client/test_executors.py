"""Where jobs run: order, errors, one thread each, nothing left behind, processes and Dask alike."""

from __future__ import annotations

import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest

from pc_client import cli
from pc_client.errors import ClientError
from pc_client.studies.executors import open_executor


def square(x):
    return x * x


def fail(words):
    raise ClientError(words)


def check_jobs_and_errors(executor):
    assert [executor.submit(square, x).result() for x in range(3)] == [0, 1, 4]
    with pytest.raises(ClientError, match="what went wrong"):
        executor.submit(fail, "what went wrong").result()


def environment_and_interrupts():
    return os.environ["OMP_NUM_THREADS"], signal.getsignal(signal.SIGINT) == signal.SIG_IGN, os.getpid()


def work_without_end(port):
    """Say over TCP that it works; the other side reads the end of the stream when this process ends."""
    with socket.create_connection(("127.0.0.1", port)) as link:
        link.sendall(b"x")
        threading.Event().wait()


@pytest.fixture
def listener():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener


@pytest.fixture
def cluster():
    distributed = pytest.importorskip("distributed")
    here = {"processes": False, "dashboard_address": ":0", "protocol": "tcp", "host": "127.0.0.1"}
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, **here) as cluster:
        yield cluster.scheduler_address


def test_processes_do_jobs_and_hand_over_errors(monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    handler = signal.getsignal(signal.SIGINT)
    with open_executor(1, None) as executor:
        check_jobs_and_errors(executor)
        threads, ignored, pid = executor.submit(environment_and_interrupts).result()
    assert threads == "1"
    assert ignored
    assert pid != os.getpid()
    assert "OMP_NUM_THREADS" not in os.environ
    assert signal.getsignal(signal.SIGINT) is handler
    assert multiprocessing.active_children() == []


def test_dask_does_the_same(cluster):
    with open_executor(None, cluster) as executor:
        check_jobs_and_errors(executor)


def interrupted_work(listener, futures):
    with open_executor(1, None) as executor:
        futures.append(executor.submit(work_without_end, listener.getsockname()[1]))
        futures.extend(executor.submit(square, x) for x in range(5))
        link, _ = listener.accept()
        with link:
            assert link.recv(1) == b"x"
            raise KeyboardInterrupt


def test_an_exception_ends_running_jobs_and_drops_waiting_ones(listener):
    futures = []
    with pytest.raises(KeyboardInterrupt):
        interrupted_work(listener, futures)
    assert len(futures) == 6
    for future in futures:
        assert future.done()
        assert future.cancelled() or isinstance(future.exception(), BrokenProcessPool)
    assert multiprocessing.active_children() == []


def test_workers_end_with_a_caller_that_is_killed(listener):
    code = (
        "from test_executors import work_without_end; from pc_client.studies.executors import open_executor\n"
        f"with open_executor(1) as e: e.submit(work_without_end, {listener.getsockname()[1]}).result()"
    )
    caller = subprocess.Popen([sys.executable, "-c", code], cwd=Path(__file__).parent)
    link, _ = listener.accept()
    with link:
        assert link.recv(1) == b"x"
        caller.kill()
        caller.wait()
        assert link.recv(1) == b""  # a worker that stays ends this test by its timeout


@pytest.mark.parametrize(
    ("workers", "dask", "words"),
    [
        (0, None, "at least 1"),
        (2, "tcp://127.0.0.1:8786", "only one"),
        (None, "127.0.0.1:1", "no Dask scheduler answers"),
        (None, "no address at all", "no Dask scheduler answers"),
    ],
)
def test_what_makes_no_sense_is_one_line(workers, dask, words, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("pc_client.studies.executors._DASK_TIMEOUT", "300ms")
    with pytest.raises(ClientError, match=words), open_executor(workers, dask):
        pass


def test_missing_dask_names_the_extra(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)

    def command(*arguments, **options):
        with open_executor(None, "tcp://127.0.0.1:8786"):
            pass

    monkeypatch.setattr(cli, "app", command)
    assert cli.run(["anything"]) == 1
    assert "pip install 'ur-hil[cluster]'" in capsys.readouterr().err
