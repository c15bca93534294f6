"""The builtins that are plain functions of their arguments: mathematics, lists, poses, strings.

They check their own arguments, raise ScriptRuntimeError without a place, and change no value: every result
is new. The host has the builtins that need a robot, a socket or a clock.

Infinities and NaN follow IEEE 754 as in the controller's C, where Python would raise. Strings are bytes, and
positions in them count from 0. The algebra of poses is `protocol.pose`.

Sources: script manual CB3 3.15.4, modules urmath and internals (str_at to to_str), which says what is an
error but not its text; for lists with room and structs the e-Series script directory, Lists and Structs.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from random import Random
from types import MappingProxyType
from typing import Any

import numpy as np

from protocol import pose as algebra
from urscript import values
from urscript.catalogue.calls import argument, fit_int, integer, number, pose, string
from urscript.catalogue.types import ParamType
from urscript.dialect import LONGEST_LIST
from urscript.errors import ScriptRuntimeError
from urscript.values import Matrix, Pose, Struct, a_type, is_number

# --- numbers ---------------------------------------------------------------------------------------------


def _of_angle(function: str, compute: Callable[[float], float]) -> Callable[[Any], float]:
    def call(f: Any) -> float:
        angle = number(function, "f", f)
        return compute(angle) if math.isfinite(angle) else math.nan

    return call


def _of_ratio(function: str, compute: Callable[[float], float]) -> Callable[[Any], float]:
    def call(f: Any) -> float:
        ratio = number(function, "f", f)
        if ratio < -1 or ratio > 1:
            raise ScriptRuntimeError(f"{function}: Parameter 'f' must be in the range [-1, 1], got {ratio}")
        return compute(ratio)

    return call


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


# --- poses, rotations and wrenches -----------------------------------------------------------------------


def _computed(function: str, compute: Callable[..., Sequence[float]], *args: Any) -> Sequence[float]:
    """`compute(*args)`; infinite angles, which have no sine, become a run-time error."""
    try:
        return compute(*args)
    except (ValueError, OverflowError):
        raise ScriptRuntimeError(f"{function}: Parameters must be finite") from None


def _of_two(
    function: str, first: str, second: str, compute: Callable[[Pose, Pose], Sequence[float]]
) -> Callable[[Any, Any], Pose]:
    def call(a: Any, b: Any) -> Pose:
        return Pose.of(_computed(function, compute, pose(function, first, a), pose(function, second, b)))

    return call


def pose_inv(p_from: Any, function: str = "pose_inv") -> Pose:
    """The inverse transformation; `function` is the builtin that errors name."""
    return Pose.of(_computed(function, algebra.pose_inv, pose(function, "p_from", p_from)))


def interpolate_pose(p_from: Any, p_to: Any, alpha: Any) -> Pose:
    """From p_from (alpha 0) to p_to (alpha 1) on a straight line with the shortest rotation, or beyond."""
    start, goal = pose("interpolate_pose", "p_from", p_from), pose("interpolate_pose", "p_to", p_to)
    fraction = number("interpolate_pose", "alpha", alpha)
    return Pose.of(_computed("interpolate_pose", algebra.interpolate_pose, start, goal, fraction))


def point_dist(p_from: Any, p_to: Any) -> float:
    """Distance of the two positions [m]."""
    start, goal = pose("point_dist", "p_from", p_from), pose("point_dist", "p_to", p_to)
    return math.dist(start[:3], goal[:3])


def pose_dist(p_from: Any, p_to: Any) -> float:
    """Distance including rotation: Euclidean length of pose_sub(p_to, p_from) over all six numbers.

    The manual gives no formula; this one is assumed, to be checked on a real arm.
    """
    start, goal = pose("pose_dist", "p_from", p_from), pose("pose_dist", "p_to", p_to)
    return math.hypot(*_computed("pose_dist", algebra.pose_sub, goal, start))


def rotvec2rpy(rotation_vector: Any) -> list[float]:
    """Roll, pitch, yaw [rad] with R = Rz(yaw) Ry(pitch) Rx(roll) of a rotation vector [rad]."""
    vector = argument("rotvec2rpy", "rotation_vector", ParamType.VECTOR3, rotation_vector)
    return list(_computed("rotvec2rpy", algebra.rotvec_to_rpy, vector))


def rpy2rotvec(rpy_vector: Any) -> list[float]:
    """Rotation vector [rad] of roll, pitch, yaw [rad] with R = Rz(yaw) Ry(pitch) Rx(roll)."""
    vector = argument("rpy2rotvec", "rpy_vector", ParamType.VECTOR3, rpy_vector)
    return list(_computed("rpy2rotvec", algebra.rpy_to_rotvec, vector))


def wrench_trans(T_from_to: Any, w_from: Any) -> list[float]:
    """A wrench [F, M] seen from another frame, whose pose in the present frame is T_from_to.

    F_to = R^T F and M_to = R^T (M - p x F): the torque about the new point, in the new axes. Assumed: some
    scripts in the field read the rotation in the opposite direction; to be checked on a real arm.

    Source: e-Series script directory, get_tcp_force: its example takes the wrench at the TCP from
    `wrench_trans(get_tcp_offset(), get_wrench_at_tool_flange())`.
    """
    x, y, z, rx, ry, rz = pose("wrench_trans", "T_from_to", T_from_to)
    fx, fy, fz, mx, my, mz = argument("wrench_trans", "w_from", ParamType.VECTOR6, w_from)
    mx, my, mz = mx - (y * fz - z * fy), my - (z * fx - x * fz), mz - (x * fy - y * fx)
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = _computed(
        "wrench_trans", algebra.rotvec_to_flat, rx, ry, rz
    )
    return [
        r00 * fx + r10 * fy + r20 * fz,
        r01 * fx + r11 * fy + r21 * fz,
        r02 * fx + r12 * fy + r22 * fz,
        r00 * mx + r10 * my + r20 * mz,
        r01 * mx + r11 * my + r21 * mz,
        r02 * mx + r12 * my + r22 * mz,
    ]


# --- lists, matrices and structs -------------------------------------------------------------------------

_WORD = 32  # bits of an int


def norm(a: Any) -> float:
    """Absolute value of a number (an int stays int), Euclidean length of a list or of all six of a pose."""
    value = argument("norm", "a", ParamType.NORMED, a)
    if isinstance(value, (list, Pose)):
        return math.hypot(*value)
    return values.wrap_int(abs(value)) if type(value) is int else abs(value)


def normalize(v: Any) -> list[float]:
    """The unit vector in the direction of v.

    Raises:
        ScriptRuntimeError: the sum of the squares is zero.
    """
    parts: list[float] = argument("normalize", "v", ParamType.NUMBERS, v)
    square = sum(part * part for part in parts)
    if square == 0:
        raise ScriptRuntimeError("normalize: the sum of all squared elements is zero")
    length = math.sqrt(square)
    return [part / length for part in parts]


def length(v: Any) -> int:
    """Number of elements of a list or pose, or of bytes of a string."""
    return len(argument("length", "v", ParamType.SIZED, v))


def get_list_length(v: Any) -> int:
    """Number of elements of a list or pose."""
    return len(argument("get_list_length", "v", ParamType.ARRAY, v))


def size(v: Any) -> int | list[int]:
    """[rows, columns] of a matrix, else the number of elements or bytes."""
    value = argument("size", "v", ParamType.SHAPED, v)
    return list(value.shape) if isinstance(value, Matrix) else len(value)


def transpose(m: Any) -> Matrix | list[Any]:
    """Rows become columns; a list becomes a column matrix, and a column matrix becomes a list."""
    array = argument("transpose", "m", ParamType.LIST_OR_MATRIX, m)
    if not isinstance(array, Matrix):
        return Matrix([[value] for value in array])
    if array.shape[1] == 1:
        return [row[0] for row in array.rows]
    return Matrix(list(zip(*array.rows, strict=True)))


def inv(m: Any) -> Matrix | Pose:
    """Inverse of a pose or of a square, non-singular matrix."""
    matrix = argument("inv", "m", ParamType.POSE_OR_MATRIX, m)
    if isinstance(matrix, Pose):
        return pose_inv(matrix, "inv")
    rows, columns = matrix.shape
    if rows != columns or rows == 0:
        raise ScriptRuntimeError(f"inv: the matrix must be square, got {rows} x {columns}")
    array = np.array(matrix.rows, dtype=np.float64)
    if not np.isfinite(array).all():
        raise ScriptRuntimeError("inv: the matrix must be finite")
    # Rounding hides exact singularity from the inversion itself: ask for the rank first.
    if np.linalg.matrix_rank(array) < rows:
        raise ScriptRuntimeError("inv: the matrix is singular")
    return Matrix(np.linalg.inv(array).tolist())


def integer_to_binary_list(x: Any) -> list[bool]:
    """The 32 bits of an int in two's complement, least significant first."""
    value = integer("integer_to_binary_list", "x", x)
    return [bool(value >> bit & 1) for bit in range(_WORD)]


def binary_list_to_integer(binary: Any) -> int:
    """Signed value of bits, least significant first; missing ones are 0, those after the 32nd are ignored."""
    bits = argument("binary_list_to_integer", "l", ParamType.BOOLS, binary)
    value = sum(1 << place for place, bit in enumerate(bits[:_WORD]) if bit)
    return value - (1 << _WORD) if value >> (_WORD - 1) else value


def make_list(length: Any, initial_value: Any, capacity: Any = None) -> list[Any]:
    """A list of `length` equal elements with room for `capacity` of them, by default for no more.

    Raises:
        ScriptRuntimeError: a length below 0 or above the capacity, a list of lists.
    """
    count = integer("make_list", "length", length)
    most = count if capacity is None else integer("make_list", "capacity", capacity)
    for name, wanted in (("length", count), ("capacity", most)):
        if not 0 <= wanted <= LONGEST_LIST:
            raise ScriptRuntimeError(
                f"make_list: Parameter '{name}' must be in the range 0 to {LONGEST_LIST}, got {wanted}"
            )
    if count > most:
        raise ScriptRuntimeError(f"make_list: a length of {count} exceeds the capacity of {most}")
    if isinstance(initial_value, (list, Matrix)):
        raise ScriptRuntimeError(
            f"make_list: elements must be no lists, got {a_type(initial_value)}; a list of lists is a matrix"
        )
    return values.list_with_capacity([initial_value] * count, most, initial_value)


def struct(names: tuple[str, ...], *members: Any) -> Struct:
    """A struct of named values; the names are those of the arguments of the call."""
    return Struct(dict(zip(names, members, strict=True)))


# --- strings ---------------------------------------------------------------------------------------------

_NUMBER = re.compile(
    r"""[ \t\n\v\f\r]*
    (?P<sign>[+-]?)
    (?: 0[xX](?P<hex>[0-9a-fA-F]+)
      | (?P<decimal>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
      | (?P<word>inf|infinity|nan)
    )""",
    re.VERBOSE | re.IGNORECASE | re.ASCII,
)


def str_at(src: Any, index: Any) -> str:
    """One byte of a string; run-time error for an empty string or an index past its ends."""
    text, place = string("str_at", "src", src), integer("str_at", "index", index)
    if not text:
        raise ScriptRuntimeError("str_at: source string is empty")
    if not 0 <= place < len(text):
        raise ScriptRuntimeError(f"str_at: index {place} is out of bounds, the string has {len(text)} bytes")
    return text[place]


def str_cat(op1: Any, op2: Any) -> str:
    """The texts of two values, joined; at most 1023 characters."""
    return _limited("str_cat", _operand_text("str_cat", op1) + _operand_text("str_cat", op2))


def to_str(val: Any) -> str:
    """The text of a value; at most 1023 characters."""
    return _limited("to_str", _operand_text("to_str", val))


def str_empty(text: Any) -> bool:
    """Whether a string has no bytes."""
    return not string("str_empty", "str", text)


def str_len(text: Any) -> int:
    """Number of bytes."""
    return len(string("str_len", "str", text))


def str_find(src: Any, target: Any, start_from: Any = 0) -> int:
    """Index of the first occurrence of target from start_from on, -1 if there is none.

    A start past either end finds nothing; the manual lists no error.
    """
    text, wanted = string("str_find", "src", src), string("str_find", "target", target)
    start = integer("str_find", "start_from", start_from)
    return text.find(wanted, start) if 0 <= start <= len(text) else -1


def str_sub(src: Any, index: Any, count: Any = None) -> str:
    """At most `count` bytes from `index` on, all to the end without it.

    Raises:
        ScriptRuntimeError: index outside [0, length], negative count.
    """
    text, start = string("str_sub", "src", src), integer("str_sub", "index", index)
    if not 0 <= start <= len(text):
        raise ScriptRuntimeError(f"str_sub: index {start} is out of bounds, the string has {len(text)} bytes")
    if count is None:
        return text[start:]
    at_most = integer("str_sub", "len", count)
    if at_most < 0:
        raise ScriptRuntimeError(f"str_sub: len {at_most} is out of bounds, it must not be negative")
    return text[start : start + at_most]


def to_num(number_text: Any) -> int | float:
    """The number a string spells: a float if it has a decimal point, else an int.

    Leading spaces, a sign, an exponent, 0x..., inf and nan are allowed. An exponent without a point that
    leaves a fraction ("5e-4") gives a float: the manual allows the text and names no type.

    Raises:
        ScriptRuntimeError: no valid number, or out of range for its type.
    """
    text = string("to_num", "str", number_text)
    match = _NUMBER.fullmatch(text)
    if match is None:
        raise ScriptRuntimeError(f'to_num: string doesn\'t contain a valid number: "{text[:40]}"')
    sign = -1 if match["sign"] == "-" else 1
    if match["word"]:
        return sign * float(match["word"])
    if match["hex"]:
        return _in_range(sign * int(match["hex"], 16), text)
    value = sign * float(match["decimal"])
    if math.isinf(value):
        raise _out_of_range(text)
    if "." in match["decimal"] or not value.is_integer():
        return value
    return _in_range(int(value), text)


def _in_range(value: int, text: str) -> int:
    if not values.INT_MIN <= value <= values.INT_MAX:
        raise _out_of_range(text)
    return value


def _out_of_range(text: str) -> ScriptRuntimeError:
    return ScriptRuntimeError(f'to_num: the number is out of range: "{text[:40]}"')


_ALLOWED = "a string, bool, int, float or pose, or a list of bools, ints, floats or poses"


def _is_scalar(value: Any) -> bool:
    return isinstance(value, (bool, Pose)) or is_number(value)


def _operand_text(function: str, value: Any) -> str:
    """The text of an operand of to_str or str_cat: six decimals at most, trailing zeros removed.

    Raises:
        ScriptRuntimeError: any type but those the manual lists (none, matrices and lists of strings are not).

    Source: script manual CB3 3.15.4, str_cat and to_str.
    """
    if not isinstance(value, str) and not _is_scalar(value):
        if not isinstance(value, list):
            raise ScriptRuntimeError(f"{function}: operand must be {_ALLOWED}, got {a_type(value)}")
        odd = [item for item in value if not _is_scalar(item)]
        if odd:
            raise ScriptRuntimeError(
                f"{function}: operand must be {_ALLOWED}, got a list with {a_type(odd[0])} in it"
            )
    return values.str_form(value)


def _limited(function: str, text: str) -> str:
    """The text, if it is not longer than a script string may become.

    Raises:
        ScriptRuntimeError: more than 1023 characters.
    """
    if len(text) > values.TEXT_LIMIT:
        raise ScriptRuntimeError(
            f"{function}: the resulting string has {len(text)} characters, the limit is {values.TEXT_LIMIT}"
        )
    return text


_NAMED: tuple[Callable[..., Any], ...] = (
    atan, atan2, ceil, floor, d2r, r2d, sqrt, log,
    norm, normalize, length, get_list_length, size, transpose, inv,
    integer_to_binary_list, binary_list_to_integer, make_list, struct,
    pose_inv, interpolate_pose, point_dist, pose_dist, rotvec2rpy, rpy2rotvec, wrench_trans,
    str_at, str_cat, str_empty, str_len, str_find, str_sub, to_num, to_str,
)  # fmt: skip

PURE: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {function.__name__: function for function in _NAMED}
    | {name: _of_angle(name, getattr(math, name)) for name in ("sin", "cos", "tan")}
    | {name: _of_ratio(name, getattr(math, name)) for name in ("asin", "acos")}
    | {
        "pow": power,
        "pose_add": _of_two("pose_add", "p_1", "p_2", algebra.pose_add),
        "pose_sub": _of_two("pose_sub", "p_to", "p_from", algebra.pose_sub),
        "pose_trans": _of_two("pose_trans", "p_from", "p_from_to", algebra.pose_trans),
    }
)
"""URScript name -> function of the bound arguments, for all whose result depends on nothing else."""


def pure_builtins(seed: int) -> dict[str, Callable[..., Any]]:
    """`PURE` and `random`: the same seed gives the same sequence on every machine."""
    return {**PURE, "random": Random(seed).random}
