"""The control box as a function of its commands: `tick(commands)` advances one cycle, gives a snapshot.

The order of a cycle is written in `Controller.tick` and nowhere else: commands, modes, script threads, motion
with the check of its set-points, plant, sensors, safety, snapshot. Must not know sockets, threads or a clock:
time is the tick.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress

from protocol.primary.messages import ReportLevel
from protocol.ur_types import ControlMode, RobotMode
from ur_emulator.controller.command import Command
from ur_emulator.controller.compliance.flange_push import FlangePush
from ur_emulator.controller.events import (
    ErrorReported,
    Event,
    RobotModeChanged,
)
from ur_emulator.controller.io.watchdogs import WatchdogAction
from ur_emulator.controller.reporting import make_snapshot
from ur_emulator.controller.robot_mode import ModeCommand, RobotModeMachine
from ur_emulator.controller.safety.limit_checks import (
    UNREACHABLE_PATH,
    SetpointCheck,
    Violation,
    find_violation,
)
from ur_emulator.controller.safety.modes import SafetyEvent
from ur_emulator.controller.safety.safety_state import UNLOCK_DELAY
from ur_emulator.controller.safety.system import SafetySystem
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.controller.state import ControllerState
from ur_emulator.errors import RefusedError
from ur_emulator.kinematics.arm_model import ArmModel
from ur_emulator.models.calibration import draw_calibration
from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.robot_generation import CB3, RobotGeneration
from ur_emulator.models.robot_model import RobotModel, Vector6, six
from ur_emulator.motion.arm_motion import ArmMotion
from ur_emulator.motion.target import JointTarget
from ur_emulator.motion.tool import UnreachableError
from ur_emulator.plant.exact import ExactPlant
from ur_emulator.plant.plant import Plant
from ur_emulator.plant.plant_state import PlantState
from ur_emulator.scripting.network import Network
from ur_emulator.scripting.program_slot import ProgramSlot

# A box that serves has booted a minute ago [s]: clients distrust a controller clock below 40 s (public client
# library).
BOOT_TIME = 60.0
# After the last activity the arm gets this time to come to rest before time may stand still [s].
SETTLE_TIME = 0.2


class Controller:
    """One control box without its ports; commands act on its public parts (`command.Box`)."""

    def __init__(
        self,
        robot: RobotModel,
        fidelity: Fidelity,
        seed: int,
        network: Network,
        *,
        mode: RobotMode = RobotMode.RUNNING,
        generation: RobotGeneration = CB3,
    ) -> None:
        """Assemble the box.

        Args:
            robot: the arm.
            fidelity: how far it is from a perfect one.
            seed: of everything random in it: calibration, phases, noise.
            network: opens the sockets of scripts.
            mode: robot mode to start in.
            generation: of the robot; its control cycle.
        """
        self.generation = generation
        self.period_s = generation.period_s
        make_plant = Plant if fidelity.has_physics else ExactPlant
        self.plant = make_plant(robot, fidelity, seed, generation)
        arm = ArmModel(robot, draw_calibration(fidelity, seed))
        q = six(robot.home_q)
        self.plant.reset(q)
        self._setpoints = SetpointCheck(robot, self.period_s)
        self._mode = mode
        self._saturated_s = 0.0
        self._settle = 0
        self._settle_cycles = generation.cycles(SETTLE_TIME)
        # A protective stop can be unlocked after a while; time must not stand still before that. Two cycles
        # more: the one in which it happens counts, and the delay must have passed, not be about to.
        self._unlock_cycles = generation.cycles(UNLOCK_DELAY) + 2
        self.state = ControllerState(
            robot=robot,
            arm=arm,
            generation=generation,
            seed=seed,
            motion=ArmMotion(q, robot.stop_deceleration),
            mode=RobotModeMachine(mode, self.period_s),
            tick=generation.cycles(BOOT_TIME),
        )
        self.state.place_arm = self._place_arm
        self._payload = self.state.payload
        self.programs = ProgramSlot(self.state, network)
        self.safety = SafetySystem(self.state, self.programs)
        self.push = FlangePush(self.plant, self.period_s)
        self.state.mode.command(ModeCommand.BOOT)
        # The first cycle only makes the first snapshot; nothing moves in it.
        self.tick(())

    @property
    def snapshot(self) -> Snapshot:
        """State at the end of the last cycle."""
        return self.state.snapshot

    @property
    def is_active(self) -> bool:
        """True while the box is busy or the arm settles: why time passes in lockstep."""
        return self._settle > 0 or self.is_busy

    @property
    def is_busy(self) -> bool:
        """True while a program runs, the arm moves, a mode changes or a protective stop is locked."""
        return (
            self.programs.has_work
            or self.state.motion.is_moving
            or self.state.mode.is_changing
            or self.safety.is_stopping
            or self._settle > self._settle_cycles
            or self.push.will_end
        )

    @property
    def waits_outside(self) -> bool:
        """True while a script waits for something that only the outside can bring."""
        return self.programs.waits_outside

    def take_events(self) -> list[Event]:
        """Return what was said since the last call and forget it."""
        events, self.state.events = self.state.events, []
        return events

    def tick(self, commands: Iterable[Command]) -> Snapshot:
        """Advance one control cycle.

        Args:
            commands: what was asked since the last cycle, in order of arrival.

        Returns:
            The state at the end of the cycle.
        """
        state = self.state
        state.tick += 1
        n_events = len(state.events)
        was_pushing = self.push.will_end
        if was_pushing:
            self.push.step()
        for command in commands:
            with suppress(RefusedError):  # who wants to know has submitted it with `done`
                command.apply(self)
        self._step_modes()
        self._step_scripts()
        was_active = was_pushing or self.programs.has_work or state.motion.is_moving or state.mode.is_changing
        running = state.mode.mode is RobotMode.RUNNING
        control, target = self._step_motion(running)
        self.plant.step(target if running else None, control)
        sensed = self.plant.sense()
        self._watch(sensed, control, running)
        settings = state.error_settings
        if settings.pause_codes and settings.asks_for_pause(state.events[n_events:]):
            self.programs.pause()
        is_still = not control and not any(target.qd)
        state.steady_cycles = state.steady_cycles + 1 if is_still else 0
        was_active = was_active or (control is _BY_HAND and any(target.qd))
        self._settle = max(self._settle - 1, self._settle_cycles if was_active else 0)
        state.snapshot = make_snapshot(state, self.programs, target, sensed)
        state.q_history.appendleft(sensed.actual_q)
        return state.snapshot

    # --- the parts of a cycle, in their order

    def _step_modes(self) -> None:
        """Robot mode and safety mode; watchdogs, encoders and Modbus signals, which scripts will look at."""
        state = self.state
        state.mode.step()
        if state.mode.mode is not self._mode:
            self._mode = state.mode.mode
            state.events.append(RobotModeChanged(int(self._mode)))
            if self._mode is RobotMode.RUNNING:
                self.safety.check_range()
        if self.safety.is_busy:
            self.safety.step()
        if state.watchdogs and not self.programs.is_paused:
            self._check_watchdogs()
        if state.encoders.decoding:
            state.encoders.step(state.io.digital_in)
        if state.modbus.signals:
            state.modbus.step(state.tick)

    def _step_scripts(self) -> None:
        """All threads of all programs, and what they have asked of the box."""
        state = self.state
        self.programs.step()
        if state.power_off_requested:
            state.power_off_requested = False
            self.safety.cut_power()
        if state.payload is not self._payload:
            # What a program declares is taken to be really there: the arm carries it from now on.
            self._payload = state.payload
            self.plant.set_payload(state.payload.mass, state.payload.cog)

    def _step_motion(self, running: bool) -> tuple[ControlMode, JointTarget]:
        """How the arm is driven in this cycle, and to where."""
        state, compliance = self.state, self.state.compliance
        control = _BY_POSITION
        if compliance.is_on or state.io_configuration.input_actions or state.modbus.signals:
            control = compliance.step(state)
        target = self._next_target() if running else state.motion.step(self.period_s, state.speed_slider)
        return control, compliance.follow_hand(state) if control is _BY_HAND else target

    def _watch(self, sensed: PlantState, control: ControlMode, running: bool) -> None:
        """Stop the arm if what the sensors say breaks a limit, or somebody has asked for it."""
        state = self.state
        self._saturated_s = self._saturated_s + self.period_s if sensed.torque_saturated else 0.0
        if running and state.safety.is_watched:
            violation = find_violation(state.robot, sensed, self._saturated_s)
            if self.safety.is_busy and violation is None:
                violation = self.safety.find_violation(sensed)
            if control and violation is None:
                violation = state.compliance.find_violation(state.robot, sensed)
            if violation is None and state.stop_requested:
                violation = _REQUESTED_STOP
            if violation is not None:
                self._stop_for(violation, sensed.actual_q)
            settings = state.error_settings
            if settings.warns_of_deviation and (warning := settings.deviation_warning(sensed.position_error)):
                state.events.append(warning)
        state.stop_requested = False

    def _check_watchdogs(self) -> None:
        late = self.state.watchdogs.late(self.state.tick)
        if late is None:
            return
        self.state.events.append(late.report)
        if late.action is WatchdogAction.PAUSE:
            self.programs.pause()
        else:
            self.programs.stop()

    # --- stops

    def _next_target(self) -> JointTarget:
        """Advance the motion; an invalid set-point never reaches the joints: they brake before it."""
        state, before = self.state, self.state.motion.target
        scale = state.speed_slider
        if state.limiter is not None:
            scale = state.limiter.step(state.motion, scale, self.period_s)
        try:
            target = state.motion.step(self.period_s, scale)
            if target is before or state.safety.is_stopped:
                return target
            violation = self._setpoints.find_invalid(before, target)
        except UnreachableError:
            violation = UNREACHABLE_PATH
        if violation is None:
            return target
        state.motion.retract(before)
        self._stop_for(violation, state.snapshot.actual_q)
        return state.motion.step(self.period_s, scale)

    def _stop_for(self, violation: Violation, actual_q: Vector6) -> None:
        state = self.state
        self._settle = self._unlock_cycles
        state.events.append(violation.error)
        self.safety.happen(SafetyEvent.PROTECTIVE_STOP)
        if violation.blocked:
            state.motion.place(actual_q)
            self.plant.rest_trim()

    def _place_arm(self, q: Vector6) -> bool:
        if self.plant.touches(q):
            return False
        self.plant.reset(q)
        self.state.motion.place(q)
        return True


_BY_POSITION, _BY_HAND = ControlMode.POSITION, ControlMode.TEACH
_REQUESTED_STOP = Violation(ErrorReported(209, 0, ReportLevel.WARNING, "Protective stop requested"))
