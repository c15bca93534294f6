"""A hand pushes the arm off its path: the client ends the run in one line and keeps what it recorded."""

from math import isfinite

import numpy as np
import pytest

import pc_client as ur
from pc_client.control.controller import CONTROLLERS
from pc_client.control.loop import LoopModel
from pc_client.driver.session import UrDriver
from pc_client.errors import DriverError
from pc_client.experiment.checks import guarded
from pc_client.experiment.experiment import load_movements, prepare_experiment
from pc_client.experiment.runner import ExperimentRunner
from pc_client.kinematics.clearance import clearance_model
from pc_client.kinematics.model import robot_model
from pc_client.recording.recording import load_recording
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
    assert recording.summary == {"aborted": f"DriverError: {message}"}
    assert recording.column("actual_q").shape[0] > 80


QUICK = [(0.30, -0.06, 0.30), (0.30, 0.06, 0.35)]
"""Own points .13 m apart: in 1.5 s more acceleration than the published controller lets `speedj` use."""


def test_the_published_controller_runs_a_quick_movement_as_the_loop_predicts(lockstep_box):
    arm = ur.connect(lockstep_box.host, lockstep_box.ports)
    run = arm.run(ur.Movement.through(QUICK, durations=[1.5]), ur.Controller.paper())
    off = np.linalg.norm(run.tcp_pose[:, None, :3] - run.ref_tcp_position[None], axis=2).min(axis=1)
    assert 0.02 < off.max() < ur.Controller.paper().path_tolerance


def test_a_predicted_way_too_near_to_a_wall_is_refused():
    """The plan keeps 21 mm from the wall, but the loop leads the tool 43 mm further."""
    quick = ur.Movement.through(QUICK, durations=[1.5])
    loop = LoopModel.of_delay(0.03, 0.0)

    def planned(y):
        cell = ur.Cell(name="c", walls=(ur.Wall("window", (0.0, -1.0, 0.0), -y),))
        return ur.plan(quick, "ur3", cell), robot_model("ur3", cell)

    plan, far = planned(0.5)
    y = 0.5 - clearance_model(far).along(plan.joints.q).cell.least.min() + 0.021
    plan, near = planned(y)
    guarded(plan.joints, CONTROLLERS["preview"], near, loop, 0.008)
    with pytest.raises(DriverError, match=r"off its path, .* of wall 'window', at least 20 mm"):
        guarded(plan.joints, CONTROLLERS["paper"], near, loop, 0.008)


def test_what_a_user_does_not_allow_is_refused_before_anything_moves(lockstep_box):
    arm = ur.connect(lockstep_box.host, lockstep_box.ports)
    q = arm.frame().actual_q
    wanted = (
        r"would lead the tool \d\d\.\d mm and .* off its path, allowed is 10 mm \(path_tolerance\) and .*: "
        "give the movement 1.3 times its duration or use the controller 'preview'"
    )
    with pytest.raises(ur.ClientError, match=wanted) as caught:
        arm.run(ur.Movement.through(QUICK, durations=[1.5]), ur.Controller.paper(path_tolerance=0.01))
    assert "\n" not in str(caught.value)
    np.testing.assert_allclose(arm.frame().actual_q, q, atol=1e-3)
    slower = ur.Movement.through(QUICK, durations=[1.5 * 1.3])
    arm.run(slower, ur.Controller.paper(path_tolerance=0.01))
