"""A whole box to try one program on, without ports: what `urscript run` runs programs on.

The box advances in the event loop as fast as the processor allows. While a program waits for something
outside (bytes of a peer, a connection being made) it advances at real pace instead, as a real one would: so
peers have time to answer and time-outs pass.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from protocol.primary.messages import RequestedType
from ur_emulator.errors import ArgumentError, RefusedError
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.script_network.loop_network import LoopNetwork
from ur_emulator.machine.commands.programs import AnswerRequest, ClosePopup, StartProgram, StopProgram
from ur_emulator.machine.controller import events as ev
from ur_emulator.machine.controller.command import Command
from ur_emulator.machine.machine import Answer, Machine
from ur_emulator.machine.models.robots import robot_by_name
from ur_emulator.machine.motion.move import Move
from urscript.robot import Report, ReportKind, RunEnd, RunStatus

if TYPE_CHECKING:
    from urscript import CompiledProgram

# Time after the program for the arm to come to rest [s]: the longest ramp and the lag of the drives.
REST_TIME = 2.0
# Protective stops that the path of a move may cause, by deviation, collision or set-point (limit_checks.py).
MOTION_CODES = frozenset({153, 157, 204})
# A wait for the outside is reported when it has lasted this long [s].
PATIENCE = 1.0
_KINDS = {
    RequestedType.BOOLEAN: "yes or no",
    RequestedType.INTEGER: "an integer",
    RequestedType.FLOAT: "a number",
    RequestedType.STRING: "a text",
}
_TRUE, _FALSE = frozenset({"true", "yes", "1"}), frozenset({"false", "no", "0"})


class ScriptBox:
    """A box for one program (see urscript.robot.ScriptRobot), and the run of it as a service of a loop.

    Attributes:
        step_time: control cycle [s].
    """

    def __init__(
        self, robot: str, fidelity: str, seed: int, software: Sequence[int], answers: Sequence[str]
    ) -> None:
        """Assemble the box with a version (major, minor) of the software.

        `answers` are the operator's, in order. EmulatorError if there is no such arm or fidelity, or the arm
        needs newer software.
        """
        asked = f"{software[0]}.{software[1]}"
        model = robot_by_name(robot, asked)
        version = model.software_version(asked)
        self._machine = machine = Machine(
            model, model.generation.fidelity(fidelity), seed, version=(version.major, version.minor)
        )
        self._controller = machine.controller
        self.title = f"{model.title}, fidelity {fidelity}, seed {seed}"
        self.step_time = self._controller.period_s
        self._loop = EventLoop()
        self._network = LoopNetwork(self._loop, machine.network, self.step_time, machine.take, _raise)
        self._answers = deque(answers)
        self._commands: list[Command] = []
        self._first_tick = self._controller.snapshot.tick
        self._status = RunStatus.RUNNING
        self._is_over = False
        # From the start to the end of the program, and from the first cycle to the last [s].
        self._robot_time = self._real_time = 0.0
        self._began = math.nan
        self._due = -math.inf
        self._waits_since = math.inf
        # The last move that was under way at the beginning of a cycle.
        self._move: Move | None = None
        self._rest = model.generation.cycles(REST_TIME)

    @property
    def time(self) -> float:
        """Robot time since the program began [s]: at the start of the present cycle."""
        return self._cycles * self.step_time

    def run(self, program: CompiledProgram, limit: float, report: Callable[[Report], None]) -> RunEnd:
        """Run a program to its end and the arm to rest; see urscript.robot.ScriptRobot."""
        self._limit_cycles = round(min(limit / self.step_time, 1e15))
        self._send = report
        self._commands.append(StartProgram(program, loaded=True))
        self._loop.add(self)
        try:
            self._loop.run()
        except KeyboardInterrupt:
            if not self._is_over:
                self._end(RunStatus.INTERRUPTED)
            self._tick((*self._commands, StopProgram()))
        finally:
            self._loop.close()
        now = self._controller.snapshot
        return RunEnd(self._status, self._robot_time, self._real_time, now.actual_q, now.actual_tcp_pose)

    # --- the loop

    def advance(self, now: float) -> float:
        """Tick, unless it is not time to; return when to be called next at the latest."""
        if math.isnan(self._began):
            self._began = now
        self._real_time = now - self._began
        if not self._commands and not self._is_over and self._controller.waits_outside:
            if now < self._due:
                return self._due
            self._wait(now)
        else:
            self._waits_since = math.inf
        commands, self._commands = self._commands, []
        self._move = self._controller.state.motion.move or self._move
        answer = self._tick(commands)
        self._due = now + self.step_time
        for event in answer.events:
            self._take(event)
        if self._is_at_rest():
            self._loop.stop()
        return now

    def _tick(self, commands: Iterable[Command]) -> Answer:
        """Advance the machine by a cycle; an error of ours in a command ends the run."""
        answer = self._machine.tick(commands)
        for _, error in answer.outcomes:
            if error is not None and not isinstance(error, RefusedError):
                raise error
        self._network.carry_out(answer.requests)
        return answer

    def failed(self, error: Exception) -> None:
        """Let an error end the run."""
        raise error

    def _wait(self, now: float) -> None:
        if self._waits_since == math.inf:
            self._waits_since = now
        elif now - self._waits_since >= PATIENCE:
            self._waits_since = math.nan  # reported once
            text = "the program waits for something outside, at real pace"
            self._report(ReportKind.NOTICE, text, *self._place())

    def _is_at_rest(self) -> bool:
        """Update the state of the run; True when nothing more is expected."""
        controller = self._controller
        if not self._is_over:
            if not controller.programs.is_running:
                self._end(RunStatus.FINISHED)
            elif controller.state.safety.is_stopped and not controller.state.motion.is_moving:
                self._end(RunStatus.STOPPED)
            elif self._cycles >= self._limit_cycles:
                self._end(RunStatus.RUNNING)
            return False
        self._rest -= 1
        return self._rest <= 0 or not controller.is_active or controller.state.safety.is_stopped

    @property
    def _cycles(self) -> int:
        return self._controller.snapshot.tick - self._first_tick

    def _end(self, status: RunStatus) -> None:
        """The program is over, or has to be; from now on only the arm matters."""
        self._is_over = True
        if self._status is RunStatus.RUNNING:
            self._status = status
        # Up to the beginning of its last cycle, as in all reports; a program that was ended had all of it.
        cycles = self._cycles - (status is not RunStatus.RUNNING)
        self._robot_time = max(0, cycles) * self.step_time
        self._commands.append(StopProgram())

    # --- what is said

    def _take(self, event: ev.Event) -> None:
        match event:
            case ev.TextPrinted(text):
                self._report(ReportKind.TEXT, text)
            case ev.ScriptFailed(line, column, text):
                self._status = RunStatus.FAILED
                self._report(ReportKind.FAILURE, text, line, column)
            case ev.ErrorReported(code, argument, _, text):
                coded = f"C{code}A{argument}: {text}" if code else text
                self._report(ReportKind.CODE, self._why_stopped(code) + coded, *self._place())
            case ev.PopupShown(title, text, blocking=blocking):
                closed = " (closed)" if blocking else ""
                self._report(ReportKind.POPUP, f"{title}: {text}{closed}")
                if blocking:
                    self._commands.append(ClosePopup())
            case ev.ValueRequested(request_id, kind, text):
                self._answer(request_id, kind, text)

    def _why_stopped(self, code: int) -> str:
        """Return why the arm cannot do the present move, if that is the reason for an error code; else ""."""
        if code not in MOTION_CODES or self._move is None or self._move.leg.goal is not None:
            return ""
        leg, state = self._move.leg, self._controller.state
        target = f"p[{', '.join(f'{x:.4g}' for x in leg.goal_pose)}]"
        if state.arm.inverse(leg.goal_pose, state.motion.target.q, leg.tool.tcp) is None:
            return f"the target {target} is out of reach; "
        return f"the target {target} can be reached, but not on this path; "

    def _answer(self, request_id: int, kind: RequestedType, question: str) -> None:
        """Answer for the operator; a program whose question is not answered has failed."""
        text = self._answers.popleft() if self._answers else None
        answer = None if text is None else _parsed(text, kind, request_id)
        if answer is not None:
            self._report(ReportKind.QUESTION, f"{question} {text}", *self._place())
            self._commands.append(answer)
            return
        given = "and there is no answer" if text is None else f"but the answer is '{text}'"
        self._status = RunStatus.FAILED
        message = f"the program asks for {_KINDS[kind]}: '{question}', {given} (--answer)"
        self._report(ReportKind.FAILURE, message, *self._place())
        self._commands.append(StopProgram())

    def _place(self) -> tuple[int, int]:
        """Return line and column of the thread that has the arm, or of the main one; 0, 0 if none is left."""
        run = self._controller.programs.latest
        if run is None or not run.threads:
            return 0, 0
        owner = self._controller.state.motion.owner
        return run.position(next((it for it in run.threads if it is owner), run.threads[0]))

    def _report(self, kind: ReportKind, text: str, line: int = 0, column: int = 0) -> None:
        time = max(0, self._cycles - 1) * self.step_time
        self._send(Report(time, kind, text, line, column))


def _raise(what: str, error: Exception) -> None:
    """Let an error end the run, whatever it belongs to."""
    raise error


def _parsed(text: str, kind: RequestedType, request_id: int) -> AnswerRequest | None:
    """Return an answer as the type asked for; None if it does not fit."""
    try:
        if kind is RequestedType.INTEGER:
            return AnswerRequest(int(text), request_id)
        if kind is RequestedType.FLOAT:
            return AnswerRequest(float(text), request_id)
        if kind is RequestedType.BOOLEAN:
            word = text.lower()
            return AnswerRequest(word in _TRUE, request_id) if word in _TRUE | _FALSE else None
        return AnswerRequest(text, request_id)
    except (ValueError, ArgumentError):
        return None
