"""Moves and their waypoints.

A waypoint in Cartesian space is a pose, to which the tool goes that is active when the program runs; one in
joint space is joint angles. Source: program files and the scripts that PolyScope saved beside them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from protocol.pose import pose_inv
from ur_emulator.programs.script_names import identifier
from ur_emulator.programs.urp_expressions import taught_waypoint, variable_name
from ur_emulator.programs.urp_maker import Around, UrpMaker
from ur_emulator.programs.urp_nodes import CB3, Node
from ur_emulator.programs.urp_positions import ZERO_POSE, pose_of, pose_text, position_of
from ur_emulator.programs.urp_values import number_text

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# Type of a move -> builtin, and the attributes of a waypoint that replace the move's acceleration and speed.
_TYPES = {
    "MoveJ": ("movej", "jointAcceleration", "jointSpeed"),
    "MoveL": ("movel", "cartesianAcceleration", "cartesianSpeed"),
    "MoveP": ("movep", "cartesianAcceleration", "cartesianSpeed"),
}
_PARAMETERS = frozenset(
    {"jointSpeed", "jointAcceleration", "cartesianSpeed", "cartesianAcceleration"}
    | {"blendRadius", "nextMotionTime"}
)
_BASE = "Joint_0_name"
_TOOL = "Joint_6_name"
_AFTER = "breakAfter"


def write_move(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Move>`: its nodes stand at the same level."""
    motion = _motion(maker, node)
    if node.get("optimoveEnabled") == "true":
        raise node.source.unknown("a <Move> with OptiMove")
    maker.writer.label(node.number, motion, around.mark)
    if node.get("useActiveTCP") == "false" and (tcp := node.find("tcp")) is not None:
        maker.writer.add(set_tcp(maker, node, tcp))
    maker.write_children(node, Around(node, around.is_quiet))


def set_tcp(maker: UrpMaker, node: Node, tcp: Element) -> str:
    """Return the statement that makes a TCP of the installation the active one.

    Raises:
        ProgramFileError: the installation has none of that name.
    """
    name = tcp.get("referencedName", "")
    offset = maker.installation.tcps.get(name)
    if offset is None:
        known = ", ".join(maker.installation.tcps) or "none"
        raise node.source.error(f"the installation has no TCP {name[:100]!r}: it has {known}")
    return f"set_tcp(p[{', '.join(map(repr, offset))}])"


def write_waypoint(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Waypoint>` of the move around it."""
    move = _move_around(node, around)
    builtin = _TYPES[_motion(maker, move)][0]
    if node.children:
        raise node.source.unknown("what is inside of a waypoint")
    maker.writer.label(node.number, _waypoint_name(node), around.mark or _AFTER)
    target = _target(maker, node, move, builtin)
    maker.writer.add(f"{builtin}({target}, {_motion_parameters(maker, node, node, move)})")


def write_circle(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<CircleMove>`: a motion through its first waypoint to its second."""
    move = _move_around(node, around)
    if [child.kind for child in node.children] != ["Waypoint", "Waypoint"]:
        raise node.source.error("a <CircleMove> needs two waypoints: one on the way, and its end")
    via, end = node.children
    maker.writer.label(node.number, "CircleMove", around.mark)
    maker.writer.label(via.number, _waypoint_name(via), "noBreak")
    maker.writer.label(end.number, _waypoint_name(end), around.mark or _AFTER)
    targets = ", ".join(_target(maker, one, move, "movep") for one in (via, end))
    mode = ", mode=1" if node.get("OrientationMode") == "FIXED" else ""
    maker.writer.add(f"movec({targets}, {_motion_parameters(maker, node, end, move)}{mode})")


def write_safe_home(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<SafeHome>`: a motion to the position of the installation."""
    q = maker.installation.safe_home
    if q is None:
        raise node.source.error("the installation has no position for the <SafeHome> node")
    tree = node.source.tree
    if node.get("positionOptionType") == "SPEED_AND_ACCELERATION":
        how = ", ".join(
            f"{letter}={number_text(tree, node.get(name), f'{name} of a <SafeHome>')}"
            for letter, name in (("a", "acceleration"), ("v", "speed"))
        )
    else:
        how = f"t={number_text(tree, node.get('nextMotionTime'), 'time of a <SafeHome>')}"
    maker.writer.label(node.number, "Home", around.mark)
    maker.writer.add(f"movej([{', '.join(map(repr, q))}], {how})")


# --- targets


def _target(maker: UrpMaker, node: Node, move: Node, builtin: str) -> str:
    """Return where a waypoint is, as the builtin takes it."""
    match node.get("type") or "Fixed":
        case "Variable":
            name = variable_name(node, node.element.find("variable"))
            feature = _variable_feature(maker, move)
            return f"pose_trans({feature}, {name})" if feature else name
        case "Fixed":
            return _fixed_target(maker, node, move, builtin)
        case "Relative":
            return _relative_target(maker, node)
        case other:
            raise node.source.unknown(f"a waypoint of type {other!r}")


def _fixed_target(maker: UrpMaker, node: Node, move: Node, builtin: str) -> str:
    pose, q = taught_waypoint(maker, node, node.find("position"), _waypoint_name(node))
    if not pose or (builtin == "movej" and _is_joint_move(move)):
        return q
    if feature := _variable_feature(maker, move):
        pose = _in_feature(node, pose, feature)
    return f"get_inverse_kin({pose}, qnear={q})" if builtin == "movej" else pose


def _in_feature(node: Node, pose: str, feature: str) -> str:
    """Return a pose that moves with a feature."""
    tree = node.source.tree
    given = node.find("BaseToFeature")
    if given is not None:
        base = pose_text(pose_inv(pose_of(tree, given.get("pose"), "<BaseToFeature>")))
        return f"pose_trans({feature}, pose_trans({base}, {pose}))"
    inside = node.find("position/poseInFeatureCoordinates")
    if inside is None:
        name = _waypoint_name(node)[:100]
        raise node.source.error(f"the pose of waypoint {name!r} in feature {feature!r} is not known")
    taught = pose_of(tree, inside.get("pose"), "<poseInFeatureCoordinates>")
    return f"pose_trans({feature}, {pose_text(taught)})"


def _relative_target(maker: UrpMaker, node: Node) -> str:
    """Return the target of a waypoint that is a step from where the tool is."""
    name = _waypoint_name(node)
    poses = []
    for part, tag in (("from", "relativeFromPosition"), ("to", "position")):
        position = position_of(node.source.tree, node.find(tag), f"waypoint {name[:100]!r}")
        if position.pose is None:
            raise node.source.error(f"the file has only the joint angles of waypoint {name[:100]!r}")
        text = pose_text(position.pose)
        if node.source.series != CB3:
            variable = f"{identifier(name)}_{part}_p"
            maker.declare(f"pose {variable}", f"global {variable}={text}")
            text = variable
        poses.append(text)
    return f"pose_add(get_target_tcp_pose(), pose_sub({poses[1]}, {poses[0]}))"


def _is_joint_move(move: Node) -> bool:
    """True for a MoveJ whose waypoints are joint angles, whatever the tool is."""
    if move.source.series != CB3:
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
    feature = maker.installation.features.get(name)
    return name if feature is not None and feature.is_variable else ""


def frame_of(maker: UrpMaker, node: Node, name: str, tool: str) -> str:
    """Return the pose of the feature of that name in the base frame, as a script has it.

    Args:
        maker: writes the program.
        node: that names it.
        name: of the feature; "" is the base.
        tool: what a script has for the tool.

    Raises:
        ProgramFileError: the installation has none of that name.
    """
    if name in ("", _BASE):
        return ZERO_POSE
    if name == _TOOL:
        return tool
    feature = maker.installation.features.get(name)
    if feature is None:
        raise node.source.error(f"the installation has no feature {name[:100]!r}")
    return name if feature.is_variable else pose_text(feature.pose)


def feature_label(name: str) -> str:
    """Return how labels call a feature."""
    return {"": "Base", _BASE: "Base", _TOOL: "Tool"}.get(name, name)


# --- parameters


def _motion(maker: UrpMaker, move: Node) -> str:
    motion = move.get("motionType")
    if motion not in _TYPES:
        raise move.source.unknown(f"a move of type {motion!r}")
    return motion


def _move_around(node: Node, around: Around) -> Node:
    if around.move is None:
        raise node.source.error(f"a <{node.kind}> stands outside of a <Move>")
    return around.move


def _waypoint_name(node: Node) -> str:
    if node.get("type") == "Variable":
        return variable_name(node, node.element.find("variable"))
    return node.get("name") or "Waypoint"


def _motion_parameters(maker: UrpMaker, motion: Node, waypoint: Node, move: Node) -> str:
    """Return acceleration, speed and blend of a motion, or its time.

    Args:
        maker: writes the program.
        motion: the waypoint, or the circle that ends there.
        waypoint: where it ends.
        move: around it.
    """
    tree = waypoint.source.tree
    kind = _motion(maker, move)
    _, acceleration, speed = _TYPES[kind]
    parameters = waypoint.find("motionParameters")
    own = {} if parameters is None else dict(parameters.attrib)
    unknown = set(own) - _PARAMETERS - {"reference"}
    if unknown:
        raise waypoint.source.unknown(f"motion parameter {min(unknown)!r} of a waypoint")
    given = [
        ("a", own.get(acceleration) or move.get("acceleration")),
        ("v", own.get(speed) or move.get("speed")),
    ]
    if "nextMotionTime" in own:
        given = [("t", own["nextMotionTime"])]
    radius = own.get("blendRadius") or (move.get("blendRadius") or "0.0" if kind == "MoveP" else "")
    if radius:
        given.append(("r", "0.0" if motion.number in maker.last_motions else radius))
    return ", ".join(
        f"{letter}={number_text(tree, text, f'{letter} of a waypoint')}" for letter, text in given
    )
