"""The view of the tables that one software version has: names, signatures, binding, checks.

Everything a compiler asks about builtins goes through `Catalogue`; it holds no behaviour of any builtin.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import lru_cache
from typing import Any

from urscript.catalogue.calls import Slot, compile_check, static_bind
from urscript.catalogue.methods import ValueMethod, methods_of
from urscript.catalogue.tables import FIELD_USE, read_chapter
from urscript.catalogue.types import Builtin, BuiltinArray, Generation, ModuleVariable, PerGeneration, Version
from urscript.errors import ScriptTypeError

ALL_ROWS: tuple[Builtin, ...] = (
    *read_chapter("motion"),
    *read_chapter("internals"),
    *read_chapter("urmath"),
    *read_chapter("interfaces"),
    *read_chapter("ioconfiguration"),
    *read_chapter("interpreter_mode"),
    *read_chapter("processpath"),
    *read_chapter("world_model"),
)

VARIABLES: tuple[ModuleVariable, ...] = tuple(
    ModuleVariable(name, value, unit, "motion", "URScript API Reference CB3 3.15.4, module motion, Variables")
    for name, value, unit in (
        ("a_joint_default", 1.4, "rad/s^2"),
        ("a_tool_default", 1.2, "m/s^2"),
        ("v_joint_default", 1.05, "rad/s"),
        ("v_tool_default", 0.25, "m/s"),
    )
)

ARRAYS: tuple[BuiltinArray, ...] = (
    BuiltinArray("digital_out", 10, "get_digital_out", "set_digital_out", FIELD_USE),
)

_MOST_CALL_FORMS = 10_000


class Catalogue:
    """The builtins of one software version.

    Args:
        version: the release whose names are visible.
        rows: rows to select from.
        extra: names to make visible although this version does not know them, in their newest form.

    Raises:
        ValueError: for an `extra` name in no table.
    """

    def __init__(
        self, version: Version, rows: tuple[Builtin, ...] = ALL_ROWS, extra: frozenset[str] = frozenset()
    ) -> None:
        self.version = version
        self._rows = rows
        self._extra = extra
        self._by_name: dict[str, Builtin] = {row.name: row for row in rows if row.is_in(version)}
        for name in sorted(extra):
            forms = [row for row in rows if row.name == name]
            if not forms:
                raise ValueError(f"no builtin named {name!r} in any software version")
            self._by_name.setdefault(name, forms[-1])
        self.variables: Mapping[str, ModuleVariable] = {item.name: item for item in VARIABLES}
        self.arrays: Mapping[str, BuiltinArray] = {item.name: item for item in ARRAYS}
        self.methods: Mapping[tuple[str, str], ValueMethod] = methods_of(version)
        self._slots: dict[tuple[str, int, tuple[str, ...]], list[Slot]] = {}
        self._checks = {name: compile_check(row) for name, row in self._by_name.items()}

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle it as its version, and its rows if they are others than those of the tables."""
        rows = () if self._rows is ALL_ROWS else (self._rows,)
        return catalogue_for, (self.version, self._extra, *rows)

    def lookup(self, name: str) -> Builtin | None:
        """The builtin of that name, or None."""
        return self._by_name.get(name)

    def __getitem__(self, name: str) -> Builtin:
        return self._by_name[name]

    def __contains__(self, name: object) -> bool:
        return name in self._by_name

    def __iter__(self) -> Iterator[Builtin]:
        return iter(self._by_name.values())

    def __len__(self) -> int:
        return len(self._by_name)

    @property
    def names(self) -> frozenset[str]:
        """Names of all builtin functions of this version."""
        return frozenset(self._by_name)

    def suggest(self, name: str, others: Iterable[str] = ()) -> str | None:
        """The known name that looks most like a misspelt one, among builtins, variables and `others`."""
        names = sorted({*self._by_name, *self.variables, *self.arrays, *others})
        by_lower_case = {known.lower(): known for known in names}
        matches = get_close_matches(name.lower(), by_lower_case, n=1, cutoff=0.75)
        return by_lower_case[matches[0]] if matches else None

    def first_releases(self, name: str, has: Callable[[Builtin], bool] = lambda row: True) -> PerGeneration:
        """The first release of each generation with a row of that name; none where no software has one."""
        since = [row.since for row in self._rows if row.name == name and has(row)]
        firsts = ([each.get(generation) for each in since] for generation in Generation)
        return PerGeneration(*(min(filter(None, known), default=None) for known in firsts))

    def static_bind(self, name: str, n_positional: int, keyword_names: Sequence[str] = ()) -> list[Slot]:
        """Where the value of each parameter comes from in a call of this form; the list must not be changed.

        Raises:
            ScriptTypeError: the call does not fit the signature.
        """
        form = name, n_positional, tuple(keyword_names)
        slots = self._slots.get(form)
        if slots is None:
            # A program has few forms of calls, but all programs share the catalogue: limit its size.
            if len(self._slots) > _MOST_CALL_FORMS:
                self._slots.clear()
            try:
                slots = self._slots[form] = static_bind(self._by_name[name], n_positional, keyword_names)
            except ScriptTypeError as error:
                since = self.first_releases(name, lambda row: _fits(row, n_positional, keyword_names))
                if since != PerGeneration():
                    here = f"{self.version.generation.value} {self.version}"
                    error.hint = f"with these arguments it is known since {since}; this is {here}"
                raise
        return slots

    def check_of(self, name: str) -> Callable[[Sequence[Any]], None]:
        """A function that checks bound arguments against what the table asks for: types, ranges, finiteness.

        It raises ScriptRuntimeError with the controller's text where it is known.
        """
        return self._checks[name]


def _fits(builtin: Builtin, n_positional: int, keyword_names: Sequence[str]) -> bool:
    try:
        static_bind(builtin, n_positional, keyword_names)
    except ScriptTypeError:
        return False
    return True


@lru_cache(maxsize=32)
def _view(version: Version, extra: frozenset[str]) -> Catalogue:
    return Catalogue(version, extra=extra)


def catalogue_for(
    version: str | Sequence[int], extra: Iterable[str] = (), rows: tuple[Builtin, ...] = ALL_ROWS
) -> Catalogue:
    """The catalogue of a software version.

    Args:
        version: "3.15", "5.11.4", or a version tuple.
        extra: names to accept beside those of the version, e.g. `["set_tool_communication"]` for a program
            that was exported on an e-Series.
        rows: the builtins of all versions.

    Raises:
        ValueError: for a version of no known generation, or an extra name in no table.
    """
    if rows is not ALL_ROWS:
        return Catalogue(Version.of(version), rows, frozenset(extra))
    return _view(Version.of(version), frozenset(extra))


CB3_3_15 = catalogue_for("3.15")
