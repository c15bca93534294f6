"""Nodes that hold others: folders, loops, conditions, calls, threads, events.

Source: program files and the scripts that PolyScope saved beside them.
"""

from collections.abc import Sequence
from functools import partial

from ur_emulator.budgets import BUDGETS
from ur_emulator.program_files.reader import number_text
from ur_emulator.program_files.urp_expressions import expression_of, variable_name
from ur_emulator.program_files.urp_maker import Around, UrpMaker
from ur_emulator.program_files.urp_nodes import Node

# Value of the case of a `<Switch>` that is taken when no other one is.
_DEFAULT_CASE = "2147483647"


def write_folder(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Folder>`: its nodes stand at the same level."""
    maker.writer.label(node.number, node.get("name") or "Folder", around.mark)
    maker.write_children(node, around)


def write_loop(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Loop>`: without end, a number of times, or while a condition holds."""
    writer = maker.writer
    match node.get("type"):
        case "Forever":
            writer.label(node.number, "Loop", around.mark)
            with writer.block("while (True):"):
                maker.write_children(node, around)
        case "Counting":
            count = number_text(node.source.tree, node.get("count"), "count of a <Loop>")
            variable = node.element.find("loopVariable")
            counter = maker.program.names.new("Loop") if variable is None else variable_name(node, variable)
            writer.label(node.number, f"Loop {count} times", around.mark)
            writer.add(f"{counter} = 0")
            with writer.block(f"while ({counter} < {count}):"):
                maker.write_children(node, around)
                writer.add(f"{counter} = {counter} + 1")
        case "While" | "Expression":
            condition = expression_of(maker, node)
            writer.label(node.number, f"Loop {condition.label}", around.mark)
            if node.get("checkContinuously") == "true":
                _write_watched_loop(maker, node, around, condition.script)
                return
            with writer.block(f"while ({condition.script}):"):
                maker.write_children(node, around)
        case other:
            raise node.source.unknown(f"a loop of type {other!r}")


def _write_watched_loop(maker: UrpMaker, node: Node, around: Around, condition: str) -> None:
    """Write a loop in a thread that ends as soon as the condition does not hold."""
    writer, n = maker.writer, node.number
    with writer.block(f"thread Thread_while_{n}():"), writer.block("while (True):"):
        maker.write_children(node, around)
    with writer.block(f"if ({condition}):"):
        writer.add(f"global thread_handler_{n}=run Thread_while_{n}()")
        with writer.block(f"while ({condition}):"):
            writer.add("sync()")
        writer.add(f"kill thread_handler_{n}")


def write_if(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write an `<If>` with its branches: each stands in the `else` of the one before."""
    if node.get("type") not in ("", "If"):
        if node.get("type") in ("ElseIf", "Else"):
            raise node.source.error(f"an {node.get('type')} node stands behind no If")
        raise node.source.unknown(f"an <If> node of type {node.get('type')!r}")
    if len(node.branches) > BUDGETS.node_depth:
        raise node.source.error(f"an <If> node has more than {BUDGETS.node_depth} branches")
    _write_branches(maker, (node, *node.branches), around)


def _write_branches(maker: UrpMaker, branches: Sequence[Node], around: Around) -> None:
    """Write the first branch; the others run if its condition does not hold."""
    node, others = branches[0], branches[1:]
    writer, n = maker.writer, node.number
    if node.get("type") == "Else":
        writer.label(n, "Else", "noBreak")
        maker.write_children(node, around)
        return
    condition = expression_of(maker, node)
    writer.label(n, f"{node.get('type') or 'If'} {condition.label}", around.mark)
    if node.get("checkContinuously") == "true":
        _write_watched_branch(maker, node, around, condition.script)
        if others:
            with writer.block(f"if (thread_flag_{n} == 2):"):
                _write_branches(maker, others, around)
        return
    with writer.branch(f"if ({condition.script}):"):
        maker.write_children(node, around)
    if others:
        with writer.branch("else:"):
            _write_branches(maker, others, around)
    writer.add("end")


def _write_watched_branch(maker: UrpMaker, node: Node, around: Around, condition: str) -> None:
    """Write a branch in a thread that ends as soon as the condition does not hold; its flag is 2 then."""
    writer, n = maker.writer, node.number
    writer.add(f"global thread_flag_{n}=0")
    with writer.block(f"thread Thread_if_{n}():"):
        maker.write_children(node, around)
        writer.add(f"thread_flag_{n} = 1")
    with writer.branch(f"if ({condition}):"):
        writer.add(f"global thread_handler_{n}=run Thread_if_{n}()")
        with writer.block(f"while (thread_flag_{n} == 0):"):
            with writer.branch(f"if not({condition}):"):
                writer.add(f"kill thread_handler_{n}", f"thread_flag_{n} = 2")
            with writer.block("else:"):
                writer.add("sync()")
    with writer.block("else:"):
        writer.add(f"thread_flag_{n} = 2")


def write_switch(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Switch>` with its cases; the default case stands behind the others."""
    writer = maker.writer
    for case in node.children:
        if case.kind != "Case":
            raise case.source.unknown(f"<{case.kind}> in a <Switch>")
    value = expression_of(maker, node)
    maker.switches += 1
    variable = f"switch_{maker.switches}"
    writer.label(node.number, f"Switch {value.label}", around.mark)
    writer.add(f"{variable} = {value.script}")
    cases = [case for case in node.children if case.get("caseValue") != _DEFAULT_CASE]
    defaults = [case for case in node.children if case.get("caseValue") == _DEFAULT_CASE]
    for index, case in enumerate(cases):
        chosen = number_text(case.source.tree, case.get("caseValue"), "value of a <Case>")
        if index == 0:  # PolyScope writes the label of the first case before its block
            writer.label(case.number, f"Case {chosen}", around.mark)
        with writer.branch(f"{'elif' if index else 'if'} ({chosen} == {variable}):"):
            if index:
                writer.label(case.number, f"Case {chosen}", around.mark)
            maker.write_children(case, around)
    for case in defaults[:1]:
        with writer.branch("else:" if cases else "if (True):"):
            writer.label(case.number, "Default Case", around.mark)
            maker.write_children(case, around)
    if cases or defaults:
        writer.add("end")


def write_call(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<CallSubProgram>`."""
    called = node.find("subprogram")
    if called is None:
        raise node.source.undefined("a <CallSubProgram> node names no sub-program")
    name = maker.program.functions[called]
    maker.writer.label(node.number, f"Call {name}", around.mark)
    maker.writer.add(f"{name}()")


def write_thread(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Thread>`, which loops unless it says that it runs once."""
    writer = maker.writer
    given = node.get("name") or "Thread"
    name = maker.program.names.new(given)
    writer.label(node.number, given)
    with writer.block(f"thread {name}():"):
        if node.get("runOnlyOnce") == "true":
            maker.write_children(node, around)
        else:
            with writer.block("while (True):"):
                maker.write_children(node, around)
    writer.add(f"threadId_{name} = run {name}()")


def write_events(maker: UrpMaker, events: Sequence[Node], around: Around) -> None:
    """Write all `<Event>` nodes: one thread looks for them in each cycle."""
    writer = maker.writer
    known: list[tuple[Node, str]] = []
    for event in events:
        maker.try_to(event, partial(_note_condition, maker, event, known))
    if not known:
        return
    with writer.block("thread EventThread():"), writer.block("while (True):"):
        for index, (node, condition) in enumerate(known):
            with writer.branch(f"{'elif' if index else 'if'} ({condition}):"):
                maker.write_children(node, around)
        writer.add("end", "sync()")
    writer.add("eventThread = run EventThread()")


def _note_condition(maker: UrpMaker, event: Node, known: list[tuple[Node, str]]) -> None:
    known.append((event, expression_of(maker, event).script))
