"""From the tree of an installation file to the record.

What a file does not give keeps the value of a new box. Source of all names and shapes: real installations of
software 3.5 to 5.26.
"""

from __future__ import annotations

import math
import posixpath
from collections.abc import Iterator
from dataclasses import replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

import numpy as np

from protocol.pose import T_to_pose
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import FileMissingError, ProgramFileError, UndefinedError
from ur_emulator.machine.controller.io.lines import RunState
from ur_emulator.machine.controller.io.network import SignalType
from ur_emulator.machine.models.robot_model import ZERO6, Vector3, Vector6, six
from ur_emulator.program_files import installation, variables_file
from ur_emulator.program_files.folder import WIRE_ROOTS, ProgramFolder
from ur_emulator.program_files.installation import Installation
from ur_emulator.program_files.lines import LINE_KINDS
from ur_emulator.program_files.reader import ProgramReader, XmlTree
from ur_emulator.program_files.safety_text import safety_settings

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


# --- finds and reads installations, each with its variables
#
# `default.installation` always exists, perhaps without settings, as on a new box.

SUFFIX = ".installation"
DEFAULT_NAME = "default" + SUFFIX
NEW_BOX = Installation(str(WIRE_ROOTS[0] / DEFAULT_NAME))
"""The installation of a box that nobody has set up."""


def load_installation(folder: ProgramFolder, name: str) -> Installation:
    """Read an installation by the name that a client gives it; FileMissingError if there is none."""
    return _read(ProgramReader(folder), name)


def installation_of(reader: ProgramReader, tree: XmlTree) -> Installation:
    """Read the installation of a program: at its path from the program's folder, else by its name.

    ProgramFileError if there is none of that name, or the file is not an installation.
    """
    given = tree.root.get("installationRelativePath") or tree.root.get("installation") or ""
    path = given.replace("\\", "/").removesuffix(SUFFIX) + SUFFIX if given else DEFAULT_NAME
    for place in (PurePosixPath(tree.file.wire_path).parent, WIRE_ROOTS[0]):
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
    if file.inside.suffix != SUFFIX:
        raise ProgramFileError(f"{file.name} is not an installation: its name must end in {SUFFIX}")
    found = _read_tree(reader.xml(file))
    variables = str(file.inside.with_suffix(variables_file.SUFFIX))
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
_SIGNAL_TYPES = {kind.name: kind for kind in SignalType}


def _read_tree(tree: XmlTree) -> Installation:
    """Return what an installation file declares; its variables stand in another file.

    ProgramFileError if a value makes no sense, or there are too many.
    """
    found = Installation(tree.file.wire_path)
    if tree.root.tag.startswith("gui."):  # of PolyScope 1.8, a dump of its objects: nothing is read
        return found
    reader = _Reader(tree)
    pc, pc_name = reader.external_control()
    tcps, active_tcp = reader.tcps()
    safety = reader.first.get("SafetySettings")
    found = Installation(
        tree.file.wire_path,
        pc,
        pc_name,
        tcps,
        active_tcp,
        reader.payload(),
        reader.gravity(),
        reader.tool_voltage(),
        reader.domains("analogInputRange", found.analog_in_domains),
        reader.domains("analogOutputDomain", found.analog_out_domains),
        reader.input_actions(),
        reader.output_rules(),
        0 if reader.attribute("SmoothTransitionSettings", "transitionHardness") == "HARD" else 1,
        reader.line_names(),
        dict(_features(reader, reader.first.get("Features", reader.first.get("GeomFeatures")))),
        {},
        tuple(reader.signals()),
        reader.safe_home(),
        found.safety if safety is None else safety_settings(tree.file.name, safety.itertext()),
        reader.start_up(),
        reader.grippers(),
    )
    entries = len(tcps) + len(found.features) + len(found.lines) + len(found.modbus)
    if entries > BUDGETS.installation_entries:
        raise ProgramFileError(
            f"{tree.file.name} has more than {BUDGETS.installation_entries} TCPs, features, lines and signals"
        )
    return found


def pc_from(data: dict[str, str], tree: XmlTree) -> installation.ExternalControlPc:
    """Return the PC in the data of a node or an installation. Keys: the source text of the URCap.

    ProgramFileError if the host is too long for a name, or the port is not a port number.
    """
    host = data.get("host_ip", "")
    if len(host) > BUDGETS.host_length:
        raise tree.error(f"the host of External Control has more than {BUDGETS.host_length} characters")
    port = data.get("port_nr", "")
    if port and not (port.isascii() and port.isdigit() and 0 < int(port[:6]) < 1 << 16):
        raise tree.error(f"port {port[:20]!r} of External Control is none of 1 to 65535")
    return installation.ExternalControlPc(host, int(port or 0))


class _Reader:
    """Looks up the parts of one file; `first` is the first element of each kind."""

    def __init__(self, tree: XmlTree) -> None:
        self.tree = tree
        self.first: dict[str, Element] = {}
        for element in tree.root.iter():
            self.first.setdefault(element.tag.rpartition(".")[2], element)
        self._tcp_settings = self.first.get("TCPSettings", self.first.get("TCPSettingsImpl"))

    def attribute(self, kind: str, name: str, default: str = "") -> str:
        """Return an attribute of the first element of a kind."""
        return self.first[kind].get(name, default) if kind in self.first else default

    def value(self, element: Element, name: str) -> str:
        """Return a list of an element: of its attribute, or of the child of that name."""
        child = element.find(name)
        if child is None:
            return element.get(name, "")
        return self.tree.resolve(child).get("value", "")

    def items(self, kind: str) -> list[str]:
        """Return the items of the list that the first element of a kind holds."""
        given = self.attribute(kind, "value")
        return [item.strip() for item in given.split(",")] if given else []

    def _contributed(self, owner: str) -> dict[str, str]:
        """Return what a URCap has kept, by key."""
        parts = [part for part in self.tree.root.iter("Contributed") if part.get("ownerId") == owner]
        return {item.get("key", ""): item.get("value", "") for part in parts for item in part.iter("data")}

    def external_control(self) -> tuple[installation.ExternalControlPc, str]:
        data = self._contributed(_EXTERNAL_CONTROL)
        return pc_from(data, self.tree), data.get("name", "")

    def grippers(self) -> installation.GripperSetup:
        data = self._contributed(_ROBOTIQ)
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
                calibrations[n] = installation.GripperCalibration(*values)
        is_limited = data.get("gripper_current_limit_enabled") == "true"
        return installation.GripperSetup(bool(data), is_limited, calibrations)

    def tcps(self) -> tuple[dict[str, Vector6], str]:
        settings = self._tcp_settings
        if settings is None:
            return {}, ""
        tcps = {
            tcp.get("name", ""): self.tree.vector6(tcp.get("offset"), "offset of a TCP")
            for tcp in settings.iter("tcp")
            if tcp.get("name")
        }
        return tcps, settings.get("activePose", "")

    def payload(self) -> installation.DeclaredPayload:
        payloads = self.tree.root.iter("Payload")
        payload = next((one for one in payloads if one.get("defaultPayload") == "true"), self._tcp_settings)
        if payload is None:
            return installation.DeclaredPayload()
        mass = payload.get("toolPayload" if payload is self._tcp_settings else "mass")
        cog = payload.get("centerOfGravity")
        return installation.DeclaredPayload(
            self.tree.number(mass, "mass of the payload") if mass else 0.0,
            self.tree.vector3(cog, "centre of gravity") if cog else None,
        )

    def gravity(self) -> Vector3:
        if "WorldtoMarshal" not in self.first:
            return (0.0, 0.0, installation.STANDARD_GRAVITY)
        base = self.tree.number(self.attribute("WorldtoMarshal", "baseAngle", "0"), "angle of the base")
        tilt = self.tree.number(self.attribute("WorldtoMarshal", "tiltAngle", "0"), "tilt of the base")
        # The sign of y is seen; which of sine and cosine belongs to x is open: both were equal.
        g = installation.STANDARD_GRAVITY
        level = g * math.sin(tilt)
        return (level * math.cos(base), -level * math.sin(base), g * math.cos(tilt))

    def tool_voltage(self) -> int:
        if self._contributed(_ROBOTIQ):
            return 24  # its software controls the connector
        given = self.attribute("ToolCommSettings", "toolOutputVoltage")
        return _VOLTAGES.get(given or self.tree.root.get("toolOutputVoltage", ""), 0)

    def domains(self, kind: str, usual: tuple[int, ...]) -> tuple[int, ...]:
        given = self.items(kind)
        if not given:
            return usual
        if len(given) != len(usual) or not set(given) <= {"0", "1"}:
            raise self.tree.error(f"<{kind}> is {given[:8]}, {len(usual)} of 0 and 1 are needed")
        return tuple(map(int, given))

    def _actions(self, direction: str) -> Iterator[tuple[str, int, str]]:
        """Yield group, index and action of the lines in a direction that can have one."""
        for kind in LINE_KINDS:
            if kind.element.endswith(direction):
                actions = self.items(f"{kind.element}Actions")[: kind.actions]
                yield from ((kind.group, index, action) for index, action in enumerate(actions))

    def input_actions(self) -> tuple[tuple[str, int, str], ...]:
        return tuple(row for row in self._actions("Input") if row[2] not in ("", "NONE"))

    def output_rules(self) -> tuple[installation.OutputRule, ...]:
        return tuple(
            installation.OutputRule(group, index, _RUN_STATES[action])
            for group, index, action in self._actions("Output")
            if action in _RUN_STATES
        )

    def line_names(self) -> dict[str, str]:
        names: dict[str, str] = {}
        for kind in LINE_KINDS:
            for index, name in enumerate(self.items(f"{kind.element}Names"), kind.first):
                if name:
                    names.setdefault(name, f"{kind.name}[{index}]")
        return names

    def signals(self) -> Iterator[installation.DeclaredSignal]:
        for unit in self.tree.root.iter("Unit"):
            for signal in unit.iter("ModbusSignal"):
                kind = _SIGNAL_TYPES.get(signal.get("type", ""))
                if kind is None:
                    continue
                frequency = self.tree.number(signal.get("updateFrequency", "-1"), "frequency of a signal")
                rule = _RUN_STATES.get(signal.get("outputAction", ""), RunState.KEEP)
                if signal.get("setLowAtProgramStop") == "true":
                    rule = RunState.LOW_WHEN_STOPPED
                yield installation.DeclaredSignal(
                    signal.get("name", ""),
                    unit.get("ipAddress", ""),
                    int(self.tree.number(signal.get("slaveAddress", "255"), "slave of a signal")),
                    int(self.tree.number(signal.get("signalAddress", "0"), "address of a signal")),
                    kind,
                    frequency if frequency >= 0.0 else None,
                    rule,
                    unit.get("sequentialMode") == "true",
                )

    def safe_home(self) -> Vector6:
        settings = self.first.get("SafeHomeSettings")
        position = "" if settings is None else self.value(settings, "position")
        return self.tree.vector6(position, "safe home") if position else installation.NEW_HOME

    def start_up(self) -> installation.StartUp:
        kind = "DefaultProgramSettings"
        return installation.StartUp(
            self.attribute(kind, "fileName") if self.attribute(kind, "autoLoad") == "true" else "",
            self.attribute(kind, "nameOfSensorToAutoStartProgram"),
            self.attribute(kind, "triggerValueToStartProgram", "true") == "true",
        )


def _features(
    file: _Reader, node: Element | None, name: str = "", *, is_variable: bool = False
) -> Iterator[tuple[str, installation.Feature]]:
    """Yield the features in a node; one may stand in another node that has its name."""
    for given in () if node is None else node:
        child = file.tree.resolve(given)
        inner_name = child.get("name") or name
        variable = child.get("isVariable") == "true" or (is_variable and not child.get("isVariable"))
        try:
            pose, is_taught = _pose_of(file, child), True
        except UndefinedError:
            pose, is_taught = ZERO6, False
        if pose is not None and inner_name:
            yield inner_name, installation.Feature(pose, variable, is_taught)
        elif pose is None and given is child:
            yield from _features(file, child, inner_name, is_variable=variable)


def _pose_of(file: _Reader, node: Element) -> Vector6 | None:
    """Return the pose of a feature, None for another node; UndefinedError if it was never taught."""
    if node.tag.endswith("GeomPlaneNode") and node.find("firstPoint") is not None:
        return _plane(file, node)
    if not node.tag.endswith("GeomPoseNode") or any(inner.tag.endswith("GeomPoseNode") for inner in node):
        return None
    position, rotation = _taught(file, node, "toolPosition", "toolAxisAngle")
    return (*position, *rotation)


def _taught(file: _Reader, node: Element, *names: str) -> list[Vector3]:
    """Return vectors of a point; UndefinedError if it was never taught: no joint angles, and only zeros."""
    vectors = [file.tree.vector3(file.value(node, name), f"{name} of a feature") for name in names]
    if "NaN" in file.value(node, "jointPositionVector") and not any(map(any, vectors)):
        raise file.tree.undefined("a feature was never taught")
    return vectors


def _plane(file: _Reader, node: Element) -> Vector6:
    p1, p2, p3 = (_point(file, node, name) for name in ("firstPoint", "secondPoint", "thirdPoint"))
    y, normal = p2 - p1, np.cross(p2 - p1, p3 - p1)
    length, area = float(np.linalg.norm(y)), float(np.linalg.norm(normal))
    if not (length > 0.0 and area > 0.0):
        raise file.tree.undefined("the points of a plane lie on a line")
    y, z = y / length, normal / (-area if node.get("userHasPoints") == "true" else area)
    T_base_plane = np.eye(4)
    T_base_plane[:3, :4] = np.column_stack((np.cross(y, z), y, z, p1))
    return six(T_to_pose(T_base_plane))


def _point(file: _Reader, node: Element, name: str) -> np.ndarray:
    point = node.find(name)
    inner = None if point is None else file.tree.resolve(point)
    for element in () if inner is None else inner.iter():
        if file.value(element, "toolPosition"):
            return np.array(_taught(file, element, "toolPosition")[0])
    raise file.tree.undefined(f"a plane has no <{name}>")
