"""How the operations of the control API are done, each in steps (see `box_access`).

Arguments have been checked by the table. A result is what the table says; `RefusedError` tells what stands
against it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial
from typing import Any

from protocol.primary_messages import ReportLevel, RequestedType
from protocol.ur_types import ProgramState, SafetyMode
from ur_emulator.box_log import LogEntry
from ur_emulator.control.box_state import take_state
from ur_emulator.control.conditions import holds, unmet
from ur_emulator.control.desk import Surroundings
from ur_emulator.controller import commands as cmd
from ur_emulator.controller import hands, obstacles, operator, wires
from ur_emulator.controller import safety_commands as safety
from ur_emulator.controller.events import LogAdded
from ur_emulator.controller.io import ANALOG_RANGE
from ur_emulator.errors import ArgumentError, EmulatorError, RefusedError, WaitTimeoutError
from ur_emulator.servers.program_desk import Loading
from urscript import CompiledProgram, compile_program
from urscript.catalogue import catalogue_for
from urscript.errors import ScriptError

Steps = Generator[None, None, Any]
_STANDS_STILL = frozenset({ProgramState.PAUSING, ProgramState.PAUSED})


class Actions:
    """Does operations."""

    def __init__(self, around: Surroundings) -> None:
        self._around = around
        self._access = access = around.access
        self._state = access.controller.state
        self._methods: dict[str, Callable[..., Steps]] = {
            "state": self._take_state,
            "log": self._log,
            "identity": self._identity,
            "wait_until": self._wait_until,
            "set_digital_input": self._set_digital_input,
            "set_analog_input": self._set_analog_input,
            "push": partial(self._apply, hands.Push),
            "attach_payload": partial(self._apply, hands.HangLoad),
            "add_obstacle": self._add_obstacle,
            "remove_obstacle": self._remove_obstacle,
            "emergency_stop": partial(self._apply, safety.PressEmergencyStop),
            "release_emergency_stop": partial(self._apply, safety.ReleaseEmergencyStop),
            "safeguard_stop": partial(self._apply, safety.SafeguardStop),
            "reduced_mode": partial(self._apply, safety.ReducedMode),
            "protective_stop": partial(self._apply, cmd.TriggerProtectiveStop),
            "unlock_protective_stop": self._unlock,
            "trigger_violation": partial(self._apply, safety.TriggerViolation),
            "trigger_fault": partial(self._apply, safety.TriggerFault),
            "restart_safety": partial(self._apply, cmd.RestartSafety),
            "power_on": partial(self._apply, cmd.PowerOn),
            "power_off": partial(self._apply, cmd.PowerOff),
            "release_brakes": partial(self._apply, cmd.ReleaseBrakes),
            "run_program": self._run_program,
            "stop_program": partial(self._apply, cmd.StopProgram),
            "pause_program": self._pause,
            "resume_program": self._resume,
            "set_speed": partial(self._apply, cmd.SetSpeedSlider),
            "answer": self._answer,
            "close_popups": partial(self._apply, cmd.ClosePopup),
            "add_to_log": self._add_to_log,
        }

    def begin(self, name: str, arguments: dict[str, Any]) -> Steps:
        """Return the steps of an operation."""
        return self._methods[name](**arguments)

    # --- what is going on

    def _take_state(self) -> Steps:
        yield from ()
        return take_state(self._access.controller)

    def _log(self, after: int, level: str) -> Steps:
        yield from ()
        log, least = self._access.box_log, ReportLevel[level]
        entries = log.since(after)
        return {"entries": [e for e in entries if e.level >= least], "next": max(after, log.count)}

    def _identity(self) -> Steps:
        yield from ()
        return self._around.identity()

    def _wait_until(self, timeout: float, log: str | None, after: int, **wanted: Any) -> Steps:
        wanted = {name: value for name, value in wanted.items() if value is not None}
        if not wanted and log is None:
            raise ArgumentError("wait_until needs a condition, such as program_state STOPPED or steady true")
        box_log, controller = self._access.box_log, self._access.controller
        end = self._around.clock() + timeout
        seen = log is None
        while True:
            if not seen:
                seen = any(str(log) in entry.text for entry in box_log.since(after))
                after = max(after, box_log.count)
            if seen and holds(controller, wanted):
                return take_state(controller)
            if self._around.clock() >= end:
                missing = [*unmet(controller, wanted), *([] if seen else [f"no log entry with {log!r}"])]
                raise WaitTimeoutError(f"waited {timeout:g} s in vain: {', '.join(missing)}")
            yield

    # --- wires

    def _set_digital_input(self, group: str, n: int, level: bool) -> Steps:
        return self._apply(wires.SetDigitalInput, group, n, level)

    def _set_analog_input(self, group: str, n: int, value: float) -> Steps:
        command = _make(wires.SetAnalogInput, group, n, value)
        line = (self._state.io.analog_in if group == "standard" else self._state.io.tool_analog_in)[n]
        low, high = ANALOG_RANGE[line.domain]
        if not low <= value <= high:
            raise RefusedError(
                f"{value:g} given for {group} analog input {n}, which measures {low:g} to {high:g} "
                f"{'V' if line.domain else 'A'} now"
            )
        return (yield from self._applied(command))

    # --- surroundings

    def _add_obstacle(self, name: str, **shape: Any) -> Steps:
        before = self._access.box_log.count
        result = yield from self._apply(obstacles.AddObstacle, name, **shape)
        refusals = [
            e.text for e in self._access.box_log.since(before) if e.text.startswith(f"obstacle {name}:")
        ]
        if refusals:
            raise RefusedError(refusals[0])
        return result

    def _remove_obstacle(self, name: str) -> Steps:
        known = self._access.controller.plant.obstacles
        if name not in known:
            raise RefusedError(
                f"there is no obstacle {name!r}: there {'are ' + ', '.join(known) if known else 'is none'}"
            )
        return (yield from self._applied(obstacles.RemoveObstacle(name)))

    # --- safety

    def _unlock(self) -> Steps:
        mode = self._state.safety.mode
        if mode is not SafetyMode.PROTECTIVE_STOP:
            raise RefusedError(f"there is no protective stop to unlock: the safety mode is {mode.name}")
        return (yield from self._applied(cmd.UnlockProtectiveStop()))

    # --- programs

    def _run_program(self, script: str | None, file: str | None) -> Steps:
        if (script is None) == (file is None):
            raise ArgumentError("run_program needs either script, the text, or file, a name")
        before = self._access.box_log.count
        if script is None:
            yield from self._play(str(file))
            name = self._access.controller.programs.name
            return {"program": name, "tick": self._access.snapshot.tick}
        program = yield from self._access.in_worker(partial(self._compile, script))
        yield from self._access.apply(cmd.StartProgram(program))
        latest = self._access.controller.programs.latest
        if program.kind != "sec" and (latest is None or latest.program is not program):
            raise RefusedError(self._complaint(before) or f"program {program.name} not started")
        return {"program": program.name, "tick": self._access.snapshot.tick}

    def _play(self, file: str) -> Steps:
        """Load and play a file, as the dashboard does; what runs is stopped before."""
        before, desk = self._access.box_log.count, self._around.desk
        yield from desk.stop()
        if (yield from desk.load(file)) is not Loading.DONE or not (yield from desk.play("127.0.0.1")):
            raise RefusedError(self._complaint(before) or f"{file} cannot be run")

    def _compile(self, text: str) -> CompiledProgram:
        """Compile a program; in the worker."""
        try:
            return compile_program(text, catalogue=catalogue_for(self._access.identity.version))
        except ScriptError as error:
            raise ArgumentError(
                f"the program does not compile: {error.log_text or error.wire_text}"
            ) from None

    def _pause(self) -> Steps:
        state = self._access.snapshot.runtime_state
        if not self._access.controller.programs.is_running or state in _STANDS_STILL:
            raise RefusedError(f"there is no program to pause: the program state is {_name(state)}")
        return (yield from self._applied(cmd.PauseProgram()))

    def _resume(self) -> Steps:
        before = self._access.box_log.count
        if not self._access.controller.programs.is_paused:
            state = self._access.snapshot.runtime_state
            raise RefusedError(f"there is no program to resume: the program state is {_name(state)}")
        result = yield from self._applied(cmd.ResumeProgram())
        if self._access.controller.programs.is_paused:
            raise RefusedError(self._complaint(before) or "the program stays paused")
        return result

    # --- the operator

    def _answer(self, value: operator.Answer, id: int | None) -> Steps:
        questions = self._state.operator
        before = {r.request_id: r for r in questions.requests if r.kind is not RequestedType.NONE}
        result = yield from self._applied(cmd.AnswerRequest(value, id))
        for request in before.values():
            if request.is_answered and id in (None, request.request_id):
                return {"id": request.request_id, **result}
        asked = ", ".join(f"{r.request_id} ({r.kind.name.lower()}): {r.text}" for r in before.values())
        raise RefusedError(
            f"{value!r} answers no question: {f'asked is {asked}' if asked else 'none is open'}"
        )

    def _add_to_log(self, text: str) -> Steps:
        yield from ()
        self._access.announce(LogAdded("Control", text))
        return {"tick": self._access.snapshot.tick}

    # --- how

    def _apply(self, kind: Callable[..., cmd.Command], /, *args: Any, **kwargs: Any) -> Steps:
        return (yield from self._applied(_make(kind, *args, **kwargs)))

    def _applied(self, command: cmd.Command) -> Steps:
        yield from self._access.apply(command)
        return {"tick": self._access.snapshot.tick}

    def _complaint(self, before: int) -> str:
        """Return the last text of the log that tells why something was not done."""
        new: list[LogEntry] = self._access.box_log.since(before)
        told = [
            e.text
            for e in new
            if any(word in e.text for word in (" failed: ", "not started", "stays paused"))
        ]
        return told[-1] if told else ""


def _make(kind: Callable[..., cmd.Command], /, *args: Any, **kwargs: Any) -> cmd.Command:
    try:
        return kind(*args, **kwargs)
    except EmulatorError as error:
        raise ArgumentError(str(error)) from None


def _name(state: int) -> str:
    return ProgramState(state).name
