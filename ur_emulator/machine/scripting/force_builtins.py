"""Builtins for force mode, freedrive and contacts."""

from functools import partial
from typing import Any

from ur_emulator.machine.controller.compliance import Compliance
from ur_emulator.machine.controller.force_sense import ForceSense
from ur_emulator.machine.controller.past_cycles import PastCycles
from ur_emulator.machine.kinematics.arm_model import moved_wrench
from ur_emulator.machine.models.robot_model import ZERO6, Vector6, six
from ur_emulator.machine.motion import force_mode
from ur_emulator.machine.motion.axis_hold import AxisHold, singularity_status
from ur_emulator.machine.plant.drives import SERVO_FREQUENCY, ServoGains
from ur_emulator.machine.scripting.builtin_group import (
    BuiltinGroup,
    ScriptArm,
    builtin,
    floats,
    require_positive,
)
from urscript import HostFunction, ScriptRuntimeError
from urscript.values import Pose, log_form

# Greatest distance of a task frame [m]: beyond it poses lose precision.
MAX_FRAME_DISTANCE = 100.0
_FEATURES = ("base", "tool")
# Deviation of a stiff axis that stops nothing [m, rad].
_UNLIMITED = 1e3


class ForceBuiltins(BuiltinGroup):
    """Force mode, freedrive and contacts."""

    def __init__(
        self, arm: ScriptArm, compliance: Compliance, force_sense: ForceSense, past: PastCycles
    ) -> None:
        self._arm = arm
        self._compliance = compliance
        self._force_sense = force_sense
        self._past = past
        self._stiffness = ServoGains.of(arm.robot).kp.tolist()
        self._sensing = arm.robot.generation.force_sensing

    def functions(self) -> dict[str, HostFunction]:
        """Return the builtins."""
        arm, past, sense, compliance = self._arm, self._past, self._force_sense, self._compliance
        return super().functions() | {
            "get_freedrive_status": lambda thread: singularity_status(
                arm.model.jacobian(past.sensed.actual_q, arm.settings.tcp_offset)
            ),
            "zero_ftsensor": lambda thread: sense.set_zero(past.steady_cycles),
            "tool_contact": lambda thread, direction: sense.steps_since_contact(tuple(direction)[:3]),
            "force_mode_get_damping": lambda thread: compliance.force_damping,
            "force_mode_get_gain_scaling": lambda thread: compliance.force_gain_scaling,
        }

    # --- hand guiding

    @builtin("freedrive_mode", "teach_mode")
    def _begin_freedrive(self, thread: object, free_axes: Any = (1,) * 6, feature: Any = "base") -> None:
        if not all(x in (0, 1) for x in free_axes):
            raise ScriptRuntimeError(
                f"freedrive_mode: freeAxes must hold only 0 and 1, got {log_form(free_axes)}"
            )
        q = self._past.sensed.actual_q
        if feature in _FEATURES:
            turn = self._arm.tcp_pose(q)[3:] if feature == "tool" else ZERO6[3:]
        elif isinstance(feature, Pose):
            turn = floats(feature)[3:]
        else:
            raise ScriptRuntimeError(
                f'freedrive_mode: feature {log_form(feature)} is unknown; allowed: a pose, "base", "tool"'
            )
        blocked = [x == 0 for x in free_axes]
        hold = AxisHold(self._arm.tool, turn, blocked, q) if any(blocked) else None
        wrench = self._force_sense.residual(self._past.steady_cycles)
        self._compliance.start_freedrive("program", hold=hold, wrench=wrench)

    @builtin("freedrive_mode_no_incorrect_payload_check")
    def _begin_freedrive_unchecked(self, thread: object) -> None:
        self._compliance.start_freedrive("program")

    @builtin("end_freedrive_mode", "end_teach_mode")
    def _end_freedrive(self, thread: object) -> None:
        self._compliance.end_freedrive("program")

    # --- force mode

    @builtin("force_mode")
    def _force_mode(
        self, thread: object, task_frame: Any, selection_vector: Any, wrench: Any, type: float, limits: Any
    ) -> None:
        frame = floats(task_frame)
        if not all(x in (0, 1) for x in selection_vector):
            raise ScriptRuntimeError(
                f"force_mode: selection_vector must hold only 0 and 1, got {log_form(selection_vector)}"
            )
        if not all(x >= 0 for x in limits):
            raise ScriptRuntimeError(f"force_mode: limits must not be below 0, got {log_form(limits)}")
        if max(map(abs, frame)) > MAX_FRAME_DISTANCE:
            raise ScriptRuntimeError(
                f"force_mode: {log_form(task_frame)} is not a valid task frame; "
                f"allowed: numbers up to {MAX_FRAME_DISTANCE:g}"
            )
        task = force_mode.TaskFrame(frame, force_mode.FrameType(int(type)))
        self._begin_force(task, tuple(map(bool, selection_vector)), floats(wrench), floats(limits))

    @builtin("screw_driving")
    def _screw_driving(self, thread: object, f: float, v_limit: float) -> None:
        """Push along z of the tool; the other axes are stiff, without a limit of their own."""
        require_positive("screw_driving", v_limit=v_limit)
        frame = self._arm.tcp_pose(self._arm.motion.target.q)
        task = force_mode.TaskFrame(frame, force_mode.FrameType.FIXED)
        wrench, limits = floats((0, 0, f, 0, 0, 0)), [_UNLIMITED] * 6
        limits[2] = v_limit
        self._begin_force(task, (False, False, True, False, False, False), wrench, floats(limits))

    @builtin("end_force_mode", "end_screw_driving")
    def _end_force(self, thread: object) -> None:
        self._compliance.end_force()

    @builtin("force_mode_set_damping")
    def _set_damping(self, thread: object, damping: float) -> None:
        self._compliance.force_damping = float(damping)

    @builtin("force_mode_set_gain_scaling")
    def _set_gain_scaling(self, thread: object, scaling: float) -> None:
        self._compliance.force_gain_scaling = float(scaling)

    def _begin_force(
        self, frame: force_mode.TaskFrame, selection: tuple[bool, ...], wrench: Vector6, limits: Vector6
    ) -> None:
        """Go into force mode, or on in it with other settings."""
        tool, force_sense, compliance = self._arm.tool, self._force_sense, self._compliance
        settings = force_mode.ForceSettings(
            selection, wrench, limits, compliance.force_damping, compliance.force_gain_scaling
        )
        distance = frame.distance(self._arm.tcp_pose(self._arm.motion.target.q))
        if frame.kind is force_mode.FrameType.POINT and distance < force_mode.MIN_DISTANCE:
            raise ScriptRuntimeError(
                f"force_mode: the tool is {1000.0 * distance:.1f} mm from the origin of the task frame, "
                f"type 1 needs at least {1000.0 * force_mode.MIN_DISTANCE:g} mm"
            )
        active = compliance.force_mode
        if active is not None and active.tool == tool:
            frame.follow(active.frame)
            active.set(frame, settings)
            return
        offset = ZERO6 if force_sense.sensor is not None else force_sense.offset(self._past.steady_cycles)
        measure = partial(self._measure, offset)
        compliance.begin_force(
            force_mode.ForceMode(
                tool, frame, settings, self._sensing, self._stiffness, SERVO_FREQUENCY, measure
            )
        )

    def _measure(self, offset: Vector6) -> force_mode.ArmMeasurement:
        """Return what force mode measures in this cycle.

        `offset` is an error of the wrench, at the flange in base axes [N, Nm].
        """
        snapshot = self._past.snapshot
        wrench = snapshot.space.tcp_force
        if offset is not ZERO6:
            flange = self._arm.model.fk(snapshot.actual_q)
            moved = moved_wrench(offset, flange, snapshot.actual_tcp_pose)
            wrench = six([w - z for w, z in zip(wrench, moved, strict=True)])
        return force_mode.ArmMeasurement(snapshot.actual_q, wrench, snapshot.actual_tcp_speed)
