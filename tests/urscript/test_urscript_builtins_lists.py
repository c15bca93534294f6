"""Lists, matrices and bits against the manual's examples and numpy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from urscript.builtins import PURE
from urscript.errors import ScriptRuntimeError
from urscript.values import Matrix, Pose

NUMBERS = st.floats(-1e3, 1e3)
INTS = st.integers(-(2**31), 2**31 - 1)


def call(name: str, *args: Any) -> Any:
    return PURE[name](*args)


def refusal(name: str, *args: Any) -> str:
    with pytest.raises(ScriptRuntimeError) as caught:
        call(name, *args)
    return caught.value.message


def test_norm_examples() -> None:
    assert call("norm", -5.3) == 5.3
    assert call("norm", -8) == 8
    assert type(call("norm", -8)) is int
    assert call("norm", Pose(-0.2, 0.2, -0.2, -1.57, 0, 3.14)) == pytest.approx(3.52768, abs=5e-6)
    assert call("norm", [3, 4]) == 5.0


@given(st.lists(NUMBERS, max_size=8))
def test_norm_is_the_euclidean_length(values: list[float]) -> None:
    assert call("norm", values) == pytest.approx(float(np.linalg.norm(values)), rel=1e-12)


@pytest.mark.parametrize("value", ["x", True, None, ["x"], [True], Matrix([[1, 2]])])
def test_norm_refuses(value: object) -> None:
    assert refusal("norm", value).startswith(
        "norm: Parameter 'a' must be a number, a list of numbers or a Pose"
    )


def test_normalize_examples() -> None:
    assert call("normalize", [1, 0, 0]) == [1, 0, 0]
    assert call("normalize", [0, 5, 0]) == [0, 1, 0]
    assert call("normalize", [0, 1, 1]) == pytest.approx([0, 0.707, 0.707], abs=5e-4)


@given(st.lists(NUMBERS, min_size=1, max_size=8).filter(lambda values: any(abs(v) > 1e-6 for v in values)))
def test_normalize_gives_a_parallel_unit_vector(values: list[float]) -> None:
    unit = np.array(call("normalize", values))
    assert np.linalg.norm(unit) == pytest.approx(1, rel=1e-12)
    assert unit * np.linalg.norm(values) == pytest.approx(np.array(values), rel=1e-9, abs=1e-9)


def test_normalize_changes_no_argument() -> None:
    values = [3, 4]
    call("normalize", values)
    assert values == [3, 4]


@pytest.mark.parametrize("values", [[0, 0, 0], [], [0.0, -0.0]])
def test_normalize_of_zero(values: list[float]) -> None:
    assert refusal("normalize", values) == "normalize: the sum of all squared elements is zero"


@pytest.mark.parametrize(
    ("name", "argument", "result"),
    [
        ("get_list_length", [1, 3, 3, 6, 2], 5),
        ("get_list_length", [], 0),
        ("length", [1, 3, 3, 6, 2], 5),
        ("length", "here I am", 9),
        ("length", "", 0),
        ("length", Pose(0, 0, 0, 0, 0, 0), 6),
        ("size", "here I am", 9),
        ("size", [1, 2, 3, 4, 5], 5),
        ("size", Matrix([[1, 2], [3, 4], [5, 6]]), [3, 2]),
    ],
)
def test_lengths(name: str, argument: object, result: object) -> None:
    assert call(name, argument) == result


@pytest.mark.parametrize(
    ("name", "argument"),
    [
        ("get_list_length", "text"),
        ("get_list_length", 3),
        ("length", 3),
        ("length", Matrix([[1]])),
        ("size", None),
    ],
)
def test_lengths_refuse(name: str, argument: object) -> None:
    assert refusal(name, argument).startswith(f"{name}: Parameter 'v' must be a")


def test_transpose_examples() -> None:
    assert call("transpose", Matrix([[1, 2], [3, 4], [5, 6]])) == Matrix([[1, 3, 5], [2, 4, 6]])
    assert call("transpose", [1, 2, 3]) == Matrix([[1], [2], [3]])
    assert call("transpose", Matrix([[1], [2], [3]])) == [1, 2, 3]


@given(
    hnp.arrays(np.float64, hnp.array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=5), elements=NUMBERS)
)
def test_transpose_against_numpy(array: np.ndarray) -> None:
    matrix = Matrix(array.tolist())
    transposed = call("transpose", matrix)
    assert np.array_equal(np.array(transposed.rows), array.T)
    assert call("transpose", transposed) == matrix


def test_transpose_refuses() -> None:
    assert refusal("transpose", ["a"]).startswith(
        "transpose: Parameter 'm' must be a matrix or a list of numbers"
    )


def test_inv_examples() -> None:
    matrix = Matrix([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    assert call("inv", matrix) == Matrix([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    pose = call("inv", Pose(0.2, 0.5, 0.1, 1.57, 0, 3.14))
    assert isinstance(pose, Pose)
    assert list(pose) == pytest.approx([0.19324, 0.41794, -0.29662, 1.23993, 0.0, 2.47985], abs=6e-6)


@given(hnp.arrays(np.float64, (3, 3), elements=st.floats(-10, 10)))
def test_inv_against_the_definition(array: np.ndarray) -> None:
    array = array + 40 * np.eye(3)  # far from singular
    inverse = np.array(call("inv", Matrix(array.tolist())).rows)
    assert inverse @ array == pytest.approx(np.eye(3), abs=1e-12)


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ([[1, 2, 3], [4, 5, 6], [7, 8, 9]], "inv: the matrix is singular"),
        ([[0, 0], [0, 0]], "inv: the matrix is singular"),
        ([[1, 2, 3], [4, 5, 6]], "inv: the matrix must be square, got 2 x 3"),
        ([[1, math.nan], [0, 1]], "inv: the matrix must be finite"),
    ],
)
def test_inv_errors(rows: list[list[float]], text: str) -> None:
    assert refusal("inv", Matrix(rows)) == text


def test_inv_of_a_list() -> None:
    assert refusal("inv", [1, 2]) == "inv: Parameter 'm' must be a square matrix or a Pose, got a list of 2"


def test_bits_examples() -> None:
    assert call("binary_list_to_integer", [True, False, False, True]) == 9
    assert call("binary_list_to_integer", []) == 0
    bits = call("integer_to_binary_list", 57)
    assert bits == [True, False, False, True, True, True] + [False] * 26
    assert call("integer_to_binary_list", -1) == [True] * 32
    assert call("integer_to_binary_list", 4.0)[:4] == [False, False, True, False]


@given(INTS, st.lists(st.booleans(), max_size=9))
def test_bits_round_trip_and_only_32_count(value: int, more: list[bool]) -> None:
    bits = call("integer_to_binary_list", value)
    assert len(bits) == 32
    assert call("binary_list_to_integer", bits + more) == value


@pytest.mark.parametrize("value", [[1, 0], ["True"], "1001", None])
def test_bits_must_be_bools(value: object) -> None:
    assert "must be a list of bools" in refusal("binary_list_to_integer", value)


def test_integer_to_binary_list_needs_an_integer() -> None:
    assert refusal("integer_to_binary_list", 1.5) == (
        "integer_to_binary_list: Parameter 'x' must be an integer, got the float 1.5"
    )
