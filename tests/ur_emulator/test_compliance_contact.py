"""Contacts: with the table, with obstacles that come and go, what finds them, and what the plant does for them."""

import math

import numpy as np
import pytest
from box_support import Bench
from compliance_support import DOWN, TABLE, above_table, place, push, reported, truth
from plant_support import HOME, hold, target
from states_support import infos

from protocol.ur_types import ControlMode, SafetyMode
from ur_emulator.errors import EmulatorError
from ur_emulator.machine.commands.client_writes import WriteInputs
from ur_emulator.machine.commands.programs import StopProgram
from ur_emulator.machine.commands.safety import UnlockProtectiveStop
from ur_emulator.machine.commands.surroundings import AddObstacle, RemoveObstacle
from ur_emulator.machine.controller.events import ErrorReported
from ur_emulator.machine.models.cb3_arms import UR3
from ur_emulator.machine.models.fidelity import IDEAL, TYPICAL
from ur_emulator.machine.plant.plant import Plant
from ur_emulator.machine.plant.scene import MOST

DEEP = DOWN.format(z=-0.15)


@pytest.mark.parametrize(
    ("fidelity", "speed"),
    [("ideal", 1.0), ("typical", 0.05), ("typical", 0.25), ("typical", 1.0), ("poor", 0.05), ("poor", 1.0)],
)
def test_a_move_into_the_table_is_a_protective_stop(fidelity, speed):
    bench = above_table(f"  movel({DEEP}, a=1.2, v={speed})", z=0.1, fidelity=fidelity)
    forces, places = truth(bench, 600)
    assert [code for code, _ in reported(bench)] in ([153], [157])
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    # The table has held, the arm is whole: it rests on it, presses no harder, and its numbers are numbers.
    assert np.ptp(forces[-100:, 2]) < 1.0
    assert forces[-1, 2] < 50.0
    assert places[:, 2].min() > TABLE - 2e-3
    assert np.abs(bench.controller.plant.qd_true).max() < 5e-3
    assert np.isfinite(bench.now.actual_q).all()
    assert not any(bench.now.target_qd)


def test_after_a_protective_stop_on_the_table_the_arm_can_be_moved_away():
    bench = above_table(f"  movel({DEEP}, v=0.25)", z=0.1)
    bench.tick(300)
    bench.tick(650)
    bench.tick(1, StopProgram(), UnlockProtectiveStop())
    bench.events.clear()
    bench.start("def up():\n  movel(pose_add(get_target_tcp_pose(), p[0,0,0.1,0,0,0]), v=0.1)\nend\n")
    bench.tick(300)
    assert reported(bench) == []
    assert place(bench)[2] > TABLE + 0.08


def test_an_arm_that_was_pushed_off_its_place_is_exact_again_where_it_then_stands():
    bench = above_table("  sleep(100)", z=0.25)
    push(bench, 0.0, 250.0, 0.0)
    bench.controller.plant.push((0.0, 250.0, 0.0), (0.0, 0.0, 0.3))
    bench.tick(100)
    assert [code for code, _ in reported(bench)] in ([153], [157])
    push(bench, 0.0, 0.0, 0.0)
    bench.tick(300)
    assert np.abs(bench.controller.plant.q_true - bench.now.target_q).max() < 3e-4


def search(speed, direction):
    return f"""
  steps = 0
  while steps == 0:
    speedl([0,0,-{speed},0,0,0], 0.5, get_steptime())
    steps = tool_contact({direction})
  end
  q = get_actual_joint_positions_history(steps)
  stopl(3)
  movel(q)
  textmsg("found")
  sleep(100)"""


@pytest.mark.parametrize(
    ("fidelity", "direction"),
    [
        *((fidelity, "direction=[0,0,-1,0,0,0]") for fidelity in ("ideal", "typical", "poor")),
        *(("typical", direction) for direction in ("get_target_tcp_speed()", "[0,0,0,0,0,0]", "")),
    ],
)
def test_the_tool_finds_the_table(fidelity, direction):
    bench = above_table(search(0.03, direction), fidelity=fidelity)
    bench.tick(450)
    assert bench.texts == ["found"]
    assert place(bench)[2] == pytest.approx(TABLE, abs=1.5e-3)
    assert reported(bench) == []


def test_a_contact_in_another_direction_does_not_count():
    bench = above_table("  while True:\n    textmsg(tool_contact([0,1,0,0,0,0]))\n    sync()\n  end", z=0.2)
    bench.tick(150)
    push(bench, 0.0, 0.0, 40.0)
    bench.tick(30)
    assert set(bench.texts) == {"0"}
    push(bench, 0.0, -40.0, 0.0)
    bench.tick(30)
    assert int(bench.texts[-1]) in range(27, 32)


@pytest.mark.parametrize("fidelity", ["typical", "poor"])
def test_moves_without_contact_are_none(fidelity):
    bench = above_table(
        "  while True:\n    movel(pose_add(get_target_tcp_pose(), p[0,0.1,0.1,0,0,0]))\n"
        "    movel(pose_add(get_target_tcp_pose(), p[0,-0.1,-0.1,0,0,0]))\n  end",
        z=0.1,
        fidelity=fidelity,
    )
    for _ in range(1000):
        bench.tick()
        assert bench.controller.state.force_sense.steps_since_contact((0.0, 0.0, 0.0)) == 0


def test_force_mode_trusts_a_zero_that_the_program_has_set():
    """Zeroed in the air, entered with 8 N on the table: it goes on to 25 N; ±10 N by the manual of CB3."""
    bench = above_table(
        "  sleep(1)\n  zero_ftsensor()\n  force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,-8,0,0,0], 2, [1,1,0.05,1,1,1])\n"
        "  sleep(4)\n  end_force_mode()\n  sleep(1)\n"
        "  force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,-25,0,0,0], 2, [1,1,0.05,1,1,1])\n  sleep(100)"
    )
    forces, _ = truth(bench, 1150)
    assert forces[550:600, 2].mean() == pytest.approx(8.0, abs=10.0)
    assert forces[-150:, 2].mean() == pytest.approx(25.0, abs=10.0)


def test_a_tool_moves_the_point_of_the_wrench():
    bench = above_table("  set_tcp(p[0,0,0.1,0,0,0])\n  sleep(100)", z=0.2, fidelity="ideal")
    push(bench, 10.0, 0.0, 0.0)
    bench.tick(100)
    moment = np.mean([s.actual_tcp_force for s in bench.snapshots[-50:]], axis=0)[3:]
    # The tool points down: the push at the flange acts 0.1 m above the TCP.
    assert moment == pytest.approx([0.0, 1.0, 0.0], abs=0.05)


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
    plant.set_payload(1.0, (0.0, 0.0, 0.0))
    states = hold(plant, HOME, 100)
    assert states[-1].estimated_force[2] == pytest.approx(0.0, abs=0.3)
    plant.set_payload(0.0, (0.0, 0.0, 0.0))
    states = hold(plant, HOME, 100)
    assert states[-1].estimated_force[2] == pytest.approx(-9.81, abs=0.3)
    assert np.abs(plant.q_true - HOME).max() < 1e-4  # the outer loop carries it anyway


def test_another_sensor_begins_without_zero_and_past():
    bench = above_table(
        "  sleep(1)\n  zero_ftsensor()\n  ft_rtde_input_enable(True)\n  while True:\n"
        "    textmsg(tool_contact([0,0,0,0,0,0]))\n    sync()\n  end",
        z=0.2,
    )
    bench.tick(100)
    for _ in range(60):
        bench.tick(1, WriteInputs((("external_force_torque", (0.0, 0.0, 40.0, 0.0, 0.0, 0.0)),)))
    assert np.hypot.reduce(bench.now.actual_tcp_force[:3]) == pytest.approx(40.0)
    # The first reading was there before the first cycle with the sensor was over: no contact came.
    assert set(bench.texts) == {"0"}


# The tool points down at (.3, 0, .15) and goes 0.3 m along y.
APPROACH = "set_pos(get_inverse_kin(p[0.3,0,0.15,3.14159265,0,0]))"
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


def obstacles(bench):
    return tuple(shape.name for shape in bench.controller.plant.physics.scene.obstacles)


def y(bench):
    return bench.controller.plant.physics.flange_position[1]


@pytest.mark.parametrize("kind", OBSTACLES)
def test_the_arm_is_stopped(bench, kind):
    bench.tick(1, OBSTACLES[kind])
    assert obstacles(bench) == ("it",)
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
    assert obstacles(bench) == ()
    bench.run(PUSH_ON)
    assert y(bench) == pytest.approx(0.3, abs=1e-3)


def test_the_touch_is_felt_as_a_force_that_pushes_back(bench):
    bench.tick(1, OBSTACLES["box"])
    bench.start(PUSH_ON)
    forces = []
    for _ in range(300):
        bench.tick()
        forces.append(bench.controller.plant.physics.contact_wrench[:3])
    assert min(force[1] for force in forces) < -50.0


def test_an_obstacle_of_the_same_name_is_replaced(bench):
    bench.tick(1, OBSTACLES["box"])
    bench.tick(1, AddObstacle("it", "sphere", (0.05,), (0.3, -0.4, 0.15, *UPRIGHT)))
    assert obstacles(bench) == ("it",)
    bench.run(PUSH_ON)
    assert bench.now.safety_mode == SafetyMode.NORMAL
    assert y(bench) == pytest.approx(0.3, abs=1e-3)


def test_what_would_stand_in_the_arm_is_refused_and_nothing_moves(bench):
    before = bench.now.actual_q
    bench.tick(1, AddObstacle("it", "box", (0.2, 0.2, 0.2), (0.3, 0.0, 0.2, *UPRIGHT)))
    bench.tick(20)
    assert obstacles(bench) == ()
    assert infos(bench) == ["obstacle it: the arm is where it should stand, move one of them"]
    assert bench.now.actual_q == pytest.approx(before, abs=1e-4)
    assert bench.now.safety_mode == SafetyMode.NORMAL


def test_a_move_into_the_arm_leaves_the_old_one_where_it_was(bench):
    for i in range(MOST["obstacle"]):
        bench.tick(1, AddObstacle(f"{i}", "sphere", (0.01,), (0.3, 0.4, 0.1 + 0.03 * i, *UPRIGHT)))
    assert len(obstacles(bench)) == MOST["obstacle"]
    bench.tick(1, AddObstacle("more", "sphere", (0.01,), (0.5, 0.4, 0.1, *UPRIGHT)))
    assert infos(bench) == [f"obstacle more: there are {MOST['obstacle']} already, remove one first"]
    bench.tick(1, AddObstacle("3", "box", (0.2, 0.2, 0.2), (0.3, 0.0, 0.2, *UPRIGHT)))
    assert "the arm is where it should stand" in infos(bench)[-1]
    bench.tick(1, AddObstacle("3", "box", (0.4, 0.1, 0.4), (0.3, 0.25, 0.15, *UPRIGHT)))
    assert len(obstacles(bench)) == MOST["obstacle"]
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
