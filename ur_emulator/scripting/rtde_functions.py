"""get_rtde_value: a program reads an RTDE output by its name, as a client would get it of the last cycle.

Source: URScript manual e-Series 5.24.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from protocol.rtde.fields import RtdeField
from protocol.rtde.recipe import Recipe, snapshot_encoder
from ur_emulator.controller.past_cycles import PastCycles
from urscript.errors import ScriptRuntimeError


def rtde_functions(past: PastCycles, outputs: tuple[RtdeField, ...]) -> Mapping[str, Callable[..., Any]]:
    """Return the builtin.

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
