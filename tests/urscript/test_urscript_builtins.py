"""The pure builtins against the manual's examples, numpy, scipy and the errors that the manual lists."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from urscript.builtins import PURE, pure_builtins
from urscript.errors import ScriptRuntimeError
from urscript.values import Matrix, Pose

# --- numbers


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
def test_scalar_examples(name: str, args: tuple[float, ...], result: float, digits: int) -> None:
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


# --- poses


LENGTHS = st.floats(-2, 2)
VECTORS = st.lists(st.floats(-3, 3), min_size=3, max_size=3)
POSES = st.builds(lambda p, r: Pose(*p, *r), st.lists(LENGTHS, min_size=3, max_size=3), VECTORS)
WRENCHES = st.lists(st.floats(-100, 100), min_size=6, max_size=6)


def transform(pose: Pose) -> NDArray[np.float64]:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(pose[3:]).as_matrix()
    T[:3, 3] = pose[:3]
    return T


@pytest.mark.parametrize(
    ("name", "args", "result"),
    [
        (
            "interpolate_pose",
            (Pose(0.2, 0.2, 0.4, 0, 0, 0), Pose(0.2, 0.2, 0.6, 0, 0, 0), 0.5),
            [0.2, 0.2, 0.5, 0, 0, 0],
        ),
        (
            "pose_add",
            (Pose(0.2, 0.5, 0.1, 1.57, 0, 0), Pose(0.2, 0.5, 0.6, 1.57, 0, 0)),
            [0.4, 1.0, 0.7, 3.14, 0, 0],
        ),
        (
            "pose_sub",
            (Pose(0.2, 0.5, 0.1, 1.57, 0, 0), Pose(0.2, 0.5, 0.6, 1.57, 0, 0)),
            [0, 0, -0.5, 0, 0, 0],
        ),
        (
            "pose_trans",
            (Pose(0.2, 0.5, 0.1, 1.57, 0, 0), Pose(0.2, 0.5, 0.6, 1.57, 0, 0)),
            [0.4, -0.0996, 0.60048, 3.14, 0, 0],
        ),
        (
            "pose_inv",
            (Pose(0.2, 0.5, 0.1, 1.57, 0, 3.14),),
            [0.19324, 0.41794, -0.29662, 1.23993, 0.0, 2.47985],
        ),
        ("rotvec2rpy", ([3.14, 1.57, 0],), [-2.80856, -0.16202, 0.9]),
        ("rpy2rotvec", ([3.14, 1.57, 0],), [2.22153, 0.00177, -2.21976]),
    ],
)
def test_pose_examples(name: str, args: tuple[Any, ...], result: list[float]) -> None:
    # The manual prints five digits.
    assert list(call(name, *args)) == pytest.approx(result, abs=6e-6)


@pytest.mark.parametrize("name", ["pose_add", "pose_sub", "pose_trans"])
@given(a=POSES, b=POSES)
def test_products_against_matrices(name: str, a: Pose, b: Pose) -> None:
    A, B = transform(a), transform(b)
    expected = A @ B
    if name == "pose_add":
        expected = np.eye(4)
        expected[:3, :3], expected[:3, 3] = A[:3, :3] @ B[:3, :3], A[:3, 3] + B[:3, 3]
    if name == "pose_sub":
        expected = np.eye(4)
        expected[:3, :3], expected[:3, 3] = A[:3, :3] @ B[:3, :3].T, A[:3, 3] - B[:3, 3]
    result = call(name, a, b)
    assert isinstance(result, Pose)
    assert transform(result) == pytest.approx(expected, abs=1e-12)


@given(POSES)
def test_inverse_undoes(pose: Pose) -> None:
    assert transform(call("pose_inv", pose)) @ transform(pose) == pytest.approx(np.eye(4), abs=1e-12)
    assert np.linalg.norm(call("pose_inv", pose)[3:]) <= math.pi + 1e-12


@given(POSES, POSES)
def test_interpolation_ends_and_goes_on_beyond(a: Pose, b: Pose) -> None:
    assert transform(call("interpolate_pose", a, b, 0)) == pytest.approx(transform(a), abs=1e-9)
    assert transform(call("interpolate_pose", a, b, 1)) == pytest.approx(transform(b), abs=1e-9)
    middle = call("interpolate_pose", a, b, 0.5)
    turn = Rotation.from_rotvec(a[3:]).inv() * Rotation.from_rotvec(b[3:])
    half = Rotation.from_rotvec(a[3:]).inv() * Rotation.from_rotvec(middle[3:])
    if turn.magnitude() < 3:  # nearer pi the shortest turn is not unique
        assert half.as_rotvec() == pytest.approx(turn.as_rotvec() / 2, abs=1e-7)
    assert call("interpolate_pose", a, b, 2)[0] == pytest.approx(2 * b[0] - a[0], abs=1e-12)


def test_distances() -> None:
    a, b = Pose(0.2, 0.5, 0.1, 1.57, 0, 3.14), Pose(0.2, 0.5, 0.6, 0, 1.57, 3.14)
    assert call("point_dist", a, b) == pytest.approx(0.5)
    turn = (Rotation.from_rotvec(b[3:]) * Rotation.from_rotvec(a[3:]).inv()).magnitude()
    assert call("pose_dist", a, b) == pytest.approx(math.hypot(0.5, turn), rel=1e-12)
    assert call("pose_dist", a, a) == pytest.approx(0, abs=1e-15)


@given(VECTORS)
def test_roll_pitch_yaw_against_scipy(vector: list[float]) -> None:
    rotation = Rotation.from_rotvec(vector)
    roll, pitch, yaw = call("rotvec2rpy", vector)
    assert Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix() == pytest.approx(
        rotation.as_matrix(), abs=1e-7
    )
    again = Rotation.from_rotvec(call("rpy2rotvec", [roll, pitch, yaw]))
    assert again.as_matrix() == pytest.approx(rotation.as_matrix(), abs=1e-7)


def test_wrench_at_the_tip_of_a_tool() -> None:
    # 10 N along x at the flange; the TCP is 0.1 m out along z. About the TCP the force acts below the point:
    # M = -p x F = -(0, 0.1 * 10, 0).
    tcp = Pose(0, 0, 0.1, 0, 0, 0)
    assert call("wrench_trans", tcp, [10, 0, 0, 0, 0, 0]) == pytest.approx([10, 0, 0, 0, -1, 0])
    # The TCP turned by 90 degrees about z sees a force along x as one along -y.
    turned = Pose(0, 0, 0, 0, 0, math.pi / 2)
    assert call("wrench_trans", turned, [10, 0, 0, 0, 0, 1]) == pytest.approx([0, -10, 0, 0, 0, 1], abs=1e-12)


@given(POSES, POSES, WRENCHES)
def test_wrenches_chain_like_frames(a: Pose, b: Pose, wrench: list[float]) -> None:
    chained = call("wrench_trans", b, call("wrench_trans", a, wrench))
    assert chained == pytest.approx(call("wrench_trans", call("pose_trans", a, b), wrench), abs=1e-9)
    assert np.linalg.norm(chained[:3]) == pytest.approx(float(np.linalg.norm(wrench[:3])), abs=1e-9)


@given(POSES, WRENCHES, WRENCHES)
def test_wrenches_keep_power(pose: Pose, wrench: list[float], twist: list[float]) -> None:
    # A twist (v, w) at "from" seen from "to": w' = R^T w, v' = R^T (v + w x p). Power is the same in both.
    T = transform(pose)
    R, p = T[:3, :3], T[:3, 3]
    v, w = np.array(twist[:3]), np.array(twist[3:])
    moved = np.concatenate([R.T @ (v + np.cross(w, p)), R.T @ w])
    power = float(np.dot(wrench, twist))
    assert float(np.dot(call("wrench_trans", pose, wrench), moved)) == pytest.approx(power, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "args"),
    [
        ("pose_trans", (Pose(0, 0, 0, 0, 0, 0), [0, 0, 0, 0, 0, 0])),
        ("pose_add", ([0] * 6, Pose(0, 0, 0, 0, 0, 0))),
        ("pose_sub", (1, 2)),
        ("pose_inv", ("p",)),
        ("point_dist", (None, None)),
        ("pose_dist", ([0] * 6, [0] * 6)),
        ("interpolate_pose", ([0] * 6, [0] * 6, 0.5)),
        ("wrench_trans", ([0] * 6, [0] * 6)),
    ],
)
def test_lists_are_no_poses(name: str, args: tuple[Any, ...]) -> None:
    assert refusal(name, *args) == f"{name}: Parameter must be a Pose on the form p[x,y,z,a,b,c]"


def test_other_argument_errors() -> None:
    origin = Pose(0, 0, 0, 0, 0, 0)
    assert refusal("rotvec2rpy", [0, 0]).endswith("must be a list of 3 numbers, got a list of 2")
    assert refusal("rpy2rotvec", origin).endswith("must be a list of 3 numbers, got a pose")
    assert refusal("interpolate_pose", origin, origin, "x").endswith('must be a number, got the string "x"')
    assert refusal("wrench_trans", origin, [1]).endswith(
        "must be a list of 6 numbers or a Pose, got a list of 1"
    )
    assert refusal("pose_inv", Pose(0, 0, 0, math.inf, 0, 0)) == "pose_inv: Parameters must be finite"


# --- lists and matrices


LIST_NUMBERS = st.floats(-1e3, 1e3)
INTS = st.integers(-(2**31), 2**31 - 1)


def test_norm_examples() -> None:
    assert call("norm", -5.3) == 5.3
    assert call("norm", -8) == 8
    assert type(call("norm", -8)) is int
    assert call("norm", Pose(-0.2, 0.2, -0.2, -1.57, 0, 3.14)) == pytest.approx(3.52768, abs=5e-6)
    assert call("norm", [3, 4]) == 5.0


@given(st.lists(LIST_NUMBERS, max_size=8))
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


@given(
    st.lists(LIST_NUMBERS, min_size=1, max_size=8).filter(lambda values: any(abs(v) > 1e-6 for v in values))
)
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
    hnp.arrays(
        np.float64, hnp.array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=5), elements=LIST_NUMBERS
    )
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


# --- strings


BYTES = st.text(st.characters(max_codepoint=255), max_size=60)
POSE = Pose(1, 2, 3, 4, 5, 6)


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
def test_string_examples(name: str, args: tuple[Any, ...], result: object) -> None:
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
def test_string_errors(name: str, args: tuple[Any, ...], text: str) -> None:
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
