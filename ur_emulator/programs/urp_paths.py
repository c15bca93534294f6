"""Where paths of MoveP end: the motions there have no blend radius.

Source: program files and the scripts that PolyScope saved beside them; ends of other loops than counting ones
are inferred.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from ur_emulator.programs.urp_nodes import Node


def last_motions(section: Node, *, is_loop: bool) -> set[int]:
    """Return the numbers of the motions of MoveP behind which no other motion of MoveP comes.

    Args:
        section: main program, thread or sub-program.
        is_loop: its first node comes behind its last.
    """
    motions = list(_motions(section, section.get("motionType")))
    behind = motions[0] if motions and is_loop else (0, "")
    return {
        number
        for (number, kind), (_, following) in pairwise([*motions, behind])
        if kind == "MoveP" and following != "MoveP"
    }


def _motions(node: Node, motion: str) -> Iterator[tuple[int, str]]:
    """Yield number and type of each motion in the order of the nodes; the end of a loop has no type."""
    for child in node.children:
        match child.kind:
            case "Waypoint" | "CircleMove":
                yield child.number, motion
                continue
            case "SafeHome" | "gui.program.direction.MoveDirectionNode":
                yield child.number, ""
        yield from _motions(child, child.get("motionType") if child.kind == "Move" else motion)
        for branch in child.branches:
            yield from _motions(branch, motion)
        if child.kind == "Loop":
            yield 0, ""
