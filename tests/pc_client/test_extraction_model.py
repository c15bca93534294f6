"""The arrays of the fit are the package's own movement, and its Jacobian is the derivative of it."""

from __future__ import annotations

import numpy as np
import pytest

from pc_client.studies.extraction.chain import (
    Bounds,
    Chain,
    in_order,
    inserted,
    normals_across,
    sigma_lognormal,
    without,
)
from pc_client.studies.extraction.refine import linearise, moved, variables_per_stroke


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


TIMES = np.linspace(-0.2, 1.5, 83)


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
@pytest.mark.parametrize("arc_angles", [(0.8, -1.5, 0.3), (1e-5, 0.0, -2e-4), (4.4, -4.4, 0.0011)])
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


def test_strokes_put_in_order_still_make_the_same_movement():
    chain = chain_of(2)
    shuffled = Chain(
        chain.median[::-1], chain.width, chain.sigma, chain.arc_angle, chain.normal, chain.targets
    )
    sorted_ = in_order(shuffled)
    assert sorted_.median.tolist() == sorted(chain.median.tolist())
    assert linearise(sorted_, TIMES, 0, 4).p == pytest.approx(linearise(shuffled, TIMES, 0, 4).p, abs=1e-12)


def test_normals_of_chords_they_are_parallel_to_are_still_across():
    chords = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 0.0]])
    normals = normals_across(chords, np.tile([0.0, 0.0, 1.0], (2, 1)))
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
    assert normals[0] @ chords[0] == pytest.approx(0.0, abs=1e-12)
