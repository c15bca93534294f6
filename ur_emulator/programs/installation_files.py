"""Finds and reads installations, each with its variables.

`default.installation` always exists, perhaps without settings, as on a new box.
"""

from __future__ import annotations

import posixpath
from dataclasses import replace
from pathlib import PurePosixPath

from ur_emulator.errors import FileMissingError, ProgramFileError
from ur_emulator.programs.folder import WIRE_ROOTS, FoundFile, ProgramFolder
from ur_emulator.programs.installation import Installation
from ur_emulator.programs.installation_reader import read_installation
from ur_emulator.programs.reading import ProgramReader
from ur_emulator.programs.variables_file import SUFFIX as VARIABLES_SUFFIX
from ur_emulator.programs.variables_file import read_variables
from ur_emulator.programs.xml_tree import XmlTree

SUFFIX = ".installation"
DEFAULT_NAME = "default" + SUFFIX
NEW_BOX = Installation(str(WIRE_ROOTS[0] / DEFAULT_NAME))
"""The installation of a box that nobody has set up."""


def load_installation(folder: ProgramFolder, name: str) -> Installation:
    """Read an installation by the name that a client gives it.

    Raises:
        FileMissingError: there is none of that name.
        ProgramFileError: it is not an installation.
    """
    return _read(ProgramReader(folder), name)


def installation_of(reader: ProgramReader, tree: XmlTree, program: FoundFile) -> Installation:
    """Read the installation of a program: at its path from the program's folder, else by its name.

    Raises:
        ProgramFileError: there is none of that name, or the file is not an installation.
    """
    given = tree.root.get("installationRelativePath") or tree.root.get("installation") or ""
    path = given.replace("\\", "/").removesuffix(SUFFIX) + SUFFIX if given else DEFAULT_NAME
    for place in (PurePosixPath(program.wire_path).parent, WIRE_ROOTS[0]):
        name = posixpath.normpath(place / path)
        if reader.folder.has(name):
            return _read(reader, name)
        path = PurePosixPath(path).name
    if path == DEFAULT_NAME:
        return _read(reader, DEFAULT_NAME)
    raise ProgramFileError(f"{tree.name} needs the installation {path}: put it beside the program")


def _read(reader: ProgramReader, name: str) -> Installation:
    try:
        file = reader.folder.find(name)
    except FileMissingError:
        if name.rpartition("/")[2].strip('"') != DEFAULT_NAME:
            raise
        return NEW_BOX
    if file.inside.suffix != SUFFIX:
        raise ProgramFileError(f"{file.name} is not an installation: its name must end in {SUFFIX}")
    installation = read_installation(reader.xml(file), file.wire_path)
    variables = str(file.inside.with_suffix(VARIABLES_SUFFIX))
    if not reader.folder.has(variables):
        return installation
    return replace(installation, variables=read_variables(reader, reader.folder.find(variables)))
