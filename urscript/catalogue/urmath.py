"""Builtins of the manual's module "urmath": pure mathematics, behaviour in `urscript.builtins`."""

from __future__ import annotations

from .chapter import MANUAL_LATE, Chapter
from .types import Builtin, Param, ParamType, Support
from .versions import releases

_row = Chapter("urmath", nan_ok=True, default_support=Support.EXACT).row

ANY, INT, NUMBER, LIST = ParamType.ANY, ParamType.INT, ParamType.NUMBER, ParamType.LIST
POSE, VECTOR3 = ParamType.POSE, ParamType.VECTOR3

_F = Param("f", NUMBER)
_P_FROM = Param("p_from", POSE, unit="m, rad")
_P_TO = Param("p_to", POSE, unit="m, rad")

ROWS: tuple[Builtin, ...] = (
    _row("acos", (_F,), "float, rad", "arc cosine; run-time error outside [-1, 1]"),
    _row("asin", (_F,), "float, rad", "arc sine; run-time error outside [-1, 1]"),
    _row("atan", (_F,), "float, rad", "arc tangent"),
    _row("atan2", (Param("x", NUMBER), Param("y", NUMBER)), "float, rad", "arc tangent of x / y"),
    _row("sin", (_F,), "float", "sine of an angle in radians"),
    _row("cos", (_F,), "float", "cosine of an angle in radians"),
    _row("tan", (_F,), "float", "tangent of an angle in radians"),
    _row("ceil", (_F,), "int", "smallest integer not below f"),
    _row("floor", (_F,), "int", "largest integer not above f"),
    _row("d2r", (Param("d", NUMBER, unit="degree"),), "float, rad", "degrees to radians"),
    _row("r2d", (Param("r", NUMBER, unit="rad"),), "float, degree", "radians to degrees"),
    _row("sqrt", (_F,), "float", "square root; run-time error below 0"),
    _row("pow", (Param("base", NUMBER), Param("exponent", NUMBER)), "float", "base to the power of exponent"),
    _row("log", (Param("b", NUMBER), _F), "float", "logarithm of f to base b"),
    _row("norm", (Param("a", ParamType.NORMED),), "number", "absolute value, or Euclidean length"),
    _row("normalize", (Param("v", ParamType.NUMBERS),), "list", "unit vector; run-time error for zero"),
    _row("random", (), "float", "pseudo-random number between 0 and 1"),
    _row("length", (Param("v", ParamType.SIZED),), "int", "number of elements or bytes"),
    _row("get_list_length", (Param("v", ParamType.ARRAY),), "int", "number of elements"),
    _row("size", (Param("v", ParamType.SHAPED),), "int or list", "size of a list, string or matrix"),
    _row("transpose", (Param("m", ParamType.LIST_OR_MATRIX),), "matrix or list", "rows become columns"),
    _row("inv", (Param("m", ParamType.POSE_OR_MATRIX),), "matrix or pose", "inverse of a matrix or pose"),
    _row("integer_to_binary_list", (Param("x", INT),), "list of 32 bool", "two's complement, bit 0 first"),
    _row(
        "binary_list_to_integer", (Param("l", ParamType.BOOLS),), "int", "signed value of bits, bit 0 first"
    ),
    _row("point_dist", (_P_FROM, _P_TO), "float, m", "distance of the positions"),
    _row(
        "pose_dist",
        (_P_FROM, _P_TO),
        "float",
        "distance including rotation",
        support=Support.APPROXIMATE,
        note="the manual gives no formula; taken as the Euclidean length of pose_sub(p_to, p_from)",
    ),
    _row(
        "pose_add", (Param("p_1", POSE), Param("p_2", POSE)), "pose", "positions added, rotations multiplied"
    ),
    _row("pose_sub", (_P_TO, _P_FROM), "pose", "positions subtracted, rotation between the two"),
    _row("pose_trans", (_P_FROM, Param("p_from_to", POSE)), "pose", "the second pose seen from the first"),
    _row("pose_inv", (_P_FROM,), "pose", "inverse transformation"),
    _row(
        "interpolate_pose",
        (_P_FROM, _P_TO, Param("alpha", NUMBER)),
        "pose",
        "straight line, shortest rotation",
    ),
    _row(
        "rotvec2rpy",
        (Param("rotation_vector", VECTOR3, unit="rad"),),
        "list of 3, rad",
        "roll, pitch, yaw of a rotation vector",
    ),
    _row(
        "rpy2rotvec",
        (Param("rpy_vector", VECTOR3, unit="rad"),),
        "list of 3, rad",
        "rotation vector of roll, pitch, yaw",
    ),
    _row(
        "wrench_trans",
        (Param("T_from_to", POSE), Param("w_from", ParamType.VECTOR6, unit="N, Nm")),
        "list of 6, N and Nm",
        "a wrench seen from another frame",
        support=Support.APPROXIMATE,
        note="direction of the rotation read from one manual example (flange to TCP); field scripts disagree",
    ),
    _row(
        "make_list",
        (
            Param("length", INT, low=0),
            Param("initial_value", ANY),
            Param("capacity", INT, None, shown="length", low=0),
        ),
        "list",
        "a list of equal elements",
        since=releases(None, "5.15", "10.0"),
        support=Support.APPROXIMATE,
        note="at most 65,536 elements; error texts are chosen",
        source=MANUAL_LATE,
    ),
    _row(
        "struct",
        (),
        "struct",
        "a value with named members",
        since=releases(None, "5.14", "10.0"),  # in files that 5.14 has saved
        support=Support.APPROXIMATE,
        note="at most 10,000 values; text form and error texts are chosen",
        any_names=True,
        source=MANUAL_LATE,
    ),
)
