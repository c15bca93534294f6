"""Nodes that hold others: loops, conditions, folders, sub-programs, threads."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ur_emulator.programs.urp_maker import UrpMaker
from ur_emulator.programs.urp_values import expression_text, number, variable_name

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_EMPTY = "# nothing"


def write_folder(maker: UrpMaker, element: Element) -> None:
    """Write what is in a `<Folder>`."""
    maker.writer.label(element.get("name", "Folder"))
    maker.write_children(element)


def write_loop(maker: UrpMaker, element: Element) -> None:
    """Write a `<Loop>`: without end, a number of times, or while a condition holds."""
    _not_watched(maker, element)
    writer = maker.writer
    writer.label("Loop")
    kind = element.get("type", "")
    if kind == "Counting":
        count = number(maker.tree, element.get("count"), "count of a <Loop>")
        variable = element.find("variable")
        counter = maker.shared.new_name("Loop") if variable is None else variable_name(maker.tree, variable)
        writer.add(f"global {counter} = 0")
        with writer.block(f"while ({counter} < {count:.0f}):"):
            maker.write_children(element)
            writer.add(f"{counter} = {counter} + 1")
        return
    if kind not in ("Forever", "While", "Expression"):
        raise maker.error(f"a loop of type {kind!r} cannot be turned into a script")
    condition = "True"
    if kind != "Forever":
        condition = expression_text(maker.tree, element.find("expression"), element)
    with writer.block(f"while ({condition}):"):
        writer.add(_EMPTY)
        maker.write_children(element)


def write_if(maker: UrpMaker, element: Element) -> None:
    """Write an `<If>`; its `ElseIf` and `Else` follow it in the tree and reopen the block it has closed."""
    _not_watched(maker, element)
    writer = maker.writer
    kind = element.get("type", "If")
    if kind == "If":
        writer.label("If")
        head = f"if ({expression_text(maker.tree, element.find('expression'), element)}):"
    elif kind in ("ElseIf", "Else"):
        before = maker.previous
        if before is None or before.tag != "If" or before.get("type", "If") == "Else":
            raise maker.error(f"an {kind} node stands behind no If")
        writer.parts.pop()
        head = "else:"
        if kind == "ElseIf":
            head = f"elif ({expression_text(maker.tree, element.find('expression'), element)}):"
    else:
        raise maker.error(f"an <If> node of type {kind!r} cannot be turned into a script")
    with writer.block(head):
        writer.add(_EMPTY)
        maker.write_children(element)


def write_switch(maker: UrpMaker, element: Element) -> None:
    """Write a `<Switch>` with its cases."""
    writer = maker.writer
    writer.label("Switch")
    value = expression_text(maker.tree, element.find("expression"), element)
    variable = maker.shared.new_name("switch_value")
    writer.add(f"global {variable} = {value}")
    head = "if"
    for case in element.findall("children/*"):
        if case.tag != "Case":
            raise maker.error(f"<{case.tag}> in a <Switch> cannot be turned into a script")
        chosen = number(maker.tree, case.get("caseValue"), "value of a <Case>")
        writer.add(f"{head} ({variable} == {chosen:g}):")
        with writer.indented():
            writer.add(_EMPTY)
            maker.write_children(case)
        head = "elif"
    if head == "elif":
        writer.add("end")


def write_call(maker: UrpMaker, element: Element) -> None:
    """Write the call of a sub-program."""
    called = element.find("subprogram")
    if called is None:
        raise maker.error("a <CallSubProgram> node names no sub-program")
    name = maker.name_of_subprogram(called)
    maker.writer.label(f"Call {name}")
    maker.writer.add(f"{name}()")


def write_thread(maker: UrpMaker, element: Element) -> str:
    """Write a `<Thread>`, which loops unless it says that it runs once; return its name."""
    writer = maker.writer
    name = maker.shared.new_name(element.get("name") or "Thread")
    with writer.block(f"thread {name}():"):
        writer.add(_EMPTY)
        if element.get("runOnlyOnce") == "true":
            maker.write_children(element)
        else:
            with writer.block("while (True):"):
                writer.add(_EMPTY)
                maker.write_children(element)
    return name


def _not_watched(maker: UrpMaker, element: Element) -> None:
    """Refuse a condition that is checked continuously while its block runs: it would take a thread."""
    if element.get("checkContinuously") == "true":
        raise maker.error(f"a <{element.tag}> that is checked continuously cannot be turned into a script")
