"""The builtins that are plain functions of their arguments: mathematics, strings, lists, poses.

They check their own arguments, raise ScriptRuntimeError without a place, and change no value. The host has
the builtins that need a robot, a socket or a clock.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from random import Random
from types import MappingProxyType
from typing import Any

from urscript.builtins import lists, poses, strings, urmath

PURE: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {**urmath.FUNCTIONS, **lists.FUNCTIONS, **poses.FUNCTIONS, **strings.FUNCTIONS}
)
"""URScript name -> function of the bound arguments, for all whose result depends on nothing else."""


def pure_builtins(seed: int) -> dict[str, Callable[..., Any]]:
    """`PURE` and `random`, whose numbers depend on the seed only.

    Args:
        seed: of the pseudo-random numbers; the same seed gives the same sequence on every machine.
    """
    return {**PURE, "random": Random(seed).random}


__all__ = ["PURE", "pure_builtins"]
