"""Recipes: the variables of an RTDE data package, their order, and the codec made from them.

A recipe is made once, when a client sets it up, and used every cycle: the robot's encoder is one generated
call of `struct.pack` over all numbers of the package. Nothing here knows ids, frequencies or clients.
"""

import struct
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from itertools import chain
from typing import Any
from weakref import WeakValueDictionary

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.packing import attribute, snapshot_packer
from protocol.rtde.fields import RtdeField
from protocol.rtde.types import RtdeType, RtdeValue

__all__ = ["Recipe", "recipe_of", "snapshot_encoder"]


class Recipe:
    """An ordered list of variables with their types; `size` is the bytes of all values."""

    __slots__ = ("__weakref__", "_counts", "_is_flat", "_struct", "names", "size", "types")

    def __init__(self, names: Iterable[str], types: Iterable[RtdeType]) -> None:
        self.names = tuple(names)
        self.types = tuple(types)
        self._struct = struct.Struct(">" + "".join(kind.letters for kind in self.types))
        self._counts = tuple(kind.count for kind in self.types)
        self._is_flat = all(count == 1 for count in self._counts)
        self.size = self._struct.size

    def __repr__(self) -> str:
        return f"<Recipe {','.join(self.names)}: {self.size} bytes>"

    def decode(self, data: bytes) -> tuple[RtdeValue, ...]:
        """Values from bytes of exactly the recipe's size; RemoteProtocolError if they are fewer or more."""
        if len(data) != self.size:
            raise RemoteProtocolError(
                f"a data package of {len(self.names)} variables has {self.size} bytes of values, "
                f"this one {len(data)}"
            )
        return self._group(self._struct.unpack(data))

    def encode(self, values: Iterable[RtdeValue]) -> bytes:
        """Bytes of one value for each variable; LocalProtocolError if they do not fit its types."""
        flat = chain.from_iterable(value if isinstance(value, tuple) else (value,) for value in values)
        try:
            return self._struct.pack(*flat)
        except struct.error as problem:
            raise LocalProtocolError(f"the values do not fit {self}: {problem}") from None

    def decode_leading(self, data: bytes) -> tuple[RtdeValue, ...]:
        """The complete values: all of them from surplus bytes, the first ones from too few.

        Clients send both: the public ur_rtde 1.6.5 sends 12 floats for a recipe of 6, and 6 floats for a
        recipe that has one more integer.
        """
        if len(data) >= self.size:
            return self._group(self._struct.unpack_from(data))
        fit, size = 0, 0
        while size + self.types[fit].size <= len(data):
            size += self.types[fit].size
            fit += 1
        return Recipe(self.names[:fit], self.types[:fit]).decode(data[:size])

    def _group(self, flat: tuple[Any, ...]) -> tuple[RtdeValue, ...]:
        if self._is_flat:
            return flat
        values: list[RtdeValue] = []
        start = 0
        for count in self._counts:
            values.append(flat[start] if count == 1 else flat[start : start + count])
            start += count
        return tuple(values)


_RECIPES: WeakValueDictionary[tuple[tuple[str, ...], tuple[RtdeType, ...]], Recipe] = WeakValueDictionary()


def recipe_of(fields: Sequence[RtdeField]) -> Recipe:
    """Return the recipe of these variables: the same one for all who have it, as long as one has."""
    # Names of the table, not those that arrived: every recipe would hold copies of its own.
    key = tuple(field.name for field in fields), tuple(field.type for field in fields)
    recipe = _RECIPES.get(key)
    if recipe is None:
        recipe = _RECIPES[key] = Recipe(*key)
    return recipe


def snapshot_encoder(fields: Sequence[RtdeField], header: bytes) -> Callable[[Any], bytes]:
    """Make a function from snapshot to data package; the same one for the same recipe.

    The fields are outputs; the header is the same in every package. The function takes an object that has the
    attributes named by the fields' `comes_from`: tuples of numbers for vectors, numbers otherwise. It raises
    `LocalProtocolError` when a value does not fit its type and `AttributeError` when the object lacks an
    attribute.
    """
    return _make_encoder(tuple(fields), header)


@lru_cache(maxsize=64)
def _make_encoder(fields: tuple[RtdeField, ...], header: bytes) -> Callable[[Any], bytes]:
    def explain(snapshot: Any, problem: Exception) -> LocalProtocolError:
        for field in fields:
            value: Any = field.constant
            if field.comes_from:
                value = eval(f"s.{field.comes_from}", {"s": snapshot})
            try:
                struct.pack(">" + field.type.letters, *(value if field.type.count > 1 else (value,)))
            except (struct.error, TypeError):
                return LocalProtocolError(f"{field.name} is {value!r}, which is not {field.type.value}")
        return LocalProtocolError(f"this snapshot cannot be encoded: {problem}")

    letters = "".join(field.type.letters for field in fields)
    arguments = [
        attribute(field.comes_from, field.type.count) if field.comes_from else repr(field.constant)
        for field in fields
    ]
    return snapshot_packer(header, letters, arguments, explain)
