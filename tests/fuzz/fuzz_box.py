"""A whole box in memory under fire: hostile clients at every port, honest ones beside them, checks after each step.

A step is something that one hostile client does, a turn of the loop, a cycle, or a heartbeat without one.
"""

import itertools
import math
import time
from collections import Counter, deque
from functools import lru_cache
from types import SimpleNamespace

from box_support import FakeNetwork
from fuzz_corpus import MESSAGES
from fuzz_mutations import mutate_bytes
from fuzz_replies import READERS
from fuzz_wire import FakeLoop, Wire
from states_support import check_wires

from protocol.dashboard.connection import MAX_LINE as DASHBOARD_LINE
from protocol.dashboard.connection import MAX_WAITING
from protocol.rtde.client_connection import DataReceived, RtdeClientConnection
from protocol.rtde.messages import RequestProtocolVersion, SetupOutputs, Start
from protocol.rtde.server_connection import MAX_REQUEST_SIZE
from protocol.script_channel import MAX_LINE, MAX_PROGRAM
from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator import ControlBox
from ur_emulator.budgets import BUDGETS
from ur_emulator.commands.power import PowerOn, ReleaseBrakes
from ur_emulator.commands.programs import StartProgram, StopProgram
from ur_emulator.commands.push import AttachPayload, Push
from ur_emulator.commands.safety import (
    AssignSafetyInput,
    ConfirmSafety,
    PressButton,
    ReleaseEmergencyStop,
    RequireSafeguardReset,
    RestartSafety,
    SafeguardStop,
    UnlockProtectiveStop,
)
from ur_emulator.controller.safety.inputs import N_INPUT_PAIRS
from ur_emulator.programs.compiling import compile_text
from ur_emulator.servers.modbus.server import MAX_INBOX
from ur_emulator.servers.rtde_port import MAX_WAITING as MAX_RTDE_WAITING
from urscript import compile_program

# Hostile clients of one port at a time.
MAX_HOSTILE = 5
_PERIOD = 0.008  # s
# How far an arm at rest may give way when brakes close and open or a stop brakes it [rad].
_GIVES_WAY = 0.02
# Cycles in which an honest question has to be answered.
_PATIENCE = 200
# Looks at a box that does not work until it is repaired.
_OUT_OF_WORK = 15
SIGN_OF_LIFE = compile_program("def alive():\n  sync()\nend\n")
# Cycles in which all that a client may have waiting is answered: dashboard lines that take one each, and
# `wait_until` with its longest time.
_LONGEST_QUEUE = 10_000
_CHECK_EVERY = 40  # cycles between the slower checks
ASK_MODBUS = bytes.fromhex("000700000006010301020001")  # register 258, robot mode
ASK_HTTP = b"GET /v1/state HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"


class _AtOnce:
    """A queue whose tasks are done in this process, in the next turn of the loop."""

    def __init__(self, loop):
        self.loop = loop
        # Most of the time would go into compiling the same programs again and again.
        self.compile_text = lru_cache(maxsize=300)(compile_text)

    def submit(self, done, failed, function, *arguments):
        def work():
            try:
                result = (self.compile_text if function is compile_text else function)(*arguments)
            except Exception as error:
                done(None, error)
            else:
                done(result, None)

        self.loop.call_soon_threadsafe(work, failed)

    def drop(self, task):
        pass

    def close(self):
        pass


class _Pacer:
    """Lets a cycle pass when the test says so."""

    ticks = True
    publish_at = 0.0

    def may_tick(self, now, situation):
        return self.ticks

    def next_call(self, now):
        return now + _PERIOD


class RtdeWitness:
    """An honest RTDE client: every value comes, every cycle."""

    def __init__(self, wire):
        self.protocol, self.n_packages = RtdeClientConnection(), 0
        self.wire = wire
        for request in (RequestProtocolVersion(2), SetupOutputs(("timestamp", "robot_mode"), 125.0), Start()):
            wire.send(self.protocol.send(request))
            wire.loop.turn()
            self.feed(wire.take())

    def feed(self, data):
        self.protocol.receive_data(data)
        while (event := self.protocol.next_event()) is not None:
            self.n_packages += isinstance(event, DataReceived)


class FuzzBox:
    """The box, its clients, and what is known of them.

    Attributes:
        cases: pieces, ends and resets that arrived, by port.
        trail: the last steps, for the report of a failure.
    """

    def __init__(self, rng, folder, *, lively, cycle_share=0.1):
        """Make a box.

        Args:
            rng: decides everything.
            folder: of program files.
            lively: programs may move the arm; False: nothing that is sent may.
            cycle_share: how many of the steps are cycles; these cost the time.
        """
        self.rng, self.lively, self.cycle_share = rng, lively, cycle_share
        self.cases, self.trail = Counter(), deque(maxlen=300)
        self.now = 0.0
        self.box = box = ControlBox(
            pace="lockstep", port_base=None, seed=rng.randrange(100), programs=folder, control_port=0
        )
        box._loop._wake = lambda: None
        box._intake._tasks = box._loop.tasks = _AtOnce(box._loop)
        box.on_end = lambda: None
        self.served, self.pacer = box._box, _Pacer()
        self.served._pacer = self.pacer
        self.served._on_failure = _raise
        self.served.report = lambda what, error: _raise(error)
        self.controller = self.served.controller
        self.controller.programs._network = FakeNetwork()
        self.ports = box._port_set._ports
        box._operations._context.clock = lambda: self.now
        self.loop = FakeLoop()
        self.numbers = itertools.count(50_000)
        self.hostile = {name: {} for name in self.ports}
        self.sent_lines = Counter()
        self.n_published = self.n_out_of_work = self.n_repairs = 0
        self.witnesses = {name: self._connect(name) for name in self.ports}
        self.readers = {name: READERS[name]() for name in self.ports}
        for name in ("primary", "primary_ro", "secondary", "secondary_ro"):
            self.readers[name].feed(self.witnesses[name].take())
        self.readers["rtde"] = RtdeWitness(self.witnesses["rtde"])
        self.asked_at = {}
        self.rest = self.controller.snapshot.target_q

    def _connect(self, name):
        return Wire(self.loop, self.ports[name], self.served.backlog, next(self.numbers))

    def join(self, name):
        """Add a hostile client of a port; return it and the reader of what it gets."""
        wire = self._connect(name)
        reader = self.hostile[name][wire] = READERS[name]()
        return wire, reader

    def close(self):
        for wires in self.hostile.values():
            for wire in tuple(wires):
                wire.connection.close()
        self.box.close()

    # --- steps

    def step(self):
        """Let something happen."""
        kind = self.rng.random()
        if kind < self.cycle_share:
            self.cycle()
            works = self.controller.snapshot.robot_mode == RobotMode.RUNNING
            self.n_out_of_work = 0 if works else self.n_out_of_work + 1
            if self.n_out_of_work > _OUT_OF_WORK:
                self.repair()
        elif kind < 1.1 * self.cycle_share:
            self.heartbeat()
        else:
            self.attack(self.rng.choice(tuple(self.ports)))

    def attack(self, name):
        """Let a client of a port do something."""
        rng, wires = self.rng, self.hostile[name]
        if not wires or (len(wires) < MAX_HOSTILE and rng.random() < 0.1):
            wire, _ = self.join(name)
            self._did(name, "open", wire)
            return
        wire = rng.choice(tuple(wires))
        kind = rng.random()
        if kind < 0.91:
            data = MESSAGES[name](rng, self.lively)
            if rng.random() < 0.55:
                others = rng.choice(tuple(MESSAGES))
                data = mutate_bytes(rng, data, lambda: MESSAGES[others](rng, self.lively))
            self.send(name, wire, data)
        elif kind < 0.93:
            wire.sock.room = rng.choice((0, 1, 100, 5000))
            self.trail.append((name, wire.sock.number, "reads little", wire.sock.room))
        elif kind < 0.96:
            wire.sock.room = None
        elif kind < 0.98:
            wire.end()
            self._did(name, "end", wire)
        else:
            wire.reset()
            self._did(name, "reset", wire)

    def send(self, name, wire, data):
        """Send in one piece, at one cut, or byte by byte."""
        how = self.rng.random()
        if how < 0.6 or len(data) < 2:
            pieces = [data]
        elif how < 0.95 or len(data) > 80:
            at = self.rng.randrange(1, len(data))
            pieces = [data[:at], data[at:]]
        else:
            pieces = [data[i : i + 1] for i in range(len(data))]
        for piece in pieces:
            if not piece or not wire.is_open or wire.connection.has_ended:
                return
            wire.send(piece)
            self._did(name, piece, wire)

    def _did(self, name, what, wire):
        self.trail.append((name, wire.sock.number, what))
        self.cases[name] += 1
        self.turn()

    def turn(self):
        """A turn of the loop."""
        self.loop.turn()
        calls = self.box._loop._calls
        while calls:
            calls.popleft()()

    def cycle(self):
        """A control cycle, or several, and a look at everything."""
        for _ in range(self.rng.choice((1, 1, 1, 1, 1, 12))):
            self._advance(ticks=True)
        self._look()

    def repair(self):
        """Do what an operator does until the arm works again, and let a program run."""
        self.n_out_of_work = 0
        self.n_repairs += 1
        for name in (
            "dashboard",
            "control",
            "modbus",
        ):  # a thousand lines that wait to be obeyed are not over yet
            for wire in self.hostile[name]:
                wire.reset()
        self.turn()
        commands = [
            *(AssignSafetyInput(pair, "none") for pair in range(N_INPUT_PAIRS)),
            RequireSafeguardReset(False),
            PressButton("teach", False),
            ReleaseEmergencyStop(),
            SafeguardStop(False),
            StopProgram(),
            Push((0.0, 0.0, 0.0)),
            AttachPayload(0.0, (0.0, 0.0, 0.0)),
        ]
        self._order(20, *commands)
        if self.controller.snapshot.safety_mode == SafetyMode.PROTECTIVE_STOP:
            self._order(640)
            self._order(20, UnlockProtectiveStop())
        if self.controller.snapshot.safety_mode in (SafetyMode.VIOLATION, SafetyMode.FAULT):
            self._order(200, RestartSafety())
        self._order(20, ConfirmSafety())
        self._order(300, PowerOn())
        self._order(100, ReleaseBrakes())
        if not self.lively:  # a moved arm may stand where it cannot work
            now = self.controller.snapshot
            assert now.robot_mode == RobotMode.RUNNING, (
                f"it cannot be repaired: {RobotMode(now.robot_mode).name}, {SafetyMode(now.safety_mode).name}, "
                f"{[entry.text for entry in self.served.log.entries[-8:]]}"
            )
            self._order(1, StartProgram(SIGN_OF_LIFE))
            assert self.controller.programs.latest.program is SIGN_OF_LIFE, "no program starts any more"

    def _order(self, n_cycles, *commands):
        for command in commands:
            self.trail.append(("order", command))
            self.served.submit(command)
        for _ in range(n_cycles):
            self._advance(ticks=True)
        self._look()

    def heartbeat(self):
        """Time stands still; the ports repeat themselves."""
        self._advance(ticks=False)

    def _advance(self, ticks):
        self.trail.append(("cycle" if ticks else "heartbeat",))
        self.pacer.ticks = ticks
        self.now += _PERIOD + 1e-6
        self.served.advance(self.now)
        self.n_published += 1
        self.turn()

    # --- checks

    def _look(self):
        self._check_streams()
        self._check_arm()
        tick = self.controller.snapshot.tick
        if tick % _CHECK_EVERY < 5:
            self._ask()
            self._check_memory()
            self._check_modes()
        self._check_answers()

    def _check_streams(self):
        """Honest clients have missed nothing; what the others get is well-formed as far as they read it."""
        for name, wire in self.witnesses.items():
            assert wire.is_open, f"the honest client of {name} was cut off"
            assert not wire.connection.dropped, f"the honest client of {name} lost something"
            self.readers[name].feed(wire.take())
        for name in ("realtime", "realtime_ro"):
            self.readers[name].finish()
            assert self.readers[name].n_frames == self.n_published, name
        assert self.readers["rtde"].n_packages == self.n_published, "RTDE packages are missing"
        for name in ("primary", "primary_ro", "secondary", "secondary_ro"):
            reader = self.readers[name]
            reader.finish()
            assert reader.n_states == self.n_published * 10 // 125 + 1, (name, reader.n_states)
        for wires in self.hostile.values():
            for wire, reader in tuple(wires.items()):
                reader.feed(wire.take())
                if not wire.is_open:
                    assert wire.n_closed == 1
                    assert wire.sock not in self.loop.watched
                    del wires[wire]

    def _check_arm(self):
        snapshot = self.controller.snapshot
        for values in (snapshot.target_q, snapshot.target_qd, snapshot.actual_q, snapshot.actual_qd):
            assert all(map(math.isfinite, values)), "the arm is nowhere"
        if not self.lively:
            for values in (snapshot.target_q, snapshot.actual_q):
                away = max(abs(a - b) for a, b in zip(values, self.rest, strict=True))
                assert away < _GIVES_WAY, f"the arm moved by {away} rad"
        elif snapshot.robot_mode != RobotMode.RUNNING:
            assert not any(snapshot.target_qd), "an arm without power is told to move"

    def _ask(self):
        questions = {"dashboard": b"robotmode\n", "modbus": ASK_MODBUS, "control": ASK_HTTP}
        for name, question in questions.items():
            if name not in self.asked_at:
                self.asked_at[name] = self.n_published
                self.witnesses[name].send(question)

    def _check_answers(self):
        answered = {
            "dashboard": self.readers["dashboard"].lines,
            "modbus": self.readers["modbus"].answers,
            "control": self.readers["control"].answers,
        }
        for name, answers in answered.items():
            if name not in self.asked_at:
                continue
            if not answers:
                waited = self.n_published - self.asked_at[name]
                assert waited < _PATIENCE, f"{name} has not answered for {waited} cycles"
                continue
            answer = answers.pop()
            if name == "dashboard":
                RobotMode[answer.removeprefix("Robotmode: ")]
            elif name == "modbus":
                assert answer.pdu[:2] == b"\3\2", answer
                RobotMode(int.from_bytes(answer.pdu[2:], "big", signed=True))
            else:
                assert answer[0] == 200, answer
            del self.asked_at[name]

    def _check_modes(self):
        """All ports say the same, and it makes sense."""
        snapshot = self.controller.snapshot
        check_wires(SimpleNamespace(controller=self.controller, now=snapshot))
        RobotMode(snapshot.robot_mode), SafetyMode(snapshot.safety_mode), ProgramState(snapshot.runtime_state)
        assert 0.0 <= snapshot.speed_scaling <= 1.0

    def _check_memory(self):
        """What a client can make the box keep is bounded."""
        for name, port in self.ports.items():
            known = _known_clients(port)
            assert known == {
                wire.connection for wire in (*self.hostile[name], self.witnesses[name]) if wire.is_open
            }
            for connection in known:
                assert len(connection._outbox) <= BUDGETS.outbox_bytes + 4096, name
        assert all(connection.is_open for connection in self.served.backlog)
        for session in self.ports["rtde"]._sessions.values():
            assert session.is_lost or len(session.protocol._buffer) <= 2 * MAX_REQUEST_SIZE
            assert len(session.inbox) <= MAX_RTDE_WAITING
            assert len(session.protocol.input_recipes) <= 255
        assert set(self.ports["rtde"]._owners.values()) <= _known_clients(self.ports["rtde"])
        for session in self.ports["modbus"]._sessions.values():
            assert len(session.inbox) <= MAX_INBOX
        for session in self.ports["dashboard"]._sessions.values():
            assert session.lines._waiting <= MAX_WAITING
            assert len(session.lines._buffer) <= DASHBOARD_LINE
        assert len(self.box._access.steps._under_way) < 500
        for name in ("primary", "secondary", "realtime"):
            for channel in self.ports[name]._channels.values():
                assert channel.pending <= MAX_LINE + MAX_PROGRAM
        for name in ("primary_ro", "secondary_ro", "realtime_ro"):
            assert not any(channel.pending for channel in self.ports[name]._channels.values())
        assert not self.box._intake._waiting
        for session in self.ports["control"]._sessions.values():
            assert len(session._body) <= 1 << 20
        assert len(self.controller.state.operator.requests) <= 1000

    def settle(self):
        """All hostile clients go; nothing of them stays."""
        for wires in self.hostile.values():
            for wire in wires:
                wire.reset()
        self.turn()
        for _ in range(300):
            self._advance(ticks=True)
        self._look()
        self._ask()
        for _ in range(20):
            self._advance(ticks=True)
            self._look()
        # One that ended before it was reset is heard of again when all that it asked for is answered.
        for _ in range(_LONGEST_QUEUE):
            if not any(wire.is_open for wires in self.hostile.values() for wire in wires):
                break
            self._advance(ticks=True)
        self._look()
        assert not any(self.hostile.values()), "a client that is gone is not forgotten"
        assert len(self.loop.watched) == len(self.ports)  # those of the honest clients


def run(rng, folder, n_cases, **options):
    """Fuzz one box; return the cases by port. An error has the last steps as a note."""
    fuzz = FuzzBox(rng, folder, **options)
    try:
        while fuzz.cases.total() < n_cases:
            started = time.perf_counter()
            fuzz.step()
            if (took := time.perf_counter() - started) > 20:
                raise AssertionError(f"a step took {took:.0f} s")
        fuzz.settle()
    except BaseException as error:
        lines = [repr(step)[:2000] for step in tuple(fuzz.trail)[-40:]]
        error.add_note(f"{options} cases={fuzz.cases.total()}; last steps:\n" + "\n".join(lines))
        raise
    finally:
        fuzz.close()
    return fuzz.cases


def _known_clients(port):
    return set(port._sessions if hasattr(port, "_sessions") else port._channels)


def _raise(error):
    raise error
