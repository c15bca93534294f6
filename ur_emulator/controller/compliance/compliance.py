"""Compliance: who lets the arm give way, and how it is driven therefore: by position, by force, by hand.

Hand guiding ("freedrive", "teach mode") may be asked for by the program, by a client's word or by inputs that
are set up for it; force mode by the program. Both are modes of the robot, not of the thread that asked.
Source: URScript manual CB3 3.15: freedrive_mode, teach_mode, force_mode, set_*_digital_input_action. Chosen:
an input acts once no move is under way, with or without a program; hand guiding takes the place of force
mode.
"""

from __future__ import annotations

from math import hypot

from protocol.primary.messages import ReportLevel
from protocol.ur_types import JOINT_NAMES, ControlMode, RobotMode
from ur_emulator.controller.events import ErrorReported
from ur_emulator.controller.io.configuration import IoConfiguration
from ur_emulator.controller.past_cycles import PastCycles
from ur_emulator.controller.robot_mode import RobotModeMachine
from ur_emulator.controller.safety.limit_checks import SPEED_TOLERANCE, Violation
from ur_emulator.controller.safety.safety_state import SafetyState
from ur_emulator.models.robot_model import RobotModel, Vector6
from ur_emulator.motion.arm_motion import ArmMotion
from ur_emulator.motion.force_mode import ForceMode
from ur_emulator.motion.target import JointTarget
from ur_emulator.plant.plant_state import PlantState

# A wrench that nobody expects when hand guiding begins is a wrong payload or a push: beyond this, which is
# twice the stated precision of the estimate [N].
UNEXPECTED_FORCE = 20.0

_AXES = ("x", "y", "z", "rx", "ry", "rz")


class Compliance:
    """Who has asked for what.

    Attributes:
        mode: how the arm is driven in this cycle.
        by_program: a program asks for hand guiding.
        by_client: the word `set robotmode freedrive` does.
        by_input: an input or the teach button does, and it is granted.
        force_mode: the overlay while a program is in force mode.
        force_damping: as programs have set it, for a force mode to come; 0..1.
        force_gain_scaling: likewise, 0..2.
        is_on: there is something to look after in every cycle.
    """

    def __init__(
        self,
        motion: ArmMotion,
        mode: RobotModeMachine,
        safety: SafetyState,
        inputs: IoConfiguration,
        past: PastCycles,
    ) -> None:
        """Begin with an arm that is driven by position.

        Args:
            motion: of the arm; force mode is an overlay of it, a guided arm its place.
            mode: compliance ends when it is not RUNNING.
            safety: compliance ends when it stops the arm.
            inputs: may ask for hand guiding.
            past: where the arm is.
        """
        self._motion = motion
        self._robot_mode = mode
        self._safety = safety
        self._inputs = inputs
        self._past = past
        self.force_damping, self.force_gain_scaling = 0.0, 1.0
        self.mode = ControlMode.POSITION
        self.by_program = self.by_client = self.by_input = False
        self.force_mode: ForceMode | None = None
        self.is_on = False
        self._is_refused = False
        self._is_teach_pressed = False

    @property
    def is_guided(self) -> bool:
        """True while somebody's wish for hand guiding is granted."""
        return self.by_program or self.by_client or self.by_input

    # --- wishes

    def guide(self, *, by_program: bool = False, by_client: bool = False) -> None:
        """Let the arm be guided by hand from this cycle on."""
        self.by_program = self.by_program or by_program
        self.by_client = self.by_client or by_client
        self.is_on = True

    def press(self, pressed: bool) -> None:
        """Press the teach button or let it go: it acts as an input that is set up for hand guiding."""
        self._is_teach_pressed = pressed
        self.is_on = True

    def check_payload(self, wrench: Vector6) -> None:
        """Refuse hand guiding with a protective stop if something unexpected acts at its beginning.

        Args:
            wrench: that nothing explains, at the flange [N, Nm].
        """
        self._is_refused = hypot(*wrench[:3]) > UNEXPECTED_FORCE

    def end_guiding_by_program(self) -> None:
        """End the hand guiding that the program has asked for."""
        self.by_program = False

    def end_guiding_by_client(self) -> None:
        """End the hand guiding that a client has asked for."""
        self.by_client = False

    def set_force_damping(self, damping: float) -> None:
        """Set the damping of a force mode to come, 0..1."""
        self.force_damping = damping

    def set_force_gain_scaling(self, scaling: float) -> None:
        """Set the gain scaling of a force mode to come, 0..2."""
        self.force_gain_scaling = scaling

    def begin_force(self, force_mode: ForceMode) -> None:
        """Go into force mode; hand guiding by the program ends: what is commanded last counts."""
        self.end_force()
        self.by_program = False
        self.force_mode = force_mode
        self._motion.add_overlay(force_mode)
        self.is_on = True

    def end_force(self) -> None:
        """Leave force mode, if the arm is in it; the arm stays where it is."""
        if self.force_mode is not None:
            self._motion.remove_overlay(self.force_mode)
            self.force_mode = None

    def program_ended(self) -> None:
        """End what the program has asked for."""
        self.by_program = False
        self.end_force()

    # --- cycle

    def step(self) -> ControlMode:
        """Return how the arm is driven in this cycle, after the scripts have had their turn."""
        motion = self._motion
        if self._robot_mode.mode is not RobotMode.RUNNING or self._safety.is_stopped:
            self.by_program = self.by_client = self.by_input = False
            self.end_force()
        else:
            wanted = self._is_teach_pressed or self._inputs.asks_for_freedrive()
            self.by_input = wanted and (self.by_input or not motion.is_moving)
        was_guided = self.mode is ControlMode.TEACH
        if self.is_guided:
            self.end_force()
            self.mode = ControlMode.TEACH
        else:
            if was_guided:
                snapshot = self._past.snapshot
                motion.place(snapshot.actual_q, snapshot.actual_qd)
            self.mode = ControlMode.POSITION
            if self.force_mode is not None:
                self.mode = ControlMode.FORCE
                if not motion.has_overlay(self.force_mode):
                    # A stop has ended it, such as that of a thread that was killed in motion.
                    motion.add_overlay(self.force_mode)
        self.is_on = self.mode is not ControlMode.POSITION or self._is_teach_pressed
        return self.mode

    def follow_hand(self) -> JointTarget:
        """Return what counts as the target of an arm that is guided by hand: where it is.

        Moves are not followed. They take their time on paper, and end with the guiding.
        """
        snapshot = self._past.snapshot
        if not self._motion.is_moving:
            self._motion.place(snapshot.actual_q)
        return JointTarget(snapshot.actual_q, snapshot.actual_qd)

    def find_violation(self, robot: RobotModel, sensed: PlantState) -> Violation | None:
        """Return what a compliant arm has done wrong in this cycle, or None.

        Args:
            robot: limits of the arm.
            sensed: of this cycle.
        """
        if self.mode is ControlMode.TEACH:
            if self._is_refused:
                self._is_refused = False
                return WRONG_PAYLOAD
            return _guided_too_far(robot, sensed)
        if self.force_mode is None:
            return None
        error = sensed.position_error
        deviation = self.force_mode.deviation(sensed.actual_q, error)
        if deviation is None:
            return None
        joint = max(range(6), key=lambda i: abs(error[i]))
        axis, unit = _AXES[deviation.axis], "m" if deviation.axis < 3 else "rad"
        return _stop(
            153,
            joint,
            f"position deviates from path: {JOINT_NAMES[joint]}: stiff axis {axis} of force mode is "
            f"{deviation.size:.4f} {unit} off, limit {deviation.limit:g} {unit}",
        )


# Source of code and text: the maker's list of error codes.
WRONG_PAYLOAD = Violation(
    ErrorReported(
        156,
        0,
        ReportLevel.WARNING,
        "Protective Stop: Wrong payload or mounting detected, "
        "or something is pushing the robot when entering Freedrive mode",
    )
)


def _guided_too_far(robot: RobotModel, sensed: PlantState) -> Violation | None:
    """Codes C150 and C191 from the maker's list; that they lead to a protective stop is chosen.

    A joint that is outside its range already may be guided back.
    """
    for i, (q, qd) in enumerate(zip(sensed.actual_q, sensed.actual_qd, strict=True)):
        if (q > robot.q_max[i] and qd > 0.0) or (q < robot.q_min[i] and qd < 0.0):
            return _stop(150, i, f"Position close to joint limits: {JOINT_NAMES[i]} at {q:.3f} rad")
        if abs(qd) > robot.qd_max[i] * SPEED_TOLERANCE:
            return _stop(191, 32 + i, f"Joint speed limit violated: {JOINT_NAMES[i]} at {abs(qd):.3f} rad/s")
    return None


def _stop(code: int, argument: int, text: str) -> Violation:
    return Violation(ErrorReported(code, argument, ReportLevel.WARNING, f"Protective Stop: {text}"))
