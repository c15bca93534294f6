"""Paths of the tool as geometry, and the fastest speed plans on them that are able to stop."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from motion_support import START, at, line

from protocol.pose import pose_sub
from ur_emulator.machine.motion.blend import blend
from ur_emulator.machine.motion.path import TURN_LEVER, PoseArc, PoseLine, arc_through
from ur_emulator.machine.motion.speed_plan import Interval, plan, stopping_curve

coordinates = st.floats(-0.5, 0.5)
turns = st.floats(-1.0, 1.0)
poses = st.tuples(coordinates, coordinates, coordinates, turns, turns, turns)


def derivative(path, s, h=1e-6):
    return [x / (2 * h) for x in pose_sub(path.at(s + h)[0], path.at(s - h)[0])]


def check_derivatives(path):
    for k in range(1, 8):
        s = path.length * k / 8
        assert path.at(s)[1] == pytest.approx(derivative(path, s), abs=1e-5)


@given(poses, poses)
def test_a_line_is_straight_ends_exactly_and_knows_its_derivative(start, goal):
    path = PoseLine(start, goal)
    assume(path.length > 0.02)
    assert path.at(path.length)[0] == goal
    assert path.at(0.0)[0] == pytest.approx(start, abs=1e-12)
    middle = path.at(path.length / 2)[0]
    assert middle[:3] == pytest.approx([(a + b) / 2 for a, b in zip(start[:3], goal[:3], strict=True)])
    check_derivatives(path)


def test_a_turn_on_the_spot_has_a_length():
    path = PoseLine((0.1, 0.2, 0.3, 0, 0, 0), (0.1, 0.2, 0.3, 0, 0, 1.0))
    assert path.length == pytest.approx(TURN_LEVER)
    assert path.at(path.length / 2)[0] == pytest.approx((0.1, 0.2, 0.3, 0, 0, 0.5))


@given(poses, poses, poses, st.booleans())
def test_an_arc_is_a_circle_through_its_three_points(start, via, goal, fixed):
    a, b, c = (np.array(p[:3]) for p in (start, via, goal))
    cross = np.linalg.norm(np.cross(b - a, c - a))
    assume(min(np.linalg.norm(x) for x in (b - a, c - b, c - a)) > 0.05)
    assume(cross > 0.1 * np.linalg.norm(b - a) * np.linalg.norm(c - a))
    path = arc_through(start, via, goal, fixed=fixed)
    assert isinstance(path, PoseArc)
    assert path.at(0.0)[0] == pytest.approx(start, abs=1e-9)
    assert path.at(path.length)[0][:3] == pytest.approx(goal[:3], abs=1e-9)
    if not fixed:
        assert path.at(path.length)[0] == goal
    points = np.array([path.at(path.length * k / 500)[0][:3] for k in range(501)])
    assert np.linalg.norm(points - b, axis=1).min() <= 1.01 * np.linalg.norm(points[1] - points[0])
    check_derivatives(path)


def test_mode_1_keeps_the_orientation_to_the_tangent():
    start = (1.0, 0.0, 0.0, 0.3, 0.0, 0.0)
    path = arc_through(start, (math.sqrt(0.5), math.sqrt(0.5), 0, 0, 0, 0), (0, 1, 0, 9, 9, 9), fixed=True)
    assert path.length == pytest.approx(math.pi / 2)
    quarter = pose_sub(path.at(path.length)[0], start)
    assert quarter[3:] == pytest.approx((0, 0, math.pi / 2))


def test_an_arc_may_be_longer_than_half_a_circle():
    path = arc_through((1, 0, 0, 0, 0, 0), (-1, 0, 0, 0, 0, 0), (0, -1, 0, 0, 0, 0), fixed=False)
    assert path.length == pytest.approx(1.5 * math.pi)


def test_three_points_on_a_line_give_a_line():
    path = arc_through((0, 0, 0, 0, 0, 0), (0.1, 0, 0, 0, 0, 0), (0.3, 0, 0, 0, 0, 1), fixed=False)
    assert isinstance(path, PoseLine)
    assert path.at(path.length)[0] == (0.3, 0, 0, 0, 0, 1)


@pytest.mark.parametrize("twin", [(0, 1), (1, 2), (0, 2)])
def test_points_that_differ_by_rounding_only_give_a_line(twin):
    points = [(0, 0, 0, 0, 0, 0), (0.1, 0.1, 0, 0, 0, 0), (0.2, 0, 0, 0, 0, 1)]
    points[twin[1]] = (points[twin[0]][0], points[twin[0]][1] + 1e-12, *points[twin[1]][2:])
    path = arc_through(*points, fixed=False)
    assert isinstance(path, PoseLine)
    assert path.at(path.length)[0] == points[2]


@given(
    st.tuples(*[st.floats(-0.08, 0.08)] * 3, *[st.floats(-0.4, 0.4)] * 3),
    st.tuples(*[st.floats(-0.08, 0.08)] * 3, *[st.floats(-0.4, 0.4)] * 3),
    st.floats(0.005, 0.03),
    st.booleans(),
)
def test_a_blend_stays_within_r_of_the_waypoint_and_is_tangent_to_both_moves(one, two, r, process):
    corner = at(*one)
    assume(math.dist(one[:3], (0, 0, 0)) > 0.02)
    assume(math.dist(one[:3], two[:3]) > 0.02)
    first, second = line(START, corner, process=process), line(corner, at(*two), process=process)
    found = blend(first, second, r, 0.5 * first.path.length)
    curve = found.path.path
    assert all(
        math.dist(curve.at(curve.length * k / 50)[0][:3], corner[:3]) <= r * (1 + 1e-9) for k in range(51)
    )
    start, slope = curve.at(0.0)
    end, end_slope = curve.at(curve.length)
    assert pose_sub(start, first.path.path.at(found.leave)[0]) == pytest.approx([0] * 6, abs=1e-9)
    assert pose_sub(end, second.path.path.at(found.enter)[0]) == pytest.approx([0] * 6, abs=1e-9)
    assert slope == pytest.approx(first.path.path.at(found.leave)[1], abs=1e-7)
    ratio = 1.0 / found.scale
    assert end_slope == pytest.approx([ratio * x for x in second.path.path.at(found.enter)[1]], abs=1e-7)
    check_derivatives(curve)


lengths = st.floats(1e-4, 1.0)
speeds = st.floats(1e-2, 3.0)
accelerations = st.floats(0.05, 40.0)


@st.composite
def intervals(draw):
    """Intervals whose bends never need more acceleration than the limit."""
    found = []
    for _ in range(draw(st.integers(1, 8))):
        a = draw(accelerations)
        b = draw(st.sampled_from([0.0, 0.0, 1.0, 10.0, 100.0]))
        cap = draw(speeds) ** 2
        found.append(Interval(draw(lengths), min(cap, a / b) if b else cap, ((a, b),)))
    return found


def interval_at(parts, s):
    for part in parts:
        if s <= part.length:
            return part
        s -= part.length
    return parts[-1]


@given(lengths, speeds, accelerations)
def test_one_straight_part_is_the_trapezoid(length, v, a):
    found = plan([Interval(length, v * v, ((a, 0.0),))], 0.0)
    top = min(v, math.sqrt(a * length))
    assert found.duration == pytest.approx(length / top + top / a, rel=1e-9)
    ramp = top / a
    assert found.at(0.5 * ramp) == pytest.approx((a * ramp**2 / 8, 0.5 * top), rel=1e-6)
    assert found.at(found.duration / 2) == pytest.approx((length / 2, top), rel=1e-6)
    assert found.at(found.duration - 0.5 * ramp) == pytest.approx(
        (length - a * ramp**2 / 8, 0.5 * top), rel=1e-6
    )


@given(intervals())
def test_no_limit_is_exceeded_and_the_end_is_reached_at_rest(parts):
    found = plan(parts, 0.0)
    total = math.fsum(part.length for part in parts)
    before, v_before = 0.0, 0.0
    steps = 400
    dt = found.duration / steps
    for k in range(1, steps + 1):
        s, v = found.at(k * dt)
        assert s >= before
        assert abs(s - before - 0.5 * dt * (v + v_before)) <= 0.25 * dt * abs(v - v_before) + 40 * dt * dt
        before, v_before = s, v
    assert found.at(found.duration) == (pytest.approx(total), 0.0)
    for (s, v, a), t, after in zip(
        found.phases, found.times, (*found.times[1:], found.duration), strict=True
    ):
        part = interval_at(parts, s + 0.5 * (found.at(after)[0] - s))
        w = v + a * (after - t)
        z = max(v, w) ** 2
        assert z <= part.cap * (1 + 1e-6)
        for bound, bend in part.bounds:
            assert abs(a) <= (bound - bend * z) * (1 + 1e-6) + 1e-6 * bound


@given(intervals())
def test_speed_is_continuous_from_segment_to_segment(parts):
    found = plan(parts, 0.0)
    for k, t in enumerate(found.times[1:], 1):
        s, v, a = found.phases[k - 1]
        dt = t - found.times[k - 1]
        assert v + a * dt == pytest.approx(found.phases[k].v, rel=1e-6, abs=1e-7)
        assert s + (v + 0.5 * a * dt) * dt == pytest.approx(found.phases[k].s, rel=1e-9, abs=1e-9)


@given(intervals(), st.floats(0.0, 1.0), intervals())
def test_what_can_stop_can_go_on_whatever_follows(parts, share, following):
    """The promise that blends rest on: below the curve, any continuation behind the point has a plan."""
    total = math.fsum(part.length for part in parts)
    found = plan(parts, 0.0)
    stop = 0.9 * total
    curve = stopping_curve(parts, stop)
    t = share * found.duration
    s, v = found.at(t)
    if s >= stop or not curve.can_stop(s, v):
        return
    rest, way = [], s
    for part in parts:
        if way < part.length:
            rest.append(part._replace(length=part.length - way))
            way = 0.0
        else:
            way -= part.length
    left, kept = stop - s, []
    for part in rest:
        if left > 0.0:
            kept.append(part._replace(length=min(part.length, left)))
            left -= part.length
    assert plan([*kept, *following], v) is not None


def test_too_fast_for_what_follows_is_no_plan():
    slow = Interval(0.1, 0.01, ((1.0, 0.0),))
    assert plan([slow], 0.2) is None
    assert plan([Interval(0.001, 1.0, ((1.0, 0.0),)), slow], 0.5) is None
    assert plan([slow], 0.1) is not None


def test_a_path_without_length_takes_no_time():
    found = plan([], 0.0)
    assert found.duration == 0.0
    assert found.at(1.0) == (0.0, 0.0)
