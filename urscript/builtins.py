"""The builtins that are plain functions of their arguments: mathematics, lists, poses, strings.

They get arguments of the types that the catalogue asks for, raise ScriptRuntimeError without a place, and
change no value: every result is new. The host has the builtins that need a robot, a socket or a clock.

Infinities and NaN follow IEEE 754 as in the controller's C, where Python would raise. Strings are bytes, and
positions in them count from 0. The algebra of poses is `protocol.pose`.

Sources: script manual CB3 3.15.4, modules urmath and internals (str_at to to_str), which says what is an
error but not its text; for lists with room and structs the e-Series script directory, Lists and Structs.
"""

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from random import Random
from types import MappingProxyType
from typing import Any

import numpy as np

from protocol import pose as algebra
from ur_hil.arithmetic import add_up
from urscript import values
from urscript.dialect import LONGEST_LIST
from urscript.errors import ScriptRuntimeError
from urscript.values import Matrix, Pose, Struct, a_type, is_number

# --- numbers ---------------------------------------------------------------------------------------------


def _of_angle(compute: Callable[[float], float]) -> Callable[[float], float]:
    return lambda angle: compute(angle) if math.isfinite(angle) else math.nan


def _of_ratio(function: str, compute: Callable[[float], float]) -> Callable[[float], float]:
    def call(ratio: float) -> float:
        if ratio < -1 or ratio > 1:
            raise ScriptRuntimeError(f"{function}: Parameter 'f' must be in the range [-1, 1], got {ratio}")
        return compute(ratio)

    return call


def _rounded(function: str, compute: Callable[[float], int]) -> Callable[[float], int]:
    def call(value: float) -> int:
        whole = compute(value) if math.isfinite(value) else value
        # A controller converts by a C cast, arbitrary for numbers out of range; here that is an error.
        if values.INT_MIN <= whole <= values.INT_MAX:
            return int(whole)
        raise ScriptRuntimeError(f"{function}: result {whole} does not fit into a 32-bit integer")

    return call


def d2r(d: float) -> float:
    """Degrees to radians: (d / 180) * pi."""
    return d / 180 * math.pi


def r2d(r: float) -> float:
    """Radians to degrees."""
    return r / math.pi * 180


def sqrt(f: float) -> float:
    """Square root; negative numbers are an error."""
    if f < 0:
        raise ScriptRuntimeError(f"sqrt: Parameter 'f' must not be negative, got {f}")
    return math.sqrt(f)


def power(base: float, exponent: float) -> float:
    """`pow`: base raised to the power of exponent.

    Raises:
        ScriptRuntimeError: negative base with a fractional exponent, zero base with a negative exponent.
    """
    b, e = float(base), float(exponent)
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


def log(b: float, f: float) -> float:
    """Logarithm of f to base b.

    Zero is not mentioned by the manual: it gives the infinities and zeros of C's log(f) / log(b).

    Raises:
        ScriptRuntimeError: b or f negative, or b equal to 1.
    """
    if b < 0 or b == 1:
        raise ScriptRuntimeError(f"log: Parameter 'b' must be neither negative nor 1, got {b}")
    if f < 0:
        raise ScriptRuntimeError(f"log: Parameter 'f' must not be negative, got {f}")
    return _ln(f) / _ln(b)


# --- poses, rotations and wrenches -----------------------------------------------------------------------


def _computed(function: str, compute: Callable[..., Sequence[float]], *args: Any) -> Sequence[float]:
    """`compute(*args)`; infinite angles, which have no sine, become a run-time error."""
    try:
        return compute(*args)
    except (ValueError, OverflowError):
        raise ScriptRuntimeError(f"{function}: Parameters must be finite") from None


def _pose_of(function: str, compute: Callable[..., Sequence[float]]) -> Callable[..., Pose]:
    return lambda *args: Pose.of(_computed(function, compute, *args))


def point_dist(p_from: Pose, p_to: Pose) -> float:
    """Distance of the two positions [m]."""
    return math.dist(p_from[:3], p_to[:3])


def pose_dist(p_from: Pose, p_to: Pose) -> float:
    """Distance including rotation: Euclidean length of pose_sub(p_to, p_from) over all six numbers.

    The manual gives no formula; this one is assumed, to be checked on a real arm.
    """
    return math.hypot(*_computed("pose_dist", algebra.pose_sub, p_to, p_from))


def rotvec2rpy(rotation_vector: list[float]) -> list[float]:
    """Roll, pitch, yaw [rad] with R = Rz(yaw) Ry(pitch) Rx(roll) of a rotation vector [rad]."""
    return list(_computed("rotvec2rpy", algebra.rotvec_to_rpy, rotation_vector))


def rpy2rotvec(rpy_vector: list[float]) -> list[float]:
    """Rotation vector [rad] of roll, pitch, yaw [rad] with R = Rz(yaw) Ry(pitch) Rx(roll)."""
    return list(_computed("rpy2rotvec", algebra.rpy_to_rotvec, rpy_vector))


def wrench_trans(T_from_to: Pose, w_from: Sequence[float]) -> list[float]:
    """A wrench [F, M] seen from another frame, whose pose in the present frame is T_from_to.

    F_to = R^T F and M_to = R^T (M - p x F): the torque about the new point, in the new axes. Assumed: some
    scripts in the field read the rotation in the opposite direction; to be checked on a real arm.

    Source: e-Series script directory, get_tcp_force: its example takes the wrench at the TCP from
    `wrench_trans(get_tcp_offset(), get_wrench_at_tool_flange())`.
    """
    x, y, z, rx, ry, rz = T_from_to
    fx, fy, fz, mx, my, mz = w_from
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


def norm(a: float | list[float] | Pose) -> float:
    """Absolute value of a number (an int stays int), Euclidean length of a list or of all six of a pose."""
    if isinstance(a, (list, Pose)):
        return math.hypot(*a)
    return values.wrap_int(abs(a)) if isinstance(a, int) else abs(a)


def normalize(v: list[float]) -> list[float]:
    """The unit vector in the direction of v.

    Raises:
        ScriptRuntimeError: the sum of the squares is zero.
    """
    square = add_up(part * part for part in v)
    if square == 0:
        raise ScriptRuntimeError("normalize: the sum of all squared elements is zero")
    length = math.sqrt(square)
    return [part / length for part in v]


def size(v: Matrix | list[Any] | str | Pose) -> int | list[int]:
    """[rows, columns] of a matrix, else the number of elements or bytes."""
    return list(v.shape) if isinstance(v, Matrix) else len(v)


def transpose(m: Matrix | list[Any]) -> Matrix | list[Any]:
    """Rows become columns; a list becomes a column matrix, and a column matrix becomes a list."""
    if not isinstance(m, Matrix):
        return Matrix([[value] for value in m])
    if m.shape[1] == 1:
        return [row[0] for row in m.rows]
    return Matrix(list(zip(*m.rows, strict=True)))


def inv(m: Matrix | Pose) -> Matrix | Pose:
    """Inverse of a pose or of a square, non-singular matrix."""
    if isinstance(m, Pose):
        return Pose.of(_computed("inv", algebra.pose_inv, m))
    rows, columns = m.shape
    if rows != columns or rows == 0:
        raise ScriptRuntimeError(f"inv: the matrix must be square, got {rows} x {columns}")
    array = np.array(m.rows, dtype=np.float64)
    if not np.isfinite(array).all():
        raise ScriptRuntimeError("inv: the matrix must be finite")
    # Rounding hides exact singularity from the inversion itself: ask for the rank first.
    if np.linalg.matrix_rank(array) < rows:
        raise ScriptRuntimeError("inv: the matrix is singular")
    return Matrix(np.linalg.inv(array).tolist())


def integer_to_binary_list(x: int) -> list[bool]:
    """The 32 bits of an int in two's complement, least significant first."""
    return [bool(x >> bit & 1) for bit in range(_WORD)]


def binary_list_to_integer(bits: list[bool]) -> int:
    """Signed value of bits, least significant first; missing ones are 0, those after the 32nd are ignored."""
    value = sum(1 << place for place, bit in enumerate(bits[:_WORD]) if bit)
    return value - (1 << _WORD) if value >> (_WORD - 1) else value


def make_list(length: int, initial_value: Any, capacity: int | None = None) -> list[Any]:
    """A list of `length` equal elements with room for `capacity` of them, by default for no more.

    Raises:
        ScriptRuntimeError: a length below 0 or above the capacity, a list of lists.
    """
    most = length if capacity is None else capacity
    for name, wanted in (("length", length), ("capacity", most)):
        if not 0 <= wanted <= LONGEST_LIST:
            raise ScriptRuntimeError(
                f"make_list: Parameter '{name}' must be in the range 0 to {LONGEST_LIST}, got {wanted}"
            )
    if length > most:
        raise ScriptRuntimeError(f"make_list: a length of {length} exceeds the capacity of {most}")
    if isinstance(initial_value, (list, Matrix)):
        raise ScriptRuntimeError(
            f"make_list: elements must be no lists, got {a_type(initial_value)}; a list of lists is a matrix"
        )
    return values.list_with_capacity([initial_value] * length, most, initial_value)


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


def str_at(src: str, index: int) -> str:
    """One byte of a string; run-time error for an empty string or an index past its ends."""
    if not src:
        raise ScriptRuntimeError("str_at: source string is empty")
    if not 0 <= index < len(src):
        raise ScriptRuntimeError(f"str_at: index {index} is out of bounds, the string has {len(src)} bytes")
    return src[index]


def str_cat(op1: Any, op2: Any) -> str:
    """The texts of two values, joined; at most 1023 characters."""
    return _limited("str_cat", _operand_text("str_cat", op1) + _operand_text("str_cat", op2))


def to_str(val: Any) -> str:
    """The text of a value; at most 1023 characters."""
    return _limited("to_str", _operand_text("to_str", val))


def str_find(src: str, target: str, start_from: int = 0) -> int:
    """Index of the first occurrence of target from start_from on, -1 if there is none.

    A start past either end finds nothing; the manual lists no error.
    """
    return src.find(target, start_from) if 0 <= start_from <= len(src) else -1


def str_sub(src: str, index: int, count: int | None = None) -> str:
    """At most `count` bytes from `index` on, all to the end without it.

    Raises:
        ScriptRuntimeError: index outside [0, length], negative count.
    """
    if not 0 <= index <= len(src):
        raise ScriptRuntimeError(f"str_sub: index {index} is out of bounds, the string has {len(src)} bytes")
    if count is None:
        return src[index:]
    if count < 0:
        raise ScriptRuntimeError(f"str_sub: len {count} is out of bounds, it must not be negative")
    return src[index : index + count]


def to_num(text: str) -> int | float:
    """The number a string spells: a float if it has a decimal point, else an int.

    Leading spaces, a sign, an exponent, 0x..., inf and nan are allowed. An exponent without a point that
    leaves a fraction ("5e-4") gives a float: the manual allows the text and names no type.

    Raises:
        ScriptRuntimeError: no valid number, or out of range for its type.
    """
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
    math.atan, math.atan2, d2r, r2d, sqrt, log,
    norm, normalize, size, transpose, inv,
    integer_to_binary_list, binary_list_to_integer, make_list, struct,
    point_dist, pose_dist, rotvec2rpy, rpy2rotvec, wrench_trans,
    str_at, str_cat, str_find, str_sub, to_num, to_str,
)  # fmt: skip

PURE: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {function.__name__: function for function in _NAMED}
    | {name: _of_angle(getattr(math, name)) for name in ("sin", "cos", "tan")}
    | {name: _of_ratio(name, getattr(math, name)) for name in ("asin", "acos")}
    | {name: _rounded(name, getattr(math, name)) for name in ("ceil", "floor")}
    | {
        name: _pose_of(name, getattr(algebra, name))
        for name in ("pose_add", "pose_sub", "pose_trans", "pose_inv", "interpolate_pose")
    }
    | {"pow": power, "str_empty": operator.not_}
    | dict.fromkeys(("length", "get_list_length", "str_len"), len)
)
"""URScript name -> function of the fitted arguments, for all whose result depends on nothing else."""


def pure_builtins(seed: int) -> dict[str, Callable[..., Any]]:
    """`PURE` and `random`: the same seed gives the same sequence on every machine."""
    return {**PURE, "random": Random(seed).random}
