"""The door is the only way in: the host reads the machine, and changes it by `Machine` alone.

Found by reading the syntax trees of the host: names that stand for something of the machine are those with the
type of a class of the machine, and what was taken out of them.
"""

import ast
from pathlib import Path

import pytest

HOST = Path(__file__).parent.parent / "ur_emulator" / "host"
# Attributes and names that lead into the machine, whoever has them.
ROOTS = {"machine", "controller", "grippers"}
# Methods of the machine that only tell something.
READS = {
    "as_dict", "find", "get", "is_high", "items", "may_unlock", "position", "read_digital_in",
    "read_global", "seconds", "state", "summary", "tick_at", "unread", "values", "inverse", "cycles",
    "software", "answer", "count", "index", "variables", "jacobian",
}  # fmt: skip
# The door, and who may use it.
DOOR = {
    "tick": {"served_box.py", "replay.py"},
    "take": {"served_box.py"},
    "use_idle_time": {"served_box.py"},
    "forget_ended": {"memory.py"},
}
# Records and tables of the machine are no part of its state.
PLAIN = {
    "Command", "Done", "Event", "Snapshot", "Input", "Answer", "Arrival", "Request", "RobotModel", "Fidelity",
    "RobotGeneration", "Software", "Result", "Vector3", "Vector6", "CallProcedure", "ServeSignal", "ModbusSignal",
    "UnitAddress", "SignalType", "Machine", "OperationalMode",
}  # fmt: skip


def chain(node):
    """The names of `a.b().c[0].d`, from the left."""
    names = []
    while True:
        match node:
            case ast.Attribute(value, attr):
                names.append(attr)
                node = value
            case ast.Call(func):
                node = func
            case ast.Subscript(value):
                node = value
            case ast.Name(name):
                return [name, *names[::-1]]
            case _:
                return names[::-1]


class Reader:
    """What a module does to the machine."""

    def __init__(self, tree):
        self.calls, self.stores = [], []
        of_machine = {
            alias.asname or alias.name
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            and (node.module or "").startswith("ur_emulator.machine")
            and not node.module.startswith("ur_emulator.machine.commands")
            for alias in node.names
            if alias.name[0].isupper() and alias.name not in PLAIN
        }
        for scope in [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)] or [tree]:
            self._read(scope, of_machine)
        for node in tree.body:
            if isinstance(node, ast.FunctionDef):
                self._read(node, of_machine)

    def _read(self, scope, of_machine):
        known = {
            argument.arg
            for node in ast.walk(scope)
            if isinstance(node, ast.arg) and (argument := node).annotation is not None
            and {name.id for name in ast.walk(node.annotation) if isinstance(name, ast.Name)} & of_machine
        }  # fmt: skip
        assigned = [node for node in ast.walk(scope) if isinstance(node, ast.Assign)]
        for _ in range(3):  # what was taken out of what was taken out
            for node in assigned:
                for target in node.targets:
                    self._learn(known, target, node.value)
        for node in ast.walk(scope):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                if self._leads_in(known, chain(node.func)[:-1]):
                    self.calls.append(node.func)
            elif isinstance(node, ast.Assign | ast.AugAssign):
                for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                    for one in target.elts if isinstance(target, ast.Tuple) else [target]:
                        names = chain(one)
                        if isinstance(one, ast.Attribute | ast.Subscript) and self._leads_in(
                            known, names[:-1]
                        ):
                            self.stores.append(one)

    def _learn(self, known, target, value):
        pairs = [(target, value)]
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = zip(target.elts, value.elts, strict=False)
        for one, of in pairs:
            if isinstance(of, ast.Attribute | ast.Name) and self._leads_in(known, chain(of)):
                known.add(".".join(chain(one)))

    def _leads_in(self, known, names):
        return bool(ROOTS & set(names)) or any(".".join(names[:k]) in known for k in range(1, len(names) + 1))


@pytest.mark.parametrize(
    "path", sorted(HOST.rglob("*.py")), ids=lambda path: path.relative_to(HOST).as_posix()
)
def test_the_host_changes_the_machine_only_by_its_door(path):
    name = path.relative_to(HOST).as_posix()
    reader = Reader(ast.parse(path.read_text()))
    assert not [ast.unparse(store) for store in reader.stores if not ast.unparse(store).startswith("self.")]
    for call in reader.calls:
        if call.attr in DOOR:
            assert name in DOOR[call.attr], ast.unparse(call)
        else:
            assert call.attr in READS, ast.unparse(call)


@pytest.mark.parametrize(
    "text",
    [
        "def f(box):\n    box.controller.state.io.digital_out = 1",
        "def f(box):\n    state = box.controller.state\n    state.events.append(1)",
        "class A:\n    def __init__(self, box):\n        self._queue = box.controller.state.interpreter\n"
        "    def f(self):\n        self._queue.skip()",
        "from ur_emulator.machine.tools import Gripper\ndef f(gripper: Gripper):\n    gripper.stop()",
        "def f(box):\n    box.machine.controller.plant.reset(1)",
    ],
)
def test_the_guard_sees_what_changes_the_machine(text):
    reader = Reader(ast.parse(text))
    assert reader.stores or [call for call in reader.calls if call.attr not in READS]
