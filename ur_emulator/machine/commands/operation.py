"""Operation: an operation of the control API, declared as a frozen dataclass.

The first sentence of its docstring is its sentence; its fields are its parameters: the annotation and
`parameter` say what they may be; they are checked when the record is made. Methods of `ControlBox`, the
HTTP API, `ur-emulator ctl` and docs/control.md follow from that (`control_api.operations`). The command line
imports all of them: nothing heavy here.
"""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from enum import Enum
from inspect import getdoc
from itertools import islice
from math import hypot, inf, isfinite
from types import NoneType, UnionType
from typing import (
    Any,
    ClassVar,
    Generic,
    Literal,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

from ur_emulator.errors import ArgumentError
from ur_emulator.machine.controller.command import BoxParts, Result

_WORDS = {"true": True, "on": True, "1": True, "false": False, "off": False, "0": False}


class Kind(Enum):
    """Type of a parameter, as people read it."""

    NUMBER = "number"
    INTEGER = "integer"
    BOOLEAN = "true or false"
    CHOICE = "word"
    TEXT = "text"
    SCRIPT = "URScript"
    VECTOR = "numbers"
    ANSWER = "true, false, number or text"
    OBJECT = "JSON object"


# Kinds of parameters by the type of their field; one of several types, beside None, is an ANSWER.
_KINDS: Mapping[Any, Kind] = {
    float: Kind.NUMBER,
    int: Kind.INTEGER,
    bool: Kind.BOOLEAN,
    str: Kind.TEXT,
    Literal: Kind.CHOICE,
    tuple: Kind.VECTOR,
    Sequence: Kind.VECTOR,
    Mapping: Kind.OBJECT,
}
# How a word of a command line or a query is read; the other kinds are texts.
_READERS: Mapping[Kind, Callable[[str], Any]] = {
    Kind.NUMBER: float,
    Kind.INTEGER: int,
    Kind.OBJECT: json.loads,
    Kind.ANSWER: json.loads,
}
# Characters of a text such as a log line or a popup, and of a program.
_LENGTHS = {Kind.TEXT: 1000, Kind.SCRIPT: 500_000, Kind.ANSWER: 1000}
# How far computing puts a number that lies on a bound beyond it, as a share of the bound; or in its unit.
_ROUNDING = 1e-9
_COUNTS = {(3, 3): "three", (6, 6): "six", (0, 3): "up to three"}


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of an operation.

    Attributes:
        meaning: what it is, as a phrase.
        default: taken when it is not given; None where leaving it out means something of its own, MISSING
            where it must be given.
        low: least number.
        high: greatest number; of a vector, its greatest length.
        lengths: of a VECTOR: least and greatest number of numbers.
    """

    name: str
    kind: Kind
    meaning: str
    default: Any
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    lengths: tuple[int, int] = (3, 3)

    @property
    def is_required(self) -> bool:
        """True if it must be given."""
        return self.default is MISSING

    @property
    def allowed(self) -> str:
        """What is allowed, as a phrase."""
        unit = f" {self.unit}" if self.unit else ""
        match self.kind:
            case Kind.CHOICE:
                return " or ".join((", ".join(self.choices[:-1]), self.choices[-1]))
            case Kind.VECTOR:
                most = f", together at most {self.high:g}{unit}" if self.high is not None else ""
                return f"{_COUNTS[self.lengths]} numbers{most}"
            case Kind.NUMBER | Kind.INTEGER if self.high is not None and self.low is not None:
                return f"{self.low:g} to {self.high:g}{unit}"
            case Kind.NUMBER | Kind.INTEGER if self.low is not None:
                return f"{self.kind.value} from {self.low:g}{unit}"
            case Kind.TEXT | Kind.SCRIPT:
                return f"text of at most {_LENGTHS[self.kind]} characters"
            case _:
                return f"{self.kind.value}{unit}"

    @property
    def words(self) -> tuple[str, ...]:
        """What may be given for it, where that is one of a few words."""
        return ("on", "off") if self.kind is Kind.BOOLEAN else self.choices

    def check(self, value: Any) -> Any:
        """Return a value as operations want it; ArgumentError if it does not fit."""
        if value is None and self.default is None:
            return None
        checked = self._checked(value)
        if checked is None:
            raise ArgumentError(f"{self.name} {_short(value)} given: allowed is {self.allowed}")
        return checked

    def parse(self, text: str) -> Any:
        """Return what a word of a command line or a query means; `check` still has to look at it."""
        if self.kind is Kind.BOOLEAN:
            return _WORDS.get(text.lower(), text)
        if self.kind is Kind.VECTOR:
            return [_read(float, word) for word in text.replace(",", " ").split()]
        value = _read(_READERS.get(self.kind, str), text)
        return text if self.kind is Kind.ANSWER and not isinstance(value, int | float | str) else value

    def _checked(self, value: Any) -> Any:
        """Return the value, or None if it does not fit."""
        match self.kind:
            case Kind.BOOLEAN if isinstance(value, int) and value in (True, False):
                return bool(value)
            case Kind.NUMBER if _is_number(value):
                return self._in_range(float(value))
            case Kind.INTEGER if isinstance(value, int) and _is_number(value):
                return None if self._in_range(float(value)) is None else value
            case Kind.CHOICE if isinstance(value, str) and value in self.choices:
                return value
            case Kind.TEXT | Kind.SCRIPT | Kind.ANSWER if _is_text(value, _LENGTHS[self.kind]):
                return value
            case Kind.ANSWER if isinstance(value, bool) or _is_number(value):
                return value
            case Kind.OBJECT if isinstance(value, Mapping) and _is_json(value):
                return dict(value)
            case Kind.VECTOR if isinstance(value, Iterable) and not isinstance(value, str | bytes | Mapping):
                least, most = self.lengths
                numbers = tuple(islice(value, most + 1))
                if least <= len(numbers) <= most and all(map(_is_number, numbers)):
                    vector = tuple(map(float, numbers))
                    return None if self._in_range(hypot(*vector)) is None else vector
        return None

    def _in_range(self, value: float) -> float | None:
        return within(value, -inf if self.low is None else self.low, inf if self.high is None else self.high)


def within(value: float, low: float = -inf, high: float = inf) -> float | None:
    """Return a number between two bounds, None for one outside.

    One that is outside by no more than what it was computed with may have added is taken for the bound.
    """
    bounded = min(max(value, low), high)
    return bounded if abs(value - bounded) <= _ROUNDING * max(1.0, abs(bounded)) else None


def parameter(
    meaning: str,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    *,
    default: Any = MISSING,
    **details: Any,
) -> Any:
    """Declare a field of an operation's dataclass; see `Parameter`.

    Without a default it must be given. `details` are `kind`, `choices` or `lengths`, where the type of the
    field does not say them.
    """
    if "choices" in details:
        details["kind"] = Kind.CHOICE
    declared = {"meaning": meaning, "unit": unit, "low": low, "high": high, **details}
    return field(default=default, metadata=declared)


def _details_of(annotation: Any) -> dict[str, Any]:
    """Return the kind of a field by its type, and what else the type defines."""
    origin, arguments = get_origin(annotation) or annotation, get_args(annotation)
    if origin in (Union, UnionType):
        first, *others = (one for one in arguments if one is not NoneType)
        return {"kind": Kind.ANSWER} if others else _details_of(first)
    details: dict[str, Any] = {"kind": _KINDS[origin]}
    if origin is Literal:
        details["choices"] = arguments
    if origin is tuple:
        details["lengths"] = (len(arguments), len(arguments))
    return details


def _is_json(value: Mapping[Any, Any]) -> bool:
    try:
        json.dumps(value, allow_nan=False)
    except (TypeError, ValueError):
        return False
    return all(isinstance(name, str) for name in value)


def _is_number(value: Any) -> bool:
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:
        return False


def _is_text(value: Any, most: int) -> bool:
    """Text with a lone surrogate cannot be encoded."""
    return isinstance(value, str) and len(value) <= most and not any("\ud800" <= c <= "\udfff" for c in value)


def _short(value: Any) -> str:
    text = ascii(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _read(reader: Callable[[str], Any], text: str) -> Any:
    try:
        return reader(text)
    except (ValueError, RecursionError):
        return text


R_co = TypeVar("R_co", covariant=True)


@dataclass_transform(frozen_default=True, field_specifiers=(parameter,))
class Operation(Generic[R_co]):
    """What is common to all operations; `R_co` is what the method of `ControlBox` returns.

    Attributes:
        result: what the JSON object that it returns holds.
        only_reads: it changes nothing: a property in Python, GET in HTTP.
        is_logged: the box's log shows that it was asked for.
        api_name: its name in the control API, "" without one.
        given: names of the arguments that were given, which the log shows; all, unless `make` made it.

    Raises:
        ArgumentError: when one is made with a value that does not fit.
    """

    parameters: ClassVar[tuple[Parameter, ...]] = ()
    meaning: ClassVar[str] = ""
    result: ClassVar[str] = "`tick`: the cycle in which it was applied"
    only_reads: ClassVar[bool] = False
    is_logged: ClassVar[bool] = True
    api_name: ClassVar[str] = ""
    given: tuple[str, ...]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        dataclass(frozen=True)(cls)
        types = get_type_hints(cls)
        cls.parameters = tuple(
            Parameter(row.name, default=row.default, **{**_details_of(types[row.name]), **row.metadata})
            for row in fields(cls)  # type: ignore[arg-type]
        )
        cls.given = tuple(row.name for row in cls.parameters)
        cls.meaning = (getdoc(cls) or "").partition("\n")[0]

    def __post_init__(self) -> None:
        for row in self.parameters:
            object.__setattr__(self, row.name, row.check(getattr(self, row.name)))
        self.check_together()

    @property
    def as_given(self) -> dict[str, Any]:
        """The arguments that were given, checked."""
        return {name: getattr(self, name) for name in self.given}

    def check_together(self) -> None:
        """Raise ArgumentError for parameters that fit one by one but not together."""


class CommandOperation(Operation[int]):
    """An operation that is done at the beginning of a cycle; its method returns the number of that cycle."""

    @abstractmethod
    def apply(self, box: BoxParts) -> Result:
        """Apply the operation; return what its result holds beside `tick`, if anything.

        RefusedError if the state of the box does not allow it.
        """
