"""Builtins about errors and limits (most only keep a setting), `powerdown`, and the statement `pause`."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from typing import Any, NoReturn

from ur_emulator.controller.error_settings import ErrorSettings
from ur_emulator.controller.past_cycles import PastCycles
from ur_emulator.controller.program_requests import ProgramRequests
from ur_emulator.models.robot_model import six
from urscript.run.threads import ProgramHalted
from urscript.run.waits import NEXT_CYCLE, Wait


def error_functions(
    settings: ErrorSettings, past: PastCycles, requests: ProgramRequests
) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins about errors, `powerdown` and `pause`."""

    def pause_on_error_code(thread: object, code: float, argument: float | None) -> None:
        settings.pause_on(int(code), None if argument is None else int(argument))

    def position_deviation_warning(thread: object, enabled: bool, threshold: float) -> None:
        settings.warn_of_deviation(enabled, float(threshold))

    def set_safety_mode_transition_hardness(thread: object, kind: float) -> None:
        settings.set_transition_hardness(int(kind))

    def reset_revolution_counter(thread: object, q_near: Any) -> None:
        # A real box uses it when new safety settings limit a joint that had no limits: not here.
        settings.set_revolution_reference(
            past.sensed.actual_q if q_near is None else six([float(x) for x in q_near])
        )

    def powerdown(thread: object) -> NoReturn:
        requests.power_off()
        raise ProgramHalted

    def pause(thread: object) -> Generator[Wait, None, None]:
        requests.pause()
        yield NEXT_CYCLE

    return {
        "pause": pause,
        "pause_on_error_code": pause_on_error_code,
        "position_deviation_warning": position_deviation_warning,
        "set_safety_mode_transition_hardness": set_safety_mode_transition_hardness,
        "reset_revolution_counter": reset_revolution_counter,
        "powerdown": powerdown,
        "high_holding_torque_enable": lambda thread: settings.set_high_holding_torque(True),
        "high_holding_torque_disable": lambda thread: settings.set_high_holding_torque(False),
    }
