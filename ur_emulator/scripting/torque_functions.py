"""direct_torque: the program drives the joints by torque.

Source: URScript manual e-Series 5.25.1, direct_torque: range and defaults of the scales; friction_comp is the
former argument, which does not count beside a scale and is logged once. Chosen: True means the default
scales, False none, before 5.25 too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ur_emulator.controller.compliance.compliance import Compliance
from ur_emulator.controller.events import EventQueue, LogAdded
from ur_emulator.controller.past_cycles import PastCycles
from ur_emulator.models.robot_model import ZERO6, Vector6
from ur_emulator.motion.arm_motion import ArmMotion
from ur_emulator.motion.direct_torque import DirectTorque, TorqueCommand
from ur_emulator.motion.path_motion import OwnershipError
from ur_emulator.motion.target import JointTarget
from ur_emulator.scripting.script_arm import Cycles, floats
from urscript.catalogue.motion import COULOMB_SCALE, VISCOUS_SCALE
from urscript.errors import ScriptRuntimeError
from urscript.run.waits import NEXT_CYCLE
from urscript.values import log_form


class ProgramTorque:
    """The torque control of one program."""

    def __init__(
        self, motion: ArmMotion, compliance: Compliance, past: PastCycles, events: EventQueue
    ) -> None:
        self._motion = motion
        self._compliance = compliance
        self._past = past
        self._events = events
        self._has_logged = False

    def functions(self) -> Mapping[str, Callable[..., Any]]:
        """Return the builtin."""
        return {"direct_torque": self._direct_torque}

    def _direct_torque(
        self,
        thread: object,
        torque: Sequence[float],
        friction_comp: bool | None,
        *scales: Sequence[float] | None,
    ) -> Cycles:
        viscous, coulomb = scales or (None, None)  # none before 5.25
        if scales and friction_comp is not None and not self._has_logged:
            self._has_logged = True
            text = "direct_torque: friction_comp is deprecated, use viscous_scale and coulomb_scale"
            self._events.append(LogAdded("Program", text))
        compensates = friction_comp is not False or viscous is not None or coulomb is not None
        command = TorqueCommand(
            floats(torque),
            _scale("viscous_scale", viscous, VISCOUS_SCALE) if compensates else ZERO6,
            _scale("coulomb_scale", coulomb, COULOMB_SCALE) if compensates else ZERO6,
        )
        self._compliance.end_force()
        try:
            self._motion.command_torque(thread, DirectTorque(command, self._measure))
        except OwnershipError:
            raise ScriptRuntimeError("Another thread is already controlling the robot") from None
        yield NEXT_CYCLE

    def _measure(self) -> JointTarget:
        sensed = self._past.sensed
        return JointTarget(sensed.actual_q, sensed.actual_qd)


def _scale(name: str, given: Sequence[float] | None, default: Vector6) -> Vector6:
    scale = default if given is None else floats(given)
    if not all(0.0 <= share <= 1.0 for share in scale):
        raise ScriptRuntimeError(f"direct_torque: {name} must have shares from 0 to 1, got {log_form(given)}")
    return scale
