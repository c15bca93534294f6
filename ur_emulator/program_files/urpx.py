"""Programs of PolyScope X: a `.urpx` is JSON, with the nodes and the script that PolyScope made of them.

    application.urscript.script     settings of the application, functions and variables for its programs
    program.urscript.script         the program; lines `$ 1 "name"` are the places of its nodes
    program.programInformation      name, description, dates [ms since 1970] and state, DRAFT or FINAL

The box plays the script and does not look at the nodes. Source of the form: program files of the UR client
library's tests (10.12) and of its simulator's folder (10.14).
"""

import json
from dataclasses import dataclass
from typing import Any

from ur_emulator.errors import ProgramFileError

# What a list of programs says of one, by field. All but the name may be null.
Information = dict[str, Any]
_FIELDS: dict[str, type] = {
    "name": str,
    "description": str,
    "createdDate": int,
    "lastModifiedDate": int,
    "lastSavedDate": int,
    "programState": str,
}


@dataclass(frozen=True, slots=True)
class UrpxProgram:
    """What is read of such a file.

    Attributes:
        information: what a list of programs says of it; a field that the file lacks is None.
        script: of application and program, in this order.
    """

    name: str
    information: Information
    script: str


def read_urpx(file_name: str, data: bytes) -> UrpxProgram:
    """Read a program; ProgramFileError if it has another form."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise ProgramFileError(f"{file_name} is no .urpx program: not JSON: {error}") from None
    given = _inside(file_name, tree, "program", "programInformation", kind=dict)
    name = _inside(file_name, given, "name", kind=str)
    values = {field: given.get(field) for field in _FIELDS}
    information = {
        field: value if isinstance(value, _FIELDS[field]) else None for field, value in values.items()
    }
    scripts = [
        _inside(file_name, tree, part, "urscript", "script", kind=str) for part in ("application", "program")
    ]
    return UrpxProgram(name, information, "\n".join(scripts))


def information_of(name: str) -> Information:
    """Return the entry of a program of which nothing but its name is known."""
    return dict.fromkeys(_FIELDS) | {"name": name}


def _inside(file_name: str, tree: Any, *path: str, kind: type) -> Any:
    """Return what lies at a path of keys; raise if it is not there, or no `kind`."""
    for key in path:
        tree = tree.get(key) if isinstance(tree, dict) else None
    if not isinstance(tree, kind):
        raise ProgramFileError(f"{file_name} is no .urpx program: it has no {'.'.join(path)}")
    return tree
