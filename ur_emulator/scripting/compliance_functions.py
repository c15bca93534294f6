"""Builtins that let the arm give way: force mode, hand guiding, and what is felt of contacts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.controller.compliance.force_sense import moved_wrench
from ur_emulator.controller.state import ControllerState
from ur_emulator.models.robot_model import ZERO6, Vector6, six
from ur_emulator.motion.force_mode import ArmMeasurement, ForceMode, ForceSettings
from ur_emulator.motion.task_frame import MIN_DISTANCE, FrameType, TaskFrame
from ur_emulator.motion.tool import Tool
from ur_emulator.plant.physics import ServoGains
from urscript.builtins.text import wire_text
from urscript.errors import ScriptRuntimeError

# No task frame is further away [m]: beyond, poses lose their digits.
MAX_FRAME_DISTANCE = 100.0


def compliance_functions(state: ControllerState) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins for force mode, hand guiding and contacts, bound to one controller."""

    def end_freedrive_mode(thread: object) -> None:
        state.compliance.by_program = False

    def freedrive_unchecked(thread: object) -> None:
        state.compliance.guide(by_program=True)

    def freedrive_mode(thread: object, free_axes: Any = (1,) * 6, feature: Any = None) -> None:
        if not all(x == 1 for x in free_axes):
            raise ScriptRuntimeError(
                f"freedrive_mode: blocked axes are not modelled, got freeAxes={wire_text(free_axes)}, "
                "allowed is [1,1,1,1,1,1]"
            )
        if not state.compliance.is_guided:
            state.compliance.check_payload(state.force_sense.unexplained(state.steady_cycles))
        freedrive_unchecked(thread)

    def tool_contact(thread: object, direction: Any) -> int:
        return state.force_sense.steps_since_contact(tuple(direction)[:3])

    return {
        **_force_mode(state),
        "freedrive_mode": freedrive_mode,
        "freedrive_mode_no_incorrect_payload_check": freedrive_unchecked,
        "end_freedrive_mode": end_freedrive_mode,
        "teach_mode": freedrive_mode,
        "end_teach_mode": end_freedrive_mode,
        "zero_ftsensor": lambda thread: state.force_sense.set_zero(state.steady_cycles),
        "tool_contact": tool_contact,
    }


def _force_mode(state: ControllerState) -> dict[str, Callable[..., Any]]:
    stiffness = ServoGains.of(state.robot).kp.tolist()

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
                raise ScriptRuntimeError(f"force_mode: {name} must {allowed}, got {wire_text(values)}")
        if max(map(abs, frame)) > MAX_FRAME_DISTANCE:
            raise ScriptRuntimeError(
                f"force_mode: {wire_text(task_frame)} is no task frame, "
                f"allowed are numbers up to {MAX_FRAME_DISTANCE:g}"
            )
        settings = ForceSettings(
            tuple(bool(x) for x in selection_vector),
            _floats(wrench),
            _floats(limits),
            state.force_mode_damping,
            state.force_mode_gain_scaling,
        )
        _begin(state, TaskFrame(frame, FrameType(int(type))), settings, stiffness)

    def end_force_mode(thread: object) -> None:
        state.compliance.end_force(state)

    def force_mode_set_damping(thread: object, damping: float) -> None:
        state.force_mode_damping = float(damping)

    def force_mode_set_gain_scaling(thread: object, scaling: float) -> None:
        state.force_mode_gain_scaling = float(scaling)

    return {
        "force_mode": force_mode,
        "end_force_mode": end_force_mode,
        "force_mode_set_damping": force_mode_set_damping,
        "force_mode_set_gain_scaling": force_mode_set_gain_scaling,
        "force_mode_get_damping": lambda thread: state.force_mode_damping,
        "force_mode_get_gain_scaling": lambda thread: state.force_mode_gain_scaling,
    }


def _begin(state: ControllerState, frame: TaskFrame, settings: ForceSettings, stiffness: list[float]) -> None:
    """Go into force mode, or on in it with other settings."""
    compliance = state.compliance
    tool = Tool(state.arm, state.tcp_offset)
    place = state.arm.fk(state.motion.target.q, tool.tcp)
    distance = frame.distance(place)
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
    compliance.end_force(state)
    compliance.by_program = False  # what is commanded last counts
    offset = ZERO6 if state.external_sensor is not None else state.force_sense.offset(state.steady_cycles)
    compliance.begin_force(
        state, ForceMode(tool, frame, settings, stiffness, lambda: _measure(state, offset))
    )


def _measure(state: ControllerState, offset: Vector6) -> ArmMeasurement:
    """Return what force mode measures in this cycle.

    Args:
        state: of the controller.
        offset: error of the wrench, at the flange in base axes [N, Nm].
    """
    snapshot = state.snapshot
    wrench = snapshot.actual_tcp_force
    if offset is not ZERO6:
        moved = moved_wrench(offset, state.arm.fk(snapshot.actual_q), snapshot.actual_tcp_pose)
        wrench = six([w - z for w, z in zip(wrench, moved, strict=True)])
    return ArmMeasurement(snapshot.actual_q, wrench, snapshot.actual_tcp_speed)


def _floats(values: Any) -> Vector6:
    return six([float(x) for x in values])
