"""Installations: what is read from their files, in the shapes of real ones."""

import gzip
from math import inf, pi

import pytest
from installation_support import (
    MOUNTING,
    NEW_PAYLOAD,
    SAFETY,
    TCP,
    WIDE,
    installation,
    listed,
    plane_feature,
    pose_feature,
)

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError
from ur_emulator.machine.controller.io.lines import RunState
from ur_emulator.machine.controller.io.network import SignalType
from ur_emulator.machine.controller.safety.boundaries import NO_BOUNDARIES, BoundaryMode, ToolDirection
from ur_emulator.machine.models.safety_limits import ArmLimits
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.installation import DeclaredSignal, Feature, OutputRule, StartUp
from ur_emulator.program_files.installation_reader import NEW_BOX, load_installation


def read(folder, *parts, variables=None):
    (folder / "cell.installation").write_bytes(installation(*parts))
    if variables is not None:
        (folder / "cell.variables").write_bytes(variables)
    return load_installation(ProgramFolder(folder), "cell.installation")


def test_an_empty_installation_is_that_of_a_new_box(tmp_path):
    empty = read(tmp_path)
    assert empty.wire_path == "/programs/cell.installation"
    assert (empty.payload, empty.gravity, empty.safety) == (NEW_BOX.payload, NEW_BOX.gravity, NEW_BOX.safety)
    assert empty.tcp_offset == (0.0,) * 6


def test_tcps_and_payload(tmp_path):
    cell = read(tmp_path, TCP)
    assert list(cell.tcps) == ["TCP", "Gripper"]
    assert cell.tcp_offset == (0.0, 0.0, 0.12, 0.0, 0.0, 0.5)
    assert (cell.payload, cell.payload_cog) == (1.25, (0.0, 0.01, 0.05))
    new = read(tmp_path, TCP, NEW_PAYLOAD)
    assert (new.payload, new.payload_cog) == (0.75, (0.0, 0.0, 0.04))
    text = TCP.replace("TCPSettings", "com.ur.view.tcp.domain.TCPSettingsImpl")
    old = read(tmp_path, text.replace(' centerOfGravity="0.0, 0.01, 0.05"', ""))
    assert (old.tcp_offset, old.payload, old.payload_cog) == (cell.tcp_offset, 1.25, None)


def test_mounting(tmp_path):
    assert read(tmp_path, f"<Features>{MOUNTING}</Features>").gravity == pytest.approx((0.0, 0.0, -9.82))
    tilted = MOUNTING.replace(f'tiltAngle="{pi}"', f'tiltAngle="{pi / 2}"')
    share, cell = 9.82 / 2**0.5, read(tmp_path, f"<Features>{tilted}</Features>")
    assert cell.gravity == pytest.approx((share, -share, 0.0), abs=1e-12)


def test_names_of_lines(tmp_path):
    cell = read(
        tmp_path,
        "<IOs>",
        listed("DigitalOutputNames", "", "", "pump", "", "", "", "", ""),
        listed("ConfigurableInputNames", "door", *[""] * 7),
        listed("ToolAnalogInputNames", "", "distance"),
        "</IOs>",
    )
    assert cell.lines == {"pump": "digital_out[2]", "door": "config_in[0]", "distance": "analog_in[3]"}


def test_actions_domains_and_tool(tmp_path):
    cell = read(
        tmp_path,
        '<ToolCommSettings toolOutputVoltage="TWENTY_FOUR"/><SmoothTransitionSettings transitionHardness="HARD"/><IOs>',
        listed("analogInputRange", 0, 1, 1, 0),
        listed("analogOutputDomain", 1, 0),
        listed("ToolDigitalInputActions", "NONE", "FREEDRIVE"),
        listed("DigitalOutputActions", "NONE", "LOW_WHEN_PROGRAM_STOPPED", "PROGRAM_RUNNING"),
        "</IOs>",
    )
    assert (cell.tool_voltage, cell.transition_hardness) == (24, 0)
    assert (cell.analog_in_domains, cell.analog_out_domains) == ((0, 1, 1, 0), (1, 0))
    assert cell.input_actions == (("tool_digital", 1, "FREEDRIVE"),)
    assert cell.output_rules == (
        OutputRule("standard_digital", 1, RunState.LOW_WHEN_STOPPED),
        OutputRule("standard_digital", 2, RunState.HIGH_WHEN_RUNNING),
    )


@pytest.mark.parametrize("container", ["Features", "GeomFeatures"])  # the latter in 3.5, 3.12, 5.1, 5.7
def test_features(tmp_path, container):
    table, corner = (0.3, -0.2, 0.1, 0.0, 0.0, 1.5), (0.1, 0.2, 0.3, 0.0, 0.0, 0.0)
    # P1 to P2 is along the base's x, P3 in its x-y plane: y of the plane is x, z is up, x is y cross z.
    points = ((0.1, 0.2, 0.3), (0.4, 0.2, 0.3), (0.1, 0.9, 0.3))
    nodes = (
        pose_feature("Table", table, is_variable=True)
        + f"<SetupFeatureContainerNode>{pose_feature('Corner', corner)}</SetupFeatureContainerNode>"
        + plane_feature("Plane", points)
        + plane_feature("Below", points, has_points=True)
    )
    cell = read(tmp_path, f'<{container}><BaseView name="Base"/>{nodes}</{container}>')
    assert list(cell.features) == ["Table", "Corner", "Plane", "Below"]
    assert cell.features["Table"] == Feature(table, is_variable=True)
    assert cell.features["Corner"] == Feature(corner)
    assert cell.features["Plane"].pose == pytest.approx((0.1, 0.2, 0.3, 0.0, 0.0, pi / 2 - pi))
    half_turn = pi / 2**0.5
    assert cell.features["Below"].pose[:3] == (0.1, 0.2, 0.3)
    assert cell.features["Below"].pose[3:] == pytest.approx((half_turn, half_turn, 0.0))


NAN = '<jointPositionVector value="NaN, NaN, NaN, NaN, NaN, NaN"/>'
LINE = [(0.1, 0, 0), (0.2, 0, 0), (0.3, 0, 0)]
CORNER = [(0.1, 0.2, 0.3), (0.4, 0.2, 0.3), (0, 0, 0)]


@pytest.mark.parametrize(
    "node",
    [
        plane_feature("P", [(0, 0, 0)] * 3).replace("<toolPosition", f"{NAN}<toolPosition"),
        plane_feature("P", CORNER).replace('<toolPosition value="0,', f'{NAN}<toolPosition value="0,'),
        plane_feature("P", LINE),
        '<GeomPlaneNode name="P"><firstPoint/><secondPoint/><thirdPoint/></GeomPlaneNode>',
        pose_feature("P", (0, 0, 0, 0, 0, 0)),
        '<GeomPoseNode name="P"><GeomPoseNode name="P"/></GeomPoseNode>',
        pose_feature("P", ("NaN",) * 6),
    ],
    ids=["plane", "third point", "line", "no points", "pose", "no pose", "no numbers"],
)
def test_a_feature_that_was_never_taught_is_zero(tmp_path, node):
    for text, is_variable in (
        (node, False),
        (node.replace('isVariable="false"', 'isVariable="true"'), "isVariable" in node),
    ):
        cell = read(tmp_path, f"<Features>{text}{pose_feature('Q', (0.1, 0, 0, 0, 0, 0))}</Features>")
        assert cell.features == {
            "P": Feature((0.0,) * 6, is_variable, is_taught=False),
            "Q": Feature((0.1, 0.0, 0.0, 0.0, 0.0, 0.0)),
        }


def test_modbus_signals(tmp_path):
    signal = (
        '<ModbusSignal class="ModbusSignal" name="{}" type="{}" slaveAddress="255" updateFrequency="{}" '
        'signalAddress="7" {}/>'
    )
    cell = read(
        tmp_path,
        '<ModbusUnits><Unit ipAddress="10.0.0.9" sequentialMode="false">',
        signal.format("LAMP", "DIGITAL_OUTPUT", 5, 'setLowAtProgramStop="true"'),
        signal.format("COUNT", "REGISTER_INPUT", -1, 'inputAction="NONE"'),
        "</Unit></ModbusUnits>",
    )
    lamp, count = SignalType.DIGITAL_OUTPUT, SignalType.REGISTER_INPUT
    assert cell.modbus == (
        DeclaredSignal("LAMP", "10.0.0.9", 255, 7, lamp, 5.0, RunState.LOW_WHEN_STOPPED),
        DeclaredSignal("COUNT", "10.0.0.9", 255, 7, count),
    )


def test_safety_limits(tmp_path):
    safety = read(tmp_path, f"<SafetySettings>{SAFETY}</SafetySettings>").safety
    assert safety.joint_speed[0] == 3.3415927
    assert safety.reduced_joint_speed == (1.5, 1.5, 1.5, 3.0, 3.0, 3.0)
    assert safety.q_max == pytest.approx((*(5 * [WIDE]), inf), abs=1e-6)
    assert safety.q_min == pytest.approx((*(5 * [-WIDE]), -inf), abs=1e-6)


def test_other_safety_limits(tmp_path):
    values = (
        "[SafetyLimits {} Values]\nmaxTcpSpeed = 1.5\nmaxElbowSpeed = 1.0\nmaxForce = 150.0\nmaxElbowForce = 200.0\n"
        "maxPower = 300.0\nmaxMomentum = 25.0\nmaxStoppingTime = 0.4\nmaxStoppingDistance = 0.5\n"
    )
    text = values.format("Normal") + values.format("Reduced").replace("1.0", "0.75")
    safety = read(tmp_path, f"<SafetySettings>{text}</SafetySettings>").safety
    assert safety.arm == ArmLimits(tool_speed=1.0, force=150.0, power=300.0, momentum=25.0)
    assert safety.reduced_arm == ArmLimits(tool_speed=0.75, force=150.0, power=300.0, momentum=25.0)
    usual = read(tmp_path, f"<SafetySettings>{SAFETY}</SafetySettings>").safety
    assert (usual.arm, usual.reduced_arm, usual.unwatched) == (None, None, ())


PLANE = (
    "[SafetyLimits BoundaryPlane{}]\nname = 'wall {}'\ndisplacement = 0.0\nmode = {}\n"
    "planeNormal = [0.0, 0.0, 2.0]\ndistanceToOrigin = -0.1\nelbowRestricted = {}\n"
)
CONE = (
    "[SafetyLimits ToolOrientation]\ntcpOrientationVector = [0.0, 0.0, -1.0]\n"
    "maximumTcpOrientationDeviation = {}\nmode = {}\n"
)


def boundaries(tmp_path, *texts):
    return read(tmp_path, f"<SafetySettings>{''.join(texts)}</SafetySettings>").safety


def test_safety_planes(tmp_path):
    words = ("1", '"BOTH"', "0", "DISABLED", "TRIGGER_REDUCED_MODE", "Reduced")
    planes = [PLANE.format(n, n, word, "true" if n == 1 else "false") for n, word in enumerate(words)]
    safety = boundaries(tmp_path, *planes)
    assert safety.unwatched == ()
    assert [(p.name, p.mode, p.restricts_elbow) for p in safety.boundaries.planes] == [
        ("wall 0", BoundaryMode.NORMAL, False),
        ("wall 1", BoundaryMode.BOTH, True),
        ("wall 4", BoundaryMode.TRIGGER, False),
        ("wall 5", BoundaryMode.REDUCED, False),
    ]
    assert {(p.position, p.normal) for p in safety.boundaries.planes} == {((0, 0, -0.1), (0, 0, 1))}


def test_the_limit_of_the_tools_direction(tmp_path):
    cone = ToolDirection((0.0, 0.0, -1.0), 0.5, BoundaryMode.BOTH)
    assert boundaries(tmp_path, CONE.format(0.5, "BOTH")).boundaries.tool_direction == cone
    for off in (CONE.format(3.159, "BOTH"), CONE.format(0.5, "DISABLED")):
        assert boundaries(tmp_path, off).boundaries == NO_BOUNDARIES


def test_boundaries_of_unknown_modes_are_named_and_those_without_a_place_are_errors(tmp_path):
    safety = boundaries(tmp_path, PLANE.format(0, 0, "SOMETIMES", "true"), CONE.format(0.5, "SOMETIMES"))
    assert safety.boundaries == NO_BOUNDARIES
    assert safety.unwatched == (
        "SafetyLimits BoundaryPlane0 with the unknown mode SOMETIMES is",
        "SafetyLimits ToolOrientation with the unknown mode SOMETIMES is",
    )
    whole = PLANE.format(0, 0, "NORMAL", "true")
    for spoilt in (
        whole.replace("[0.0, 0.0, 2.0]", "[0.0, 0.0, 0.0]"),
        whole.replace("[0.0, 0.0, 2.0]", "[0.0, 2.0]"),
        whole.replace("distanceToOrigin", "distance"),
        whole.replace("-0.1", "nan"),
    ):
        with pytest.raises(ProgramFileError, match=r"(planeNormal|distanceToOrigin) of the safety settings"):
            boundaries(tmp_path, spoilt)


def test_start_up_and_safe_home(tmp_path):
    node = '<DefaultProgramSettings autoLoad="{}" fileName="sub/x.urp" nameOfSensorToAutoStartProgram="digital_in[6]" triggerValueToStartProgram="false"/>'
    home = '<SafeHomeSettings enabled="true"><position value="0.0, -1.5, 0.0, -1.5, 0.0, 0.0"/></SafeHomeSettings>'
    cell = read(tmp_path, node.format("true"), home)
    assert cell.start_up == StartUp("sub/x.urp", "digital_in[6]", start_level=False)
    assert cell.safe_home == (0.0, -1.5, 0.0, -1.5, 0.0, 0.0)
    assert read(tmp_path, node.format("false")).start_up.program == ""


def test_external_control(tmp_path):
    node = (
        '<Contributed ownerId="com.fzi.externalcontrol"><data key="host_ip" value="10.1.2.3"/>'
        '<data key="port_nr" value="50010"/><data key="name" value="my pc"/></Contributed>'
    )
    cell = read(tmp_path, node)
    assert (cell.pc.host, cell.pc.port, cell.pc_name) == ("10.1.2.3", 50010, "my pc")


PROPERTIES = (
    b"#\n#Tue Mar 02 10:11:12 CET 2021\ncount=7\nplace=p[0.1, 0.2, 0.3, 0, 3.14, 0]\nis\\u005fon=True\n"
)
VARIABLES = b'<InstallationVariables timestamp="1"><variable name="count" value="7" favourite="false"/><variable name="place" value="p[0.1, 0.2, 0.3, 0, 3.14, 0]"/><variable name="is_on" value="True"/></InstallationVariables>'


@pytest.mark.parametrize("data", [PROPERTIES, VARIABLES], ids=["properties", "XML"])
def test_variables(tmp_path, data):
    cell = read(tmp_path, variables=data)
    assert list(cell.variables.items()) == [
        ("count", "7"),
        ("place", "p[0.1, 0.2, 0.3, 0, 3.14, 0]"),
        ("is_on", "True"),
    ]


MANY = "".join(f"v{i}=1\n" for i in range(BUDGETS.installation_entries + 1))
SECTION = "[SafetyLimits Normal Joints]\nmaxJointSpeed = [1, 2]\n"


@pytest.mark.parametrize(
    ("parts", "variables", "problem"),
    [
        ([TCP.replace("0.0, 0.0, 0.12", "0.0, 0.12")], None, "offset of a TCP has 5 values, it needs 6"),
        ([TCP.replace("1.25", "heavy")], None, "mass of the payload is 'heavy', a number is needed"),
        ([listed("analogInputRange", 0, 1)], None, r"<analogInputRange> is \['0', '1'\], 4 of 0 and 1 are needed"),
        ([f"<SafetySettings>{SECTION}</SafetySettings>"], None, "maxJointSpeed of the safety settings has not six"),
        ([f"<SafetySettings>{SECTION.replace('1, 2', '1, 1, 1, 1, 1, nan')}</SafetySettings>"], None, "has not six numbers"),
        ([f"<SafetySettings>{SECTION.replace('1, 2', '1, 1, 1, 1, 1, 0')}</SafetySettings>"], None, "maxJointSpeed of the safety settings is 0, it must be above 0"),
        (["<SafetySettings>[SafetyLimits Normal Values]\nmaxForce = -1\n</SafetySettings>"], None, "maxForce of the safety settings is '-1', it must be a number above 0"),
        ([], b"7a=1\n", "'7a' is not the name of a variable"),
        ([], b"a=\n", "the value of a is not one line of text"),
        ([], b"a=1\\n2\n", "the value of a is not one line of text"),
        ([], MANY.encode(), "has 2001 variables of 2001 characters: at most 2000"),
        ([], b"<Other/>", "is a <Other>, not <InstallationVariables>"),
        ([listed("DigitalInputNames", *range(2001))], None, "more than 2000 TCPs, features, lines and signals"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_one_line(tmp_path, parts, variables, problem):
    with pytest.raises(ProgramFileError, match=problem) as error:
        read(tmp_path, *parts, variables=variables)
    assert "\n" not in str(error.value)


BOMB = gzip.compress(bytes(20_000_000))
ENTITIES = b'<!DOCTYPE a [<!ENTITY b "cccccccccc">]><InstallationVariables><variable name="a" value="&b;"/></InstallationVariables>'


@pytest.mark.parametrize("kind", ["installation", "variables"])
@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (BOMB, "has more than 16[0-9]* bytes unpacked"),
        (ENTITIES, "a document type is declared"),
        (b"<a>" * 201 + b"</a>" * 201, "elements are nested more than 200 deep"),
    ],
    ids=["gzip", "entities", "depth"],
)
def test_hostile_files_are_one_line(tmp_path, kind, data, problem):
    (tmp_path / "cell.installation").write_bytes(installation())
    (tmp_path / f"cell.{kind}").write_bytes(data)
    with pytest.raises(ProgramFileError, match=problem) as error:
        load_installation(ProgramFolder(tmp_path), "cell.installation")
    assert "\n" not in str(error.value)


def test_a_file_of_100_megabytes_is_not_read(tmp_path):
    (tmp_path / "cell.installation").write_bytes(installation())
    with open(tmp_path / "cell.variables", "wb") as file:
        file.truncate(100_000_000)
    with pytest.raises(ProgramFileError, match=r"cell\.variables has more than 16[0-9]* bytes"):
        load_installation(ProgramFolder(tmp_path), "cell.installation")
