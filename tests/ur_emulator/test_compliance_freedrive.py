"""Hand guiding: who may ask for it, what the arm does under a hand, and how it ends.

With blocked axes, and in screw driving, the tool moves along the axes that are free, and along no other.
"""

import numpy as np
import pytest
from box_support import Bench
from compliance_support import above_table, place, push, reported, truth
from e_series_support import DT, ESeriesBench, program

from protocol.pose import pose_inv, pose_trans, rotvec_to_matrix
from protocol.ur_types import ControlMode, ProgramState, RobotMode, SafetyMode
from ur_emulator.errors import ArgumentError
from ur_emulator.machine.commands.client_writes import WriteInputs
from ur_emulator.machine.commands.power import PowerOff, ReleaseBrakes, StartFreedrive
from ur_emulator.machine.commands.programs import StopProgram
from ur_emulator.machine.commands.safety import TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.machine.commands.surroundings import AttachPayload, Push

FREE = "  freedrive_mode()\n  sleep(100)"


@pytest.mark.parametrize("fidelity", ["ideal", "typical", "poor"])
def test_with_the_right_payload_the_arm_stays_where_it_is(fidelity):
    bench = above_table("  set_payload(1.2, [0, 0, 0.05])\n  sleep(1)\n" + FREE, z=0.2, fidelity=fidelity)
    bench.tick(200)
    before = place(bench)
    bench.tick(500)
    assert np.abs(place(bench) - before).max() < 1e-4
    assert bench.now.control_mode == ControlMode.TEACH


@pytest.mark.parametrize(("load", "declared", "sign"), [(1.0, 0.0, -1), (0.0, 1.0, +1)])
def test_with_a_wrong_payload_it_drifts_down_or_up(load, declared, sign):
    bench = above_table(f"  set_payload({declared}, [0, 0, 0])\n  sleep(1)\n" + FREE, z=0.25)
    bench.controller.plant.attach_load(load)
    bench.tick(200)
    before = place(bench)
    bench.tick(400)
    assert reported(bench) == []
    assert sign * (place(bench) - before)[2] > 0.02


def test_a_push_moves_the_arm_and_it_stays_there():
    bench = above_table("  freedrive_mode()\n  sleep(2)\n  end_freedrive_mode()\n  sleep(100)", z=0.2)
    before = place(bench)
    push(bench, 0.0, 15.0, 0.0)
    bench.tick(80)
    assert place(bench)[1] - before[1] > 0.05
    push(bench, 0.0, 0.0, 0.0)
    bench.tick(60)
    left = place(bench)
    bench.tick(400)
    assert np.abs(place(bench) - left).max() < 2e-4
    assert bench.now.control_mode == ControlMode.POSITION
    # Held again: the same push hardly moves it.
    push(bench, 0.0, 15.0, 0.0)
    bench.tick(80)
    assert np.abs(place(bench) - left).max() < 2e-3


def test_a_light_touch_does_not_move_it():
    bench = above_table(FREE, z=0.2)
    before = place(bench)
    push(bench, 0.0, 1.5, 0.0)
    bench.tick(200)
    assert np.abs(place(bench) - before).max() < 1e-4


def test_the_target_follows_the_arm():
    bench = above_table(FREE, z=0.2)
    push(bench, 0.0, 15.0, 5.0)
    bench.tick(60)
    old, before, now = bench.snapshots[-3:]
    assert np.abs(now.actual_qd).max() > 0.1
    assert now.target_q == old.actual_q
    assert now.target_qd == old.actual_qd
    assert bench.controller.state.motion.target.q == before.actual_q


def test_moves_are_not_followed_but_take_their_time():
    bench = above_table(
        '  freedrive_mode()\n  movej([0,-1.5,-1.5,-1.5,1.5,0], t=2)\n  textmsg("done")\n  sleep(1)\n'
        '  end_freedrive_mode()\n  textmsg("held")\n  sleep(100)',
        z=0.2,
    )
    before = place(bench)
    bench.tick(200)
    assert bench.texts == []
    bench.tick(100)
    assert bench.texts == ["done"]
    bench.tick(200)
    assert bench.texts == ["done", "held"]
    assert np.abs(place(bench) - before).max() < 2e-4


def test_a_move_of_another_thread_ends_with_the_guiding():
    bench = above_table(
        '  thread mover():\n    movej([0,-1.5,-1.5,-1.5,1.5,0], t=20)\n    textmsg("over")\n  end\n'
        "  freedrive_mode()\n  h = run mover()\n  sleep(1)\n  end_freedrive_mode()\n  join h\n  sleep(100)",
        z=0.2,
    )
    before = place(bench)
    bench.tick(200)
    assert bench.texts == ["over"]
    assert np.abs(place(bench) - before).max() < 2e-4


@pytest.mark.parametrize("fidelity", ["ideal", "typical", "poor"])
def test_letting_go_in_motion_ends_in_a_smooth_stop(fidelity):
    bench = above_table(
        "  freedrive_mode()\n  sleep(0.8)\n  end_freedrive_mode()\n  sleep(100)", z=0.2, fidelity=fidelity
    )
    push(bench, 0.0, 20.0, 0.0)
    bench.tick(98)
    plant = bench.controller.plant
    speeds = [plant.qd_true]
    assert np.abs(speeds[0]).max() > 0.3
    push(bench, 0.0, 0.0, 0.0)
    for _ in range(80):
        bench.tick()
        speeds.append(plant.qd_true)
    changes = np.abs(np.diff(speeds, axis=0)) / 0.008
    assert changes.max() < 23.0  # rad/s², the deceleration of a stop and a little: no joint jumps
    assert np.abs(speeds[-1]).max() < 1e-3
    assert np.abs(plant.q_true - bench.now.target_q).max() < 2e-4
    assert reported(bench) == []


def test_it_ends_with_the_program():
    bench = above_table(FREE, z=0.2)
    bench.tick(50)
    assert bench.now.control_mode == ControlMode.TEACH
    bench.tick(3, StopProgram())
    assert bench.now.runtime_state == ProgramState.STOPPED
    assert bench.now.control_mode == ControlMode.POSITION
    left = place(bench)
    push(bench, 0.0, 15.0, 0.0)
    bench.tick(50)
    assert np.abs(place(bench) - left).max() < 2e-3


def test_a_secondary_program_ends_nothing():
    bench = above_table(FREE, z=0.2)
    bench.tick(5)
    bench.start('sec s():\n  textmsg("beside")\nend\n')
    bench.tick(5)
    assert bench.texts == ["beside"]
    assert bench.now.control_mode == ControlMode.TEACH


@pytest.mark.parametrize(
    ("action", "high"),
    [
        ('set_standard_digital_input_action(3, "freedrive")', 1 << 3),
        ('set_configurable_digital_input_action(1, "freedrive")', 1 << 9),
        ('set_tool_digital_input_action(1, "freedrive")', 1 << 17),
    ],
)
def test_an_input_guides_while_it_is_high_and_no_move_is_under_way(action, high):
    bench = above_table(f"  {action}\n  movej([0.2,-1.5,-1.5,-1.5,1.5,0], t=1)\n  sleep(100)", z=0.2)
    bench.tick(10)
    io = bench.controller.state.io
    io.digital_in = high
    bench.tick(50)
    assert bench.now.control_mode == ControlMode.POSITION  # a move is under way
    bench.tick(100)
    assert bench.now.control_mode == ControlMode.TEACH
    assert bench.now.is_guided_by_input
    io.digital_in = 0
    bench.tick(2)
    assert bench.now.control_mode == ControlMode.POSITION
    assert not bench.now.is_guided_by_input


def test_an_input_register_guides_too_and_also_without_a_program():
    bench = above_table('  set_gp_boolean_input_action(70, "freedrive")', z=0.2)
    bench.tick(5)
    assert bench.now.runtime_state == ProgramState.STOPPED
    bench.tick(1, WriteInputs((("input_bit_register_70", True),)))
    bench.tick(1)
    assert bench.now.control_mode == ControlMode.TEACH
    bench.tick(1, WriteInputs((("input_bit_register_70", False),)))
    bench.tick(1)
    assert bench.now.control_mode == ControlMode.POSITION


def test_the_words_of_a_client_guide_and_hold():
    bench = Bench()
    bench.tick(1, StartFreedrive())
    assert bench.now.control_mode == ControlMode.TEACH
    bench.start("def f():\n  sleep(0.1)\nend\n")
    bench.tick(30)
    assert bench.now.control_mode == ControlMode.TEACH  # it does not end with a program
    bench.tick(1, ReleaseBrakes())
    assert bench.now.control_mode == ControlMode.POSITION
    bench.tick(1, StartFreedrive(), PowerOff())
    bench.tick(2)
    assert bench.now.control_mode == ControlMode.POSITION


def test_near_the_end_of_its_range_a_joint_pushes_back_and_beyond_it_the_arm_stops():
    bench = Bench()
    bench.run("set_pos([6.05,-1.5,-1.5,-1.5,1.5,0])\n")
    bench.start("def f():\n  freedrive_mode()\n  sleep(100)\nend\n")
    turn = np.array([-np.sin(6.05), np.cos(6.05), 0.0])  # where the base joint takes the tool
    push(bench, *(15.0 * turn))
    bench.tick(200)
    assert 6.1 < bench.now.actual_q[0] < 2 * np.pi
    assert abs(bench.now.actual_qd[0]) < 0.05
    assert reported(bench) == []
    push(bench, *(220.0 * turn))
    bench.tick(30)
    assert reported(bench)[0] == (150, 0)
    push(bench, 0.0, 0.0, 0.0)
    bench.tick(150)
    assert np.all(np.array(bench.now.actual_qd) == 0.0)
    # Outside, it may be guided back.
    bench.tick(700, UnlockProtectiveStop())
    bench.events.clear()
    bench.start("def f():\n  freedrive_mode()\n  sleep(100)\nend\n")
    push(bench, *(-20.0 * turn))
    bench.tick(60)
    assert reported(bench) == []
    assert bench.now.actual_q[0] < 6.2


def test_a_joint_that_is_thrown_faster_than_its_rating_stops_the_arm():
    bench = above_table(FREE, z=0.3)
    bench.controller.plant.push((0.0, 0.0, 250.0), (0.2, 0.0, 0.0))
    bench.tick(60)
    code, argument = reported(bench)[0]
    assert code == 191
    assert 32 <= argument <= 37
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert bench.now.control_mode == ControlMode.POSITION
    push(bench, 0.0, 0.0, 0.0)
    bench.tick(200)
    assert np.all(np.array(bench.now.actual_qd) == 0.0)


def test_a_protective_stop_takes_the_arm_from_the_hand():
    bench = above_table(FREE, z=0.2)
    push(bench, 0.0, 15.0, 0.0)
    bench.tick(60)
    bench.tick(1, TriggerProtectiveStop())
    bench.tick(90)
    assert np.abs(bench.controller.plant.qd_true).max() < 1e-3
    assert bench.now.control_mode == ControlMode.POSITION


def test_the_table_stops_a_guided_arm():
    bench = above_table(FREE, z=0.1)
    push(bench, 0.0, 0.0, -25.0)
    forces, places = truth(bench, 300)
    assert places[:, 2].min() > -0.021
    assert forces[-1][2] > 5.0
    assert np.abs(bench.controller.plant.qd_true).max() < 0.05
    assert reported(bench) == []


def test_time_passes_in_lockstep_as_long_as_a_hand_moves_the_arm():
    bench = Bench()
    bench.tick(1, StartFreedrive())
    bench.tick(100)
    assert not bench.controller.is_active
    bench.tick(1, Push((0.0, 15.0, 0.0)))
    bench.tick(20)
    assert bench.controller.is_active


@pytest.mark.parametrize(
    "force", [(0.0, 0.0, float("nan")), (1e9, 0.0, 0.0), (200.0, 200.0, 0.0), (1.0, 2.0)]
)
def test_no_hand_pushes_like_that(force):
    with pytest.raises(ArgumentError, match="together at most 250 N"):
        Push(force)


@pytest.mark.parametrize(
    ("mass", "cog", "what"),
    [(-1.0, (0, 0, 0), "mass"), (float("nan"), (0, 0, 0), "mass"), (1.0, (9, 0, 0), "cog")],
)
def test_no_load_is_like_that(mass, cog, what):
    with pytest.raises(ArgumentError, match=f"^{what} .* given: allowed is"):
        AttachPayload(mass, cog)


def test_a_load_can_be_hung_by_command():
    bench = above_table("  sleep(100)", z=0.25, fidelity="ideal")
    bench.tick(1, AttachPayload(1.0))
    bench.tick(100)
    assert bench.now.actual_tcp_force[2] == pytest.approx(-9.81, abs=0.5)


TURNED = "p[0.1, 0, 0, 0, 0, 0.7853981633974483]"  # 45 degrees about z


def guided(arguments, fidelity="ideal"):
    bench = ESeriesBench(fidelity=fidelity)
    bench.start(program(f"freedrive_mode({arguments})", "sleep(100)"))
    bench.tick(100)
    assert bench.now.control_mode == ControlMode.TEACH
    return bench


def tool(bench):
    return bench.controller.state.arm.fk(bench.controller.plant.q_true)


def moved_by(bench, force, n=500):
    """How the tool has moved after a push of 1 s and some time to come to rest."""
    before = tool(bench)
    bench.tick(n, Push(tuple(force)))
    bench.tick(n, Push((0.0, 0.0, 0.0)))
    assert not bench.errors
    turn = np.array(pose_trans(pose_inv(before), tool(bench))[3:])
    return np.array(tool(bench)[:3]) - np.array(before[:3]), turn


@pytest.mark.parametrize("fidelity", ["ideal", "typical"])
def test_only_x_of_the_base_is_free(fidelity):
    bench = guided("[1, 0, 0, 0, 0, 0]", fidelity)
    shift, turn = moved_by(bench, (60.0, 60.0, 60.0), 300)
    assert shift[0] > 0.03
    assert np.abs(shift[1:]).max() < 0.006
    assert np.linalg.norm(turn) < 0.03


def test_all_free_yields_everywhere():
    shift, _ = moved_by(guided(""), (0.0, 60.0, 0.0), 300)
    assert shift[1] > 0.03


def test_axes_of_a_turned_feature():
    shift, _ = moved_by(guided(f"[1, 0, 0, 0, 0, 0], {TURNED}"), (60.0, 0.0, 0.0), 300)
    assert shift[0] > 0.015
    assert shift[1] == pytest.approx(shift[0], abs=0.005)
    assert abs(shift[2]) < 0.006


def test_axes_of_the_tool():
    bench = guided('freeAxes=[0, 0, 1, 0, 0, 0], feature="tool"')
    z = rotvec_to_matrix(tool(bench)[3:])[:, 2]
    shift, _ = moved_by(bench, -60.0 * z, 300)
    assert shift @ z < -0.03
    assert np.linalg.norm(shift - (shift @ z) * z) < 0.006


def test_a_locked_arm_keeps_its_place():
    shift, turn = moved_by(guided("[0, 0, 0, 0, 0, 0]"), (50.0, -50.0, -50.0), 300)
    assert np.linalg.norm(shift) < 0.008
    assert np.linalg.norm(turn) < 0.04


def test_a_client_frees_all_axes():
    bench = guided("[0, 0, 0, 0, 0, 0]")
    bench.tick(1, StartFreedrive())
    shift, _ = moved_by(bench, (0.0, 60.0, 0.0), 300)
    assert bench.now.robot_mode == RobotMode.RUNNING
    assert shift[1] > 0.03


def test_freedrive_status_tells_of_singularities():
    bench = ESeriesBench(fidelity="exact")
    bench.run(
        program(
            "global usual = get_freedrive_status()",
            "set_pos([0, -1.57, -1.57, -1.57, 1.57, 0])",
            "sync()",
            "global good = get_freedrive_status()",
            "set_pos([0, -1.57, -1.57, -1.57, 0.25, 0])",
            "sync()",
            "global near = get_freedrive_status()",
            "set_pos([0, -1.57, -1.57, -1.57, 0.001, 0])",
            "sync()",
            "global wrist = get_freedrive_status()",
            "set_pos([0, -1.57, 0, -1.57, 1.57, 0])",
            "sync()",
            "global stretched = get_freedrive_status()",
        )
    )
    names = ("usual", "good", "near", "wrist", "stretched")
    assert [bench[name] for name in names] == [0, 0, 1, 2, 2]


def test_screw_driving_follows_the_tool_axis_at_its_speed():
    bench = ESeriesBench(fidelity="ideal")
    bench.start(program("screw_driving(10, 0.02)", "sleep(2)", "end_screw_driving()", "sleep(1)"))
    z = rotvec_to_matrix(bench.now.actual_tcp_pose[3:])[:, 2]
    bench.tick(500)
    assert bench.now.control_mode == ControlMode.FORCE
    before = np.array(tool(bench)[:3])
    bench.tick(400)
    shift = np.array(tool(bench)[:3]) - before
    assert shift @ z == pytest.approx(0.02 * 400 * DT, rel=0.05)
    assert np.linalg.norm(shift - (shift @ z) * z) < 1e-3
    bench.tick(400)
    assert bench.now.control_mode == ControlMode.POSITION
    assert np.abs(bench.now.target_qd).max() == 0.0
    assert not bench.errors
