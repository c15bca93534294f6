"""What can be waited for: names of `wait_until`, each with what the box has to say to it now."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from protocol.primary_messages import RequestedType
from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator.control.box_state import is_steady
from ur_emulator.controller.controller import Controller


def _has_popup(controller: Controller) -> bool:
    operator = controller.state.operator
    return bool(operator.shown) or any(r.kind is RequestedType.NONE for r in operator.requests)


def _has_question(controller: Controller) -> bool:
    return any(r.kind is not RequestedType.NONE for r in controller.state.operator.requests)


CONDITIONS: dict[str, Callable[[Controller], object]] = {
    "robot_mode": lambda controller: RobotMode(controller.snapshot.robot_mode).name,
    "safety_mode": lambda controller: SafetyMode(controller.snapshot.safety_mode).name,
    "program_state": lambda controller: ProgramState(controller.snapshot.runtime_state).name,
    "steady": is_steady,
    "popup": _has_popup,
    "question": _has_question,
}


def holds(controller: Controller, wanted: Mapping[str, Any]) -> bool:
    """Return whether all conditions hold."""
    return all(CONDITIONS[name](controller) == value for name, value in wanted.items())


def unmet(controller: Controller, wanted: Mapping[str, Any]) -> list[str]:
    """Return, for people, what does not hold."""
    values = {name: CONDITIONS[name](controller) for name in wanted}
    return [
        f"{name} is {value}, not {wanted[name]}" for name, value in values.items() if value != wanted[name]
    ]
