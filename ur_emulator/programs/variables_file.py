"""The file with the values of installation variables, which lies beside the installation.

Software up to 5.12 writes Java properties, later software XML. Values are literals of URScript.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError
from ur_emulator.programs.folder import FoundFile
from ur_emulator.programs.reading import ProgramReader

SUFFIX = ".variables"
_ROOT = "InstallationVariables"
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
# A key, then the first `=` or `:` that is not escaped. Source: java.util.Properties.
_PROPERTY = re.compile(r"\s*((?:\\.|[^\\=:\s])+)\s*[=:]\s*(.*)")
_ESCAPE = re.compile(r"\\(?:u([0-9A-Fa-f]{4})|(.))")
_CONTROLS = {"t": "\t", "n": "\n", "r": "\r", "f": "\f"}


def read_variables(reader: ProgramReader, file: FoundFile) -> dict[str, str]:
    """Return name -> value of a file, in its order.

    Raises:
        ProgramFileError: it cannot be read, has too many variables, or something else than variables.
    """
    data = reader.unpacked(file)
    items = _xml_items(reader, file, data) if data.lstrip().startswith(b"<") else _properties(data)
    variables: dict[str, str] = {}
    for name, value in items:
        if not _IDENTIFIER.fullmatch(name):
            raise ProgramFileError(f"{file.name}: {name[:40]!r} is not the name of a variable")
        if not value or not value.isprintable():
            raise ProgramFileError(f"{file.name}: the value of {name[:40]} is not one line of text")
        variables[name] = value
    size = sum(map(len, variables.values()))
    if len(variables) > BUDGETS.installation_entries or size > BUDGETS.variable_bytes:
        raise ProgramFileError(
            f"{file.name} has {len(variables)} variables of {size} characters: at most "
            f"{BUDGETS.installation_entries} of {BUDGETS.variable_bytes} together are allowed"
        )
    return variables


def _xml_items(reader: ProgramReader, file: FoundFile, data: bytes) -> Iterator[tuple[str, str]]:
    root = reader.parsed(file.name, data).root
    if root.tag != _ROOT:
        raise ProgramFileError(f"{file.name} is a <{root.tag}>, not <{_ROOT}>")
    for variable in root.iter("variable"):
        yield variable.get("name", ""), variable.get("value", "").strip()


def _properties(data: bytes) -> Iterator[tuple[str, str]]:
    for line in data.decode("latin-1").splitlines():
        match = _PROPERTY.fullmatch(line)
        if match and not line.lstrip().startswith(("#", "!")):
            yield _unescaped(match[1]), _unescaped(match[2]).strip()


def _unescaped(text: str) -> str:
    return _ESCAPE.sub(lambda m: chr(int(m[1], 16)) if m[1] else _CONTROLS.get(m[2], m[2]), text)
