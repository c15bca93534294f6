"""Nodes of a single statement: scripts, lines, waits, popups, variables, timers, nodes of URCaps.

Source: program files and the scripts that PolyScope saved beside them.
"""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from ur_emulator.errors import FileMissingError
from ur_emulator.program_files.installation_reader import pc_from
from ur_emulator.program_files.reader import number_text
from ur_emulator.program_files.script_writer import one_line
from ur_emulator.program_files.urp_expressions import Line, expression_of, line_of, variable_name
from ur_emulator.program_files.urp_maker import Around, UrpMaker
from ur_emulator.program_files.urp_moves import set_tcp
from ur_emulator.program_files.urp_nodes import Node
from ur_emulator.program_files.urp_robotiq import ROBOTIQ, write_gripper_node

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

EXTERNAL_CONTROL = "External Control"
# How an analogue line is compared. Source: a public description of the file format.
_COMPARISONS = {"0": "<", "1": ">", "2": "=="}
# Kind of a popup -> warning, error.
_POPUPS = {"Message": "False, False", "Warning": "True, False", "Error": "False, True"}
# Type of a value that the operator gives -> builtin that asks for it; Float is inferred.
_QUESTIONS = {
    "Boolean": "request_boolean_from_primary_client",
    "Integer": "request_integer_from_primary_client",
    "Float": "request_float_from_primary_client",
    "String": "request_string_from_primary_client",
}
_TIMER_ACTIONS = {"Start": "{t}_is_counting = True", "Stop": "{t}_is_counting = False", "Reset": "{t} = 0"}


def write_nothing(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write nothing: the node is an empty place."""


def write_comment(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Comment>`."""
    comment = node.element.get("comment")
    text = f"'{' '.join(comment.splitlines())}'" if comment else "Comment"
    maker.writer.label(node.number, text, around.mark)
    maker.writer.add(f"# {text}")


def write_halt(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Halt>`."""
    maker.writer.label(node.number, "Halt", around.mark)
    maker.writer.add("halt")


def write_script(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Script>`: a line, or the lines of a file, which are also kept in the node."""
    kind = node.get("type")
    if kind == "Line":
        line = expression_of(maker, node)
        maker.writer.label(node.number, line.label, around.mark)
        maker.writer.add(line.script)
        return
    if kind not in ("File", "Code"):
        raise node.source.unknown(f"a <Script> of type {kind!r}")
    content = node.element.findtext("cachedContents")
    name = node.text("file")
    if name:
        try:
            content = maker.reader.script(maker.reader.folder.beside(node.source.file, name))
        except FileMissingError as error:
            if content is None:
                raise node.source.undefined(f"the file of a <Script> node is missing: {error}") from None
    if content is None:
        raise node.source.undefined("a <Script> node is empty and names no file")
    maker.writer.label(node.number, f"Script: {PurePosixPath(name).name}", around.mark)
    maker.writer.add(content)


def write_assignment(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write an `<Assignment>` of an expression, or of a value that the operator is asked for."""
    name = variable_name(node, node.element.find("variable"))
    source = node.get("valueSource") or "Expression"
    if source == "Expression":
        value = expression_of(maker, node)
        maker.writer.label(node.number, f"{name}≔{value.label}", around.mark)
        maker.writer.add(f"global {name}={value.script}")
        return
    question = _QUESTIONS.get(node.get("valueType"))
    if source != "Operator" or question is None:
        how = f"{source} {node.get('valueType')}".strip()
        raise node.source.unknown(f"an assignment from {how!r}")
    maker.writer.label(node.number, f"{name}≔{source}", around.mark)
    maker.writer.add(f'global {name}={question}("{one_line(node.get("message"))}")')


def write_set(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Set>` of a digital line or of the active TCP."""
    kind = node.get("type")
    tcp = node.find("tcp")
    if kind == "DigitalOutput":
        line = _line(maker, node)
        is_high = _is_high(node)
        statement = line.write(str(is_high))
        if not statement:
            raise node.source.undefined(f"line {line.label!r} is an input: it cannot be set")
        maker.writer.label(node.number, f"Set {line.label}={'On' if is_high else 'Off'}", around.mark)
        maker.writer.add(statement)
    elif kind != "NoAction":
        raise node.source.unknown(f"a <Set> of type {kind!r}")
    else:
        maker.writer.label(node.number, "Set", around.mark)
    if tcp is not None:
        maker.writer.add(set_tcp(maker, node, tcp))


def write_wait(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Wait>`: for a time, a line, or a condition."""
    tree, writer, number = node.source.tree, maker.writer, node.number
    match node.get("type"):
        case "NoWait":
            writer.label(number, "Wait: 0", around.mark)
            return
        case "Sleep":
            time = number_text(tree, node.element.findtext("waitTime"), "time of a <Wait>")
            writer.label(number, f"Wait: {time}", around.mark)
            writer.add(f"sleep({time})")
            return
        case "DigitalInput":
            line, is_high = _line(maker, node), _is_high(node)
            label = f"{line.label}={'HI' if is_high else 'LO'}"
            condition = f"{line.read} == {not is_high}"
        case "AnalogInput":
            sign = _COMPARISONS.get(node.text("analogComparison"))
            if sign is None:
                raise node.source.undefined(
                    "a <Wait> compares in an unknown way: use 0 (less), 1 (more) or 2 (equal)"
                )
            level = number_text(tree, node.element.findtext("analogValue"), "level of a <Wait>")
            line = _line(maker, node)
            label, condition = f"{line.label}{sign}{level}", f"not({line.read} {sign} {level})"
        case "Condition" | "Expression":
            awaited = expression_of(maker, node)
            label, condition = awaited.label, f"not({awaited.script})"
        case other:
            raise node.source.unknown(f"a <Wait> of type {other!r}")
    writer.label(number, f"Wait {label}", around.mark)
    with writer.block(f"while ({condition}):"):
        writer.add("sync()")


def write_popup(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Popup>` of a text, a variable or an expression; one that halts does not wait to be closed."""
    kind = node.get("type") or "Message"
    if kind not in _POPUPS:
        raise node.source.unknown(f"a popup of type {kind!r}")
    match node.get("inputType") or "Text":
        case "Text":
            text = node.get("message") or node.text("message")
            shown, label = f'"{one_line(text)}"', f"Popup: {text}"
        case "Variable":
            shown, label = f'str_cat("",{variable_name(node, node.element.find("variable"))})', "Popup"
        case "Expression":
            shown, label = f'str_cat("",{expression_of(maker, node).script})', "Popup"
        case other:
            raise node.source.unknown(f"a popup of {other!r}")
    is_halt = node.get("haltProgram") == "true"
    maker.writer.label(node.number, label, around.mark)
    maker.writer.add(f'popup({shown}, "{kind}", {_POPUPS[kind]}, blocking={not is_halt})')
    if is_halt:
        maker.writer.add("halt")


def write_timer(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Timer>`: a variable that a thread counts up [s]."""
    name = variable_name(node, node.element.find("variable"))
    action = node.get("action")
    if action not in _TIMER_ACTIONS:
        raise node.source.unknown(f"a timer's action {action!r}")
    maker.timers.setdefault(name)
    maker.writer.label(node.number, f"{name}: {action}", around.mark)
    maker.writer.add(_TIMER_ACTIONS[action].format(t=name))


def write_contributed(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write the node of a URCap: External Control, or Robotiq's grippers."""
    name = contributor(node.element)
    write = {EXTERNAL_CONTROL: _write_external_control, ROBOTIQ: write_gripper_node}.get(name)
    if write is None:
        raise node.source.unknown(f"a node of the URCap {name!r}")
    writer = maker.writer
    writer.add("# begin: URCap Program Node")
    writer.add(f"#   Source: {name}, {one_line(node.get('strategyURCapDeveloper'))}".rstrip(", "))
    writer.add(f"#   Type: {one_line(node.get('strategyProgramNodeType') or name)}")
    write(maker, node, around)
    writer.add("# end: URCap Program Node")


def _write_external_control(maker: UrpMaker, node: Node, around: Around) -> None:
    pc = pc_from(node.data, node.source.tree.name)
    title = one_line(node.get("strategyProgramNodeType") or EXTERNAL_CONTROL)
    name = maker.installation.pc_name or pc.host or title
    maker.writer.label(node.number, f"Control by {name}", around.mark)
    maker.writer.gap(pc)


def contributor(element: Element) -> str:
    """Return the name of the URCap that a `<Contributed>` node is of."""
    return element.get("strategyURCapName") or element.get("strategyProgramNodeType") or "?"


def _line(maker: UrpMaker, node: Node) -> Line:
    pin = node.find("pin")
    name = "" if pin is None else pin.get("referencedName", "")
    return line_of(maker.installation, name, node.source.tree.name)


def _is_high(node: Node) -> bool:
    """Return the level that a node names; UndefinedError if it names none."""
    text = node.text("digitalValue").lower()
    if text not in ("0", "1", "true", "false"):
        raise node.source.undefined(f"a <{node.kind}> node has the level {text[:100]!r}: it is 0 or 1")
    return text in ("1", "true")
