"""The scalar functions of the manual's module "urmath", with the run-time errors it lists.

Infinities and NaN follow IEEE 754 as in the controller's C, where Python would raise.
Source: script manual CB3 3.15.4, module urmath.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from urscript.catalogue.calls import fit_int, number
from urscript.errors import ScriptRuntimeError


def _of_angle(function: str, compute: Callable[[float], float]) -> Callable[[Any], float]:
    def call(f: Any) -> float:
        angle = number(function, "f", f)
        return compute(angle) if math.isfinite(angle) else math.nan

    return call


sin = _of_angle("sin", math.sin)
cos = _of_angle("cos", math.cos)
tan = _of_angle("tan", math.tan)


def _of_ratio(function: str, compute: Callable[[float], float]) -> Callable[[Any], float]:
    def call(f: Any) -> float:
        ratio = number(function, "f", f)
        if ratio < -1 or ratio > 1:
            raise ScriptRuntimeError(f"{function}: Parameter 'f' must be in the range [-1, 1], got {ratio}")
        return compute(ratio)

    return call


asin = _of_ratio("asin", math.asin)
acos = _of_ratio("acos", math.acos)


def atan(f: Any) -> float:
    """Arc tangent [rad]."""
    return math.atan(number("atan", "f", f))


def atan2(x: Any, y: Any) -> float:
    """Arc tangent of x / y [rad] in the right quadrant: the first argument is the numerator."""
    return math.atan2(number("atan2", "x", x), number("atan2", "y", y))


def ceil(f: Any) -> int:
    """Smallest integer not below f."""
    value = number("ceil", "f", f)
    return fit_int("ceil", math.ceil(value) if math.isfinite(value) else value)


def floor(f: Any) -> int:
    """Largest integer not above f."""
    value = number("floor", "f", f)
    return fit_int("floor", math.floor(value) if math.isfinite(value) else value)


def d2r(d: Any) -> float:
    """Degrees to radians: (d / 180) * pi."""
    return number("d2r", "d", d) / 180 * math.pi


def r2d(r: Any) -> float:
    """Radians to degrees."""
    return number("r2d", "r", r) / math.pi * 180


def sqrt(f: Any) -> float:
    """Square root; negative numbers are an error."""
    value = number("sqrt", "f", f)
    if value < 0:
        raise ScriptRuntimeError(f"sqrt: Parameter 'f' must not be negative, got {value}")
    return math.sqrt(value)


def power(base: Any, exponent: Any) -> float:
    """`pow`: base raised to the power of exponent.

    Raises:
        ScriptRuntimeError: negative base with a fractional exponent, zero base with a negative exponent.
    """
    b, e = float(number("pow", "base", base)), float(number("pow", "exponent", exponent))
    if b < 0 and math.isfinite(e) and not e.is_integer():
        raise ScriptRuntimeError(f"pow: a negative base ({b:g}) needs an integral exponent, got {e:g}")
    if b == 0 and e < 0:
        raise ScriptRuntimeError(f"pow: base zero needs an exponent that is not negative, got {e:g}")
    try:
        return math.pow(b, e)
    except OverflowError:
        return -math.inf if b < 0 and e % 2 == 1 else math.inf


def _ln(value: float) -> float:
    return math.log(value) if value else -math.inf


def log(b: Any, f: Any) -> float:
    """Logarithm of f to base b.

    Zero is not mentioned by the manual: it gives the infinities and zeros of C's log(f) / log(b).

    Raises:
        ScriptRuntimeError: b or f negative, or b equal to 1.
    """
    base, value = number("log", "b", b), number("log", "f", f)
    if base < 0 or base == 1:
        raise ScriptRuntimeError(f"log: Parameter 'b' must be neither negative nor 1, got {base}")
    if value < 0:
        raise ScriptRuntimeError(f"log: Parameter 'f' must not be negative, got {value}")
    return _ln(value) / _ln(base)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": sin,
    "cos": cos,
    "tan": tan,
    "asin": asin,
    "acos": acos,
    "atan": atan,
    "atan2": atan2,
    "ceil": ceil,
    "floor": floor,
    "d2r": d2r,
    "r2d": r2d,
    "sqrt": sqrt,
    "pow": power,
    "log": log,
}
