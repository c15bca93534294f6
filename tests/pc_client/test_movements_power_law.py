"""The two-thirds power law and the path it runs on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from pc_client.errors import MovementError
from pc_client.movements.power_law import TORSION_EXPONENT, TWO_THIRDS, PowerLaw, SmoothPath
from pc_client.movements.trajectory import Similarity
from pc_client.studies.likeness import fit_power_law

POINTS = np.array(
    [[0.30, 0.0, 0.2], [0.40, 0.1, 0.3], [0.30, 0.15, 0.2], [0.35, -0.05, 0.25], [0.3, 0.0, 0.3]]
)
RAMPS = (0.3, 0.2)
PLANE = PowerLaw(POINTS, 6.0, RAMPS, 1.0)
SPACE = PowerLaw(POINTS, 6.0, RAMPS, 1.0, TWO_THIRDS, TORSION_EXPONENT)


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
    assert fit.n_samples == len(t)


def test_exponent_zero_is_a_constant_speed() -> None:
    trajectory = PowerLaw(POINTS, 6.0, RAMPS, 1.0, 0.0)
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


@pytest.mark.parametrize("trajectory", [PLANE, SPACE])
def test_targets_are_passed_exactly(trajectory: PowerLaw) -> None:
    at = trajectory.evaluate(trajectory.passages)
    np.testing.assert_allclose(at.p, POINTS, atol=1e-12)
    np.testing.assert_allclose(at.v[[0, -1]], 0.0, atol=1e-12)
    assert np.all(np.diff(trajectory.passages) > 0.3)


@pytest.mark.parametrize("trajectory", [PLANE, SPACE, PowerLaw(POINTS[:2], 1.0, (0.3,), 0.1)])
def test_derivatives(trajectory: PowerLaw) -> None:
    t, h = np.linspace(0.0011, trajectory.duration - 0.0011, 1001), 1e-6
    before, at, after = (trajectory.evaluate(t + shift) for shift in (-h, 0.0, h))
    np.testing.assert_allclose((after.p - before.p) / (2 * h), at.v, atol=1e-8)
    if len(trajectory.ramps) == 2:
        np.testing.assert_allclose((after.v - before.v) / (2 * h), at.a, atol=1e-5)


@settings(max_examples=15)
@given(
    scale=st.floats(0.1, 10.0),
    angles=st.tuples(*(st.floats(-3.0, 3.0) for _ in range(3))),
    stretch=st.floats(0.2, 5.0),
)
def test_similarities_and_time_stretch_commute_with_evaluation(
    scale: float, angles: tuple[float, float, float], stretch: float
) -> None:
    similarity = Similarity(scale, Rotation.from_euler("xyz", angles).as_matrix(), np.array([1.0, -2.0, 0.3]))
    t = np.linspace(0.0, SPACE.duration, 101)
    at, moved = SPACE.evaluate(t), SPACE.transformed(similarity).stretched(stretch).evaluate(stretch * t)
    np.testing.assert_allclose(moved.p, similarity.points(at.p), atol=1e-9 * scale)
    np.testing.assert_allclose(moved.v, similarity.vectors(at.v) / stretch, atol=1e-8 * scale / stretch)
    np.testing.assert_allclose(moved.a, similarity.vectors(at.a) / stretch**2, atol=1e-6 * scale / stretch**2)


def test_path_is_smooth_up_to_the_fourth_derivative() -> None:
    path = SmoothPath(POINTS)
    for order in range(5):
        left, right = (path.derivative(path.knots[1:-1] + side * 1e-9, order) for side in (-1, 1))
        np.testing.assert_allclose(left, right, atol=1e-4 * 10.0 ** max(order - 2, 0))
    np.testing.assert_allclose(path.derivative(path.knots, 0), POINTS, atol=1e-14)
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


@pytest.mark.parametrize(
    "make",
    [
        lambda: PowerLaw(POINTS, 0.5, RAMPS, 1.0),
        lambda: PowerLaw(POINTS, np.nan, RAMPS, 1.0),
        lambda: PowerLaw(POINTS, 6.0, (), 1.0),
        lambda: PowerLaw(POINTS, 6.0, RAMPS, 0.0),
        lambda: PowerLaw(POINTS, 6.0, RAMPS, 1.0, -0.1),
        lambda: PowerLaw(POINTS, 6.0, RAMPS, 1.0, 0.3, 1.1),
        lambda: SmoothPath(POINTS[:1]),
        lambda: SmoothPath(POINTS[[0, 0, 1]]),
        lambda: SmoothPath(POINTS + np.inf),
        lambda: SmoothPath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.0]])),
    ],
)
def test_nonsense_is_refused(make: object) -> None:
    with pytest.raises(MovementError):
        make()
