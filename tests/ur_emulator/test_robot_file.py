"""Arms of one's own: the file of `--robot`, and a box, a client and a program on such an arm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pc_client.driver.report import read_report
from pc_client.driver.transport import TcpNetwork
from pc_client.driver.watchdog import refusal
from pc_client.experiment.preflight import model_of, preflight
from ur_emulator import ControlBox
from ur_emulator.errors import EmulatorError, ModelError, RefusedError
from ur_emulator.machine.kinematics.arm_model import ArmModel
from ur_emulator.machine.models.generations import CB3, POLYSCOPE_X
from ur_emulator.machine.models.robots import ROBOTS, robot_by_name
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.plant.plant import Plant
from ur_hil.cell import NO_CELL

EXAMPLE = Path(__file__).parents[2] / "examples" / "arms" / "long_ur5e.toml"
UR5E = ROBOTS["ur5e"]


def read(tmp_path, text, version=None):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return robot_by_name(str(path), version)


@pytest.mark.parametrize("base", ROBOTS)
def test_a_file_keeps_what_it_does_not_name(tmp_path, base):
    assert read(tmp_path, f'based_on = "{base}"') == replace(ROBOTS[base], name="mine")


def test_a_file_changes_what_it_names(tmp_path):
    robot = read(
        tmp_path,
        """
        based_on = "ur3"
        title = "Mine"
        q_min = [-1, -3, -3, -3, -3, -3]
        qd_max = [1, 1, 1, 1, 1, 1]
        payload_max = 1
        [dh]
        d4 = 0.2
        [links.wrist_3]
        mass = 1.5
        com = [0, 0.1, 0]
        """,
    )
    base = ROBOTS["ur3"]
    wrist = replace(base.links[5], mass=1.5, com=(0.0, 0.1, 0.0))
    assert robot == replace(
        base,
        name="mine",
        title="Mine",
        q_min=(-1.0, -3.0, -3.0, -3.0, -3.0, -3.0),
        qd_max=(1.0,) * 6,
        payload_max=1.0,
        dh=(*base.dh[:3], replace(base.dh[3], d=0.2), *base.dh[4:]),
        links=(*base.links[:5], wrist),
        servo_inertia=robot.servo_inertia,
    )
    assert robot.generation is CB3


def test_the_servos_are_laid_out_for_the_masses_of_the_file(tmp_path):
    text = 'based_on = "ur5e"\n[links.wrist_3]\nmass = '
    # The table has three digits of the same numbers.
    assert read(tmp_path, text + "0.3651").servo_inertia == pytest.approx(UR5E.servo_inertia, rel=0.005)
    assert read(tmp_path, text + "4").servo_inertia[1] > 1.25 * UR5E.servo_inertia[1]


def test_an_arm_of_the_e_series_runs_polyscope_x(tmp_path):
    assert read(tmp_path, 'based_on = "ur5e"', "10.11").generation is POLYSCOPE_X


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "based_on: missing; give one of ur3, ur5"),
        ('based_on = "ur6"', "based_on: 'ur6'; give one of ur3, ur5"),
        ("reach = nan", "reach: nan; give a number from 0.01 to 10 m"),
        ("q_max = [0, 0, 0, 0, 0, 0]\nq_min = [0, 0, 0, 0, 0, 0]", "q_min: 0 of joint 0 is not below"),
        ("q_max = [0, 3, 3, 3, 3, 3]", "home_q: 0.2817 of joint 0 is not within -6.33555 to 0"),
        ("[dh]\na2 = 0.4", "dh.a2: 0.4; give a number from -5 to -0.01 m"),
        ("[links.forearm]\nmass = 0", "links.forearm.mass: 0; give a number from 0.001 to 1000 kg"),
        ("[links.forearm]\ninertia = [1, 1, 3]", "links.forearm.inertia: no body has these"),
        ("[links.forearm]\nproducts = [0, 1, 0]", "links.forearm.inertia: no body has these"),
        ("reach = ", "not TOML"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_in_one_line(tmp_path, text, words):
    with pytest.raises(ModelError) as caught:
        read(tmp_path, text if "based_on" in text or not text else f'based_on = "ur5e"\n{text}')
    assert str(caught.value).startswith(f"{tmp_path / 'mine.toml'}: ")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_cannot_be_served_is_refused():
    with pytest.raises(EmulatorError, match=r"nowhere\.toml: cannot be read"):
        ControlBox(robot="nowhere.toml", in_process=True)


def test_an_arm_that_would_stand_in_the_table_is_refused(tmp_path):
    path = tmp_path / "low.toml"
    path.write_text('based_on = "ur5e"\nhome_q = [0, 1.2, 0, 0, 0, 0]')
    with pytest.raises(EmulatorError, match="low: at home_q the arm would touch itself or the table"):
        ControlBox(robot=path, port_base=None, in_process=True).__enter__()


def test_geometry_and_masses_are_those_of_the_file():
    robot = robot_by_name(str(EXAMPLE))
    upright = (0.0, -np.pi / 2, 0.0, 0.0, 0.0, 0.0)
    heights = [ArmModel(arm).fk(upright)[2] for arm in (robot, UR5E)]
    assert heights[0] - heights[1] == pytest.approx(0.1)
    moments = []
    for arm in (robot, UR5E):
        plant = Plant(arm, arm.generation.fidelity("ideal"), 0)
        for _ in range(2):  # an arm of 500 Hz moves in the step after that of its target
            plant.step(JointTarget((0.0, -0.3, 0.0, 0.0, 0.0, 0.0)))
        moments.append(abs(plant.sense().target_moment[1]))
    assert moments[0] > 1.1 * moments[1]


@pytest.fixture(scope="module")
def box():
    with ControlBox(robot=EXAMPLE, pace="lockstep", fidelity="exact", port_base=None) as box:
        yield box


def test_a_box_of_a_file_moves_by_its_own_kinematics(box):
    assert box.title.startswith("UR5e, long forearm e-Series 5.")
    goal = (0.3, -1.6, -1.9, -0.2, 1.4, 1.7)
    box.run_program(f"def there():\n  movej({list(goal)})\nend\n", wait=True)
    state = box.wait_until(steady=True)
    assert state.q == pytest.approx(goal)
    assert state.tcp_pose == pytest.approx(ArmModel(robot_by_name(str(EXAMPLE))).fk(goal), abs=1e-9)


def test_a_box_of_a_file_keeps_the_joint_ranges_of_the_file(box):
    program = "def far():\n  movej([0.3, -1.6, -2.8, -0.2, 1.4, 1.7])\nend\n"
    with pytest.raises(RefusedError):
        box.run_program(program, wait=True)
    with ControlBox(robot="ur5e", pace="lockstep", fidelity="exact", port_base=None) as other:
        other.run_program(program, wait=True)


def test_the_client_takes_it_for_another_arm_than_its_base(box):
    report = read_report(TcpNetwork(), box.host, box.ports)
    complaint = refusal(preflight(report, model_of(report, NO_CELL)))
    assert "from the UR5e model" in complaint
