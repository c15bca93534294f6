"""How moves are planned: optimovej, optimovel, motion version 2, and tool_wrench_limit_set.

Jerk and the arm's limits are kept on the same path, and what the payload feels stays below its limits.
"""

import numpy as np
import pytest
from box_support import Bench
from e_series_support import DT, ESeriesBench, program
from hypothesis import given
from hypothesis import strategies as st

from protocol.pose import rotvec_to_matrix
from ur_emulator.machine.models.generations import E_SERIES
from ur_emulator.machine.motion.speed_plan import Interval, SmoothPlan, plan
from urscript import compile_program
from urscript.catalogue import catalogue_for

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
    bench = ESeriesBench(fidelity="exact")
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


def test_optimovej_blends_into_the_next_move():
    bench, q = targets(f"optimovej({GOAL}, a=0.2, v=0.3, r=0.05)", "movej([0.2, -1.7, -1.8, -0.3, 1.4, 1.7])")
    speeds = np.linalg.norm(np.diff(q, axis=0) / DT, axis=1)
    assert speeds[100 : len(speeds) - 200].min() > 0.01
    assert bench.now.target_q == pytest.approx((0.2, -1.7, -1.8, -0.3, 1.4, 1.7), abs=1e-9)


MASS, COG = 2.0, (0.01, 0.02, 0.1)
INERTIA = np.diag([0.01, 0.02, 0.03])
PAYLOAD = f"  set_target_payload({MASS}, {list(COG)}, [0.01, 0.02, 0.03, 0, 0, 0])\n"
THERE = "pose_trans(get_target_tcp_pose(), p[0.1, 0.05, 0.1, 0.3, 0, 0])"
MOVES = {
    "movej": "movej(get_inverse_kin({there}), a=20, v=3)",
    "movel": "movel({there}, a=5, v=1)",
    "movel in a time": "movel({there}, t=0.4)",
    "movep": "movep({there}, a=5, v=1)",
    "movec": "movec(pose_trans(get_target_tcp_pose(), p[0.1, 0, 0, 0, 0, 0]), {there}, a=5, v=1)",
    "optimovel": "optimovel({there}, a=1, v=1)",
    "motion version 2": "motion_version_set(2)\n  movel({there}, a=5, v=1)",
}


def wrenches(move, limit=""):
    """Run a move; return the wrench of motion at the centre of gravity in flange axes, a row for each cycle."""
    bench = Bench(fidelity="exact", robot="ur5e", generation=E_SERIES)
    text = f"def p():\n{PAYLOAD}{limit}  {MOVES[move].format(there=THERE)}\nend\n"
    bench.controller.programs.start(compile_program(text, catalogue=catalogue_for("5.25")))
    while bench.controller.programs.has_work:
        bench.tick()
    bench.tick(5)
    arm = bench.controller.state.arm
    rows = []
    for snapshot in bench.snapshots:
        pose = arm.fk(snapshot.target_q)
        moving = arm.state(snapshot.target_q, snapshot.target_qd).tcp_speed
        rows.append((pose, moving))
    turns = [rotvec_to_matrix(pose[3:]) for pose, _ in rows]
    spins = np.array([turn.T @ moving[3:] for turn, (_, moving) in zip(turns, rows, strict=True)])
    # Of the centre of gravity, in base axes.
    speeds = np.array(
        [
            np.array(moving[:3]) + np.cross(moving[3:], turn @ COG)
            for turn, (_, moving) in zip(turns, rows, strict=True)
        ]
    )
    accelerations = np.diff(speeds, axis=0) / E_SERIES.period_s
    forces = MASS * np.array([turn.T @ a for turn, a in zip(turns[1:], accelerations, strict=True)])
    momenta = spins @ INERTIA
    torques = np.diff(momenta, axis=0) / E_SERIES.period_s + np.cross(spins[1:], momenta[1:])
    assert np.abs(speeds).max() > 0.02  # it has moved
    assert np.abs(speeds[-1]).max() < 1e-9
    return np.concatenate([forces, torques], axis=1)


@pytest.mark.parametrize("move", MOVES)
def test_a_move_keeps_the_limits_in_their_frame(move):
    most = [3.0, 2.0, 4.0, 0.02, 0.05, 0.05]
    names = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
    frame = f"p[{COG[0]}, {COG[1]}, {COG[2]}, 0, 0, 0]"
    given = ", ".join(f"{name}={value}" for name, value in zip(names, most, strict=True))
    free = np.abs(wrenches(move)).max(axis=0)
    kept = np.abs(wrenches(move, f"  tool_wrench_limit_set({frame}, {given})\n")).max(axis=0)
    assert (free > most).any()
    assert (kept <= 1.05 * np.array(most)).all()
    # It is not slower than it must be by much: some axis uses half of its limit.
    assert (kept / most).max() > 0.4


def test_axes_without_a_limit_are_free():
    free = wrenches("movel")
    assert np.array_equal(wrenches("movel", "  tool_wrench_limit_set(p[0, 0, 0, 0, 0, 0], Fx=1000)\n"), free)
