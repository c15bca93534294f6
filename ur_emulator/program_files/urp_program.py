"""A program file of PolyScope as a script, in the form that PolyScope gives it; and the kinds of its nodes.

PolyScope generates a script from the nodes each time a program is played. Its parts stand in this order:
header, first values of variables, positions and helpers in the order of first use, timers, sub-programs,
BeforeStart, threads and events, main program. Source: program files and the scripts that PolyScope saved
beside them. docs/programs.md shows the tables of nodes.
"""

from collections.abc import Iterator
from itertools import groupby

from ur_emulator.program_files import (
    urp_directions,  # noqa: F401 - its nodes are in KINDS then, as those of the others
    urp_flow,
    urp_moves,
    urp_statements,
)
from ur_emulator.program_files.installation import Installation
from ur_emulator.program_files.names import identifier
from ur_emulator.program_files.reader import ProgramReader, XmlTree
from ur_emulator.program_files.script_writer import Header, Part, ScriptWriter
from ur_emulator.program_files.urp_expressions import expression_of, variable_name
from ur_emulator.program_files.urp_nodes import Node, ProgramNodes
from ur_emulator.program_files.urp_robotiq import declare_functions

TOP_KINDS = {
    "InitVariablesNode": "first values of variables",
    "SpecialSequence": "BeforeStart: statements before threads and main program",
    "MainProgram": "the body, in a loop unless `runOnlyOnce`",
    "Thread": "a thread that loops unless `runOnlyOnce`; it starts after BeforeStart",
    "Event": "a condition with nodes; one thread looks for all events",
    "SubProgram": "a function before BeforeStart",
    "SuppressedNode": "nothing, but its nodes count in the numbers of labels; also inside of programs",
}
"""Nodes around those of `KINDS` -> what they become."""

NOT_KNOWN = (
    "pallets and conveyor tracking",
    "wizards and nodes of URCaps other than External Control and Robotiq_Grippers",
    "`Set` of analogue outputs, expressions and payloads",
    "`Until` of an expression or a line, or with another end than a stop",
    "moves with OptiMove",
    "lines, planes and points as features in expressions",
)
"""What programs of PolyScope may hold and no script is known for."""


def uses_external_control(tree: XmlTree) -> bool:
    """True for a program with a part that a PC sends when it is played."""
    nodes = tree.root.iter("Contributed")
    return any(urp_statements.contributor(node) == urp_statements.EXTERNAL_CONTROL for node in nodes)


def make_script(
    tree: XmlTree, reader: ProgramReader, installation: Installation, *, skip_unknown: bool = False
) -> ScriptWriter:
    """Write the script of a program, and return its writer; the reader reads files that it refers to.

    Raises:
        UnknownNodeError: a node is not known, and must not be skipped.
        ProgramFileError: something in the file is damaged, or a limit is exceeded.
    """
    program = ProgramNodes(tree, reader)
    writer = ScriptWriter(program, installation, skip_unknown=skip_unknown)
    sub_programs = [node for _, node in program.sub_programs]
    for node in (*program.before_start, program.main, *program.others, *program.events, *sub_programs):
        writer.last_motions |= urp_moves.last_motions(node)
    # Parts are written in the order of their numbers, so that declarations come in the order of first use.
    with writer.block(f"def {identifier(tree.root.get('name') or tree.file.stem)}():"):
        writer.parts.append(Header())
        _write_first_values(writer)
        with writer.aside() as before:
            for node in program.before_start:
                _write_section(writer, node, "BeforeStart")
        with writer.aside() as body, writer.repeated(program.main):
            _write_section(writer, program.main, "Robot Program")
        with writer.aside() as others:
            for node in program.others:
                if node.kind == "Thread":
                    urp_flow.write_thread(writer, node)
                else:
                    writer.write(node)
            urp_flow.write_events(writer, program.events)
        with writer.aside() as functions:
            for function, node in program.sub_programs:
                with writer.block(f"def {function}():"):
                    _write_section(writer, node, function, mark="noBreak")
        rest = (*functions, *before, *others, *body)
        texts = (part for part in (*writer.parts, *rest) if isinstance(part, str))
        if installation.grippers.is_there and any("rq_" in text for text in texts):
            declare_functions(writer)
        for timer in writer.timers:
            if f"first value of {timer}" not in writer.declarations:
                writer.add(f"global {timer}=0")
        for lines in writer.declarations.values():
            writer.add(*lines)
        _write_timers(writer)
        writer.parts += rest
    writer.parts = list(_joined(writer.parts))
    return writer


def _joined(parts: list[Part]) -> Iterator[Part]:
    """Yield the texts between gaps whole."""
    for is_text, group in groupby(parts, lambda part: isinstance(part, str)):
        if is_text:
            yield "\n".join(map(str, group))
        else:
            yield from group


def _write_section(writer: ScriptWriter, node: Node, name: str, *, mark: str = "") -> None:
    writer.put(node, name, mark=mark)
    writer.write_children(node)


def _write_first_values(writer: ScriptWriter) -> None:
    """Write the values that variables have before anything else; they stand with the names."""
    program = writer.program
    values = [(one, one.find("initializeExpression")) for one in program.tree.root.iter()]
    values += [(one, one.find("expression")) for one in program.variables]
    for variable, value in values:
        if value is not None and len(value):
            with writer.leaving_out(program.main):
                name = variable_name(program.main, variable)
                expression = expression_of(writer, program.main, value)
                writer.declare(f"first value of {name}", f"global {name}={expression.script}")


def _write_timers(writer: ScriptWriter) -> None:
    if not writer.timers:
        return
    writer.add(*(f"global {timer}_is_counting=False" for timer in writer.timers))
    with writer.block("thread Timer_Thread():"), writer.block("while (True):"):
        for timer in writer.timers:
            writer.add(f"if ({timer}_is_counting):", f"  {timer} = {timer} + get_steptime()", "end")
        writer.add("sync()")
    writer.add("run Timer_Thread()")
