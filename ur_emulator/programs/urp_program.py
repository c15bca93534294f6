"""A program file of PolyScope as a script, as far as its nodes are known.

The script has the form of those that PolyScope makes: first values of variables, sub-programs and threads,
the sequence before the start, then the nodes of the main program, in a loop unless it runs once. Names,
nesting and meaning of the nodes come from public generators and readers of such files; there is no
published description of all of them. A node that is not known is an error.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import groupby
from types import MappingProxyType
from typing import TYPE_CHECKING

from ur_emulator.programs import urp_flow, urp_moves, urp_statements
from ur_emulator.programs.folder import FoundFile
from ur_emulator.programs.installation import Installation
from ur_emulator.programs.reading import ProgramReader
from ur_emulator.programs.script_writer import Header, Part
from ur_emulator.programs.urp_maker import NodeWriter, Shared, UrpMaker
from ur_emulator.programs.urp_values import expression_text, variable_name
from ur_emulator.programs.xml_tree import XmlTree

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

ROOT = "URProgram"

NODES: Mapping[str, NodeWriter] = MappingProxyType(
    {
        "Assignment": urp_statements.write_assignment,
        "CallSubProgram": urp_flow.write_call,
        "Comment": urp_statements.write_comment,
        "Contributed": urp_statements.write_contributed,
        "Folder": urp_flow.write_folder,
        "Halt": urp_statements.write_halt,
        "If": urp_flow.write_if,
        "Loop": urp_flow.write_loop,
        "Move": urp_moves.write_move,
        "Placeholder": urp_statements.write_nothing,
        "Popup": urp_statements.write_popup,
        "Script": urp_statements.write_script,
        "Set": urp_statements.write_set,
        "SuppressedNode": urp_statements.write_nothing,
        "Switch": urp_flow.write_switch,
        "Wait": urp_statements.write_wait,
        "Waypoint": urp_moves.write_waypoint,
        "suppressedNode": urp_statements.write_nothing,
    }
)
"""What writes each kind of node that may stand in a program."""


def uses_external_control(tree: XmlTree) -> bool:
    """True for a program with a part that a PC sends when it is played."""
    return any(
        urp_statements.EXTERNAL_CONTROL
        in (node.get("strategyURCapName"), node.get("strategyProgramNodeType"))
        for node in tree.root.iter("Contributed")
    )


def make_script(
    file: FoundFile, tree: XmlTree, name: str, reader: ProgramReader, installation: Installation
) -> tuple[Part, ...]:
    """Return the script of a program and the gaps in it that are filled when it is played.

    Args:
        file: of the program.
        tree: its content.
        name: of the program in the script.
        reader: reads files that it refers to.
        installation: of the program.

    Raises:
        ProgramFileError: a part of it is not known.
    """
    maker = UrpMaker(file, tree, Shared(NODES, reader, installation))
    writer = maker.writer
    main = tree.root.find("children/MainProgram")
    if main is None:
        raise maker.error("there is no <MainProgram> in it")
    with writer.block(f"def {name}():"):
        writer.parts.append(Header())
        _write_first_values(maker)
        begin = len(writer.parts)
        threads = [urp_flow.write_thread(maker, node) for node in tree.root.findall("children/Thread")]
        for node in tree.root.findall("children/*"):
            _check_top_level(maker, node)
            if node.tag == "SpecialSequence":
                maker.write_children(node)
        for thread in threads:
            writer.add(f"run {thread}()")
        if main.get("runOnlyOnce") == "true":
            writer.label("Robot Program")
            maker.write_children(main)
        else:
            with writer.block("while (True):"):
                writer.label("Robot Program")
                maker.write_children(main)
        _write_subprograms(maker, begin)
    return tuple(_joined(writer.parts))


def _joined(parts: list[Part]) -> Iterator[Part]:
    """Yield the texts between gaps whole."""
    for is_text, group in groupby(parts, lambda part: isinstance(part, str)):
        if is_text:
            yield "\n".join(map(str, group))
        else:
            yield from group


_TOP_LEVEL = {"InitVariablesNode", "MainProgram", "SpecialSequence", "SubProgram", "Thread"}


def _check_top_level(maker: UrpMaker, node: Element) -> None:
    if node.tag not in _TOP_LEVEL:
        maker.write(node)
    elif node.tag == "SpecialSequence" and node.get("type") != "BeforeStart":
        raise maker.error(f"a sequence of type {node.get('type')!r} cannot be turned into a script")


def _write_first_values(maker: UrpMaker) -> None:
    """Write the values that variables have before anything else; they stand with the names."""
    for element in maker.tree.root.iter():
        first = element.find("initializeExpression")
        if first is not None and len(first):
            name = variable_name(maker.tree, element)
            maker.writer.add(f"global {name} = {expression_text(maker.tree, first, element)}")


def _write_subprograms(maker: UrpMaker, place: int) -> None:
    """Write the functions of all sub-programs that are called, also by each other.

    Args:
        maker: has written everything else.
        place: where in the script they belong.
    """
    writer, shared = maker.writer, maker.shared
    later = writer.parts[place:]
    del writer.parts[place:]
    done = 0
    while done < len(shared.subprograms):
        sub_program = tuple(shared.subprograms.values())[done]
        done += 1
        with writer.block(f"def {sub_program.name}():"):
            writer.add("# sub-program")
            if sub_program.maker is not maker:
                _write_first_values(sub_program.maker)
            sub_program.maker.write_children(sub_program.body)
    writer.parts.extend(later)
