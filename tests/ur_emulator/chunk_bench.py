"""Runs the chunks of `chunk_marks` on a controller without ports."""

import re
from ast import literal_eval
from functools import cache

import numpy as np
from box_support import Bench
from chunk_actions import act
from chunk_peers import ChunkNetwork

from protocol.primary.messages import ReportLevel
from protocol.ur_types import ControlMode, ProgramState, RobotMode, SafetyMode, SafetyStatus
from ur_emulator.machine.commands.programs import AnswerRequest, ClosePopup, StartProgram
from ur_emulator.machine.models.generations import CB3, E_SERIES
from urscript import compile_program
from urscript.catalogue import catalogue_for
from urscript.check.checking import check_program
from urscript.errors import ScriptCompileError

MAX_CYCLES = 6_000
_NAMED = {
    "safety_mode": SafetyMode,
    "safety_status": SafetyStatus,
    "robot_mode": RobotMode,
    "runtime_state": ProgramState,
    "control_mode": ControlMode,
}
# What snapshots do not tell: the true state of the arm.
_TRUE = {
    "place": lambda box: box.plant.physics.flange_position,
    "contact": lambda box: box.plant.physics.contact_wrench[:3],
    "q_true": lambda box: box.plant.q_true,
    "qd_true": lambda box: box.plant.qd_true,
}
_OVER_CYCLES = {
    "": lambda values: values,
    "mean": lambda values: values.mean(axis=0),
    "most": lambda values: np.abs(values).max(),
    "span": lambda values: np.ptp(values, axis=0).max(),
    "step": lambda values: np.abs(np.diff(values, axis=0)).max(),
    "gain": lambda values: values[-1] - values[0],
}


@cache
def compiled(text, catalogue):
    """The compiled program of a text, once for all tests."""
    return compile_program(text, catalogue=catalogue)


class ChunkBench(Bench):
    """A bench on the network of a chunk."""

    def __init__(self, chunk):
        robot, generation = ("ur3", CB3) if chunk.software.startswith("3.") else ("ur5e", E_SERIES)
        super().__init__(
            robot=chunk.robot or robot,
            mode=RobotMode[chunk.mode],
            generation=generation,
            fidelity=chunk.fidelity,
            seed=chunk.seed,
            network=ChunkNetwork(chunk),
        )


class ChunkRun:
    """One run of a chunk: what was done and what came of it."""

    def __init__(self, chunk):
        self.chunk = chunk
        self.catalogue = catalogue_for(chunk.software)
        self.bench = ChunkBench(chunk)
        self.network = self.bench.network
        self.messages = []
        self.errors = []
        self.events = []
        self.life = []
        self.cycles = 0
        self.seen = {look.name: {} for look in chunk.looks}
        self._last_look = max((look.cycles[-1] for look in chunk.looks), default=-1)
        self._answers = list(chunk.answers)
        self._due = []
        if chunk.before:
            self.bench.tick(1, StartProgram(compiled(chunk.before, self.catalogue)))
            while self.bench.controller.programs.has_work or self.bench.controller.state.motion.is_moving:
                self.bench.tick()
            self.bench.events.clear()

    def start(self, text, cycles_of_actions):
        """Start a program and run until it and the arm have come to rest, and to the last cycle looked at."""
        program = compiled(text, self.catalogue)
        actions = sorted(cycles_of_actions, key=lambda action: action[0])
        for cycle, action in actions:
            if cycle < 0:
                self._tick_if(act(self.bench, self.catalogue, action))
        actions = [action for action in actions if action[0] >= 0]
        self._tick(0, [StartProgram(program, loaded=self.chunk.loaded)])
        if actions and actions[0][0] == 0:
            raise AssertionError(f"{self.chunk}: use #do for what comes before the program")
        self.cycles = 1
        for cycle in range(1, MAX_CYCLES):
            commands = []
            while actions and actions[0][0] == cycle:
                commands += act(self.bench, self.catalogue, actions.pop(0)[1])
            if not actions and not commands and not self._due and cycle > self._last_look and self._is_over():
                self._last_look = -1
                return
            self._tick(cycle, commands)
            if self.bench.controller.programs.has_work:
                self.cycles = cycle + 1
        raise AssertionError(f"{self.chunk}: still running, texts so far: {self.messages}")

    def _is_over(self):
        programs = self.bench.controller.programs
        if self.chunk.endless:
            return True
        if programs.is_running:
            return programs.runtime_state is ProgramState.PAUSED
        return not self.bench.controller.state.motion.is_moving

    def _tick_if(self, commands):
        if commands:
            self._tick(-1, commands)

    def _tick(self, cycle, commands):
        first = len(self.bench.events)
        due, self._due = self._due, []
        self.bench.tick(1, *commands, *due)
        self.bench.snapshots.clear()
        if 0 <= cycle <= self._last_look:
            for name, values in self.seen.items():
                true = _TRUE.get(name)
                values[cycle] = np.array(
                    true(self.bench.controller) if true else getattr(self.bench.now, name)
                )
        for event in self.bench.events[first:]:
            self._take(cycle, event)

    def _take(self, cycle, event):
        match type(event).__name__:
            case "TextPrinted":
                self.messages.append((cycle, event.text))
            case "ScriptFailed":
                self.errors.append((event.secondary, event.line, event.column, event.text))
            case "ErrorReported":
                level = "" if event.level is ReportLevel.WARNING else f"{event.level.name.lower()} "
                self.events.append(f"{level}C{event.code}A{event.argument} {event.text}")
            case "SafetyModeChanged":
                self.events.append(f"safety {_mode_name(event.safety_mode)}")
            case "PopupShown":
                kind = " warning" * event.warning + " error" * event.error
                self.events.append(f"popup{kind} {event.title}: {event.text}")
                if event.blocking:
                    self._answer()
            case "ValueRequested":
                self.events.append(f"asks {event.kind.name.lower()}: {event.text}")
                self._answer()
            case "LogAdded":
                self.events.append(f"log {event.source}: {event.text}")
            case name if name.startswith("Program"):
                self.life.append(f"{name.removeprefix('Program').lower()} {event.name}")

    def _answer(self):
        if self._answers:
            answer = self._answers.pop(0)
            self._due.append(ClosePopup() if answer == "close" else AnswerRequest(literal_eval(answer)))


def run_box_chunk(chunk):
    """Compile and run a chunk; asserts everything it expects."""
    run = ChunkRun(chunk)
    try:
        compiled(chunk.text, run.catalogue)
    except ScriptCompileError:
        compile_errors = check_program(chunk.text, catalogue=run.catalogue)[0]
        run.errors = [(False, error.line, error.column, error.message) for error in compile_errors]
        wire = compile_errors[0].wire_text
    else:
        run.start(chunk.text, chunk.actions)
        first_cycles = run.cycles
        for program in chunk.then:
            run.start(program, [])
        run.cycles = first_cycles
        wire = run.errors[0][3] if run.errors else None
    _compare_errors(chunk, run.errors)
    _compare_texts(chunk, "events", chunk.events, run.events)
    shown = [
        (None if want[0] is None else cycle, text)
        for want, (cycle, text) in zip(
            [*chunk.messages, *[(None, "")] * len(run.messages)], run.messages, strict=False
        )
    ]
    assert shown == chunk.messages, f"{chunk}: texts {run.messages}"
    if chunk.wire_text is not None:
        assert wire == chunk.wire_text
    if chunk.life:
        _compare_texts(chunk, "life", chunk.life, run.life)
    if chunk.cycles is not None:
        assert run.cycles == chunk.cycles, f"{chunk}: ran {run.cycles} cycles"
    if chunk.sent is not None:
        assert run.network.sent == chunk.sent, f"{chunk}: sent {run.network.sent}"
    assert run.network.called == chunk.called, f"{chunk}: called {run.network.called}"
    assert run.network.custom == chunk.custom, f"{chunk}: sent {run.network.custom}"
    for kind, address, value in chunk.modbus:
        found = run.network.modbus_memory.get((kind, address))
        assert found == value, f"{chunk}: {found} at {kind} {address}"
    assert not any(socket.is_open for socket in run.network.sockets), f"{chunk}: left a socket open"
    assert run.bench.controller.programs.is_paused == chunk.paused, f"{chunk}: paused"
    for look in chunk.looks:
        _compare_look(chunk, look, run.seen[look.name])
    for name, value, tolerance in chunk.states:
        _compare_value(chunk, name, getattr(run.bench.now, name), value, tolerance)
    return run


def _compare_look(chunk, look, seen):
    values = np.array([seen[cycle] for cycle in look.cycles], dtype=float)
    found = _OVER_CYCLES[look.how](values if look.index is None else values[:, look.index])
    wanted = _NAMED[look.name][look.value] if look.value.isupper() else literal_eval(look.value)
    if look.relation:
        fits = found < wanted if look.relation == "<" else found > wanted
    else:
        fits = np.abs(found - np.array(wanted, dtype=float)) <= look.tolerance
    assert np.all(fits), f"{chunk}: {look.how} {look.name} in {look.cycles} is {found}"


def _mode_name(mode):
    return SafetyMode(mode).name


def _matches(pattern, text):
    parts = pattern.split("...")
    return re.fullmatch(".*".join(map(re.escape, parts)), text, re.DOTALL) is not None


def _compare_errors(chunk, found):
    places = [error[:3] for error in found]
    assert places == [error[:3] for error in chunk.errors], f"{chunk}: errors {found}"
    for error, expected in zip(found, chunk.errors, strict=True):
        assert _matches(expected[3], error[3]), f"{chunk}: {error[3]!r}, not {expected[3]!r}"


def _compare_texts(chunk, what, expected, found):
    same = len(found) == len(expected) and all(map(_matches, expected, found))
    assert same, f"{chunk}: {what} {found}"


def _compare_value(chunk, name, found, expected, tolerance):
    if isinstance(expected, (list, tuple)):
        assert len(found) == len(expected), f"{chunk}: {name} is {found}"
        for one, other in zip(found, expected, strict=True):
            assert abs(one - other) <= tolerance, f"{chunk}: {name} is {found}"
    elif isinstance(expected, str):
        assert found == expected, f"{chunk}: {name} is {found}"
    else:
        assert abs(found - expected) <= tolerance, f"{chunk}: {name} is {found}"
