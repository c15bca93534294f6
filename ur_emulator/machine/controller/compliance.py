"""Compliance: freedrive and force mode: who has requested them, and the control mode that follows.

Freedrive (also "teach mode") is requested by the program, by a client or by inputs that are set up for it;
force mode by the program. Both are modes of the robot, not of the thread that has requested them.
Source: URScript manual CB3 3.15: freedrive_mode, teach_mode, force_mode, set_*_digital_input_action. Chosen:
an input acts once no move runs, with or without a program; freedrive replaces force mode.
"""

from math import hypot
from typing import Literal

from protocol.ur_types import JOINT_NAMES, ControlMode, RobotMode
from ur_emulator.machine.controller.io.configuration import IoConfiguration
from ur_emulator.machine.controller.past_cycles import PastCycles
from ur_emulator.machine.controller.robot_mode import RobotModeMachine
from ur_emulator.machine.controller.safety.inputs import OperationalModeChoice
from ur_emulator.machine.controller.safety.limit_checks import (
    SPEED_TOLERANCE,
    Violation,
    protective_stop,
)
from ur_emulator.machine.controller.safety.safety_state import ConfiguredLimits, SafetyState
from ur_emulator.machine.models.robot_model import ZERO6, RobotModel, Vector6
from ur_emulator.machine.motion.arm_motion import ArmMotion
from ur_emulator.machine.motion.axis_hold import AxisHold
from ur_emulator.machine.motion.force_mode import ForceMode
from ur_emulator.machine.motion.generators import TorqueCommand
from ur_emulator.machine.motion.ownership import ArmState
from ur_emulator.machine.plant.arm_plant import PlantState

# An external force above this when freedrive begins means a wrong payload or a push. Chosen: of a sensor six
# times its precision. An arm without one takes for a force what friction bears at rest, a second after a
# motion up to 25 N on a UR3 and 56 N on a UR5: 13 N per kg of the rated payload.
_OF_SENSOR, _OF_ESTIMATE = 20.0, 13.0  # N, N/kg

# Who asks for freedrive; the teach button acts as an input.
Asker = Literal["program", "client", "input"]

_AXES = ("x", "y", "z", "rx", "ry", "rz")


class Compliance:
    """Requests for freedrive and force mode; each acts on the motion of the arm when it comes.

    Attributes:
        askers: who has requested freedrive.
        force_damping: as programs have set it, for a force mode to come; 0..1.
        force_gain_scaling: likewise, 0..2.
        is_teach_pressed: the teach button acts as an input that is set up for freedrive.
    """

    def __init__(
        self,
        motion: ArmMotion,
        mode: RobotModeMachine,
        safety: SafetyState,
        operational: OperationalModeChoice,
        inputs: IoConfiguration,
        past: PastCycles,
        robot: RobotModel,
    ) -> None:
        """Begin with an arm that is driven by position.

        `mode` and `safety` can end compliance; `operational` decides whether people may guide the arm.
        """
        self._motion = motion
        self._robot_mode = mode
        self._safety = safety
        has_sensor = robot.generation.force_sensing.has_sensor
        self._unexpected_force = _OF_SENSOR if has_sensor else _OF_ESTIMATE * robot.payload_max
        self._operational = operational
        self._inputs = inputs
        self._past = past
        self.force_damping, self.force_gain_scaling = 0.0, 1.0
        self.askers: set[Asker] = set()
        self._force: ForceMode | None = None
        self._hold: AxisHold | None = None
        self._is_refused = False
        self.is_teach_pressed = False

    @property
    def is_in_freedrive(self) -> bool:
        """True while the arm is in freedrive."""
        return self._motion.state is ArmState.BY_HAND

    @property
    def force_mode(self) -> ForceMode | None:
        """The overlay of force mode; None without it. Stops of the arm end it."""
        force = self._force
        return force if force is not None and force in self._motion.overlays else None

    @property
    def mode(self) -> ControlMode:
        """How the arm is driven."""
        match self._motion.state:
            case ArmState.BY_HAND:
                return ControlMode.TEACH
            case ArmState.BY_TORQUE:
                return ControlMode.TORQUE
        return ControlMode.POSITION if self.force_mode is None else ControlMode.FORCE

    @property
    def is_active(self) -> bool:
        """True while `step` must be called in every cycle."""
        return (
            self._motion.is_compliant
            or self.is_teach_pressed
            or self.force_mode is not None
            or self._inputs.has_actions
        )

    # --- requests

    def start_freedrive(self, asker: Asker, *, hold: AxisHold | None = None, wrench: Vector6 = ZERO6) -> None:
        """Start freedrive.

        Args:
            hold: has the axes that the program blocks, None for none.
            wrench: from outside; if it is not expected, the arm is stopped when freedrive begins [N, Nm].
        """
        if asker == "program":
            self._hold = hold
        self.askers.add(asker)
        if not self.is_in_freedrive:
            self._is_refused = hypot(*wrench[:3]) > self._unexpected_force
        self._hand_over()

    def end_freedrive(self, asker: Asker) -> None:
        """End the freedrive that the program, or a client, has requested."""
        self.askers.discard(asker)
        self._hand_over()

    def begin_force(self, force_mode: ForceMode) -> None:
        """Go into force mode; freedrive by the program ends."""
        self.end_force()
        self.end_freedrive("program")
        if not self.is_in_freedrive:
            self._force = force_mode
            self._motion.add_overlay(force_mode)

    def end_force(self) -> None:
        """Leave force mode, if the arm is in it; the arm stays where it is."""
        if self._force is not None:
            self._motion.remove_overlay(self._force)
            self._force = None

    def program_ended(self) -> None:
        """End freedrive and force mode of the program."""
        self.end_freedrive("program")
        self.end_force()

    def _hand_over(self) -> None:
        """Let a hand guide the arm if anybody has requested it and nothing forbids it, else hold the arm."""
        if self._is_forbidden:
            self.askers.clear()
        if self.askers:
            self._motion.guide(self._past.measured)
        else:
            self._motion.let_go()

    @property
    def _is_forbidden(self) -> bool:
        return self._robot_mode.mode is not RobotMode.RUNNING or self._safety.is_stopped

    # --- cycle

    def step(self) -> None:
        """Follow inputs, and what forbids compliance, after the scripts have run."""
        may_guide = self._operational.allows.allows_freedrive
        if not may_guide:
            self.askers.discard("client")
        if not (may_guide and (self.is_teach_pressed or self._inputs.requests_freedrive())):
            self.askers.discard("input")
        elif not self._motion.is_moving:
            self.askers.add("input")
        self._hand_over()
        if self._is_forbidden:
            self.end_force()

    def torque(self) -> TorqueCommand | None:
        """Return what the drives shall give beside the hand, or in place of a position; None for nothing.

        In freedrive it holds the axes that the program has blocked; a client or an input frees all.
        """
        if not self.is_in_freedrive:
            return self._motion.torque
        if self._hold is None or self.askers & {"client", "input"}:
            return None
        sensed = self._past.sensed
        return TorqueCommand(self._hold.torque(sensed.actual_q, sensed.actual_qd), ZERO6, ZERO6)

    def find_violation(self, sensed: PlantState) -> Violation | None:
        """Return a violation by a compliant arm in this cycle, or None."""
        if self.is_in_freedrive and self._is_refused:
            self._is_refused = False
            return WRONG_PAYLOAD
        if self._motion.is_compliant:
            return _moved_too_far(self._safety.limits, sensed)
        force_mode, error = self.force_mode, sensed.position_error
        deviation = None if force_mode is None else force_mode.deviation(sensed.actual_q, error)
        if deviation is None:
            return None
        joint = max(range(6), key=lambda i: abs(error[i]))
        axis, unit = _AXES[deviation.axis], "m" if deviation.axis < 3 else "rad"
        return protective_stop(
            153,
            joint,
            f"Protective Stop: position deviates from path: {JOINT_NAMES[joint]}: stiff axis {axis} of "
            f"force mode is {deviation.size:.4f} {unit} off, limit {deviation.limit:g} {unit}",
        )


# Source of code and text: the maker's list of error codes.
WRONG_PAYLOAD = protective_stop(
    156,
    0,
    "Protective Stop: Wrong payload or mounting detected, "
    "or something is pushing the robot when entering Freedrive mode",
)


def _moved_too_far(limits: ConfiguredLimits, sensed: PlantState) -> Violation | None:
    """Codes C150 and C191 from the maker's list; that they lead to a protective stop is chosen.

    A joint outside its range may be moved back.
    """
    for i, (q, qd) in enumerate(zip(sensed.actual_q, sensed.actual_qd, strict=True)):
        if (q > limits.q_max[i] and qd > 0.0) or (q < limits.q_min[i] and qd < 0.0):
            text = f"Protective Stop: Position close to joint limits: {JOINT_NAMES[i]} at {q:.3f} rad"
            return protective_stop(150, i, text)
        if abs(qd) > limits.speed[i] * SPEED_TOLERANCE:
            text = f"Protective Stop: Joint speed limit violated: {JOINT_NAMES[i]} at {abs(qd):.3f} rad/s"
            return protective_stop(191, 32 + i, text)
    return None
