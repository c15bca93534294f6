"""Finds and reads installations, each with its variables.

What a file does not give keeps the value of a new box. `default.installation` always exists, perhaps without
settings, as on a new box. Source of all names and shapes: real installations of software 3.5 to 5.26.
"""

import math
import posixpath
from collections.abc import Iterator
from dataclasses import replace
from pathlib import PurePosixPath
from xml.etree.ElementTree import Element

import numpy as np

from protocol.pose import T_to_pose
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import FileMissingError, ProgramFileError, UndefinedError
from ur_emulator.machine.controller.io.lines import RunState
from ur_emulator.machine.controller.io.network import SignalType
from ur_emulator.machine.models.robot_model import ZERO6, Vector3, Vector6, six
from ur_emulator.program_files import variables_file
from ur_emulator.program_files.folder import WIRE_ROOTS, ProgramFolder
from ur_emulator.program_files.installation import (
    STANDARD_GRAVITY,
    DeclaredSignal,
    ExternalControlPc,
    Feature,
    GripperCalibration,
    GripperSetup,
    Installation,
    OutputRule,
    StartUp,
)
from ur_emulator.program_files.lines import LINE_KINDS
from ur_emulator.program_files.reader import ProgramReader, XmlTree
from ur_emulator.program_files.safety_text import safety_settings

SUFFIX = ".installation"
DEFAULT_NAME = "default" + SUFFIX
NEW_BOX = Installation(str(WIRE_ROOTS[0] / DEFAULT_NAME))  # of a box that nobody has set up


def load_installation(folder: ProgramFolder, name: str) -> Installation:
    """Read an installation by the name that a client gives it; FileMissingError if there is none."""
    return _read(ProgramReader(folder), name)


def installation_of(reader: ProgramReader, tree: XmlTree) -> Installation:
    """Read the installation of a program: at its path from the program's folder, else by its name.

    ProgramFileError if there is none of that name, or the file is not an installation.
    """
    given = tree.root.get("installationRelativePath") or tree.root.get("installation") or ""
    path = given.replace("\\", "/").removesuffix(SUFFIX) + SUFFIX if given else DEFAULT_NAME
    for place in (WIRE_ROOTS[0] / tree.file.parent, WIRE_ROOTS[0]):
        name = posixpath.normpath(place / path)
        if reader.folder.has(name):
            return _read(reader, name)
        path = PurePosixPath(path).name
    if path == DEFAULT_NAME:
        return _read(reader, DEFAULT_NAME)
    raise ProgramFileError(f"{tree.file.name} needs the installation {path}: put it beside the program")


def _read(reader: ProgramReader, name: str) -> Installation:
    try:
        file = reader.folder.find(name)
    except FileMissingError:
        if name.rpartition("/")[2].strip('"') != DEFAULT_NAME:
            raise
        return NEW_BOX
    if file.suffix != SUFFIX:
        raise ProgramFileError(f"{file.name} is not an installation: its name must end in {SUFFIX}")
    found = _read_tree(reader.xml(file))
    variables = str(file.with_suffix(variables_file.SUFFIX))
    if not reader.folder.has(variables):
        return found
    return replace(found, variables=variables_file.read_variables(reader, reader.folder.find(variables)))


# Contributors of parts of an installation. Sources: the source text of the URCap; installations.
_EXTERNAL_CONTROL = "com.fzi.externalcontrol"
_ROBOTIQ = "com.robotiq.urcap.gripper"
_CALIBRATION = [f"_{end}ValueIn{unit}" for unit in ("Percent", "Millimeters") for end in ("closed", "open")]
_RUN_STATES = {
    "LOW_WHEN_PROGRAM_STOPPED": RunState.LOW_WHEN_STOPPED,
    "HIGH_WHEN_PROGRAM_STOPPED": RunState.HIGH_WHEN_STOPPED,  # inferred
    "PROGRAM_RUNNING": RunState.HIGH_WHEN_RUNNING,
}
_VOLTAGES = {"ZERO": 0, "TWELVE": 12, "TWENTY_FOUR": 24}


def _read_tree(tree: XmlTree) -> Installation:
    """Return what an installation file declares; its variables stand in another file.

    ProgramFileError if a value makes no sense, or there are too many.
    """
    if tree.root.tag.startswith("gui."):  # of PolyScope 1.8, a dump of its objects: nothing is read
        return Installation(ProgramFolder.wire_path(tree.file))
    reader = _Reader(tree)
    remote = reader.contributed(_EXTERNAL_CONTROL)
    hardness = reader.part("SmoothTransitionSettings").get("transitionHardness")
    home = reader.value(reader.part("SafeHomeSettings"), "position")
    tcps, payloads = reader.tcps(), tree.root.iter("Payload")
    payload = next((one for one in payloads if one.get("defaultPayload") == "true"), reader.tcp_settings)
    mass = payload.get("toolPayload" if payload is reader.tcp_settings else "mass")
    cog = payload.get("centerOfGravity")
    found = Installation(
        ProgramFolder.wire_path(tree.file),
        pc=pc_from(remote, tree),
        pc_name=remote.get("name", ""),
        tcps=tcps,
        tcp_offset=tcps.get(reader.tcp_settings.get("activePose", ""), ZERO6),
        payload=tree.number(mass, "mass of the payload") if mass else 0.0,
        payload_cog=tree.vector3(cog, "centre of gravity") if cog else None,
        gravity=reader.gravity(),
        tool_voltage=reader.tool_voltage(),
        analog_in_domains=reader.domains("analogInputRange", NEW_BOX.analog_in_domains),
        analog_out_domains=reader.domains("analogOutputDomain", NEW_BOX.analog_out_domains),
        input_actions=tuple(row for row in reader.actions("Input") if row[2] not in ("", "NONE")),
        output_rules=tuple(
            OutputRule(group, index, _RUN_STATES[action])
            for group, index, action in reader.actions("Output")
            if action in _RUN_STATES
        ),
        transition_hardness=0 if hardness == "HARD" else 1,
        lines=reader.line_names(),
        features=dict(reader.features(reader.part("Features", "GeomFeatures"))),
        modbus=tuple(reader.signals()),
        safe_home=tree.vector6(home, "safe home") if home else NEW_BOX.safe_home,
        safety=safety_settings(tree.file.name, reader.part("SafetySettings").itertext()),
        start_up=reader.start_up(),
        grippers=reader.grippers(),
    )
    entries = len(found.tcps) + len(found.features) + len(found.lines) + len(found.modbus)
    if entries > BUDGETS.installation_entries:
        raise ProgramFileError(
            f"{tree.file.name} has more than {BUDGETS.installation_entries} TCPs, features, lines and signals"
        )
    return found


def pc_from(data: dict[str, str], tree: XmlTree) -> ExternalControlPc:
    """Return the PC in the data of a node or an installation. Keys: the source text of the URCap.

    ProgramFileError if the host is too long for a name, or the port is not a port number.
    """
    host = data.get("host_ip", "")
    if len(host) > BUDGETS.host_length:
        raise tree.error(f"the host of External Control has more than {BUDGETS.host_length} characters")
    port = data.get("port_nr", "")
    if port and not (port.isascii() and port.isdigit() and 0 < int(port[:6]) < 1 << 16):
        raise tree.error(f"port {port[:20]!r} of External Control is none of 1 to 65535")
    return ExternalControlPc(host, int(port or 0))


_NOTHING = Element("nothing")


class _Reader:
    def __init__(self, tree: XmlTree) -> None:
        self.tree = tree
        self._first: dict[str, Element] = {}
        for element in tree.root.iter():
            self._first.setdefault(element.tag.rpartition(".")[2], element)
        self.tcp_settings = self.part("TCPSettings", "TCPSettingsImpl")

    def part(self, *kinds: str) -> Element:
        """Return the first element of the first of these kinds that is there; an empty one for none."""
        return next((self._first[kind] for kind in kinds if kind in self._first), _NOTHING)

    def value(self, element: Element, name: str) -> str:
        """Return a list of an element: of its attribute, or of the child of that name."""
        child = element.find(name)
        if child is None:
            return element.get(name, "")
        return self.tree.resolve(child).get("value", "")

    def items(self, kind: str) -> list[str]:
        """Return the items of the list that the first element of a kind holds."""
        given = self.part(kind).get("value")
        return [item.strip() for item in given.split(",")] if given else []

    def contributed(self, owner: str) -> dict[str, str]:
        """Return what a URCap has kept, by key."""
        parts = [part for part in self.tree.root.iter("Contributed") if part.get("ownerId") == owner]
        return {item.get("key", ""): item.get("value", "") for part in parts for item in part.iter("data")}

    def grippers(self) -> GripperSetup:
        data = self.contributed(_ROBOTIQ)
        calibrations = {}
        for n in range(1, 5):
            prefix = f"_models.Gripper{n}."
            if data.get(prefix + "_isCalibrationDefined") == "true":
                values = [
                    self.tree.number(data.get(prefix + key), f"{key} of a gripper") for key in _CALIBRATION
                ]
                if values[0] == values[1] or max(map(abs, values)) > 1000.0:
                    problem = f"gripper {n} is calibrated at {values}: use two positions, widths below 1 m"
                    raise self.tree.error(problem)
                calibrations[n] = GripperCalibration(*values)
        is_limited = data.get("gripper_current_limit_enabled") == "true"
        return GripperSetup(bool(data), is_limited, calibrations)

    def tcps(self) -> dict[str, Vector6]:
        return {
            tcp.get("name", ""): self.tree.vector6(tcp.get("offset"), "offset of a TCP")
            for tcp in self.tcp_settings.iter("tcp")
            if tcp.get("name")
        }

    def gravity(self) -> Vector3:
        mounting = self.part("WorldtoMarshal")
        if mounting is _NOTHING:
            return NEW_BOX.gravity
        base = self.tree.number(mounting.get("baseAngle", "0"), "angle of the base")
        tilt = self.tree.number(mounting.get("tiltAngle", "0"), "tilt of the base")
        # The sign of y is seen; which of sine and cosine belongs to x is open: both were equal.
        level = STANDARD_GRAVITY * math.sin(tilt)
        return (level * math.cos(base), -level * math.sin(base), STANDARD_GRAVITY * math.cos(tilt))

    def tool_voltage(self) -> int:
        if self.contributed(_ROBOTIQ):
            return 24  # its software controls the connector
        given = self.part("ToolCommSettings").get("toolOutputVoltage", "")
        return _VOLTAGES.get(given or self.tree.root.get("toolOutputVoltage", ""), 0)

    def domains(self, kind: str, usual: tuple[int, ...]) -> tuple[int, ...]:
        given = self.items(kind)
        if not given:
            return usual
        if len(given) != len(usual) or not set(given) <= {"0", "1"}:
            raise self.tree.error(f"<{kind}> is {given[:8]}, {len(usual)} of 0 and 1 are needed")
        return tuple(map(int, given))

    def actions(self, direction: str) -> Iterator[tuple[str, int, str]]:
        """Yield group, index and action of the lines in a direction that can have one."""
        for kind in LINE_KINDS:
            if kind.element.endswith(direction):
                actions = self.items(f"{kind.element}Actions")[: kind.actions]
                yield from ((kind.group, index, action) for index, action in enumerate(actions))

    def line_names(self) -> dict[str, str]:
        names: dict[str, str] = {}
        for kind in LINE_KINDS:
            for index, name in enumerate(self.items(f"{kind.element}Names"), kind.first):
                if name:
                    names.setdefault(name, f"{kind.name}[{index}]")
        return names

    def signals(self) -> Iterator[DeclaredSignal]:
        for unit in self.tree.root.iter("Unit"):
            for signal in unit.iter("ModbusSignal"):
                kind = SignalType.__members__.get(signal.get("type", ""))
                if kind is None:
                    continue
                frequency = self.tree.number(signal.get("updateFrequency", "-1"), "frequency of a signal")
                rule = _RUN_STATES.get(signal.get("outputAction", ""), RunState.KEEP)
                if signal.get("setLowAtProgramStop") == "true":
                    rule = RunState.LOW_WHEN_STOPPED
                yield DeclaredSignal(
                    signal.get("name", ""),
                    unit.get("ipAddress", ""),
                    int(self.tree.number(signal.get("slaveAddress", "255"), "slave of a signal")),
                    int(self.tree.number(signal.get("signalAddress", "0"), "address of a signal")),
                    kind,
                    frequency if frequency >= 0.0 else None,
                    rule,
                    unit.get("sequentialMode") == "true",
                )

    def start_up(self) -> StartUp:
        settings = self.part("DefaultProgramSettings")
        return StartUp(
            settings.get("fileName", "") if settings.get("autoLoad") == "true" else "",
            settings.get("nameOfSensorToAutoStartProgram", ""),
            settings.get("triggerValueToStartProgram", "true") == "true",
        )

    def features(
        self, node: Element, name: str = "", *, is_variable: bool = False
    ) -> Iterator[tuple[str, Feature]]:
        """Yield the features in a node; one may stand in another node that has its name."""
        for given in node:
            child = self.tree.resolve(given)
            inner_name = child.get("name") or name
            variable = child.get("isVariable") == "true" or (is_variable and not child.get("isVariable"))
            try:
                pose, is_taught = self._pose_of(child), True
            except UndefinedError:
                pose, is_taught = ZERO6, False
            if pose is not None and inner_name:
                yield inner_name, Feature(pose, variable, is_taught)
            elif pose is None and given is child:
                yield from self.features(child, inner_name, is_variable=variable)

    def _pose_of(self, node: Element) -> Vector6 | None:
        """Return the pose of a feature, None for another node; UndefinedError if it was never taught."""
        if node.tag.endswith("GeomPlaneNode") and node.find("firstPoint") is not None:
            return self._plane(node)
        if not node.tag.endswith("GeomPoseNode") or any(inner.tag.endswith("GeomPoseNode") for inner in node):
            return None
        position, rotation = self._taught(node, "toolPosition", "toolAxisAngle")
        return (*position, *rotation)

    def _taught(self, node: Element, *names: str) -> list[Vector3]:
        """Return vectors of a point; UndefinedError if it was never taught: no angles, and only zeros."""
        vectors = [self.tree.vector3(self.value(node, name), f"{name} of a feature") for name in names]
        if "NaN" in self.value(node, "jointPositionVector") and not any(map(any, vectors)):
            raise self.tree.undefined("a feature was never taught")
        return vectors

    def _plane(self, node: Element) -> Vector6:
        p1, p2, p3 = (self._point(node, name) for name in ("firstPoint", "secondPoint", "thirdPoint"))
        y, normal = p2 - p1, np.cross(p2 - p1, p3 - p1)
        length, area = float(np.linalg.norm(y)), float(np.linalg.norm(normal))
        if not (length > 0.0 and area > 0.0):
            raise self.tree.undefined("the points of a plane lie on a line")
        y, z = y / length, normal / (-area if node.get("userHasPoints") == "true" else area)
        T_base_plane = np.eye(4)
        T_base_plane[:3, :4] = np.column_stack((np.cross(y, z), y, z, p1))
        return six(T_to_pose(T_base_plane))

    def _point(self, node: Element, name: str) -> np.ndarray:
        point = node.find(name)
        inner = None if point is None else self.tree.resolve(point)
        for element in () if inner is None else inner.iter():
            if self.value(element, "toolPosition"):
                return np.array(self._taught(element, "toolPosition")[0])
        raise self.tree.undefined(f"a plane has no <{name}>")
