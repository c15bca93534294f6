"""ProgramRunner: the one primary program of the box and the secondary programs beside it.

It knows the robot that they run on only as `urscript.run.host.Host`; `scripting` has the builtins.
"""

from collections import deque
from collections.abc import Callable

from protocol.ur_types import ProgramState
from ur_emulator.budgets import BUDGETS, of_cycle
from ur_emulator.machine.controller import events
from ur_emulator.machine.controller.state import ControllerState
from urscript import CompiledProgram, Host, ProgramStatus, RunningProgram
from urscript.run.metering import WorkBudget
from urscript.run.waits import Outside

# Looked up once: a cycle asks for them several times.
_PLAYING, _PAUSED = ProgramState.PLAYING, ProgramState.PAUSED
# States in which the threads of a program do not run.
_STANDS_STILL = frozenset({ProgramState.PAUSING, ProgramState.PAUSED})


class ProgramRunner:
    """Runs programs on a controller.

    A primary program plays, or it comes to a pause (PAUSING, until the arm rests), in it (PAUSED), or
    leaves it (RESUMING, for a cycle, and until the arm is back on a path that it had to leave).
    Time that a paused program counts, in `sleep` and the time-outs of its sockets, stands still.

    Attributes:
        name: of the primary program, or of the last one.
        latest: the primary program or the last one, whose variables can still be read; None before the first.
        reports_line: a client reads the line that the program executes.
        work: units that all programs have used in this cycle (`urscript.run.metering`).
    """

    def __init__(self, state: ControllerState, make_host: Callable[[], Host]) -> None:
        """Prepare; `make_host` makes the robot as one program sees it."""
        self._state = state
        self._make_host = make_host
        self._primary: RunningProgram | None = None
        self._secondaries: deque[RunningProgram] = deque()
        limits = BUDGETS.program_units, BUDGETS.program_units_saved
        self._work = WorkBudget(*(of_cycle(limit, state.clock.period_s) for limit in limits))
        limits = BUDGETS.secondary_units, BUDGETS.secondary_units_saved
        self._secondary_work = WorkBudget(*(of_cycle(limit, state.clock.period_s) for limit in limits))
        self._ran = False
        self._phase = ProgramState.PLAYING
        self._phase_since = 0
        self._is_loaded = False
        self._is_unscheduled = False
        self.name = ""
        self.reports_line = False
        self.work = 0.0
        self.latest: RunningProgram | None = None

    @property
    def is_running(self) -> bool:
        """True while there is a primary program, paused or not."""
        return self._primary is not None

    @property
    def is_paused(self) -> bool:
        """True while the primary program is paused, or about to be."""
        return self._primary is not None and self._phase in _STANDS_STILL

    @property
    def is_any_running(self) -> bool:
        """True while there is a program, primary or secondary."""
        return self._primary is not None or bool(self._secondaries)

    @property
    def has_work(self) -> bool:
        """True while any program needs cycles, and after one has ended as long as that takes."""
        if self._primary is None:
            return self._ran or bool(self._secondaries) or self.is_releasing
        return self._phase is not _PAUSED or bool(self._secondaries)

    @property
    def is_releasing(self) -> bool:
        """True while the last program, which has ended, still holds long values."""
        return self.latest is not None and self.latest.is_releasing

    @property
    def runtime_state(self) -> ProgramState:
        """Program state as published.

        PLAYING also in the cycle in which a program ends, so that clients see even the shortest one run;
        STOPPING while the arm still ramps down after it.
        """
        if self._primary is not None:
            return self._phase
        if self._ran:
            return _PLAYING
        return ProgramState.STOPPING if self._state.motion.is_moving else ProgramState.STOPPED

    @property
    def line(self) -> int:
        """Line of the primary program's main thread as sent, the `def` line being 1; 0 without a program."""
        if self._primary is None:
            return 0
        return self._primary.position(self._primary.threads[0])[0]

    @property
    def waits_outside(self) -> Outside | None:
        """Who outside the box the program waits for."""
        return self._primary.waits_outside if self._primary and self._phase is _PLAYING else None

    # --- commands

    def start(self, program: CompiledProgram, *, loaded: bool = False) -> None:
        """Start a program; a primary one replaces the one that runs.

        `loaded`: it comes from a file and was played; otherwise it came through a socket.
        """
        if program.kind == "sec":
            if len(self._secondaries) >= BUDGETS.secondary_programs:
                text = f"{len(self._secondaries)} secondary programs wait already: this one is not started"
                self._state.events.append(events.ScriptFailed(1, 1, text, True))
                return
            self._secondaries.append(program.start(self._make_host(), self._secondary_work))
            return
        self.stop()
        self.name = program.name
        self.latest = self._primary = program.start(self._make_host(), self._work)
        self._phase = ProgramState.PLAYING
        self._is_loaded = loaded
        if loaded:
            self._state.planning.motion_version = 1
        self._state.motion.begin_program()
        self._state.io_configuration.follow(True)
        self._state.interpreter.program_started()
        self._state.force_sense.zero_built_in(self._state.past.steady_cycles)
        self._state.events.append(events.ProgramStarted(program.name, self._primary))

    def stop(self, *, unscheduled: bool = False) -> None:
        """End the primary program, if one runs, and stop the arm, also on its last segment to a waypoint.

        `unscheduled`: an error or the safety system did, which the outputs that follow the program show.
        """
        if self._primary is not None:
            self._primary.kill()
            self._end(unscheduled=unscheduled)
        self._state.motion.stop(at_once=unscheduled)

    def pause(self, deceleration: float = 0.0) -> None:
        """Pause the primary program; the arm comes to rest on its path.

        `deceleration` of the leading axis [rad/s²], if that is faster than the usual ramp.
        """
        if self._primary is not None and self._phase not in _STANDS_STILL:
            self._state.motion.pause(deceleration)
            self._is_unscheduled = False
            self._enter(ProgramState.PAUSING)

    def interrupt(self) -> None:
        """Stop the arm without regard for its path.

        A loaded program is paused. One that came through a socket ends, and its sockets close: live tests of
        the maker's client library wait for that, and drivers tell their users to send the program again.
        """
        if self._primary is None or not self._is_loaded:
            self.stop(unscheduled=True)
            return
        self._is_unscheduled = True
        self._state.motion.interrupt()
        if self._phase not in _STANDS_STILL:
            self._enter(ProgramState.PAUSING)

    def resume(self) -> None:
        """Let a paused program go on."""
        if self.is_paused:
            state = self._state
            state.motion.resume()
            state.watchdogs.restart(state.clock.tick)
            state.io_configuration.follow(True)
            state.events.append(events.ProgramResumed(self.name))
            self._enter(ProgramState.RESUMING)

    def end_for_memory(self, text: str) -> None:
        """End the secondary programs with an error, or, if there is none, the primary program."""
        if self._secondaries:
            for program in self._secondaries:
                program.fail(text)
                self._report(program, secondary=True)
            self._secondaries.clear()
        elif self._primary is not None:
            self._primary.fail(text)
            self._report(self._primary)
            self._end(unscheduled=True)
            self._state.motion.stop()

    def forget(self) -> None:
        """Drop the variables of the last program if it has ended."""
        if self._primary is None and self.latest is not None:
            self.latest.forget()

    # --- cycle

    def step(self) -> None:
        """Run all programs for one cycle."""
        self._ran = self._primary is not None
        self._work.renew()
        self._secondary_work.renew()
        granted = self._work.left + self._secondary_work.left
        if self.latest is not None and self._primary is None:
            self.latest.release()
        self._run()
        self.work = granted - self._work.left - self._secondary_work.left

    def _run(self) -> None:
        while self._secondaries and self._secondary_work.left > 0:
            program = self._secondaries[0]
            status = program.step()
            if program.is_between:
                break  # its cycle takes several of the box
            self._secondaries.popleft()
            if status is ProgramStatus.FAILED:
                self._report(program, secondary=True)
            else:
                program.kill()  # a secondary program has one cycle
        if self._primary is not None and (self._phase is _PLAYING or self._may_run()):
            self._state.clock.program_tick += 1
            status = self._primary.step()
            if status is not ProgramStatus.RUNNING:
                has_failed = status is ProgramStatus.FAILED
                if has_failed:
                    self._report(self._primary)
                self._end(unscheduled=has_failed)

    def _may_run(self) -> bool:
        """Advance towards a pause or out of it; return whether the threads run in this cycle."""
        state = self._state
        is_new = self._phase_since == state.clock.tick
        if self._phase is ProgramState.PAUSING and not is_new and state.motion.is_paused:
            self._enter(ProgramState.PAUSED)
            state.io_configuration.follow(False, unscheduled=self._is_unscheduled)
            state.events.append(events.ProgramPaused(self.name))
        if self._phase in _STANDS_STILL or state.motion.is_returning:
            return False
        if not is_new:
            self._enter(ProgramState.PLAYING)
        return True

    def _enter(self, phase: ProgramState) -> None:
        self._phase = phase
        self._phase_since = self._state.clock.tick

    def _report(self, program: RunningProgram, *, secondary: bool = False) -> None:
        error = program.error
        assert error is not None
        self._state.events.append(
            events.ScriptFailed(error.line, error.column, error.wire_text, secondary, error.log_text)
        )

    def _end(self, *, unscheduled: bool) -> None:
        self._primary = None
        self._state.compliance.program_ended()
        self._state.interpreter.program_ended()
        self._state.io_configuration.follow(False, unscheduled=unscheduled)
        self._state.watchdogs.clear()
        self._state.error_settings.pause_codes.clear()
        self._state.events.append(events.ProgramStopped(self.name))
