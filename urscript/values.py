"""The values of URScript as Python values: which type is what, equality of types, text forms.

| URScript | Python | | URScript | Python |
|---|---|---|---|---|
| none | `None` | | string | `str`, one character a byte (latin-1) |
| bool | `bool` | | list | `list`, homogeneous |
| int | `int`, 32 bit | | matrix | `Matrix` |
| float | `float` | | pose | `Pose` |
| list with room | `CapacityList` | | struct | `Struct` |

URScript passes everything by value. Therefore lists, poses, matrices and structs are never changed in place:
assigning to an element makes a new value (`run.variables.store_item`), and no copies are needed. Host
functions must not change lists either. Operators are in `run.runtime`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

from urscript import dialect
from urscript.errors import ScriptRuntimeError

INT_MIN: Final = -(2**31)
INT_MAX: Final = 2**31 - 1

TEXT_LIMIT: Final = 1023
"""Longest result of to_str and str_cat in characters. Source: script manual 3.15.4, str_cat."""


class Pose(tuple[float, float, float, float, float, float]):
    """A pose: position x, y, z (m) and rotation vector rx, ry, rz (rad). Six floats, never changed."""

    __slots__ = ()

    def __new__(cls, x: float, y: float, z: float, rx: float, ry: float, rz: float) -> Pose:
        """Convert all six to float."""
        return tuple.__new__(cls, (float(x), float(y), float(z), float(rx), float(ry), float(rz)))

    @classmethod
    def of(cls, numbers: Iterable[float]) -> Pose:
        """A pose from six numbers; raises ScriptRuntimeError for another count."""
        six = tuple(map(float, numbers))
        if len(six) != 6:
            raise ScriptRuntimeError(f"a pose has 6 elements, not {len(six)}")
        return tuple.__new__(cls, six)

    def with_item(self, index: int, value: float) -> Pose:
        """The same pose with element `index` (0..5) set to `value`."""
        six = list(self)
        six[index] = float(value)
        return tuple.__new__(Pose, six)

    def __getnewargs__(self) -> tuple[float, ...]:
        """What it is pickled as."""
        return tuple(self)

    def __repr__(self) -> str:
        return f"Pose{tuple(self)}"


class Matrix:
    """A rectangular matrix of numbers, row by row; never changed once made."""

    __slots__ = ("rows",)

    rows: tuple[tuple[Any, ...], ...]

    def __init__(self, rows: Iterable[Sequence[Any]]) -> None:
        self.rows = tuple(tuple(row) for row in rows)
        width = len(self.rows[0]) if self.rows else 0
        for row in self.rows:
            if len(row) != width:
                raise ScriptRuntimeError(f"a matrix needs rows of equal length, got {width} and {len(row)}")
            for item in row:
                if not is_number(item):
                    raise ScriptRuntimeError(f"a matrix holds numbers only, got {a_type(item)}")

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return len(self.rows), len(self.rows[0]) if self.rows else 0

    def __getitem__(self, index: tuple[int, int]) -> Any:
        row, column = index
        return self.rows[row][column]

    def with_item(self, row: int, column: int, value: float) -> Matrix:
        """The same matrix with one element set to `value`."""
        rows = [list(cells) for cells in self.rows]
        rows[row][column] = value
        return Matrix(rows)

    def __iter__(self) -> Iterator[list[Any]]:
        return iter([list(row) for row in self.rows])

    def __len__(self) -> int:
        return len(self.rows)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Matrix) and self.rows == other.rows

    def __hash__(self) -> int:
        return hash(self.rows)

    def __repr__(self) -> str:
        return f"Matrix({[list(row) for row in self.rows]})"


class CapacityList(list[Any]):
    """A list with room for more elements than it has.

    One without is a plain `list`: its capacity is its length.

    Attributes:
        capacity: Most elements that it can have.
        sample: A value of the type of its elements.
    """

    __slots__ = ("capacity", "sample")

    def __init__(self, items: Iterable[Any], capacity: int, sample: Any) -> None:
        super().__init__(items)
        self.capacity = capacity
        self.sample = sample


def list_with_capacity(items: list[Any], capacity: int, sample: Any) -> list[Any]:
    """A list of `items`, which are not more than `capacity`; `sample` is a value of their type."""
    if len(items) < capacity:
        return CapacityList(items, capacity, sample)
    return items if type(items) is list else list(items)


class Struct:
    """A value with named members; never changed once made.

    Attributes:
        members: Name -> value, in their order.
        size: Number of values in it, with those of the structs and lists in it.

    Raises:
        ScriptRuntimeError: it has too many values.
    """

    __slots__ = ("members", "size")

    members: Mapping[str, Any]
    size: int

    def __init__(self, members: Mapping[str, Any]) -> None:
        self.members = members
        self.size = 1 + sum(map(size_of, members.values()))
        if self.size > dialect.LARGEST_STRUCT:
            raise ScriptRuntimeError(f"a struct of {self.size} values; allowed: {dialect.LARGEST_STRUCT}")

    def with_member(self, name: str, value: Any) -> Struct:
        """The same struct with one member set to `value`."""
        return Struct({**self.members, name: value})

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Struct) and list(self.members.items()) == list(other.members.items())

    def __hash__(self) -> int:
        return hash(tuple(self.members))

    def __repr__(self) -> str:
        return f"Struct({dict(self.members)})"


def size_of(value: Any) -> int:
    """Number of values in a value; eight characters of a string count for one."""
    kind = type(value)
    if kind is Struct:
        return int(value.size)
    if kind is str:
        return 1 + (len(value) >> 3)
    if kind is Matrix:
        rows, columns = value.shape
        return 1 + int(rows * columns)
    if not isinstance(value, list):
        return 1
    return 1 + (sum(map(size_of, value)) if value and type(value[0]) in (str, Struct) else len(value))


TYPE_NAMES: Final[dict[type, str]] = {
    type(None): "none",
    bool: "bool",
    int: "int",
    float: "float",
    str: "string",
    list: "list",
    CapacityList: "list",
    Matrix: "matrix",
    Pose: "pose",
    Struct: "struct",
}
"""Python type -> its name in URScript; other value classes have theirs as `script_type`."""


def type_name(value: Any) -> str:
    """The name of the type of `value`, for messages."""
    return TYPE_NAMES.get(type(value)) or str(getattr(value, "script_type", type(value).__name__))


def a_type(value: Any) -> str:
    """The type of `value` with its article: "a pose", "an int"; None is None."""
    if value is None:
        return "None"
    name = type_name(value)
    return f"{'an' if name[0] in 'aeiou' else 'a'} {name}"


def is_number(value: Any) -> bool:
    """Whether `value` is an int or a float; a bool is not."""
    kind = type(value)
    return kind is float or kind is int or (isinstance(value, (int, float)) and not isinstance(value, bool))


def to_script_text(text: str) -> str:
    """A text as a script string: its UTF-8 bytes, one character a byte."""
    return text.encode("utf-8", "replace").decode("latin-1")


def wrap_int(value: int) -> int:
    """`value` wrapped to 32 bits, two's complement."""
    return (value - INT_MIN) % 2**32 + INT_MIN


def _decimals(value: float) -> str:
    text = f"{value:.6f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def str_form(value: Any) -> str:
    """The text that `to_str` and `str_cat` make, without their length limit.

    Floats have up to six decimals without trailing zeros, elements are separated by a comma and a space.
    Source: script manual 3.15.4, to_str.
    """
    if isinstance(value, str):
        return value
    return _nested_form(value, _decimals, ", ")


def log_form(value: Any) -> str:
    """The text that `textmsg` shows and sockets send: floats with six significant digits, no spaces.

    Source: primary interface captures of text messages; field use for sockets.
    """
    text = value if isinstance(value, str) else _nested_form(value, "{:.6g}".format, ",")
    if len(text) > dialect.LONGEST_STRING:
        raise ScriptRuntimeError(
            f"{a_type(value)} with a text of {len(text)} characters; allowed: up to {dialect.LONGEST_STRING}"
        )
    return text


def _nested_form(value: Any, float_form: Any, comma: str) -> str:
    if isinstance(value, (bool, type(None))):
        return str(value)
    if isinstance(value, float):
        return str(float_form(value))
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, (list, Matrix)):
        return f"[{comma.join(_nested_form(item, float_form, comma) for item in value)}]"
    if isinstance(value, Pose):
        return f"p[{comma.join(_nested_form(item, float_form, comma) for item in value)}]"
    if isinstance(value, Struct):
        colon = comma.replace(",", ":")
        members = value.members.items()
        parts = (f"{name}{colon}{_nested_form(item, float_form, comma)}" for name, item in members)
        return f"{{{comma.join(parts)}}}"
    return str(value)
