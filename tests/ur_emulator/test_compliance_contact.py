"""Contacts: a move into the table, detecting one, the zero of the wrench; and what the plant does for them."""

import numpy as np
import pytest
from compliance_support import DOWN, TABLE, above_table, failures, place, push, reported, said, truth
from plant_support import HOME, hold, target

from protocol.ur_types import ControlMode, SafetyMode
from ur_emulator.commands.client_writes import WriteInputs
from ur_emulator.commands.programs import StopProgram
from ur_emulator.commands.safety import UnlockProtectiveStop
from ur_emulator.models.cb3_arms import UR3
from ur_emulator.models.fidelity import IDEAL, TYPICAL
from ur_emulator.plant.plant import Plant

DEEP = DOWN.format(z=-0.15)


@pytest.mark.parametrize("fidelity", ["ideal", "typical", "poor"])
@pytest.mark.parametrize("speed", [0.05, 0.25, 1.0])
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


@pytest.mark.parametrize("fidelity", ["ideal", "typical", "poor"])
@pytest.mark.parametrize(
    "direction", ["direction=[0,0,-1,0,0,0]", "get_target_tcp_speed()", "[0,0,0,0,0,0]", ""]
)
def test_the_tool_finds_the_table(fidelity, direction):
    bench = above_table(search(0.03, direction), fidelity=fidelity)
    bench.tick(450)
    assert said(bench) == ["found"]
    assert place(bench)[2] == pytest.approx(TABLE, abs=1.5e-3)
    assert reported(bench) == []


def test_a_contact_in_another_direction_does_not_count():
    bench = above_table("  while True:\n    textmsg(tool_contact([0,1,0,0,0,0]))\n    sync()\n  end", z=0.2)
    bench.tick(150)
    push(bench, 0.0, 0.0, 40.0)
    bench.tick(30)
    assert set(said(bench)) == {"0"}
    push(bench, 0.0, -40.0, 0.0)
    bench.tick(30)
    assert int(said(bench)[-1]) in range(27, 32)


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


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (
            'tool_contact([0,0,to_num("nan"),0,0,0])',
            "tool_contact: Parameter 'direction' must be finite, got [0, 0, nan, 0, 0, 0]",
        ),
        (
            "tool_contact([])",
            "tool_contact: Parameter 'direction' must be a list of 6 numbers or a Pose, got a list of 0",
        ),
    ],
)
def test_absurd_directions_are_errors(call, text):
    bench = above_table(f"  {call}", z=0.2)
    bench.tick(3)
    assert failures(bench) == [text]


def test_zero_ftsensor_takes_the_present_wrench_as_zero():
    bench = above_table("  sleep(1)\n  zero_ftsensor()\n  sleep(100)", z=0.2)
    push(bench, 5.0, 0.0, -12.0)
    bench.tick(120)
    force = np.mean([s.actual_tcp_force for s in bench.snapshots[-50:]], axis=0)
    assert np.abs(force[:3]).max() > 7.0
    bench.tick(80)
    rest = np.mean([s.actual_tcp_force for s in bench.snapshots[-50:]], axis=0)
    assert np.abs(rest[:3]).max() < 1.5
    assert np.abs(rest[3:]).max() < 0.3
    push(bench, 0.0, 0.0, 0.0)
    bench.tick(60)
    force = np.mean([s.actual_tcp_force for s in bench.snapshots[-50:]], axis=0)
    assert force[:3] == pytest.approx([-5.0, 0.0, 12.0], abs=1.5)


def test_force_mode_trusts_a_zero_that_the_program_has_set():
    """Zeroed in the air, entered with 8 N on the table: it goes on to 25 N, not to 33 N."""
    bench = above_table(
        "  sleep(1)\n  zero_ftsensor()\n  force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,-8,0,0,0], 2, [1,1,0.05,1,1,1])\n"
        "  sleep(4)\n  end_force_mode()\n  sleep(1)\n"
        "  force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,-25,0,0,0], 2, [1,1,0.05,1,1,1])\n  sleep(100)"
    )
    forces, _ = truth(bench, 1150)
    assert forces[550:600, 2].mean() == pytest.approx(8.0, abs=2.5)
    assert forces[-150:, 2].mean() == pytest.approx(25.0, abs=2.5)


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
    assert states[-1].tcp_force[2] == pytest.approx(0.0, abs=0.3)
    plant.set_payload(0.0, (0.0, 0.0, 0.0))
    states = hold(plant, HOME, 100)
    assert states[-1].tcp_force[2] == pytest.approx(-9.81, abs=0.3)
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
    assert set(said(bench)) == {"0"}
