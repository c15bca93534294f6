import pytest
from hypothesis import given
from hypothesis import strategies as st

from ur_emulator.motion.profile import Trapezoid

distances = st.floats(1e-4, 10.0)
speeds = st.floats(1e-2, 5.0)
accelerations = st.floats(1e-2, 50.0)


@given(distances, speeds, accelerations)
def test_limits_are_kept_and_the_end_is_reached(distance, speed, acceleration):
    profile = Trapezoid.from_limits(distance, speed, acceleration)
    before = 0.0
    for k in range(101):
        s, sd, sdd = profile.at(profile.duration * k / 100)
        assert sd <= speed * (1 + 1e-9)
        assert abs(sdd) <= acceleration * (1 + 1e-9)
        assert s >= before - 1e-12
        before = s
    assert profile.at(profile.duration) == (distance, 0.0, 0.0)


@given(distances, speeds, accelerations)
def test_duration_is_the_documented_one(distance, speed, acceleration):
    profile = Trapezoid.from_limits(distance, speed, acceleration)
    if distance * acceleration >= speed * speed:
        assert profile.duration == pytest.approx(distance / speed + speed / acceleration)
    else:
        assert profile.duration == pytest.approx(2 * (distance / acceleration) ** 0.5)


@given(distances, speeds, accelerations, st.floats(0.1, 20.0))
def test_a_given_time_is_kept_exactly(distance, speed, acceleration, duration):
    like = Trapezoid.from_limits(distance, speed, acceleration)
    profile = Trapezoid.from_duration(distance, duration, like)
    assert profile.duration == duration
    assert profile.at(duration * (1 - 1e-9))[0] == pytest.approx(distance)
    assert profile.at(duration / 2)[0] == pytest.approx(distance / 2)


def test_velocity_is_the_derivative_of_the_travel():
    profile = Trapezoid.from_limits(1.0, 0.5, 0.8)
    step = 1e-5
    for k in range(1, 100):
        t = profile.duration * k / 100
        slope = (profile.at(t + step)[0] - profile.at(t - step)[0]) / (2 * step)
        assert slope == pytest.approx(profile.at(t)[1], abs=1e-4)


@pytest.mark.parametrize(
    ("speed", "acceleration"), [(0.0, 1.0), (1.0, 0.0), (-1.0, 1.0), (float("nan"), 1.0)]
)
def test_limits_must_be_positive(speed, acceleration):
    with pytest.raises(ValueError, match="above 0"):
        Trapezoid.from_limits(1.0, speed, acceleration)
