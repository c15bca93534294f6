"""All generators together, Fitts and isochrony, human variability, and their files."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client.errors import MovementError
from pc_client.movements.durations import Fitts, Isochrony, chained_windows, retimed
from pc_client.movements.generate import GENERATORS, generate_movement, retimed_twin
from pc_client.movements.lognormal import FULL_COVERAGE, TwoSidedTiming
from pc_client.movements.movement import Movement, load_movement
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke, leg_lengths
from pc_client.movements.variability import HUMAN_STROKE, PUBLISHED, VariabilityRanges, duplicate

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


@settings(max_examples=40)
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


def test_kinds_in_files() -> None:
    kinds = {kind: generate_movement(kind, 4, 1).kind for kind in GENERATORS}
    assert kinds == {
        "lognormal": "lognormal",
        "arcs": "lognormal",
        "isochronous": "lognormal",
        "fitts": "lognormal",
        "duplicate": "lognormal",
        "minimum_jerk": "minimum_jerk",
        "minimum_jerk_via": "minimum_jerk",
        "power_law": "power_law",
        "power_law_3d": "power_law",
        "uniform": "uniform",
        "uniform_blend": "uniform",
    }


def test_names_say_kind_points_and_seed() -> None:
    assert generate_movement("fitts", 4, 9).name == "fitts_4_seed9"
    assert generate_movement("lognormal", 4, 9).name == "lognorm_4_seed9"
    assert generate_movement("power_law", 4, 9, name="mine").provenance["twin"] == "lognorm_4_seed9"


JERK = generate_movement("minimum_jerk", 4, 1).text
POWER = generate_movement("power_law", 4, 1).text


@pytest.mark.parametrize(
    ("text", "change", "complaint"),
    [
        (JERK, ('passing = "stop"', 'passing = "blend"'), "profile.passing: 'blend'; give 'stop' or 'via'"),
        (JERK, ('passing = "stop"', 'passing = "stop"\nramps = [1]'), "profile.ramps: no such key"),
        (JERK, ("duration = 8.685", "duration = 6.0"), "duration: 6.0 s"),
        (JERK, ("stroke_durations", "durations"), "stroke_durations: missing"),
        (
            JERK,
            ('kind = "minimum_jerk"', 'kind = "jerk"'),
            "kind: 'jerk'; give one of lognormal, uniform, minimum_jerk, power_law",
        ),
        (POWER, ("largest_radius = 1.0", "largest_radius = -1.0"), "largest radius of -1.0 m"),
        (POWER, ("largest_radius = 1.0", ""), "profile.largest_radius: missing"),
        (POWER, ("exponent = 0.3333333333333333", "exponent = 3.0"), "exponent 3.0"),
        (POWER, ("[profile]", "[profil]"), "profile: missing"),
    ],
)
def test_bad_files_are_named_by_field(
    text: str, change: tuple[str, str], complaint: str, tmp_path: Path
) -> None:
    assert change[0] in text
    path = tmp_path / "bad.toml"
    path.write_text(text.replace(*change, 1))
    with pytest.raises(MovementError, match=r"bad\.toml") as caught:
        load_movement(path)
    assert complaint in str(caught.value)


def test_power_law_without_stroke_durations_takes_the_passages(tmp_path: Path) -> None:
    path = tmp_path / "short.toml"
    path.write_text("\n".join(line for line in POWER.splitlines() if not line.startswith("stroke_durations")))
    np.testing.assert_allclose(
        load_movement(path).stroke_durations, generate_movement("power_law", 4, 1).stroke_durations, atol=1e-9
    )


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
    ],
)
def test_nonsense_is_refused(make: object) -> None:
    with pytest.raises(MovementError):
        make()
