"""Path offset: the tool is displaced from its path in each of the frames, within limits and through a filter."""

from math import exp

import numpy as np
import pytest
from e_series_support import DT, ESeriesBench, program

from protocol.pose import pose_add, pose_inv, pose_sub, pose_trans, rotvec_to_matrix

FILTER = "path_offset_set_alpha_filter(0.01)"
OFFSET = (0.02, -0.01, 0.03, 0.05, 0.02, -0.04)


def settled(kind, *more, offset=OFFSET, at_rest=True):
    """A resting arm after an offset: the bench, the path's pose and the target's."""
    bench = ESeriesBench(fidelity="exact")
    path = bench.now.target_tcp_pose
    bench.start(
        program(
            "path_offset_enable()",
            FILTER,
            *more,
            f"path_offset_set({list(offset)}, {kind})",
            "sleep(3)",
            *(f"global in_{frame} = path_offset_get({frame})" for frame in (1, 2, 3, 4)),
            "sync()",
            "path_offset_disable()",
            "sleep(0.5)",
        )
    )
    bench.tick(1500)
    assert not bench.errors
    return bench, path, bench.now.target_tcp_pose


@pytest.mark.parametrize(
    ("kind", "displaced"),
    [
        (1, lambda path: pose_add(OFFSET, path)),
        (2, lambda path: pose_trans(path, OFFSET)),
        (4, lambda path: pose_trans(pose_inv(OFFSET), path)),
    ],
)
def test_frames(kind, displaced):
    bench, path, target = settled(kind)
    assert target == pytest.approx(displaced(path), abs=1e-6)
    bench.tick(100)
    assert tuple(bench[f"in_{kind}"]) == pytest.approx(OFFSET, abs=1e-6)
    assert tuple(bench["in_1"]) == pytest.approx(pose_sub(target, path), abs=1e-6)
    assert tuple(bench["in_2"]) == pytest.approx(pose_trans(pose_inv(path), target), abs=1e-6)


def test_a_resting_arm_has_the_tool_as_motion_frame():
    _, path, target = settled(3)
    turn = rotvec_to_matrix(path[3:])
    assert np.array(target[:3]) - path[:3] == pytest.approx(turn @ OFFSET[:3], abs=1e-6)


def test_the_motion_frame_follows_the_path():
    bench = ESeriesBench(fidelity="exact")
    start = np.array(bench.now.target_tcp_pose)
    side = np.cross([1.0, 0.0, 0.0], rotvec_to_matrix(start[3:])[:, 2])
    side /= np.linalg.norm(side)
    bench.start(
        program(
            "path_offset_enable()",
            FILTER,
            "path_offset_set([0, 0.02, 0, 0, 0, 0], 3)",
            "movel(pose_add(get_target_tcp_pose(), p[0.1, 0, 0, 0, 0, 0]), a=0.5, v=0.02)",
        )
    )
    bench.tick(2000)
    assert not bench.errors
    off = np.array(bench.now.target_tcp_pose[:3]) - start[:3]
    assert off[0] == pytest.approx(np.dot(off, [1, 0, 0]), abs=1e-9)
    assert off - [off[0] - 0.02 * side[0], 0, 0] == pytest.approx(0.02 * side, abs=1e-4)


def test_limits_and_filter():
    bench = ESeriesBench(fidelity="exact")
    start = bench.now.target_tcp_pose[2]
    bench.start(
        program(
            "path_offset_enable()",
            "path_offset_set_max_offset(0.01, 0.1)",
            "path_offset_set_alpha_filter(0.02)",
            "path_offset_set([0, 0, 0.05, 0, 0, 0], 1)",
            "sleep(2)",
        )
    )
    bench.tick(100)
    # 1 - 0.98^n of the way after n cycles.
    n = round(np.log(1 - (bench.now.target_tcp_pose[2] - start) / 0.01) / np.log(0.98))
    assert n in (98, 99, 100, 101)
    assert 1 - 0.98**n == pytest.approx(1 - exp(-0.02 * n), abs=0.01)
    bench.tick(800)
    assert bench.now.target_tcp_pose[2] - start == pytest.approx(0.01, abs=1e-6)


def test_a_sudden_offset_is_a_protective_stop():
    bench = ESeriesBench(fidelity="exact")
    bench.start(program("path_offset_enable()", "path_offset_set([0, 0, 0.05, 0, 0, 0], 1)", "sleep(1)"))
    bench.tick(20)
    assert bench.errors[0][0] == 204


def test_a_weave_of_a_thread_lies_on_a_move():
    """The manual's example: 2 Hz, 5 mm, along z of the base."""
    bench = ESeriesBench(fidelity="typical")
    start = np.array(bench.now.target_tcp_pose)
    bench.start(
        program(
            "path_offset_enable()",
            "global p = 0.0",
            "thread weave():",
            "  while True:",
            "    path_offset_set([0, 0, 0.005 * (cos(p) - 1), 0, 0, 0], 1)",
            "    p = p + 4 * 3.14159265 / 500",
            "    sync()",
            "  end",
            "end",
            "weaving = run weave()",
            "movel(pose_add(get_target_tcp_pose(), p[0, 0.1, 0, 0, 0, 0]), a=0.5, v=0.05)",
            "kill weaving",
            "path_offset_disable()",
        )
    )
    poses = np.array([bench.tick().target_tcp_pose for _ in range(900)])
    assert not bench.errors
    z = poses[:, 2] - start[2]
    assert z.min() == pytest.approx(-0.01, abs=2e-4)
    assert z.max() == pytest.approx(0.0, abs=2e-4)
    spectrum = np.abs(np.fft.rfft(z - z.mean()))
    assert np.argmax(spectrum) * 1.0 / (len(z) * DT) == pytest.approx(2.0, abs=0.6)
    assert poses[-1, 1] - start[1] > 0.08
    assert np.abs(poses[:, 0] - start[0]).max() < 1e-6


def test_the_end_of_a_program_ends_it_and_the_arm_stays():
    bench = ESeriesBench(fidelity="exact")
    bench.run(program("path_offset_enable()", FILTER, f"path_offset_set({list(OFFSET)}, 1)", "sleep(2)"))
    assert not bench.errors
    before = bench.now.target_q
    bench.run(program("global off = path_offset_get(1)", "sleep(0.1)"))
    assert tuple(bench["off"]) == (0.0,) * 6
    assert bench.now.target_q == before
