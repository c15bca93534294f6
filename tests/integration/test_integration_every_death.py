"""In every phase of an experiment, and for every way in which a client can be lost: the arm rests in 0.3 s.

Counted in robot time, from the last command that the robot got. In lockstep the client dies at an exact command.
"""

import threading
from dataclasses import replace

import pytest
from dying_client import CUT_OFF, FROZEN, KILLED, Bystander, DyingNetwork, Killed
from integration_support import PERIOD, Frames

import ur_emulator.realtime.pacing as pacing
from pc_client.control.controller import CONTROLLERS
from pc_client.driver.session import UrDriver
from pc_client.experiment.experiment import load_movements, prepare_experiment
from pc_client.experiment.runner import ExperimentRunner
from pc_client.recording.recording import load_recording
from protocol.ur_types import ProgramState, SafetyMode

ALLOWED = 0.3  # s

# The programs of an experiment of two runs, and a speed [rad/s] that the phase reaches.
PHASES = {
    "approach": (1, 0.4),
    "identification": (2, 0.08),
    "stream": (3, 0.3),
    "return": (4, 0.3),
    "pause between runs": (4, None),
}


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    movements = load_movements(["lognorm_4_1"])
    return prepare_experiment(movements, repeat=2, out=tmp_path_factory.mktemp("unused"))


class Client(threading.Thread):
    """A client in a thread; `error` is what ended it."""

    def __init__(self, box, network, experiment):
        super().__init__()
        self.box, self.network, self.experiment = box, network, experiment
        self.error = None

    def run(self):
        try:
            with UrDriver(self.box.host, self.box.ports, network=self.network) as driver:
                ExperimentRunner(driver, self.experiment, CONTROLLERS["preview"]).run()
        except BaseException as error:
            self.error = error


def lose_client(box, experiment, death, phase, monkeypatch):
    """Run an experiment until its client is lost and the arm rests, then let the client go on if it can.

    Returns:
        What ended the client, the time to rest [s] and the frame at rest.
    """
    network = DyingNetwork(death, *PHASES[phase])
    client = Client(box, network, experiment)
    with Frames(box) as frames:
        bystander = Bystander(frames)
        client.start()
        try:
            bystander.until(lambda: network.dead.is_set() or not client.is_alive())
            assert network.dead.is_set(), client.error
            monkeypatch.setattr(
                pacing, "HANG_LIMIT", 0.05
            )  # s, instead of a minute: time goes on without a command
            bystander.until_rest()
            time_to_rest, at_rest = bystander.time_to_rest(network.last_command), bystander.latest
            monkeypatch.undo()
        finally:
            network.awake.set()
            bystander.until(lambda: not client.is_alive())
            network.close()
    return client.error, time_to_rest, at_rest


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("death", [KILLED, FROZEN, CUT_OFF])
def test_the_arm_rests_in_time(lockstep_box, twice, tmp_path, death, phase, monkeypatch):
    experiment = replace(twice, out=tmp_path)
    error, time_to_rest, at_rest = lose_client(lockstep_box, experiment, death, phase, monkeypatch)
    rests_already = phase == "pause between runs"
    assert time_to_rest <= ALLOWED
    assert rests_already or time_to_rest >= 5 * PERIOD  # it was in motion
    assert at_rest.runtime_state == ProgramState.STOPPED
    assert at_rest.safety_mode == SafetyMode.NORMAL
    if death == KILLED:
        assert isinstance(error, Killed)
        return
    assert (
        kept_recordings(experiment)
        == {
            "approach": [],
            "identification": [],
            "stream": ["aborted"],
            "return": ["complete"],
            "pause between runs": ["complete"] * (2 if death == FROZEN else 1),
        }[phase]
    )
    if death == FROZEN and rests_already:
        assert error is None  # nothing has happened that it need know of
    else:
        words = "the robot had no command for" if death == FROZEN else "no new realtime frame for 120 s"
        assert str(error).startswith(words)
        assert "\n" not in str(error)
        # A client that cannot see the robot any more says so; one that was frozen sees that the arm rests.
        notes = [it for it in getattr(error, "__notes__", []) if not it.startswith("recorded until then")]
        assert bool(notes) == (death == CUT_OFF)


def kept_recordings(experiment):
    """How each recording that was begun ended; all can be read and hold rows."""
    recordings = [load_recording(path) for path in sorted(experiment.out.glob("*.mcap"))]
    assert all(len(recording.column("timestamp")) > 20 for recording in recordings)
    return ["aborted" if "aborted" in recording.summary else "complete" for recording in recordings]
