"""Records read from files and options: frozen dataclasses whose annotations say what each field may hold.

    @record
    class Tool:
        mass: Annotated[float, number(0.0, 100.0, "kg")] = 0.0

`checked(Tool, {"mass": -1}, "cell.toml", CellError)` raises one line: `cell.toml: mass: -1; give a number
from 0 to 100 kg`. Values are taken as they are, but whole numbers become floats and lists become tuples.
pydantic validates; it is imported when the first record is read.
"""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, is_dataclass
from difflib import get_close_matches
from functools import cache
from math import inf
from types import MappingProxyType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Generic,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, TypeAdapter
    from pydantic_core import CoreSchema, ErrorDetails

T = TypeVar("T")

#: What is said of each type of pydantic's errors, and of the error "allowed" of a `Field`.
_PROBLEMS = MappingProxyType(
    {
        "allowed": "{given}; {msg}",
        "missing": "missing; give {allowed}",
        "unexpected_keyword_argument": "no such key; {nearest}",
        "literal_error": "{given}; give {expected}",
        "dataclass_type": "{given}; give a table",
        "dict_type": "{given}; give a table",
        "tuple_type": "{given}; give a list",
        "too_short": "{given}; give a list of {min_length} or more",
        "too_long": "{given}; give a list of {max_length} or fewer",
        "value_error": "{error}",
    }
)
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60


@dataclass(frozen=True, slots=True, eq=False)
class Field(Generic[T]):
    """What a single value may be; stands in the `Annotated` type of a field.

    Attributes:
        text: what is allowed, for messages and documentation.
        schema: pydantic's core schema.
        unit: of the values; empty without one.
    """

    text: str
    kind: type[T]
    schema: Mapping[str, Any]
    unit: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return {
            "type": "custom-error",
            "schema": dict(self.schema),
            "custom_error_type": "allowed",
            "custom_error_message": f"give {self.text}",
        }


def number(least: float = -inf, most: float = inf, unit: str = "") -> Field[float]:
    """A finite number within bounds."""
    schema = {"type": "float", "strict": True, "ge": least, "le": most, "allow_inf_nan": False}
    return Field(_range_text("number", least, most, unit), float, schema, unit)


def whole(least: int, most: int | None = None, unit: str = "") -> Field[int]:
    """A whole number within bounds."""
    schema = {"type": "int", "strict": True, "ge": least} | ({} if most is None else {"le": most})
    return Field(_range_text("whole number", least, inf if most is None else most, unit), int, schema, unit)


def text(most: int = 1000) -> Field[str]:
    """A text of printable characters that is not empty."""
    printable = r"^[^\p{C}\p{Zl}\p{Zp}]+$"
    schema = {"type": "str", "strict": True, "max_length": most, "pattern": printable}
    return Field(f"a text of at most {most} characters on one line", str, schema)


def word(known: Iterable[str]) -> Field[str]:
    """One of several words."""
    words = list(known)
    return Field(f"one of {', '.join(words)}", str, {"type": "literal", "expected": words})


def _range_text(noun: str, least: float, most: float, unit: str) -> str:
    bounds = (f" from {least:g}" if least > -inf else "") + (f" to {most:g}" if most < inf else "")
    return f"a {noun}{bounds}{unit and f' {unit}'}" if bounds else f"a finite {noun}{unit and f' in {unit}'}"


Flag = Annotated[bool, Field("true or false", bool, {"type": "bool", "strict": True})]
Finite = Annotated[float, number()]


@dataclass(frozen=True, slots=True)
class Items:
    """How many values a list may have; stands in the `Annotated` type of a tuple of any length.

    The first wrong value ends the reading: a hostile list has millions.
    """

    least: int = 1
    most: int = 100_000

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        bounds = {"min_length": self.least, "max_length": self.most, "fail_fast": True}
        return {**handler(source), **bounds}


@dataclass_transform(frozen_default=True, kw_only_default=True)
def record(cls: type[T]) -> type[T]:
    """Make a frozen dataclass of a class; read by `checked`, it takes no other fields than its own.

    A `__post_init__` raises ValueError(problem), or ValueError(field, problem), for fields that do not fit
    each other.
    """
    made = dataclass(frozen=True, slots=True, kw_only=True)(cls)
    made.__pydantic_config__ = {"extra": "forbid"}  # type: ignore[attr-defined]
    return made


def fields_of(kind: type) -> Mapping[str, Field[Any]]:
    """What the fields of a record, or the values of a list, may hold; by name, those with a `Field`."""
    hints = get_type_hints(kind, include_extras=True)
    found = {name: _field(hint) for name, hint in hints.items()}
    return MappingProxyType({name: field for name, field in found.items() if field})


def checked(kind: type[T] | Field[T], values: object, source: str, error: type[Exception]) -> T:
    """Make a record, or a single value, of what was given.

    Args:
        kind: a class made by `record`, or a `Field`.
        values: tables, lists and values as `tomllib` gives them.
        source: file or option, for the message.
        error: what is raised.

    Raises:
        Exception: of the type `error`, in one line: the first thing that is wrong.
    """
    from pydantic import ValidationError

    try:
        made: T = _adapter(kind).validate_python(values)  # type: ignore[arg-type]
        return made
    except ValidationError as problems:
        raise error(f"{source}: {_problem(kind, problems.errors(include_url=False)[0])}") from None
    except error as problem:  # of a record that knows no file
        raise error(f"{source}: {problem}") from problem


def nearest(given: str, known: Iterable[str]) -> str:
    """A hint for someone who gave a word that is not among the known ones."""
    known = list(known)
    near = get_close_matches(given, known, n=1, cutoff=0.5)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    from pydantic import TypeAdapter

    return TypeAdapter(Annotated[Any, kind] if isinstance(kind, Field) else kind)


def _problem(kind: Any, first: ErrorDetails) -> str:
    """Where something is wrong, what was given and what is allowed."""
    place, context = first["loc"], dict(first.get("ctx", {}))
    if first["type"] == "missing":
        context["allowed"] = _allowed(_hint(kind, place))
    elif first["type"] == "unexpected_keyword_argument":
        table = get_type_hints(_bare(_hint(kind, place[:-1])))
        context["nearest"] = nearest(str(place[-1]), table)
    elif isinstance(error := context.get("error"), ValueError):
        *fields, context["error"] = error.args
        place = (*place, *fields)
    words = _PROBLEMS.get(first["type"], "{given}; {msg}")
    said = words.format(given=_shown(first["input"]), msg=first["msg"], **context)
    path = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in place)
    return f"{path.removeprefix('.')}: {said}" if path else said


def _shown(value: object) -> str:
    try:
        return "nothing" if value is None else _SHORT.repr(value)
    except ValueError:  # Python writes no whole number of thousands of digits
        return "a number of thousands of digits"


def _hint(kind: Any, place: tuple[int | str, ...]) -> Any:
    """The annotation at a place of a record."""
    for step in place:
        bare = _bare(kind)
        hints: Any = get_type_hints(bare, include_extras=True) if isinstance(step, str) else get_args(bare)
        kind = hints[step if isinstance(step, str) else 0]
    return kind


def _bare(hint: Any) -> Any:
    """The type in an annotation, without `Annotated` and `| None`."""
    while get_origin(hint) in (Annotated, Union, UnionType):
        hint = get_args(hint)[0]
    return hint


def _field(hint: Any) -> Field[Any] | None:
    """The `Field` in an annotation, also of the values of a list."""
    found = next((one for one in getattr(hint, "__metadata__", ()) if isinstance(one, Field)), None)
    inner = get_args(hint)
    return found or (_field(inner[0]) if inner else None)


def _allowed(hint: Any) -> str:
    bare, field = _bare(hint), _field(hint)
    if is_dataclass(bare) or get_origin(bare) is tuple:
        return "a table" if is_dataclass(bare) else "a list"
    return field.text if field else " or ".join(map(repr, get_args(bare)))  # of a Literal
