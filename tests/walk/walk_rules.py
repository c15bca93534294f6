"""What must hold in every cycle of a walk, and what must be so after a recovery."""

import math
import sys
from pathlib import Path

import numpy as np
from walk_box import WalkBox
from walk_programs import COUNTER, KEPT_OUTPUT

sys.path.append(str(Path(__file__).parent.parent / "ur_emulator"))
from states_support import check_wires

from protocol.ur_types import ControlMode, ProgramState, RobotMode, SafetyMode, SoftwareVersion
from ur_emulator.machine.controller.events import ErrorReported, Event
from ur_emulator.machine.controller.safety.modes import MOVING_MODES, ROW
from ur_emulator.machine.controller.snapshot import Snapshot
from ur_emulator.machine.motion.move import Move
from ur_emulator.machine.motion.ownership import ArmState
from ur_emulator.machine.motion.tool_streams import SpeedL, StopL

# No set-point accelerates a joint more than this [rad/s²]: the hardest of the programs' commands (6 rad/s², the
# run-up of a CB3 box adds .38 of it), a stop, and a ramp of the time scaling; and what may be added near a singularity by
# whatever moves the tool, and by force mode, in which a servoj that starts at the target of the joints is away from its
# path.
MOST, OF_PATHS, OF_FORCE = 36.0, 500.0, 110.0
STILL = 150  # cycles of 8 ms, after which a stopped arm stands still
STUCK = 12.0  # s of robot time without progress in which a program should have got on
BLOCKED = (153, 156, 157)
_DRIVEN = (ControlMode.POSITION, ControlMode.FORCE)


class BrokenRule(AssertionError):
    """A walk has found something."""


class Rules:
    """Looks at every cycle."""

    def __init__(self, box: WalkBox, version: SoftwareVersion) -> None:
        self._box = box
        self._version = version
        self._before = box.now
        self._dt = box.controller.period_s
        self._most = max(MOST, 1.5 * box.controller.state.robot.stop_deceleration)
        self._still = round(STILL * 0.008 / self._dt)
        self._stopped_for = self._unpowered_for = 0
        self._progress: tuple[object, ...] | None = None
        self.n_places = 0  # how often a program has got on
        self._waited = 0.0
        self._placed = self._held_for = 0
        self._count = 0
        box.watch(self.look, self._note)

    def look(self, now: Snapshot) -> None:
        before, self._before = self._before, now
        self._count += 1
        for name in ("actual_q", "actual_qd", "target_q", "target_qd", "target_qdd", "actual_tcp_force"):
            self._claim(all(map(math.isfinite, getattr(now, name))), f"{name} is {getattr(now, name)}")
        self._look_at_motion(before, now)
        self._look_at_stops(before, now)
        self._look_at_progress(now)
        bit = now.actual_digital_output_bits >> KEPT_OUTPUT & 1
        self._claim(bit == 1, "a digital output has changed that nobody has set")
        if self._count % 7 == 0:
            check_wires(self._box, self._version)

    def _note(self, event: Event) -> None:
        if isinstance(event, ErrorReported) and event.code in BLOCKED:
            self._placed = 6  # a blocked arm drops its target, which clients see two cycles later

    def _claim(self, holds: bool, text: str) -> None:
        if not holds:
            raise BrokenRule(f"tick {self._box.now.tick}: {text}")

    def _look_at_motion(self, before: Snapshot, now: Snapshot) -> None:
        """Set-points are continuous, and a paused arm stands still."""
        if now.control_mode != before.control_mode:
            self._placed = max(self._placed, 3)  # what follows a hand is a cycle behind it
        self._placed = max(0, self._placed - 1)
        is_held = ControlMode.TEACH not in (now.control_mode, before.control_mode)
        self._held_for = self._held_for + 1 if is_held else 0
        is_driven = now.control_mode in _DRIVEN and before.control_mode in _DRIVEN
        is_on = now.robot_mode == before.robot_mode == RobotMode.RUNNING
        if is_driven and is_on and not self._placed:
            change = np.abs(np.subtract(now.target_qd, before.target_qd)).max() / self._dt
            most = self._most + (OF_FORCE if now.control_mode == ControlMode.FORCE else 0.0)
            command = self._box.controller.state.motion._command
            if command is not None and isinstance(command.generator, Move | SpeedL | StopL):
                most += OF_PATHS
            self._claim(change <= most, f"set-point accelerates with {change:.1f} rad/s²")
            mean = 0.5 * np.add(now.target_qd, before.target_qd) * self._dt
            jump = np.abs(np.subtract(now.target_q, before.target_q) - mean).max()
            self._claim(jump <= most * self._dt**2, f"set-point jumps by {jump:.2e} rad")
        # What a hand has moved comes to rest first.
        if now.runtime_state == ProgramState.PAUSED and is_driven and self._held_for > self._still:
            self._claim(
                not any(now.target_qd), f"paused arm moves with {max(map(abs, now.target_qd)):.2e} rad/s"
            )
            if before.runtime_state == ProgramState.PAUSED and is_on and not self._placed:
                gone = np.abs(np.subtract(now.target_q, before.target_q)).max()
                self._claim(gone < 1e-9, f"paused arm goes {gone:.2e} rad")

    def _look_at_stops(self, before: Snapshot, now: Snapshot) -> None:
        mode = SafetyMode(now.safety_status)
        is_stopped = mode not in MOVING_MODES
        changed = now.safety_status != before.safety_status
        self._stopped_for = (0 if changed else self._stopped_for + 1) if is_stopped else 0
        self._unpowered_for = 0 if now.robot_mode == RobotMode.RUNNING else self._unpowered_for + 1
        if self._stopped_for > self._still or self._unpowered_for > 3:
            self._claim(now.target_qd == (0.0,) * 6, f"arm moves in {mode.name}")
            self._claim(
                now.runtime_state not in (ProgramState.STOPPING, ProgramState.RESUMING),
                f"program is {ProgramState(now.runtime_state).name} in {mode.name}",
            )
        if self._stopped_for > 1:
            self._claim(
                now.runtime_state not in (ProgramState.PLAYING, ProgramState.RESUMING),
                f"program is {ProgramState(now.runtime_state).name} in {mode.name}",
            )
            self._claim(now.control_mode == 0, f"control mode {now.control_mode} in {mode.name}")
        if not ROW[mode].may_have_power and self._stopped_for > self._still:
            self._claim(
                now.robot_mode in (RobotMode.POWER_OFF, RobotMode.CONFIRM_SAFETY),
                f"robot mode {RobotMode(now.robot_mode).name} in {mode.name}",
            )
        if now.runtime_state == ProgramState.STOPPED:
            motion = self._box.controller.state.motion
            self._claim(motion.owner is None, f"without a program {motion.owner} has the arm")

    def _look_at_progress(self, now: Snapshot) -> None:
        """A program that plays gets on, unless it waits itself, or a hand or the slider holds it."""
        state, controller = now.runtime_state, self._box.controller
        running = controller.programs.latest
        if state == ProgramState.STOPPED or running is None:
            self._progress = None
            return
        held = (
            state == ProgramState.PAUSED
            or bool(controller.state.pendant.requests)
            or controller.state.interpreter.is_on
            or controller.state.compliance.askers & {"client", "input"}
            or now.safety_status not in (SafetyMode.NORMAL, SafetyMode.REDUCED)
            or now.robot_mode != RobotMode.RUNNING
        )
        place = (
            controller.state.registers.outputs.integers[COUNTER],
            tuple(running.position(thread) for thread in running.threads[:1]),
            state,
            controller.state.motion.path.q if controller.state.motion.state is ArmState.MOVING else None,
        )
        self.n_places += place != self._progress
        if place != self._progress or held:
            self._progress, self._waited = place, 0.0
        slider = now.target_speed_fraction * (0.25 if now.safety_status == SafetyMode.REDUCED else 1.0)
        self._waited += self._dt * slider
        self._claim(self._waited < STUCK, f"program is stuck, {ProgramState(state).name}, at line {place[1]}")
