"""direct_torque: the arm is held against gravity, moves as its inertia says, and returns to position control."""

import numpy as np
import pytest
from e_series_support import DT, ESeriesBench, program

from protocol.ur_types import ControlMode, ProgramState, SafetyMode
from ur_emulator.machine.commands.programs import PauseProgram, ResumeProgram, StopProgram
from ur_emulator.machine.commands.surroundings import Push

ALL = "viscous_scale=[1,1,1,1,1,1], coulomb_scale=[1,1,1,1,1,1]"
NONE = "viscous_scale=[0,0,0,0,0,0], coulomb_scale=[0,0,0,0,0,0]"


@pytest.fixture
def bench():
    return ESeriesBench(fidelity="ideal")


def endless(torque, more=ALL):
    return program("while True:", f"  direct_torque({torque}, {more})", "end")


def truth(bench):
    return bench.controller.plant.q_true.copy()


def rest(bench):
    """Whether the arm stands, and position control holds it."""
    bench.tick(400)
    before = truth(bench)
    bench.tick(100)
    return np.abs(truth(bench) - before).max() < 1e-5 and bench.now.control_mode == ControlMode.POSITION


@pytest.mark.parametrize(
    ("robot", "fidelity"), [("ur3e", "typical"), ("ur5e", "ideal"), ("ur10e", "typical")]
)
def test_zero_torque_holds_the_arm_with_its_payload(robot, fidelity):
    bench = ESeriesBench(robot=robot, fidelity=fidelity)
    payload = "set_target_payload(2, [0, 0, 0.1])"
    bench.start(program(payload, "while True:", "  direct_torque([0,0,0,0,0,0])", "end"))
    bench.tick(20)
    before = truth(bench)
    bench.tick(1000)
    assert np.abs(truth(bench) - before).max() < 1e-4
    assert bench.now.control_mode == ControlMode.TORQUE
    assert bench.now.target_q == pytest.approx(bench.now.actual_q, abs=1e-3)
    assert not bench.errors


@pytest.mark.parametrize(("joint", "torque"), [(0, 20.0), (1, -30.0), (2, 15.0), (3, 2.0), (5, -2.0)])
def test_a_joint_accelerates_as_its_inertia_says(bench, joint, torque):
    bench.run(program("global m = get_mass_matrix(get_actual_joint_positions(), True)"))
    inertia = np.array(list(bench["m"]))[joint, joint]
    torques = [0.0] * 6
    torques[joint] = torque
    bench.start(endless(torques))
    start = truth(bench)[joint]
    n = 40
    bench.tick(n - 1)
    # Full scales leave two thirds of the viscous friction. The other joints yield a little, so that this one
    # feels less than its inertia with them at rest.
    damping = 2.0 / 3.0 * bench.controller.state.robot.viscous[joint]
    lost = damping * n * DT / inertia
    way = torque * inertia / damping**2 * (lost + np.expm1(-lost))
    assert truth(bench)[joint] - start == pytest.approx(way, rel=0.12)
    assert bench.now.target_moment[joint] - gravity(bench)[joint] == pytest.approx(torque, abs=0.5)


def gravity(bench):
    return bench.controller.state.dynamics.gravity_torque(bench.now.actual_q)


def test_friction_brakes_what_is_not_compensated():
    moved = {}
    for name, more in (("all", ALL), ("default", ""), ("none", NONE), ("old", "friction_comp=False")):
        bench = ESeriesBench(fidelity="ideal")
        bench.start(endless([0, 0, 0, 0, 0, 2.5], more) if more else endless([0, 0, 0, 0, 0, 2.5], "True"))
        start = truth(bench)[5]
        bench.tick(100)
        moved[name] = truth(bench)[5] - start
    assert moved["all"] > moved["default"] > moved["none"] == moved["old"] > 0.0


@pytest.mark.parametrize(("robot", "speed", "way"), [("ur5e", 3.1, 4.5), ("ur3e", 5.8, 9.2)])
def test_the_example_of_the_maker_swings_wrist_3(robot, speed, way):
    """Universal_Robots_Client_Library, examples/direct_torque_control.cpp: full scales at wrist 3, one period of ten."""
    bench = ESeriesBench(robot=robot, fidelity="ideal")
    bench.start(
        program(
            "q = get_actual_joint_positions()",
            "q[5] = 0",
            "movej(q)",
            "t = 0.0",
            "while t < 5:",
            "  t = t + get_steptime()",
            "  tau = 2.5 * sin(2 * 3.141592653589793 * 0.2 * t)",
            "  direct_torque([0,0,0,0,0,tau], viscous_scale=[0,0,0,0,0,1], coulomb_scale=[0,0,0,0,0,1])",
            "end",
            "stopj(4)",
        )
    )
    while bench.controller.is_active:
        bench.tick()
    swung = [s.actual_q[5] for s in bench.snapshots if s.control_mode == ControlMode.TORQUE]
    speeds = [s.actual_qd[5] for s in bench.snapshots if s.control_mode == ControlMode.TORQUE]
    assert bench.errors == []
    assert len(swung) == pytest.approx(5.0 / DT, abs=2)
    # Out and back; the friction that is left damps it.
    assert max(swung) == pytest.approx(way, abs=0.1)
    assert np.diff(np.sign(np.array(swung) - 0.5 * max(swung))).nonzero()[0].size == 2
    assert [min(speeds), max(speeds)] == pytest.approx([-speed, speed], abs=0.1)
    assert swung[-1] == pytest.approx(0.0, abs=0.15)


@pytest.mark.parametrize(
    ("robot", "joint"), [*(("ur3e", joint) for joint in range(6)), ("ur10e", 1), ("ur10e", 5)]
)
def test_full_compensation_leaves_damping_in_every_joint(robot, joint):
    bench = ESeriesBench(robot=robot, fidelity="ideal")
    torques = ["0"] * 6
    torques[joint] = "tau"
    push = 0.2 * bench.controller.state.robot.tau_max[joint]
    bench.start(
        program(
            "i = 0",
            "while True:",
            "  i = i + 1",
            "  tau = 0",
            "  if i < 20:",
            f"    tau = {push}",
            "  end",
            f"  direct_torque([{','.join(torques)}], {ALL})",
            "end",
        )
    )
    bench.tick(30)
    pushed = bench.now.actual_qd[joint]
    bench.tick(250)
    assert pushed > 0.1
    assert 0.0 <= bench.now.actual_qd[joint] < 0.7 * pushed
    assert bench.errors == []


def test_the_deprecated_argument_is_logged_once_and_does_not_count_beside_a_scale(bench):
    bench.start(endless([0, 0, 0, 0, 0, 0], f"False, {ALL}"))
    bench.tick(50)
    logged = [event.text for event in bench.events if type(event).__name__ == "LogAdded"]
    assert logged == ["direct_torque: friction_comp is deprecated, use viscous_scale and coulomb_scale"]
    command = bench.controller.state.motion.torque
    assert command.viscous == command.coulomb == (1.0,) * 6


def test_before_5_25_friction_comp_is_not_deprecated():
    bench = ESeriesBench(fidelity="ideal", software="5.23")
    bench.start(endless([0, 0, 0, 0, 0, 0], "friction_comp=True"))
    bench.tick(50)
    assert not [event for event in bench.events if type(event).__name__ == "LogAdded"]
    assert bench.controller.state.motion.torque.viscous == (0.9, 0.9, 0.8, 0.9, 0.9, 0.9)


@pytest.mark.parametrize("after", ["sleep(1)", "stopj(5)", "x = 1", "halt"])
def test_without_a_call_in_a_cycle_position_control_brings_the_arm_to_rest(bench, after):
    lines = ("i = 0", "while i < 100:", "  direct_torque([15, 0, 0, 0, 0, 0])", "  i = i + 1", "end", after)
    bench.start(program(*lines))
    bench.tick(60)
    assert bench.now.actual_qd[0] > 0.3
    before = truth(bench)[0]
    assert rest(bench)
    assert 0.0 < truth(bench)[0] - before < 0.5
    assert not bench.errors
    assert np.abs(np.array(bench.now.position_error)).max() < 1e-4


def test_one_cycle_without_a_call_leaves_torque_control(bench):
    bench.start(program("while True:", "  direct_torque([0, 0, 0, 0, 0, 0])", "  sync()", "end"))
    modes = [bench.tick().control_mode for _ in range(40)]
    assert modes[10:14] in ([3, 0, 3, 0], [0, 3, 0, 3])


def test_pause_holds_the_arm_and_resume_goes_on(bench):
    bench.start(endless([8, 0, 0, 0, 0, 0]), loaded=True)
    bench.tick(60)
    bench.tick(1, PauseProgram())
    assert rest(bench)
    assert bench.now.runtime_state == ProgramState.PAUSED
    bench.tick(3, ResumeProgram())
    assert bench.now.control_mode == ControlMode.TORQUE
    bench.tick(1, StopProgram())
    assert rest(bench)


def test_a_joint_that_becomes_too_fast_is_stopped(bench):
    bench.start(endless([0, 0, 0, 0, 0, 8]))
    bench.tick(1500)
    assert bench.errors == [(191, 37)]
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert rest(bench)


def test_more_torque_than_the_drives_have_is_stopped_as_a_collision(bench):
    bench.start(endless([1000, 0, 0, 0, 0, 0]))
    bench.tick(200)
    assert bench.errors[0] in [(157, 0), (191, 32)]
    assert rest(bench)


def test_an_impedance_in_a_script_yields_to_a_push_as_its_stiffness_says(bench):
    bench.start(
        program(
            "q0 = get_actual_joint_positions()",
            "while True:",
            "  tau = (q0 - get_actual_joint_positions()) * 200 - get_actual_joint_speeds() * 40",
            f"  direct_torque(tau, {NONE})",
            "end",
        )
    )
    bench.tick(20)
    start = truth(bench)
    bench.tick(1500, Push((0.0, 60.0, 0.0)))
    jacobian = bench.controller.state.arm.jacobian(bench.now.actual_q)
    moment = jacobian[:3].T @ [0.0, 60.0, 0.0]
    off = truth(bench) - start
    strongest = int(np.argmax(np.abs(moment)))
    friction = bench.controller.state.robot.coulomb[strongest]  # holds a part of it back
    assert abs(200.0 * off[strongest] - moment[strongest]) < friction < 0.25 * abs(moment[strongest])
    assert not bench.errors


def test_force_mode_ends(bench):
    force = "force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,0,0,0,0], 2, [0.1,0.1,0.1,0.1,0.1,0.1])"
    bench.start(program(force, "sleep(0.1)", "while True:", "  direct_torque([0,0,0,0,0,0])", "end"))
    bench.tick(30)
    assert bench.now.control_mode == ControlMode.FORCE
    bench.tick(60)
    assert bench.now.control_mode == ControlMode.TORQUE
    bench.tick(1, StopProgram())
    assert rest(bench)


def test_an_arm_without_physics_stands_still_as_in_the_simulator_of_the_maker():
    bench = ESeriesBench(fidelity="exact")
    bench.start(endless([20, 0, 0, 0, 0, 0]))
    before = bench.now.actual_q
    bench.tick(200)
    assert bench.now.actual_q == before
    assert bench.now.control_mode == ControlMode.TORQUE
