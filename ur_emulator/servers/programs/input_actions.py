"""Inputs that start, pause and stop programs, as an installation sets them up.

Each acts on a rising edge. Source: the user manuals' page of I/O set-up, from memory. FREEDRIVE acts in the
controller.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from ur_emulator.controller.io.configuration import IoConfiguration
from ur_emulator.servers.steps import Steps


def follow_inputs(
    lines: IoConfiguration,
    declared: Sequence[tuple[str, int, str]],
    acts: Mapping[str, Callable[[], None]],
    is_effective: Callable[[], bool],
) -> Steps[None]:
    """Do what inputs ask for.

    Args:
        lines: has their levels.
        declared: (group of inputs as in the names of builtins, index, action).
        acts: begins an action.
        is_effective: the installation with these inputs is still loaded.
    """
    inputs = [(group, index, acts[action]) for group, index, action in declared if action in acts]
    before = [True] * len(inputs)
    while inputs and is_effective():
        levels = [lines.is_high(group, index) for group, index, _ in inputs]
        for (_, _, act), was_high, is_high in zip(inputs, before, levels, strict=True):
            if is_high and not was_high:
                act()
        before = levels
        yield
