"""The paper set follows section II: Eq. 6 to 9 for every stroke, straight lines, similar to the movement of a hand."""

from __future__ import annotations

import json
import math
import random
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pc_client import cli
from pc_client.errors import MovementError
from pc_client.kinematics.arms import UR3_BOX
from pc_client.movements.description import describe
from pc_client.movements.durations import TOP_SPEED
from pc_client.movements.generate import generate_movement, uniform_twin
from pc_client.movements.library_sets import library_names
from pc_client.movements.lognormal import LiteralTiming, sigma_for_k
from pc_client.movements.movement import Movement, load_movement
from pc_client.movements.recipes import HAND, random_targets, recipe_movement
from pc_client.movements.sigma_lognormal import LEAD, leg_lengths, literal_strokes
from pc_client.movements.uniform import SETBACK

HUMANS = library_names("paper")[5:]
#: With the seed that each was made by, in order.
SEEDED = [pytest.param(name, seed, id=name) for seed, name in enumerate(HUMANS, start=1)]


def distance_from_lines(p: NDArray[np.float64], targets: NDArray[np.float64]) -> NDArray[np.float64]:
    distances = []
    for a, b in pairwise(targets):
        share = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        distances.append(np.linalg.norm(p - a - share[:, None] * (b - a), axis=1))
    return np.min(distances, axis=0)


@pytest.mark.parametrize("name", HUMANS)
def test_every_stroke_is_centred_hardly_skew_and_of_kurtosis_three(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """From what the command prints, and from mu and sigma alone, as anyone else would compute it."""
    assert cli.run(["movements", "show", name, "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    ends = np.cumsum(figures["stroke_durations_s"])
    assert len(figures["strokes"]) == len(ends) == int(name[-3]) - 1
    for stroke, window, end in zip(figures["strokes"], figures["stroke_durations_s"], ends, strict=True):
        w = math.exp(stroke["sigma"] ** 2)
        skewness, kurtosis = (w + 2.0) * math.sqrt(w - 1.0), w**4 + 2.0 * w**3 + 3.0 * w**2 - 3.0
        assert 0.0 < skewness <= 0.3
        assert 3.0 < kurtosis <= 3.2
        assert (stroke["skewness"], stroke["kurtosis"]) == pytest.approx((skewness, kurtosis))
        mode = stroke["t0_s"] + math.exp(stroke["mu"] - stroke["sigma"] ** 2)
        assert mode == pytest.approx(stroke["mode_s"])
        assert 0.45 <= (mode - (end - window)) / window <= 0.55


@pytest.mark.parametrize("name", HUMANS)
def test_every_stroke_fulfils_the_equations(name: str) -> None:
    movement = load_movement(name)
    ends = np.cumsum(movement.stroke_durations)
    legs = leg_lengths(movement.target_points)
    for stroke, length, end, window in zip(
        describe(movement)["strokes"], legs, ends, movement.stroke_durations, strict=True
    ):
        t0, mu, sigma = stroke["t0_s"], stroke["mu"], stroke["sigma"]
        mode = end - 0.5 * window
        assert stroke["length_m"] == pytest.approx(length, abs=1e-15)  # Eq. 6
        assert mu == pytest.approx(math.log(end - t0) - 3.0 * math.sqrt(2.0) * sigma, abs=1e-9)  # Eq. 7
        assert mode - t0 == pytest.approx(math.exp(mu - sigma**2), abs=1e-9)  # Eq. 8
        k = (end - t0) / (mode - t0)
        assert sigma**2 + 3.0 * math.sqrt(2.0) * sigma - math.log(k) == pytest.approx(0.0, abs=1e-9)  # Eq. 9
        assert k == pytest.approx(4.0 / 3.0, abs=1e-9)


@pytest.mark.parametrize("name", HUMANS)
def test_both_twins_run_the_straight_lines_and_rest_at_every_target_point(name: str) -> None:
    human, robot = load_movement(name), load_movement(name.replace("lognorm", "uniform"))
    t = np.linspace(0.0, human.duration, 4001)
    passages = np.concatenate(([0.0], np.cumsum(human.stroke_durations)))
    for movement in (human, robot):
        # where the tail of a stroke of .25 m/s meets the next, the corner is rounded by nanometres
        assert distance_from_lines(movement.sample(t).p, movement.target_points).max() < 1e-6
        np.testing.assert_allclose(movement.sample(passages).p, movement.target_points, atol=1e-5)
        assert movement.speed(passages).max() < 1e-4
        assert UR3_BOX.contains(movement.sample(t).p)
    assert human.speed(t).max() == pytest.approx(TOP_SPEED, rel=2e-3)


@pytest.mark.parametrize(("name", "seed"), SEEDED)
def test_the_robots_movement_is_the_hands_moved_scaled_turned_and_slowed(name: str, seed: int) -> None:
    movement = load_movement(name)
    n = len(movement.target_points)
    hand = random_targets(n, HAND.box, random.Random(seed), HAND.targets)
    assert not np.allclose(HAND.box.size, UR3_BOX.size)
    scale, stretch = (float(movement.provenance[fact]) for fact in ("scale", "time_stretch"))
    distances = [
        np.linalg.norm(points[:, None] - points, axis=2) for points in (hand, movement.target_points)
    ]
    np.testing.assert_allclose(distances[1], scale * distances[0], atol=2.5e-4)  # points are rounded to .1 mm
    volumes = [np.linalg.det(points[1:4] - points[0]) for points in (hand, movement.target_points)]
    assert volumes[1] / volumes[0] == pytest.approx(scale**3, rel=0.02)  # turned, not mirrored
    strokes = movement.stroke_durations / stretch
    assert np.all((strokes > 0.08) & (strokes < 0.13))  # s: a hand's
    np.testing.assert_array_equal(movement.target_points, np.round(movement.target_points, 4))
    np.testing.assert_array_equal(movement.stroke_durations, np.round(movement.stroke_durations, 3))


def test_the_lead_of_one_window_is_the_one_that_a_hand_allows() -> None:
    """A stroke of .1 s: only then do mu of a hand and the paper's skewness and kurtosis go together."""
    assert LEAD == 1.0
    mu = {
        lead: LiteralTiming(0.0, HAND.stroke, lead * HAND.stroke).lognormal.mu
        for lead in (0.0, 0.5, 1.0, 2.0)
    }
    assert [lead for lead, value in mu.items() if -2.2 <= value <= -1.6] == [LEAD]
    assert sigma_for_k(4.0 / 3.0) == pytest.approx(0.066756911, abs=1e-9)


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 7))
def test_any_seed_stays_in_the_box_at_the_top_speed(seed: int, n: int) -> None:
    movement = recipe_movement(n, seed, "x")
    assert UR3_BOX.shrunk(0.0149).contains(movement.target_points)
    assert movement.speed(np.linspace(0.0, movement.duration, 4001)).max() == pytest.approx(
        TOP_SPEED, rel=5e-3
    )
    assert movement.provenance["seed"] == seed


def test_durations_must_go_with_the_points() -> None:
    with pytest.raises(MovementError, match="1 stroke durations for 3 target points: give 2"):
        literal_strokes(np.eye(3), [1.0])


def test_corners_are_stops_or_blends_with_a_stated_setback() -> None:
    human = load_movement("lognorm_4_1")
    stop, blend = uniform_twin(human, "stop"), uniform_twin(human, "blend", "blend")
    wide = uniform_twin(human, "wide", "blend", 0.04)
    made = generate_movement("uniform", 4, 1, corners="blend")
    passages = np.cumsum(human.stroke_durations)[:-1]

    def least(movement: Movement) -> float:
        return float(movement.speed(passages).min())

    assert least(stop) < 1e-9
    assert min(least(blend), least(wide)) > 0.03
    np.testing.assert_array_equal(made.sample(passages).p, blend.sample(passages).p)
    for movement, setback in ((blend, SETBACK), (wide, 0.04)):
        np.testing.assert_array_equal(movement.stroke_durations, human.stroke_durations)
        missed = np.linalg.norm(movement.sample(passages).p - human.target_points[1:-1], axis=1)
        assert np.all((missed > 1e-3) & (missed < setback))
        t = np.linspace(0.0, movement.duration, 4001)
        p = movement.sample(t).p
        off = distance_from_lines(p, human.target_points) > 1e-9
        assert off.any()
        nearest = np.linalg.norm(p[off][:, None] - human.target_points[1:-1], axis=2).min(axis=1)
        assert nearest.max() < setback + 1e-6
