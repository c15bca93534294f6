"""The scalar functions against the manual's examples, the standard library and their listed errors."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urscript.builtins import PURE, pure_builtins
from urscript.errors import ScriptRuntimeError

REALS = st.floats(-1e6, 1e6)


def call(name: str, *args: Any) -> Any:
    return PURE[name](*args)


def refusal(name: str, *args: Any) -> str:
    with pytest.raises(ScriptRuntimeError) as caught:
        call(name, *args)
    return caught.value.message


@pytest.mark.parametrize(
    ("name", "args", "result", "digits"),
    [
        ("acos", (0.707,), 0.785, 3),
        ("asin", (0.707,), 0.785, 3),
        ("atan", (1.0,), 0.785, 3),
        ("atan2", (0.5, 0.5), 0.785, 3),
        ("cos", (1.57,), 0.0, 2),
        ("sin", (1.57,), 1.0, 3),
        ("tan", (0.7854,), 1.0, 4),
        ("d2r", (90,), 1.57, 2),
        ("r2d", (1.5707963,), 90, 4),
        ("log", (10.0, 4.0), 0.60206, 6),
        ("pow", (5.0, 3), 125.0, 12),
        ("sqrt", (9,), 3, 15),
    ],
)
def test_manual_examples(name: str, args: tuple[float, ...], result: float, digits: int) -> None:
    assert call(name, *args) == pytest.approx(result, abs=0.6 * 10**-digits)


@pytest.mark.parametrize(
    ("name", "argument", "result"),
    [
        ("ceil", 1.43, 2),
        ("ceil", -1.43, -1),
        ("ceil", -0.5, 0),
        ("floor", 1.53, 1),
        ("floor", -1.53, -2),
        ("floor", 7, 7),
        ("floor", 2147483647.5, 2147483647),
        ("ceil", -2147483648.5, -2147483648),
    ],
)
def test_rounding_gives_an_int(name: str, argument: float, result: int) -> None:
    rounded = call(name, argument)
    assert rounded == result
    assert type(rounded) is int


@pytest.mark.parametrize("argument", [2147483648.0, -2147483649.0, math.inf, math.nan])
def test_rounding_out_of_range(argument: float) -> None:
    assert refusal("floor", argument).endswith("does not fit into a 32-bit integer")


def test_first_argument_of_atan2_is_the_numerator() -> None:
    assert call("atan2", 1, 0) == math.pi / 2
    assert call("atan2", 0, -1) == math.pi
    assert call("atan2", -1, -1) == pytest.approx(-3 * math.pi / 4)


@given(REALS)
def test_degrees_and_radians_are_inverse(angle: float) -> None:
    assert call("r2d", call("d2r", angle)) == pytest.approx(angle, rel=1e-14, abs=1e-14)
    assert call("d2r", angle) == pytest.approx(np.deg2rad(angle), rel=1e-14)


@pytest.mark.parametrize(
    ("name", "reference"), [("sin", np.sin), ("cos", np.cos), ("tan", np.tan), ("atan", np.arctan)]
)
@given(value=REALS)
def test_against_numpy(name: str, reference: Callable[[float], float], value: float) -> None:
    assert call(name, value) == pytest.approx(float(reference(value)), rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("name", ["asin", "acos"])
@pytest.mark.parametrize("value", [1.0000001, -2, 7, math.inf])
def test_arc_functions_refuse_what_is_no_ratio(name: str, value: float) -> None:
    assert refusal(name, value) == f"{name}: Parameter 'f' must be in the range [-1, 1], got {value}"


@pytest.mark.parametrize(
    ("args", "text"),
    [
        ((-2, 0.5), "pow: a negative base (-2) needs an integral exponent, got 0.5"),
        ((0, -1), "pow: base zero needs an exponent that is not negative, got -1"),
        ((-0.0, -0.5), "pow: base zero needs an exponent that is not negative, got -0.5"),
    ],
)
def test_pow_errors(args: tuple[float, float], text: str) -> None:
    assert refusal("pow", *args) == text


@pytest.mark.parametrize(
    ("args", "result"),
    [
        ((-2, 3), -8.0),
        ((-2, -2.0), 0.25),
        ((0, 0), 1.0),
        ((0, 2), 0.0),
        ((1e200, 2), math.inf),
        ((-1e200, 3), -math.inf),
        ((2, 0.5), math.sqrt(2)),
    ],
)
def test_pow(args: tuple[float, float], result: float) -> None:
    power = call("pow", *args)
    assert power == result
    assert type(power) is float


@pytest.mark.parametrize(
    ("args", "text"),
    [
        ((-1, 2), "log: Parameter 'b' must be neither negative nor 1, got -1"),
        ((1, 2), "log: Parameter 'b' must be neither negative nor 1, got 1"),
        ((10, -0.1), "log: Parameter 'f' must not be negative, got -0.1"),
    ],
)
def test_log_errors(args: tuple[float, float], text: str) -> None:
    assert refusal("log", *args) == text


def test_log_of_zero_is_infinite() -> None:
    assert call("log", 10, 0) == -math.inf
    assert call("log", 0.5, 0) == math.inf
    assert call("log", 0, 5) == 0.0


def test_sqrt_of_a_negative_number() -> None:
    assert refusal("sqrt", -1e-9) == "sqrt: Parameter 'f' must not be negative, got -1e-09"
    assert call("sqrt", 0) == 0.0


@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
def test_angles_without_a_value(name: str) -> None:
    assert math.isnan(call(name, math.inf))
    assert math.isnan(call(name, math.nan))


@pytest.mark.parametrize(
    "name", ["sin", "cos", "tan", "asin", "acos", "atan", "ceil", "floor", "d2r", "r2d", "sqrt"]
)
@pytest.mark.parametrize("value", ["1", True, None, [1.0]])
def test_only_numbers_are_numbers(name: str, value: object) -> None:
    text = refusal(name, value)
    assert text.startswith(f"{name}: Parameter '")
    assert "must be a number, got " in text


def test_random_follows_from_the_seed() -> None:
    first, same, other = (pure_builtins(seed)["random"] for seed in (7, 7, 8))
    numbers = [first() for _ in range(200)]
    assert numbers == [same() for _ in range(200)]
    assert numbers != [other() for _ in range(200)]
    assert all(0 <= number <= 1 for number in numbers)
    assert 0.4 < sum(numbers) / len(numbers) < 0.6
    assert "random" not in PURE
