"""Nodes of a single statement: scripts, lines, waits, popups, variables, nodes of URCaps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ur_emulator.errors import FileMissingError
from ur_emulator.programs.installation_reader import pc_from
from ur_emulator.programs.script_writer import one_line
from ur_emulator.programs.urp_maker import UrpMaker
from ur_emulator.programs.urp_values import (
    digital_level,
    expression_text,
    number,
    pin_read,
    pin_write,
    variable_name,
)

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

EXTERNAL_CONTROL = "External Control"
# How an analogue line is compared. Source: a public description of the file format.
_COMPARISONS = {"0": "<", "1": ">", "2": "=="}
# Kind of a popup -> warning, error.
_POPUPS = {"Message": "False, False", "Warning": "True, False", "Error": "False, True"}


def write_nothing(maker: UrpMaker, element: Element) -> None:
    """Write nothing: the node is suppressed, or an empty place."""


def write_comment(maker: UrpMaker, element: Element) -> None:
    """Write a `<Comment>`."""
    maker.writer.add(f"# {one_line(element.get('comment', ''))}")


def write_halt(maker: UrpMaker, element: Element) -> None:
    """Write a `<Halt>`."""
    maker.writer.label("Halt")
    maker.writer.add("halt")


def write_script(maker: UrpMaker, element: Element) -> None:
    """Write a `<Script>`: a line, or the lines of a file, which are also kept in the node."""
    kind = element.get("type", "")
    maker.writer.label("Script")
    if kind == "Line":
        maker.writer.add(expression_text(maker.tree, element.find("expression"), element))
        return
    if kind not in ("File", "Code"):
        raise maker.error(f"a <Script> of type {kind!r} cannot be turned into a script")
    content = element.findtext("cachedContents")
    name = (element.findtext("file") or "").strip()
    if name:
        try:
            reader = maker.shared.reader
            content = reader.script(reader.folder.beside(maker.file, name))
        except FileMissingError:
            if content is None:
                raise
    if content is None:
        raise maker.error("a <Script> node is empty and names no file")
    maker.writer.add(content)


def write_assignment(maker: UrpMaker, element: Element) -> None:
    """Write an `<Assignment>`; a variable that the operator is asked for is not known."""
    source = element.get("valueSource", "Expression")
    if source != "Expression":
        raise maker.error(f"an assignment from {source!r} cannot be turned into a script")
    name = variable_name(maker.tree, element.find("variable"))
    value = expression_text(maker.tree, element.find("expression"), element)
    maker.writer.label(f"{name}={value}")
    maker.writer.add(f"global {name} = {value}")


def write_set(maker: UrpMaker, element: Element) -> None:
    """Write a `<Set>` of a digital line; tools and payloads are in the installation, which is not read."""
    kind = element.get("type", "")
    maker.writer.label("Set")
    if kind == "DigitalOutput":
        level = digital_level(maker.tree, element)
        maker.writer.add(pin_write(maker.tree, element.find("pin"), level))
        return
    if kind == "NoAction" and element.find("tcp") is None:
        return
    raise maker.error(f"a <Set> of type {kind!r} cannot be turned into a script")


def write_wait(maker: UrpMaker, element: Element) -> None:
    """Write a `<Wait>`: for a time, a line, or a condition."""
    tree, writer = maker.tree, maker.writer
    kind = element.get("type", "")
    writer.label("Wait")
    match kind:
        case "NoWait":
            return
        case "Sleep":
            writer.add(f"sleep({number(tree, element.findtext('waitTime'), 'time of a <Wait>')!r})")
            return
        case "DigitalInput":
            awaited = f"{pin_read(tree, element.find('pin'))} == {digital_level(tree, element)}"
        case "AnalogInput":
            sign = _COMPARISONS.get((element.findtext("analogComparison") or "").strip())
            if sign is None:
                raise maker.error("a <Wait> compares in an unknown way: use 0 (less), 1 (more) or 2 (equal)")
            level = number(tree, element.findtext("analogValue"), "level of a <Wait>")
            awaited = f"{pin_read(tree, element.find('pin'))} {sign} {level!r}"
        case "Condition" | "Expression":
            awaited = expression_text(tree, element.find("expression"), element)
        case _:
            raise maker.error(f"a <Wait> of type {kind!r} cannot be turned into a script")
    with writer.block(f"while (not ({awaited})):"):
        writer.add("sync()")


def write_popup(maker: UrpMaker, element: Element) -> None:
    """Write a `<Popup>`, which waits until it is closed."""
    kind = element.get("type", "Message")
    if kind not in _POPUPS:
        raise maker.error(
            f"a popup of type {kind!r} cannot be turned into a script: use {', '.join(_POPUPS)}"
        )
    message = element.get("message") or element.findtext("message") or ""
    maker.writer.label("Popup")
    maker.writer.add(f'popup("{one_line(message)}", "{kind}", {_POPUPS[kind]}, blocking=True)')
    if element.get("haltProgram") == "true":
        maker.writer.add("halt")


def write_contributed(maker: UrpMaker, element: Element) -> None:
    """Write the node of a URCap: only External Control is known."""
    name = element.get("strategyURCapName") or element.get("strategyProgramNodeType") or "?"
    if name != EXTERNAL_CONTROL:
        raise maker.error(
            f"a node of the URCap {name!r} cannot be turned into a script; "
            "put the .script that PolyScope saved with the program beside it"
        )
    maker.writer.label(EXTERNAL_CONTROL)
    data = {item.get("key", ""): item.get("value", "") for item in element.iter("data")}
    maker.writer.gap(pc_from(data, maker.tree.name))
