"""Global variables and labels of programs on port 30001."""

from dataclasses import replace

import pytest
from box_support import VERSION, Bench, MessageReader, connect

from protocol.frame_buffer import FrameBuffer
from protocol.primary.framing import MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE
from protocol.primary.messages import (
    KeyMessage,
    ProgramLabelMessage,
    ProgramThreadsMessage,
    TextMessage,
    ThreadLabel,
)
from protocol.primary.packages import RobotState, decode_package
from protocol.primary.values import (
    GlobalVariablesSetup,
    GlobalVariablesUpdate,
    TypedValue,
    ValueType,
    encode_value,
)
from protocol.ur_types import SoftwareVersion
from ur_emulator import ControlBox
from ur_emulator.budgets import BUDGETS
from ur_emulator.host.ports.primary import program_reports
from ur_emulator.host.ports.primary.port import PrimaryPort
from ur_emulator.host.ports.primary.program_reports import (
    MAX_BODY,
    MAX_THREADS,
    MAX_VALUE,
    LabelReporter,
    parse_label,
    size_of,
    typed_value,
)
from ur_emulator.host.ports.primary.robot_state import StateEncoder
from ur_emulator.machine.commands.programs import StopProgram
from ur_emulator.machine.models.generations import CB3
from urscript import Matrix, Pose, RunningProgram

FOREVER = "  while True:\n    sync()\n  end\nend\n"


class Client:
    """A connection that keeps what it is sent."""

    def __init__(self):
        self.sent = []

    def send(self, package):
        self.sent.append(package)

    def packages(self, version=VERSION):
        """What has come since the last call, without states and the greeting."""
        buffer = FrameBuffer(MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE)
        found = []
        for package in self.sent:
            buffer.feed(package)
            while (frame := buffer.next_frame()) is not None:
                found.append(decode_package(frame, version))
        self.sent.clear()
        wanted = (
            GlobalVariablesSetup,
            GlobalVariablesUpdate,
            ProgramThreadsMessage,
            ProgramLabelMessage,
            KeyMessage,
        )
        return [package for package in found if isinstance(package, wanted)]


class PortBench(Bench):
    """A bench with a primary port, published as a served box does."""

    def __init__(self, version=VERSION, *, all_messages=True):
        super().__init__(fidelity="exact")
        self.port = PrimaryPort(
            CB3.software(version),
            self.controller,
            None,
            StateEncoder(CB3.software(version), self.controller.state.arm, self.controller.state.safety),
            all_messages=all_messages,
        )

    def tick(self, n=1, *commands):
        for _ in range(n):
            n_before = len(self.events)
            super().tick(1, *commands)
            commands = ()
            for event in self.events[n_before:]:
                self.port.send_message(event)
            self.port.publish(self.now)
        return self.now

    def client(self):
        client = Client()
        self.port.opened(client)
        return client


@pytest.fixture
def bench():
    return PortBench()


@pytest.fixture
def client(bench):
    return bench.client()


def values_of(packages):
    """Index to value, as a client would know them."""
    known = {}
    for package in packages:
        if isinstance(package, GlobalVariablesUpdate):
            for i, value in enumerate(package.values, package.start_index):
                known[i] = value.value
    return known


def names_of(packages):
    names = {}
    for package in packages:
        if isinstance(package, GlobalVariablesSetup):
            names.update(enumerate(package.names, package.start_index))
    return names


def test_without_a_program_a_client_gets_the_empty_update(client, bench):
    assert [p.hex() for p in client.sent if p[4] == 25] == ["0000001019" + "ff" * 8 + "010000"]
    bench.tick(50)
    assert client.packages() == [GlobalVariablesUpdate()]


def test_names_once_and_values_when_they_change(client, bench):
    client.packages()
    bench.start(
        "def p():\n  global a = 1\n  global b = 2\n  local c = 3\n  d = 4\n  sleep(1)\n  b = 5\n" + FOREVER
    )
    bench.tick(20)
    started, names, first = client.packages()
    assert started.title == "PROGRAM_XXX_STARTED"
    assert names == GlobalVariablesSetup(timestamp=bench.snapshots[0].tick * 8000, names=("a", "b"))
    assert values_of([first]) == {0: 1, 1: 2}
    assert first.start_index == 0
    bench.tick(80)
    assert client.packages() == []
    bench.tick(50)
    (second,) = client.packages()
    assert (second.start_index, values_of([second])) == (1, {1: 5})
    bench.tick(100)
    assert client.packages() == []


def test_neighbours_share_a_package_and_others_do_not(client, bench):
    declarations = "".join(f"  global v{i} = 0\n" for i in range(6))
    bench.start(f"def p():\n{declarations}  sleep(0.4)\n  v0 = 1\n  v1 = 1\n  v3 = 1\n  v5 = 1\n" + FOREVER)
    bench.tick(30)
    client.packages()
    bench.tick(50)
    assert [(p.start_index, len(p.values)) for p in client.packages()] == [(0, 2), (3, 1), (5, 1)]


def test_the_last_values_come_before_the_program_is_reported_as_stopped(client, bench):
    bench.start("def p():\n  global n = 0\n  while n < 7:\n    n = n + 1\n  end\nend\n")
    bench.tick(2)
    *_, update, stopped = client.packages()
    assert values_of([update]) == {0: 7}
    assert stopped.title == "PROGRAM_XXX_STOPPED"
    bench.tick(50)
    assert client.packages() == []


def test_a_client_that_comes_later_gets_everything(bench):
    bench.start("def p():\n  global a = 1\n  global b = True\n  global c\n  sleep(2)\n  a = 2\n" + FOREVER)
    bench.tick(30)
    client = bench.client()
    names, update = client.packages()
    assert names_of([names]) == {0: "a", 1: "b", 2: "c"}
    assert [value.type for value in update.values] == [ValueType.INT, ValueType.BOOL, ValueType.NONE]
    bench.tick(30)
    second = bench.client()
    assert values_of(second.packages()) == {0: 1, 1: True, 2: None}
    bench.tick(250)
    assert values_of(client.packages()) == values_of(second.packages()) == {0: 2}
    bench.tick(1, StopProgram())
    third = bench.client()
    assert third.packages() == [GlobalVariablesUpdate()]


def test_programs_that_follow_each_other_within_a_cycle_are_distinguished(client, bench):
    client.packages()
    bench.start("def one():\n  global a = 1\n" + FOREVER)
    bench.start("def two():\n  global b = 2\n" + FOREVER)
    bench.tick(20)
    told = [(type(p).__name__, getattr(p, "text", None) or getattr(p, "names", None) or p.values[0].value)
            for p in client.packages()]  # fmt: skip
    assert told == [
        ("KeyMessage", "one"),
        ("GlobalVariablesSetup", ("a",)),
        ("GlobalVariablesUpdate", 1),
        ("KeyMessage", "one"),
        ("KeyMessage", "two"),
        ("GlobalVariablesSetup", ("b",)),
        ("GlobalVariablesUpdate", 2),
    ]


def test_while_nobody_listens_nobody_looks(monkeypatch):
    def look(*_):
        raise AssertionError("somebody looks at the variables")

    bench = PortBench()
    bench.start('def p():\n  $ 1 "Robot Program"\n  global a = 1\n' + FOREVER)
    monkeypatch.setattr("urscript.RunningProgram.read_global", look)
    monkeypatch.setattr(LabelReporter, "message", look)
    bench.tick(50)


VALUES = [
    ("None", ValueType.NONE, None),
    ("True", ValueType.BOOL, True),
    ("-5", ValueType.INT, -5),
    ("0.5", ValueType.FLOAT, 0.5),
    ('"a b"', ValueType.CONST_STRING, "a b"),
    ('str_cat("a", "b")', ValueType.CONST_STRING, "ab"),
    ("p[1,2,3,0.5,0.25,0]", ValueType.POSE, (1.0, 2.0, 3.0, 0.5, 0.25, 0.0)),
    ("run t()", ValueType.INT, 2),
]


@pytest.mark.parametrize("version", ["3.2.0", "3.15.8"])
def test_values_of_all_types(version):
    version = SoftwareVersion.parse(version)
    bench = PortBench(version)
    client = bench.client()
    declarations = "".join(f"  global x{i} = {text}\n" for i, (text, _, _) in enumerate(VALUES))
    bench.start(f"def p():\n  thread t():\n    sleep(9)\n  end\n{declarations}" + FOREVER)
    bench.tick(20)
    empty, found = [p for p in client.packages(version) if isinstance(p, GlobalVariablesUpdate)]
    assert empty.values == ()
    # What is None has not changed.
    assert (found.start_index, found.values) == (1, tuple(TypedValue(*row[1:]) for row in VALUES[1:]))


def test_lists_and_matrices():
    def integer(number):
        return TypedValue(ValueType.INT, number)

    assert typed_value([1, 2]) == TypedValue(ValueType.LIST, (integer(1), integer(2)))
    matrix = Matrix([[1, 2], [3, 4]])
    rows = ((integer(1), integer(2)), (integer(3), integer(4)))
    assert typed_value(matrix) == TypedValue(ValueType.MATRIX, rows)
    assert typed_value([Pose(1, 2, 3, 4, 5, 6)]).value[0].type is ValueType.POSE
    nested = [1]
    for _ in range(50):
        nested = [nested]
    value = typed_value(nested)
    depth = 0
    while value.type is ValueType.LIST:
        value, depth = value.value[0], depth + 1
    assert (value.type, depth) == (ValueType.NONE, 32)
    assert typed_value(object()).type is ValueType.NONE


def test_a_matrix_is_none_for_software_without_matrices():
    version = SoftwareVersion(3, 4)
    bench = PortBench(version)
    client = bench.client()
    bench.start("def p():\n  global m = [[1,2],[3,4]]\n  global n = 1\n" + FOREVER)
    bench.tick(20)
    assert values_of(client.packages(version)) == {1: 1}


def test_no_package_is_longer_than_clients_can_hold(client, bench):
    long_text = "x" * 700
    names = [f"a_variable_with_a_rather_long_name_{i}" for i in range(300)]
    text = "".join(f'  global {name} = "{long_text}"\n' for name in names)
    bench.start(f"def p():\n{text}" + FOREVER)
    bench.tick(20)
    sizes = [len(p) for p in client.sent if p[4] == 25]
    assert max(sizes) <= MAX_BODY + 20
    packages = client.packages()
    assert list(names_of(packages).values()) == names
    assert values_of(packages) == dict.fromkeys(range(300), long_text)


def test_a_value_too_large_for_a_client_goes_as_none(client, bench):
    bench.start(
        'def p():\n  global s = "abcdefghij"\n  while str_len(s) < 10000:\n    s = s + s\n  end\n  global n = 1\n'
        + FOREVER
    )
    bench.tick(20)
    assert max(len(p) for p in client.sent if p[4] == 25) < MAX_VALUE
    assert values_of(client.packages()) == {1: 1}


def test_thousands_of_variables_take_turns_and_all_come(client, bench):
    n = 3 * BUDGETS.variables_per_update + 7
    text = "".join(f"  global v{i} = {i}\n" for i in range(n))
    bench.start(f"def p():\n{text}" + FOREVER)
    bench.tick(14)
    assert 0 < len(values_of(client.packages())) <= BUDGETS.variables_per_update
    bench.tick(60)
    rest = values_of(client.packages())
    assert rest[n - 1] == n - 1
    assert len(rest) >= n - BUDGETS.variables_per_update


def large_values(n, length):
    """A program that gives `n` variables lists of `length` numbers, new ones every 10 cycles."""
    literal = "[" + "1, " * (length - 1) + "1]"
    text = "".join(f"  global v{i} = {literal}\n" for i in range(n))
    changes = "".join(f"    v{i} = v{i} + 1\n" for i in range(n))
    return f"def p():\n{text}  while True:\n{changes}    sleep(0.08)\n  end\nend\n"


def test_an_update_encodes_a_bounded_number_of_elements_and_all_take_turns(monkeypatch):
    encoded = []
    monkeypatch.setattr(
        program_reports.values,
        "encode_value",
        lambda value, version: encoded.append(value) or encode_value(value, version),
    )
    bench = PortBench()
    client = bench.client()
    bench.start(large_values(12, 400))
    most, known = 0, {}
    for _ in range(100):
        encoded.clear()
        bench.tick()
        most = max(most, sum(len(value.value) for value in encoded if value.type is ValueType.LIST))
        known |= values_of(client.packages())
    assert 0 < most < BUDGETS.variable_elements_per_update + 400
    assert set(known) == set(range(12))


def test_a_value_that_cannot_fit_is_not_encoded_at_all():
    many, text = [1] * 50_000, "x" * 60_000
    for value in (many, text, [text] * 3_000, Matrix([[1.0] * 300] * 300), [[1] * 3_000] * 3_000):
        size, elements = size_of(value, MAX_VALUE)
        assert size > MAX_VALUE
        assert elements <= MAX_VALUE or isinstance(value, Matrix)
    assert size_of([1, 2.5, True, "abc"], MAX_VALUE) == (4 + 1 + 1 + 1 + 6, 5)


def test_all_values_of_a_program_have_a_limit_together(monkeypatch):
    monkeypatch.setattr(program_reports, "BUDGETS", replace(BUDGETS, variable_bytes=3_000))
    bench = PortBench()
    client = bench.client()
    bench.start(large_values(4, 400))
    bench.tick(40)
    known = values_of(client.packages())
    assert [i for i, value in known.items() if value is not None] == [0]


def test_the_names_of_a_program_have_a_limit_together(client, bench):
    names = [f"v{i}".ljust(255, "_") for i in range(300)]
    bench.start("def p():\n" + "".join(f"  global {name} = 1\n" for name in names) + FOREVER)
    bench.tick(20)
    packages = client.packages()
    assert list(names_of(packages).values()) == names[: BUDGETS.variable_name_bytes // 256]
    assert len(values_of(packages)) == BUDGETS.variable_name_bytes // 256


@pytest.fixture
def encoded(monkeypatch):
    """The indices of the first names or values of packages that were encoded."""
    starts = {"encode_names": [], "encode_values": []}
    for name, found in starts.items():
        encode = getattr(program_reports.values, name)

        def count(timestamp, start, items, *, encode=encode, found=found):
            found.append(start)
            return encode(timestamp, start, items)

        monkeypatch.setattr(program_reports.values, name, count)
    return starts


def test_clients_that_come_in_one_cycle_get_what_is_encoded_once(bench, encoded):
    declarations = "".join(f"  global variable_{i} = {i}\n" for i in range(400))
    bench.start(f"def p():\n{declarations}" + FOREVER)
    bench.tick(20)
    clients = [bench.client() for _ in range(5)]
    n_packages = len(encoded["encode_names"])
    assert n_packages == len(set(encoded["encode_names"])) > 1
    told = [client.packages() for client in clients]
    assert told[0] == told[-1]
    assert values_of(told[0]) == dict(enumerate(range(400)))
    bench.tick()
    bench.client()
    assert len(encoded["encode_names"]) == 2 * n_packages


def test_clients_that_come_and_go_do_not_make_the_values_be_read_more_often(monkeypatch):
    looked = []
    read = RunningProgram.read_global
    monkeypatch.setattr(
        RunningProgram, "read_global", lambda run, name: looked.append(name) or read(run, name)
    )
    bench = PortBench()
    bench.start("def p():\n  global n = 0\n  while True:\n    n = n + 1\n    sync()\n  end\nend\n")
    seen = []
    for _ in range(50):  # 0.4 s
        bench.tick()
        client = bench.client()
        seen.append(values_of(client.packages())[0])
        bench.port.closed(client)
    assert len(looked) == 4
    assert sorted(set(seen)) == [2, 15, 28, 41]


def test_what_a_program_held_is_given_back_at_its_end_also_when_nobody_listens(bench):
    bench.start("def p():\n  global x = [1, 2, 3]\n" + FOREVER)
    bench.tick(3)
    bench.port.closed(bench.client())
    assert bench.port._variables._seen == [[1, 2, 3]]
    bench.tick(1, StopProgram())
    assert bench.port._variables._seen == []


# --- labels


def test_long_labels_of_many_threads_stay_within_a_package(client, bench):
    label = f'    $ 1 "{"x" * 1_000}"\n'
    runs = "  run t()\n" * 100
    bench.start(f"def p():\n  thread t():\n{label}    sleep(9)\n  end\n{runs}" + FOREVER)
    bench.tick(3)
    assert max(map(len, client.sent)) <= 4096
    assert [len(p.threads) for p in client.packages() if isinstance(p, ProgramThreadsMessage)] == [
        MAX_THREADS
    ]


LABELLED = (
    'def p():\n  thread t():\n    $ 9 "Thread 1" "noBreak"\n    sleep(0.1)\n    $ 10 "Wait: 0.1"\n    sleep(9)\n  end\n  run t()\n'
    '  $ 1 "Robot Program"\n  $ 2 "MoveJ" "breakAfter"\n  sleep(0.2)\n  $ 3 "Wayp\xc3\xb6int"\n' + FOREVER
)


def test_labels_of_all_threads(client, bench):
    bench.start(LABELLED)
    bench.tick(60)
    told = [p.threads for p in client.packages() if isinstance(p, ProgramThreadsMessage)]
    main, other = [(2, "MoveJ"), (3, "Wayp\xc3\xb6int")], [(9, "Thread 1"), (10, "Wait: 0.1")]
    assert [[(t.label_id, t.text, t.thread_name) for t in threads] for threads in told] == [
        [(*main[0], "p"), (*other[0], "t")],
        [(*main[0], "p"), (*other[1], "t")],
        [(*main[1], "p"), (*other[1], "t")],
    ]


def test_labels_of_software_up_to_3_2():
    version = SoftwareVersion(3, 2)
    bench = PortBench(version)
    client = bench.client()
    bench.start(LABELLED)
    bench.tick(60)
    told = [(p.label_id, p.text) for p in client.packages(version) if isinstance(p, ProgramLabelMessage)]
    assert told == [(2, "MoveJ"), (3, "Wayp\xc3\xb6int")]


def test_a_program_without_labels_is_not_watched(bench):
    bench.client()
    bench.start("def p():\n" + FOREVER)
    assert bench.port._labels._run is None
    bench.start(LABELLED)
    assert bench.port._labels._run is not None
    bench.tick(1, StopProgram())
    assert bench.port._labels._run is None


@pytest.mark.parametrize(
    ("line", "label"),
    [
        (' 12 "Move"', (12, "Move")),
        (' 12 "Move" "breakAfter"', (12, "Move")),
        ('3"a"', (3, "a")),
        (' -1 ""', (-1, "")),
        (" 12", None),
        (' "Move"', None),
        ("", None),
        (' 99999999999999999999 "x"', None),
    ],
)
def test_lines_of_labels(line, label):
    assert parse_label(line) == label


def test_on_the_wire():
    with ControlBox(in_process=True, pace="lockstep", port_base=None) as box, connect(box, "primary") as sock:
        reader = MessageReader(sock)
        sock.sendall(
            b'def p():\n  $ 1 "Robot Program"\n  global speed = 0.5\n  speed = speed * 2\n  textmsg("done")\n  sleep(0.5)\nend\n'
        )
        assert reader.message(GlobalVariablesSetup).names == ("speed",)
        assert reader.message(TextMessage).text == "done"
        assert reader.message(ProgramThreadsMessage).threads == (
            ThreadLabel(label_id=1, text="Robot Program", thread_name="p"),
        )
        assert reader.message(GlobalVariablesUpdate).values == (TypedValue(ValueType.FLOAT, 1.0),)
        assert isinstance(reader.message(RobotState), RobotState)
