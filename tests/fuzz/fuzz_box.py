"""A whole box under fire: hostile clients at every port, honest ones beside them, checks after each step.

Loop, worker process and sockets are real, but everything waits for everything: the loop takes one turn at a time, a
cycle passes when the test says so, and what the worker process has to do is done before the next step. So the same
seed is the same story, up to the order of what one turn finds of the worker process and of clients. A step is
something that one hostile client does, a cycle, or a heartbeat without one.
"""

import math
import os
import re
import socket
import threading
import time
from collections import Counter, deque
from functools import lru_cache
from types import SimpleNamespace

import psutil
from box_support import inside
from fuzz_clients import READERS, Wire
from fuzz_corpus import DIALLING_PROGRAMS, MESSAGES, peer_message
from fuzz_mutations import mutate_bytes
from states_support import check_wires

from protocol.robot_api import BASE
from protocol.rtde.client_connection import DataReceived, RtdeClientConnection
from protocol.rtde.codec import RequestProtocolVersion, SetupOutputs, Start
from protocol.ur_types import ProgramState, RobotMode, SafetyMode, SoftwareVersion
from ur_emulator import ControlBox
from ur_emulator.machine.commands.power import (
    MoveEnablingDevice,
    PowerOn,
    ReleaseBrakes,
    SetOperationalMode,
    SwitchRemoteControl,
)
from ur_emulator.machine.commands.programs import StartProgram, StopProgram
from ur_emulator.machine.commands.safety import (
    AssignSafetyInput,
    ConfirmSafety,
    PressButton,
    ReleaseEmergencyStop,
    RequireSafeguardReset,
    RestartSafety,
    SafeguardStop,
    UnlockProtectiveStop,
)
from ur_emulator.machine.commands.surroundings import AttachPayload, Push
from ur_emulator.machine.controller.events import RobotModeChanged, SafetyModeChanged
from ur_emulator.machine.controller.safety.inputs import N_INPUT_PAIRS
from urscript import compile_program

# Kinds of boxes, as options.
CB3 = {"robot": "ur3", "version": "3.15.8", "tool": "onrobot-rg2"}
E_SERIES = {"robot": "ur5e", "version": "5.25.1", "tool": "robotiq-2f85"}
POLYSCOPE_X = {"robot": "ur5e", "version": "10.14.0", "services": ("primary", "rtde")}
# Hostile clients of one port at a time.
MAX_HOSTILE = 5
# How far an arm at rest may give way when brakes close and open or a stop brakes it [rad].
_GIVES_WAY = 0.02
_PATIENCE = 1.6  # s; an honest question has to be answered in this time
# Looks at a box that does not work until it is repaired.
_OUT_OF_WORK = 15
SIGN_OF_LIFE = compile_program("def alive():\n  sync()\nend\n")
# In this time all that a client may have waiting is answered: dashboard lines that take a cycle each, and
# `wait_until` with its longest time [s].
_LONGEST_QUEUE = 80.0
_CHECK_EVERY = 40  # cycles between the slower checks
_READ_EVERY = 16  # cycles until honest clients read; the buffers of the kernel must not fill
_NEVER = 60.0  # s; no service is due
# Memory of this process beyond what it had at the beginning, and of the worker process [bytes].
_MOST_GROWTH = 120 << 20
_MOST_OF_WORKER = 300 << 20
# How the box reports an error of its own (ur_emulator/host/runtime/barrier.py).
_DEFECT = re.compile(r" line \d+ of \w+\.py$")
QUESTIONS = {
    "dashboard": b"robotmode\n",
    "modbus": bytes.fromhex("000700000006010301020001"),  # register 258, robot mode
    "interpreter": b"statelastcleared\n",
    "control": b"GET /v1/state HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
    "robot_api": f"GET {BASE}/robotstate/v1/robotmode HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode(),
}


class _Pacer:
    """Lets a cycle pass when the test says so."""

    ticks = True
    publish_at = 0.0

    def __init__(self, period):
        self._period = period

    def may_tick(self, now, situation):
        return self.ticks

    def next_call(self, now):
        return now + self._period


class RtdeWitness:
    """An honest RTDE client: every value comes, every cycle."""

    def __init__(self, wire, turn, rate):
        self.protocol, self.n_packages = RtdeClientConnection(), 0
        for request in (RequestProtocolVersion(2), SetupOutputs(("timestamp", "robot_mode"), rate), Start()):
            wire.send(self.protocol.send(request))
            turn()
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

    def __init__(self, rng, folder, *, lively, cycle_share=0.1, kind=CB3):
        """Make a box.

        Args:
            rng: decides everything.
            folder: of program files.
            lively: programs may move the arm; False: nothing that is sent may.
            cycle_share: how many of the steps are cycles; these cost the time.
            kind: options of the box.
        """
        self.rng, self.lively, self.cycle_share = rng, lively, cycle_share
        self.cases, self.trail = Counter(), deque(maxlen=300)
        self.now = 0.0
        self.box = box = ControlBox(
            in_process=True,
            **kind,
            pace="lockstep",
            port_base=None,
            seed=rng.randrange(100),
            programs=folder,
            control_port=0,
        )
        inside(box).on_end = lambda: None
        self.served, self.loop = inside(box)._box, inside(box)._loop
        self.tasks = inside(box)._tasks
        self.controller = self.served.controller
        self.generation = self.controller.state.robot.generation
        self.period = self.generation.period_s
        self.served._pacer = self.pacer = _Pacer(self.period)
        self.defects = []
        box.follow_log(self._look_at_log)
        inside(box).listen()
        self.loop.remove(self.served)  # its time is ours
        self.loop._thread = threading.get_ident()
        self.version = SoftwareVersion.parse(kind["version"])
        self.ports = tuple(name for name in MESSAGES if name == "control" or getattr(box.ports, name))
        self.hostile = {name: {} for name in self.ports}
        self.n_published = self.n_out_of_work = self.n_repairs = 0
        self.witnesses = {name: self._connect(name) for name in self.ports}
        self.readers = {name: READERS[name](self.version) for name in self.ports}
        for name in ("primary", "primary_ro", "secondary", "secondary_ro"):
            self.readers[name].feed(self.witnesses[name].take())
        self.readers["rtde"] = RtdeWitness(self.witnesses["rtde"], self.turn, 1.0 / self.period)
        self.asked_at = {}
        self.n_mode_changes = 0
        self.served._listeners = (*self.served._listeners, self._count_mode_change)
        self.rest = self.controller.snapshot.target_q
        self.server = socket.create_server(("127.0.0.1", 0), backlog=64)
        self.server.setblocking(False)
        self.peers = []
        self.process = psutil.Process()
        self.memory = self.process.memory_info().rss
        self.in_use = self._in_use()

    def _count_mode_change(self, event):
        self.n_mode_changes += isinstance(event, RobotModeChanged | SafetyModeChanged)

    def _connect(self, name):
        number = self.box.control_port if name == "control" else getattr(self.box.ports, name)
        wire = Wire.to((self.box.host, number))
        self.turn()
        return wire

    def join(self, name):
        """Add a hostile client of a port; return it and the reader of what it gets."""
        wire = self._connect(name)
        reader = self.hostile[name][wire] = READERS[name](self.version)
        return wire, reader

    def close(self):
        for wires in (*self.hostile.values(), self.witnesses):
            for wire in wires.values() if wires is self.witnesses else wires:
                wire.close()
        self._end_peers()
        self.server.close()
        self.box.close()

    def _end_peers(self):
        """Nobody answers those that scripts dial any more, and those that were answered are gone."""
        try:
            while True:
                self.server.accept()[0].close()
        except BlockingIOError:
            pass
        for wire in self.peers:
            wire.close()
        self.peers.clear()

    def _in_use(self):
        """Descriptors and threads of this process."""
        return len(os.listdir("/proc/self/fd")), threading.active_count()

    def _look_at_log(self, entry):
        if _DEFECT.search(entry.text):
            self.defects.append(entry.text)

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
        elif kind < 0.95:
            self.attack(self.rng.choice(self.ports))
        else:
            self.attack_as_peer()

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
                others = rng.choice(self.ports)
                data = mutate_bytes(rng, data, lambda: MESSAGES[others](rng, self.lively))
            self.send(name, wire, data)
        elif kind < 0.93:
            wire.reads = False
            self.trail.append((name, wire.number, "reads no more"))
        elif kind < 0.96:
            wire.reads = True
        elif kind < 0.98:
            wire.end()
            self._did(name, "end", wire)
        else:
            wire.reset()
            self._did(name, "reset", wire)

    def attack_as_peer(self):
        """Let one that a script has dialled do something."""
        try:
            while True:
                self.peers.append(Wire(self.server.accept()[0]))
        except BlockingIOError:
            pass
        for wire in self.peers[:-MAX_HOSTILE]:
            wire.close()
        self.peers = [wire for wire in self.peers if wire.is_open]
        if not self.peers:
            if not self.controller.programs.is_running:
                program = self.rng.choice(DIALLING_PROGRAMS)
                self._order(
                    0.016, StartProgram(_compiled(program.replace("PEER", str(self.server.getsockname()[1]))))
                )
            return
        wire, kind = self.rng.choice(self.peers), self.rng.random()
        if kind < 0.8:
            data = peer_message(self.rng)
            wire.send(data)
            self._did("peer", data, wire)
        elif kind < 0.9:
            wire.end()
            self._did("peer", "end", wire)
        else:
            wire.reset()
            self._did("peer", "reset", wire)
        wire.take()

    def send(self, name, wire, data):
        """Send in one piece, at one cut, or byte by byte."""
        data = data.replace(b"PEER", b"%d" % self.server.getsockname()[1])
        how = self.rng.random()
        if how < 0.6 or len(data) < 2:
            pieces = [data]
        elif how < 0.95 or len(data) > 80:
            at = self.rng.randrange(1, len(data))
            pieces = [data[:at], data[at:]]
        else:
            pieces = [data[i : i + 1] for i in range(len(data))]
        for piece in pieces:
            if not piece or not wire.is_open:
                return
            wire.send(piece)
            self._did(name, piece, wire)

    def _did(self, name, what, wire):
        self.trail.append((name, wire.number, what))
        self.cases[name] += 1
        self.turn()

    def turn(self):
        """A turn of the loop; nothing is left for the worker process then."""
        for service in tuple(self.loop._services):
            service.advance(time.monotonic())
        self.loop.call_soon(_nothing, _raise)  # so that it does not wait
        self.loop._dispatch(time.monotonic() + _NEVER)
        while not self.tasks.is_idle:
            self.loop._dispatch(time.monotonic() + _NEVER)
        assert not self.defects, self.defects

    def cycle(self):
        """A control cycle, or several, and a look at everything."""
        for _ in range(self.rng.choice((1, 1, 1, 1, 1, 12))):
            self._advance(ticks=True)
        self._look()

    def repair(self):
        """Do what an operator does until the arm works again, and let a program run."""
        self.n_out_of_work = 0
        self.n_repairs += 1
        for name in QUESTIONS.keys() & self.hostile.keys():
            for wire in self.hostile[name]:  # a thousand lines that wait to be obeyed are not over yet
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
        if self.generation.has_operational_modes:
            commands += [
                SafeguardStop(False, "automatic mode"),
                RequireSafeguardReset(False, "automatic mode"),
                SetOperationalMode("none"),
                MoveEnablingDevice("none"),
                SwitchRemoteControl(True),
            ]
        self._order(0.16, *commands)
        if self.controller.snapshot.safety_mode == SafetyMode.PROTECTIVE_STOP:
            self._order(5.12)
            self._order(0.16, UnlockProtectiveStop())
        if self.controller.snapshot.safety_mode in (SafetyMode.VIOLATION, SafetyMode.FAULT):
            self._order(1.6, RestartSafety())
        self._order(0.16, ConfirmSafety())
        self._order(2.4, PowerOn())
        self._order(0.8, ReleaseBrakes())
        if not self.lively:  # a moved arm may stand where it cannot work
            now = self.controller.snapshot
            assert now.robot_mode == RobotMode.RUNNING, (
                f"it cannot be repaired: {RobotMode(now.robot_mode).name}, {SafetyMode(now.safety_mode).name}, "
                f"{[entry.text for entry in self.served.log.entries[-8:]]}"
            )
            self._order(self.period, StartProgram(SIGN_OF_LIFE))
            assert self.controller.programs.latest.program is SIGN_OF_LIFE, "no program starts any more"

    def _order(self, seconds, *commands):
        for command in commands:
            self.trail.append(("order", command))
            self.served.submit(command)
        for _ in range(round(seconds / self.period)):
            self._advance(ticks=True)
        self._look()

    def heartbeat(self):
        """Time stands still; the ports repeat themselves."""
        self._advance(ticks=False)

    def _advance(self, ticks):
        self.trail.append(("cycle" if ticks else "heartbeat",))
        self.pacer.ticks = ticks
        self.now += self.period + 1e-6
        self.served.advance(self.now)
        self.n_published += 1
        self.turn()
        if self.n_published % _READ_EVERY == 0:
            self._check_streams()

    # --- checks

    def _look(self):
        assert self.box.failure is None, repr(self.box.failure)
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
            self.readers[name].feed(wire.take())
            assert wire.is_open, f"the honest client of {name} was cut off"
        for name in ("realtime", "realtime_ro"):
            self.readers[name].finish()
            assert self.readers[name].n_frames == self.n_published, name
        assert self.readers["rtde"].n_packages == self.n_published, "RTDE packages are missing"
        for name in ("primary", "primary_ro", "secondary", "secondary_ro"):
            reader = self.readers[name]
            reader.finish()
            due = self.n_published * 10 // round(1 / self.period)
            assert reader.n_states == 1 + due + self.n_mode_changes, (name, reader.n_states)
        for wires in self.hostile.values():
            for wire, reader in tuple(wires.items()):
                reader.feed(wire.take())
                if not wire.is_open:
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
            # A package shows the target with which its cycle began, so ask for that of the next one.
            assert not any(self.controller.state.motion.target.qd), "an arm without power is told to move"

    def _ask(self):
        for name, question in QUESTIONS.items():
            if name in self.witnesses and name not in self.asked_at:
                self.asked_at[name] = self.n_published
                self.witnesses[name].send(question)

    def _check_answers(self):
        for name, asked_at in tuple(self.asked_at.items()):
            answers = self.readers[name].answers
            if not answers:
                waited = (self.n_published - asked_at) * self.period
                assert waited < _PATIENCE, f"{name} has not answered for {waited:.2f} s"
                continue
            answer = answers.pop()
            match name:
                case "dashboard":
                    RobotMode[answer.removeprefix("Robotmode: ")]
                case "modbus":
                    assert answer.pdu[:2] == b"\3\2", answer
                    RobotMode(int.from_bytes(answer.pdu[2:], "big", signed=True))
                case "interpreter":
                    assert answer.startswith("state: "), answer
                case _:
                    assert answer[0] == 200, answer
            del self.asked_at[name]

    def _check_modes(self):
        """All ports say the same, and it makes sense."""
        snapshot = self.controller.snapshot
        check_wires(SimpleNamespace(controller=self.controller, now=snapshot), self.version)
        RobotMode(snapshot.robot_mode), SafetyMode(snapshot.safety_mode), ProgramState(snapshot.runtime_state)
        assert 0.0 <= snapshot.speed_scaling <= 1.0

    def _check_memory(self):
        """What clients can make the box and its worker process keep is bounded."""
        grown = self.process.memory_info().rss - self.memory
        assert grown < _MOST_GROWTH, f"the box has grown by {grown >> 20} MiB"
        for worker in self.process.children():
            if (held := worker.memory_info().rss) > _MOST_OF_WORKER:
                raise AssertionError(f"a worker process holds {held >> 20} MiB")

    def settle(self):
        """All hostile clients go; nothing of them stays."""
        for wires in self.hostile.values():
            for wire in wires:
                wire.reset()
        self.turn()
        # Lines of port 30020 wait for interpreter mode as long as a program runs.
        self._order(2.4, *(StopProgram(),) * ("interpreter" in self.ports))
        self._ask()
        for _ in range(20):
            self._advance(ticks=True)
            self._look()
        # One that ended before it was reset is heard of again when all that it asked for is answered.
        for _ in range(round(_LONGEST_QUEUE / self.period)):
            self._end_peers()
            if self._in_use() <= self.in_use:
                break
            self._advance(ticks=True)
        self._look()
        now = self._in_use()
        assert now <= self.in_use, f"descriptors and threads: {now} instead of {self.in_use}"


def run(rng, folder, n_cases, **options):
    """Fuzz one box; return the cases by port. An error has the last steps as a note."""
    fuzz = FuzzBox(rng, folder, **options)
    try:
        while fuzz.cases.total() < n_cases:
            fuzz.step()
        fuzz.settle()
    except BaseException as error:
        lines = [repr(step)[:2000] for step in tuple(fuzz.trail)[-40:]]
        error.add_note(f"{options} cases={fuzz.cases.total()}; last steps:\n" + "\n".join(lines))
        raise
    finally:
        fuzz.close()
    return fuzz.cases


@lru_cache
def _compiled(text):
    return compile_program(text)


def _nothing():
    pass


def _raise(error):
    raise error
