"""Speed plans: as fast as the limits allow, never faster, and able to stop."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ur_emulator.motion.speed_plan import Interval, plan, stopping_curve

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
