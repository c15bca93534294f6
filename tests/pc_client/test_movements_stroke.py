"""Strokes and their sum: arcs in the plane and in space against figures, quadrature and differentiation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from pc_client.errors import MovementError
from pc_client.movements.lognormal import LiteralTiming, Lognormal, TwoSidedTiming
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke, sinc
from pc_client.movements.trajectory import Similarity

A, B = (0.25, -0.1, 0.2), (0.35, 0.1, 0.3)
LOGNORMAL = Lognormal(0.1, -1.6, 0.25)


def flat_arc(length: float, theta_start: float, theta_end: float) -> SigmaLognormal:
    """A stroke in the plane z = 0 by the variables of the paper: D, and the directions at both ends."""
    turn, along = theta_end - theta_start, 0.5 * (theta_start + theta_end)
    end = length * float(sinc(0.5 * turn)) * np.array([math.cos(along), math.sin(along), 0.0])
    # The reference normal points up, c x up points to the right: the left is at -pi / 2.
    return SigmaLognormal(np.array([np.zeros(3), end]), (Stroke(LOGNORMAL, turn, -math.pi / 2),), 60.0)


def test_case_e_arc_in_space() -> None:
    stroke = Stroke(LOGNORMAL, arc_angle=0.9, tilt=0.7)
    assert stroke.length(A, B) / math.dist(A, B) == pytest.approx(1.034564729179, abs=5e-13)
    movement = SigmaLognormal(np.array([A, B]), (stroke,), 60.0)
    np.testing.assert_allclose(movement.evaluate(60.0).p[0], B, atol=1e-14)
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


@pytest.mark.parametrize("arc_angle", [0.0, 1e-12, 0.9, -1.7])
def test_derivatives_in_space(arc_angle: float) -> None:
    strokes = (
        Stroke(TwoSidedTiming(0.1, 1.0, 0.15), arc_angle, 0.4),
        Stroke(TwoSidedTiming(0.6, 1.3, 0.22), -arc_angle, 2.0),
    )
    movement = SigmaLognormal(np.array([A, B, (0.3, 0.0, 0.15)]), strokes, 2.0)
    t, h = np.linspace(0.15, 1.9, 300), 1e-6
    before, at, after = (movement.evaluate(t + shift) for shift in (-h, 0.0, h))
    np.testing.assert_allclose((after.p - before.p) / (2 * h), at.v, atol=1e-8)
    np.testing.assert_allclose((after.v - before.v) / (2 * h), at.a, atol=1e-7)


# Overlap -> corner miss (mm) for sigma .10 and .25, and speed at the junction over the peak.
@pytest.mark.parametrize(
    ("overlap", "misses", "junctions"),
    [
        (0.0, (0.0, 0.0), (0.0, 0.0)),
        (0.3, (0.4, 0.2), (0.014, 0.004)),
        (0.4, (1.3, 0.6), (0.045, 0.015)),
        (0.5, (4.2, 2.2), None),
        (0.6, (11.5, 6.7), None),
    ],
)
def test_table_of_overlaps(
    overlap: float, misses: tuple[float, float], junctions: tuple[float, float] | None
) -> None:
    corner = np.array([0.2, 0.0, 0.0])
    points = np.array([[0.0, 0.0, 0.0], corner, [0.2, 0.2, 0.0]])
    for index, sigma in enumerate((0.10, 0.25)):
        second = TwoSidedTiming(1.0 - overlap, 1.0, sigma)
        movement = SigmaLognormal(
            points, (Stroke(TwoSidedTiming(0.0, 1.0, sigma)), Stroke(second)), 2.0 - overlap
        )
        t = np.linspace(0.0, 2.0, 20_001)
        motion = movement.evaluate(t)
        speed = np.linalg.norm(motion.v, axis=1)
        assert 1e3 * np.linalg.norm(motion.p - corner, axis=1).min() == pytest.approx(misses[index], abs=0.06)
        np.testing.assert_allclose(movement.evaluate(40.0).p[0], points[-1], atol=1e-7)
        if junctions is not None:
            least = movement.evaluate(movement.speed_minima()).v
            assert np.linalg.norm(least) / speed.max() == pytest.approx(junctions[index], abs=6e-4)


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


points_3d = st.tuples(*(st.floats(-1.0, 1.0) for _ in range(3)))


@settings(max_examples=60)
@given(
    arc_angle=st.floats(-5.0, 5.0),
    tilt=st.floats(-math.pi, math.pi),
    b=points_3d,
    scale=st.floats(0.05, 20.0),
    shift=points_3d,
    quaternion=st.tuples(*(st.floats(-1.0, 1.0) for _ in range(4))).filter(
        lambda q: sum(x * x for x in q) > 0.01
    ),
    stretch=st.floats(0.1, 10.0),
)
def test_similarities_and_time_stretch_commute_with_evaluation(
    arc_angle: float,
    tilt: float,
    b: tuple[float, float, float],
    scale: float,
    shift: tuple[float, float, float],
    quaternion: tuple[float, float, float, float],
    stretch: float,
) -> None:
    first = np.array([1.5, 1.6, 1.7])
    points = np.array([first, b, [-1.5, 2.0, -1.4]])
    strokes = (
        Stroke(TwoSidedTiming(0.1, 1.0, 0.2), arc_angle, tilt),
        Stroke(LiteralTiming(0.8, 1.0, 1.0), 0.3 * arc_angle, 0.7),
    )
    movement = SigmaLognormal(points, strokes, 2.0)
    similarity = Similarity(scale, Rotation.from_quat(quaternion).as_matrix(), np.array(shift))
    t = np.linspace(0.0, 2.0, 23)
    at = movement.evaluate(t)
    moved = movement.transformed(similarity).stretched(stretch).evaluate(stretch * t)
    size = scale * float(movement.lengths.max())
    np.testing.assert_allclose(moved.p, similarity.points(at.p), atol=1e-9 * max(size, 1.0))
    np.testing.assert_allclose(moved.v, similarity.vectors(at.v) / stretch, atol=1e-8 * size / stretch)
    np.testing.assert_allclose(moved.a, similarity.vectors(at.a) / stretch**2, atol=1e-6 * size / stretch**2)


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


@pytest.mark.parametrize(
    "make",
    [
        lambda: Stroke(LOGNORMAL, arc_angle=2 * math.pi),
        lambda: Stroke(LOGNORMAL, tilt=math.nan),
        lambda: SigmaLognormal(np.array([A, A]), (Stroke(LOGNORMAL),), 1.0),
        lambda: SigmaLognormal(np.array([A, B]), (), 1.0),
        lambda: SigmaLognormal(np.array([A[:2], B[:2]]), (Stroke(LOGNORMAL),), 1.0),
        lambda: Similarity(0.0, np.eye(3), np.zeros(3)),
        lambda: Similarity(1.0, -np.eye(3), np.zeros(3)),
        lambda: Similarity(1.0, 2 * np.eye(3), np.zeros(3)),
        lambda: Similarity(1.0, np.eye(3), np.array([0.0, math.inf, 0.0])),
    ],
)
def test_nonsense_is_refused(make: object) -> None:
    with pytest.raises(MovementError):
        make()
