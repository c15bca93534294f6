"""Every arm of the family: geometry against an independent model, sensible numbers, at rest and in motion."""

from functools import partial
from math import pi, radians

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from box_support import FakeNetwork, connect

from pc_client.kinematics.robot_model import robot_model
from protocol.primary.layout import calibration_hash
from protocol.serial_numbers import parse_serial
from protocol.ur_types import RobotType
from ur_emulator import ControlBox
from ur_emulator.commands.programs import StartProgram
from ur_emulator.controller.controller import Controller
from ur_emulator.errors import ModelError
from ur_emulator.kinematics.arm_model import ArmModel
from ur_emulator.models.generations import E_SERIES
from ur_emulator.models.mjcf import arm_spec
from ur_emulator.models.robots import ROBOTS
from ur_emulator.scripting.robot_host import robot_hosts
from urscript import compile_program

ARMS = [pytest.param(robot, id=name) for name, robot in ROBOTS.items()]
E_SERIES_ARMS = [
    pytest.param(robot, id=name) for name, robot in ROBOTS.items() if robot.generation is E_SERIES
]


@pytest.mark.parametrize("robot", ARMS)
def test_geometry_is_that_of_the_published_urdf(robot):
    arm, other = ArmModel(robot), robot_model(robot.name)
    rng = np.random.default_rng(5)
    for _ in range(50):
        q = rng.uniform(-pi, pi, 6)
        x, y, z, *rotation = arm.fk(q.tolist())
        pin.framesForwardKinematics(other.pin_model, other.pin_data, q)
        T_base_tcp = other.pin_data.oMf[other.tcp_frame]
        assert [x, y, z] == pytest.approx(T_base_tcp.translation, abs=1e-9)
        assert pin.exp3(np.array(rotation)) == pytest.approx(T_base_tcp.rotation, abs=1e-9)


@pytest.mark.parametrize("robot", ARMS)
def test_client_stays_within_the_limits_and_below_speeds_that_take_too_long_to_stop(robot):
    limits = robot_model(robot.name).limits
    assert limits.qd_max == pytest.approx([min(qd, radians(180)) for qd in robot.qd_max])
    assert all(low <= one for low, one in zip(robot.q_min, limits.q_min, strict=True))
    assert all(one <= high for one, high in zip(limits.q_max, robot.q_max, strict=True))


@pytest.mark.parametrize("robot", ARMS)
def test_data_sheet_fits_the_geometry(robot):
    # From the base axis to the axis of wrist 3, arm stretched; data sheets of small arms say less.
    stretched = robot.dh[4].d - robot.dh[1].a - robot.dh[2].a
    assert stretched == pytest.approx(robot.reach, rel=0.004 if robot.reach in (0.95, 1.3, 1.75) else 0.09)


@pytest.mark.parametrize(
    ("name", "mass"),
    [
        ("ur3", 8.63), ("ur5", 17.05), ("ur10", 28.435),
        ("ur3e", 8.7985), ("ur5e", 17.7), ("ur7e", 17.7), ("ur10e", 29.104), ("ur12e", 29.104),
        ("ur16e", 27.26), ("ur8long", 39.944), ("ur15", 36.258), ("ur18", 34.952),
        ("ur20", 60.88), ("ur30", 59.147),
    ],
)  # fmt: skip
def test_moving_mass_is_that_of_the_vendor_table(name, mass):
    assert sum(link.mass for link in ROBOTS[name].links) == pytest.approx(mass, abs=0.01)


@pytest.mark.parametrize("robot", ARMS)
def test_drives_can_carry_the_stretched_arm_with_its_payload(robot):
    """Static torque of shoulder and elbow, arm stretched horizontally with the rated payload at the flange."""
    g = 9.81
    upper, fore = -robot.dh[1].a, -robot.dh[2].a
    arms = (upper - robot.links[1].com[0], upper + fore - robot.links[2].com[0], *(3 * [upper + fore]))
    masses = [link.mass for link in robot.links[1:]]
    shoulder = g * (
        sum(m * r for m, r in zip(masses, arms, strict=True)) + robot.payload_max * (upper + fore)
    )
    assert shoulder < 0.95 * robot.tau_max[1]


@pytest.mark.parametrize("fidelity", ["exact", "ideal", "typical", "poor"])
@pytest.mark.parametrize("robot", ARMS)
def test_moves_with_the_rated_payload_and_comes_to_rest_on_target(robot, fidelity):
    controller = Controller(
        robot, robot.generation.fidelity(fidelity), 7, partial(robot_hosts, network=FakeNetwork())
    )
    program = compile_program(f"""def prog():
      set_payload({robot.payload_max}, [0, 0, 0.03])
      q = get_target_joint_positions()
      movej([q[0] + 0.5, q[1] + 0.2, q[2], q[3], q[4], q[5]])
      movel(pose_add(get_target_tcp_pose(), p[0, 0, 0.08, 0, 0, 0]))
      sleep(0.6)
    end""")
    controller.tick([StartProgram(program)])
    events = []
    for _ in range(robot.generation.cycles(16.0)):
        if not controller.is_active:
            break
        controller.tick(())
        events += controller.state.events.take()
    assert not controller.is_active
    assert not [event for event in events if type(event).__name__ in ("ErrorReported", "ScriptFailed")]
    snapshot = controller.snapshot
    assert snapshot.actual_q == pytest.approx(snapshot.target_q, abs=2e-4)
    assert controller.plant.n_contacts == 0


@pytest.mark.parametrize("robot", ARMS)
def test_box_names_its_arm_on_the_wire(robot):
    with ControlBox(robot=robot.name, pace="lockstep", port_base=None) as box:
        with connect(box, "dashboard") as sock, sock.makefile("rw") as lines:
            lines.readline()
            lines.write("get robot model\n")
            lines.flush()
            assert lines.readline() == f"{RobotType(robot.robot_type).name}\n"
        assert parse_serial(box.serial_number).simulated


@pytest.mark.parametrize("robot", E_SERIES_ARMS)
def test_servos_are_laid_out_for_the_inertia_at_the_home_pose(robot):
    model = arm_spec(robot, robot.dh, (1.0,) * 6).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home_q
    mujoco.mj_forward(model, data)
    inertia = np.zeros((6, 6))
    mujoco.mj_fullM(model, data, inertia)
    assert robot.servo_inertia == pytest.approx(np.diag(inertia) + robot.armature, rel=0.01)


@pytest.mark.parametrize("robot", ARMS)
def test_home_is_clear_of_singularities(robot):
    assert np.linalg.svd(ArmModel(robot).jacobian(robot.home_q))[1].min() > 0.1


@pytest.mark.parametrize(
    ("name", "too_old", "first"),
    [("ur7e", "5.21.3", "5.22.0"), ("ur12e", "5.15.0", "5.22.0"), ("ur20", "5.13.0", "5.14.0"), ("ur30", "5.14.6", "5.15.0"),
     ("ur15", "5.21.3", "5.22.0"), ("ur18", "5.22.1", "5.23.0"), ("ur8long", "5.22.1", "5.23.0")],
)  # fmt: skip
def test_an_arm_needs_software_that_knows_it(name, too_old, first):
    robot = ROBOTS[name]
    assert str(robot.software_version(first)).startswith(first)
    assert robot.software_version(None) >= robot.software_version(first)
    with pytest.raises(ModelError, match=f"version {too_old} given: a {robot.title} needs {first} or newer"):
        robot.software_version(too_old)


def test_wrist_3_turns_without_end_on_the_smallest_arms_only():
    endless = {name for name, robot in ROBOTS.items() if robot.q_max[5] > 1e6 and robot.q_min[5] < -1e6}
    assert endless == {"ur3", "ur3e"}


@pytest.mark.parametrize(("name", "sold_as"), [("ur7e", "ur5e"), ("ur12e", "ur10e")])
def test_stronger_arms_say_that_they_are_their_older_sisters(name, sold_as):
    arm, sister = ROBOTS[name], ROBOTS[sold_as]
    assert (arm.robot_type, arm.box_type, arm.links) == (sister.robot_type, sister.box_type, sister.links)
    assert arm.payload_max > sister.payload_max


@pytest.mark.parametrize(
    ("name", "published"),
    [
        ("ur3e", 16756443741236045476), ("ur5e", 12788084448423163542), ("ur10e", 5119701370761913513),
        ("ur16e", 1935737212149401527), ("ur20", 4890363623803256388), ("ur30", 12001109639981648826),
        ("ur8long", 464256464824449623), ("ur15", 16739373764049705779), ("ur18", 141559178124808281),
    ],
)  # fmt: skip
def test_hash_of_the_nominal_calibration_is_the_published_one(name, published):
    """The hashes stand in the ROS descriptions beside the nominal tables."""
    rows = ROBOTS[name].dh
    assert calibration_hash((row.theta, row.d, row.a, row.alpha) for row in rows) == f"calib_{published}"
