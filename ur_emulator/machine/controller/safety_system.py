"""SafetySystem: the safety mode changes with its events, and arm, program and power follow."""

from collections.abc import Mapping

from protocol.ur_types import ControlMode, ProgramState, RobotMode, SafetyMode
from ur_emulator.machine.controller.events import LogAdded, SafetyModeChanged
from ur_emulator.machine.controller.program_runner import ProgramRunner
from ur_emulator.machine.controller.robot_mode import POWERED, ModeCommand
from ur_emulator.machine.controller.safety import modes
from ur_emulator.machine.controller.safety.boundaries import TRIGGER_BAND
from ur_emulator.machine.controller.safety.inputs import Guard, OperationalMode, SafetyInput, SafetyInputs
from ur_emulator.machine.controller.safety.limit_checks import (
    JointWatch,
    SetpointCheck,
    Violation,
    protective_stop,
)
from ur_emulator.machine.controller.safety.safety_state import ConfiguredLimits
from ur_emulator.machine.controller.safety.speed_scaling import SpeedLimiter, limits_of_mode
from ur_emulator.machine.controller.state import ControllerState
from ur_emulator.machine.motion.arm_motion import SCALING_RATE
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.plant.arm_plant import ArmPlant, PlantState

# Joints settle behind their targets. The brakes wait for them, at most the second time (chosen) [s].
BRAKE_DELAY, LONGEST_BRAKING = 0.05, 1.5
_REQUESTED_STOP = protective_stop(209, 0, "Protective stop requested")


class SafetySystem:
    """Applies safety events by the tables of `safety/modes.py`, and their effects."""

    def __init__(self, state: ControllerState, programs: ProgramRunner, plant: ArmPlant) -> None:
        self._state = state
        self._plant = plant
        state.arm.range = plant.range
        self._programs = programs
        self.inputs = SafetyInputs(
            self.handle, state.enabling_device, state.operational, self._begin_operational_mode
        )
        self._cut_after: int | None = None
        self._rests_since: int | None = None
        self._is_waiting = False
        self._is_beyond_trigger = False
        self._setpoints = SetpointCheck(state.robot, state.clock.period_s)
        self._joints = JointWatch(state.robot)

    @property
    def is_braking(self) -> bool:
        """True until the power is cut after an emergency stop."""
        return self._cut_after is not None

    def set_up_inputs(self, inputs: Mapping[int, SafetyInput]) -> None:
        """Set up what an installation has of the inputs that need operational modes, and free its others."""
        for pair, function in tuple(self.inputs.assigned.items()):
            if function.needs_operational_modes:
                self.inputs.assign(pair, None)
        for pair, function in inputs.items():
            self.inputs.assign(pair, function)
        self.inputs.require_reset(Guard.AUTOMATIC, SafetyInput.AUTOMATIC_RESET in inputs.values())

    def set_limits(self, limits: ConfiguredLimits) -> None:
        """Set the limits of joints and space, in place of those of the arm's model.

        The mode in force, the inverse kinematics and freedrive keep them too.
        """
        self._state.safety.set_limits(limits)
        self._plant.set_range(limits.q_min, limits.q_max)
        self._set_limits(self._state.safety.mode)

    def handle(self, event: modes.SafetyEvent) -> None:
        """Apply an event."""
        state, safety = self._state, self._state.safety
        before = safety.mode
        was_braking = self.is_braking
        safety.apply(event, state.clock.time)
        if safety.mode is not before:
            state.events.append(SafetyModeChanged(int(safety.mode)))
            self._react(before)
        if event.value.cuts_power or (was_braking and modes.ROW[safety.mode].may_have_power):
            self.cut_power()  # an emergency stop ends without power, however soon it is released

    def cut_power(self) -> None:
        """End the program, apply the brakes and cut the power at once."""
        state = self._state
        self._cut_after = self._rests_since = None
        self._is_waiting = False
        self._programs.stop()
        state.mode.command(ModeCommand.POWER_OFF)
        state.motion.stop()
        state.motion.place(state.past.sensed.actual_q)
        self.handle(modes.SafetyEvent.POWERED_OFF)

    def check_range(self) -> None:
        """Check joint ranges and boundaries when the brakes have opened."""
        if not self._is_in_range():
            self.handle(modes.SafetyEvent.RANGE_LEFT)

    # --- cycle

    def step(self) -> None:
        """Begin a cycle."""
        state = self._state
        if self.inputs.assigned:
            self.inputs.step(state.io.digital_in)
        if self._is_beyond_trigger or state.safety.limits.boundaries:
            self._watch_space()
        if state.safety.has(SafetyMode.RECOVERY) and self._is_in_range():
            self.handle(modes.SafetyEvent.RANGE_KEPT)
        if self._cut_after is not None:
            if state.motion.is_moving:
                self._rests_since = None
            elif self._rests_since is None:
                self._rests_since = state.clock.tick
            if state.clock.tick >= self._cut_after or (
                self._rests_since is not None
                and (state.clock.tick - self._rests_since) * state.clock.period_s >= BRAKE_DELAY
            ):
                self.cut_power()

    def find_invalid(self, before: JointTarget, target: JointTarget) -> Violation | None:
        """Return what is wrong with the set-point `target`, which follows `before`; None: nothing."""
        state = self._state
        invalid = self._setpoints.find_invalid(state.safety.limits, before, target)
        if invalid is not None or not state.safety.boundaries:
            return invalid
        way = (target.q, *state.motion.way_to_rest(target))
        now, *ahead = (state.arm.state(q, target.qd, state.tool.tcp_offset) for q in way)
        near = state.safety.boundaries.find_near(now, ahead)
        return None if near is None else Violation(near)

    def watch(self, sensed: PlantState, control: ControlMode, running: bool) -> Violation | None:
        """Return why the arm is to be stopped now that this is measured, or None; in every cycle.

        `control` is how the arm was driven, `running` whether it had power and its brakes were open.
        """
        state = self._state
        is_requested = state.requests.protective_stop
        state.requests.protective_stop = False
        self._joints.count_saturation(sensed)
        if not state.safety.is_watched:
            return None
        found = None
        if running:
            plays = self._programs.runtime_state is ProgramState.PLAYING
            may_hold = plays and state.error_settings.holds_high
            found = self._joints.find_violation(sensed, state.motion.target.qd, may_hold=may_hold)
            if found is None and (limiter := state.speed.limiter) is not None:
                space, period_s = state.past.snapshot.space, state.clock.period_s
                found = limiter.find_violation(sensed, space, period_s)
            if found is None and control:
                found = state.compliance.find_violation(sensed)
        return found or (_REQUESTED_STOP if is_requested else None)

    # --- space

    def _watch_space(self) -> None:
        """Let planes trigger reduced mode, and a boundary that is crossed be a violation."""
        state, arm = self._state, self._state.past.snapshot.space.actual
        gap = state.safety.limits.boundaries.trigger_gap(arm)
        if gap < 0.0 if not self._is_beyond_trigger else gap > TRIGGER_BAND:
            self._is_beyond_trigger = not self._is_beyond_trigger
            self.inputs.reduce(self._is_beyond_trigger, "plane")
        if state.mode.mode is RobotMode.RUNNING and state.safety.is_watched:
            crossed = state.safety.boundaries.find_crossed(arm)
            if crossed is not None:
                state.events.append(crossed)
                self.handle(modes.SafetyEvent.VIOLATION)

    # --- effects

    def _react(self, before: SafetyMode) -> None:
        state, mode = self._state, self._state.safety.mode
        row, row_before = modes.ROW[mode], modes.ROW[before]
        self._set_limits(mode)
        robot_mode = state.mode.mode
        if row.arm is modes.ArmEffect.POWER_OFF:
            if row_before.arm is not modes.ArmEffect.POWER_OFF:
                self._is_waiting = False
                self._programs.stop(unscheduled=True)
                if robot_mode is RobotMode.RUNNING:
                    self._cut_after = state.clock.tick + round(LONGEST_BRAKING / state.clock.period_s)
                elif robot_mode in POWERED:
                    self.cut_power()
        elif row.arm is modes.ArmEffect.STOP:
            self._is_waiting = False
            self._programs.interrupt()
        elif row.arm is modes.ArmEffect.PATH_STOP:
            if row.program is modes.ProgramEffect.PAUSE_FOR_A_WHILE and row_before.may_move:
                self._wait()
        elif self._is_waiting:
            self._is_waiting = False
            if robot_mode is RobotMode.RUNNING:
                self._programs.resume()

    def _begin_operational_mode(self) -> None:
        state, mode = self._state, self._state.operational.mode
        self._set_limits(state.safety.mode)
        state.events.append(LogAdded("Safety", f"Operational mode: {mode.name}"))
        if mode is OperationalMode.MANUAL and not state.robot.generation.has_remote_in_manual:
            state.pendant.set_remote_control(False)

    def _wait(self) -> None:
        """Pause program and arm until the mode ends; a program that was paused before stays paused."""
        state, programs = self._state, self._programs
        hard = 0.0 if state.error_settings.transition_hardness else state.robot.stop_deceleration
        if not programs.is_running:
            state.motion.stop()
        elif not programs.is_paused:
            self._is_waiting = True
            programs.pause(hard)

    def _set_limits(self, mode: SafetyMode) -> None:
        state = self._state
        is_manual, rules = state.operational.allows.is_slow, state.robot.generation.limits
        limits = limits_of_mode(mode, is_manual, state.safety.limits, rules)
        state.motion.scaling_rate = SCALING_RATE
        hard = not state.error_settings.transition_hardness
        state.speed.limiter = None if limits is None else SpeedLimiter(limits, state.motion.scale, hard)

    def _is_in_range(self) -> bool:
        safety, past = self._state.safety, self._state.past
        in_space = safety.limits_in_space()
        crossed = in_space and in_space.find_crossed(past.snapshot.space.actual)
        return safety.limits.allow(past.sensed.actual_q) and not crossed
