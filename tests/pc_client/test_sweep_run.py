"""Cases over processes and Dask, and on boxes of their own: errors are rows, nothing outlives its user."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from sweep_samples import case, faulty, interrupted, invented, process_id

import pc_client.studies.sweep.schedule as schedule
from pc_client.errors import SweepError
from pc_client.movements.movement import Movement
from pc_client.studies.executors import open_executor
from pc_client.studies.sweep.case import MovementFile, Outcome, SimulatedArm, failed
from pc_client.studies.sweep.schedule import HOST, in_turn, run_case, side_by_side, simulated_box
from protocol.ur_types import Ports

CASES = [case(seed=seed) for seed in (1, 2, 13, 3, 4, 5)]


def statuses(outcomes):
    return {case.arm.seed: outcome.status for case, outcome in outcomes}


def done_by(job, cases=CASES, *, workers=None, dask=None):
    with side_by_side(job, workers=workers, dask=dask) as run:
        return list(run(cases))


def test_side_by_side_in_processes():
    outcomes = done_by(invented, workers=2)
    assert len(outcomes) == len(CASES)
    assert statuses(outcomes) == {1: "done", 2: "done", 13: "failed", 3: "done", 4: "done", 5: "done"}
    assert all(outcome == invented(case) for case, outcome in outcomes)


@pytest.mark.nightly
def test_side_by_side_on_dask():
    distributed = pytest.importorskip("distributed")
    keeping = partial(invented, keep_recordings=True)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as cluster:
        outcomes = done_by(keeping, dask=cluster.scheduler_address)
    assert dict(outcomes) == {case: keeping(case) for case in CASES}


def test_a_job_that_kills_its_worker_costs_only_its_own_case_and_the_worker_is_replaced():
    with side_by_side(process_id, workers=1, dask=None) as run:
        outcomes = [*run(CASES), *run([case(seed=6)])]
    assert len(outcomes) == len(CASES) + 1
    assert statuses(outcomes) == {s: "failed" if s == 13 else "done" for s in (1, 2, 13, 3, 4, 5, 6)}
    said = {case.arm.seed: outcome.error for case, outcome in outcomes}
    assert "worker process died" in said[13]
    assert said[1] == said[2] != said[4] == said[5] == said[6]  # one process lasts for all batches


@contextmanager
def one_thread(workers, dask):
    with ThreadPoolExecutor(1) as executor:
        yield executor


def test_a_mistake_in_the_job_is_a_row_too(monkeypatch):
    monkeypatch.setattr(schedule, "open_executor", one_thread)
    ((_, outcome),) = done_by(faulty, [case()])
    assert outcome == failed("ZeroDivisionError: division by zero")


def test_nothing_to_do_starts_nothing(monkeypatch):
    monkeypatch.setattr("pc_client.studies.sweep.schedule.open_executor", None)
    assert done_by(invented, [], workers=2) == []


def test_ctrl_c_goes_through():
    outcomes = in_turn(interrupted)(CASES)
    assert [next(outcomes)[0].arm.seed for _ in range(2)] == [1, 2]
    with pytest.raises(KeyboardInterrupt):
        next(outcomes)


def test_without_the_box_every_case_fails_in_one_line(monkeypatch):
    monkeypatch.setattr(
        "pc_client.studies.sweep.schedule._command", lambda *a: [sys.executable, "-m", "ur_emulator_not_here"]
    )
    outcome = run_case(case(), False)
    assert outcome.status == "failed"
    assert "No module named" in outcome.error
    assert "\n" not in outcome.error


def test_a_folder_without_room_is_a_failed_case(monkeypatch):
    def full(*args, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pc_client.studies.sweep.schedule.tempfile.mkdtemp", full)
    assert run_case(case(), False) == Outcome("failed", "[Errno 28] No space left on device")


ARM = SimulatedArm("ur3", "typical", 7)
REACH = Movement.through([(0.35, -0.06, 0.25), (0.35, 0.06, 0.3)], "robot", [1.5], name="short")
SHORT = MovementFile("short", "short.toml", REACH.text)


def connect(box):
    return socket.create_connection((HOST, box.ports.dashboard), timeout=20.0)


def read_to_the_end(link):
    """Return once the other side has gone; a box that stays lets the time-out of the socket pass."""
    while True:
        try:
            if not link.recv(4096):
                return
        except ConnectionError:
            return


def test_the_same_case_gives_the_same_figures_here_and_in_another_process():
    short = replace(case(repeat=2), movement=SHORT)
    with open_executor(1, None) as executor:
        there = executor.submit(run_case, short, True)
        here = run_case(short, True)
        there = there.result()
    assert here.status == "done", here.error
    assert len(here.rows) == 2
    assert here.rows[0]["snr_db"] > 20.0
    assert here.rows[0]["delay_ms"] == pytest.approx(32.0, abs=4.0)
    assert here.rows[0]["gain_margin"] > 2.0
    assert here.rows[0]["late_frames"] == here.rows[0]["lost_frames"] == 0
    assert here.rows[0]["snr_db"] != here.rows[1]["snr_db"]
    assert here == there  # figures and recordings, to the last bit
    assert [name for name, _ in here.recordings] == ["short_r1.mcap", "short_r2.mcap"]


def test_gains_that_the_loop_does_not_bear_are_refused_before_the_movement_runs():
    outcome = run_case(replace(case(gain_p=60.0), movement=SHORT), True)
    assert outcome.status == "refused"
    assert "gain margin" in outcome.error
    (row,) = outcome.rows
    assert 0.0 < row["gain_margin"] < 2.0
    assert row["delay_ms"] > 8.0
    assert outcome.recordings == ()


def test_leaving_ends_box_and_scratch_folder():
    with simulated_box(ARM) as box:
        assert (box.folder / "ready.json").exists()
        link = connect(box)
    with link:
        read_to_the_end(link)
    assert not box.folder.exists()


@pytest.mark.nightly
def test_a_port_that_somebody_took_in_between_is_no_trouble(monkeypatch):
    with socket.create_server((HOST, 0)) as somebody:
        taken = somebody.getsockname()[1] - Ports().dashboard
        offsets = iter([taken, taken])
        find = schedule._free_offset
        monkeypatch.setattr(schedule, "_free_offset", lambda: next(offsets, None) or find())
        with simulated_box(ARM) as box:
            connect(box).close()
    assert next(offsets, None) is None


@pytest.mark.nightly
def test_a_box_that_is_refused_says_why():
    box = simulated_box(SimulatedArm("ur3", "perfect", 7))
    with pytest.raises(SweepError, match=r"does not start .*unknown fidelity 'perfect'"), box:
        pass


def test_a_box_that_dies_in_the_middle_is_named(monkeypatch):
    before = set(children_of(os.getpid()))  # an earlier test may have left an idle worker process

    class Fatal(schedule.ExperimentRunner):
        """Kills the box when the movement is about to run."""

        def _record(self, *args, **options):
            (guard,) = set(children_of(os.getpid())) - before
            (box,) = children_of(guard)
            os.kill(box, signal.SIGKILL)
            return super()._record(*args, **options)

    monkeypatch.setattr(schedule, "ExperimentRunner", Fatal)
    outcome = run_case(replace(case(), movement=SHORT), False)
    assert outcome.status == "failed"
    assert outcome.error.startswith("the simulated box died (exit code -9): ")


@pytest.mark.nightly
def test_a_box_ends_with_a_user_that_is_killed():
    code = (
        "from pc_client.studies.sweep.schedule import simulated_box; from pc_client.studies.sweep.case import SimulatedArm\n"
        "with simulated_box(SimulatedArm('ur3', 'typical', 7)) as box:\n"
        "    print(box.ports.dashboard, box.folder, flush=True)\n"
        "    input()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as user:
        port, folder = user.stdout.readline().split()
        with socket.create_connection((HOST, int(port)), timeout=20.0) as link:
            user.kill()
            read_to_the_end(link)
        user.wait()
    assert Path(folder).name.startswith("ur-sweep-")


def children_of(pid):
    psutil = pytest.importorskip("psutil")
    return [
        child.pid
        for child in psutil.Process(pid).children()
        if "resource_tracker" not in " ".join(child.cmdline())
    ]
