"""Nodes that hold others: folders, loops, conditions, calls, threads, events.

Source: program files and the scripts that PolyScope saved beside them.
"""

from collections.abc import Sequence

from ur_emulator.budgets import BUDGETS
from ur_emulator.program_files.script_writer import ScriptWriter, writes
from ur_emulator.program_files.urp_expressions import expression_of, variable_name
from ur_emulator.program_files.urp_nodes import Node

# Value of the case of a `<Switch>` that is taken when no other one is.
_DEFAULT_CASE = "2147483647"


@writes("Folder", "its nodes")
def _write_folder(writer: ScriptWriter, node: Node) -> None:
    writer.put(node, node.get("name") or "Folder")
    writer.write_children(node)


@writes("Loop", "`while`: Forever, Counting with its variable, While; checked continuously as If")
def _write_loop(writer: ScriptWriter, node: Node) -> None:
    match node.get("type"):
        case "Forever":
            writer.put(node, "Loop")
            with writer.block("while (True):"):
                writer.write_children(node)
        case "Counting":
            count = node.tree.number_text(node.get("count"), "count of a <Loop>")
            variable = node.element.find("loopVariable")
            counter = writer.program.names.new("Loop") if variable is None else variable_name(node, variable)
            writer.put(node, f"Loop {count} times", f"{counter} = 0")
            with writer.block(f"while ({counter} < {count}):"):
                writer.write_children(node)
                writer.add(f"{counter} = {counter} + 1")
        case "While" | "Expression":
            condition = expression_of(writer, node)
            writer.put(node, f"Loop {condition.label}")
            if node.get("checkContinuously") == "true":
                _write_watched_loop(writer, node, condition.script)
                return
            with writer.block(f"while ({condition.script}):"):
                writer.write_children(node)
        case other:
            raise node.tree.unknown(f"a loop of type {other!r}")


def _write_watched_loop(writer: ScriptWriter, node: Node, condition: str) -> None:
    """Write a loop in a thread that ends as soon as the condition does not hold."""
    n = node.number
    with writer.block(f"thread Thread_while_{n}():"), writer.block("while (True):"):
        writer.write_children(node)
    with writer.block(f"if ({condition}):"):
        writer.add(f"global thread_handler_{n}=run Thread_while_{n}()")
        with writer.block(f"while ({condition}):"):
            writer.add("sync()")
        writer.add(f"kill thread_handler_{n}")


@writes(
    "If",
    "`if`, with ElseIf and Else; a condition that is checked continuously ends the thread of its nodes",
)
def _write_if(writer: ScriptWriter, node: Node) -> None:
    """Each branch stands in the `else` of the one before."""
    kind = node.get("type")
    if kind in ("ElseIf", "Else"):
        raise node.tree.error(f"an {kind} node stands behind no If")
    if kind not in ("", "If"):
        raise node.tree.unknown(f"an <If> node of type {kind!r}")
    if len(node.branches) > BUDGETS.node_depth:
        raise node.tree.error(f"an <If> node has more than {BUDGETS.node_depth} branches")
    _write_branches(writer, (node, *node.branches))


def _write_branches(writer: ScriptWriter, branches: Sequence[Node]) -> None:
    """Write the first branch; the others run if its condition does not hold."""
    node, others = branches[0], branches[1:]
    n = node.number
    if node.get("type") == "Else":
        writer.put(node, "Else", mark="noBreak")
        writer.write_children(node)
        return
    condition = expression_of(writer, node)
    writer.put(node, f"{node.get('type') or 'If'} {condition.label}")
    if node.get("checkContinuously") == "true":
        _write_watched_branch(writer, node, condition.script)
        if others:
            with writer.block(f"if (thread_flag_{n} == 2):"):
                _write_branches(writer, others)
        return
    with writer.branch(f"if ({condition.script}):"):
        writer.write_children(node)
    if others:
        with writer.branch("else:"):
            _write_branches(writer, others)
    writer.add("end")


def _write_watched_branch(writer: ScriptWriter, node: Node, condition: str) -> None:
    """Write a branch in a thread that ends as soon as the condition does not hold; its flag is 2 then."""
    n = node.number
    writer.add(f"global thread_flag_{n}=0")
    with writer.block(f"thread Thread_if_{n}():"):
        writer.write_children(node)
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


@writes("Switch", "`if`, `elif` and `else` for the default case")
def _write_switch(writer: ScriptWriter, node: Node) -> None:
    for case in node.children:
        if case.kind != "Case":
            raise case.tree.unknown(f"<{case.kind}> in a <Switch>")
    value = expression_of(writer, node)
    writer.switches += 1
    variable = f"switch_{writer.switches}"
    writer.put(node, f"Switch {value.label}", f"{variable} = {value.script}")
    defaults = [case for case in node.children if case.get("caseValue") == _DEFAULT_CASE]
    cases = [case for case in node.children if case.get("caseValue") != _DEFAULT_CASE]
    for index, case in enumerate(cases):
        chosen = case.tree.number_text(case.get("caseValue"), "value of a <Case>")
        if index == 0:  # PolyScope writes the label of the first case before its block
            writer.put(case, f"Case {chosen}")
        with writer.branch(f"{'elif' if index else 'if'} ({chosen} == {variable}):"):
            if index:
                writer.put(case, f"Case {chosen}")
            writer.write_children(case)
    for case in defaults[:1]:
        with writer.branch("else:" if cases else "if (True):"):
            writer.put(case, "Default Case")
            writer.write_children(case)
    if cases or defaults:
        writer.add("end")


@writes("CallSubProgram", "the call of a function, perhaps from another .urp")
def _write_call(writer: ScriptWriter, node: Node) -> None:
    called = node.find("subprogram")
    if called is None:
        raise node.tree.undefined("a <CallSubProgram> node names no sub-program")
    name = writer.program.functions[called]
    writer.put(node, f"Call {name}", f"{name}()")


def write_thread(writer: ScriptWriter, node: Node) -> None:
    """Write a `<Thread>`, which loops unless it says that it runs once."""
    given = node.get("name") or "Thread"
    name = writer.program.names.new(given)
    writer.put(node, given)
    with writer.block(f"thread {name}():"), writer.repeated(node):
        writer.write_children(node)
    writer.add(f"threadId_{name} = run {name}()")


def write_events(writer: ScriptWriter, events: Sequence[Node]) -> None:
    """Write all `<Event>` nodes: one thread looks for them in each cycle."""
    known: list[tuple[Node, str]] = []
    for event in events:
        with writer.leaving_out(event):
            known.append((event, expression_of(writer, event).script))
    if not known:
        return
    with writer.block("thread EventThread():"), writer.block("while (True):"):
        for index, (node, condition) in enumerate(known):
            with writer.branch(f"{'elif' if index else 'if'} ({condition}):"):
                writer.write_children(node)
        writer.add("end", "sync()")
    writer.add("eventThread = run EventThread()")
