"""The file with the values of installation variables, which lies beside the installation.

Software up to 5.12 writes Java properties, later software XML. Values are literals of URScript.
"""

import gzip
import re
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath
from typing import Any
from xml.etree import ElementTree

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.names import is_identifier
from ur_emulator.program_files.reader import ProgramReader, XmlTree, unpack
from urscript.values import Pose

SUFFIX = ".variables"
# Source: files that boxes have written.
_DECIMALS = 5
_MOST_ITEMS, _DEEPEST = 64, 1
_ROOT = "InstallationVariables"
# A key, then the first `=` or `:` that is not escaped; no comment. Source: java.util.Properties.
_PROPERTY = re.compile(r"\s*(?![\s#!])((?:\\.|[^\\=:\s])+)\s*[=:]\s*(.*)")
_ESCAPE = re.compile(r"\\(?:u([0-9A-Fa-f]{4})|(.))")
_CONTROLS = {"t": "\t", "n": "\n", "r": "\r", "f": "\f"}


def read_variables(reader: ProgramReader, file: PurePosixPath) -> dict[str, str]:
    """Return name -> value of a file, in its order.

    ProgramFileError if it cannot be read, has too many variables, or something else than variables.
    """
    data = reader.unpacked(file)
    items = _xml_items(reader, file, data) if data.lstrip().startswith(b"<") else _properties(data)
    variables: dict[str, str] = {}
    for name, value in items:
        if not is_identifier(name):
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


def write_variables(folder: ProgramFolder, installation: str, values: Mapping[str, str]) -> None:
    """Write literals by name into the file beside an installation; its form and its other content stay."""
    file = folder.find(str(PurePosixPath(installation).with_suffix(SUFFIX)))
    raw = folder.read(file, BUDGETS.program_bytes)
    data = unpack(file.name, raw, BUDGETS.program_bytes)
    if data.lstrip().startswith(b"<"):
        new = _new_xml(ProgramReader(folder).parsed(file, data), values)
    else:
        new = _new_properties(data, values)
    folder.write(file, new if data is raw else gzip.compress(new, mtime=0))


def literal(value: Any, depth: int = 0) -> str:
    """Return a value of a program as it stands in a file of variables; "" for what has no place there.

    Numbers have five decimals, as in real files. Lists of more than 64 items or nested deeper than lists of
    poses have no place: chosen, so that this takes little time.
    """
    if isinstance(value, float):
        return repr(round(value, _DECIMALS))
    if isinstance(value, bool | int):
        return str(value)
    if isinstance(value, str):
        text = value.encode("latin-1").decode("utf-8", "replace")
        return f'"{text}"' if text.isprintable() else ""
    if isinstance(value, list | Pose) and len(value) <= _MOST_ITEMS and depth <= _DEEPEST:
        items = [literal(item, depth + 1) for item in value]
        return f"{'p' if isinstance(value, Pose) else ''}[{', '.join(items)}]" if all(items) else ""
    return ""


def _xml_items(reader: ProgramReader, file: PurePosixPath, data: bytes) -> Iterator[tuple[str, str]]:
    root = reader.parsed(file, data).root
    if root.tag != _ROOT:
        raise ProgramFileError(f"{file.name} is a <{root.tag}>, not <{_ROOT}>")
    for variable in root.iter("variable"):
        yield variable.get("name", ""), variable.get("value", "").strip()


def _properties(data: bytes) -> Iterator[tuple[str, str]]:
    for line in data.decode("latin-1").splitlines():
        if match := _PROPERTY.fullmatch(line):
            yield _unescaped(match[1]), _unescaped(match[2]).strip()


def _unescaped(text: str) -> str:
    plain = _ESCAPE.sub(lambda m: chr(int(m[1], 16)) if m[1] else _CONTROLS.get(m[2], m[2]), text)
    return plain.encode("utf-16", "surrogatepass").decode("utf-16", "replace")  # pairs become characters


def _new_xml(tree: XmlTree, values: Mapping[str, str]) -> bytes:
    for variable in tree.root.iter("variable"):
        variable.set("value", values.get(variable.get("name", ""), variable.get("value", "")))
    data: bytes = ElementTree.tostring(tree.root, encoding="utf-8")
    return data


def _new_properties(data: bytes, values: Mapping[str, str]) -> bytes:
    lines: list[str] = []
    for line in data.decode("latin-1").splitlines():
        match = _PROPERTY.fullmatch(line)
        name = _unescaped(match[1]) if match else ""
        lines.append(f"{name}={_escaped(values[name])}" if name in values else line)
    return "".join(f"{line}\n" for line in lines).encode("latin-1")


def _escaped(text: str) -> str:
    data = text.encode("utf-16-be", "replace")
    units = (int.from_bytes(data[i : i + 2]) for i in range(0, len(data), 2))
    return "".join(chr(unit) if unit < 128 and unit != ord("\\") else f"\\u{unit:04x}" for unit in units)
