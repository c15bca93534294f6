"""Moves and their waypoints.

A waypoint in Cartesian space is a pose, to which the tool goes that is active when the program runs; one in
joint space is joint angles. Source: program files and the scripts that PolyScope saved beside them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from protocol.pose import pose_inv
from ur_emulator.program_files.reader import CB3
from ur_emulator.program_files.script_writer import identifier
from ur_emulator.program_files.urp_expressions import (
    ZERO_POSE,
    expression_of,
    only_angles,
    pose_of,
    pose_text,
    position_of,
    taught_feature,
    taught_waypoint,
    variable_name,
)
from ur_emulator.program_files.urp_maker import Around, NodeKinds, UrpMaker
from ur_emulator.program_files.urp_nodes import Node

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


KINDS = NodeKinds()

# --- motions that end at an event: Direction with Until, and the Force node

_AXES = ("X", "Y", "Z")
_SIGNS = {"Plus": ("+", "1.0"), "Minus": ("-", "-1.0")}
# Goal of a direction that no distance ends [m]; it is beyond the reach of every arm.
_FAR = "1000.0"
# The way back from a contact: its speed is 0.1 m/s.
_RETRACTION = """\
kill move_thread_han_{n}
stopl({a})
local contactPose=get_forward_kin(get_actual_joint_positions_history(stepsToRetract))
local axis=[targetTcpDirection[0], targetTcpDirection[1], targetTcpDirection[2]]
local retractTo=contactPose
if (norm(axis) > 1e-6):
  local unit=normalize(axis)
  retractTo = pose_sub(contactPose, p[unit[0]*{d}, unit[1]*{d}, unit[2]*{d}, 0, 0, 0])
end
movel(retractTo, a={a}, v=0.1)"""
_POINT = """\
def calculate_point_to_move_towards(feature, direction, position_distance):
  local goal=get_target_waypoint()
  local axis=[direction[0], direction[1], direction[2]]
  if (norm(axis) < 1e-6):
    return goal
  end
  local unit=normalize(axis)
  local d=position_distance
  local step=p[unit[0]*d, unit[1]*d, unit[2]*d, 0, 0, 0]
  local turned=pose_trans(p[0, 0, 0, feature[3], feature[4], feature[5]], step)
  return p[goal[0]+turned[0], goal[1]+turned[1], goal[2]+turned[2], goal[3], goal[4], goal[5]]
end"""


@KINDS.writes(
    "gui.program.direction.MoveDirectionNode",
    "a motion in a thread that its `Until` nodes end: a distance, or a contact and a way back",
)
def _write_direction(maker: UrpMaker, node: Node, around: Around) -> None:
    writer, n = maker.writer, node.number
    untils = [child for child in node.children if child.kind == "Until"]
    if not untils or len(untils) != len(node.children):
        raise node.tree.undefined("a direction needs <Until> nodes, and no others")
    feature = feature_name(node)
    name, vector = _direction(maker, node)
    maker.put(node, around, f"Direction: {_LABELS.get(feature, feature)}{name}")
    maker.declare("point of a direction", _POINT)
    distance = _FAR
    for until in untils:
        if until.get("type") == "DISTANCE":
            distance = node.tree.number_text(until.text("Distance"), "distance of an <Until>")
    speed, acceleration = _tool_parameters(node, around)
    frame = frame_of(maker, node, feature, "get_forward_kin()")
    writer.add(f"global move_thread_flag_{n}=0")
    with writer.block(f"thread move_thread_{n}():"):
        writer.add(
            "enter_critical",
            f"move_thread_flag_{n} = 1",
            f"local towardsPos=calculate_point_to_move_towards({frame}, {vector}, {distance})",
            f"movel(towardsPos, a={acceleration}, v={speed})",
            f"move_thread_flag_{n} = 2",
            "exit_critical",
        )
    writer.add(f"move_thread_flag_{n} = 0", f"move_thread_han_{n} = run move_thread_{n}()")
    with writer.block("while (True):"):
        for until in sorted(untils, key=lambda one: one.get("type") == "DISTANCE"):
            _write_until(maker, until, n, acceleration, around)
        writer.add("sync()")


def _direction(maker: UrpMaker, node: Node) -> tuple[str, str]:
    """Return the direction as labels show it, and as a list of three numbers."""
    selected = node.get("selectedDirection")
    if not selected:
        return "", expression_of(maker, node).script
    axis, sign = selected[:1], selected[1:]
    if axis not in _AXES or sign not in _SIGNS:
        raise node.tree.unknown(f"a direction {selected!r}")
    mark, length = _SIGNS[sign]
    return f" {axis}{mark}", f"[{', '.join(length if one == axis else '0.0' for one in _AXES)}]"


def _tool_parameters(node: Node, around: Around) -> list[str]:
    """Return speed and acceleration: those of the node, else those of the move around it."""
    if own := node.get("toolParams"):
        return node.tree.number_texts(own, "toolParams of a direction", 2)
    if around.move is None:
        raise node.tree.undefined("a direction stands outside of a <Move> and has no toolParams")
    names = ("speed", "acceleration")
    return [node.tree.number_text(around.move.get(name), f"{name} of a direction") for name in names]


def _write_until(maker: UrpMaker, node: Node, n: int, acceleration: str, around: Around) -> None:
    """Write the part of a loop that looks whether an `<Until>` ends the motion of label `n`."""
    writer, kind = maker.writer, node.get("type")
    label = f"Until ({kind.lower()})"
    match kind:
        case "DISTANCE" if node.get("distanceNodeType") in ("", "STOP"):
            writer.add("sleep(1.0E-10)")
            with writer.block(f"if (move_thread_flag_{n} > 1):"):
                writer.add(f"join move_thread_han_{n}")
                maker.put(node, around, label)
                maker.write_children(node, around)
                writer.add("break")
        case "TOOL_CONTACT_DETECTION":
            deceleration = node.tree.number_text(
                node.get("decelerationAcceleration") or acceleration, "deceleration of an <Until>"
            )
            retraction = node.tree.number_text(node.get("retraction") or "0.0", "retraction of an <Until>")
            writer.add(
                "local targetTcpDirection=get_target_tcp_speed()",
                "local stepsToRetract=tool_contact(direction=targetTcpDirection)",
            )
            with writer.block("if (stepsToRetract > 0):"):
                writer.add(_RETRACTION.format(n=n, a=deceleration, d=retraction))
                maker.put(node, around, label)
                maker.write_children(node, around)
                writer.add("break")
        case _:
            how = f"{kind} {node.get('distanceNodeType')}".strip()
            raise node.tree.unknown(f"an <Until> of type {how!r}")


@KINDS.writes("Force", "`force_mode` around its nodes; only the type Frame")
def _write_force(maker: UrpMaker, node: Node, around: Around) -> None:
    if node.get("type") != "Frame":
        raise node.tree.unknown(f"a <Force> of type {node.get('type')!r}")
    values = []
    for tag in ("selection", "wrench", "limitsForce", "limitsMotion"):
        element = node.find(tag)
        given = None if element is None else element.get("value")
        values.append(node.tree.number_texts(given, f"{tag} of a <Force>"))
    selection, wrench, compliant, stiff = values
    limits = [c if float(selected) else s for selected, c, s in zip(selection, compliant, stiff, strict=True)]
    lists = [f"[{', '.join(one)}]" for one in (selection, wrench, limits)]
    frame = frame_of(maker, node, feature_name(node), "tool_pose()")
    force_mode = f"force_mode({frame}, {lists[0]}, {lists[1]}, 2, {lists[2]})"
    maker.put(node, around, "Force", "sleep(0.02)", "zero_ftsensor()", force_mode)
    maker.write_children(node, Around(around.move, "noBreak"))
    maker.writer.add("end_force_mode()", "stopl(5.0)")


# Type of a move -> builtin, and the attributes of a waypoint that replace the move's acceleration and speed.
_TYPES = {
    "MoveJ": ("movej", "jointAcceleration", "jointSpeed"),
    "MoveL": ("movel", "cartesianAcceleration", "cartesianSpeed"),
    "MoveP": ("movep", "cartesianAcceleration", "cartesianSpeed"),
}
_PARAMETERS = frozenset(
    {"jointSpeed", "jointAcceleration", "cartesianSpeed", "cartesianAcceleration"}
    | {"blendRadius", "nextMotionTime", "reference"}
)
_BASE = "Joint_0_name"
_TOOL = "Joint_6_name"
# How labels call features, other than by their names.
_LABELS = {"": "Base", _BASE: "Base", _TOOL: "Tool"}
_AFTER = "breakAfter"


@KINDS.writes("Move", "a label and its nodes (MoveJ, MoveL, MoveP); `set_tcp` if it names a TCP")
def _write_move(maker: UrpMaker, node: Node, around: Around) -> None:
    motion = _motion(node)
    if node.get("optimoveEnabled") == "true":
        raise node.tree.unknown("a <Move> with OptiMove")
    maker.put(node, around, motion)
    if node.get("useActiveTCP") == "false" and (tcp := node.find("tcp")) is not None:
        maker.writer.add(set_tcp(maker, node, tcp))
    maker.write_children(node, Around(node, around.mark))


def set_tcp(maker: UrpMaker, node: Node, tcp: Element) -> str:
    """Return the statement that makes a TCP of the installation the active one, or UndefinedError."""
    name = tcp.get("referencedName", "")
    offset = maker.installation.tcps.get(name)
    if offset is None:
        known = ", ".join(maker.installation.tcps) or "none"
        raise node.tree.undefined(f"the installation has no TCP {name[:100]!r}: it has {known}")
    return f"set_tcp(p[{', '.join(map(repr, offset))}])"


@KINDS.writes(
    "Waypoint",
    "`movej`, `movel` or `movep`: Fixed, Variable (also a feature), Relative; own speeds, blend or time",
)
def _write_waypoint(maker: UrpMaker, node: Node, around: Around) -> None:
    move = _move_around(node, around)
    builtin = _TYPES[_motion(move)][0]
    if node.children:
        raise node.tree.unknown("what is inside of a waypoint")
    maker.writer.label(node.number, _waypoint_name(node), around.mark or _AFTER)
    target = _target(maker, node, move, builtin)
    maker.writer.add(f"{builtin}({target}, {_motion_parameters(maker, node, node, move)})")


@KINDS.writes(
    "CircleMove",
    "`movec` through the first to the second waypoint, `mode=1` for a fixed orientation",
)
def _write_circle(maker: UrpMaker, node: Node, around: Around) -> None:
    move = _move_around(node, around)
    if [child.kind for child in node.children] != ["Waypoint", "Waypoint"]:
        raise node.tree.undefined("a <CircleMove> needs two waypoints: one on the way, and its end")
    via, end = node.children
    maker.put(node, around, "CircleMove")
    maker.writer.label(via.number, _waypoint_name(via), "noBreak")
    maker.writer.label(end.number, _waypoint_name(end), around.mark or _AFTER)
    targets = ", ".join(_target(maker, one, move, "movep") for one in (via, end))
    mode = ", mode=1" if node.get("OrientationMode") == "FIXED" else ""
    maker.writer.add(f"movec({targets}, {_motion_parameters(maker, node, end, move)}{mode})")


@KINDS.writes(
    "SafeHome",
    "`movej` to the home position of the installation, or else to that of a new box: arm upright",
)
def _write_safe_home(maker: UrpMaker, node: Node, around: Around) -> None:
    given = [("t", "nextMotionTime", "time")]
    if node.get("positionOptionType") == "SPEED_AND_ACCELERATION":
        given = [("a", "acceleration", "acceleration"), ("v", "speed", "speed")]
    how = ", ".join(
        f"{letter}={node.tree.number_text(node.get(name), f'{what} of a <SafeHome>')}"
        for letter, name, what in given
    )
    maker.put(node, around, "Home", f"movej([{', '.join(map(repr, maker.installation.safe_home))}], {how})")


# --- targets


def _target(maker: UrpMaker, node: Node, move: Node, builtin: str) -> str:
    """Return where a waypoint is, as the builtin takes it."""
    match node.get("type") or "Fixed":
        case "Variable":
            name = variable_name(node)
            taught_feature(maker, node, name)
            feature = _variable_feature(maker, move)
            return f"pose_trans({feature}, {name})" if feature else name
        case "Fixed":
            return _fixed_target(maker, node, move, builtin)
        case "Relative":
            return _relative_target(maker, node)
        case other:
            raise node.tree.unknown(f"a waypoint of type {other!r}")


def _fixed_target(maker: UrpMaker, node: Node, move: Node, builtin: str) -> str:
    pose, q = taught_waypoint(maker, node, node.find("position"), _waypoint_name(node))
    if not pose or (builtin == "movej" and _is_joint_move(move)):
        return q
    if feature := _variable_feature(maker, move):
        pose = _in_feature(node, pose, feature)
    return f"get_inverse_kin({pose}, qnear={q})" if builtin == "movej" else pose


def _in_feature(node: Node, pose: str, feature: str) -> str:
    """Return a pose that moves with a feature."""
    given = node.find("BaseToFeature")
    if given is not None:
        base = pose_text(pose_inv(pose_of(node.tree, given.get("pose"), "<BaseToFeature>")))
        return f"pose_trans({feature}, pose_trans({base}, {pose}))"
    inside = node.find("position/poseInFeatureCoordinates")
    if inside is None:
        name = _waypoint_name(node)[:100]
        raise node.tree.undefined(f"the pose of waypoint {name!r} in feature {feature!r} is not known")
    taught = pose_of(node.tree, inside.get("pose"), "<poseInFeatureCoordinates>")
    return f"pose_trans({feature}, {pose_text(taught)})"


def _relative_target(maker: UrpMaker, node: Node) -> str:
    """Return the target of a waypoint that is a step from where the tool is."""
    name = _waypoint_name(node)
    poses = []
    for part, tag in (("from", "relativeFromPosition"), ("to", "position")):
        _, pose = position_of(node.tree, node.find(tag), f"waypoint {name[:100]!r}")
        if pose is None:
            raise only_angles(node, name)
        text = pose_text(pose)
        if node.tree.series != CB3:
            variable = f"{identifier(name)}_{part}_p"
            maker.declare(f"pose {variable}", f"global {variable}={text}")
            text = variable
        poses.append(text)
    return f"pose_add(get_target_tcp_pose(), pose_sub({poses[1]}, {poses[0]}))"


def _is_joint_move(move: Node) -> bool:
    """True for a MoveJ whose waypoints are joint angles, whatever the tool is."""
    if move.tree.series != CB3:
        return move.get("positionType") == "JointAngles"
    return move.get("useActiveTCP") == "false" and move.find("feature") is None


def feature_name(node: Node) -> str:
    """Return the name of the feature that a node names; "" for none."""
    feature = node.find("feature")
    if feature is None:
        return ""
    return feature.get("referencedName") or feature.get("featureName") or ""


def _variable_feature(maker: UrpMaker, move: Node) -> str:
    """Return the variable of the feature that a move follows; "" for base, tool, or a fixed feature."""
    name = feature_name(move)
    feature = taught_feature(maker, move, name)
    return name if feature is not None and feature.is_variable else ""


def frame_of(maker: UrpMaker, node: Node, name: str, tool: str) -> str:
    """Return the pose of a feature in the base frame, as a script has it; "" is the base.

    `tool` is what a script has for the tool. UndefinedError if there is no such feature, or it is not taught.
    """
    if name in ("", _BASE):
        return ZERO_POSE
    if name == _TOOL:
        return tool
    feature = taught_feature(maker, node, name)
    if feature is None:
        raise node.tree.undefined(f"the installation has no feature {name[:100]!r}")
    return name if feature.is_variable else pose_text(feature.pose)


# --- parameters


def _motion(move: Node) -> str:
    motion = move.get("motionType")
    if motion not in _TYPES:
        raise move.tree.unknown(f"a move of type {motion!r}")
    return motion


def _move_around(node: Node, around: Around) -> Node:
    if around.move is None:
        raise node.tree.undefined(f"a <{node.kind}> stands outside of a <Move>")
    return around.move


def _waypoint_name(node: Node) -> str:
    if node.get("type") == "Variable":
        return variable_name(node)
    return node.get("name") or "Waypoint"


def _motion_parameters(maker: UrpMaker, motion: Node, waypoint: Node, move: Node) -> str:
    """Return acceleration, speed and blend, or the time, of a waypoint or of the circle up to it."""
    kind = _motion(move)
    _, acceleration, speed = _TYPES[kind]
    parameters = waypoint.find("motionParameters")
    own = {} if parameters is None else dict(parameters.attrib)
    if unknown := own.keys() - _PARAMETERS:
        raise waypoint.tree.unknown(f"motion parameter {min(unknown)!r} of a waypoint")
    if "nextMotionTime" in own:
        given = [("t", own["nextMotionTime"])]
    else:
        values = own.get(acceleration) or move.get("acceleration"), own.get(speed) or move.get("speed")
        given = list(zip("av", values, strict=True))
    radius = own.get("blendRadius") or (move.get("blendRadius") or "0.0" if kind == "MoveP" else "")
    if radius:
        given.append(("r", "0.0" if motion.number in maker.last_motions else radius))
    texts = [(letter, waypoint.tree.number_text(text, f"{letter} of a waypoint")) for letter, text in given]
    return ", ".join(f"{letter}={text}" for letter, text in texts)
