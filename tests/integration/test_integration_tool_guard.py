"""A hand pushes the arm off its path: the client ends the run in one line and keeps what it recorded."""

from math import isfinite

import pytest

from pc_client.control.controller import CONTROLLERS
from pc_client.driver.ur_driver import UrDriver
from pc_client.errors import DriverError
from pc_client.experiment.prepare import load_movements, prepare_experiment
from pc_client.experiment.runner import ExperimentRunner
from pc_client.recording.loader import load_recording
from protocol.ur_types import SafetyMode

PUSH, PUSH_DURATION = (0.0, 240.0, 0.0), 0.05
"""A shove [N], [s]: more than the joints hold."""


class PushingDriver(UrDriver):
    """A session in which somebody pushes the flange in the midst of a movement; keeps the last frame."""

    def __init__(self, box):
        super().__init__(box.host, box.ports)
        self._box = box
        self.last_frame = None

    def stream(self, tracker, on_row, *, acceleration):
        pushed = []

        def push(frame, step):
            on_row(frame, step)
            self.last_frame = frame
            of_a_movement = isfinite(step.point.p[0])  # neither approach nor excitation has a TCP path
            if of_a_movement and step.t > 0.5 and not pushed:
                pushed.append(self._box.push(PUSH, duration=PUSH_DURATION))

        return super().stream(tracker, push, acceleration=acceleration)


def test_a_push_ends_the_run_before_the_box_protects_itself(lockstep_box, tmp_path):
    experiment = prepare_experiment(load_movements(["lognorm_4_1"]), repeat=1, out=tmp_path)
    with PushingDriver(lockstep_box) as driver:
        with pytest.raises(DriverError) as caught:
            ExperimentRunner(driver, experiment, CONTROLLERS["preview"]).run()
        assert driver.last_frame.safety_mode == SafetyMode.NORMAL
        driver.check_ready()
    message = str(caught.value)
    assert "off its path" in message
    assert "allowed is 5 mm (path_tolerance)" in message
    assert "\n" not in message
    recording = load_recording(tmp_path / "lognorm_4_1_r1.mcap")
    assert recording.summary == {"aborted": "DriverError"}
    assert recording.column("actual_q").shape[0] > 80
