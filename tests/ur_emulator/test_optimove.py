"""optimovej, optimovel, and moves of motion version 2: limited jerk, limits of the arm, the same path and end."""

import numpy as np
import pytest
from e_series_support import DT, ESeriesBench, program
from hypothesis import given
from hypothesis import strategies as st

from protocol.pose import rotvec_to_matrix
from ur_emulator.motion.speed_plan import Interval, SmoothPlan, plan

GOAL = "[0.6, -1.3, -1.6, -0.5, 1.2, 1.2]"
AHEAD = "pose_add(get_target_tcp_pose(), p[0, 0.25, 0, 0, 0, 0])"


def targets(*lines, limit=6000, **kwargs):
    """The joint targets of a run, cycle by cycle."""
    bench = ESeriesBench(fidelity="exact", **kwargs)
    bench.start(program(*lines))
    found = [bench.controller.state.motion.target]
    while bench.controller.programs.is_running and len(found) < limit:
        bench.tick()
        found.append(bench.controller.state.motion.target)
    assert not bench.errors
    return bench, np.array([target.q for target in found])


def derivatives(q):
    """Greatest speed, acceleration and jerk of any joint."""
    v = np.diff(q, axis=0) / DT
    a = np.diff(v, axis=0) / DT
    return tuple(float(np.abs(x).max()) for x in (v, a, np.diff(a, axis=0) / DT))


@given(
    st.floats(0.01, 3.0), st.floats(0.05, 2.0), st.floats(0.1, 5.0), st.floats(0.01, 2.0), st.floats(0.0, 1.0)
)
def test_a_smooth_plan_is_the_mean_of_a_plan_over_its_window(length, v, a, window, share):
    trapezoid = plan([Interval(length, v * v, ((a, 0.0),))], 0.0)
    smooth = SmoothPlan(trapezoid, window)
    assert smooth.duration == pytest.approx(trapezoid.duration + window)
    assert smooth.at(smooth.duration) == (length, 0.0)
    t = share * smooth.duration
    times = np.linspace(t - window, t, 2001)
    lengths = [trapezoid.at(max(0.0, x))[0] if x > 0.0 else 0.0 for x in times]
    mean = np.trapezoid(lengths, times) / window
    s, speed = smooth.at(t)
    assert s == pytest.approx(mean, abs=1e-5 * (1 + length))
    h = 1e-4 * smooth.duration
    if h < t < smooth.duration - h:
        assert speed == pytest.approx(
            (smooth.at(t + h)[0] - smooth.at(t - h)[0]) / (2 * h), abs=1e-3 * (1 + v)
        )


def test_optimovej_ends_exactly_and_has_no_steps_of_acceleration():
    bench, q = targets(f"optimovej({GOAL}, a=0.2, v=0.3)")
    assert tuple(bench.now.actual_q) == pytest.approx((0.6, -1.3, -1.6, -0.5, 1.2, 1.2), abs=1e-9)
    v, a, jerk = derivatives(q)
    assert v == pytest.approx(0.3 * 0.99 * np.pi, rel=0.01)
    assert jerk <= 1.05 * a / 0.1
    _, step = targets(f"movej({GOAL}, a={a}, v={v})")
    assert derivatives(step)[2] > 10 * jerk


def test_shares_scale_speed_and_acceleration():
    v, a = {}, {}
    for share in (0.1, 0.2):
        _, q = targets(f"optimovej({GOAL}, a={share}, v={share})")
        v[share], a[share], _ = derivatives(q)
    assert v[0.2] == pytest.approx(2 * v[0.1], rel=0.02)
    assert a[0.2] == pytest.approx(2 * a[0.1], rel=0.05)


def test_a_share_of_one_is_within_what_the_drives_have():
    bench = ESeriesBench(fidelity="ideal")
    bench.start(program("set_target_payload(5, [0, 0, 0.1])", f"optimovej({GOAL}, a=1, v=1)"))
    moments = np.array([bench.tick().target_moment for _ in range(600)])
    assert not bench.errors
    shares = np.abs(moments).max(axis=0) / bench.controller.state.robot.tau_max
    assert 0.5 < shares.max() < 1.0
    assert bench.now.target_q == pytest.approx((0.6, -1.3, -1.6, -0.5, 1.2, 1.2), abs=1e-9)


def test_optimovel_is_straight():
    bench, q = targets(f"optimovel({AHEAD}, a=0.2, v=0.3)")
    arm = bench.controller.state.arm
    poses = np.array([arm.fk(angles) for angles in (*q[::20], q[-1])])
    off = poses[:, :3] - poses[0, :3]
    assert np.abs(off[:, [0, 2]]).max() < 1e-6
    assert off[-1, 1] == pytest.approx(0.25, abs=1e-6)
    turns = [rotvec_to_matrix(pose[3:]) for pose in poses]
    assert max(np.abs(turn - turns[0]).max() for turn in turns) < 1e-6
    _, a, jerk = derivatives(q)
    assert jerk < 2.0 * a / 0.1


def test_jerk_gain_makes_the_ramps_longer():
    bench, q = targets(f"optimovej({GOAL}, a=0.2, v=0.3)", "global gain = jerk_gain_scaling_get()")
    assert bench["gain"] == 1.0
    _, slow = targets("jerk_gain_scaling_set(0.25)", f"optimovej({GOAL}, a=0.2, v=0.3)")
    assert derivatives(slow)[2] < 0.3 * derivatives(q)[2]
    assert len(slow) == len(q) + round(0.3 / DT)


@pytest.mark.parametrize("move", [f"movej({GOAL}, a=2, v=1)", f"movel({AHEAD}, a=0.5, v=0.2)"])
def test_motion_version_2_is_the_same_path_with_smooth_ramps(move):
    _, one = targets(move)
    bench, two = targets("motion_version_set(2)", move, "global version = motion_version_get()")
    assert bench["version"] == 2
    assert two[-1] == pytest.approx(one[-1], abs=1e-9)
    assert len(two) == len(one) + round(0.1 / DT)
    assert derivatives(two)[2] < 0.2 * derivatives(one)[2]
    assert derivatives(two)[0] == pytest.approx(derivatives(one)[0], rel=0.02)


def test_motion_version_2_keeps_a_given_time_and_clamps_what_is_too_fast():
    _, timed = targets("motion_version_set(2)", f"movej({GOAL}, t=2)")
    assert len(timed) == pytest.approx(2.0 / DT, abs=3)
    bench, fast = targets("motion_version_set(2)", f"movej({GOAL}, a=1000, v=100)")
    assert derivatives(fast)[0] < np.pi
    assert not bench.errors


def test_motion_version_is_1_again_for_a_program_that_was_loaded():
    bench = ESeriesBench(fidelity="exact")
    bench.run(program("motion_version_set(2)"))
    bench.run(program("global sent = motion_version_get()"))
    assert bench["sent"] == 2
    bench.start(program("global played = motion_version_get()"), loaded=True)
    bench.tick(3)
    assert bench["played"] == 1


def test_optimovej_blends_into_the_next_move():
    bench, q = targets(f"optimovej({GOAL}, a=0.2, v=0.3, r=0.05)", "movej([0.2, -1.7, -1.8, -0.3, 1.4, 1.7])")
    speeds = np.linalg.norm(np.diff(q, axis=0) / DT, axis=1)
    assert speeds[100 : len(speeds) - 200].min() > 0.01
    assert bench.now.target_q == pytest.approx((0.2, -1.7, -1.8, -0.3, 1.4, 1.7), abs=1e-9)
