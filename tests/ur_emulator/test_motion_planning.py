"""How moves are planned, beside what chunks show (`chunks/watched/planning.script`): smooth plans, tool_wrench_limit_set.

Jerk and the arm's limits are kept on the same path, and what the payload feels stays below its limits.
"""

import numpy as np
import pytest
from box_support import Bench
from hypothesis import given
from hypothesis import strategies as st

from protocol.pose import rotvec_to_matrix
from ur_emulator.machine.models.generations import E_SERIES
from ur_emulator.machine.motion.speed_plan import Interval, SmoothPlan, plan
from urscript import compile_program
from urscript.catalogue import catalogue_for


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
