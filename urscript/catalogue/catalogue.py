"""The builtins of all software versions, read from `chapters/`, and the view that one version has of them.

Everything a compiler asks about builtins goes through `Catalogue`; it holds no behaviour of any builtin.

A file of `chapters/` is one module of the script manual:

    movej(q: pose|joints [rad, or pose in m and rad], a: number = 1.4 [rad/s^2]) -> None
        one line that says what it does
        motion, approximate: why it is not exact
        since 3.0 5.0 10.0

A parameter has a type of `ParamType`, then what applies of: a range `0..7`, `0..` or `..1`, the only values
allowed `{0, 12, 24}`, a default `= 1.4`, or `= (active TCP)` for one that the controller fills in, a unit in
brackets. Lines below the summary: time, support, `deprecated`, `nan ok`, `any names`, then the note; `since`
and `until` with a release of CB3, e-Series and PolyScope X each, `-` for none; `undocumented` generations.
Eight spaces continue a line. What `by default:` lists holds for the
rows up to the next blank line.

Sources are the manuals (MANUAL_CB3: URScript API Reference CB3 3.15.4; MANUAL_E: Script Manual e-Series 5.11)
of the generations that document a row, unless a line `source`, which is for readers, names others:
MANUAL_LATE: Script Directory e-Series 5.2x; MANUAL_X: world model and ROS 2 pages of the 5.2x / 10.x script
directories; DRIVER_SCRIPT: called after run-time tests by the maker's driver script, which 3.14.3 and later
accept; POLYSCOPE_EXPORT: written by PolyScope into exported programs; FIELD_USE: called by field scripts and
public clients.

"3.0", "5.0" and "10.0" mean "since the first release": the manuals rarely give a later one. "5.21": names
first seen in an e-Series manual of the 5.2x editions; the exact first release is not known.
"""

import re
from ast import literal_eval
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from protocol.ur_types import JOINT_ACCELERATION, JOINT_SPEED
from urscript.catalogue import types
from urscript.catalogue.calls import Fitting, Slot, compile_fitting, static_bind
from urscript.catalogue.types import Builtin, Generation, ModuleVariable, Param, PerGeneration, Version
from urscript.errors import ScriptTypeError
from urscript.values import Pose

VARIABLES: Final = {
    "a_joint_default": ModuleVariable(JOINT_ACCELERATION, "rad/s^2"),
    "a_tool_default": ModuleVariable(1.2, "m/s^2"),
    "v_joint_default": ModuleVariable(JOINT_SPEED, "rad/s"),
    "v_tool_default": ModuleVariable(0.25, "m/s"),
}
"""By name. Source: URScript API Reference CB3 3.15.4, module motion, Variables."""

_TYPES: Final = {kind.name.lower().replace("_or_", "|"): kind for kind in types.ParamType}
_WORDS: Final[dict[str, tuple[str, Any]]] = {
    **{time.name.lower(): ("time", time) for time in types.TimeClass},
    **{support.value: ("support", support) for support in types.Support},
    "deprecated": ("deprecated", True),
    "nan ok": ("nan_ok", True),
    "any names": ("any_names", True),
    "changes": ("changes", True),
}

_HEAD = re.compile(r"([\w.]+)\((.*)\) -> (.+)")
_PARAM = re.compile(
    r"""(?P<name>\w+):\ (?P<type>[\w|]+)
    (?:\ (?P<low>-?[\d.]*\d)?\.\.(?P<high>-?[\d.]+)?)?
    (?:\ \{(?P<choices>[^}]*)\})?
    (?:\ =\ (?P<default>"[^"]*"|\((?P<shown>[^)]*)\)|p?\[[^]]*\]|[^\s,]+))?
    (?:\ \[(?P<unit>[^]]*)\])?
    (?:,\ |$)""",
    re.VERBOSE,
)


def _read_chapter(module: str) -> Iterator[Builtin]:
    path = Path(__file__).parent / "chapters" / f"{module}.txt"
    return read_rows(path.read_text(encoding="utf-8"), module)


def read_rows(text: str, module: str) -> Iterator[Builtin]:
    """The rows of a text about one module of the script manual.

    Raises:
        ValueError: a line that is not of the form above.
    """
    for section in text.replace("\n" + " " * 8, " ").split("\n\n"):
        defaults: dict[str, Any] = {}
        lines = "\n".join(line for line in section.splitlines() if not line.startswith("#"))
        for head, *rest in (row.split("\n    ") for row in re.split(r"\n(?! )", lines) if row):
            if head == "by default:":
                defaults = _settings(rest)
            else:
                yield _row(module, head, rest, defaults)


def _row(module: str, head: str, lines: list[str], defaults: dict[str, Any]) -> Builtin:
    form = _HEAD.fullmatch(head)
    if form is None or not lines:
        raise ValueError(f"{module}: {head!r} is not a row; write name(...) -> type, and below what it does")
    fields: dict[str, Any] = {"since": types.EVERYWHERE, "undocumented": frozenset()}
    fields |= defaults | _settings(lines[1:])
    return Builtin(
        name=form[1], params=tuple(_params(form[2], head)), returns=form[3], module=module, summary=lines[0],
        **fields,
    )  # fmt: skip


def _params(text: str, head: str) -> Iterator[Param]:
    place = 0
    while place < len(text):
        found = _PARAM.match(text, place)
        if found is None or found["type"] not in _TYPES:
            raise ValueError(f"{text[place:]!r} of {head!r} is not a parameter; write name: type")
        place = found.end()
        default = found["default"]
        yield Param(
            found["name"],
            _TYPES[found["type"]],
            types.REQUIRED if default is None else None if default[0] == "(" else _value(default),
            found["unit"] or "",
            None if found["low"] is None else _value(found["low"]),
            None if found["high"] is None else _value(found["high"]),
            _value(f"({found['choices']},)") if found["choices"] else (),
            found["shown"] or "",
        )


def _value(text: str) -> Any:
    if text in VARIABLES:
        return VARIABLES[text].value
    return Pose(*literal_eval(text[1:])) if text[0] == "p" else literal_eval(text)


def _settings(lines: list[str]) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    for line in lines:
        key, _, rest = line.partition(" ")
        if key in ("since", "until"):
            fields[key] = PerGeneration(*(None if it == "-" else Version.of(it) for it in rest.split()))
        elif key == "undocumented":
            fields[key] = frozenset(map(Generation, rest.split(", ")))
        elif key != "source":
            words, _, fields["note"] = line.partition(": ")
            if unknown := set(words.split(", ")) - set(_WORDS):
                raise ValueError(f"{', '.join(sorted(unknown))} in {line!r}; allowed: {', '.join(_WORDS)}")
            # A row's own line replaces the whole line of `by default:`.
            fields |= {"time": types.TimeClass.ZERO, "deprecated": False}
            fields |= {"nan_ok": False, "any_names": False, "changes": False}
            fields |= dict(_WORDS[word] for word in words.split(", "))
    return fields


ALL_ROWS: tuple[Builtin, ...] = (
    *_read_chapter("motion"),
    *_read_chapter("internals"),
    *_read_chapter("urmath"),
    *_read_chapter("interfaces"),
    *_read_chapter("ioconfiguration"),
    *_read_chapter("interpreter_mode"),
    *_read_chapter("processpath"),
    *_read_chapter("world_model"),
)

METHODS: tuple[Builtin, ...] = tuple(_read_chapter("methods"))
"""The methods of values: `list.append(value)` and its like."""

ARRAYS: Final = {"digital_out": types.BuiltinArray("digital_out", 10, "get_digital_out", "set_digital_out")}
"""By name. Source: field use of `digital_out[2]=True` as a one-line program by an early Python client;
undocumented."""

_MOST_CALL_FORMS = 10_000


def method_key(row: Builtin) -> tuple[str, str]:
    """The type of values that have a method, and its name in calls."""
    of_type, name = row.name.split(".")
    return of_type, name


class Catalogue:
    """The builtins of one software version.

    Attributes:
        methods: By `method_key`; none before the software that knows them.
        fittings: Functions that return bound arguments as the tables ask for them: types, ranges, finiteness.
            They raise ScriptRuntimeError with the controller's text where it is known.
    """

    def __init__(self, version: Version, rows: tuple[Builtin, ...] = ALL_ROWS) -> None:
        self.version = version
        self._rows = rows
        self._by_name: dict[str, Builtin] = {row.name: row for row in rows if row.is_in(version)}
        self.variables: Mapping[str, ModuleVariable] = VARIABLES
        self.arrays: Mapping[str, types.BuiltinArray] = ARRAYS
        self.methods = {method_key(row): row for row in METHODS if row.is_in(version)}
        self._slots: dict[tuple[str, int, tuple[str, ...]], list[Slot]] = {}
        self.fittings: Mapping[str, Fitting] = {
            name: compile_fitting(name, row.params, row.nan_ok) for name, row in self._by_name.items()
        }

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle it as its version, and its rows if they are others than those of the tables."""
        rows = () if self._rows is ALL_ROWS else (self._rows,)
        return catalogue_for, (self.version, *rows)

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


def _fits(builtin: Builtin, n_positional: int, keyword_names: Sequence[str]) -> bool:
    try:
        static_bind(builtin, n_positional, keyword_names)
    except ScriptTypeError:
        return False
    return True


@lru_cache(maxsize=32)
def _of_all_rows(version: Version) -> Catalogue:
    return Catalogue(version)


def catalogue_for(version: str | Sequence[int], rows: tuple[Builtin, ...] = ALL_ROWS) -> Catalogue:
    """The catalogue of a software version: "3.15", "5.11.4", or a version tuple.

    Raises:
        ValueError: for a version of no known generation.
    """
    found = Version.of(version)
    return _of_all_rows(found) if rows is ALL_ROWS else Catalogue(found, rows)


CB3_3_15 = catalogue_for("3.15")
