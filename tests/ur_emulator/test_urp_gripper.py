"""Nodes of Robotiq's grippers in program files: the script they become, and what it does with and without a gripper."""

import pytest
from dashboard_support import gripper_move, gripper_node, script_line, urp
from finger_support import tool_box
from installation_support import installation
from urp_support import NEW_BOX, lines_of, script_of, undefined_in

from ur_emulator.errors import ProgramFileError, UnknownNodeError
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.installation import GripperCalibration, GripperSetup, Installation
from ur_emulator.program_files.installation_reader import load_installation
from urscript import compile_program
from urscript.catalogue import catalogue_for

CALIBRATION = GripperCalibration(90.2, 1.18, 0.0, 85.0)
CALIBRATED = Installation("/programs/cell.installation", grippers=GripperSetup(True, True, {1: CALIBRATION}))


@pytest.mark.parametrize(
    ("node", "installed", "label"),
    [
        (gripper_move(0), NEW_BOX, "Gripper Open (1)"),
        (gripper_move(100), CALIBRATED, "Gripper Close (1)"),
        (gripper_move(40, slaveIds="[2]"), CALIBRATED, "Gripper Move40% (2)"),
        (gripper_move(60, slaveIds="[9]"), CALIBRATED, "Gripper Move29mm (1)"),
        (gripper_move(99), CALIBRATED, "Gripper Move0mm (1)"),
    ],
)
def test_labels(tmp_path, node, installed, label):
    assert lines_of(tmp_path, node, installed)[3] == f'$ 2 "{label}"'


@pytest.mark.parametrize(
    ("node", "problem"),
    [
        (gripper_node("Vacuum"), "a node 'Vacuum' of the URCap 'Robotiq_Grippers' cannot"),
        (gripper_move(0, slaveIds="[9, 5]"), "a node of the grippers '9, 5' cannot"),
    ],
)
def test_nodes_that_are_not_known(tmp_path, node, problem):
    with pytest.raises(UnknownNodeError, match=problem):
        lines_of(tmp_path, node)


@pytest.mark.parametrize(
    ("node", "problem"),
    [
        (gripper_move(101), "position is 101 %: use 0 to 100"),
        (gripper_node("Gripper"), "position of a Gripper node is None, a number"),
        (gripper_node("Grip Check"), "a Grip Check node needs one gripper, an If and an Else"),
    ],
)
def test_nodes_that_are_not_filled_in(tmp_path, node, problem):
    assert problem in undefined_in(tmp_path, node)


@pytest.mark.parametrize("software", ["3.15", "5.11"])
def test_functions_stand_once_in_front_of_programs_that_need_them(tmp_path, software):
    text = script_of(tmp_path, urp(gripper_move(0) + gripper_move(100)), CALIBRATED)
    assert text.count("def rq_wait(") == 1
    assert "rq_current_limit_enabled = True\n" in text
    assert "gripper_open_mm = [85.0, 50.0, 50.0, 50.0]\n" in text
    compile_program(text, catalogue=catalogue_for(software))
    call = urp(script_line("rq_close_and_wait()"))
    compile_program(script_of(tmp_path, call, CALIBRATED), catalogue=catalogue_for(software))
    assert "def rq_" not in script_of(tmp_path, call)
    assert "def rq_" not in script_of(tmp_path, urp(script_line("sync()")), CALIBRATED)


def contribution(**values):
    data = "".join(f'<data key="{key}" value="{value}"/>' for key, value in values.items())
    return f'<Contributed ownerId="com.robotiq.urcap.gripper" title="Gripper"><dataModel>{data}</dataModel></Contributed>'


VALUES = {
    "gripper_current_limit_enabled": "true",
    "_models.Gripper1._isCalibrationDefined": "true",
    "_models.Gripper1._openValueInMillimeters": "85.0",
    "_models.Gripper1._closedValueInMillimeters": "0.0",
    "_models.Gripper1._openValueInPercent": "1.18",
    "_models.Gripper1._closedValueInPercent": "90.2",
    "_models.Gripper2._isCalibrationDefined": "false",
}


def test_the_installation_gives_calibrations_and_the_voltage(tmp_path):
    path = tmp_path / "cell.installation"
    path.write_bytes(installation(contribution(**VALUES)))
    cell = load_installation(ProgramFolder(tmp_path), path.name)
    assert (cell.grippers, cell.tool_voltage) == (CALIBRATED.grippers, 24)
    for key, value in (("_openValueInPercent", "90.2"), ("_openValueInMillimeters", "1e308")):
        path.write_bytes(installation(contribution(**VALUES | {f"_models.Gripper1.{key}": value})))
        with pytest.raises(ProgramFileError, match="use two positions, widths below 1 m"):
            load_installation(ProgramFolder(tmp_path), path.name)


# --- what the script does


BRANCHES = "".join(
    gripper_node(name, script_line(f'textmsg("{text}")'))
    for name, text in (("If", "held"), ("Else", "nothing"))
)
GRIP = (
    gripper_node("Gripper Activate", ResetAndActivateKey="true")
    + gripper_move(0)
    + script_line('textmsg("open ", rq_current_pos_norm())')
    + gripper_move(100)
    + gripper_node("Grip Check", BRANCHES, ObjectDetectedKey="true")
    + script_line('textmsg("wide ", rq_current_pos_mm())')
    + gripper_move(0)
)
REACH = """
def reach():
  set_tcp(p[0, 0, 0.15, 0, 0, 0])
  set_payload(0.9, [0, 0, 0.058])
  movej(get_inverse_kin(p[0.5, 0.2, 0.1, 3.14159, 0, 0]), a=3, v=2)
  movel(p[0.5, 0.2, 0, 3.14159, 0, 0], a=1.2, v=0.4)
end
"""


@pytest.fixture
def programs(tmp_path):
    (tmp_path / "cell.installation").write_bytes(installation(contribution(**VALUES)))
    (tmp_path / "grip.urp").write_bytes(urp(GRIP, name="grip", installation="cell"))
    (tmp_path / "move.urp").write_bytes(urp(gripper_move(0), name="move", installation="cell"))
    return tmp_path


def said(box, run):
    """Do something; return what programs have written meanwhile."""
    before = len(box.log)
    run()
    return [
        entry.text for entry in box.log[before:] if entry.text.startswith(("open", "held", "nothing", "wide"))
    ]


def test_a_program_sees_what_it_has_gripped(programs):
    with tool_box("robotiq-2f85", programs=programs) as box:
        box.run_program(file="move.urp", wait=False)
        assert box.wait_until(popup=True).popups == ("Gripper 1 must be activated first.",)
        box.close_popups()
        box.add_thing("block", "box", (0.04, 0.04, 0.04), 0.1, (0.5, 0.2, 0.0, 0, 0, 0))
        box.run_program(REACH, wait=True)
        lines = said(box, lambda: box.run_program(file="grip.urp", wait=True))
        assert lines[:2] == ["open 1", "held"]
        assert float(lines[2].removeprefix("wide ")) == pytest.approx(40.0, abs=0.5)


def test_without_a_gripper_a_program_shows_that_there_is_no_connection(programs):
    with tool_box("none", programs=programs) as box:
        box.run_program(file="grip.urp", wait=False)
        assert box.wait_until(popup=True).popups == ("Gripper 1 does not answer.",)
