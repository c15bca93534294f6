"""Freedrive with blocked axes, screw driving: the tool moves along the axes that are free, and along no other."""

import numpy as np
import pytest
from e_series_support import DT, ESeriesBench, program

from protocol.pose import pose_inv, pose_trans, rotvec_to_matrix
from protocol.ur_types import ControlMode, RobotMode
from ur_emulator.commands.power import StartFreedrive
from ur_emulator.commands.surroundings import Push

TURNED = "p[0.1, 0, 0, 0, 0, 0.7853981633974483]"  # 45 degrees about z


def guided(arguments, fidelity="ideal"):
    bench = ESeriesBench(fidelity=fidelity)
    bench.start(program(f"freedrive_mode({arguments})", "sleep(100)"))
    bench.tick(100)
    assert bench.now.control_mode == ControlMode.TEACH
    return bench


def tool(bench):
    return bench.controller.state.arm.fk(bench.controller.plant.q_true)


def moved_by(bench, force, n=500):
    """How the tool has moved after a push of 1 s and some time to come to rest."""
    before = tool(bench)
    bench.tick(n, Push(tuple(force)))
    bench.tick(n, Push((0.0, 0.0, 0.0)))
    assert not bench.errors
    turn = np.array(pose_trans(pose_inv(before), tool(bench))[3:])
    return np.array(tool(bench)[:3]) - np.array(before[:3]), turn


@pytest.mark.parametrize("fidelity", ["ideal", "typical"])
def test_only_x_of_the_base_is_free(fidelity):
    bench = guided("[1, 0, 0, 0, 0, 0]", fidelity)
    shift, turn = moved_by(bench, (60.0, 60.0, 60.0), 300)
    assert shift[0] > 0.03
    assert np.abs(shift[1:]).max() < 0.006
    assert np.linalg.norm(turn) < 0.03


def test_all_free_yields_everywhere():
    shift, _ = moved_by(guided(""), (0.0, 60.0, 0.0), 300)
    assert shift[1] > 0.03


def test_axes_of_a_turned_feature():
    shift, _ = moved_by(guided(f"[1, 0, 0, 0, 0, 0], {TURNED}"), (60.0, 0.0, 0.0), 300)
    assert shift[0] > 0.015
    assert shift[1] == pytest.approx(shift[0], abs=0.005)
    assert abs(shift[2]) < 0.006


def test_axes_of_the_tool():
    bench = guided('freeAxes=[0, 0, 1, 0, 0, 0], feature="tool"')
    z = rotvec_to_matrix(tool(bench)[3:])[:, 2]
    shift, _ = moved_by(bench, -60.0 * z, 300)
    assert shift @ z < -0.03
    assert np.linalg.norm(shift - (shift @ z) * z) < 0.006


def test_a_locked_arm_keeps_its_place():
    shift, turn = moved_by(guided("[0, 0, 0, 0, 0, 0]"), (50.0, -50.0, -50.0), 300)
    assert np.linalg.norm(shift) < 0.008
    assert np.linalg.norm(turn) < 0.04


def test_a_client_frees_all_axes():
    bench = guided("[0, 0, 0, 0, 0, 0]")
    bench.tick(1, StartFreedrive())
    shift, _ = moved_by(bench, (0.0, 60.0, 0.0), 300)
    assert bench.now.robot_mode == RobotMode.RUNNING
    assert shift[1] > 0.03


def test_freedrive_status_tells_of_singularities():
    bench = ESeriesBench(fidelity="exact")
    bench.run(
        program(
            "global usual = get_freedrive_status()",
            "set_pos([0, -1.57, -1.57, -1.57, 1.57, 0])",
            "sync()",
            "global good = get_freedrive_status()",
            "set_pos([0, -1.57, -1.57, -1.57, 0.25, 0])",
            "sync()",
            "global near = get_freedrive_status()",
            "set_pos([0, -1.57, -1.57, -1.57, 0.001, 0])",
            "sync()",
            "global wrist = get_freedrive_status()",
            "set_pos([0, -1.57, 0, -1.57, 1.57, 0])",
            "sync()",
            "global stretched = get_freedrive_status()",
        )
    )
    names = ("usual", "good", "near", "wrist", "stretched")
    assert [bench[name] for name in names] == [0, 0, 1, 2, 2]


def test_screw_driving_follows_the_tool_axis_at_its_speed():
    bench = ESeriesBench(fidelity="ideal")
    bench.start(program("screw_driving(10, 0.02)", "sleep(2)", "end_screw_driving()", "sleep(1)"))
    z = rotvec_to_matrix(bench.now.actual_tcp_pose[3:])[:, 2]
    bench.tick(500)
    assert bench.now.control_mode == ControlMode.FORCE
    before = np.array(tool(bench)[:3])
    bench.tick(400)
    shift = np.array(tool(bench)[:3]) - before
    assert shift @ z == pytest.approx(0.02 * 400 * DT, rel=0.05)
    assert np.linalg.norm(shift - (shift @ z) * z) < 1e-3
    bench.tick(400)
    assert bench.now.control_mode == ControlMode.POSITION
    assert np.abs(bench.now.target_qd).max() == 0.0
    assert not bench.errors
