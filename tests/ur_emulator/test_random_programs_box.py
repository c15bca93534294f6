"""Whatever a program does, and whatever a builtin is given, the box ticks on and the arm keeps to its limits.

`RANDOM_PROGRAMS=20000 pytest tests/ur_emulator/test_random_programs_box.py` tries that many of each.
"""

import math
import os
import threading

from driver_program import PROGRAMS, driver_text
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from program_support import Box, frames

from protocol.ur_types import RobotMode, SafetyMode
from ur_emulator.machine.commands.programs import StopProgram
from ur_emulator.machine.commands.safety import UnlockProtectiveStop
from urscript.catalogue import CB3_3_15

HOME = "[0.0, -1.57, 0.0, -1.57, 0.0, 0.0]"


def text_of(form, *parts):
    return st.tuples(*parts).map(lambda values: form.format(*values))


def joined(items, low, high):
    return st.lists(items, min_size=low, max_size=high).map(", ".join)


# A minus sign binds tighter in a call than anywhere else, so numbers below zero are written like all others.
whole = st.integers(-(2**31), 2**31 - 1).map(lambda n: str(n) if n > -(2**31) else "(-2147483647 - 1)")
small = st.integers(-2, 40).map(str)
real = st.one_of(
    st.floats(-2.0, 2.0).map(repr),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.sampled_from(['to_num("nan")', 'to_num("inf")', 'to_num("-inf")', "1e308", "-0.0", "5e-324"]),
)
numbers = small | real | whole
ordinary = st.one_of(st.floats(-3.0, 3.0).map(lambda x: f"{x:.4f}"), small)
strings = st.one_of(
    st.sampled_from(["", "a", "socket_0", "default", "freedrive", "pause", "input_int_register_0", "xmlrpc"]),
    st.sampled_from(["http://127.0.0.1:1", "127.0.0.1", "not a host!", "\xff\x00", "%s{}", "1e400", "0x7"]),
    st.text(st.characters(max_codepoint=255, exclude_characters='"\n'), max_size=8),
).map(lambda text: f'"{text}"')
joints = st.one_of(
    st.just(HOME),
    st.lists(st.floats(-0.3, 0.3), min_size=6, max_size=6).map(
        lambda d: str([round(a + b, 4) for a, b in zip([0, -1.57, 0, -1.57, 0, 0], d, strict=True)])
    ),
    joined(ordinary, 6, 6).map("[{}]".format),
    joined(numbers, 0, 7).map("[{}]".format),
)
poses = st.one_of(
    text_of("p[{}]", joined(ordinary, 6, 6)),
    st.sampled_from(["p[0.25, -0.25, 0.2, 2.2, -2.2, 0]", "p[0, 0, 0.05, 0, 0, 0]", "get_target_tcp_pose()"]),
    text_of("p[{}]", joined(numbers, 6, 6)),
)
others = st.one_of(
    st.sampled_from(["True", "False", "None", "run side()", '["a", "b"]', "[True, False]", "[]", "[[1, 2], [3, 4]]"]),
    joined(numbers, 2, 4).map("[[{0}], [{0}]]".format),
    joined(numbers, 0, 4).map("[{}]".format),
)  # fmt: skip
values = st.one_of(numbers, ordinary, strings, joints, poses, others)
_BY_TYPE = {
    "BOOL": st.sampled_from(["True", "False"]),
    "INT": small,
    "NUMBER": ordinary,
    "STRING": strings,
    "POSE": poses,
    "JOINTS": joints,
    "POSE_OR_JOINTS": poses | joints,
    "VECTOR3": joined(ordinary, 3, 3).map("[{}]".format),
    "VECTOR6": joints | poses,
    "LIST": joints,
    "NUMBERS": joints,
}
ROWS = sorted((row for row in CB3_3_15), key=lambda row: row.name)


@st.composite
def _argument(draw, parameter):
    """Most often of the type and in the range that is asked for."""
    whim = draw(st.integers(0, 9))
    if whim == 0:
        return draw(values)
    if parameter.choices and whim > 2:
        return repr(draw(st.sampled_from(sorted(parameter.choices)))).replace("'", '"')
    if parameter.type.name in ("INT", "NUMBER") and whim > 2:
        low = -3 if parameter.low is None else parameter.low
        high = low + 8 if parameter.high is None else parameter.high
        return str(draw(st.integers(int(low), int(high)))) if whim % 2 else repr(draw(st.floats(low, high)))
    return draw(_BY_TYPE.get(parameter.type.name, values))


@st.composite
def calls(draw, module=""):
    """A call of a builtin of a module: as many arguments as it takes, the last ones perhaps by name or left out."""
    row = draw(st.sampled_from([row for row in ROWS if row.module.startswith(module)]))
    required = sum(parameter.is_required for parameter in row.params)
    count = draw(st.integers(required, len(row.params)))
    named_from = draw(st.integers(0, count))
    given = [draw(_argument(parameter)) for parameter in row.params[:count]]
    named = [
        f"{parameter.name}={text}"
        for parameter, text in zip(row.params[named_from:count], given[named_from:], strict=True)
    ]
    return f"{row.name}({', '.join([*given[:named_from], *named])})"


EXAMPLES = int(os.environ.get("RANDOM_PROGRAMS", "15"))
some = settings(max_examples=EXAMPLES, suppress_health_check=list(HealthCheck), print_blob=True)
TOLERANCE = 1.001


def peer(unread):
    """Answers everything with a bit of everything."""
    return len(unread), b"(1.5,2,-3)\r\nack 12\n" + bytes(8) if unread else b""


class Server:
    """Has any method, and returns its arguments."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *arguments: list(arguments) if len(arguments) != 1 else arguments[0]


class WatchedBox(Box):
    """A box that checks every cycle that the arm and what is published of it stay within reason."""

    def __init__(self):
        super().__init__(
            peers={30001: frames(b"(1,2)"), 63352: peer, 1: None},
            servers={"http://a": Server()},
            fidelity="ideal",
        )
        self.robot = self.controller.state.robot

    def tick(self, n=1, *commands):
        for _ in range(n):
            before = self.now
            super().tick(1, *commands)
            commands = ()
            self._check(before, self.now)
            del self.snapshots[:-2]
        return self.now

    def _check(self, before, now):
        for vector in (now.target_q, now.target_qd, now.actual_q, now.actual_qd, now.actual_tcp_pose):
            assert all(map(math.isfinite, vector)), vector
        limits = zip(
            now.target_q,
            before.target_q,
            self.robot.qd_safety,
            self.robot.q_min,
            self.robot.q_max,
            strict=True,
        )
        for q, q_before, speed, low, high in limits:
            assert low <= q <= high
            if not self._placed(before, now):
                assert abs(q - q_before) <= speed * 0.008 * TOLERANCE + 1e-12
        for qd, speed in zip(now.target_qd, self.robot.qd_safety, strict=True):
            assert abs(qd) <= speed * TOLERANCE

    def _placed(self, before, now):
        """Whether the set-point may have jumped: the arm was placed, or is held or guided where it is."""
        return self.placing or RobotMode.RUNNING not in (before.robot_mode, now.robot_mode)

    placing = False

    def leave(self):
        """Stop what runs; nothing of it may stay."""
        state = self.controller.state
        self.tick(1, StopProgram())
        self.finish(limit=3000)
        assert not self.controller.programs.is_running
        assert state.motion.owner is None
        assert not any(sock.is_open for sock in self.network.sockets)
        assert not [text for text in self.failures if "internal error" in text], self.failures
        assert not [error for error in self.compile_errors if "internal" in error.message]

    def send_text(self, text):
        self.send(text.encode("latin-1", "replace") + b"\n")


def run_and_leave(text, cycles=60):
    """Run a text as programs for some cycles, whatever they are."""
    system_threads = threading.active_count()
    box = WatchedBox()
    box.placing = "set_pos" in text or "freedrive" in text or "teach_mode" in text
    box.send_text(text)
    box.tick(cycles)
    if box.now.safety_mode != SafetyMode.NORMAL:
        box.tick(1, UnlockProtectiveStop())
    box.leave()
    assert threading.active_count() == system_threads
    return box


# --- programs ----------------------------------------------------------------------------------------------

lines = st.one_of(
    calls(module="motion"),
    calls(),
    text_of("{} = {}", st.sampled_from(["x", "x1", "x2", "x3"]), values),
    text_of("y[{}] = {}", st.integers(-1, 7), values),
    text_of("global {} = {}", st.sampled_from(["z", "z1", "z2"]), calls()),
    text_of("kill {}", st.sampled_from(["h", "g[0]", "run mover()", "0", "x"])),
    text_of("join {}", st.sampled_from(["h", "g[1]", "0", "run watcher()"])),
    st.sampled_from(["sync()", "sleep(0.02)", "h = run mover()", "g[0] = run watcher()", "halt"]),
    st.sampled_from(["enter_critical", "exit_critical", "g[1] = run side()", f"movej({HOME})", "return x"]),
)
blocks = st.recursive(
    lines,
    lambda inner: st.one_of(
        text_of("{}\n{}", inner, inner),
        text_of("{}\n{}\n{}", inner, inner, inner),
        text_of("while True:\n{}\nsync()\nend", inner),
        text_of("while True:\n{}\nend", inner),
        text_of("enter_critical\n{}\nexit_critical", inner),
        text_of("if x == {}:\n{}\nelse:\n{}\nend", values, inner, inner),
    ),
    max_leaves=5,
)


@some
@given(blocks, blocks, blocks, st.integers(1, 120), st.sampled_from(["def", "sec"]))
def test_random_programs_with_threads_and_moves_leave_the_box_as_it_was(body, mover, watcher, cycles, kind):
    text = (
        f"{kind} p():\nx = None x1 = None x2 = None x3 = None z = None z1 = None z2 = None\n"
        f"y = [0, 0, 0, 0, 0, 0]\nh = 0\ng = [0, 0]\n"
        f"thread side():\nsync()\nend\nthread mover():\n{mover}\nend\nthread watcher():\n{watcher}\nend\n"
        f"{body}\nend\n"
    )
    run_and_leave(text, cycles)


# --- mutated programs --------------------------------------------------------------------------------------

ORIGINALS = [path.read_bytes() for path in sorted(PROGRAMS.glob("*.script"))] + [driver_text(3).encode()]
PIECES = [
    b"end\n",
    b"\ndef f():\n",
    b"[",
    b")",
    b'"',
    b"=",
    b" 1e308 ",
    b" None ",
    b"kill ",
    b"#",
    b"\n",
    b"-",
    b"\xff",
]


@st.composite
def mutated(draw):
    """A program of ours with a few pieces cut out, doubled, swapped or put in."""
    text = draw(st.sampled_from(ORIGINALS))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 60)))
        piece = draw(st.sampled_from([b"", text[start:end] * 2, *PIECES]))
        text = text[:start] + piece + text[end:]
    return text


@some
@given(mutated())
def test_mutated_programs_run_or_are_refused(text):
    box = run_and_leave(text.decode("latin-1"), 40)
    for error in box.compile_errors:
        assert error.line >= 1
        assert error.column >= 1
        assert error.wire_text
