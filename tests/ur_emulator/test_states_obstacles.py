"""Obstacles come and go while the arm works, and stop it."""

import math

import numpy as np
import pytest
from box_support import Bench
from states_support import infos

from protocol.ur_types import SafetyMode
from ur_emulator.commands.safety import UnlockProtectiveStop
from ur_emulator.commands.surroundings import AddObstacle, RemoveObstacle
from ur_emulator.controller.events import ErrorReported
from ur_emulator.errors import EmulatorError
from ur_emulator.plant.obstacles import SLOTS

# The tool points down at (.3, 0, .15) and goes 0.3 m along y.
APPROACH = "movej(p[0.3,0,0.15,3.14159265,0,0], a=3, v=2)"
PUSH_ON = "def f():\n  movel(p[0.3,0.3,0.15,3.14159265,0,0], a=1, v=0.2)\nend\n"
UPRIGHT = (0.0, 0.0, 0.0)
ON_ITS_SIDE = (-math.pi / 2, 0.0, 0.0)
# Each begins at y = .2 on the way of the wrist, which reaches about 0.04 m around the tool's axis.
OBSTACLES = {
    "box": AddObstacle("it", "box", (0.4, 0.1, 0.4), (0.3, 0.25, 0.15, *UPRIGHT)),
    "turned box": AddObstacle("it", "box", (0.4, 0.4, 0.1), (0.3, 0.25, 0.15, *ON_ITS_SIDE)),
    "sphere": AddObstacle("it", "sphere", (0.15,), (0.3, 0.35, 0.15, *UPRIGHT)),
    "capsule": AddObstacle("it", "capsule", (0.05, 0.3), (0.3, 0.25, 0.2, *UPRIGHT)),
    "plane": AddObstacle("it", "plane", (), (0.0, 0.2, 0.0, math.pi / 2, 0.0, 0.0)),
}


@pytest.fixture
def bench():
    bench = Bench(fidelity="ideal")
    bench.run(f"def a():\n  {APPROACH}\nend\n")
    bench.events.clear()
    return bench


def y(bench):
    return bench.controller.plant.flange_position[1]


@pytest.mark.parametrize("kind", OBSTACLES)
def test_the_arm_is_stopped(bench, kind):
    bench.tick(1, OBSTACLES[kind])
    assert bench.controller.plant.obstacles.names == ("it",)
    bench.start(PUSH_ON)
    reached = []
    for _ in range(400):
        bench.tick()
        reached.append(y(bench))
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    codes = [event.code for event in bench.events if isinstance(event, ErrorReported)]
    assert codes[0] in (153, 157)
    assert 0.1 < max(reached) < 0.205
    assert bench.now.target_qd == (0.0,) * 6


def test_after_the_obstacle_is_gone_the_path_is_free(bench):
    bench.tick(1, OBSTACLES["box"])
    bench.start(PUSH_ON)
    bench.tick(400)
    bench.tick(1, RemoveObstacle("it"), UnlockProtectiveStop())
    assert bench.controller.plant.obstacles.names == ()
    bench.run(PUSH_ON)
    assert y(bench) == pytest.approx(0.3, abs=1e-3)


def test_the_touch_is_felt_as_a_force_that_pushes_back(bench):
    bench.tick(1, OBSTACLES["box"])
    bench.start(PUSH_ON)
    forces = []
    for _ in range(300):
        bench.tick()
        forces.append(bench.controller.plant.contact_wrench[:3])
    assert min(force[1] for force in forces) < -50.0


def test_an_obstacle_of_the_same_name_is_replaced(bench):
    bench.tick(1, OBSTACLES["box"])
    bench.tick(1, AddObstacle("it", "sphere", (0.05,), (0.3, -0.4, 0.15, *UPRIGHT)))
    assert bench.controller.plant.obstacles.names == ("it",)
    bench.run(PUSH_ON)
    assert bench.now.safety_mode == SafetyMode.NORMAL
    assert y(bench) == pytest.approx(0.3, abs=1e-3)


def test_what_would_stand_in_the_arm_is_refused_and_nothing_moves(bench):
    before = bench.now.actual_q
    bench.tick(1, AddObstacle("it", "box", (0.2, 0.2, 0.2), (0.3, 0.0, 0.2, *UPRIGHT)))
    bench.tick(20)
    assert bench.controller.plant.obstacles.names == ()
    assert infos(bench) == ["obstacle it: the arm is where it should stand, move one of them"]
    assert bench.now.actual_q == pytest.approx(before, abs=1e-4)
    assert bench.now.safety_mode == SafetyMode.NORMAL


def test_a_move_into_the_arm_leaves_the_old_one_where_it_was(bench):
    for i in range(SLOTS):
        bench.tick(1, AddObstacle(f"{i}", "sphere", (0.01,), (0.3, 0.4, 0.1 + 0.03 * i, *UPRIGHT)))
    assert len(bench.controller.plant.obstacles.names) == SLOTS
    bench.tick(1, AddObstacle("more", "sphere", (0.01,), (0.5, 0.4, 0.1, *UPRIGHT)))
    assert infos(bench) == [f"obstacle more: there are {SLOTS} already, remove one first"]
    bench.tick(1, AddObstacle("3", "box", (0.2, 0.2, 0.2), (0.3, 0.0, 0.2, *UPRIGHT)))
    assert "the arm is where it should stand" in infos(bench)[-1]
    bench.tick(1, AddObstacle("3", "box", (0.4, 0.1, 0.4), (0.3, 0.25, 0.15, *UPRIGHT)))
    assert len(bench.controller.plant.obstacles.names) == SLOTS
    bench.start(PUSH_ON)
    bench.tick(400)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP


def test_an_obstacle_that_nothing_touches_changes_no_bit(bench):
    other = Bench(fidelity="ideal")
    other.run(f"def a():\n  {APPROACH}\nend\n")
    other.tick(1, AddObstacle("far", "box", (0.1, 0.1, 0.1), (-0.5, -0.5, 0.5, *UPRIGHT)))
    bench.tick(1)
    for one in (bench, other):
        one.run(PUSH_ON)
    a, b = ([s.actual_q for s in one.snapshots] for one in (bench, other))
    assert a == b


@pytest.mark.parametrize(
    ("kwargs", "text"),
    [
        ({"name": ""}, "needs one"),
        ({"shape": "cone"}, "allowed is box, sphere, capsule or plane"),
        ({"size": (0.1,)}, "a box needs 3 numbers"),
        ({"size": (0.1, 0.1, 0.0)}, "0.001 to 5 m"),
        ({"size": (0.1, 0.1, math.nan)}, "up to three numbers"),
        ({"size": (0.1, 0.1, math.inf)}, "up to three numbers"),
        ({"pose": (0.0, 0.0, math.inf, 0.0, 0.0, 0.0)}, "six numbers"),
        ({"pose": (9.0, 0.0, 0.0, 0.0, 0.0, 0.0)}, "at most 5 m away"),
        ({"pose": (0.0,) * 5}, "six numbers"),
        ({"shape": "plane"}, "a plane needs 0 numbers"),
    ],
)
def test_absurd_obstacles_are_refused_in_one_line(kwargs, text):
    good = {"name": "it", "shape": "box", "size": (0.1, 0.1, 0.1), "pose": (0.5, 0.0, 0.0, 0.0, 0.0, 0.0)}
    with pytest.raises(EmulatorError, match=text) as caught:
        AddObstacle(**{**good, **kwargs})
    assert "\n" not in str(caught.value)


def test_a_resting_arm_stays_where_it_is_among_obstacles(bench):
    before = np.array(bench.now.actual_q)
    for obstacle in OBSTACLES.values():
        bench.tick(1, obstacle)
        bench.tick(10)
    assert np.abs(np.array(bench.now.actual_q) - before).max() < 1e-4
