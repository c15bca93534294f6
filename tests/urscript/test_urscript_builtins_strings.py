"""Strings, numbers in strings and text forms against the manual's examples."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urscript.builtins import PURE
from urscript.errors import ScriptRuntimeError
from urscript.values import Matrix, Pose, log_form

BYTES = st.text(st.characters(max_codepoint=255), max_size=60)
POSE = Pose(1, 2, 3, 4, 5, 6)


def call(name: str, *args: Any) -> Any:
    return PURE[name](*args)


def refusal(name: str, *args: Any) -> str:
    with pytest.raises(ScriptRuntimeError) as caught:
        call(name, *args)
    return caught.value.message


@pytest.mark.parametrize(
    ("name", "args", "result"),
    [
        ("str_at", ("Hello", 0), "H"),
        ("str_at", ("Hello", 1), "e"),
        ("str_cat", ("Hello", " World!"), "Hello World!"),
        ("str_cat", ("Integer ", 1), "Integer 1"),
        ("str_cat", ("", POSE), "p[1, 2, 3, 4, 5, 6]"),
        ("str_cat", ([True, False, True], [1, 0, 1]), "[True, False, True][1, 0, 1]"),
        ("str_cat", ("OneTwo", "34"), "OneTwo34"),
        ("str_cat", ("v=", 0.1 + 0.2), "v=0.3"),
        ("str_empty", ("",), True),
        ("str_empty", ("Hello",), False),
        ("str_find", ("Hello World!", "o", 0), 4),
        ("str_find", ("Hello World!", "lo"), 3),
        ("str_find", ("Hello World!", "o", 5), 7),
        ("str_find", ("abc", "z", 0), -1),
        ("str_find", ("abc", "a", 99), -1),
        ("str_find", ("abc", "c", -1), -1),
        ("str_len", ("Hello",), 5),
        ("str_len", ("",), 0),
        ("str_sub", ("0123456789abcdefghij", 5, 3), "567"),
        ("str_sub", ("0123456789abcdefghij", 10), "abcdefghij"),
        ("str_sub", ("0123456789abcdefghij", 2, 0), ""),
        ("str_sub", ("abcde", 2, 50), "cde"),
        ("str_sub", ("abcde", 5, None), ""),
        ("to_str", (10,), "10"),
        ("to_str", (2.123456123456,), "2.123456"),
        ("to_str", (1.0,), "1"),
        ("to_str", (100.0,), "100"),
        ("to_str", (1e-7,), "0"),
        ("to_str", (POSE,), "p[1, 2, 3, 4, 5, 6]"),
        ("to_str", ([True, False, True],), "[True, False, True]"),
        ("to_str", ([POSE, POSE],), "[p[1, 2, 3, 4, 5, 6], p[1, 2, 3, 4, 5, 6]]"),
        ("to_str", ([],), "[]"),
        ("to_str", (math.inf,), "inf"),
    ],
)
def test_examples(name: str, args: tuple[Any, ...], result: object) -> None:
    assert call(name, *args) == result


@pytest.mark.parametrize(
    ("name", "args", "text"),
    [
        ("str_at", ("Hello", 10), "str_at: index 10 is out of bounds, the string has 5 bytes"),
        ("str_at", ("Hello", -1), "str_at: index -1 is out of bounds, the string has 5 bytes"),
        ("str_at", ("", 0), "str_at: source string is empty"),
        ("str_at", (5, 0), "str_at: Parameter 'src' must be a string, got the int 5"),
        ("str_at", ("x", "0"), "str_at: Parameter 'index' must be an integer, got the string \"0\""),
        ("str_sub", ("abcde", -5, 50), "str_sub: index -5 is out of bounds, the string has 5 bytes"),
        ("str_sub", ("abcde", 6), "str_sub: index 6 is out of bounds, the string has 5 bytes"),
        ("str_sub", ("abcde", 1, -1), "str_sub: len -1 is out of bounds, it must not be negative"),
        ("str_len", ([1],), "str_len: Parameter 'str' must be a string, got a list of 1"),
        (
            "to_str",
            (None,),
            "to_str: operand must be a string, bool, int, float or pose, or a list of bools, ints, "
            "floats or poses, got None",
        ),
        (
            "str_cat",
            ("", ["a"]),
            "str_cat: operand must be a string, bool, int, float or pose, or a list of bools, ints, "
            "floats or poses, got a list with a string in it",
        ),
        (
            "str_cat",
            (Matrix([[1]]), ""),
            "str_cat: operand must be a string, bool, int, float or pose, or a list of bools, ints, "
            "floats or poses, got a matrix",
        ),
    ],
)
def test_errors(name: str, args: tuple[Any, ...], text: str) -> None:
    assert refusal(name, *args) == text


@pytest.mark.parametrize("name", ["str_cat", "to_str"])
def test_length_limit(name: str) -> None:
    def make(length: int) -> tuple[Any, ...]:
        return ("x" * (length - 3), "yyy") if name == "str_cat" else ("x" * length,)

    assert len(call(name, *make(1023))) == 1023
    assert (
        refusal(name, *make(1024)) == f"{name}: the resulting string has 1024 characters, the limit is 1023"
    )


@given(BYTES, st.integers(0, 60), st.integers(0, 60))
def test_str_sub_is_a_slice(text: str, index: int, length: int) -> None:
    if index > len(text):
        assert "out of bounds" in refusal("str_sub", text, index, length)
    else:
        assert call("str_sub", text, index, length) == text[index:][:length]


@given(BYTES, st.text(st.characters(max_codepoint=255), max_size=2), st.integers(0, 70))
def test_str_find_gives_the_first_place(text: str, target: str, start: int) -> None:
    place = call("str_find", text, target, start)
    places = [i for i in range(start, len(text) + 1) if text[i : i + len(target)] == target]
    assert place == (places[0] if places else -1)


@pytest.mark.parametrize(
    ("spelt", "value"),
    [
        ("10", 10),
        ("-5", -5),
        ("+7", 7),
        ("3.14", 3.14),
        (".36", 0.36),
        ("-2.0", -2.0),
        ("-3.0e5", -3.0e5),
        ("+5.", 5.0),
        ("2.5E-5", 2.5e-5),
        ("10e3", 10000),
        ("-5e-4", -5e-4),
        ("  \t\n42", 42),
        ("0X3A", 58),
        ("0xb5", 181),
        ("-0x10", -16),
        ("2147483647", 2147483647),
        ("-2147483648", -2147483648),
        ("INF", math.inf),
        ("-infinity", -math.inf),
        ("007", 7),
    ],
)
def test_to_num(spelt: str, value: float) -> None:
    number = call("to_num", spelt)
    assert number == value
    assert type(number) is type(value)


def test_to_num_reads_nan() -> None:
    assert math.isnan(call("to_num", "NaN"))


@pytest.mark.parametrize(
    "spelt", ["123abc", "", " ", "1 ", "1,5", "0x", "--1", "+", ".", "1e", "0x1.8", "e5", "１"]
)
def test_to_num_refuses(spelt: str) -> None:
    assert refusal("to_num", spelt) == f'to_num: string doesn\'t contain a valid number: "{spelt}"'


@pytest.mark.parametrize("spelt", ["2147483648", "-2147483649", "0xFFFFFFFF", "1e10", "1.0e999"])
def test_to_num_out_of_range(spelt: str) -> None:
    assert refusal("to_num", spelt) == f'to_num: the number is out of range: "{spelt}"'


@given(st.integers(-(2**31), 2**31 - 1))
def test_ints_survive_text(value: int) -> None:
    assert call("to_num", call("to_str", value)) == value


@given(st.floats(-1e6, 1e6))
def test_floats_survive_text_to_six_decimals(value: float) -> None:
    assert call("to_num", call("to_str", value)) == pytest.approx(value, abs=5.1e-7)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (-0.01113677, "-0.0111368"),
        (Pose(0.6058251, -0.7200872, 0, 1, 2, 3), "p[0.605825,-0.720087,0,1,2,3]"),
        ([1, 2.5, True], "[1,2.5,True]"),
        (Matrix([[1, 2], [3, 4]]), "[[1,2],[3,4]]"),
        (1234567.0, "1.23457e+06"),
        (1e-10, "1e-10"),
        (None, "None"),
        ("as it is", "as it is"),
    ],
)
def test_log_form(value: object, text: str) -> None:
    assert log_form(value) == text
