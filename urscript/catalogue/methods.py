"""The methods that values have in later software: `list.append(x)` and its like.

What they do is in `urscript.run.variables`. Source: e-Series script directory, chapter Lists and Structs; the
maker's forum, "Request for comments: variable length lists". Names of parameters are ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from urscript.catalogue.calls import CallSignature
from urscript.catalogue.types import Param, ParamType, Version, releases

SINCE = releases(None, "5.15", "10.0")

_NO_METHODS: Mapping[tuple[str, str], ValueMethod] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class ValueMethod:
    """One method.

    Args:
        type: name of the type whose values have it.
        name: as in calls.
        params: in positional order; none has a default.
        returns: type of the result; "None" where there is none.
        summary: one line.
        changes: the call changes the variable, element or member that it is made on.
    """

    type: str
    name: str
    params: tuple[Param, ...]
    returns: str
    summary: str
    changes: bool = False

    @property
    def form(self) -> str:
        """As a call looks: `list.append(value)`."""
        return f"{self.type}.{self.name}({', '.join(map(str, self.params))})"

    @property
    def signature(self) -> CallSignature:
        """For the check of a call."""
        return CallSignature(self.name, [param.name for param in self.params], frozenset())


_VALUE = Param("value", ParamType.ANY)
_INDEX = Param("index", ParamType.INT)
_LAST = "error where the list is at its capacity"

METHODS: tuple[ValueMethod, ...] = (
    ValueMethod("list", "append", (_VALUE,), "None", f"an element more at the end; {_LAST}", changes=True),
    ValueMethod(
        "list",
        "extend",
        (Param("values", ParamType.LIST),),
        "None",
        f"all elements of a list more at the end; {_LAST}",
        changes=True,
    ),
    ValueMethod(
        "list", "insert", (_INDEX, _VALUE), "None", f"an element more before one; {_LAST}", changes=True
    ),
    ValueMethod("list", "pop", (), "value", "the last element, which the list loses", changes=True),
    ValueMethod("list", "remove", (_INDEX,), "None", "the list loses one element", changes=True),
    ValueMethod("list", "clear", (), "None", "the list loses all elements", changes=True),
    ValueMethod(
        "list",
        "slice",
        (Param("begin", ParamType.INT), Param("end", ParamType.INT)),
        "list",
        "elements from the first index to before the second, as a new list",
    ),
    ValueMethod("list", "length", (), "int", "number of elements"),
    ValueMethod("list", "capacity", (), "int", "most elements that the list can have"),
    ValueMethod("list", "excess_capacity", (), "int", "capacity less length"),
    ValueMethod("list", "to_string", (), "string", "text; one that is cut ends in ...]"),
    ValueMethod("struct", "length", (), "int", "number of members"),
    ValueMethod("struct", "to_string", (), "string", "text; one that is cut ends in ...}"),
    ValueMethod("matrix", "get_row", (_INDEX,), "list", "one row as a list"),
    ValueMethod("matrix", "get_column", (_INDEX,), "list", "one column as a list"),
    ValueMethod("matrix", "shape", (), "list", "[rows, columns]"),
    ValueMethod("matrix", "to_string", (), "string", "text; one that is cut ends in ...]"),
)

_BY_NAME = MappingProxyType({(row.type, row.name): row for row in METHODS})


def methods_of(version: Version) -> Mapping[tuple[str, str], ValueMethod]:
    """The methods that software of this version knows, by type and name."""
    first = SINCE.get(version.generation)
    return _BY_NAME if first is not None and first <= version else _NO_METHODS
