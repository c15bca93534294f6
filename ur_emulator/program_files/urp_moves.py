"""Moves and their waypoints.

A waypoint in Cartesian space is a pose, to which the tool goes that is active when the program runs; one in
joint space is joint angles. Source: program files and the scripts that PolyScope saved beside them.
"""

from collections.abc import Iterator
from itertools import pairwise

from protocol.pose import pose_inv
from ur_emulator.program_files.names import identifier
from ur_emulator.program_files.script_writer import ScriptWriter, writes
from ur_emulator.program_files.urp_expressions import variable_name
from ur_emulator.program_files.urp_nodes import Node
from ur_emulator.program_files.urp_positions import (
    only_angles,
    pose_of,
    pose_text,
    position_of,
    taught_feature,
    taught_waypoint,
    variable_feature,
)

# Type of a move -> builtin, and the attributes of a waypoint that replace the move's acceleration and speed.
_TYPES = {
    "MoveJ": ("movej", "jointAcceleration", "jointSpeed"),
    "MoveL": ("movel", "cartesianAcceleration", "cartesianSpeed"),
    "MoveP": ("movep", "cartesianAcceleration", "cartesianSpeed"),
}
_PARAMETERS = {"blendRadius", "nextMotionTime", "reference"}.union(*(own for _, *own in _TYPES.values()))


@writes("Move", "a label and its nodes (MoveJ, MoveL, MoveP); `set_tcp` if it names a TCP")
def _write_move(writer: ScriptWriter, node: Node) -> None:
    motion = _motion(node)
    if node.get("optimoveEnabled") == "true":
        raise node.tree.unknown("a <Move> with OptiMove")
    writer.put(node, motion)
    if node.get("useActiveTCP") == "false":
        write_tcp(writer, node)
    writer.write_children(node)


def write_tcp(writer: ScriptWriter, node: Node) -> None:
    """Make the TCP that a node names active, if it names one; UndefinedError if the installation has none."""
    tcp = node.find("tcp")
    if tcp is None:
        return
    name = tcp.get("referencedName", "")
    offset = writer.installation.tcps.get(name)
    if offset is None:
        known = ", ".join(writer.installation.tcps) or "none"
        raise node.tree.undefined(f"the installation has no TCP {name[:100]!r}: it has {known}")
    writer.add(f"set_tcp(p{list(offset)})")


@writes(
    "Waypoint",
    "`movej`, `movel` or `movep`: Fixed, Variable (also a feature), Relative; own speeds, blend or time",
)
def _write_waypoint(writer: ScriptWriter, node: Node) -> None:
    builtin = _TYPES[_motion(_move_around(node))][0]
    if node.children:
        raise node.tree.unknown("what is inside of a waypoint")
    writer.put(node, _waypoint_name(node), mark="breakAfter")
    target = _target(writer, node, inverse=builtin == "movej")
    writer.add(f"{builtin}({target}, {_motion_parameters(writer, node, node)})")


@writes(
    "CircleMove",
    "`movec` through the first to the second waypoint, `mode=1` for a fixed orientation",
)
def _write_circle(writer: ScriptWriter, node: Node) -> None:
    _move_around(node)
    if [child.kind for child in node.children] != ["Waypoint", "Waypoint"]:
        raise node.tree.undefined("a <CircleMove> needs two waypoints: one on the way, and its end")
    via, end = node.children
    writer.put(node, "CircleMove")
    writer.put(via, _waypoint_name(via), mark="noBreak")
    writer.put(end, _waypoint_name(end), mark="breakAfter")
    targets = ", ".join(_target(writer, one, inverse=False) for one in (via, end))
    mode = ", mode=1" if node.get("OrientationMode") == "FIXED" else ""
    writer.add(f"movec({targets}, {_motion_parameters(writer, node, end)}{mode})")


@writes(
    "SafeHome",
    "`movej` to the home position of the installation, or else to that of a new box: arm upright",
)
def _write_safe_home(writer: ScriptWriter, node: Node) -> None:
    given = {"t": ("nextMotionTime", "time")}
    if node.get("positionOptionType") == "SPEED_AND_ACCELERATION":
        given = {"a": ("acceleration", "acceleration"), "v": ("speed", "speed")}
    how = ", ".join(
        f"{letter}={node.tree.number_text(node.get(name), f'{what} of a <SafeHome>')}"
        for letter, (name, what) in given.items()
    )
    writer.put(node, "Home", f"movej({list(writer.installation.safe_home)}, {how})")


def _target(writer: ScriptWriter, node: Node, *, inverse: bool) -> str:
    """Return where a waypoint is; `inverse`: a pose becomes joint angles, as `movej` takes them."""
    move, kind = _move_around(node), node.get("type") or "Fixed"
    if kind == "Relative":
        return _relative_target(writer, node)
    if kind == "Variable":
        name = variable_name(node)
        taught_feature(writer, node, name)
        feature = variable_feature(writer, move)
        return f"pose_trans({feature}, {name})" if feature else name
    if kind != "Fixed":
        raise node.tree.unknown(f"a waypoint of type {kind!r}")
    pose, q = taught_waypoint(writer, node, node.find("position"), _waypoint_name(node))
    if not pose or (inverse and _is_joint_move(move)):
        return q
    if feature := variable_feature(writer, move):
        pose = _in_feature(node, pose, feature)
    return f"get_inverse_kin({pose}, qnear={q})" if inverse else pose


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


def _relative_target(writer: ScriptWriter, node: Node) -> str:
    """Return the target of a waypoint that is a step from where the tool is."""
    name = _waypoint_name(node)
    poses = []
    for part, tag in (("from", "relativeFromPosition"), ("to", "position")):
        _, pose = position_of(node.tree, node.find(tag), f"waypoint {name[:100]!r}")
        if pose is None:
            raise only_angles(node, name)
        text = pose_text(pose)
        if not node.tree.is_cb3:
            variable = f"{identifier(name)}_{part}_p"
            writer.declare(f"pose {variable}", f"global {variable}={text}")
            text = variable
        poses.append(text)
    return f"pose_add(get_target_tcp_pose(), pose_sub({poses[1]}, {poses[0]}))"


def _is_joint_move(move: Node) -> bool:
    """True for a MoveJ whose waypoints are joint angles, whatever the tool is."""
    if not move.tree.is_cb3:
        return move.get("positionType") == "JointAngles"
    return move.get("useActiveTCP") == "false" and move.find("feature") is None


def _motion(move: Node) -> str:
    motion = move.get("motionType")
    if motion not in _TYPES:
        raise move.tree.unknown(f"a move of type {motion!r}")
    return motion


def _move_around(node: Node) -> Node:
    if node.move is None:
        raise node.tree.undefined(f"a <{node.kind}> stands outside of a <Move>")
    return node.move


def _waypoint_name(node: Node) -> str:
    if node.get("type") == "Variable":
        return variable_name(node)
    return node.get("name") or "Waypoint"


def _motion_parameters(writer: ScriptWriter, motion: Node, waypoint: Node) -> str:
    """Return acceleration, speed and blend, or the time, of a waypoint or of the circle up to it."""
    move, tree = _move_around(waypoint), waypoint.tree
    kind = _motion(move)
    _, acceleration, speed = _TYPES[kind]
    parameters = waypoint.find("motionParameters")
    own = {} if parameters is None else parameters.attrib
    if unknown := own.keys() - _PARAMETERS:
        raise tree.unknown(f"motion parameter {min(unknown)!r} of a waypoint")
    given = {"a": own.get(acceleration) or move.get("acceleration"), "v": own.get(speed) or move.get("speed")}
    if "nextMotionTime" in own:
        given = {"t": own["nextMotionTime"]}
    radius = own.get("blendRadius") or (move.get("blendRadius") or "0.0" if kind == "MoveP" else "")
    if radius:
        given["r"] = "0.0" if motion.number in writer.last_motions else radius
    return ", ".join(
        f"{letter}={tree.number_text(text, f'{letter} of a waypoint')}" for letter, text in given.items()
    )


def last_motions(section: Node) -> set[int]:
    """Return the numbers of the motions of MoveP behind which no other motion of MoveP comes.

    They have no blend radius. Ends of other loops than counting ones are inferred.
    """
    motions = list(_motions(section))
    behind = motions[0] if motions and section.repeats else (0, "")
    return {
        number
        for (number, kind), (_, following) in pairwise([*motions, behind])
        if kind == "MoveP" and following != "MoveP"
    }


def _motions(node: Node) -> Iterator[tuple[int, str]]:
    """Yield number and type of each motion in the order of the nodes; the end of a loop has no type."""
    for child in node.children:
        match child.kind:
            case "Waypoint" | "CircleMove":
                yield child.number, child.move.get("motionType") if child.move else ""
                continue
            case "SafeHome" | "gui.program.direction.MoveDirectionNode":
                yield child.number, ""
        for branch in (child, *child.branches):
            yield from _motions(branch)
        if child.kind == "Loop":
            yield 0, ""
