"""Builtins for RTDE: outputs that a program reads, watchdogs of inputs, and an external force sensor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from protocol.rtde.fields import INPUTS, RtdeField
from protocol.rtde.recipe import Recipe, snapshot_encoder
from ur_emulator.controller.clock import Clock
from ur_emulator.controller.force_sense import VARIABLE, ExternalSensor, ForceSense
from ur_emulator.controller.io.watchdogs import WatchdogAction, Watchdogs
from ur_emulator.controller.past_cycles import PastCycles
from ur_emulator.models.robot_model import Vector3
from urscript.errors import ScriptRuntimeError


def rtde_functions(past: PastCycles, outputs: tuple[RtdeField, ...]) -> Mapping[str, Callable[..., Any]]:
    """Return the builtin that reads an output as a client would get it of the last cycle (manual 5.24).

    Args:
        past: snapshot of the last cycle.
        outputs: that the box can send.
    """
    fields = {field.name: field for field in outputs if field.origin is not None}

    def get_rtde_value(thread: object, key: str) -> Any:
        field = fields.get(key)
        if field is None:
            raise ScriptRuntimeError(f'get_rtde_value: "{key[:80]}" is not an RTDE output of this box')
        encoded = snapshot_encoder([field], b"")(past.snapshot)
        (value,) = Recipe([field.name], [field.type]).decode(encoded)
        return list(value) if isinstance(value, tuple) else value

    return {"get_rtde_value": get_rtde_value}


# --- builtins for RTDE inputs: watchdogs, and an external force sensor

# An enabled sensor is watched with this frequency [Hz] and action. Source: URScript manual,
# ft_rtde_input_enable.
SENSOR_FREQUENCY = 10.0
SENSOR_ACTION = WatchdogAction.PAUSE

_INPUT_NAMES = frozenset(field.name for field in INPUTS)


def watchdog_functions(
    watchdogs: Watchdogs, force_sense: ForceSense, clock: Clock
) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins for watchdogs and the external force sensor."""

    def rtde_set_watchdog(thread: object, variable: str, min_frequency: float, action: str) -> None:
        if variable not in _INPUT_NAMES:
            raise ScriptRuntimeError(f'rtde_set_watchdog: there is no RTDE input "{variable}"')
        try:
            chosen = WatchdogAction(action.lower())
        except ValueError:
            raise ScriptRuntimeError(
                f'rtde_set_watchdog: action "{action}" does not exist, choose ignore, pause or stop'
            ) from None
        watchdogs.set(variable, min_frequency, chosen, clock.tick)

    def sensor_function(lever_sign: float) -> Callable[..., None]:
        def enable_sensor(thread: object, enable: bool, mass: float, offset: Any, cog: Any) -> None:
            if enable:
                sensor = ExternalSensor(float(mass), _three(offset), _three(cog), lever_sign)
                watchdogs.set(VARIABLE, SENSOR_FREQUENCY, SENSOR_ACTION, clock.tick)
                force_sense.use(sensor)
            else:
                watchdogs.set(VARIABLE, 0.0, WatchdogAction.IGNORE, clock.tick)
                force_sense.use(None)

        return enable_sensor

    return {
        "rtde_set_watchdog": rtde_set_watchdog,
        "ft_rtde_input_enable": sensor_function(1.0),
        "enable_external_ft_sensor": sensor_function(-1.0),
    }


def _three(values: Any) -> Vector3:
    x, y, z = map(float, values)
    return (x, y, z)
