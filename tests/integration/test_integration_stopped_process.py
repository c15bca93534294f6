"""In lockstep a process that is stopped, client or box, changes nothing: not a byte of the recording.

Two seconds are longer than the client waits for a frame of a robot whose time runs by itself. That half a minute
is sat out as well is held where clocks are handed in: test_realtime_pacing.py, test_driver_stream.py.
"""

import os
import signal
import time
from contextlib import contextmanager

import pytest
from integration_support import Frames, at, finish, send, serving, start

from pc_client.recording.recording import load_recording
from protocol.ur_types import ProgramState

STOPPED = 2.0  # s


@contextmanager
def stopped(process):
    """The block runs while the process is stopped."""
    process.send_signal(signal.SIGSTOP)
    os.waitpid(process.pid, os.WUNTRACED)
    try:
        yield
    finally:
        process.send_signal(signal.SIGCONT)


@pytest.mark.usefixtures("without_page")
def test_a_process_that_is_stopped_in_a_movement_changes_no_byte(standard_box, ur_client, tmp_path):
    out = tmp_path / "stopped"
    path = out / "uniform_4_1_r1.mcap"
    with serving(tmp_path, "--pace", "lockstep", "--seed", 7) as box:
        client = start("pc_client", "run", "uniform_4_1", *at(box), "--out", out)
        with Frames(box) as frames:
            frames.until(lambda f: abs(f.target_qd).max() > 0.1 and path.exists())
        for process in (client, box.process):
            with stopped(process):
                time.sleep(STOPPED)
                assert not load_recording(path).complete
        done = finish(client)
    assert done.code == 0, done.err
    # The other run is that of a client and a box in one process.
    here = tmp_path / "here"
    assert ur_client("run", "uniform_4_1", *at(standard_box), "--out", here).code == 0
    assert path.read_bytes() == (here / path.name).read_bytes()


def test_a_client_that_reads_nothing_for_a_while_is_waited_for_and_loses_nothing(lockstep_box):
    with Frames(lockstep_box) as late, Frames(lockstep_box) as frames:
        begin = late.next().timestamp
        send(lockstep_box, "secondary", "def f():\n  sleep(60)\nend\n")
        frames.until(
            lambda f: f.runtime_state == ProgramState.PLAYING and frames.stamps[-2:-1] == frames.stamps[-1:]
        )
        held = frames.stamps[-1]
        assert held < begin + 60.0
        late.until_stamp(held)
        assert late.lost() == 0
