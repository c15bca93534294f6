"""A program file of PolyScope as a script, in the form that PolyScope gives it; and the kinds of its nodes.

PolyScope generates a script from the nodes each time a program is played. Its parts stand in this order:
header, first values of variables, positions and helpers in the order of first use, timers, sub-programs,
BeforeStart, threads and events, main program. Source: program files and the scripts that PolyScope saved
beside them. docs/programs.md shows the tables of nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import groupby, pairwise
from types import MappingProxyType

from ur_emulator.program_files import urp_flow, urp_moves, urp_statements
from ur_emulator.program_files.installation import Installation
from ur_emulator.program_files.reader import ProgramReader, XmlTree
from ur_emulator.program_files.script_writer import Header, Part, ScriptWriter, identifier
from ur_emulator.program_files.urp_expressions import expression_of, variable_name
from ur_emulator.program_files.urp_maker import Around, NodeKind, UrpMaker
from ur_emulator.program_files.urp_nodes import Node, ProgramNodes
from ur_emulator.program_files.urp_robotiq import declare_functions

KINDS: Mapping[str, NodeKind] = MappingProxyType(
    dict(sorted((urp_flow.KINDS | urp_moves.KINDS | urp_statements.KINDS).items()))
)
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
    "wizards and nodes of URCaps other than External Control and Robotiq_Grippers",
    "`Set` of analogue outputs, expressions and payloads",
    "`Until` of an expression or a line, or with another end than a stop",
    "moves with OptiMove",
    "lines, planes and points as features in expressions",
)
"""What programs of PolyScope may hold and no script is known for."""


@dataclass(frozen=True, slots=True)
class MadeScript:
    """The script of a program: texts, and places for what is known when the program is played.

    `left_out` is what is not known and was left out, `undefined` what has to be filled in before the program
    can be played; one line each.
    """

    parts: tuple[Part, ...]
    left_out: tuple[str, ...]
    undefined: tuple[str, ...]


def uses_external_control(tree: XmlTree) -> bool:
    """True for a program with a part that a PC sends when it is played."""
    nodes = tree.root.iter("Contributed")
    return any(urp_statements.contributor(node) == urp_statements.EXTERNAL_CONTROL for node in nodes)


def make_script(
    tree: XmlTree, reader: ProgramReader, installation: Installation, *, skip_unknown: bool = False
) -> MadeScript:
    """Return the script of a program; the reader reads files that it refers to.

    Raises:
        UnknownNodeError: a node is not known, and must not be skipped.
        ProgramFileError: something in the file is damaged, or a limit is exceeded.
    """
    program = ProgramNodes(tree, reader)
    maker = UrpMaker(program, installation, reader, KINDS, skip_unknown)
    writer, main = maker.writer, program.main
    name = identifier(tree.root.get("name") or tree.file.inside.stem)
    # Parts are written in the order of their numbers, so that declarations come in the order of first use.
    with writer.block(f"def {name}():"):
        writer.parts.append(Header())
        _write_first_values(maker)
        with _part(writer) as before:
            if program.before_start is not None:
                _write_section(maker, program.before_start, "BeforeStart")
        with _part(writer) as body, maker.repeated(main):
            _write_section(maker, main, "Robot Program", is_loop=main.get("runOnlyOnce") != "true")
        with _part(writer) as others:
            _write_threads(maker, program.others)
        with _part(writer) as functions:
            for function, node in program.sub_programs:
                with writer.block(f"def {function}():"):
                    _write_section(maker, node, function, mark="noBreak")
        written = (*writer.parts, *functions, *before, *others, *body)
        if installation.grippers.is_there and any("rq_" in part for part in written if isinstance(part, str)):
            declare_functions(maker)
        for timer in maker.timers:
            if f"first value of {timer}" not in maker.declarations:
                writer.add(f"global {timer}=0")
        for lines in maker.declarations.values():
            writer.add(*lines)
        _write_timers(maker)
        writer.parts += [*functions, *before, *others, *body]
    undefined = (*program.undefined, *maker.undefined)
    return MadeScript(tuple(_joined(writer.parts)), tuple(maker.left_out), undefined)


@contextmanager
def _part(writer: ScriptWriter) -> Iterator[list[Part]]:
    """Write a part of the script aside; it is in the list then."""
    place = writer.place
    part: list[Part] = []
    yield part
    part += writer.take(place)


def _joined(parts: list[Part]) -> Iterator[Part]:
    """Yield the texts between gaps whole."""
    for is_text, group in groupby(parts, lambda part: isinstance(part, str)):
        if is_text:
            yield "\n".join(map(str, group))
        else:
            yield from group


def _write_section(maker: UrpMaker, node: Node, name: str, *, is_loop: bool = False, mark: str = "") -> None:
    """Write the nodes of the main program, of BeforeStart or of a sub-program."""
    maker.last_motions |= _last_motions(node, is_loop=is_loop)
    maker.writer.label(node.number, name, mark)
    # Software up to 3.6 has waypoints outside of moves: the program has their parameters.
    maker.write_children(node, Around(node if node.get("motionType") else None))


def _write_threads(maker: UrpMaker, nodes: Sequence[Node]) -> None:
    events = [node for node in nodes if node.kind == "Event"]
    for event in events:
        maker.last_motions |= _last_motions(event, is_loop=False)
    for node in nodes:
        if node.kind == "Thread":
            maker.last_motions |= _last_motions(node, is_loop=node.get("runOnlyOnce") != "true")
            urp_flow.write_thread(maker, node, Around())
        elif node.kind != "Event":
            maker.write(node, Around())
    urp_flow.write_events(maker, events, Around())


def _write_first_values(maker: UrpMaker) -> None:
    """Write the values that variables have before anything else; they stand with the names."""
    program = maker.program
    values = [(one, one.find("initializeExpression")) for one in program.tree.root.iter()]
    values += [(one, one.find("expression")) for one in program.variables]
    for variable, value in values:
        if value is not None and len(value):
            with maker.leaving_out(program.main):
                name = variable_name(program.main, variable)
                expression = expression_of(maker, program.main, value)
                maker.declare(f"first value of {name}", f"global {name}={expression.script}")


def _write_timers(maker: UrpMaker) -> None:
    """Write the thread that counts all timers up."""
    if not maker.timers:
        return
    writer = maker.writer
    writer.add(*(f"global {timer}_is_counting=False" for timer in maker.timers))
    with writer.block("thread Timer_Thread():"), writer.block("while (True):"):
        for timer in maker.timers:
            with writer.block(f"if ({timer}_is_counting):"):
                writer.add(f"{timer} = {timer} + get_steptime()")
        writer.add("sync()")
    writer.add("run Timer_Thread()")


def _last_motions(section: Node, *, is_loop: bool) -> set[int]:
    """Return the numbers of the motions of MoveP behind which no other motion of MoveP comes.

    They have no blend radius. Ends of other loops than counting ones are inferred.

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
