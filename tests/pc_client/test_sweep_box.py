"""Cases on a real box in a process of its own: the same figures twice, and no box outlives its user."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from sweep_samples import case

import pc_client.studies.sweep.box as box_module
import pc_client.studies.sweep.schedule as run_case_module
from pc_client.errors import SweepError
from pc_client.studies.executors import open_executor
from pc_client.studies.sweep.box import HOST, simulated_box
from pc_client.studies.sweep.case import SimulatedArm
from pc_client.studies.sweep.schedule import run_case
from protocol.ur_types import Ports

ARM = SimulatedArm("ur3", "typical", 7)


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
    short = case(repeat=2)
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
    assert [name for name, _ in here.recordings] == ["uniform_4_1_r1.mcap", "uniform_4_1_r2.mcap"]


def test_gains_that_the_loop_does_not_bear_are_refused_before_the_movement_runs():
    outcome = run_case(case(gain_p=60.0), True)
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


def test_a_port_that_somebody_took_in_between_is_no_trouble(monkeypatch):
    with socket.create_server((HOST, 0)) as somebody:
        taken = somebody.getsockname()[1] - Ports().dashboard
        offsets = iter([taken, taken])
        find = box_module._free_offset
        monkeypatch.setattr(box_module, "_free_offset", lambda: next(offsets, None) or find())
        with simulated_box(ARM) as box:
            connect(box).close()
    assert next(offsets, None) is None


def test_a_box_that_is_refused_says_why():
    box = simulated_box(SimulatedArm("ur3", "perfect", 7))
    with pytest.raises(SweepError, match=r"does not start .*unknown fidelity 'perfect'"), box:
        pass


def test_a_box_that_dies_in_the_middle_is_named(monkeypatch):
    before = set(children_of(os.getpid()))  # an earlier test may have left an idle worker process

    class Fatal(run_case_module.ExperimentRunner):
        """Kills the box when the movement is about to run."""

        def _record(self, *args, **options):
            (guard,) = set(children_of(os.getpid())) - before
            (box,) = children_of(guard)
            os.kill(box, signal.SIGKILL)
            return super()._record(*args, **options)

    monkeypatch.setattr(run_case_module, "ExperimentRunner", Fatal)
    outcome = run_case(case(), False)
    assert outcome.status == "failed"
    assert outcome.error.startswith("the simulated box died (exit code -9): ")


def test_a_box_ends_with_a_user_that_is_killed():
    code = (
        "from pc_client.studies.sweep.box import simulated_box; from pc_client.studies.sweep.case import SimulatedArm\n"
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
