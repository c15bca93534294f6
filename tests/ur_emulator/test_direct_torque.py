"""direct_torque beside what chunks show (`chunks/watched/torque.script`): accelerations by inertia, stiffness, scales."""

import numpy as np
import pytest
from e_series_support import DT, ESeriesBench, program

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


@pytest.mark.parametrize(
    ("software", "more", "viscous"),
    [("5.25", f"False, {ALL}", (1.0,) * 6), ("5.23", "friction_comp=True", (0.9, 0.9, 0.8, 0.9, 0.9, 0.9))],
)
def test_the_deprecated_argument_counts_where_there_is_no_scale(software, more, viscous):
    bench = ESeriesBench(fidelity="ideal", software=software)
    bench.start(endless([0, 0, 0, 0, 0, 0], more))
    bench.tick(5)
    assert bench.controller.state.motion.torque.viscous == viscous


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
