"""How movements are made: all generators, the library and its recipe, variability, fitting into the workspace."""

from __future__ import annotations

import json
import math
import random
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pc_client import cli
from pc_client.errors import MovementError, PlanningError
from pc_client.kinematics.arms import ROBOTS, UR3_BOX, Box
from pc_client.kinematics.model import robot_model
from pc_client.movements.description import describe, snr_of_delay, speed_rms_frequency
from pc_client.movements.durations import TOP_SPEED, Fitts, Isochrony, chained_windows, retimed
from pc_client.movements.generate import GENERATORS, generate_movement, retimed_twin, uniform_twin
from pc_client.movements.library_sets import library_names
from pc_client.movements.lognormal import FULL_COVERAGE, TwoSidedTiming
from pc_client.movements.movement import Movement, load_movement
from pc_client.movements.recipes import (
    HAND_BOX,
    HAND_TARGETS,
    TargetRules,
    fit_movement,
    random_targets,
    recipe_movement,
)
from pc_client.movements.samples import SampledTrajectory
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke, leg_lengths, literal_strokes
from pc_client.movements.trajectory import Similarity
from pc_client.movements.uniform import SETBACK
from pc_client.movements.variability import HUMAN_STROKE, PUBLISHED, VariabilityRanges, duplicate
from pc_client.planning.plan import make_plan, plan_movement

HUMAN = load_movement("arcs/lognorm_5_1")


@pytest.mark.parametrize("kind", GENERATORS)
def test_every_kind_keeps_targets_and_time_and_survives_saving(kind: str, tmp_path: Path) -> None:
    human, made = generate_movement("lognormal", 5, 3), generate_movement(kind, 5, 3, name="made")
    assert made.duration == pytest.approx(human.duration, abs=1e-9)
    if GENERATORS[kind].same_strokes:
        np.testing.assert_array_equal(made.stroke_durations, human.stroke_durations)
    if GENERATORS[kind].same_targets:
        np.testing.assert_array_equal(made.target_points, human.target_points)
    else:  # as the table says: all but the first move
        np.testing.assert_array_equal(made.target_points[0], human.target_points[0])
        assert np.linalg.norm(made.target_points - human.target_points, axis=1)[1:].min() > 1e-3
    ends = made.motion([0.0, made.duration])
    np.testing.assert_allclose(ends.p, made.target_points[[0, -1]], atol=1e-5)
    assert np.linalg.norm(ends.v, axis=1).max() < 1e-4
    made.save(tmp_path / "made.toml")
    copy = load_movement(tmp_path / "made.toml")
    assert (copy.name, copy.kind, dict(copy.provenance)) == ("made", made.kind, dict(made.provenance))
    t = np.linspace(0.0, made.duration, 301)
    for got, expected in zip(copy.motion(t), made.motion(t), strict=True):
        np.testing.assert_array_equal(got, expected)


@settings(max_examples=20)
@given(kind=st.sampled_from(list(GENERATORS)), n=st.integers(2, 7), seed=st.integers(0, 10**6))
def test_any_movement_of_any_kind_is_smooth_from_rest_to_rest(kind: str, n: int, seed: int) -> None:
    made = generate_movement(kind, n, seed)
    t = np.linspace(0.0, made.duration, 4001)
    motion = made.motion(t)
    assert all(np.all(np.isfinite(values)) for values in motion)
    assert np.linalg.norm(motion.v[[0, -1]], axis=1).max() < 1e-3
    np.testing.assert_allclose(motion.p[[0, -1]], made.target_points[[0, -1]], atol=1e-5)
    # positions belong to velocities: no step is longer than the top speed allows
    steps = np.linalg.norm(np.diff(motion.p, axis=0), axis=1) / t[1]
    assert steps.max() <= made.speed(t).max() * (1.0 + 1e-3)
    assert np.all(made.stroke_durations > 0.0)


def test_names_say_kind_points_and_seed() -> None:
    assert generate_movement("fitts", 4, 9).name == "fitts_4_seed9"
    assert generate_movement("lognormal", 4, 9).name == "lognorm_4_seed9"
    assert generate_movement("power_law", 4, 9, name="mine").provenance["twin"] == "lognorm_4_seed9"


# --- durations


def test_fitts_law() -> None:
    """Every doubling of the distance, or halving of the width, costs one slope more."""
    trajectory = Fitts(intercept=0.2, slope=0.15, width=0.02)
    np.testing.assert_allclose(
        trajectory.durations(np.array([0.01, 0.02, 0.04, 0.16])), [0.2, 0.35, 0.5, 0.8], atol=1e-15
    )
    assert Fitts(0.2, 0.15, 0.01).durations(np.array([0.02]))[0] == pytest.approx(0.5, abs=1e-15)
    with pytest.raises(MovementError, match="no time"):
        trajectory.durations(np.array([0.001]))


def test_isochrony() -> None:
    lengths = np.array([0.05, 0.1, 0.2])
    np.testing.assert_array_equal(Isochrony().durations(lengths), 1.0)
    np.testing.assert_allclose(np.diff(np.log(Isochrony(0.3, 2.0).durations(lengths))), 0.3 * math.log(2.0))


def test_strict_isochrony_keeps_mu_and_sigma_and_scales_only_the_length() -> None:
    twin = retimed_twin(HUMAN, "iso", Isochrony())
    assert isinstance(twin.trajectory, SigmaLognormal)
    lognormals = [stroke.timing.lognormal for stroke in twin.trajectory.strokes]
    assert len({lognormal.sigma for lognormal in lognormals}) == 1
    assert (
        max(lognormal.mu for lognormal in lognormals) - min(lognormal.mu for lognormal in lognormals) < 1e-12
    )
    np.testing.assert_allclose(np.diff([lognormal.t0 for lognormal in lognormals], 2), 0.0, atol=1e-12)
    np.testing.assert_array_equal(twin.trajectory.lengths, HUMAN.trajectory.lengths)


def test_fitts_timed_strokes_have_windows_in_the_laws_proportions() -> None:
    trajectory = retimed(HUMAN.trajectory, Fitts(), overlap=0.4, rest=0.1)
    windows = [stroke.timing.duration for stroke in trajectory.strokes]
    wanted = Fitts().durations(leg_lengths(HUMAN.target_points))
    np.testing.assert_allclose(windows / wanted, windows[0] / wanted[0], rtol=1e-12)
    assert trajectory.strokes[0].timing.start == 0.1
    last = trajectory.strokes[-1].timing
    assert last.start + last.duration == pytest.approx(trajectory.duration - 0.1, abs=1e-12)


@given(
    proportions=st.lists(st.floats(0.1, 10.0), min_size=1, max_size=8),
    total=st.floats(0.1, 100.0),
    overlap=st.floats(0.0, 0.9),
)
def test_windows_overlap_by_their_share_and_fill_the_total(
    proportions: list[float], total: float, overlap: float
) -> None:
    begins, lengths = chained_windows(proportions, total, overlap)
    assert begins[0] == 0.0
    assert begins[-1] + lengths[-1] == pytest.approx(total)
    np.testing.assert_allclose(lengths / lengths[0], np.array(proportions) / proportions[0])
    shared = begins[:-1] + lengths[:-1] - begins[1:]
    np.testing.assert_allclose(shared, overlap * np.minimum(lengths[:-1], lengths[1:]), atol=1e-9 * total)


# --- variability


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32), share=st.floats(0.0, 1.0), number=st.sampled_from(["4_1", "5_2"]))
def test_duplicates_are_valid_and_inside_the_published_ranges(seed: int, share: float, number: str) -> None:
    original = load_movement(f"arcs/lognorm_{number}")
    copy = duplicate(original, seed, share=share)
    trajectory, old = copy.trajectory, original.trajectory
    assert isinstance(trajectory, SigmaLognormal)
    slack = 1e-9
    low, high = (share * np.array([r[side] for r in (PUBLISHED.length, PUBLISHED.sigma)]) for side in (0, 1))
    sigma, old_sigma = (np.array([s.timing.lognormal.sigma for s in x.strokes]) for x in (trajectory, old))
    for change, least, most in zip(
        (trajectory.lengths / old.lengths, sigma / old_sigma), low, high, strict=True
    ):
        assert np.all(change > 1.0 + least - slack)
        assert np.all(change < 1.0 + most + slack)
    assert np.all(sigma > 0.0)
    # one pace and one rhythm for the whole movement
    t0, old_t0 = (np.diff([s.timing.lognormal.t0 for s in x.strokes]) for x in (trajectory, old))
    np.testing.assert_allclose(t0 / old_t0, t0[0] / old_t0[0], rtol=1e-6)
    assert 1.0 - 0.085 * share - slack < t0[0] / old_t0[0] < 1.0 + 0.0825 * share + slack
    shift = math.log(float(np.median(original.stroke_durations)) / HUMAN_STROKE)
    mu, old_mu = (np.array([s.timing.lognormal.mu for s in x.strokes]) for x in (trajectory, old))
    human, old_human = mu - shift, old_mu - shift
    assert np.all(old_human < -1.5)  # as published for hands, so a relative change means what it says there
    np.testing.assert_allclose(human / old_human, human[0] / old_human[0], rtol=1e-9)
    assert 1.0 - 0.3775 * share - slack < human[0] / old_human[0] < 1.0 + 0.395 * share + slack
    # directions of begin and end: at most 3 % of a quarter turn, in the plane of the arc
    for a, b in zip(trajectory.strokes, old.strokes, strict=True):
        assert abs(a.arc_angle - b.arc_angle) < share * 0.5 * math.pi * 0.045 + slack
    assert copy.speed([0.0, copy.duration]).max() < 1e-4
    assert math.fsum(copy.stroke_durations) == pytest.approx(copy.duration, abs=1e-6)


def test_a_duplicate_of_no_share_is_the_movement_itself() -> None:
    copy = duplicate(HUMAN, 7, share=0.0)
    t = np.linspace(0.0, HUMAN.duration, 500)
    assert copy.duration == pytest.approx(HUMAN.duration, abs=1e-9)
    for got, expected in zip(copy.motion(t), HUMAN.motion(t), strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-9)


def test_duplicates_differ_by_seed_and_are_reproducible() -> None:
    one, same, other = (duplicate(HUMAN, seed) for seed in (1, 1, 2))
    assert one.text == same.text
    assert one.name == "arcs_lognorm_5_1_v1"
    assert not np.allclose(one.target_points, other.target_points)
    assert dict(one.provenance)["variation_seed"] == 1


def test_turned_directions_stay_in_the_plane_of_the_arc() -> None:
    """Only the angles vary: a stroke in the plane z = 0 stays there, and turns by what was asked."""
    points = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]])
    trajectory = SigmaLognormal(points, (Stroke(TwoSidedTiming(0.1, 1.0, 0.1), 0.5, -math.pi / 2),), 1.2)
    nothing = (0.0, 0.0)
    ranges = VariabilityRanges(nothing, nothing, nothing, nothing, (0.1, 0.1), (0.2, 0.2))
    copy = duplicate(Movement("flat", trajectory, np.array([1.2])), 1, ranges=ranges)
    motion = copy.motion(np.linspace(0.3, 0.9, 20))
    np.testing.assert_allclose(motion.p[:, 2], 0.0, atol=1e-15)
    assert copy.trajectory.strokes[0].arc_angle == pytest.approx(0.5 + 0.05 * math.pi)
    chord = copy.target_points[1] - copy.target_points[0]
    assert math.atan2(chord[1], chord[0]) == pytest.approx(0.075 * math.pi)
    assert copy.trajectory.lengths[0] == pytest.approx(trajectory.lengths[0], abs=1e-15)


def test_slowing_a_movement_down_changes_nothing_about_its_duplicates() -> None:
    """The point of human time: the same seed gives the same duplicate, slower."""
    slow, quick = duplicate(HUMAN.stretched(3.0), 5), duplicate(HUMAN, 5)
    t = np.linspace(0.0, quick.duration, 200)
    assert slow.duration == pytest.approx(3.0 * quick.duration, rel=1e-9)
    np.testing.assert_allclose(slow.sample(3.0 * t).p, quick.sample(t).p, atol=1e-9)


def test_rests_of_the_original_are_kept() -> None:
    copy = duplicate(HUMAN, 3)
    begins = [s.timing.lognormal.time_at_deviation(-FULL_COVERAGE) for s in copy.trajectory.strokes]
    ends = [s.timing.lognormal.time_at_deviation(FULL_COVERAGE) for s in copy.trajectory.strokes]
    assert min(begins) == pytest.approx(0.1, abs=1e-9)
    assert copy.duration - max(ends) == pytest.approx(0.1, abs=1e-9)


# --- the library


PAPER, ARCS = library_names("paper"), library_names("arcs")


@pytest.mark.parametrize("name", PAPER[5:] + ARCS[5:])
def test_twins(name: str) -> None:
    human, robot = load_movement(name), load_movement(name.replace("lognorm", "uniform"))
    assert (human.kind, robot.kind) == ("lognormal", "uniform")
    assert len(human.target_points) == len(robot.target_points) == int(name[-3])
    np.testing.assert_array_equal(human.target_points, robot.target_points)
    np.testing.assert_array_equal(human.stroke_durations, robot.stroke_durations)
    assert human.duration == pytest.approx(robot.duration, abs=1e-12)
    # the two paths are equally long: the same lines, or arcs that are bent but cut at the corners
    t = np.linspace(0.0, human.duration, 4001)
    lengths = [m.speed(t).mean() * m.duration for m in (human, robot)]
    assert lengths[0] == pytest.approx(lengths[1], rel=0.03 if name in ARCS else 1e-3)


@pytest.mark.parametrize("name", ARCS[5:])
def test_a_stroke_of_the_arcs_ends_where_the_speed_is_least(name: str) -> None:
    human = load_movement(name)
    assert isinstance(human.trajectory, SigmaLognormal)
    np.testing.assert_allclose(
        np.cumsum(human.stroke_durations)[:-1], human.trajectory.speed_minima(), atol=5.1e-4
    )


@pytest.mark.parametrize(
    "arm",
    [
        arm if arm in ("ur3", "ur5e", "ur20") else pytest.param(arm, marks=pytest.mark.nightly)
        for arm in ROBOTS
    ],
)
def test_every_arm_can_do_the_library_in_its_own_box(arm: str) -> None:
    model, box = robot_model(arm), ROBOTS[arm].working_box
    planned = make_plan(load_movement("lognorm_4_1"), model).movement
    shift = planned.target_points[0] - load_movement("lognorm_4_1").target_points[0]
    for name in PAPER:
        moved = load_movement(name).transformed(Similarity(1.0, np.eye(3), shift))
        assert box.contains(moved.target_points, 1e-9)
        plan_movement(moved, model=model, dt=0.02)


@pytest.mark.parametrize("low", [(0.2, -0.5, 0.1), (0.25, 0.1, 0.0), (0.3, -1.0, 0.3)])
def test_the_library_goes_to_any_box_that_is_large_enough(low: tuple[float, float, float]) -> None:
    box = Box(low, (low[0] + 0.15, low[1] + 0.4, low[2] + 0.2))
    shift = replace(ROBOTS["ur3"], working_box=box).library_shift
    np.testing.assert_allclose(np.add(UR3_BOX.low, shift), low, atol=1e-12)


def test_a_movement_of_a_user_stays_where_it_is() -> None:
    own = replace(load_movement("lognorm_4_1"), may_be_moved=False)
    with pytest.raises(PlanningError, match="move the movement away from the base"):
        make_plan(own, robot_model("ur5e"))


@pytest.mark.parametrize("name", PAPER + ARCS)
def test_begins_and_ends_at_rest_in_the_box_within_the_speed(name: str) -> None:
    movement = load_movement(name)
    assert movement.speed([0.0, movement.duration]).max() < 1e-4
    np.testing.assert_allclose(
        movement.sample([0.0, movement.duration]).p, movement.target_points[[0, -1]], atol=5e-6
    )
    t = np.linspace(0.0, movement.duration, 4001)
    assert UR3_BOX.contains(movement.sample(t).p)
    assert 0.05 < movement.speed(t).max() < 0.30
    assert 5.0 < movement.duration < 15.0


@pytest.mark.parametrize("name", PAPER + ARCS)
def test_expected_snr_follows_from_the_rms_frequency(name: str) -> None:
    movement = load_movement(name)
    w = speed_rms_frequency(movement)
    for delay in (0.005, 0.022, 0.035):
        assert snr_of_delay(movement, delay) == pytest.approx(-20.0 * math.log10(delay * w), abs=0.15)
    with pytest.raises(MovementError):
        snr_of_delay(movement, 0.0)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32), n=st.integers(2, 7))
def test_random_targets_follow_their_rules(seed: int, n: int) -> None:
    rules = TargetRules()
    points = random_targets(n, UR3_BOX, random.Random(seed), rules)
    assert points.shape == (n, 3)
    assert UR3_BOX.contains(points, 1e-12)
    legs = np.diff(points, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    assert rules.min_leg <= lengths.min()
    assert lengths.max() <= rules.max_leg
    cosines = np.einsum("ij,ij->i", legs[:-1], legs[1:]) / (lengths[:-1] * lengths[1:])
    turns = np.arccos(np.clip(cosines, -1.0, 1.0))
    assert np.all(turns >= rules.min_turn - 1e-9)
    assert np.all(turns <= rules.max_turn + 1e-9)
    apart = [math.dist(a, b) for i, a in enumerate(points) for b in points[:i]]
    assert min(apart) >= rules.min_apart
    np.testing.assert_array_equal(points, random_targets(n, UR3_BOX, random.Random(seed), rules))


# --- the recipe of the paper


HUMANS = PAPER[5:]
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
    hand = random_targets(n, HAND_BOX, random.Random(seed), HAND_TARGETS)
    assert not np.allclose(HAND_BOX.size, UR3_BOX.size)
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


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 7))
def test_any_seed_stays_in_the_box_at_the_top_speed(seed: int, n: int) -> None:
    movement = recipe_movement(n, seed, "x")
    assert UR3_BOX.shrunk(0.0149).contains(movement.target_points)
    assert movement.speed(np.linspace(0.0, movement.duration, 4001)).max() == pytest.approx(
        TOP_SPEED, rel=5e-3
    )
    assert movement.provenance["seed"] == seed
    scale, stretch = (float(movement.provenance[fact]) for fact in ("scale", "time_stretch"))
    legs = np.linalg.norm(np.diff(movement.target_points, axis=0), axis=1) / scale
    # A hand's stroke of 37.5 mm lasts .1 s, others by the power .3 of their length, each up to 8 % off.
    factors = movement.stroke_durations / stretch / (0.1 * (legs / 0.0375) ** 0.3)
    assert np.all((factors > 0.9) & (factors < 1.1))


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


# --- fitting into the workspace


SHARES = np.linspace(0.0, 1.0, 1501)


def drawing() -> Movement:
    """A flat figure such as a pen makes, 40 units wide."""
    t = np.linspace(0.0, 2.0, 60)
    points = np.column_stack((20.0 * np.cos(3.0 * t), 8.0 * np.sin(5.0 * t), np.zeros_like(t)))
    return Movement("drawing", SampledTrajectory(t, points), np.array([2.0]))


@pytest.mark.parametrize("name", ["drawing", "lognorm_5_1", "uniform_4_2"])
def test_fills_the_box_with_the_same_speed_shape(name: str) -> None:
    movement = drawing() if name == "drawing" else load_movement(name)
    fit = fit_movement(movement)
    t = SHARES * movement.duration
    p = fit.movement.sample(t).p
    assert UR3_BOX.contains(p, 1e-5)
    assert (np.ptp(p, axis=0) / UR3_BOX.size).max() == pytest.approx(1.0, abs=1e-4)
    np.testing.assert_allclose(0.5 * (p.min(axis=0) + p.max(axis=0)), UR3_BOX.centre, atol=1e-4)
    assert fit.stretch == 1.0
    assert fit.movement.duration == movement.duration
    np.testing.assert_allclose(
        fit.movement.speed(t), fit.similarity.scale * movement.speed(t), rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(p, fit.similarity.points(movement.sample(t).p), atol=1e-12)


def test_turning_makes_more_room() -> None:
    extent = np.ptp(drawing().sample(SHARES * 2.0).p, axis=0)[:2]
    assert fit_movement(drawing()).similarity.scale > float((UR3_BOX.size[:2] / extent).min())


def test_slows_down_only_when_asked() -> None:
    movement = drawing()
    fit = fit_movement(movement, max_speed=0.25)
    t = SHARES * fit.movement.duration
    assert fit.stretch > 1.0
    assert fit.movement.duration == pytest.approx(fit.stretch * movement.duration)
    assert fit.movement.speed(t).max() == pytest.approx(0.25, rel=1e-3)
    np.testing.assert_allclose(fit.movement.stroke_durations, fit.stretch * movement.stroke_durations)
    assert fit_movement(movement, max_speed=100.0).stretch == 1.0


@settings(max_examples=15)
@given(
    angle=st.floats(-math.pi, math.pi),
    scale=st.floats(1e-3, 1e3),
    shift=st.tuples(*(st.floats(-10.0, 10.0) for _ in range(3))),
)
def test_where_a_movement_came_from_does_not_matter(
    angle: float, scale: float, shift: tuple[float, float, float]
) -> None:
    movement = load_movement("lognorm_5_3")
    elsewhere = Similarity(scale, Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix(), np.array(shift))
    t = SHARES * movement.duration
    fitted = fit_movement(movement).movement
    again = fit_movement(movement.transformed(elsewhere)).movement
    # the angle is searched in half degrees, so the size is the same within one per cent
    ratio = again.speed(t).max() / fitted.speed(t).max()
    assert ratio == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(again.speed(t), ratio * fitted.speed(t), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    "make",
    [
        lambda: duplicate(load_movement("uniform_4_1"), 1),
        lambda: duplicate(HUMAN, -1),
        lambda: duplicate(HUMAN, 1, share=1.5),
        lambda: retimed_twin(load_movement("uniform_4_1"), "x", Fitts()),
        lambda: retimed(HUMAN.trajectory, Fitts(), overlap=0.4, rest=9.0),
        lambda: chained_windows([1.0, 0.0], 1.0, 0.1),
        lambda: chained_windows([1.0], 0.0, 0.1),
        lambda: chained_windows([1.0], 1.0, 1.0),
        lambda: Fitts(slope=-0.1),
        lambda: Fitts(width=0.0),
        lambda: Isochrony(math.nan),
        lambda: generate_movement("jerk", 4, 1),
        lambda: generate_movement("samples", 4, 1),
        lambda: generate_movement("lognormal", 1, 1),
        lambda: generate_movement("lognormal", 4, -1),
        lambda: generate_movement("fitts", 4, 1, corners="blend"),
        lambda: random_targets(12, Box((0.0, 0.0, 0.0), (0.08, 0.08, 0.08)), random.Random(1)),
        lambda: Box((0.0, 0.0, 0.0), (0.1, -0.1, 0.1)),
        lambda: UR3_BOX.shrunk(0.2),
        lambda: fit_movement(
            Movement("dot", SampledTrajectory(np.arange(4.0), np.ones((4, 3))), np.array([3.0]))
        ),
        lambda: fit_movement(drawing(), Box((0.0, 0.0, 0.0), (0.0, 1.0, 1.0))),
        lambda: drawing().stretched(0.0),
        lambda: Movement("", drawing().trajectory, np.array([2.0])),
        lambda: Movement("x", drawing().trajectory, np.array([1.0])),
    ],
)
def test_nonsense_is_refused(make: object) -> None:
    with pytest.raises(MovementError):
        make()
