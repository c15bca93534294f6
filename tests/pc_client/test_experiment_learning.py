"""The controller `best` in a whole experiment: it learns what repeats, and only from clean runs within limits."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fake_robot import PERIOD, FakeRobot
from planning_paths import prepare_experiment

from pc_client.control.controller import CONTROLLERS
from pc_client.control.gear import GearModel
from pc_client.control.learning import design_filter
from pc_client.control.loop import LoopModel
from pc_client.control.reference import ReferenceTable, RunRecipe
from pc_client.driver.session import UrDriver
from pc_client.driver.velocity_stream import StreamLog, StreamReport
from pc_client.errors import DriverError
from pc_client.experiment import prediction
from pc_client.experiment import run as runner
from pc_client.experiment.excitation import learning_filter
from pc_client.experiment.prediction import broken_limit, guarded
from pc_client.experiment.run import ExperimentRunner, Memory
from pc_client.movements.movement import Movement, load_movement
from pc_client.planning.plan import plan_movement
from pc_client.recording.recording import load_recording
from pc_client.recording.rows import Phase

POSTURE = [0.4, -1.77, -2.1, -0.1, 1.3, 1.86]
BEST = CONTROLLERS["best"]
LOOP = LoopModel(0.024, 0.010, 0.001, 0.0)


class WavyRobot(FakeRobot):
    """An arm whose gears are as uneven as real ones."""

    gear = GearModel(np.full((2, 6), [[80.0], [160.0]]), np.full((2, 6), [[1e-4], [4e-5]]), np.zeros((2, 6)))

    def follow(self):
        motor = np.array(self.q)
        for _ in range(5):
            motor = np.array(self.q) - self.gear.error(motor)[0]
        self.q = motor.tolist()
        super().follow()
        self.q = (np.array(self.q) + self.gear.error(np.array(self.q))[0]).tolist()


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    points = [(0.35, -0.1, 0.25), (0.3, 0.1, 0.32), (0.38, 0.0, 0.2)]
    movements = [
        Movement.through(points, "robot", [1.6, 1.6], name="robot"),
        Movement.through(points[::-1], "human", [1.6, 1.6], name="human"),
    ]
    return prepare_experiment(movements, repeat=3, out=tmp_path_factory.mktemp("unused"))


@pytest.fixture(scope="module")
def plan():
    return plan_movement(load_movement("lognorm_4_1"))


def run(robot, experiment, out, config=BEST):
    robot.q = list(POSTURE)
    with UrDriver("robot", network=robot) as driver:
        report = ExperimentRunner(driver, replace(experiment, out=out), config).run()
    return report, [load_recording(path) for path in report.paths]


def speed_error(recording):
    """rms of the differenced joint error over the movement [rad/s]."""
    moving = recording.rows_of(Phase.MOVEMENT)
    error = (recording.column("ref_q") - recording.column("actual_q"))[moving]
    return float(np.sqrt(np.mean(np.square(np.diff(error, axis=0) / PERIOD))))


def test_runs_teach_the_next_ones_and_the_gears_all_movements(two, tmp_path):
    report, recordings = run(WavyRobot(), two, tmp_path)
    assert report.remarks == []
    assert [r.summary["learned_from"] for r in recordings] == [0, 1, 2, 0, 1, 2]
    assert [r.summary["gear_waves"] > 0 for r in recordings] == [False] * 3 + [True] * 3
    first, second, third, other, _, last = [speed_error(r) for r in recordings]
    assert second < 0.4 * first
    assert third < 0.2 * first
    assert other < 0.4 * first  # its gears are known before it has run
    assert last < 0.2 * first


@pytest.mark.parametrize("lockstep", [True, False])
def test_facts_of_the_loop_go_with_the_recording(two, tmp_path, lockstep):
    short = replace(two, planned=two.planned[:1], repeat=1)
    report, (recording,) = run(WavyRobot(lockstep=lockstep), short, tmp_path)
    loop = recording.provenance.loop
    assert loop == dict(report.delay.facts())
    assert loop["dead_time_s"] + loop["lag_s"] == pytest.approx(3 * PERIOD, abs=1e-3)
    assert loop["gain_margin"] > 4.0
    assert loop["learning_contraction"] < 1.0
    assert recording.provenance.controller_config["uses_ilc"] is True


@pytest.mark.parametrize(
    "changes", [{}, {"uses_ilc": True}, {"compensates_gear": True}, {"compensates_lag": True}]
)
def test_the_guard_is_made_for_the_reference_that_runs(two, tmp_path, monkeypatch, changes):
    predicted, followed = [], []

    def spy(known, kind):
        return lambda table, *others: known.append(table.commands()) or kind(table, *others)

    monkeypatch.setattr(prediction, "ToolGuard", spy(predicted, prediction.ToolGuard))
    monkeypatch.setattr(runner, "Tracker", spy(followed, runner.Tracker))
    one = replace(two, planned=two.planned[:1], repeat=1)
    run(WavyRobot(), one, tmp_path, replace(CONTROLLERS["preview"], **changes))
    np.testing.assert_array_equal(predicted[-1], followed[-1])


def test_the_guard_allows_what_the_loop_predicts_and_a_margin(two, plan):
    own = CONTROLLERS["paper"]
    recipe, predicted = guarded(plan, replace(RECIPE, controller=own), two.model)
    assert recipe.controller.path_tolerance == pytest.approx(predicted.distance + 0.005)
    assert recipe.controller.angle_tolerance == pytest.approx(predicted.angle + 0.035)
    assert recipe.controller.path_tolerance < own.path_tolerance


def test_preview_neither_learns_nor_separates_lag_from_delay(two, tmp_path):
    short = replace(two, planned=two.planned[:1], repeat=2)
    report, recordings = run(WavyRobot(), short, tmp_path, CONTROLLERS["preview"])
    assert [r.summary["learned_from"] for r in recordings] == [0, 0]
    margins = {"gain_margin", "phase_margin_deg", "delay_margin_s", "sensitivity_peak"}
    assert set(recordings[0].provenance.loop) == margins
    assert str(report.delay.loop) == f"delay {1e3 * report.delay.delay:.1f} ms"
    assert speed_error(recordings[1]) == pytest.approx(speed_error(recordings[0]), rel=1e-2)


@pytest.mark.parametrize(("attribute", "count"), [("skip", "lost_frames"), ("hold", "late_frames")])
def test_a_run_that_is_not_clean_teaches_no_command(two, tmp_path, attribute, count):
    robot, done = WavyRobot(lockstep=False), []

    def spoil_second_run(r):
        programs = len(r.programs)  # approach, excitation, first run, approach, second run
        if programs == 5 and r.program == "receiver" and len(r.received) % 200 == 0 and not done:
            done.append(r.tick)
            setattr(r, attribute, 1)

    robot.on_tick = spoil_second_run
    short = replace(two, planned=two.planned[:1])
    report, recordings = run(robot, short, tmp_path)
    assert [r.summary[count] for r in recordings] == [0, 1, 0]
    assert [r.summary["learned_from"] for r in recordings] == [0, 1, 0]
    assert report.remarks == [
        f"robot: run 2 had {int(attribute == 'hold')} late and {int(attribute == 'skip')} lost frames: "
        "nothing learned"
    ]
    # but the third run knows the gears by then
    assert recordings[2].summary["gear_waves"] > 0
    assert speed_error(recordings[2]) < 0.6 * speed_error(recordings[0])


RECIPE = RunRecipe(BEST, LOOP, PERIOD)


def commands_of(plan):
    return ReferenceTable(plan.spline, RECIPE).commands()


def test_a_plan_itself_keeps_the_limits(two, plan):
    assert broken_limit(plan, commands_of(plan), RECIPE, two.model) == ""


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda c: c + 7.0, "joint speed"),
        (lambda c: c + 0.3 * (-1.0) ** np.arange(len(c))[:, None], "joint acceleration"),
        (lambda c: c + np.nan, "joint speed"),
        (lambda c: c + np.eye(6)[0], "from the end of its range"),
        (lambda c: c - 0.14 * np.eye(6)[1], "of the floor at z = 0 m, at least 30 mm"),
    ],
)
def test_commands_that_break_a_limit_are_named(two, plan, spoil, words):
    assert words in broken_limit(plan, spoil(commands_of(plan)), RECIPE, two.model)


def test_a_learned_displacement_is_limited(two, plan):
    commands = commands_of(plan)
    learned = np.full_like(commands, 0.06 / (len(commands) * PERIOD))
    assert "learned displacement" in broken_limit(plan, commands, replace(RECIPE, learned=learned), two.model)
    assert broken_limit(plan, commands, replace(RECIPE, learned=0.5 * learned), two.model) == ""


class Gears:
    """What a `GearObserver` knows, as a test says."""

    def __init__(self, known=None):
        self.known = known

    def model(self):
        return self.known

    def take(self, qd_cmd, q):
        pass


def memory_of(experiment, gears=None):
    return Memory(RECIPE, learning_filter(RECIPE), gears or Gears(), experiment.model)


def test_what_breaks_a_limit_is_forgotten_before_anything_is_sent(two, plan):
    plain = commands_of(plan)
    memory, tcp = memory_of(two, Gears(WavyRobot.gear)), two.planned[0].movement
    assert 0.0 < np.abs(memory.table(plan, tcp).commands() - plain).max() < 0.1
    memory.recipe = replace(memory.recipe, learned=np.full_like(plain, 0.19))
    memory.learned_from = 1
    np.testing.assert_array_equal(memory.table(plan, tcp).commands(), plain)
    assert (memory.recipe, memory.learned_from) == (RECIPE, 0)
    assert "learned displacement" in memory.remarks[0]
    memory.table(plan, tcp)
    assert memory.recipe.gear is None  # refused for the rest of this movement


def test_gears_are_renewed_unless_something_was_learned_with_them(two, plan):
    gears, tcp = Gears(), two.planned[0].movement
    memory = memory_of(two, gears)
    memory.table(plan, tcp)
    assert memory.recipe.gear is None
    gears.known = WavyRobot.gear
    memory.table(plan, tcp)
    memory.recipe = replace(memory.recipe, learned=np.zeros((10, 6)))
    gears.known = None
    memory.table(plan, tcp)
    assert memory.recipe.gear is WavyRobot.gear
    memory.take(2, log_of(1e-3, 0.0), StreamReport(late_frames=1))
    memory.table(plan, tcp)
    assert memory.recipe.gear is None


def log_of(slow, fast):
    """A run of 4 s, from rest to rest, whose joints swing about the reference by so much at 10 and 50 Hz [rad]."""
    log = StreamLog()
    for k in range(500):
        t = k * PERIOD
        swing = slow * math.sin(20.0 * math.pi * t) + fast * math.sin(100.0 * math.pi * t)
        q = [math.sin(math.pi * t / 4.0) ** 2 * swing] * 6
        frame = SimpleNamespace(actual_q=np.array(q))
        point = SimpleNamespace(q=(0.0,) * 6, qd_feedforward=np.zeros(6))
        log(frame, SimpleNamespace(t=t - 0.2, point=point, qd_cmd=[0.0] * 6))
    return log


@pytest.mark.parametrize(
    ("slow", "fast", "learned_from"),
    [
        ((1e-3, 2e-4, 2.05e-4), (0.0, 0.0, 0.0), 3),
        ((1e-3, 1.3e-3, 1e-3), (0.0, 0.0, 0.0), 0),
        ((1e-4, 1e-4, 1e-4), (1e-5, 2e-5, 4e-5), 3),
    ],
    ids=["better", "worse", "worse where nothing is learned"],
)
def test_learning_ends_when_it_makes_a_run_worse(two, slow, fast, learned_from):
    memory = memory_of(two)
    for n in range(3):
        memory.take(n + 1, log_of(slow[n], fast[n]), StreamReport())
    assert memory.learned_from == learned_from
    worse = [remark for remark in memory.remarks if "was worse than the one before" in remark]
    assert len(worse) == (learned_from == 0)


def test_learning_that_might_not_converge_is_refused():
    nervous = replace(BEST, gain_p=30.0, gain_i=60.0, learning_gain=0.3)
    loop = LoopModel(0.03, 0.01, 0.004, 0.0)
    weight = design_filter(RunRecipe(nervous, loop, PERIOD))
    assert weight.contraction >= 1.0
    with pytest.raises(DriverError, match="would not converge"):
        learning_filter(RunRecipe(nervous, loop, PERIOD))
    assert learning_filter(RunRecipe(CONTROLLERS["preview"], loop, PERIOD)) is None
