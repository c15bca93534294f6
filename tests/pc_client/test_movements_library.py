"""What both sets of the library promise to those who run them: rest, twins, speeds, joints, expected SNR."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client.errors import MovementError, PlanningError
from pc_client.kinematics.arms import ROBOTS, UR3_BOX, Box
from pc_client.kinematics.model import robot_model
from pc_client.movements.description import snr_of_delay, speed_rms_frequency
from pc_client.movements.generate import generate_movement
from pc_client.movements.library_sets import library_names
from pc_client.movements.lognormal import TwoSidedTiming
from pc_client.movements.movement import Movement, load_movement
from pc_client.movements.recipes import TargetRules, random_targets
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke
from pc_client.planning.plan import make_plan, plan_movement

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


@pytest.mark.parametrize("name", PAPER + ARCS)
def test_a_ur3_can_do_it(name: str) -> None:
    """Every check of planning: reach, one branch, singularities, speeds, accelerations, clearances."""
    report = plan_movement(load_movement(name)).report
    assert report.joint_speed.value < 1.2  # rad/s
    assert report.joint_acceleration.value < 4.2  # rad/s^2


@pytest.mark.parametrize("arm", [name for name in ROBOTS if name != "ur10"])
def test_every_other_arm_can_do_one_that_comes_near_the_base(arm: str) -> None:
    planned = make_plan(load_movement("lognorm_4_1"), robot_model(arm)).movement
    assert ROBOTS[arm].working_box.contains(planned.target_points, 0.025)  # a UR5 does it where a UR3 does


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


@pytest.mark.parametrize("window", [0.5, 1.0, 2.0])
def test_delay_costs_what_the_theory_says(window: float) -> None:
    """Four separate strokes of one length: 20.0 dB at 16 ms and T = 1 s, the same for the same delay / T."""
    timings = [TwoSidedTiming(window * j, window, 0.1) for j in range(4)]
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0], [0.0, 0.1, 0.1]])
    trajectory = SigmaLognormal(points, tuple(Stroke(timing) for timing in timings), 4.0 * window)
    movement = Movement("four", trajectory, np.full(4, window))
    assert snr_of_delay(movement, 0.016 * window) == pytest.approx(20.0, abs=0.06)
    assert snr_of_delay(movement, 0.024 * window) == pytest.approx(16.5, abs=0.06)
    assert snr_of_delay(movement, 0.048 * window) == pytest.approx(10.5, abs=0.06)


def test_sums_of_strokes_reach_the_last_target() -> None:
    for name in PAPER[5:] + ARCS[5:]:
        movement = load_movement(name)
        assert np.linalg.norm(movement.trajectory.evaluate(60.0).p[0] - movement.target_points[-1]) < 1e-14


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


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 6))
def test_generated_twins_share_targets_and_times(seed: int, n: int) -> None:
    human, robot = generate_movement("lognormal", n, seed), generate_movement("uniform", n, seed)
    np.testing.assert_array_equal(human.target_points, robot.target_points)
    np.testing.assert_array_equal(human.stroke_durations, robot.stroke_durations)
    t = np.linspace(0.0, human.duration, 1001)
    for movement in (human, robot):
        assert movement.speed([0.0, movement.duration]).max() < 1e-4
        assert movement.speed(t).max() < 0.35
        assert UR3_BOX.contains(movement.sample(t).p, 0.005)


@pytest.mark.parametrize(
    "make",
    [
        lambda: generate_movement("samples", 4, 1),
        lambda: generate_movement("lognormal", 1, 1),
        lambda: generate_movement("lognormal", 4, -1),
        lambda: generate_movement("fitts", 4, 1, corners="blend"),
        lambda: random_targets(12, Box((0.0, 0.0, 0.0), (0.08, 0.08, 0.08)), random.Random(1)),
        lambda: Box((0.0, 0.0, 0.0), (0.1, -0.1, 0.1)),
        lambda: UR3_BOX.shrunk(0.2),
    ],
)
def test_nonsense_is_refused(make: object) -> None:
    with pytest.raises(MovementError):
        make()
