"""Trajectories in closed form: lognormal strokes, minimum jerk, the robot-like profile, the two-thirds power law.

What holds for all of them, then each for itself. test_docs_figures.py has the figures of docs/theory.md.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson, quad, simpson
from scipy.spatial.transform import Rotation
from scipy.special import ndtr

from pc_client.errors import MovementError
from pc_client.movements.lognormal import LiteralTiming, Lognormal, TwoSidedTiming, lead_from_k, sigma_for_k
from pc_client.movements.minimum_jerk import MinimumJerk, stroke_shape
from pc_client.movements.power_law import TORSION_EXPONENT, TWO_THIRDS, PowerLaw, SmoothPath
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke, sinc
from pc_client.movements.trajectory import Similarity, Trajectory
from pc_client.movements.uniform import CornerPath, SmoothedSquareWave, Uniform
from pc_client.studies.likeness import fit_power_law

CASE_A = Lognormal(0.0, -1.6, 0.25)
LOGNORMAL = Lognormal(0.1, -1.6, 0.25)
A, B = (0.25, -0.1, 0.2), (0.35, 0.1, 0.3)
FIVE_POINTS = np.array(
    [[0.3, 0.0, 0.2], [0.4, 0.1, 0.3], [0.3, 0.15, 0.2], [0.35, -0.05, 0.25], [0.3, 0.0, 0.3]]
)
POINTS = FIVE_POINTS[:4]
DURATIONS = np.array([1.7, 1.3, 2.2])
EDGES = np.concatenate(([0.0], np.cumsum(DURATIONS)))
RAMPS = (0.3, 0.2)


def two_strokes(arc_angle: float) -> SigmaLognormal:
    strokes = (
        Stroke(TwoSidedTiming(0.1, 1.0, 0.15), arc_angle, 0.4),
        Stroke(TwoSidedTiming(0.6, 1.3, 0.22), -arc_angle, 2.0),
    )
    return SigmaLognormal(np.array([A, B, (0.3, 0.0, 0.15)]), strokes, 2.0)


STROKES = [two_strokes(arc_angle) for arc_angle in (0.0, 1e-12, 0.9, -1.7)]
STOP, VIA = (MinimumJerk(POINTS, DURATIONS, passing) for passing in ("stop", "via"))
UNIFORM = [
    Uniform(POINTS, DURATIONS, (0.2,)),
    Uniform(POINTS, DURATIONS, (0.2, 0.1)),
    Uniform(POINTS, DURATIONS, (0.1, 0.2), "blend", 0.03),
    Uniform(POINTS, DURATIONS, (0.25,), "blend", 0.02),
]
PLANE = PowerLaw(FIVE_POINTS, 6.0, RAMPS, 1.0)
SPACE = PowerLaw(FIVE_POINTS, 6.0, RAMPS, 1.0, TWO_THIRDS, TORSION_EXPONENT)
POWER_LAWS = [PLANE, SPACE, PowerLaw(POINTS[:2], 1.0, (0.3,), 0.1)]
#: With the tolerances of velocity [m/s] and acceleration [m/s^2] against differences over 2e-6 s.
FAMILIES: list[tuple[list[Trajectory], float, float]] = [
    (STROKES, 1e-8, 1e-7),
    ([STOP, VIA], 1e-8, 1e-5),
    (UNIFORM, 2e-6, 2e-4),
    (POWER_LAWS, 1e-8, 1e-5),
]


@pytest.mark.parametrize(
    ("trajectory", "of_v", "of_a"),
    [(trajectory, of_v, of_a) for family, of_v, of_a in FAMILIES for trajectory in family],
    ids=lambda value: type(value).__name__,
)
def test_velocity_and_acceleration_are_the_derivatives(
    trajectory: Trajectory, of_v: float, of_a: float
) -> None:
    t, h = np.linspace(0.0011, trajectory.duration - 0.0011, 1001), 1e-6
    before, at, after = (trajectory.evaluate(t + shift) for shift in (-h, 0.0, h))
    np.testing.assert_allclose((after.p - before.p) / (2 * h), at.v, atol=of_v)
    smooth = np.linalg.norm(after.a - before.a, axis=1) < 1e-3  # away from the corners of single ramps
    assert smooth.mean() > 0.98
    np.testing.assert_allclose(((after.v - before.v) / (2 * h))[smooth], at.a[smooth], atol=of_a)


@pytest.mark.parametrize(
    ("trajectory", "times", "rests"),
    [
        *product([STOP, *UNIFORM[:2]], [EDGES], [True]),
        (VIA, EDGES, False),
        *((trajectory, trajectory.passages, False) for trajectory in (PLANE, SPACE)),
    ],
    ids=lambda value: type(value).__name__,
)
def test_targets_are_passed_exactly_at_their_times(
    trajectory: Trajectory, times: np.ndarray, rests: bool
) -> None:
    at = trajectory.evaluate(times)
    np.testing.assert_allclose(at.p, trajectory.target_points, atol=1e-12)
    np.testing.assert_allclose(at.v[[0, -1]], 0.0, atol=1e-12)
    assert trajectory.duration == pytest.approx(times[-1], abs=1e-12)
    assert np.all(np.diff(times) > 0.3)
    if rests:
        np.testing.assert_allclose(at.v, 0.0, atol=1e-12)
    else:
        assert np.linalg.norm(at.v[1:-1], axis=1).min() > 0.05


points_3d = st.tuples(*(st.floats(-1.0, 1.0) for _ in range(3)))
arcs = st.builds(
    lambda arc_angle, tilt, b: SigmaLognormal(
        np.array([[1.5, 1.6, 1.7], b, [-1.5, 2.0, -1.4]]),
        (
            Stroke(TwoSidedTiming(0.1, 1.0, 0.2), arc_angle, tilt),
            Stroke(LiteralTiming(0.8, 1.0, 1.0), 0.3 * arc_angle, 0.7),
        ),
        2.0,
    ),
    st.floats(-5.0, 5.0),
    st.floats(-math.pi, math.pi),
    points_3d,
)


@settings(max_examples=60)
@given(
    trajectory=arcs | st.sampled_from([STOP, VIA, *UNIFORM, PLANE, SPACE]),
    scale=st.floats(0.05, 20.0),
    shift=points_3d,
    quaternion=st.tuples(*(st.floats(-1.0, 1.0) for _ in range(4))).filter(
        lambda q: sum(x * x for x in q) > 0.01
    ),
    stretch=st.floats(0.1, 10.0),
)
def test_similarities_and_time_stretch_commute_with_evaluation(
    trajectory: Trajectory,
    scale: float,
    shift: tuple[float, float, float],
    quaternion: tuple[float, float, float, float],
    stretch: float,
) -> None:
    similarity = Similarity(scale, Rotation.from_quat(quaternion).as_matrix(), np.array(shift))
    t = np.linspace(0.0, trajectory.duration, 101)
    at, moved = (
        trajectory.evaluate(t),
        trajectory.transformed(similarity).stretched(stretch).evaluate(stretch * t),
    )
    speed, acceleration = (scale * np.abs(values).max() for values in (at.v, at.a))
    np.testing.assert_allclose(moved.p, similarity.points(at.p), atol=1e-9 * max(20.0 * scale, 1.0))
    np.testing.assert_allclose(moved.v, similarity.vectors(at.v) / stretch, atol=1e-8 * speed / stretch)
    if len(getattr(trajectory, "ramps", (0, 0))) == 2:  # that of single ramps jumps
        np.testing.assert_allclose(
            moved.a, similarity.vectors(at.a) / stretch**2, atol=1e-6 * acceleration / stretch**2
        )


@pytest.mark.parametrize(
    "make",
    [
        lambda: Lognormal(0.0, 0.0, 0.0),
        lambda: Lognormal(math.nan, 0.0, 0.1),
        lambda: sigma_for_k(1.0),
        lambda: lead_from_k(2.5, 1.0),
        lambda: LiteralTiming(0.0, 1.0, -0.1),
        lambda: LiteralTiming(0.0, 0.0, 1.0),
        lambda: TwoSidedTiming(0.0, -1.0, 0.1),
        lambda: TwoSidedTiming(0.0, 1.0, math.inf),
        lambda: TwoSidedTiming(0.0, 1.0, 0.1, 0.0),
        lambda: Stroke(LOGNORMAL, arc_angle=2 * math.pi),
        lambda: Stroke(LOGNORMAL, tilt=math.nan),
        lambda: SigmaLognormal(np.array([A, A]), (Stroke(LOGNORMAL),), 1.0),
        lambda: SigmaLognormal(np.array([A, B]), (), 1.0),
        lambda: SigmaLognormal(np.array([A[:2], B[:2]]), (Stroke(LOGNORMAL),), 1.0),
        lambda: Similarity(0.0, np.eye(3), np.zeros(3)),
        lambda: Similarity(1.0, -np.eye(3), np.zeros(3)),
        lambda: Similarity(1.0, 2 * np.eye(3), np.zeros(3)),
        lambda: Similarity(1.0, np.eye(3), np.array([0.0, math.inf, 0.0])),
        lambda: MinimumJerk(POINTS, DURATIONS[:2]),
        lambda: MinimumJerk(POINTS, np.array([1.0, 0.0, 1.0])),
        lambda: MinimumJerk(POINTS[:1], np.array([])),
        lambda: MinimumJerk(POINTS[:, :2], DURATIONS),
        lambda: MinimumJerk(POINTS * np.nan, DURATIONS),
        lambda: MinimumJerk(POINTS, DURATIONS, "blend"),
        lambda: Uniform(POINTS, DURATIONS[:2], (0.2,)),
        lambda: Uniform(POINTS, DURATIONS, ()),
        lambda: Uniform(POINTS, DURATIONS, (0.2, 0.0)),
        lambda: Uniform(POINTS, DURATIONS, (1.0, 0.4)),
        lambda: Uniform(POINTS, DURATIONS, (0.2,), "stop", 0.01),
        lambda: Uniform(POINTS, DURATIONS, (0.2,), "blend"),
        lambda: Uniform(POINTS, DURATIONS, (0.2,), "round", 0.01),
        lambda: Uniform(POINTS, np.array([1.7, math.nan, 2.2]), (0.2,)),
        lambda: CornerPath(POINTS, -0.1),
        lambda: CornerPath(POINTS[:1]),
        lambda: CornerPath(POINTS[[0, 0, 1]]),
        lambda: CornerPath(POINTS[[0, 1, 0]], 0.01),
        lambda: PowerLaw(FIVE_POINTS, 0.5, RAMPS, 1.0),
        lambda: PowerLaw(FIVE_POINTS, np.nan, RAMPS, 1.0),
        lambda: PowerLaw(FIVE_POINTS, 6.0, (), 1.0),
        lambda: PowerLaw(FIVE_POINTS, 6.0, RAMPS, 0.0),
        lambda: PowerLaw(FIVE_POINTS, 6.0, RAMPS, 1.0, -0.1),
        lambda: PowerLaw(FIVE_POINTS, 6.0, RAMPS, 1.0, 0.3, 1.1),
        lambda: SmoothPath(FIVE_POINTS[:1]),
        lambda: SmoothPath(FIVE_POINTS[[0, 0, 1]]),
        lambda: SmoothPath(FIVE_POINTS + np.inf),
        lambda: SmoothPath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.0]])),
    ],
)
def test_nonsense_is_refused(make: object) -> None:
    with pytest.raises(MovementError):
        make()


# --- lognormals


@given(a=st.floats(0.05, 50.0), sigma=st.floats(0.03, 0.6), mu=st.floats(-3.0, 1.5))
def test_a_slower_lognormal_has_the_same_shape(a: float, sigma: float, mu: float) -> None:
    lognormal = Lognormal(0.3, mu, sigma)
    slow = lognormal.stretched(a)
    assert slow.t0 == pytest.approx(a * lognormal.t0)
    assert slow.mode - slow.t0 == pytest.approx(a * (lognormal.mode - lognormal.t0), rel=1e-9)
    assert slow.std == pytest.approx(a * lognormal.std, rel=1e-9)
    assert slow.peak == pytest.approx(lognormal.peak / a, rel=1e-9)
    assert (slow.skewness, slow.kurtosis) == (lognormal.skewness, lognormal.kurtosis)
    t = np.linspace(0.0, 5.0, 50)
    np.testing.assert_allclose(slow.evaluate(a * t).done, lognormal.evaluate(t).done, atol=1e-9)


@pytest.mark.parametrize(
    ("fraction", "sigma"),
    [
        (0.49, 0.008486),
        (0.475, 0.021229),
        (0.45, 0.042557),
        (0.425, 0.064084),
        (0.40, 0.085916),
        (0.375, 0.108171),
        (0.35, 0.130979),
    ],
)
def test_the_peak_of_a_two_sided_window(fraction: float, sigma: float) -> None:
    assert TwoSidedTiming(0.0, 1.0, sigma).lognormal.mode == pytest.approx(fraction, abs=6e-7)


def test_window_ends_carry_the_tails_asked_for() -> None:
    done = TwoSidedTiming(1.5, 0.8, 0.2, 2.5).lognormal.evaluate([1.5, 2.3]).done
    assert done == pytest.approx([ndtr(-2.5), ndtr(2.5)], abs=1e-14)


@pytest.mark.parametrize("lognormal", [CASE_A, Lognormal(-0.4, 0.3, 0.08), Lognormal(0.0, -0.5, 0.5)])
def test_closed_forms_agree_with_quadrature(lognormal: Lognormal) -> None:
    """Moments and power straight from Lambda, which uses none of their closed forms."""
    low, high = lognormal.time_at_deviation(-9.0), lognormal.time_at_deviation(9.0)

    def integral(weight: object) -> float:
        def weighted(t: float) -> float:
            return weight(t) * float(lognormal.evaluate(t).rate)

        return float(quad(weighted, low, high, points=[lognormal.mode], limit=400)[0])

    mean = integral(lambda t: t)
    std = math.sqrt(integral(lambda t: (t - mean) ** 2))
    assert integral(lambda t: 1.0) == pytest.approx(1.0, abs=1e-10)
    assert mean == pytest.approx(lognormal.mean, rel=1e-9)
    assert std == pytest.approx(lognormal.std, rel=1e-8)
    assert integral(lambda t: ((t - mean) / std) ** 3) == pytest.approx(lognormal.skewness, rel=1e-6)
    assert integral(lambda t: ((t - mean) / std) ** 4) == pytest.approx(lognormal.kurtosis, rel=1e-6)
    assert integral(lambda t: float(lognormal.evaluate(t).rate)) == pytest.approx(lognormal.power, rel=1e-9)


def test_rates_are_the_derivatives_of_the_values() -> None:
    t, h = np.linspace(0.05, 0.6, 200), 1e-6
    before, at, after = (CASE_A.evaluate(t + shift) for shift in (-h, 0.0, h))
    np.testing.assert_allclose((after.done - before.done) / (2 * h), at.rate, atol=1e-7)
    np.testing.assert_allclose((after.rate - before.rate) / (2 * h), at.rate_change, atol=1e-5)


def test_inflections_are_where_the_slope_is_steepest() -> None:
    t = np.linspace(0.02, 0.6, 200_001)
    slope = CASE_A.evaluate(t).rate_change
    assert t[np.argmax(slope)] == pytest.approx(CASE_A.inflections.before, abs=1e-5)
    assert t[np.argmin(slope)] == pytest.approx(CASE_A.inflections.after, abs=1e-5)


def test_nothing_moves_before_the_command() -> None:
    values = Lognormal(1.0, -1.0, 0.2).evaluate([-1e9, 0.0, 1.0, np.nextafter(1.0, 2.0)])
    assert not np.any(values)


# --- strokes


def flat_arc(length: float, theta_start: float, theta_end: float) -> SigmaLognormal:
    """A stroke in the plane z = 0 by the variables of the paper: D, and the directions at both ends."""
    turn, along = theta_end - theta_start, 0.5 * (theta_start + theta_end)
    end = length * float(sinc(0.5 * turn)) * np.array([math.cos(along), math.sin(along), 0.0])
    # The reference normal points up, c x up points to the right: the left is at -pi / 2.
    return SigmaLognormal(np.array([np.zeros(3), end]), (Stroke(LOGNORMAL, turn, -math.pi / 2),), 60.0)


def test_an_arc_in_space_has_the_speed_of_its_stroke() -> None:
    movement = SigmaLognormal(np.array([A, B]), (Stroke(LOGNORMAL, arc_angle=0.9, tilt=0.7),), 60.0)
    t = np.linspace(0.1, 1.0, 500)
    np.testing.assert_allclose(
        np.linalg.norm(movement.evaluate(t).v, axis=1), movement.stroke_speeds(t)[:, 0], atol=1e-15
    )


def test_an_arc_in_the_plane_is_eq_3_and_its_position_the_integral() -> None:
    """Simpson's rule with 1e-4 s, as in the notes: D = .2, sigma = .25, turn 1.2 rad."""
    t = np.arange(0.1, 1.2, 1e-4)
    lognormal, motion = LOGNORMAL.evaluate(t), flat_arc(0.2, 0.3, 1.5).evaluate(t)
    phi = 0.3 + 1.2 * lognormal.done
    wanted = 0.2 * lognormal.rate[:, None] * np.column_stack((np.cos(phi), np.sin(phi), np.zeros_like(phi)))
    np.testing.assert_allclose(motion.v, wanted, atol=1e-14)
    integral = cumulative_simpson(wanted, x=t, axis=0, initial=0.0)
    np.testing.assert_allclose(motion.p, integral, atol=1e-11)


@pytest.mark.parametrize("arc_angle", [0.0, 1e-300, 1e-12, 1e-9, 1e-4, 1.2, -2.5, 6.0])
def test_any_bending_is_stable(arc_angle: float) -> None:
    """Against the textbook form where it is exact, against its Taylor series for small bending."""
    done = LOGNORMAL.evaluate(0.33).done
    p = flat_arc(0.2, 0.3, 0.3 + arc_angle).evaluate(0.33).p[0, :2]
    if abs(arc_angle) < 1e-3:
        x, y = 1.0 - (arc_angle * done) ** 2 / 6.0, arc_angle * done / 2.0
    else:
        x, y = (
            math.sin(arc_angle * done) / (arc_angle * done),
            (1.0 - math.cos(arc_angle * done)) / (arc_angle * done),
        )
    rotation = np.array([[math.cos(0.3), -math.sin(0.3)], [math.sin(0.3), math.cos(0.3)]])
    np.testing.assert_allclose(p, 0.2 * done * rotation @ np.array([x, y]), atol=2e-15)


def test_strokes_without_overlap_run_along_the_polyline() -> None:
    points = np.array([A, B, (0.3, 0.05, 0.2)])
    strokes = tuple(Stroke(TwoSidedTiming(begin, 1.0, 0.1)) for begin in (0.0, 1.0))
    movement = SigmaLognormal(points, strokes, 2.0)
    p = movement.evaluate(np.linspace(0.0, 1.0, 101)).p
    along = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
    off_line = (p - points[0]) - ((p - points[0]) @ along)[:, None] * along
    assert np.abs(off_line).max() < 1e-5  # the two tails of 1.1e-5 D
    np.testing.assert_allclose(movement.evaluate(20.0).p[0], points[-1], atol=1e-15)


def test_speed_minima_have_no_slope() -> None:
    strokes = tuple(Stroke(TwoSidedTiming(0.1 + 0.6 * j, 1.0, 0.15), 0.4, 0.3 * j) for j in range(3))
    movement = SigmaLognormal(np.array([A, B, A, B]) + np.arange(4)[:, None] * 0.01, strokes, 2.5)
    minima = movement.speed_minima()
    motion = movement.evaluate(minima)
    np.testing.assert_allclose(np.einsum("ij,ij->i", motion.v, motion.a), 0.0, atol=1e-9)
    assert np.all(np.diff(minima) > 0.3)


def test_speed_minima_of_merged_strokes_stay_between_the_peaks() -> None:
    strokes = (Stroke(TwoSidedTiming(0.0, 1.0, 0.15)), Stroke(TwoSidedTiming(0.05, 1.0, 0.15)))
    movement = SigmaLognormal(np.array([A, B, (0.45, 0.3, 0.4)]), strokes, 1.2)
    modes = [stroke.timing.lognormal.mode for stroke in strokes]
    assert modes[0] <= movement.speed_minima()[0] <= modes[1]


@settings(max_examples=60)
@given(arc_angle=st.floats(-6.0, 6.0), tilt=st.floats(-7.0, 7.0), b=points_3d)
def test_every_arc_ends_at_its_target(arc_angle: float, tilt: float, b: tuple[float, float, float]) -> None:
    a = np.array([1.2, 1.3, 1.4])
    movement = SigmaLognormal(np.array([a, b]), (Stroke(LOGNORMAL, arc_angle, tilt),), 50.0)
    np.testing.assert_allclose(movement.evaluate(50.0).p[0], b, atol=1e-13)


def test_vertical_chords_have_a_plane_too() -> None:
    for b in ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1e-12, 0.0, 1.0)):
        movement = SigmaLognormal(np.array([[0.0, 0.0, 0.0], b]), (Stroke(LOGNORMAL, 1.0, 0.3),), 50.0)
        np.testing.assert_allclose(movement.evaluate(50.0).p[0], b, atol=1e-14)


# --- minimum jerk


def test_unit_stroke_is_the_published_polynomial() -> None:
    u = np.linspace(0.0, 1.0, 101)
    shape = stroke_shape(u)
    np.testing.assert_allclose(shape.done, 10 * u**3 - 15 * u**4 + 6 * u**5, atol=1e-15)
    assert shape.rate.max() == 1.875
    assert u[shape.rate.argmax()] == 0.5
    np.testing.assert_allclose(shape.rate, shape.rate[::-1], atol=1e-14)
    ends = stroke_shape([-1.0, 0.0, 1.0, 2.0])
    np.testing.assert_array_equal(ends.done, [0.0, 0.0, 1.0, 1.0])
    np.testing.assert_array_equal([*ends.rate, *ends.rate_change], 0.0)


def test_two_points_to_pass_are_one_stroke() -> None:
    t = np.linspace(0.0, 1.7, 50)
    one, other = (MinimumJerk(POINTS[:2], DURATIONS[:1], passing).evaluate(t) for passing in ("stop", "via"))
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)


def jerk_cost(trajectory: MinimumJerk, bump: float = 0.0) -> float:
    """Integral of the squared jerk, of the movement plus a bump that is zero at all points and ends."""
    t = np.linspace(0.0, trajectory.duration, 40_001)
    zeros = np.polynomial.Polynomial.fromroots([0.0, 0.0, *EDGES, EDGES[3], EDGES[3]])
    a = trajectory.evaluate(t).a + bump * zeros.deriv(2)(t)[:, None] * [1.0, -0.5, 0.3]
    jerk = np.gradient(a, t, axis=0, edge_order=2)
    return float(simpson(np.einsum("ij,ij->i", jerk, jerk), x=t))


def test_no_movement_through_the_points_has_less_jerk() -> None:
    least = jerk_cost(VIA)
    for bump in (-1e-3, -1e-4, 1e-4, 1e-3):
        assert jerk_cost(VIA, bump) > least
    # to first order nothing changes: it is the minimum, not just lower than these
    assert (jerk_cost(VIA, 1e-4) - jerk_cost(VIA, -1e-4)) / 2e-4 == pytest.approx(0.0, abs=1e-3 * least)
    assert least < jerk_cost(STOP)


# --- the robot-like profile


@pytest.mark.parametrize("trajectory", UNIFORM)
def test_length_and_time_are_kept(trajectory: Uniform) -> None:
    assert trajectory.duration == math.fsum(DURATIONS)
    along = trajectory.wave.evaluate([0.0, trajectory.duration, trajectory.duration + 100.0])
    np.testing.assert_allclose(along.s, [0.0, trajectory.path.length, trajectory.path.length], atol=1e-12)
    np.testing.assert_allclose(along.v, 0.0, atol=1e-12)
    np.testing.assert_allclose(trajectory.evaluate(trajectory.duration).p[0], POINTS[-1], atol=1e-12)


@pytest.mark.parametrize("trajectory", UNIFORM)
def test_length_speed_and_acceleration_belong_together(trajectory: Uniform) -> None:
    t = np.linspace(0.0, trajectory.duration, 52_001)
    along = trajectory.wave.evaluate(t)
    assert along.v.min() > -1e-12
    np.testing.assert_allclose(cumulative_simpson(along.v, x=t, initial=0.0), along.s, atol=1e-8)
    np.testing.assert_allclose(cumulative_simpson(along.a, x=t, initial=0.0), along.v, atol=2e-4)


def test_levels_and_ramps_of_a_trapezoid() -> None:
    wave = SmoothedSquareWave(np.array([[1.0, 3.0]]), np.array([0.5]), (0.4,))
    along = wave.evaluate([0.7, 0.8, 0.9, 1.0, 1.2, 2.0, 2.8, 3.0, 3.2, 4.0])
    np.testing.assert_allclose(along.v, [0.0, 0.0, 0.125, 0.25, 0.5, 0.5, 0.5, 0.25, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(along.s[-1], 1.0, atol=1e-15)
    assert np.abs(along.a).max() == pytest.approx(0.5 / 0.4)


def test_two_boxcars_bound_acceleration_and_jerk() -> None:
    wave = SmoothedSquareWave(np.array([[1.0, 3.0]]), np.array([0.5]), (0.4, 0.1))
    t = np.linspace(0.0, 4.0, 400_001)
    along = wave.evaluate(t)
    assert np.abs(along.a).max() == pytest.approx(0.5 / 0.4, rel=1e-9)
    assert np.abs(np.diff(along.a)).max() / (t[1] - t[0]) == pytest.approx(0.5 / (0.4 * 0.1), rel=1e-3)
    # the order of the two boxcars does not matter
    other = SmoothedSquareWave(np.array([[1.0, 3.0]]), np.array([0.5]), (0.1, 0.4)).evaluate(t)
    np.testing.assert_allclose(other.s, along.s, atol=1e-14)


def test_smoothing_is_the_convolution_with_boxcars() -> None:
    """By brute force on a grid."""
    trajectory = UNIFORM[2]
    dt = 1e-4
    t = np.arange(-1.0, trajectory.duration + 1.0, dt)
    square = np.zeros_like(t)
    for (begin, end), level in zip(trajectory.wave.windows, trajectory.wave.levels, strict=True):
        square[(t >= begin) & (t < end)] = level
    for width in trajectory.ramps:
        n = round(width / dt)
        square = np.convolve(square, np.ones(n) / n, mode="same")
    np.testing.assert_allclose(trajectory.wave.evaluate(t).v, square, atol=2e-4)


point = st.tuples(*(st.floats(-0.5, 0.5) for _ in range(3)))


@settings(max_examples=60)
@given(middle=point, end=point, blend=st.floats(0.0, 0.3))
def test_paths_have_unit_tangents_and_join(
    middle: tuple[float, float, float], end: tuple[float, float, float], blend: float
) -> None:
    points = np.array([[1.0, 1.0, 1.0], middle, np.subtract(end, 2.0)])
    path = CornerPath(points, blend)
    s = np.linspace(0.0, path.length, 400)
    at = path.at(s)
    np.testing.assert_allclose(np.linalg.norm(at.tangent, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(at.p[[0, -1]], points[[0, -1]], atol=1e-12)
    steps = np.linalg.norm(np.diff(at.p, axis=0), axis=1)
    assert steps.max() <= s[1] * (1.0 + 1e-9)
    straight = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert np.linalg.norm(points[2] - points[0]) - 1e-12 <= path.length <= straight + 1e-12


def test_blends_by_differentiation() -> None:
    path = CornerPath(POINTS, 0.03)
    h = 1e-6
    s = np.linspace(2 * h, path.length - 2 * h, 3001)
    before, at, after = (path.at(s + shift) for shift in (-h, 0.0, h))
    np.testing.assert_allclose((after.p - before.p) / (2 * h), at.tangent, atol=1e-8)
    np.testing.assert_allclose((after.tangent - before.tangent) / (2 * h), at.curvature, atol=0.02)
    # no jump of curvature: the finest steps of the curvature vector are proportional to the step of s
    fine = np.linspace(0.0, path.length, 200_001)
    curvature = path.at(fine).curvature
    assert np.abs(np.diff(curvature, axis=0)).max() < 0.05 * np.abs(curvature).max()
    assert np.abs(curvature).max() > 10.0


def test_blend_passes_its_middle_at_the_target() -> None:
    path = CornerPath(POINTS, 0.03)
    for s, target, before, after in zip(
        path.targets_at[1:-1], POINTS[1:-1], POINTS, POINTS[2:], strict=False
    ):
        inwards = (before - target) / np.linalg.norm(before - target) + (after - target) / np.linalg.norm(
            after - target
        )
        miss = path.at(s).p[0] - target
        assert 1e-3 < np.linalg.norm(miss) < 0.03
        np.testing.assert_allclose(np.cross(miss, inwards), 0.0, atol=1e-12)


def test_sharp_path_passes_exactly_through_its_targets() -> None:
    path = CornerPath(POINTS)
    np.testing.assert_allclose(path.at(path.targets_at).p, POINTS, atol=1e-15)


def test_straight_corner_needs_no_blend() -> None:
    path = CornerPath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.3, 0.0, 0.0]]), 0.02)
    assert path.length == pytest.approx(0.3, abs=1e-15)
    np.testing.assert_allclose(path.targets_at, [0.0, 0.1, 0.3], atol=1e-15)


# --- the two-thirds power law


def frenet(path: SmoothPath, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Curvature and torsion by their textbook formulas."""
    first, second, third = (path.derivative(u, order) for order in (1, 2, 3))
    across = np.cross(first, second)
    curvature = np.linalg.norm(across, axis=1) / np.linalg.norm(first, axis=1) ** 3
    return curvature, np.einsum("ij,ij->i", across, third) / np.einsum("ij,ij->i", across, across)


@pytest.mark.parametrize("trajectory", [PLANE, SPACE])
def test_speed_follows_the_law_between_the_ramps(trajectory: PowerLaw) -> None:
    """From the movement's own velocity and acceleration, and the textbook's curvature at the same point."""
    t = np.linspace(sum(RAMPS), trajectory.duration - sum(RAMPS), 2001)
    motion = trajectory.evaluate(t)
    speed = np.linalg.norm(motion.v, axis=1)
    fine = np.linspace(0.0, 1.0, 200_001)
    along = cumulative_simpson(
        np.linalg.norm(trajectory.path.derivative(fine, 1), axis=1), x=fine, initial=0.0
    )
    s = cumulative_simpson(speed, x=t, initial=0.0)
    start = fine[np.linalg.norm(trajectory.path.derivative(fine, 0) - motion.p[0], axis=1).argmin()]
    u = np.interp(s + np.interp(start, fine, along), along, fine)
    np.testing.assert_allclose(trajectory.path.derivative(u, 0), motion.p, atol=2.0 * along[-1] / len(fine))
    curvature, torsion = frenet(trajectory.path, u)
    seen = torsion * curvature**2 / (curvature**2 + 1.0)
    expected = (1 + curvature**2) ** (-1 / 6) * (1 + seen**2) ** (-0.5 * trajectory.torsion_exponent)
    np.testing.assert_allclose(speed / expected, (speed / expected).mean(), rtol=2e-3)


def test_exponent_is_one_third_where_the_path_is_bent() -> None:
    """R far above all radii: the bare law."""
    trajectory = PowerLaw(POINTS[:3], 6.0, RAMPS, 100.0)
    t = np.linspace(0.6, 5.4, 3001)
    motion = trajectory.evaluate(t)
    fit = fit_power_law(motion.v, motion.a, max_radius=10.0)
    assert fit.exponent == pytest.approx(1 / 3, abs=1e-4)
    assert fit.r_squared == pytest.approx(1.0, abs=1e-6)


def test_exponent_zero_is_a_constant_speed() -> None:
    trajectory = PowerLaw(FIVE_POINTS, 6.0, RAMPS, 1.0, 0.0)
    speed = np.linalg.norm(trajectory.evaluate(np.linspace(0.5, 5.5, 501)).v, axis=1)
    np.testing.assert_allclose(speed, speed.mean(), rtol=1e-6)


def test_speed_is_bounded_where_the_path_is_straight() -> None:
    """Two points, a line: top speed V, and a way of V (T - half of the ramps, twice)."""
    trajectory = PowerLaw(POINTS[:2], 2.0, RAMPS, 1.0)
    motion = trajectory.evaluate(np.linspace(0.0, 2.0, 2001))
    length = np.linalg.norm(POINTS[1] - POINTS[0])
    assert np.linalg.norm(motion.v, axis=1).max() == pytest.approx(length / 1.5, rel=1e-9)
    inflected = PowerLaw(
        np.array([[0.0, 0.0, 0.0], [0.1, 0.1, 0.0], [0.2, 0.0, 0.0], [0.3, 0.1, 0.0]]), 4.0, RAMPS, 1.0
    )
    for gamma in (0.0, TORSION_EXPONENT):
        trajectory = PowerLaw(inflected.target_points, 4.0, RAMPS, 1.0, TWO_THIRDS, gamma)
        speed = np.linalg.norm(trajectory.evaluate(np.linspace(0.0, 4.0, 4001)).v, axis=1)
        assert speed.max() < 4.0 * speed.mean()
        # a flat path has no torsion: both laws are one
        np.testing.assert_allclose(trajectory.evaluate(1.7).p, inflected.evaluate(1.7).p, atol=1e-12)


def test_path_is_smooth_up_to_the_fourth_derivative() -> None:
    path = SmoothPath(FIVE_POINTS)
    for order in range(5):
        left, right = (path.derivative(path.knots[1:-1] + side * 1e-9, order) for side in (-1, 1))
        np.testing.assert_allclose(left, right, atol=1e-4 * 10.0 ** max(order - 2, 0))
    np.testing.assert_allclose(path.derivative(path.knots, 0), FIVE_POINTS, atol=1e-14)
    for order in (3, 4):
        np.testing.assert_allclose(path.derivative([0.0, 1.0], order), 0.0, atol=1e-8)


def test_bend_of_a_helix() -> None:
    """Through many points of a helix of radius r and pitch 2 pi b: kappa = r / (r^2 + b^2), tau = b / (r^2 + b^2)."""
    r, b = 0.1, 0.05
    angle = np.linspace(0.0, 6.0, 61)
    path = SmoothPath(np.column_stack((r * np.cos(angle), r * np.sin(angle), b * angle)))
    bend = path.bend(np.linspace(0.3, 0.7, 50))
    kappa, tau = r / (r**2 + b**2), b / (r**2 + b**2)
    np.testing.assert_allclose(bend.curvature, kappa, rtol=1e-6)
    np.testing.assert_allclose(bend.triple, kappa**2 * tau, rtol=1e-4)
