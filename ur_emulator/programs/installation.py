"""Installations: the settings that programs need.

Only the PC of External Control is read; tool, payload, safety settings and names of lines are not.
`default.installation` always exists, perhaps without settings, as on a new box.
"""

from __future__ import annotations

import posixpath
from dataclasses import dataclass
from pathlib import PurePosixPath

from ur_emulator.errors import FileMissingError, ProgramFileError
from ur_emulator.programs.folder import WIRE_ROOTS, FoundFile, ProgramFolder
from ur_emulator.programs.reading import ProgramReader
from ur_emulator.programs.xml_tree import XmlTree

SUFFIX = ".installation"
DEFAULT_NAME = "default" + SUFFIX
# Contributor of a part of an installation. Source: a public generator of installations for CB3.
_OWNER = "com.fzi.externalcontrol"
# Longest name of a host. Source: RFC 1035.
_MAX_HOST = 253


@dataclass(frozen=True, slots=True)
class ExternalControlPc:
    """Where External Control gets its program.

    Attributes:
        host: name or address; "" if not given here.
        port: of its script sender; 0 if not given here.
    """

    host: str = ""
    port: int = 0

    def over(self, other: ExternalControlPc) -> ExternalControlPc:
        """Return this PC; what it does not give is taken from the other."""
        return ExternalControlPc(self.host or other.host, self.port or other.port)


@dataclass(frozen=True, slots=True)
class Installation:
    """An installation.

    Attributes:
        wire_path: its name on the wire.
        pc: for External Control nodes that do not name one themselves.
    """

    wire_path: str
    pc: ExternalControlPc


def load_installation(folder: ProgramFolder, name: str) -> Installation:
    """Read an installation by the name that a client gives it.

    Raises:
        FileMissingError: there is none of that name.
        ProgramFileError: it is not an installation.
    """
    return _read_installation(ProgramReader(folder), name)


def _read_installation(reader: ProgramReader, name: str) -> Installation:
    try:
        file = reader.folder.find(name)
    except FileMissingError:
        if name.rpartition("/")[2].strip('"') != DEFAULT_NAME:
            raise
        return Installation(str(WIRE_ROOTS[0] / DEFAULT_NAME), ExternalControlPc())
    if file.inside.suffix != SUFFIX:
        raise ProgramFileError(f"{file.name} is not an installation: its name must end in {SUFFIX}")
    tree = reader.xml(file)
    data: dict[str, str] = {}
    for part in tree.root.iter("Contributed"):
        if part.get("ownerId") == _OWNER:
            data |= {item.get("key", ""): item.get("value", "") for item in part.iter("data")}
    return Installation(file.wire_path, pc_from(data, tree.name))


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
            return _read_installation(reader, name)
        path = PurePosixPath(path).name
    if path == DEFAULT_NAME:
        return _read_installation(reader, DEFAULT_NAME)
    raise ProgramFileError(f"{tree.name} needs the installation {path}: put it beside the program")


def pc_from(data: dict[str, str], file_name: str) -> ExternalControlPc:
    """Return the PC in the data of a node or an installation. Keys: the source text of the URCap.

    Raises:
        ProgramFileError: the host is too long for a name, or the port is not a port number.
    """
    host = data.get("host_ip", "")
    if len(host) > _MAX_HOST:
        raise ProgramFileError(
            f"{file_name}: the host of External Control has more than {_MAX_HOST} characters"
        )
    port = data.get("port_nr", "")
    if port and not (port.isascii() and port.isdigit() and 0 < int(port[:6]) < 1 << 16):
        raise ProgramFileError(f"{file_name}: port {port[:20]!r} of External Control is none of 1 to 65535")
    return ExternalControlPc(host, int(port or 0))
