"""The kinds of nodes of PolyScope's programs, and what each becomes. docs/programs.md shows this table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from ur_emulator.program_files import urp_flow, urp_moves, urp_statements
from ur_emulator.program_files.urp_maker import NodeWriter


@dataclass(frozen=True, slots=True)
class NodeKind:
    """A kind of nodes that stand in programs.

    Attributes:
        tag: of its elements.
        becomes: what it is in the script.
        write: writes a node of the kind.
    """

    tag: str
    becomes: str
    write: NodeWriter


_ROWS = (
    NodeKind(
        "Assignment",
        "`global v=...`: an expression, or what the operator answers (Boolean, Integer, Float, String)",
        urp_statements.write_assignment,
    ),
    NodeKind("CallSubProgram", "the call of a function, perhaps from another .urp", urp_flow.write_call),
    NodeKind(
        "CircleMove",
        "`movec` through the first to the second waypoint, `mode=1` for a fixed orientation",
        urp_moves.write_circle,
    ),
    NodeKind("Comment", "a comment", urp_statements.write_comment),
    NodeKind("Contributed", "External Control: what a PC sends, see below", urp_statements.write_contributed),
    NodeKind("Folder", "its nodes", urp_flow.write_folder),
    NodeKind(
        "Force",
        "`force_mode` around its nodes; only the type Frame",
        urp_moves.write_force,
    ),
    NodeKind("Halt", "`halt`", urp_statements.write_halt),
    NodeKind(
        "If",
        "`if`, with ElseIf and Else; a condition that is checked continuously ends the thread of its nodes",
        urp_flow.write_if,
    ),
    NodeKind(
        "Loop",
        "`while`: Forever, Counting with its variable, While; checked continuously as If",
        urp_flow.write_loop,
    ),
    NodeKind(
        "Move",
        "a label and its nodes (MoveJ, MoveL, MoveP); `set_tcp` if it names a TCP",
        urp_moves.write_move,
    ),
    NodeKind("Placeholder", "nothing", urp_statements.write_nothing),
    NodeKind(
        "Popup",
        "`popup` of a text, a variable or an expression; one that halts the program does not wait",
        urp_statements.write_popup,
    ),
    NodeKind(
        "SafeHome",
        "`movej` to the home position of the installation, or else to that of a new box: arm upright",
        urp_moves.write_safe_home,
    ),
    NodeKind(
        "Script",
        "a line, or the text of a file, read from its path or else from the copy in the node",
        urp_statements.write_script,
    ),
    NodeKind("Set", "a digital output, or the active TCP", urp_statements.write_set),
    NodeKind("Switch", "`if`, `elif` and `else` for the default case", urp_flow.write_switch),
    NodeKind("Timer", "a variable that a thread counts up while it is started", urp_statements.write_timer),
    NodeKind(
        "Wait",
        "`sleep`, or a loop until a line has a level or a condition holds",
        urp_statements.write_wait,
    ),
    NodeKind(
        "Waypoint",
        "`movej`, `movel` or `movep`: Fixed, Variable (also a feature), Relative; own speeds, blend or time",
        urp_moves.write_waypoint,
    ),
    NodeKind(
        "gui.program.direction.MoveDirectionNode",
        "a motion in a thread that its `Until` nodes end: a distance, or a contact and a way back",
        urp_moves.write_direction,
    ),
)

KINDS: Mapping[str, NodeKind] = MappingProxyType({row.tag: row for row in _ROWS})
"""By tag."""

TOP_KINDS: Mapping[str, str] = MappingProxyType(
    {
        "InitVariablesNode": "first values of variables",
        "SpecialSequence": "BeforeStart: statements before threads and main program",
        "MainProgram": "the body, in a loop unless `runOnlyOnce`",
        "Thread": "a thread that loops unless `runOnlyOnce`; it starts after BeforeStart",
        "Event": "a condition with nodes; one thread looks for all events",
        "SubProgram": "a function before BeforeStart",
        "SuppressedNode": "nothing, but its nodes count in the numbers of labels; also inside of programs",
    }
)
"""Nodes around those of `KINDS` -> what they become."""

NOT_KNOWN: tuple[str, ...] = (
    "pallets and conveyor tracking",
    "wizards and nodes of URCaps other than External Control",
    "`Set` of analogue outputs, expressions and payloads",
    "`Until` of an expression or a line, or with another end than a stop",
    "moves with OptiMove",
    "lines, planes and points as features in expressions",
)
"""What programs of PolyScope may hold and no script is known for."""
