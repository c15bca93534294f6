"""Builtins for force mode, freedrive and contacts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.controller.compliance import Compliance
from ur_emulator.controller.force_sense import ForceSense
from ur_emulator.controller.past_cycles import PastCycles
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.kinematics.arm_model import ArmModel, moved_wrench
from ur_emulator.models.robot_model import ZERO6, Vector6, six
from ur_emulator.motion.axis_hold import AxisHold, singularity_status
from ur_emulator.motion.force_mode import (
    MIN_DISTANCE,
    ArmMeasurement,
    ForceMode,
    ForceSettings,
    FrameType,
    TaskFrame,
)
from ur_emulator.plant.drives import ServoGains
from ur_emulator.scripting.script_arm import ScriptArm, require_positive
from urscript.errors import ScriptRuntimeError
from urscript.values import Pose, log_form

# Greatest distance of a task frame [m]: beyond it poses lose precision.
MAX_FRAME_DISTANCE = 100.0
_FEATURES = ("base", "tool")
# Deviation of a stiff axis that stops nothing [m, rad].
_UNLIMITED = 1e3


def compliance_functions(
    arm: ScriptArm, compliance: Compliance, force_sense: ForceSense, past: PastCycles
) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins for force mode, freedrive and contacts.

    Args:
        arm: that they act on.
        compliance: gets their requests.
        force_sense: the measured wrench.
        past: measured positions.
    """

    def end_freedrive_mode(thread: object) -> None:
        compliance.end_freedrive_by_program()

    def freedrive_unchecked(thread: object) -> None:
        compliance.start_freedrive(by_program=True)

    def freedrive_mode(thread: object, free_axes: Any = (1,) * 6, feature: Any = "base") -> None:
        if not all(x in (0, 1) for x in free_axes):
            raise ScriptRuntimeError(
                f"freedrive_mode: freeAxes must hold only 0 and 1, got {log_form(free_axes)}"
            )
        q = past.sensed.actual_q
        if feature in _FEATURES:
            turn = arm.tcp_pose(q)[3:] if feature == "tool" else ZERO6[3:]
        elif isinstance(feature, Pose):
            turn = _floats(feature)[3:]
        else:
            raise ScriptRuntimeError(
                f'freedrive_mode: feature {log_form(feature)} is unknown; allowed: a pose, "base", "tool"'
            )
        blocked = [x == 0 for x in free_axes]
        hold = AxisHold(arm.tool, turn, blocked, q) if any(blocked) else None
        if not compliance.is_in_freedrive:
            compliance.check_payload(force_sense.residual(past.steady_cycles))
        compliance.start_freedrive(by_program=True, hold=hold)

    def get_freedrive_status(thread: object) -> int:
        return singularity_status(arm.model.jacobian(past.sensed.actual_q, arm.settings.tcp_offset))

    def tool_contact(thread: object, direction: Any) -> int:
        return force_sense.steps_since_contact(tuple(direction)[:3])

    return {
        **_force_mode(arm, compliance, force_sense, past),
        "freedrive_mode": freedrive_mode,
        "freedrive_mode_no_incorrect_payload_check": freedrive_unchecked,
        "get_freedrive_status": get_freedrive_status,
        "end_freedrive_mode": end_freedrive_mode,
        "teach_mode": freedrive_mode,
        "end_teach_mode": end_freedrive_mode,
        "zero_ftsensor": lambda thread: force_sense.set_zero(past.steady_cycles),
        "tool_contact": tool_contact,
    }


def _force_mode(
    arm: ScriptArm, compliance: Compliance, force_sense: ForceSense, past: PastCycles
) -> dict[str, Callable[..., Any]]:
    stiffness, sensing = ServoGains.of(arm.robot).kp.tolist(), arm.robot.generation.force_sensing

    def force_mode(
        thread: object, task_frame: Any, selection_vector: Any, wrench: Any, type: float, limits: Any
    ) -> None:
        frame = _floats(task_frame)
        for name, values, good in (
            ("selection_vector", selection_vector, lambda x: x in (0, 1)),
            ("limits", limits, lambda x: x >= 0),
        ):
            if not all(map(good, values)):
                allowed = "hold only 0 and 1" if name == "selection_vector" else "not be below 0"
                raise ScriptRuntimeError(f"force_mode: {name} must {allowed}, got {log_form(values)}")
        if max(map(abs, frame)) > MAX_FRAME_DISTANCE:
            raise ScriptRuntimeError(
                f"force_mode: {log_form(task_frame)} is not a valid task frame; "
                f"allowed: numbers up to {MAX_FRAME_DISTANCE:g}"
            )
        settings = ForceSettings(
            tuple(bool(x) for x in selection_vector),
            _floats(wrench),
            _floats(limits),
            compliance.force_damping,
            compliance.force_gain_scaling,
        )
        begin(TaskFrame(frame, FrameType(int(type))), settings)

    def begin(frame: TaskFrame, settings: ForceSettings) -> None:
        """Go into force mode, or on in it with other settings."""
        tool = arm.tool
        distance = frame.distance(arm.tcp_pose(arm.motion.target.q))
        if frame.kind is FrameType.POINT and distance < MIN_DISTANCE:
            raise ScriptRuntimeError(
                f"force_mode: the tool is {1000.0 * distance:.1f} mm from the origin of the task frame, "
                f"type 1 needs at least {1000.0 * MIN_DISTANCE:g} mm"
            )
        active = compliance.force_mode
        if active is not None and active.tool == tool:
            frame.follow(active.frame)
            active.set(frame, settings)
            return
        offset = ZERO6 if force_sense.sensor is not None else force_sense.offset(past.steady_cycles)
        compliance.begin_force(
            ForceMode(
                tool,
                frame,
                settings,
                sensing,
                stiffness,
                lambda: _measure(past.snapshot, arm.model, offset),
            )
        )

    def screw_driving(thread: object, f: float, v_limit: float) -> None:
        """Push along z of the tool; the other axes are stiff, without a limit of their own."""
        require_positive("screw_driving", v_limit=v_limit)
        settings = ForceSettings(
            (False, False, True, False, False, False),
            (0.0, 0.0, float(f), 0.0, 0.0, 0.0),
            (_UNLIMITED, _UNLIMITED, float(v_limit), _UNLIMITED, _UNLIMITED, _UNLIMITED),
            compliance.force_damping,
            compliance.force_gain_scaling,
        )
        begin(TaskFrame(arm.tcp_pose(arm.motion.target.q), FrameType.FIXED), settings)

    def set_gain_scaling(thread: object, scaling: float) -> None:
        compliance.set_force_gain_scaling(float(scaling))

    return {
        "force_mode": force_mode,
        "end_force_mode": lambda thread: compliance.end_force(),
        "screw_driving": screw_driving,
        "end_screw_driving": lambda thread: compliance.end_force(),
        "force_mode_set_damping": lambda thread, damping: compliance.set_force_damping(float(damping)),
        "force_mode_set_gain_scaling": set_gain_scaling,
        "force_mode_get_damping": lambda thread: compliance.force_damping,
        "force_mode_get_gain_scaling": lambda thread: compliance.force_gain_scaling,
    }


def _measure(snapshot: Snapshot, model: ArmModel, offset: Vector6) -> ArmMeasurement:
    """Return what force mode measures in this cycle.

    Args:
        snapshot: of the last cycle.
        model: kinematics of the arm.
        offset: error of the wrench, at the flange in base axes [N, Nm].
    """
    wrench = snapshot.space.tcp_force
    if offset is not ZERO6:
        moved = moved_wrench(offset, model.fk(snapshot.actual_q), snapshot.actual_tcp_pose)
        wrench = six([w - z for w, z in zip(wrench, moved, strict=True)])
    return ArmMeasurement(snapshot.actual_q, wrench, snapshot.actual_tcp_speed)


def _floats(values: Any) -> Vector6:
    return six([float(x) for x in values])
