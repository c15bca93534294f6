"""The rows of all builtins, read from `chapters/`: one text for each module of the script manual.

    movej(q: pose|joints [rad, or pose in m and rad], a: number = 1.4 [rad/s^2]) -> None
        one line that says what it does
        motion, approximate: why it is not exact
        since 3.0 5.0 10.0

A parameter has a type of `ParamType`, then what applies of: a range `0..7`, `0..` or `..1`, the only values
allowed `{0, 12, 24}`, a default `= 1.4`, or `= (active TCP)` for one that the controller fills in, a unit in
brackets. Lines below the summary: time, support, `deprecated`, `nan ok`, `any names`, then the note; `since`
and `until` with a release of CB3, e-Series and PolyScope X each, `-` for none; `undocumented` generations;
`source`, where it is not the manuals. Eight spaces continue a line. What `by default:` lists holds for the
rows up to the next blank line.

"3.0", "5.0" and "10.0" mean "since the first release": the manuals rarely give a later one. "5.21": names
first seen in an e-Series manual of the 5.2x editions; the exact first release is not known.
"""

from __future__ import annotations

import re
from ast import literal_eval
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from urscript.catalogue.types import (
    EVERYWHERE,
    REQUIRED,
    Builtin,
    Generation,
    Param,
    ParamType,
    Support,
    TimeClass,
    releases,
)
from urscript.values import Pose

__all__ = ["FIELD_USE", "read_chapter", "read_rows"]

FIELD_USE: Final = "called by field scripts and public clients"

_SOURCES: Final = {
    "MANUAL_CB3": "URScript API Reference CB3 3.15.4",
    "MANUAL_E": "Script Manual e-Series 5.11",
    "MANUAL_LATE": "Script Directory e-Series 5.2x",
    "MANUAL_X": "world model and ROS 2 pages of the 5.2x / 10.x script directories",
    "DRIVER_SCRIPT": "called after run-time tests by the maker's driver script, "
    "which 3.14.3 and later accept",
    "POLYSCOPE_EXPORT": "written by PolyScope into exported programs",
    "FIELD_USE": FIELD_USE,
}

_TYPES: Final = {kind.name.lower().replace("_or_", "|"): kind for kind in ParamType}
_WORDS: Final[dict[str, tuple[str, Any]]] = {
    **{time.name.lower(): ("time", time) for time in TimeClass},
    **{support.value: ("support", support) for support in Support},
    "deprecated": ("deprecated", True),
    "nan ok": ("nan_ok", True),
    "any names": ("any_names", True),
}

_HEAD = re.compile(r"(\w+)\((.*)\) -> (.+)")
_PARAM = re.compile(
    r"""(?P<name>\w+):\ (?P<type>[\w|]+)
    (?:\ (?P<low>-?[\d.]*\d)?\.\.(?P<high>-?[\d.]+)?)?
    (?:\ \{(?P<choices>[^}]*)\})?
    (?:\ =\ (?P<default>"[^"]*"|\((?P<shown>[^)]*)\)|p?\[[^]]*\]|[^\s,]+))?
    (?:\ \[(?P<unit>[^]]*)\])?
    (?:,\ |$)""",
    re.VERBOSE,
)


def read_chapter(module: str) -> tuple[Builtin, ...]:
    """The rows of one module of the script manual.

    Raises:
        ValueError: a line that is not of the form above.
    """
    path = Path(__file__).parent / "chapters" / f"{module}.txt"
    return tuple(read_rows(path.read_text(encoding="utf-8"), module))


def read_rows(text: str, module: str) -> Iterator[Builtin]:
    """The rows of a text; see `read_chapter`."""
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
    fields: dict[str, Any] = {"since": EVERYWHERE, "undocumented": frozenset()}
    fields |= defaults | _settings(lines[1:])
    if "source" not in fields:
        manuals = (Generation.CB3, "MANUAL_CB3"), (Generation.E_SERIES, "MANUAL_E")
        known = {g for g in Generation if fields["since"].get(g) is not None} - fields["undocumented"]
        cited = " and ".join(_SOURCES[manual] for generation, manual in manuals if generation in known)
        fields["source"] = f"{cited}, module {module}"
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
            REQUIRED if default is None else None if default[0] == "(" else _value(default),
            found["unit"] or "",
            None if found["low"] is None else _value(found["low"]),
            None if found["high"] is None else _value(found["high"]),
            _value(f"({found['choices']},)") if found["choices"] else (),
            found["shown"] or "",
        )


def _value(text: str) -> Any:
    return Pose(*literal_eval(text[1:])) if text[0] == "p" else literal_eval(text)


def _settings(lines: list[str]) -> dict[str, Any]:
    """The fields that the lines below the summary give."""
    fields: dict[str, Any] = {}
    for line in lines:
        key, _, rest = line.partition(" ")
        if key in ("since", "until"):
            fields[key] = releases(*(None if release == "-" else release for release in rest.split()))
        elif key == "undocumented":
            fields[key] = frozenset(map(Generation, rest.split(", ")))
        elif key == "source":
            fields[key] = rest.format_map(_SOURCES)
        else:
            words, _, fields["note"] = line.partition(": ")
            if unknown := set(words.split(", ")) - set(_WORDS):
                raise ValueError(f"{', '.join(sorted(unknown))} in {line!r}; allowed: {', '.join(_WORDS)}")
            # A row's own line replaces the whole line of `by default:`.
            fields |= {"time": TimeClass.ZERO, "deprecated": False, "nan_ok": False, "any_names": False}
            fields |= dict(_WORDS[word] for word in words.split(", "))
    return fields
