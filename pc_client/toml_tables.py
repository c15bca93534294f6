"""Typed reading of TOML tables, with messages that name file and field, and writing of TOML values.

Generic: this module knows nothing of movements or cells.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import ClientError, MovementError

__all__ = ["TableReader", "toml_value"]


class TableReader:
    """One table of a TOML file: every field is fetched by name and type, and none may be left over.

    Args:
        values: the table as `tomllib` gives it.
        source: the file's name, for messages.
        prefix: the table's own name within the file, for messages.
        error_type: the kind of error that a file of this kind raises.
    """

    def __init__(
        self,
        values: Mapping[str, Any],
        source: str,
        prefix: str = "",
        error_type: type[ClientError] = MovementError,
    ) -> None:
        self._values = dict(values)
        self._source = source
        self._prefix = prefix
        self._error_type = error_type

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def error(self, key: str, problem: str) -> ClientError:
        """An error about one field."""
        return self._error_type(f"{self._source}: {self._prefix}{key}: {problem}")

    def text(self, key: str) -> str:
        """A text that is not empty."""
        value = self._take(key, "a text")
        if not isinstance(value, str) or not value:
            raise self.error(key, f"{value!r}; give a text")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        """A finite number."""
        if default is not None and key not in self._values:
            return default
        return self._number(key, self._take(key, "a number"))

    def numbers(self, key: str) -> list[float]:
        """A list of finite numbers."""
        value = self._take(key, "a list of numbers")
        if not isinstance(value, list):
            raise self.error(key, f"{value!r}; give a list of numbers")
        return [self._number(f"{key}[{index}]", item) for index, item in enumerate(value)]

    def points(self, key: str) -> NDArray[np.float64]:
        """A list of at least two points of three finite numbers, (n, 3)."""
        value = self._take(key, "a list of points [x, y, z]")
        if not isinstance(value, list) or len(value) < 2:
            raise self.error(key, "give a list of at least two points [x, y, z]")
        for index, row in enumerate(value):
            if not isinstance(row, list) or len(row) != 3:
                raise self.error(f"{key}[{index}]", f"{row!r}; give a point [x, y, z]")
        return np.array(
            [
                [self._number(f"{key}[{i}][{j}]", item) for j, item in enumerate(row)]
                for i, row in enumerate(value)
            ]
        )

    def table(self, key: str) -> TableReader:
        """A table inside this one."""
        value = self._take(key, f"a table [{key}]")
        if not isinstance(value, dict):
            raise self.error(key, f"{value!r}; give a table [{key}]")
        return self._inner(value, key)

    def tables(self, key: str) -> list[TableReader]:
        """A list of tables inside this one, at least one."""
        value = self._take(key, f"tables [[{key}]]")
        if not isinstance(value, list) or not value or not all(isinstance(item, dict) for item in value):
            raise self.error(key, f"give one or more tables [[{key}]]")
        return [self._inner(item, f"{key}[{index}]") for index, item in enumerate(value)]

    def facts(self) -> dict[str, str | int | float]:
        """All that is left, which must be texts and numbers."""
        left, self._values = self._values, {}
        for key, value in left.items():
            if not isinstance(value, str | int | float):
                raise self.error(key, f"{value!r}; give a text or a number")
        return left

    def finish(self, known: str) -> None:
        """Refuse fields that nobody asked for; `known` is the list of what is allowed, for the message."""
        if self._values:
            raise self.error(next(iter(self._values)), f"no such field; known are {known}")

    def _inner(self, values: Mapping[str, Any], name: str) -> TableReader:
        return TableReader(values, self._source, f"{self._prefix}{name}.", self._error_type)

    def _take(self, key: str, wanted: str) -> Any:
        if key not in self._values:
            raise self.error(key, f"missing; give {wanted}")
        return self._values.pop(key)

    def _number(self, key: str, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"{value!r}; give a finite number")
        try:
            number = float(value)
        except OverflowError:  # a whole number of more than 308 digits
            number = math.inf
        if not math.isfinite(number):
            raise self.error(key, f"{number}; give a finite number")
        return number


def toml_value(value: str | int | float | list[Any]) -> str:
    """A text, a number or a (nested) list as TOML; floats to the last digit, so that they come back equal."""
    if isinstance(value, str):
        # A TOML basic string is a JSON string, but for DEL.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} has no place in a movement file")
    return repr(value)
