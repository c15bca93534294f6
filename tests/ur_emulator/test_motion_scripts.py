"""Moves in scripts: when they return, what they refuse, their messages; and set_pos."""

import numpy as np
import pytest
from box_support import Bench

from protocol.pose import pose_trans
from protocol.ur_types import ProgramState, SafetyMode
from ur_emulator.commands.programs import SetSpeedSlider, StopProgram
from ur_emulator.controller.events import ErrorReported, ReportLevel, ScriptFailed
from ur_emulator.models.generations import CB3, E_SERIES
from ur_emulator.models.robots import robot_by_name

PLACE = "p[0.25,-0.25,0.25,2.2,-2.2,0]"
POSE = (0.25, -0.25, 0.25, 2.2, -2.2, 0.0)


@pytest.fixture
def bench():
    bench = Bench(fidelity="ideal")
    bench.run(f"movej({PLACE}, a=8, v=3)\n")
    bench.events.clear()
    bench.snapshots.clear()
    return bench


def shifted(x, y=0.0, z=0.0):
    return f"pose_add({PLACE},p[{x},{y},{z},0,0,0])"


def distances(bench):
    return np.linalg.norm(np.subtract([s.target_tcp_pose[:3] for s in bench.snapshots], POSE[:3]), axis=1)


def errors(bench):
    return [e for e in bench.events if isinstance(e, ErrorReported)]


def test_movel_goes_straight_and_takes_its_time(bench):
    bench.run(f"movel({shifted(0.1)})\n")
    assert bench.now.target_tcp_pose[:3] == pytest.approx((0.35, -0.25, 0.25), abs=1e-9)
    moving = sum(any(s.target_qd) for s in bench.snapshots)
    assert moving * 0.008 == pytest.approx(0.1 / 0.25 + 0.25 / 1.2, abs=0.02)
    path = np.array([s.target_tcp_pose for s in bench.snapshots])
    assert np.abs(path[:, 1:3] - POSE[1:3]).max() < 1e-9


def test_movel_takes_joint_positions_and_movej_a_pose(bench):
    q = list(bench.now.target_q)
    bench.run(f"def f():\n  movel({shifted(0.05)})\n  movel({q})\n  movej({shifted(0.05)})\nend\n")
    assert bench.now.target_tcp_pose[:3] == pytest.approx((0.30, -0.25, 0.25), abs=1e-9)
    assert distances(bench).min() < 1e-9


def test_moves_move_the_tool_centre_point(bench):
    bench.run(
        "def f():\n  set_tcp(p[0,0,0.1,0,0,0])\n  sync()\n  movel(pose_add(get_target_tcp_pose(),p[0.05,0,0,0,0,0]))\nend\n"
    )
    start = pose_trans(POSE, (0, 0, 0.1, 0, 0, 0))
    assert bench.now.target_tcp_pose[:3] == pytest.approx((start[0] + 0.05, *start[1:3]), abs=1e-9)


def test_a_movej_that_cannot_arrive_is_a_runtime_error_before_any_motion(bench):
    q = bench.now.target_q
    bench.run("def f():\n  sync()\n  movej(p[3,0,0,0,0,0])\nend\n")
    (failure,) = [e for e in bench.events if isinstance(e, ScriptFailed)]
    assert (failure.line, failure.column) == (3, 3)
    assert "Script function movej is unable to find an inverse kinematics solution" in failure.text
    assert bench.now.target_q == q


def test_a_movel_that_cannot_arrive_begins_and_ends_in_a_protective_stop(bench):
    bench.run(f"movel({shifted(0.9)})\n")
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    (error,) = errors(bench)
    assert error.level is ReportLevel.WARNING
    assert not [e for e in bench.events if isinstance(e, ScriptFailed)]
    assert distances(bench).max() > 0.05
    assert bench.now.target_qd == (0.0,) * 6


def test_a_blending_move_returns_before_its_waypoint_so_that_the_next_can_join(bench):
    said = bench.run(
        f"def f():\n  movel({shifted(0.1)}, r=0.02)\n  textmsg(get_target_tcp_pose()[0] < 0.345)\n"
        f"  movel({shifted(0.1, 0.1)})\nend\n"
    )
    assert said == ["True"]
    speeds = np.array([np.linalg.norm(s.target_tcp_speed[:3]) for s in bench.snapshots])
    moving = np.nonzero(speeds > 1e-6)[0]
    assert speeds[moving[0] + 25 : moving[-1] - 25].min() > 0.1
    corner = np.array((0.35, -0.25, 0.25))
    nearest = min(np.linalg.norm(np.subtract(s.target_tcp_pose[:3], corner)) for s in bench.snapshots)
    assert 0.001 < nearest < 0.02


def test_the_last_move_with_a_blend_stops_at_its_waypoint(bench):
    bench.run(f"movel({shifted(0.1)}, r=0.05)\n")
    assert bench.now.target_tcp_pose[:3] == pytest.approx((0.35, -0.25, 0.25), abs=1e-9)
    speed = np.array([s.target_tcp_speed[0] for s in bench.snapshots])
    assert np.abs(np.diff(speed)).max() <= 1.2 * 0.008 * 1.01


def test_a_program_that_waits_after_a_blending_move_comes_to_rest_at_the_waypoint(bench):
    bench.run(f"def f():\n  movel({shifted(0.1)}, r=0.03)\n  sleep(1)\n  movel({shifted(0.1, 0.05)})\nend\n")
    corner = np.array((0.35, -0.25, 0.25))
    assert min(np.linalg.norm(np.subtract(s.target_tcp_pose[:3], corner)) for s in bench.snapshots) < 1e-9


def test_overlapping_blends_are_reported_and_the_waypoint_is_left_out(bench):
    bench.run(
        f"def f():\n  movel({shifted(0.1)}, r=0.03)\n  movel({shifted(0.1, 0.04)}, r=0.03)\n"
        f"  movel({shifted(0.0, 0.1)})\nend\n"
    )
    assert [e.text for e in errors(bench)] == ["Overlapping Blends"]
    skipped = np.array((0.35, -0.21, 0.25))
    assert min(np.linalg.norm(np.subtract(s.target_tcp_pose[:3], skipped)) for s in bench.snapshots) > 0.02
    assert bench.now.target_tcp_pose[:3] == pytest.approx((0.25, -0.15, 0.25), abs=1e-9)


@pytest.mark.parametrize("late", [0, 2, 10, 20, 30, 40, 50])
def test_an_arc_behind_a_waypoint_that_overlaps_is_the_programmed_one_however_late_it_comes(bench, late):
    bench.run(
        f"def f():\n  movel({shifted(0.1)}, v=0.1, r=0.03)\n  movel({shifted(0.1, 0.04)}, v=0.1, r=0.03)\n  i = 0\n"
        f"  while i < {late}:\n    sync()\n    i = i + 1\n  end\n"
        f"  movec({shifted(0.13, 0.07)}, {shifted(0.1, 0.1)}, v=0.1)\nend\n"
    )
    assert [e.text for e in errors(bench)] == ["Overlapping Blends"]
    points = np.array([s.target_tcp_pose[:3] for s in bench.snapshots])
    assert points[-1] == pytest.approx((0.35, -0.15, 0.25), abs=1e-9)
    right = points[points[:, 1] > -0.19]
    assert np.linalg.norm(right - (0.35, -0.18, 0.25), axis=1) == pytest.approx(0.03, abs=1e-6)


def test_the_target_waypoint_stays_the_same_during_a_move(bench):
    said = bench.run(
        f"def f():\n  thread watch():\n    i = 0\n    while i < 4:\n      sleep(0.1)\n"
        f"      textmsg(pose_dist(get_target_waypoint(), {shifted(0.1)}) < 0.000001)\n      i = i + 1\n    end\n  end\n"
        f"  run watch()\n  movel({shifted(0.1)})\nend\n"
    )
    assert said == ["True"] * 4


def test_a_stopped_program_stops_a_move_abruptly(bench):
    bench.start(f"movel({shifted(0.1)})\n")
    bench.tick(30)
    bench.tick(1, StopProgram())
    bench.tick(20)
    assert bench.now.target_qd == (0.0,) * 6
    assert 0.005 < distances(bench)[-1] < 0.08
    assert bench.now.runtime_state == ProgramState.STOPPED


def test_a_move_after_a_stream_begins_at_rest(bench):
    bench.run(f"def f():\n  speedl([0.05,0,0,0,0,0], 0.5, 0.4)\n  movel({PLACE})\nend\n")
    assert bench.now.target_tcp_pose == pytest.approx(POSE, abs=1e-9)


def test_speedl_and_stopl_from_a_script(bench):
    bench.run("def f():\n  speedl([0.05,0.02,0,0,0,0.1], 0.5, 0.5)\n  stopl(0.5)\nend\n")
    twist = np.array([s.target_tcp_speed for s in bench.snapshots])
    assert np.abs(twist - (0.05, 0.02, 0, 0, 0, 0.1)).max(axis=1).min() < 2e-3
    assert bench.now.target_qd == (0.0,) * 6


def test_servoj_takes_one_cycle_a_call_and_keeps_to_names(bench):
    bench.start(
        "def f():\n  q = get_target_joint_positions()\n  i = 0\n  while i < 50:\n    q[0] = q[0] + 0.002\n"
        "    servoj(q, t=get_steptime(), lookahead_time=0.1, gain=300)\n    i = i + 1\n  end\n  textmsg(i)\n  stopj(4)\nend\n"
    )
    bench.tick(50)
    assert [e.text for e in bench.events if type(e).__name__ == "TextPrinted"] == ["50"]


def test_servoc_may_be_called_with_the_same_pose_all_the_time(bench):
    bench.start(f"def f():\n  while True:\n    servoc({shifted(0.1)}, 1.2, 0.25, 0.02)\n  end\nend\n")
    bench.tick(150)
    assert bench.now.target_tcp_pose[:3] == pytest.approx((0.35, -0.25, 0.25), abs=1e-9)
    assert bench.now.runtime_state == ProgramState.PLAYING
    assert not bench.events[1:]


@pytest.mark.parametrize(("robot", "generation"), [("ur3", CB3), ("ur5", CB3), ("ur5e", E_SERIES)])
@pytest.mark.parametrize("r", [0.0, 0.05])
def test_a_duration_that_the_arm_cannot_keep_is_made_longer(robot, generation, r):
    """As the maker's live tests ask: no stop."""
    bench = Bench(robot=robot, generation=generation)
    bench.run("movej([-1.57,-1.57,0,-1.57,1.57,0], t=4)\n")
    bench.run(
        f"def f():\n  movej([1.57,-1.57,0,-1.57,1.57,0], t=0.1, r={r})\n  movej([1.2,-1.4,-1.9,-1.4,1.57,0], t=0.1)\n"
        "  p = get_target_tcp_pose()\n  p[2] = p[2] - 0.1\n  movel(p, t=0.05)\nend\n"
    )
    assert not errors(bench)
    assert bench.now.safety_mode == SafetyMode.NORMAL
    assert bench.now.target_q[0] == pytest.approx(1.2, abs=0.05)
    fastest = max(max(map(abs, s.target_qd)) for s in bench.snapshots)
    qd_max = robot_by_name(robot).qd_max
    assert 0.9 * qd_max[0] < fastest <= max(qd_max)


def test_an_absurd_duration_is_just_slow(bench):
    bench.start(f"movel({shifted(0.1)}, t=1e15)\n")
    bench.tick(20)
    assert bench.now.runtime_state == ProgramState.PLAYING
    assert distances(bench).max() < 1e-9


def test_a_chain_of_all_kinds_of_moves_never_rests_between(bench):
    bench.run(
        f"def f():\n  movej({shifted(0.08)}, r=0.02)\n  movel({shifted(0.08, 0.08)}, r=0.02)\n"
        f"  movep({shifted(0.0, 0.08)}, r=0.02)\n  movec({shifted(-0.04, 0.04)}, {shifted(0.0, 0.0)}, r=0.02)\n"
        f"  movej({shifted(0.05)})\nend\n"
    )
    assert not errors(bench)
    moving = [k for k, s in enumerate(bench.snapshots) if any(s.target_qd)]
    assert moving == list(range(moving[0], moving[-1] + 1))
    speed = np.array([np.linalg.norm(s.target_tcp_speed[:3]) for s in bench.snapshots])
    assert speed[moving[0] + 40 : moving[-1] - 30].min() > 0.05
    assert bench.now.target_tcp_pose[:3] == pytest.approx((0.30, -0.25, 0.25), abs=1e-9)


@pytest.mark.parametrize(
    "call", ["movel({p}, v=0)", "movep({p}, a=-1)", "movej({p}, r=-0.1)", "movel({p}, t=-1)", "stopl(0)"]
)
def test_senseless_limits_are_runtime_errors(bench, call):
    bench.run(call.format(p=PLACE) + "\n")
    assert [e for e in bench.events if isinstance(e, ScriptFailed)]


def test_the_speed_slider_is_taken_on_without_a_jump(bench):
    bench.start(f"movel({shifted(0.1)}, v=0.1)\n")
    bench.tick(40)
    bench.tick(1, SetSpeedSlider(0.1))
    bench.tick(60)
    speed = np.array([s.target_tcp_speed[0] for s in bench.snapshots])
    assert speed[-1] == pytest.approx(0.01, abs=1e-6)
    assert np.abs(np.diff(speed)).max() <= 1.2 * 0.008 * 1.01


@pytest.mark.parametrize("slider", [0.25, 0.3, 1.0])
@pytest.mark.parametrize("generation", [CB3, E_SERIES])
def test_a_spline_of_short_speedj_keeps_its_path_at_any_speed(slider, generation):
    """As the maker's driver script streams splines; its live test sets 25 %."""
    bench = Bench(fidelity="exact", generation=generation)
    bench.tick(1, SetSpeedSlider(slider))
    bench.tick(200)
    bench.snapshots.clear()
    bench.run(
        "def spline():\n  qd = [0,0,0,0,0,0]\n  k = 0\n  dt = get_steptime()\n  while k * dt < 1:\n    k = k + 1\n"
        "    s = k * dt\n    last = qd[5]\n    qd[5] = 12 * s * (1 - s) * (1 - 2 * s)\n"
        "    write_output_float_register(1, s)\n    speedj(qd, norm(qd[5] - last) / dt, dt)\n  end\nend\n"
    )
    start = bench.snapshots[0].target_q[5]
    assert bench.now.target_q[5] == pytest.approx(start, abs=2e-3)
    rows = [(s.registers.output_floats[1], s.target_q[5] - start) for s in bench.snapshots]
    assert max(q for _, q in rows) == pytest.approx(6 * 0.0625, abs=2e-3)
    # The register is ahead of the target by at most one call.
    dt = bench.controller.period_s
    assert (
        max(min(abs(q - 6 * (x * (1 - x)) ** 2) for x in (s, s - 0.5 * dt, s - dt)) for s, q in rows) < 5e-3
    )


ELSEWHERE = [0.5, -1.2, -1.5, -1.0, 1.2, 0.4]


def failures(bench):
    return [e.text for e in bench.events if isinstance(e, ScriptFailed)]


def test_the_arm_is_where_it_was_put_and_moves_on_from_there():
    bench = Bench()
    said = bench.run(
        f"def f():\n  set_pos({ELSEWHERE})\n  textmsg(get_target_joint_positions() == {ELSEWHERE})\n  sync()\n"
        f"  textmsg(norm(get_actual_joint_positions()[0] - 0.5) < 0.001)\n  movej({[0.6, *ELSEWHERE[1:]]})\nend\n"
    )
    assert not failures(bench)
    assert said == ["True", "True"]
    assert bench.now.actual_q == pytest.approx([0.6, *ELSEWHERE[1:]], abs=2e-3)
    assert max(abs(x) for s in bench.snapshots for x in s.actual_qd) < 1.2


@pytest.mark.parametrize(
    ("q", "word"),
    [
        ([7.0, -1.2, -1.5, -1.0, 1.2, 0.4], "joint 0"),
        ([0.0, 1.2, 0.0, 0.0, 0.0, 0.0], "touch"),
    ],
)
def test_where_no_arm_can_be(q, word):
    bench = Bench()
    before = bench.now.target_q
    bench.run(f"def f():\n  set_pos({q})\nend\n")
    (text,) = failures(bench)
    assert word in text
    assert bench.now.target_q == before


def test_not_while_the_arm_moves():
    bench = Bench()
    bench.start(
        f"def f():\n  thread t():\n    movej({ELSEWHERE})\n  end\n  run t()\n  sleep(0.2)\n  set_pos({ELSEWHERE})\nend\n"
    )
    bench.tick(60)
    (text,) = failures(bench)
    assert "moves" in text
    assert max(abs(x) for s in bench.snapshots for x in s.target_qd) < 1.2
