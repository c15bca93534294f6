"""Compliance beside what chunks show (`chunks/watched`): bit for bit, on the bare plant, laws over arms, refusals."""

import math
from dataclasses import replace

import numpy as np
import pytest
from box_support import Bench, program
from plant_support import HOME, hold, target

from protocol.ur_types import ControlMode
from ur_emulator.errors import ArgumentError
from ur_emulator.machine.commands.power import StartFreedrive
from ur_emulator.machine.commands.surroundings import AddObstacle, AttachPayload, Push
from ur_emulator.machine.controller.compliance import Compliance
from ur_emulator.machine.models.cb3_arms import UR3
from ur_emulator.machine.models.fidelity import IDEAL, TYPICAL
from ur_emulator.machine.models.generations import CB3, E_SERIES
from ur_emulator.machine.plant.plant import Plant
from ur_emulator.machine.plant.scene import MOST

PRESS = "force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,-20,0,0,0], 2, [0.05,0.05,0.05,0.2,0.2,0.2])"


def above_table(*lines, fidelity="typical", z=0.03):
    """A bench whose arm rests with the tool, pointing down, at height z, and has just begun a program."""
    bench = Bench(fidelity=fidelity)
    bench.run(program(f"set_pos(get_inverse_kin(p[0.3,0,{z},3.14159265,0,0]))", "sleep(0.2)"))
    bench.start(program(*lines))
    return bench


def test_the_target_of_a_guided_arm_is_what_was_measured():
    bench = above_table("freedrive_mode()", "sleep(100)", z=0.2)
    bench.controller.plant.push((0.0, 15.0, 5.0))
    bench.tick(60)
    old, before, now = bench.snapshots[-3:]
    assert np.abs(now.actual_qd).max() > 0.1
    assert now.target_q == old.actual_q
    assert now.target_qd == old.actual_qd
    assert bench.controller.state.motion.target.q == before.actual_q


def test_time_passes_in_lockstep_as_long_as_a_hand_moves_the_arm():
    bench = Bench()
    bench.tick(1, StartFreedrive())
    bench.tick(100)
    assert not bench.controller.is_active
    bench.tick(1, Push((0.0, 15.0, 0.0)))
    bench.tick(20)
    assert bench.controller.is_active


def test_calling_force_mode_again_and_again_changes_nothing():
    once = above_table("sleep(0.2)", PRESS, "sleep(100)")
    looped = above_table("sleep(0.2)", "while True:", PRESS, "sync()", "end")
    for _ in range(300):
        forces = [bench.tick() and bench.controller.plant.physics.contact_wrench for bench in (once, looped)]
        assert np.array_equal(*forces)
    assert forces[0][2] > 10.0


@pytest.mark.parametrize(
    ("robot", "generation", "damping"),
    [
        *(("ur5", CB3, damping) for damping in (0.0, 0.025)),
        ("ur5", replace(CB3, period_us=2_000), 0.005),
        ("ur10", CB3, 0.005),
        ("ur3e", E_SERIES, 0.025),
        ("ur20", E_SERIES, 0.0),
    ],
    ids=lambda x: str(getattr(x, "period_us", x)),
)
def test_the_free_speed_follows_one_law_in_seconds(robot, generation, damping):
    """A mass under the force less 1.5 N, whose damping takes a share of the speed in 2 ms.

    A CB3 arm takes a part of its own inertia for a force.
    """
    bench = Bench(robot=robot, generation=generation, fidelity="ideal")
    bench.run(program("set_pos([-1.54, -1.83, -2.28, -0.59, 1.60, 0.023])", "sleep(2)"))
    up = "force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,10,0,0,0], 2, [2,2,1.5,1,1,1])"
    bench.start(
        program(f"force_mode_set_damping({damping})", "force_mode_set_gain_scaling(1)", up, "sleep(2)")
    )
    bench.tick(generation.cycles(1.0))
    acceleration = 8.5 / (480.0 / generation.force_sensing.control_rate)
    rate = -np.log(1.0 - damping) / 0.002
    law = acceleration * (-np.expm1(-rate) / rate if rate else 1.0)
    # Beside it what makes the force grow in contact; the beginning waits for the delay of the loop.
    rel = 0.12 if generation.force_sensing.has_sensor else 0.4
    assert bench.now.target_tcp_speed[2] == pytest.approx(law, rel=rel, abs=0.003)


def test_what_is_not_in_use_is_not_looked_after(monkeypatch):
    def never(*_):
        raise AssertionError("compliance was looked after in a cycle that needs none")

    bench = above_table("movej([0.2,-1.5,-1.5,-1.5,1.5,0])", "sleep(1)", z=0.2)
    monkeypatch.setattr(Compliance, "step", never)
    monkeypatch.setattr(Compliance, "find_violation", never)
    bench.tick(200)


# --- the plant


def test_a_resting_arm_is_handed_over_without_a_torque_step():
    plant = Plant(UR3, TYPICAL, 5)
    hold(plant, HOME, 100)
    for _ in range(20):
        plant.step(target(HOME), ControlMode.TEACH)
    free = np.array(plant.sense().joint_control_output) * UR3.torque_constant
    where = plant.q_true
    # Wherever the first target is, the servo begins with the torque that carried the arm.
    plant.step(target(HOME + 0.002))
    held = np.array(plant.sense().joint_control_output) * UR3.torque_constant
    assert np.abs(held - free).max() < 1.5
    hold(plant, HOME + 0.002, 150)
    assert np.abs(plant.q_true - (HOME + 0.002)).max() < 1e-4
    assert np.abs(where - HOME).max() < 1e-4


def test_brakes_end_the_freedom_of_the_joints():
    plant = Plant(UR3, IDEAL, 5)
    plant.push((0.0, 20.0, 0.0))
    for _ in range(50):
        plant.step(target(HOME), ControlMode.TEACH)
    plant.step(None)
    where = plant.q_true
    plant.step(None)
    assert np.array_equal(plant.q_true, where)
    plant.push((0.0, 0.0, 0.0))
    hold(plant, where, 100)
    assert np.abs(plant.q_true - where).max() < 1e-4


def test_a_hung_load_stays_when_another_one_is_declared():
    plant = Plant(UR3, IDEAL, 5)
    plant.attach_load(1.0)
    for declared, felt in ((1.0, 0.0), (0.0, -9.81)):
        plant.set_payload(declared, (0.0, 0.0, 0.0))
        assert hold(plant, HOME, 100)[-1].estimated_force[2] == pytest.approx(felt, abs=0.3)
    assert np.abs(plant.q_true - HOME).max() < 1e-4  # the outer loop carries it anyway


# --- obstacles


def test_there_is_room_for_so_many_obstacles():
    bench = Bench(fidelity="ideal")
    for i in range(MOST["obstacle"] + 1):
        bench.tick(1, AddObstacle(f"{i}", "sphere", (0.01,), (0.5, 0.4, 0.1 + 0.03 * i, 0.0, 0.0, 0.0)))
    assert len(bench.controller.plant.physics.scene.obstacles) == MOST["obstacle"]
    last = bench.events[-1].text
    assert last == f"obstacle {i}: there are {MOST['obstacle']} already, remove one first"


def test_an_obstacle_that_nothing_touches_changes_no_bit():
    said = []
    for obstacles in ([], [AddObstacle("far", "box", (0.1, 0.1, 0.1), (-0.5, -0.5, 0.5, 0.0, 0.0, 0.0))]):
        bench = Bench(fidelity="ideal")
        bench.tick(1, *obstacles)
        bench.run("movej([0.6, -1.7, -2.0, -0.1, 1.3, 1.9])\n")
        said.append([snapshot.actual_q for snapshot in bench.snapshots])
    assert said[0] == said[1]


@pytest.mark.parametrize(
    ("make", "text"),
    [
        *((lambda force=force: Push(force), "together at most 250 N") for force in ((0.0, 0.0, math.nan), (1e9, 0.0, 0.0), (200.0, 200.0, 0.0))),
        *((lambda force=force: Push(force), "allowed is three numbers") for force in ((1.0, 2.0), (math.nan, 0.0, 0.0))),
        (lambda: AttachPayload(-1.0), "^mass .* given: allowed is"),
        (lambda: AttachPayload(math.nan), "^mass .* given: allowed is"),
        (lambda: AttachPayload(1.0, (9, 0, 0)), "^cog .* given: allowed is"),
    ],
)  # fmt: skip
def test_no_hand_pushes_and_no_load_is_like_that(make, text):
    with pytest.raises(ArgumentError, match=text):
        make()


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
    with pytest.raises(ArgumentError, match=text) as caught:
        AddObstacle(**{**good, **kwargs})
    assert "\n" not in str(caught.value)
