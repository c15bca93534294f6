"""Moves and their waypoints.

Waypoints are kept as joint angles, so a move goes exactly where it was taught, with any tool and
any feature. Source: files as public generators write them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ur_emulator.programs.urp_maker import UrpMaker
from ur_emulator.programs.urp_values import number, six_numbers, variable_name

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# Type of a move -> builtin, and the attributes of a waypoint that take the place of the move's speed and
# acceleration.
_TYPES = {
    "MoveJ": ("movej", "jointSpeed", "jointAcceleration"),
    "MoveL": ("movel", "cartesianSpeed", "cartesianAcceleration"),
    "MoveP": ("movep", "cartesianSpeed", "cartesianAcceleration"),
}
_PARAMETERS = {"jointSpeed", "jointAcceleration", "cartesianSpeed", "cartesianAcceleration", "blendRadius"}
_BASE_FEATURE = "Joint_0_name"


def write_move(maker: UrpMaker, element: Element) -> None:
    """Write a `<Move>` with all that is in it."""
    motion = element.get("motionType", "")
    if motion not in _TYPES:
        raise maker.error(
            f"a move of type {motion!r} cannot be turned into a script: use {', '.join(_TYPES)}"
        )
    maker.writer.label(motion)
    _write_tcp(maker, element)
    outer, maker.move = maker.move, element
    maker.write_children(element)
    maker.move = outer


def write_waypoint(maker: UrpMaker, element: Element) -> None:
    """Write a `<Waypoint>` of the move around it."""
    move = maker.move
    if move is None:
        raise maker.error("a <Waypoint> stands outside of a <Move>")
    builtin, speed, acceleration = _TYPES[move.get("motionType", "")]
    parameters = element.find("motionParameters")
    own = {} if parameters is None else dict(parameters.attrib)
    unknown = set(own) - _PARAMETERS
    if unknown:
        raise maker.error(f"motion parameter {min(unknown)!r} of a waypoint cannot be turned into a script")
    maker.writer.label(element.get("name", "Waypoint"))
    arguments = [_target(maker, element, move)]
    for letter, given in (
        ("a", own.get(acceleration) or move.get("acceleration")),
        ("v", own.get(speed) or move.get("speed")),
        ("r", own.get("blendRadius") or (move.get("blendRadius") if builtin == "movep" else None)),
    ):
        if given:
            arguments.append(f"{letter}={number(maker.tree, given, f'{letter} of a waypoint')!r}")
    maker.writer.add(f"{builtin}({', '.join(arguments)})")
    if element.find("children/*") is not None:
        raise maker.error("nodes inside of a waypoint cannot be turned into a script")


def _target(maker: UrpMaker, element: Element, move: Element) -> str:
    match element.get("type", "Fixed"):
        case "Fixed":
            return f"[{six_numbers(maker.tree, _joint_angles(element), 'a waypoint')}]"
        case "Variable":
            feature = move.find("feature")
            name = None if feature is None else maker.tree.resolve(feature).get("referencedName")
            if name not in (None, _BASE_FEATURE):
                raise maker.error(f"a variable waypoint in feature {name!r} cannot be turned into a script")
            return variable_name(maker.tree, element.find("variable"))
        case other:
            raise maker.error(f"a waypoint of type {other!r} cannot be turned into a script")


def _joint_angles(element: Element) -> str | None:
    """Return the angles of a waypoint: of software up to 3.4 an attribute, later an element."""
    position = element.find("position")
    if position is None:
        return None
    angles = position.find("JointAngles")
    return position.get("joints") if angles is None else angles.get("angles")


def _write_tcp(maker: UrpMaker, move: Element) -> None:
    """Set the tool that the waypoints were taught with, where a move has one of its own."""
    if move.get("useActiveTCP") != "false":
        return
    offset = move.find("children/Waypoint/position/TCPOffset")
    if offset is not None:
        maker.writer.add(f"set_tcp(p[{six_numbers(maker.tree, offset.get('pose'), 'the tool of a move')}])")
