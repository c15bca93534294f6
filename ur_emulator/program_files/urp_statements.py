"""Nodes of a single statement: scripts, lines, waits, popups, variables, timers, nodes of URCaps.

Source: program files and the scripts that PolyScope saved beside them.
"""

from pathlib import PurePosixPath
from xml.etree.ElementTree import Element

from ur_emulator.errors import FileMissingError
from ur_emulator.program_files.installation_reader import pc_from
from ur_emulator.program_files.lines import Line, line_of
from ur_emulator.program_files.names import one_line
from ur_emulator.program_files.script_writer import ScriptWriter, writes
from ur_emulator.program_files.urp_expressions import expression_of, variable_name
from ur_emulator.program_files.urp_moves import write_tcp
from ur_emulator.program_files.urp_nodes import Node
from ur_emulator.program_files.urp_robotiq import ROBOTIQ, write_gripper_node

EXTERNAL_CONTROL = "External Control"
# How an analogue line is compared. Source: a public description of the file format.
_COMPARISONS = {"0": "<", "1": ">", "2": "=="}
# Kind of a popup -> warning, error.
_POPUPS = {"Message": "False, False", "Warning": "True, False", "Error": "False, True"}
# Types of a value that the operator gives; that of Float is inferred.
_ANSWERS = ("Boolean", "Integer", "Float", "String")
_TIMER_ACTIONS = {"Start": "{t}_is_counting = True", "Stop": "{t}_is_counting = False", "Reset": "{t} = 0"}


@writes("Placeholder", "nothing")
def _write_nothing(writer: ScriptWriter, node: Node) -> None:
    """The node is an empty place."""


@writes("Comment", "a comment")
def _write_comment(writer: ScriptWriter, node: Node) -> None:
    comment = node.element.get("comment")
    text = f"'{' '.join(comment.splitlines())}'" if comment else "Comment"
    writer.put(node, text, f"# {text}")


@writes("Halt", "`halt`")
def _write_halt(writer: ScriptWriter, node: Node) -> None:
    writer.put(node, "Halt", "halt")


@writes("Script", "a line, or the text of a file, read from its path or else from the copy in the node")
def _write_script(writer: ScriptWriter, node: Node) -> None:
    kind = node.get("type")
    if kind == "Line":
        line = expression_of(writer, node)
        writer.put(node, line.label, line.script)
        return
    if kind not in ("File", "Code"):
        raise node.tree.unknown(f"a <Script> of type {kind!r}")
    content = node.element.findtext("cachedContents")
    name, reader = node.text("file"), writer.program.reader
    if name:
        try:
            content = reader.script(reader.folder.beside(node.tree.file, name))
        except FileMissingError as error:
            if content is None:
                raise node.tree.undefined(f"the file of a <Script> node is missing: {error}") from None
    if content is None:
        raise node.tree.undefined("a <Script> node is empty and names no file")
    writer.put(node, f"Script: {PurePosixPath(name).name}", content)


@writes(
    "Assignment",
    "`global v=...`: an expression, or what the operator answers (Boolean, Integer, Float, String)",
)
def _write_assignment(writer: ScriptWriter, node: Node) -> None:
    name = variable_name(node)
    source = node.get("valueSource") or "Expression"
    if source == "Expression":
        value = expression_of(writer, node)
        writer.put(node, f"{name}≔{value.label}", f"global {name}={value.script}")
        return
    kind = node.get("valueType")
    if source != "Operator" or kind not in _ANSWERS:
        raise node.tree.unknown(f"an assignment from {f'{source} {kind}'.strip()!r}")
    question = f'request_{kind.lower()}_from_primary_client("{one_line(node.get("message"))}")'
    writer.put(node, f"{name}≔{source}", f"global {name}={question}")


@writes("Set", "a digital output, or the active TCP")
def _write_set(writer: ScriptWriter, node: Node) -> None:
    kind = node.get("type")
    if kind == "DigitalOutput":
        line, is_high = _line(writer, node), _is_high(node)
        if not line.writes:
            raise node.tree.undefined(f"line {line.label!r} is an input: it cannot be set")
        writer.put(node, f"Set {line.label}={'On' if is_high else 'Off'}", line.writes[is_high])
    elif kind == "NoAction":
        writer.put(node, "Set")
    else:
        raise node.tree.unknown(f"a <Set> of type {kind!r}")
    write_tcp(writer, node)


@writes("Wait", "`sleep`, or a loop until a line has a level or a condition holds")
def _write_wait(writer: ScriptWriter, node: Node) -> None:
    match node.get("type"):
        case "NoWait":
            writer.put(node, "Wait: 0")
            return
        case "Sleep":
            time = node.tree.number_text(node.element.findtext("waitTime"), "time of a <Wait>")
            writer.put(node, f"Wait: {time}", f"sleep({time})")
            return
        case "DigitalInput":
            line, is_high = _line(writer, node), _is_high(node)
            label = f"{line.label}={'HI' if is_high else 'LO'}"
            condition = f"{line.read} == {not is_high}"
        case "AnalogInput":
            sign = _COMPARISONS.get(node.text("analogComparison"))
            if sign is None:
                raise node.tree.undefined(
                    "a <Wait> compares in an unknown way: use 0 (less), 1 (more) or 2 (equal)"
                )
            level = node.tree.number_text(node.element.findtext("analogValue"), "level of a <Wait>")
            line = _line(writer, node)
            label, condition = f"{line.label}{sign}{level}", f"not({line.read} {sign} {level})"
        case "Condition" | "Expression":
            awaited = expression_of(writer, node)
            label, condition = awaited.label, f"not({awaited.script})"
        case other:
            raise node.tree.unknown(f"a <Wait> of type {other!r}")
    writer.put(node, f"Wait {label}", f"while ({condition}):", "  sync()", "end")


@writes("Popup", "`popup` of a text, a variable or an expression; one that halts the program does not wait")
def _write_popup(writer: ScriptWriter, node: Node) -> None:
    kind = node.get("type") or "Message"
    if kind not in _POPUPS:
        raise node.tree.unknown(f"a popup of type {kind!r}")
    match node.get("inputType") or "Text":
        case "Text":
            text = node.get("message") or node.text("message")
            shown, label = f'"{one_line(text)}"', f"Popup: {text}"
        case "Variable":
            shown, label = f'str_cat("",{variable_name(node)})', "Popup"
        case "Expression":
            shown, label = f'str_cat("",{expression_of(writer, node).script})', "Popup"
        case other:
            raise node.tree.unknown(f"a popup of {other!r}")
    is_halt = node.get("haltProgram") == "true"
    writer.put(node, label, f'popup({shown}, "{kind}", {_POPUPS[kind]}, blocking={not is_halt})')
    if is_halt:
        writer.add("halt")


@writes("Timer", "a variable that a thread counts up while it is started")
def _write_timer(writer: ScriptWriter, node: Node) -> None:
    """The variable is a time [s]."""
    name = variable_name(node)
    action = node.get("action")
    if action not in _TIMER_ACTIONS:
        raise node.tree.unknown(f"a timer's action {action!r}")
    writer.timers.setdefault(name)
    writer.put(node, f"{name}: {action}", _TIMER_ACTIONS[action].format(t=name))


@writes("Contributed", "External Control: what a PC sends, see below; the nodes of Robotiq_Grippers")
def _write_contributed(writer: ScriptWriter, node: Node) -> None:
    name = contributor(node.element)
    write = {EXTERNAL_CONTROL: _write_external_control, ROBOTIQ: write_gripper_node}.get(name)
    if write is None:
        raise node.tree.unknown(f"a node of the URCap {name!r}")
    writer.add(
        "# begin: URCap Program Node",
        f"#   Source: {name}, {one_line(node.get('strategyURCapDeveloper'))}".rstrip(", "),
        f"#   Type: {one_line(node.get('strategyProgramNodeType') or name)}",
    )
    write(writer, node)
    writer.add("# end: URCap Program Node")


def _write_external_control(writer: ScriptWriter, node: Node) -> None:
    pc = pc_from(node.data, node.tree)
    title = one_line(node.get("strategyProgramNodeType") or EXTERNAL_CONTROL)
    name = writer.installation.pc_name or pc.host or title
    writer.put(node, f"Control by {name}")
    writer.gap(pc)


def contributor(element: Element) -> str:
    """Return the name of the URCap that a `<Contributed>` node is of."""
    return element.get("strategyURCapName") or element.get("strategyProgramNodeType") or "?"


def _line(writer: ScriptWriter, node: Node) -> Line:
    return line_of(writer.installation, node.value("pin", "referencedName"), node.tree)


def _is_high(node: Node) -> bool:
    """Return the level that a node names; UndefinedError if it names none."""
    text = node.text("digitalValue").lower()
    if text not in ("0", "1", "true", "false"):
        raise node.tree.undefined(f"a <{node.kind}> node has the level {text[:100]!r}: it is 0 or 1")
    return text in ("1", "true")
