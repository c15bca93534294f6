"""Motions that end at an event: Direction with Until, and the Force node.

Source: program files and the scripts that PolyScope saved beside them.
"""

from ur_emulator.program_files.script_writer import ScriptWriter, writes
from ur_emulator.program_files.urp_expressions import expression_of
from ur_emulator.program_files.urp_nodes import Node
from ur_emulator.program_files.urp_positions import BASE, TOOL, feature_name, frame_of

_AXES = ("X", "Y", "Z")
_SIGNS = {"Plus": ("+", "1.0"), "Minus": ("-", "-1.0")}
# How labels call features, other than by their names.
_LABELS = {"": "Base", BASE: "Base", TOOL: "Tool"}
# Goal of a direction that no distance ends [m]; it is beyond the reach of every arm.
_FAR = "1000.0"
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
_MOTION = """\
global move_thread_flag_{n}=0
thread move_thread_{n}():
  enter_critical
  move_thread_flag_{n} = 1
  local towardsPos=calculate_point_to_move_towards({frame}, {vector}, {distance})
  movel(towardsPos, a={a}, v={v})
  move_thread_flag_{n} = 2
  exit_critical
end
move_thread_flag_{n} = 0
move_thread_han_{n} = run move_thread_{n}()"""
_CONTACT = """\
local targetTcpDirection=get_target_tcp_speed()
local stepsToRetract=tool_contact(direction=targetTcpDirection)"""
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


@writes(
    "gui.program.direction.MoveDirectionNode",
    "a motion in a thread that its `Until` nodes end: a distance, or a contact and a way back",
)
def _write_direction(writer: ScriptWriter, node: Node) -> None:
    n, feature = node.number, feature_name(node)
    untils = [child for child in node.children if child.kind == "Until"]
    if not untils or len(untils) != len(node.children):
        raise node.tree.undefined("a direction needs <Until> nodes, and no others")
    name, vector = _direction(writer, node)
    writer.put(node, f"Direction: {_LABELS.get(feature, feature)}{name}")
    writer.declare("point of a direction", _POINT)
    distance = _FAR
    for until in untils:
        if until.get("type") == "DISTANCE":
            distance = node.tree.number_text(until.text("Distance"), "distance of an <Until>")
    v, a = _tool_parameters(node)
    frame = frame_of(writer, node, "get_forward_kin()")
    writer.add(_MOTION.format(n=n, frame=frame, vector=vector, distance=distance, a=a, v=v))
    with writer.block("while (True):"):
        for until in sorted(untils, key=lambda one: one.get("type") == "DISTANCE"):
            _write_until(writer, until, n, a)
        writer.add("sync()")


def _direction(writer: ScriptWriter, node: Node) -> tuple[str, str]:
    """Return the direction as labels show it, and as a list of three numbers."""
    selected = node.get("selectedDirection")
    if not selected:
        return "", expression_of(writer, node).script
    axis, sign = selected[:1], selected[1:]
    if axis not in _AXES or sign not in _SIGNS:
        raise node.tree.unknown(f"a direction {selected!r}")
    mark, length = _SIGNS[sign]
    return f" {axis}{mark}", f"[{', '.join(length if one == axis else '0.0' for one in _AXES)}]"


def _tool_parameters(node: Node) -> list[str]:
    """Return speed and acceleration: those of the node, else those of the move around it."""
    if own := node.get("toolParams"):
        return node.tree.number_texts(own, "toolParams of a direction", 2)
    if node.move is None:
        raise node.tree.undefined("a direction stands outside of a <Move> and has no toolParams")
    names = ("speed", "acceleration")
    return [node.tree.number_text(node.move.get(name), f"{name} of a direction") for name in names]


def _write_until(writer: ScriptWriter, node: Node, n: int, acceleration: str) -> None:
    """Write the part of a loop that looks whether an `<Until>` ends the motion of label `n`."""
    kind = node.get("type")
    match kind:
        case "DISTANCE" if node.get("distanceNodeType") in ("", "STOP"):
            looks, condition, ends = (
                "sleep(1.0E-10)",
                f"move_thread_flag_{n} > 1",
                f"join move_thread_han_{n}",
            )
        case "TOOL_CONTACT_DETECTION":
            deceleration = node.get("decelerationAcceleration") or acceleration
            a = node.tree.number_text(deceleration, "deceleration of an <Until>")
            d = node.tree.number_text(node.get("retraction") or "0.0", "retraction of an <Until>")
            looks, condition, ends = _CONTACT, "stepsToRetract > 0", _RETRACTION.format(n=n, a=a, d=d)
        case _:
            how = f"{kind} {node.get('distanceNodeType')}".strip()
            raise node.tree.unknown(f"an <Until> of type {how!r}")
    writer.add(looks)
    with writer.block(f"if ({condition}):"):
        writer.add(ends)
        writer.put(node, f"Until ({kind.lower()})")
        writer.write_children(node)
        writer.add("break")


@writes("Force", "`force_mode` around its nodes; only the type Frame")
def _write_force(writer: ScriptWriter, node: Node) -> None:
    if node.get("type") != "Frame":
        raise node.tree.unknown(f"a <Force> of type {node.get('type')!r}")
    selection, wrench, compliant, stiff = (
        node.tree.number_texts(node.value(tag, "value"), f"{tag} of a <Force>")
        for tag in ("selection", "wrench", "limitsForce", "limitsMotion")
    )
    limits = [c if float(selected) else s for selected, c, s in zip(selection, compliant, stiff, strict=True)]
    axes, wanted, most = (f"[{', '.join(one)}]" for one in (selection, wrench, limits))
    frame = frame_of(writer, node, "tool_pose()")
    force_mode = f"force_mode({frame}, {axes}, {wanted}, 2, {most})"
    writer.put(node, "Force", "sleep(0.02)", "zero_ftsensor()", force_mode)
    writer.write_children(node)
    writer.add("end_force_mode()", "stopl(5.0)")
