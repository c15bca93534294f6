"""Constant arguments that are too large for their unit: degrees for radians, millimetres for metres."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, hypot
from typing import Any, Final, NamedTuple

from urscript.catalogue.types import Param
from urscript.lint.rules import DEGREES, MILLIMETRES, Rule
from urscript.values import Pose, is_number

_JOINT_RANGE: Final = 6.4
"""No joint but the last goes beyond 363 degrees, and no rotation vector is longer [rad]."""
_LAST_JOINT: Final = 12.6
"""The last joint may turn without end; more than two turns are hardly meant [rad]."""
_JOINT_SPEED: Final = 12.6
"""Twice the speed of the fastest joint [rad/s]."""
_LENGTH: Final = 3.0
"""No arm reaches so far, with its tool [m]."""
_TOOL_SPEED: Final = 10.0
"""More than twice what the fastest arm does with its tool [m/s]."""


class Excess(NamedTuple):
    """A value that is too large for its unit.

    Attributes:
        rule: The warning.
        text: What is too large.
        hint: What to write instead.
    """

    rule: Rule
    text: str
    hint: str


def wrong_unit(param: Param, value: Any) -> Excess | None:
    """What is too large in a constant argument, or None.

    Args:
        param: The parameter; the first words of its unit say what it measures.
        value: Its value; numbers that are not known are 0.
    """
    unit = param.unit
    if isinstance(value, Pose):
        is_pose = "m, rad" in unit or "m and rad" in unit
        return _too_long(value[:3]) or _too_far_turned(value[3:]) if is_pose else None
    if is_number(value):
        value = [value]
    elif not isinstance(value, list) or not value or not all(map(is_number, value)):
        return None
    match unit:
        case "m" | "m from the flange":
            return _too_long(value)
        case "m/s" | "m/s, rad/s":
            return _too_fast_tool(value[:3])
        case "rad/s":
            return _too_fast_joint(value)
    is_joints = len(value) == 6 and "rad" in unit and "/" not in unit
    return _beyond_joints(value) if is_joints else None


def _too_fast_tool(speeds: Sequence[float]) -> Excess | None:
    fastest = max(speeds, key=abs)
    if abs(fastest) <= _TOOL_SPEED:
        return None
    return _in_millimetres(f"{fastest:g} m/s is faster than any arm", fastest)


def _too_fast_joint(speeds: Sequence[float]) -> Excess | None:
    fastest = max(speeds, key=abs)
    if abs(fastest) <= _JOINT_SPEED:
        return None
    return _in_degrees(f"{fastest:g} rad/s is faster than any joint", fastest)


def _beyond_joints(q: Sequence[float]) -> Excess | None:
    for k, x in enumerate(q):
        if abs(x) > (_LAST_JOINT if k == 5 else _JOINT_RANGE):
            return _in_degrees(f"joint {k} at {x:g} rad is {degrees(x):.0f} degrees", x)
    return None


def _too_far_turned(rotation: Sequence[float]) -> Excess | None:
    if hypot(*rotation) <= _JOINT_RANGE:
        return None
    largest = max(rotation, key=abs)
    return _in_degrees(f"a rotation vector with {largest:g} rad is more than a turn", largest)


def _too_long(lengths: Sequence[float]) -> Excess | None:
    longest = max(lengths, key=abs)
    if abs(longest) <= _LENGTH:
        return None
    return _in_millimetres(f"{longest:g} m is farther than any arm reaches", longest)


def _in_degrees(text: str, value: float) -> Excess:
    return Excess(DEGREES, text, f"write d2r({value:g}) if degrees are meant")


def _in_millimetres(text: str, value: float) -> Excess:
    return Excess(MILLIMETRES, text, f"write {value / 1000:g} if millimetres are meant")
