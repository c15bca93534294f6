"""The signal that strokes are judged by: low-passed at 12 Hz, not shifted, not bent at its ends.

The closed forms give back the lognormal that they are asked about (docs/theory.md, sections 1 and 8).

The arrays of the fit are the package's own movement, and its Jacobian is the derivative of it.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from extraction_samples import own_strokes, recorded
from hypothesis import example, given
from hypothesis import strategies as st

from pc_client.movements.lognormal import Lognormal
from pc_client.studies.extraction.chain import (
    Bounds,
    Chain,
    in_order,
    inserted,
    normals_across,
    sigma_lognormal,
    without,
)
from pc_client.studies.extraction.fitting import best_candidates
from pc_client.studies.extraction.initial import (
    CharacteristicPoints,
    characteristic_points,
    initial_chain,
    lognormal_from_points,
    salient_points,
    sigma_from_peak_ratio,
    sigma_from_slope_ratio,
)
from pc_client.studies.extraction.pen import PenPart
from pc_client.studies.extraction.refine import linearise, moved, variables_per_stroke
from pc_client.studies.extraction.smoothing import CUTOFF_HZ, moves, smooth_part, speed_peaks


def wave(frequency, rate=200.0, duration=4.0):
    t = np.arange(0.0, duration + 0.5 / rate, 1.0 / rate)
    return PenPart(
        t, np.column_stack((np.sin(2 * math.pi * frequency * t), np.cos(2 * math.pi * frequency * t)))
    )


@pytest.mark.parametrize(
    ("rate", "frequency", "gain"),
    [
        (60.0, 5.0, 1.0),
        (200.0, CUTOFF_HZ, 0.5),
        (1000.0, 1.0, 1.0),
        (1000.0, CUTOFF_HZ, 0.5),
        (133.0, 24.0, 0.004),
    ],
)
def test_what_passes_and_what_does_not(rate, frequency, gain):
    smooth = smooth_part(wave(frequency, rate))
    middle = slice(len(smooth.t) // 4, -len(smooth.t) // 4)
    radius = np.linalg.norm(smooth.p[middle], axis=1)
    assert radius == pytest.approx(gain, abs=0.01)
    assert smooth.speed[middle] == pytest.approx(2 * math.pi * frequency * gain, rel=0.02, abs=1.5)
    if gain > 0.4:  # not shifted in time
        phase = np.unwrap(np.arctan2(smooth.p[middle, 0], smooth.p[middle, 1]))
        assert phase - 2 * math.pi * frequency * smooth.t[middle] == pytest.approx(
            np.zeros(len(radius)) + phase[0] - 2 * math.pi * frequency * smooth.t[middle][0], abs=0.01
        )


def test_a_straight_run_keeps_its_speed_to_both_ends():
    t = np.linspace(0.0, 0.5, 40)
    smooth = smooth_part(PenPart(t, np.column_stack((3.0 * t, -4.0 * t))))
    assert smooth.speed == pytest.approx(5.0)
    assert smooth.p[[0, -1]] == pytest.approx(np.array([[0.0, 0.0], [1.5, -2.0]]))


def test_times_begin_and_end_with_the_part():
    smooth = smooth_part(PenPart([1.0, 1.01, 1.2, 1.2303], np.eye(4)[:, :2]))
    assert (smooth.t[0], smooth.t[-1]) == (1.0, 1.2303)
    assert np.diff(smooth.t) == pytest.approx(smooth.step)
    assert smooth.step == pytest.approx(0.005, rel=0.02)


@given(
    st.lists(st.tuples(st.integers(1, 300), st.integers(-9, 9), st.integers(-9, 9)), min_size=2, max_size=40)
)
@example([(1, 0, 0), (10, 0, 0), (28, 0, 1), (11, 0, 0), (39, 0, 0)])
@example([(1, 0, 0), (46, 0, 0), (12, 0, 1), (24, 0, 0)])
def test_no_clock_makes_the_signal_leave_the_path_far(rows):
    """No overshoot of a curve between close time stamps: never more than the size of the path itself; ends stay."""
    steps, x, y = np.array(rows, dtype=float).T
    part = PenPart(np.cumsum(steps) * 1e-3, np.column_stack((x, y)))
    if not moves(part):
        return
    smooth = smooth_part(part)
    size = np.ptp(part.p, axis=0)
    slack = size + 1e-9
    assert (smooth.p >= part.p.min(axis=0) - slack).all()
    assert (smooth.p <= part.p.max(axis=0) + slack).all()
    assert smooth.p[[0, -1]] == pytest.approx(part.p[[0, -1]], abs=1e-6 * size.max())


def smooth_sum(*lognormals):
    t = np.arange(0.0, 2.5, 0.005)
    x = sum(10.0 * lognormal.evaluate(t).done for lognormal in lognormals)
    return smooth_part(PenPart(t, np.column_stack((x, np.zeros_like(x)))))


def test_strokes_apart_are_one_peak_one_salient_interval_and_one_stroke_each():
    lognormals = [Lognormal(0.1, -0.9, 0.25), Lognormal(0.8, -0.9, 0.2), Lognormal(1.4, -0.9, 0.3)]
    smooth = smooth_sum(*lognormals)
    assert smooth.t[speed_peaks(smooth)] == pytest.approx([one.mode for one in lognormals], abs=0.01)
    assert len(salient_points(smooth)) == 4
    chain = initial_chain(smooth)
    assert chain.median == pytest.approx([one.median for one in lognormals], abs=0.03)
    assert chain.width == pytest.approx([math.exp(one.mu) * one.sigma for one in lognormals], rel=0.2)
    assert chain.targets[:, 0] == pytest.approx([0.0, 10.0, 20.0, 30.0], abs=0.5)


def test_a_single_stroke_is_found_by_the_closed_forms_alone():
    lognormal = Lognormal(0.1, -0.5, 0.25)
    smooth = smooth_sum(lognormal)
    chain = initial_chain(smooth)
    assert chain.sigma == pytest.approx([0.25], abs=0.02)
    assert chain.median == pytest.approx([lognormal.median], abs=0.01)
    points = characteristic_points(smooth.t, smooth.speed)
    assert points.times == pytest.approx(points_of(lognormal, 1.0).times, abs=0.01)


def test_a_ripple_counts_as_a_peak_only_above_the_stated_prominence():
    t = np.arange(0.0, 2.0, 0.005)
    for height, n_peaks in ((0.05, 2), (0.002, 1)):
        speed = np.exp(-0.5 * ((t - 0.6) / 0.1) ** 2) + height * np.exp(-0.5 * ((t - 1.4) / 0.06) ** 2)
        smooth = smooth_part(PenPart(t, np.cumsum(speed)[:, None] * [0.005, 0.0]))
        assert len(speed_peaks(smooth)) == n_peaks


def test_candidates_are_where_the_residual_is():
    t = np.arange(0.0, 3.0, 0.005)
    left = np.zeros((len(t), 2))
    for at, height, axis in ((0.5, 2.0, 0), (1.7, -3.0, 1), (2.99, 1.0, 0)):
        left[:, axis] += height * np.exp(-0.5 * ((t - at) / 0.032) ** 2)
    found = best_candidates(t, left, 3)
    assert [candidate.median for candidate in found] == pytest.approx([1.7, 0.5, 2.99], abs=0.011)
    assert found[0].width == 0.032
    assert found[0].energy == pytest.approx(9.0 * math.sqrt(math.pi) * 0.032 / 0.005, rel=0.02)
    assert found[0].energy > found[1].energy > found[2].energy


def test_a_residual_of_nothing_has_no_candidate():
    assert best_candidates(np.arange(100) * 0.005, np.zeros((100, 2)), 4) == []


def points_of(lognormal, length):
    times = (lognormal.inflections.before, lognormal.mode, lognormal.inflections.after)
    return CharacteristicPoints(times, tuple((length * lognormal.evaluate(list(times)).rate).tolist()))


@given(st.floats(-2.0, 2.0), st.floats(-3.0, 1.0), st.floats(0.08, 0.6), st.floats(0.01, 300.0))
def test_any_lognormal_comes_back(t0, mu, sigma, length):
    points = points_of(Lognormal(t0, mu, sigma), length)
    v2, v3, v4 = points.speeds
    found = (sigma_from_peak_ratio(v2 / v3), sigma_from_peak_ratio(v4 / v3), sigma_from_slope_ratio(v4 / v2))
    assert found == pytest.approx((sigma,) * 3, rel=1e-5)
    lognormal = lognormal_from_points(points, sigma)
    assert lognormal.mu == pytest.approx(mu, abs=1e-6)
    assert lognormal.t0 == pytest.approx(t0, abs=1e-6)


def test_a_gaussian_has_sigma_zero_and_no_less():
    assert sigma_from_peak_ratio(math.exp(-0.5)) == pytest.approx(0.0, abs=1e-7)


def chain_of(dim, arc_angles=(0.8, -1.5, 0.0, 1e-5), seed=0):
    rng = np.random.default_rng(seed)
    n = len(arc_angles)
    targets = rng.normal(size=(n + 1, dim))
    chords = np.zeros((n, 3))
    chords[:, :dim] = np.diff(targets, axis=0)
    normal = rng.normal(size=(n, 3)) if dim == 3 else np.tile([0.0, 0.0, 1.0], (n, 1))
    return Chain(
        0.2 + 0.15 * np.arange(n),
        rng.uniform(0.03, 0.06, n),
        rng.uniform(0.1, 0.5, n),
        np.array(arc_angles),
        normals_across(chords, normal),
        targets,
    )


TIMES = np.linspace(-0.2, 1.5, 57)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_chain_is_the_movement_of_the_package(dim):
    chain = chain_of(dim)
    ours = linearise(chain, TIMES, 0, len(chain))
    theirs = sigma_lognormal(chain, 1.0).evaluate(TIMES)
    assert ours.p == pytest.approx(theirs.p[:, :dim], abs=1e-13)
    assert ours.v == pytest.approx(theirs.v[:, :dim], abs=1e-12)
    if dim == 2:
        assert theirs.p[:, 2] == pytest.approx(0.0, abs=1e-13)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("arc_angles", [(0.8, 1e-5), (0.0, -4.4, 0.0011)])
def test_the_jacobian_is_the_derivative(dim, arc_angles):
    chain = chain_of(dim, arc_angles)
    jacobian = linearise(chain, TIMES, 0, len(chain)).jacobian
    assert jacobian.shape == (dim + len(chain) * variables_per_stroke(dim), 2, dim, len(TIMES))
    h = 1e-6
    for column in range(len(jacobian)):
        step = np.zeros(len(jacobian))
        step[column] = h
        ahead, behind = (
            linearise(moved(chain, sign * step, Bounds()), TIMES, 0, len(chain)) for sign in (1.0, -1.0)
        )
        for kind, name in enumerate("pv"):
            numeric = (getattr(ahead, name) - getattr(behind, name)).T / (2.0 * h)
            scale = max(1.0, float(np.abs(numeric).max()))
            assert jacobian[column, kind] == pytest.approx(numeric, abs=2e-7 * scale)


def test_a_piece_of_a_chain_is_evaluated_by_itself():
    chain = chain_of(2)
    late = TIMES[chain.time_at_deviation(6.0)[0] < TIMES]
    whole, piece = linearise(chain, late, 0, len(chain)), linearise(chain, late, 1, len(chain))
    assert piece.p == pytest.approx(whole.p, abs=1e-9)
    assert piece.v == pytest.approx(whole.v, abs=1e-7)


@pytest.mark.parametrize("dim", [2, 3])
def test_inserted_strokes_move_nothing_and_taking_them_out_gives_the_chain_back(dim):
    chain = chain_of(dim)
    longer = inserted(chain, np.array([0.9, 0.31]), np.array([0.03, 0.04]), 0.2)
    assert longer.median.tolist() == sorted(longer.median.tolist())
    assert linearise(longer, TIMES, 0, 6).p == pytest.approx(linearise(chain, TIMES, 0, 4).p, abs=1e-12)
    back = without(longer, np.isin(longer.median, [0.9, 0.31]))
    assert back.targets == pytest.approx(chain.targets)
    assert back.width == pytest.approx(chain.width)
    shorter = without(chain, np.arange(4) == 3)
    assert shorter.targets == pytest.approx(chain.targets[[0, 1, 2, 4]])  # the end of the whole is kept


def test_strokes_put_in_order_still_make_the_same_movement():
    chain = chain_of(2)
    shuffled = Chain(
        chain.median[::-1], chain.width, chain.sigma, chain.arc_angle, chain.normal, chain.targets
    )
    sorted_ = in_order(shuffled)
    assert sorted_.median.tolist() == sorted(chain.median.tolist())
    assert linearise(sorted_, TIMES, 0, 4).p == pytest.approx(linearise(shuffled, TIMES, 0, 4).p, abs=1e-12)


def test_first_strokes_in_space_turn_in_planes_through_their_chords():
    (part,) = recorded(own_strokes(0, 3), 3).parts
    chain = initial_chain(smooth_part(part))
    assert np.abs(chain.arc_angle).max() > 0.3
    assert np.einsum("ij,ij->i", chain.normal, chain.chords) == pytest.approx(np.zeros(5), abs=1e-9)


def test_normals_of_chords_they_are_parallel_to_are_still_across():
    chords = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 0.0]])
    normals = normals_across(chords, np.tile([0.0, 0.0, 1.0], (2, 1)))
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
    assert normals[0] @ chords[0] == pytest.approx(0.0, abs=1e-12)
