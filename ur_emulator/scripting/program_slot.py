"""The one primary program of the box and the secondary programs beside it, stepped once a cycle."""

from __future__ import annotations

from protocol.ur_types import ProgramState
from ur_emulator.controller.events import ProgramStarted, ProgramStopped, ScriptFailed
from ur_emulator.controller.state import ControllerState
from ur_emulator.motion.arm_motion import PROGRAM_END_DECELERATION
from ur_emulator.scripting.network import Network
from ur_emulator.scripting.robot_host import RobotHost
from urscript import CompiledProgram, ProgramStatus, RunningProgram


class ProgramSlot:
    """Runs programs on a controller."""

    def __init__(self, state: ControllerState, network: Network) -> None:
        self._state = state
        self._network = network
        self._primary: RunningProgram | None = None
        self._secondaries: list[RunningProgram] = []
        self._ran = False
        self.name = ""

    @property
    def is_running(self) -> bool:
        """True while a primary program runs."""
        return self._primary is not None

    @property
    def has_work(self) -> bool:
        """True while any program wants cycles, and in the cycle in which one ended."""
        return self._primary is not None or self._ran or bool(self._secondaries)

    @property
    def runtime_state(self) -> ProgramState:
        """Program state as published.

        PLAYING also in the cycle in which a program ends, so that clients see even the shortest one run;
        STOPPING while the arm still ramps down after it.
        """
        if self._primary is not None or self._ran:
            return ProgramState.PLAYING
        return ProgramState.STOPPING if self._state.motion.is_moving else ProgramState.STOPPED

    @property
    def line(self) -> int:
        """Line of the primary program's main thread as sent, the `def` line being 1; 0 without a program."""
        if self._primary is None:
            return 0
        return self._primary.position(self._primary.threads[0])[0]

    @property
    def waits_outside(self) -> bool:
        """True when a program cannot go on before something comes from outside the box."""
        return self._primary is not None and self._primary.waits_outside

    def start(self, program: CompiledProgram) -> None:
        """Start a program; a primary one replaces the one that runs."""
        if program.kind == "sec":
            self._secondaries.append(program.start(RobotHost(self._state, self._network)))
            return
        self.stop()
        self.name = program.name
        self._primary = program.start(RobotHost(self._state, self._network))
        self._state.io_configuration.program_started()
        self._state.events.append(ProgramStarted(program.name))

    def stop(self) -> None:
        """End the primary program, if one runs, and stop the arm, also on its last way to a waypoint."""
        if self._primary is not None:
            self._primary.kill()
            self._end()
        self._state.motion.stop(PROGRAM_END_DECELERATION)

    def step(self) -> None:
        """Run all programs for one cycle."""
        self._ran = self._primary is not None
        if self._secondaries:
            for program in self._secondaries:
                if program.step() is ProgramStatus.FAILED:
                    self._report(program, secondary=True)
                else:
                    program.kill()  # a secondary program has one cycle
            self._secondaries.clear()
        if self._primary is not None:
            status = self._primary.step()
            if status is not ProgramStatus.RUNNING:
                if status is ProgramStatus.FAILED:
                    self._report(self._primary)
                self._end()

    def _report(self, program: RunningProgram, *, secondary: bool = False) -> None:
        error = program.error
        assert error is not None
        self._state.events.append(ScriptFailed(error.line, error.column, error.wire_text, secondary))

    def _end(self) -> None:
        self._primary = None
        self._state.io_configuration.program_stopped()
        self._state.watchdogs.clear()
        self._state.error_settings.pause_codes.clear()
        self._state.events.append(ProgramStopped(self.name))
