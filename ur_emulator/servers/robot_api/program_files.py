"""Programs of a PolyScope X box: files of the programs folder, named without their extension."""

from __future__ import annotations

from email.parser import BytesParser
from email.policy import HTTP
from pathlib import PurePosixPath

from ur_emulator.errors import FileMissingError, ProgramFileError
from ur_emulator.programs.folder import FoundFile, ProgramFolder

# The box runs those of the first two kinds. How a file of PolyScope X is made is not known: it is kept.
KINDS = (".urp", ".script", ".urpx")
MAX_FILE = 4 * 1024 * 1024


def find_program(folder: ProgramFolder, name: str) -> FoundFile:
    """Return the file of a program.

    Raises:
        FileMissingError: there is none of that name.
    """
    for kind in KINDS:
        if folder.has(name + kind):
            return folder.find(name + kind)
    raise FileMissingError(f"there is no program {name!r}: its file would be {name}{KINDS[0]}, or {KINDS[1]}")


def list_programs(folder: ProgramFolder) -> list[str]:
    """Return the names of all programs of the folder itself, in alphabetical order."""
    if not folder.exists:
        return []
    files = (path for path, _ in folder.sizes())
    return sorted({path.stem for path in files if len(path.parts) == 1 and path.suffix in KINDS})


def read_program(folder: ProgramFolder, name: str) -> bytes:
    """Return the file of a program.

    Raises:
        FileMissingError: there is none of that name.
        ProgramFileError: it cannot be read.
    """
    return folder.read(find_program(folder, name), MAX_FILE)


def write_program(folder: ProgramFolder, file_name: str, data: bytes, is_new: bool) -> str | None:
    """Write the file of a program, a new one or one that exists.

    Returns:
        Its name; None: there is one already, or none yet.

    Raises:
        FileMissingError: the name leads out of the folder, or the box has none.
        ProgramFileError: it cannot be written, or is no program.
    """
    inside = folder.locate(PurePosixPath(file_name).name)
    if inside.suffix not in KINDS:
        raise ProgramFileError(f"file name {file_name!r} given: a program ends in {', '.join(KINDS)}")
    if folder.has(str(inside)) is is_new:
        return None
    folder.write(inside, data)
    return inside.stem


def form_file(content_type: str, body: bytes) -> tuple[str, bytes] | None:
    """Return name and content of the form field `file` of a multipart body; None if it has no such field."""
    if not content_type.lower().startswith("multipart/form-data"):
        return None
    head = f"Content-Type: {content_type}\r\n\r\n".encode("latin-1", "replace")
    form = BytesParser(policy=HTTP).parsebytes(head + body)
    for part in form.iter_parts() if form.is_multipart() else ():
        if part.get_param("name", header="content-disposition") == "file":
            content = part.get_payload(decode=True)
            return part.get_filename() or "", content if isinstance(content, bytes) else b""
    return None
