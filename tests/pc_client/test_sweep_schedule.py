"""Cases over processes and Dask: errors are rows, a dead worker costs its own case, one robot works in turn."""

from __future__ import annotations

import sys
from functools import partial

import pytest
from sweep_samples import case, deadly, faulty, interrupted, invented, process_id

from pc_client.studies.sweep.case import Outcome, failed
from pc_client.studies.sweep.schedule import in_turn, run_case, side_by_side

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


def test_side_by_side_on_dask():
    distributed = pytest.importorskip("distributed")
    keeping = partial(invented, keep_recordings=True)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as cluster:
        outcomes = done_by(keeping, dask=cluster.scheduler_address)
    assert dict(outcomes) == {case: keeping(case) for case in CASES}


def test_a_job_that_kills_its_worker_costs_only_its_own_case():
    outcomes = done_by(deadly, workers=1)
    assert len(outcomes) == len(CASES)
    assert statuses(outcomes) == {1: "done", 2: "done", 13: "failed", 3: "done", 4: "done", 5: "done"}
    (error,) = [outcome.error for case, outcome in outcomes if case.arm.seed == 13]
    assert "worker process died" in error


def test_processes_last_for_all_batches_and_are_replaced_when_one_has_died():
    with side_by_side(process_id, workers=1, dask=None) as run:
        ids = [[outcome.error for _, outcome in run([case(seed=seed)])] for seed in (1, 2, 13, 3, 4)]
    assert ids[0] == ids[1]
    assert "worker process died" in ids[2][0]
    assert ids[0] != ids[3] == ids[4]


def test_a_mistake_in_the_job_is_a_row_too():
    ((_, outcome),) = done_by(faulty, [case()], workers=1)
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
        "pc_client.studies.sweep.box._command", lambda *a: [sys.executable, "-m", "ur_emulator_not_here"]
    )
    outcome = run_case(case(), False)
    assert outcome.status == "failed"
    assert "No module named" in outcome.error
    assert "\n" not in outcome.error


def test_a_folder_without_room_is_a_failed_case(monkeypatch):
    def full(*args, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pc_client.studies.sweep.box.tempfile.mkdtemp", full)
    assert run_case(case(), False) == Outcome("failed", "[Errno 28] No space left on device")
