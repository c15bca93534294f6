"""Nodes that hold others: folders, loops, conditions, calls, threads, events.

Source: program files and the scripts that PolyScope saved beside them.
"""

from collections.abc import Sequence

from ur_emulator.budgets import BUDGETS
from ur_emulator.program_files.urp_expressions import expression_of, variable_name
from ur_emulator.program_files.urp_maker import Around, NodeKinds, UrpMaker
from ur_emulator.program_files.urp_nodes import Node

KINDS = NodeKinds()
# Value of the case of a `<Switch>` that is taken when no other one is.
_DEFAULT_CASE = "2147483647"


@KINDS.writes("Folder", "its nodes")
def _write_folder(maker: UrpMaker, node: Node, around: Around) -> None:
    maker.put(node, around, node.get("name") or "Folder")
    maker.write_children(node, around)


@KINDS.writes("Loop", "`while`: Forever, Counting with its variable, While; checked continuously as If")
def _write_loop(maker: UrpMaker, node: Node, around: Around) -> None:
    writer = maker.writer
    match node.get("type"):
        case "Forever":
            maker.put(node, around, "Loop")
            maker.write_block("while (True):", node, around)
        case "Counting":
            count = node.tree.number_text(node.get("count"), "count of a <Loop>")
            variable = node.element.find("loopVariable")
            counter = maker.program.names.new("Loop") if variable is None else variable_name(node, variable)
            maker.put(node, around, f"Loop {count} times", f"{counter} = 0")
            with writer.block(f"while ({counter} < {count}):"):
                maker.write_children(node, around)
                writer.add(f"{counter} = {counter} + 1")
        case "While" | "Expression":
            condition = expression_of(maker, node)
            maker.put(node, around, f"Loop {condition.label}")
            if node.get("checkContinuously") == "true":
                _write_watched_loop(maker, node, around, condition.script)
                return
            maker.write_block(f"while ({condition.script}):", node, around)
        case other:
            raise node.tree.unknown(f"a loop of type {other!r}")


def _write_watched_loop(maker: UrpMaker, node: Node, around: Around, condition: str) -> None:
    """Write a loop in a thread that ends as soon as the condition does not hold."""
    writer, n = maker.writer, node.number
    with writer.block(f"thread Thread_while_{n}():"):
        maker.write_block("while (True):", node, around)
    with writer.block(f"if ({condition}):"):
        writer.add(f"global thread_handler_{n}=run Thread_while_{n}()")
        with writer.block(f"while ({condition}):"):
            writer.add("sync()")
        writer.add(f"kill thread_handler_{n}")


@KINDS.writes(
    "If",
    "`if`, with ElseIf and Else; a condition that is checked continuously ends the thread of its nodes",
)
def _write_if(maker: UrpMaker, node: Node, around: Around) -> None:
    """Each branch stands in the `else` of the one before."""
    kind = node.get("type")
    if kind in ("ElseIf", "Else"):
        raise node.tree.error(f"an {kind} node stands behind no If")
    if kind not in ("", "If"):
        raise node.tree.unknown(f"an <If> node of type {kind!r}")
    if len(node.branches) > BUDGETS.node_depth:
        raise node.tree.error(f"an <If> node has more than {BUDGETS.node_depth} branches")
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
    maker.put(node, around, f"{node.get('type') or 'If'} {condition.label}")
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


@KINDS.writes("Switch", "`if`, `elif` and `else` for the default case")
def _write_switch(maker: UrpMaker, node: Node, around: Around) -> None:
    writer = maker.writer
    for case in node.children:
        if case.kind != "Case":
            raise case.tree.unknown(f"<{case.kind}> in a <Switch>")
    value = expression_of(maker, node)
    maker.switches += 1
    variable = f"switch_{maker.switches}"
    maker.put(node, around, f"Switch {value.label}", f"{variable} = {value.script}")
    defaults = [case for case in node.children if case.get("caseValue") == _DEFAULT_CASE]
    cases = [case for case in node.children if case.get("caseValue") != _DEFAULT_CASE]
    for index, case in enumerate(cases):
        chosen = case.tree.number_text(case.get("caseValue"), "value of a <Case>")
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


@KINDS.writes("CallSubProgram", "the call of a function, perhaps from another .urp")
def _write_call(maker: UrpMaker, node: Node, around: Around) -> None:
    called = node.find("subprogram")
    if called is None:
        raise node.tree.undefined("a <CallSubProgram> node names no sub-program")
    name = maker.program.functions[called]
    maker.put(node, around, f"Call {name}", f"{name}()")


def write_thread(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a `<Thread>`, which loops unless it says that it runs once."""
    writer = maker.writer
    given = node.get("name") or "Thread"
    name = maker.program.names.new(given)
    writer.label(node.number, given)
    with writer.block(f"thread {name}():"), maker.repeated(node):
        maker.write_children(node, around)
    writer.add(f"threadId_{name} = run {name}()")


def write_events(maker: UrpMaker, events: Sequence[Node], around: Around) -> None:
    """Write all `<Event>` nodes: one thread looks for them in each cycle."""
    writer = maker.writer
    known: list[tuple[Node, str]] = []
    for event in events:
        with maker.leaving_out(event):
            known.append((event, expression_of(maker, event).script))
    if not known:
        return
    with writer.block("thread EventThread():"), writer.block("while (True):"):
        for index, (node, condition) in enumerate(known):
            with writer.branch(f"{'elif' if index else 'if'} ({condition}):"):
                maker.write_children(node, around)
        writer.add("end", "sync()")
    writer.add("eventThread = run EventThread()")
