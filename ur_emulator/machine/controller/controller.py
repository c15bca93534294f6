"""The control box as a function of its commands: `tick(commands)` advances one cycle, gives a snapshot.

The order of a cycle is written in `Controller.tick` and nowhere else: commands, modes, script threads, motion
with the check of its set-points, plant, sensors, safety, snapshot. Must not know sockets, threads or a clock:
time is the tick.
"""

from collections.abc import Callable, Iterable, Sequence

from protocol.rtde.types import SafetyStatusBits
from protocol.ur_types import ControlMode, RobotMode
from ur_emulator.errors import ModelError
from ur_emulator.machine.controller.arm_in_space import ArmInSpace
from ur_emulator.machine.controller.command import Command, Outcome, outcome_of
from ur_emulator.machine.controller.events import RobotModeChanged
from ur_emulator.machine.controller.force_sense import VARIABLE
from ur_emulator.machine.controller.io.watchdogs import WatchdogAction
from ur_emulator.machine.controller.program_runner import ProgramRunner
from ur_emulator.machine.controller.robot_mode import JOINT_VECTORS, ModeCommand
from ur_emulator.machine.controller.safety.inputs import ACTIVE
from ur_emulator.machine.controller.safety.limit_checks import UNREACHABLE_PATH, Violation
from ur_emulator.machine.controller.safety.modes import SafetyEvent
from ur_emulator.machine.controller.safety.safety_state import UNLOCK_DELAY
from ur_emulator.machine.controller.safety_system import SafetySystem
from ur_emulator.machine.controller.snapshot import Snapshot
from ur_emulator.machine.controller.state import ControllerState
from ur_emulator.machine.kinematics.arm_model import ArmModel
from ur_emulator.machine.models.fidelity import Fidelity
from ur_emulator.machine.models.robot_model import ZERO6, RobotModel, Vector6
from ur_emulator.machine.motion.generators import JointTarget, TorqueCommand
from ur_emulator.machine.motion.tool import UnreachableError
from ur_emulator.machine.plant.arm_plant import ArmPlant, PlantState
from ur_emulator.machine.plant.exact import ExactPlant
from ur_emulator.machine.plant.plant import Plant
from ur_emulator.machine.tools import SUPPLY
from ur_hil.arithmetic import add_up
from ur_hil.tools import ToolModel
from urscript.run.host import Host
from urscript.run.waits import Outside

# Run time of a unit of work [ms]. Source: urscript.catalogue.costs.
_UNIT_TIME = 50e-6
# Looked up once.
_BY_HAND = ControlMode.TEACH
_ENABLING_BIT = int(SafetyStatusBits.THREE_POSITION_ENABLING_INPUT_ACTIVE)


def make_snapshot(
    state: ControllerState, programs: ProgramRunner, sensed: PlantState, control: ControlMode
) -> Snapshot:
    """Return everything that any port may publish of this cycle.

    The target is the one with which the cycle began: target and measurements are of the same moment.
    `sensed` is the state of the arm as `Plant.report` gives it, `control` how it was driven.
    """
    target = state.past.target
    arm, clock, sensor, wrench = state.arm, state.clock, state.force_sense.sensor, sensed.estimated_force
    if sensor is not None:
        wrench = sensor.wrench_at_flange(state.client_inputs.get(VARIABLE, ZERO6), arm.fk(sensed.actual_q))
    wrench = state.force_sense.measure(wrench)
    tcp = state.tool.tcp_offset
    space = ArmInSpace(
        arm,
        (target.q, target.qd),
        target.qdd,
        (sensed.actual_q, sensed.actual_qd),
        wrench,
        tcp if any(tcp) else None,
        state.force_sense.refers_to_flange,
    )
    mode, safety_mode = state.mode.mode, state.safety.mode
    speed, tool, io = state.speed, state.tool, state.io
    payload, own_time = tool.payload, clock.generation.execution_time
    analog, (encoder_0, encoder_1) = io.analog, state.encoders
    return Snapshot(
        clock.tick,
        clock.time,
        *(target + sensed),
        robot_mode=int(mode),
        joint_mode=JOINT_VECTORS[mode, safety_mode],
        safety_mode=int(safety_mode),
        safety_status=int(state.safety.status),
        enabling_bit=_ENABLING_BIT if state.enabling_device.state in ACTIVE else 0,
        speed_scaling=speed.share,
        target_speed_fraction=speed.slider,
        runtime_state=int(programs.runtime_state),
        program_name=programs.name,
        script_control_line=programs.line if programs.reports_line else 0,
        control_mode=int(control),
        is_guided_by_input="input" in state.compliance.askers,
        buttons=state.pendant.buttons,
        payload=payload.mass,
        payload_cog=payload.cog,
        payload_inertia=payload.inertia,
        tcp_offset=tool.tcp_offset,
        actual_digital_input_bits=io.digital_in,
        actual_digital_output_bits=io.digital_out,
        analog_values=analog.values,
        analog_domains=analog.domains,
        tool_output_voltage=io.tool_voltage,
        gripper_current=add_up(g.supply_current for g in state.grippers) if state.grippers else 0.0,
        tool_output_modes=io.tool_output_modes,
        tool_line=io.tool_line,
        euromap_inputs=io.euromap_inputs,
        euromap_outputs=io.euromap_outputs,
        registers=state.registers.values(),
        encoder_counts=(int(encoder_0.count), int(encoder_1.count)),
        gravity=tool.gravity,
        base_acceleration=tool.base_acceleration,
        energy_consumed=state.energy.consumed,
        actual_execution_time=own_time + _UNIT_TIME * programs.work if own_time else 0.0,
        space=space,
        supply=arm.robot.generation.electrics,
    )


# Time after the last activity until the simulation may pause in lockstep, so that the arm comes to rest [s].
# Joints of a CB3 creep for up to .9 s, below 1 mrad/s: more time would let clients begin in cycles that
# depend on the speed of the machine.
SETTLE_TIME = 0.2


class Controller:
    """One control box without its ports; commands act on its public parts (`command.BoxParts`).

    Attributes:
        outcomes: of the commands of the last cycle, in their order.
    """

    outcomes: list[Outcome]

    def __init__(
        self,
        robot: RobotModel,
        fidelity: Fidelity,
        seed: int,
        make_robot: Callable[[ControllerState], Callable[[], Host]],
        *,
        mode: RobotMode = RobotMode.RUNNING,
        version: tuple[int, int] | None = None,
        tools: Sequence[ToolModel] = (),
    ) -> None:
        """Assemble the box.

        Args:
            fidelity: how far the arm is from a perfect one.
            seed: of everything random in the box: calibration, phases, noise.
            make_robot: called once with the parts of the controller; what it returns makes the robot as one
                program sees it.
            version: of the software, major and minor; None: the usual one of the generation.
            tools: on the flange.
        """
        self.generation = generation = robot.generation
        self.period_s = generation.period_s
        make_plant = Plant if fidelity.has_physics else ExactPlant
        self.plant: ArmPlant = make_plant(robot, fidelity, seed, tools)
        q = robot.home_q
        if self.plant.touches(q):
            raise ModelError(f"{robot.name}: at home_q the arm would touch itself or the table; give another")
        self.plant.reset(q)
        self._mode = mode
        self._settle = 0
        self._settle_cycles = generation.cycles(SETTLE_TIME)
        # Time must not pause before a protective stop can be unlocked. Two cycles more: the cycle of the stop
        # counts, and the delay must have passed.
        self._unlock_cycles = generation.cycles(UNLOCK_DELAY) + 2
        self.state = state = ControllerState(
            ArmModel(robot, self.plant.dh),
            fidelity,
            seed,
            mode,
            version or generation.parse_version(generation.default_version)[:2],
            tools,
            self._place_arm,
        )
        self._payload = state.tool.payload
        state.past.place(state.motion.target, self.plant.sense())
        self.programs = ProgramRunner(state, make_robot(state))
        self.safety = SafetySystem(state, self.programs, self.plant)
        state.mode.command(ModeCommand.BOOT)
        # The first cycle only makes the first snapshot; nothing moves in it.
        self.tick(())

    @property
    def snapshot(self) -> Snapshot:
        """What ports publish of the last cycle."""
        return self.state.past.snapshot

    @property
    def is_active(self) -> bool:
        """True while the box is busy or the arm settles: in lockstep time passes only then."""
        return self._settle > 0 or self.is_busy

    @property
    def is_busy(self) -> bool:
        """True while a program runs, the arm moves, a mode changes or a protective stop is locked."""
        return self.programs.has_work or self._settle > self._settle_cycles or self._is_moving

    @property
    def waits_outside(self) -> Outside | None:
        """Who outside the box a script waits for; None while the arm or its surroundings need time."""
        waits = self.programs.waits_outside
        return None if waits is Outside.OPERATOR and self._is_moving else waits

    @property
    def _is_moving(self) -> bool:
        return (
            self.state.motion.is_moving
            or self.state.mode.is_changing
            or self.safety.is_braking
            or self.plant.push_left > 0
            or any(gripper.is_busy for gripper in self.state.grippers)
        )

    def tick(self, commands: Iterable[Command]) -> Snapshot:
        """Advance one control cycle; return what ports publish of it.

        The commands are those since the last cycle, in order of arrival.
        """
        state = self.state
        state.clock.tick += 1
        n_events = len(state.events)
        was_pushing = self.plant.push_left > 0
        if was_pushing:
            self.plant.count_push()
        self.outcomes = []
        for command in commands:
            self.outcomes.append(outcome_of(command, self))
        self._step_modes()
        self._step_scripts()
        was_active = was_pushing or self.programs.has_work or state.motion.is_moving or state.mode.is_changing
        running = state.mode.mode is RobotMode.RUNNING
        control, target, torque = self._step_motion(running)
        self.plant.step(target if running else None, control, torque)
        if state.grippers:
            self._step_grippers()
        sensed = self.plant.sense()
        state.energy.step(state.mode.mode, sensed.actual_current)
        self._watch(sensed, control, running)
        settings = state.error_settings
        if settings.pause_codes and settings.must_pause(state.events[n_events:]):
            self.programs.pause()
        was_active = was_active or (control is _BY_HAND and any(target.qd))
        self._settle = max(self._settle - 1, self._settle_cycles if was_active else 0)
        snapshot = make_snapshot(state, self.programs, self.plant.report(state.past.sensed), control)
        # What has stopped the arm may have dropped its target.
        target = state.motion.target
        state.past.add(snapshot, target, sensed, is_still=not control and not any(target.qd))
        return snapshot

    # --- the parts of a cycle, in their order

    def _step_modes(self) -> None:
        """Robot mode and safety mode; watchdogs, encoders and Modbus signals, which scripts read next."""
        state = self.state
        state.mode.step()
        if state.mode.mode is not self._mode:
            self._mode = state.mode.mode
            state.events.append(RobotModeChanged(int(self._mode)))
            if self._mode is RobotMode.RUNNING:
                self.safety.check_range()
        self.safety.step()
        # Rare parts are asked whether they hold anything: a step that does nothing takes longer.
        if state.watchdogs and not self.programs.is_paused:
            self._check_watchdogs()
        for encoder in state.encoders:
            if encoder.decoder:
                encoder.step(state.io.digital_in)
        if state.modbus.signals:
            state.modbus.step(state.clock.tick)

    def _step_scripts(self) -> None:
        """All threads of all programs, and the effects of their requests."""
        state = self.state
        self.programs.step()
        requests = state.requests
        if requests.pause:
            requests.pause = False
            self.programs.pause()
        if requests.power_off:
            requests.power_off = False
            self.safety.cut_power()
        state.tool.step()
        payload = state.tool.payload
        if payload is not self._payload:
            # The plant carries the payload that programs declare.
            self._payload = payload
            self.plant.set_payload(payload.mass, payload.cog, payload.inertia)

    def _step_motion(self, running: bool) -> tuple[ControlMode, JointTarget, TorqueCommand | None]:
        """How the arm is driven in this cycle, to where, and by which torque."""
        state, compliance = self.state, self.state.compliance
        if compliance.is_active:
            compliance.step()
        target = self._next_target() if running else state.motion.step(self.period_s, state.speed.slider)
        return compliance.mode, target, compliance.torque()

    def _step_grippers(self) -> None:
        """Let the grippers see their fingers, and drive them in the next cycle."""
        state, plant = self.state, self.plant
        is_on, has_supply = state.mode.mode >= RobotMode.POWER_ON, state.io.tool_voltage == SUPPLY
        plant.finger_commands = [
            gripper.step(fingers, is_on and (has_supply or gripper.has_cable), state.io)
            for gripper, fingers in zip(state.grippers, plant.fingers, strict=True)
        ]

    def _watch(self, sensed: PlantState, control: ControlMode, running: bool) -> None:
        """Stop the arm if the measured state violates a limit, or a stop was requested."""
        state, settings = self.state, self.state.error_settings
        is_watched = running and state.safety.is_watched  # before a stop
        if violation := self.safety.watch(sensed, control, running):
            self._stop_for(violation, sensed.actual_q)
        may_warn = is_watched and settings.warns_of_deviation
        if may_warn and (warning := settings.deviation_warning(sensed.position_error)):
            state.events.append(warning)

    def _check_watchdogs(self) -> None:
        if late := self.state.watchdogs.late(self.state.clock.tick):
            report, action = late
            self.state.events.append(report)
            if action is WatchdogAction.PAUSE:
                self.programs.pause()
            else:
                self.programs.stop()

    # --- stops

    def _next_target(self) -> JointTarget:
        """Advance the motion; an invalid set-point is replaced by a protective stop."""
        state, before = self.state, self.state.motion.target
        scale, limiter = state.speed.slider, state.speed.limiter
        if limiter is not None:
            scale = limiter.step(state.motion, state.arm, state.tool.tcp_offset, scale, self.period_s)
        try:
            target = state.motion.step(self.period_s, scale)
            if target is before or state.safety.is_stopped or state.motion.is_compliant:
                return target
            violation = self.safety.find_invalid(before, target)
        except UnreachableError:
            violation = UNREACHABLE_PATH
        if violation is None:
            return target
        state.motion.retract(before)
        self._stop_for(violation, state.past.sensed.actual_q)
        return state.motion.step(self.period_s, scale)

    def _stop_for(self, violation: Violation, actual_q: Vector6) -> None:
        state = self.state
        self._settle = self._unlock_cycles
        state.events.append(violation.error)
        self.safety.handle(SafetyEvent.PROTECTIVE_STOP)
        if violation.blocked:
            state.motion.place(actual_q)
            self.plant.hold_trim()

    def _place_arm(self, q: Vector6) -> bool:
        plant, state = self.plant, self.state
        if plant.touches(q):
            return False
        plant.reset(q)
        state.motion.place(q)
        state.past.place(state.motion.target, plant.sense())
        return True
