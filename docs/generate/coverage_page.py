"""The page `docs/urscript-coverage.md`, generated from the tables: which builtin is modelled how well."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Final

from urscript.catalogue.catalogue import ALL_ROWS, CB3_3_15, METHODS, catalogue_for
from urscript.catalogue.types import Builtin, Generation, Support

_HEAD = """\
# URScript coverage

This page lists every builtin function of a controller and how this box models it. It is generated
from the tables in `urscript/catalogue/` by `make docs`.

* **exact**: does what the manual describes.
* **approximate**: works; the note states differences and assumptions.
* **declared only**: programs that name it compile, and the call ends the program with the run-time error
  `<name> is declared only: this box does not model it yet`; the remarks say what is missing.

"Undocumented" names are missing in the script manual of their generation, but its controllers
accept them.
"""

_SHOWN: Final = ("3.15", "5.9", "5.12", "5.15", "5.22", "5.25", "10.11")

_LATER_HEAD = """\
Functions, or forms of functions, that CB3 3.15 does not have; the others are those of the tables above.
Before its first release a name is not defined: a program that has it is refused, with that release in
the message. 5.0 and 10.0 stand for the oldest documents: the first release is not known. Others are the
oldest manual that has the name, or what a client of the maker asks for, so a controller may know it
earlier."""


def _versions() -> list[str]:
    lines = ["| software | exact | approximate | declared only | all |", "|---|---|---|---|---|"]
    for text in _SHOWN:
        catalogue = catalogue_for(text)
        title = f"{catalogue.version.generation.value} {text}"
        lines.append(_count_line(title, Counter(row.support for row in catalogue)))
    return lines


def _summary(rows: Iterable[Builtin]) -> list[str]:
    counts: dict[str, Counter[Support]] = {}
    for row in rows:
        counts.setdefault(row.module, Counter())[row.support] += 1
    lines = ["| module | exact | approximate | declared only | all |", "|---|---|---|---|---|"]
    total: Counter[Support] = Counter()
    for module, count in counts.items():
        lines.append(_count_line(module, count))
        total += count
    return [*lines, _count_line("**total**", total)]


def _count_line(title: str, count: Counter[Support]) -> str:
    cells = [str(count[support]) for support in Support]
    return f"| {title} | {' | '.join(cells)} | {count.total()} |"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _remarks(row: Builtin, is_documented: bool) -> str:
    words = ["undocumented"] if not is_documented else []
    if row.deprecated:
        words.append("deprecated")
    if row.note:
        words.append(row.note)
    return "; ".join(words)


def _table(rows: Iterable[Builtin]) -> list[str]:
    lines = ["| function | returns | time | model | what it does | remarks |", "|---|---|---|---|---|---|"]
    for row in rows:
        is_documented = row.is_documented_in(CB3_3_15.version)
        cells = (
            f"`{row.signature}`",
            row.returns,
            row.time.name.lower(),
            row.support.value,
            row.summary,
            _remarks(row, is_documented),
        )
        lines.append(f"| {' | '.join(_cell(cell) for cell in cells)} |")
    return lines


def _method_table() -> list[str]:
    lines = ["| method | returns | what it does |", "|---|---|---|"]
    return [*lines, *(f"| `{row.signature}` | {row.returns} | {row.summary} |" for row in METHODS)]


def _later_table(rows: Iterable[Builtin]) -> list[str]:
    lines = ["| function | since | until | model | what it does | remarks |", "|---|---|---|---|---|---|"]
    for row in rows:
        is_documented = any(row.since.get(g) and g not in row.undocumented for g in Generation)
        cells = (
            f"`{row.signature}`",
            str(row.since),
            str(row.until),
            row.support.value,
            row.summary,
            _remarks(row, is_documented),
        )
        lines.append(f"| {' | '.join(_cell(cell) for cell in cells)} |")
    return lines


def render() -> str:
    """The whole page as Markdown."""
    lines = [_HEAD, "## Versions", "", *_versions(), "", f"## CB3 {CB3_3_15.version}", ""]
    lines += [*_summary(CB3_3_15), ""]
    lines += [
        "Besides the functions, programs can read the variables "
        + ", ".join(f"`{name}` ({item.value:g} {item.unit})" for name, item in CB3_3_15.variables.items())
        + " and use the arrays "
        + ", ".join(
            f"`{item.name}[n]` (as `{item.getter}` and `{item.setter}`)" for item in CB3_3_15.arrays.values()
        )
        + ".",
        "",
    ]
    for module in dict.fromkeys(row.module for row in CB3_3_15):
        lines += [f"### {module}", "", *_table(row for row in CB3_3_15 if row.module == module), ""]
    lines += [
        "## Later software",
        "",
        _LATER_HEAD,
        "",
        *_later_table(row for row in ALL_ROWS if not row.is_in(CB3_3_15.version)),
        "",
        "## Methods",
        "",
        f"Lists, structs and matrices have methods since {METHODS[0].since}. A list has a length and a "
        "capacity, which it keeps. Error texts are chosen.",
        "",
        *_method_table(),
    ]
    return "\n".join(lines) + "\n"
