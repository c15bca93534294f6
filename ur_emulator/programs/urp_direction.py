"""Motions that end at an event: Direction with Until, and the Force node.

Source: program files and the scripts that PolyScope saved beside them.
"""

from __future__ import annotations

from ur_emulator.programs.urp_expressions import expression_of
from ur_emulator.programs.urp_maker import Around, UrpMaker
from ur_emulator.programs.urp_moves import feature_label, feature_name, frame_of
from ur_emulator.programs.urp_nodes import Node
from ur_emulator.programs.urp_values import number_text, number_texts

_AXES = {"X": 0, "Y": 1, "Z": 2}
_SIGNS = {"Plus": ("+", "1.0"), "Minus": ("-", "-1.0")}
# Goal of a direction that no distance ends [m]; it is beyond the reach of every arm.
_FAR = "1000.0"
# Speed of the way back from a contact [m/s].
_RETRACTION_SPEED = "0.1"
_POINT = (
    "def calculate_point_to_move_towards(feature, direction, position_distance):",
    "  local goal=get_target_waypoint()",
    "  local axis=[direction[0], direction[1], direction[2]]",
    "  if (norm(axis) < 1e-6):",
    "    return goal",
    "  end",
    "  local unit=normalize(axis)",
    "  local d=position_distance",
    "  local step=p[unit[0]*d, unit[1]*d, unit[2]*d, 0, 0, 0]",
    "  local turned=pose_trans(p[0, 0, 0, feature[3], feature[4], feature[5]], step)",
    "  return p[goal[0]+turned[0], goal[1]+turned[1], goal[2]+turned[2], goal[3], goal[4], goal[5]]",
    "end",
)


def write_direction(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `MoveDirectionNode`: a motion in a thread, which its `<Until>` nodes end."""
    writer, n = maker.writer, node.number
    untils = [child for child in node.children if child.kind == "Until"]
    if not untils or len(untils) != len(node.children):
        raise node.source.error("a direction needs <Until> nodes, and no others")
    feature = feature_name(node)
    name, vector = _direction(maker, node)
    writer.label(n, f"Direction: {feature_label(feature)}{name}", around.mark)
    maker.declare("point of a direction", *_POINT)
    distance = _FAR
    for until in untils:
        if until.get("type") == "DISTANCE":
            distance = number_text(node.source.tree, until.text("Distance"), "distance of an <Until>")
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
        raise node.source.unknown(f"a direction {selected!r}")
    mark, length = _SIGNS[sign]
    vector = ["0.0"] * 3
    vector[_AXES[axis]] = length
    return f" {axis}{mark}", f"[{', '.join(vector)}]"


def _tool_parameters(node: Node, around: Around) -> list[str]:
    """Return speed and acceleration: those of the node, else those of the move around it."""
    tree = node.source.tree
    if own := node.get("toolParams"):
        return number_texts(tree, own, "toolParams of a direction", 2)
    if around.move is None:
        raise node.source.error("a direction stands outside of a <Move> and has no toolParams")
    return [
        number_text(tree, around.move.get(name), f"{name} of a direction")
        for name in ("speed", "acceleration")
    ]


def _write_until(maker: UrpMaker, node: Node, n: int, acceleration: str, around: Around) -> None:
    """Write the part of a loop that looks whether the motion has to end.

    Args:
        maker: writes the program.
        node: the `<Until>`.
        n: number of the direction's label.
        acceleration: of its motion.
        around: the direction.
    """
    writer, kind = maker.writer, node.get("type")
    label = f"Until ({kind.lower()})"
    match kind:
        case "DISTANCE" if node.get("distanceNodeType") in ("", "STOP"):
            writer.add("sleep(1.0E-10)")
            with writer.block(f"if (move_thread_flag_{n} > 1):"):
                writer.add(f"join move_thread_han_{n}")
                writer.label(node.number, label, around.mark)
                maker.write_children(node, around)
                writer.add("break")
        case "TOOL_CONTACT_DETECTION":
            tree = node.source.tree
            deceleration = number_text(
                tree, node.get("decelerationAcceleration") or acceleration, "deceleration of an <Until>"
            )
            retraction = number_text(tree, node.get("retraction") or "0.0", "retraction of an <Until>")
            writer.add(
                "local targetTcpDirection=get_target_tcp_speed()",
                "local stepsToRetract=tool_contact(direction=targetTcpDirection)",
            )
            with writer.block("if (stepsToRetract > 0):"):
                writer.add(f"kill move_thread_han_{n}", f"stopl({deceleration})")
                writer.add(
                    "local contactPose=get_forward_kin(get_actual_joint_positions_history(stepsToRetract))",
                    "local axis=[targetTcpDirection[0], targetTcpDirection[1], targetTcpDirection[2]]",
                    "local retractTo=contactPose",
                )
                with writer.block("if (norm(axis) > 1e-6):"):
                    step = ", ".join(f"unit[{i}]*{retraction}" for i in range(3))
                    writer.add(
                        "local unit=normalize(axis)", f"retractTo = pose_sub(contactPose, p[{step}, 0, 0, 0])"
                    )
                writer.add(f"movel(retractTo, a={deceleration}, v={_RETRACTION_SPEED})")
                writer.label(node.number, label, around.mark)
                maker.write_children(node, around)
                writer.add("break")
        case _:
            how = f"{kind} {node.get('distanceNodeType')}".strip()
            raise node.source.unknown(f"an <Until> of type {how!r}")


def write_force(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Force>`: its nodes run while the tool gives way."""
    if node.get("type") != "Frame":
        raise node.source.unknown(f"a <Force> of type {node.get('type')!r}")
    values = {}
    for tag in ("selection", "wrench", "limitsForce", "limitsMotion"):
        element = node.find(tag)
        given = None if element is None else element.get("value")
        values[tag] = number_texts(node.source.tree, given, f"{tag} of a <Force>")
    limits = [
        compliant if float(selected) else stiff
        for selected, compliant, stiff in zip(
            values["selection"], values["limitsForce"], values["limitsMotion"], strict=True
        )
    ]
    frame = frame_of(maker, node, feature_name(node), "tool_pose()")
    maker.writer.label(node.number, "Force", around.mark)
    lists = [f"[{', '.join(one)}]" for one in (values["selection"], values["wrench"])]
    maker.writer.add(
        "sleep(0.02)",
        "zero_ftsensor()",
        f"force_mode({frame}, {lists[0]}, {lists[1]}, 2, [{', '.join(limits)}])",
    )
    maker.write_children(node, Around(around.move, is_quiet=True))
    maker.writer.add("end_force_mode()", "stopl(5.0)")
