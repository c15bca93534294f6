"""Builtins for RTDE: outputs that a program reads, watchdogs of inputs, and an external force sensor."""

from typing import Any

from protocol.rtde.fields import INPUTS
from protocol.rtde.recipe import Recipe, snapshot_encoder
from ur_emulator.machine.controller.clock import Clock
from ur_emulator.machine.controller.force_sense import VARIABLE, ExternalSensor, ForceSense
from ur_emulator.machine.controller.io.watchdogs import WatchdogAction, Watchdogs
from ur_emulator.machine.controller.past_cycles import PastCycles
from ur_emulator.machine.scripting.builtin_group import BuiltinGroup, builtin, vector
from urscript.errors import ScriptRuntimeError

# An enabled sensor is watched with this frequency [Hz] and action. Source: URScript manual,
# ft_rtde_input_enable.
SENSOR_FREQUENCY = 10.0
SENSOR_ACTION = WatchdogAction.PAUSE

_INPUT_NAMES = frozenset(field.name for field in INPUTS)


class RtdeBuiltins(BuiltinGroup):
    """RTDE outputs and inputs of one box."""

    def __init__(self, past: PastCycles, clock: Clock, watchdogs: Watchdogs, force_sense: ForceSense) -> None:
        self._past = past
        outputs = clock.generation.rtde_outputs
        self._outputs = {field.name: field for field in outputs if field.origin is not None}
        self._watchdogs = watchdogs
        self._force_sense = force_sense
        self._clock = clock

    @builtin("get_rtde_value")
    def _get_value(self, thread: object, key: str) -> Any:
        """Read an output as a client would get it of the last cycle (manual 5.24)."""
        field = self._outputs.get(key)
        if field is None:
            raise ScriptRuntimeError(f'get_rtde_value: "{key[:80]}" is not an RTDE output of this box')
        encoded = snapshot_encoder([field], b"")(self._past.snapshot)
        (value,) = Recipe([field.name], [field.type]).decode(encoded)
        return list(value) if isinstance(value, tuple) else value

    @builtin("rtde_set_watchdog")
    def _set_watchdog(self, thread: object, variable: str, min_frequency: float, action: str) -> None:
        if variable not in _INPUT_NAMES:
            raise ScriptRuntimeError(f'rtde_set_watchdog: there is no RTDE input "{variable}"')
        try:
            chosen = WatchdogAction(action.lower())
        except ValueError:
            raise ScriptRuntimeError(
                f'rtde_set_watchdog: action "{action}" does not exist, choose ignore, pause or stop'
            ) from None
        self._watchdogs.set(variable, min_frequency, chosen, self._clock.tick)

    @builtin("ft_rtde_input_enable")
    def _use_sensor(
        self, thread: object, enable: bool, mass: float, offset: Any, cog: Any, lever_sign: float = 1.0
    ) -> None:
        sensor = ExternalSensor(float(mass), vector(offset), vector(cog), lever_sign) if enable else None
        frequency, action = (SENSOR_FREQUENCY, SENSOR_ACTION) if enable else (0.0, WatchdogAction.IGNORE)
        self._watchdogs.set(VARIABLE, frequency, action, self._clock.tick)
        self._force_sense.use(sensor)

    @builtin("enable_external_ft_sensor")
    def _use_old_sensor(self, thread: object, enable: bool, mass: float, offset: Any, cog: Any) -> None:
        self._use_sensor(thread, enable, mass, offset, cog, lever_sign=-1.0)
