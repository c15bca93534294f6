"""The program files of the Robot API: files of the programs folder, named without their extension.

All functions but `find_program` may take a while: they run in the worker process.
"""

from contextlib import suppress
from email.parser import BytesParser
from email.policy import HTTP
from pathlib import PurePosixPath

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ArgumentError, FileMissingError, ProgramFileError, RefusedError
from ur_emulator.program_files.folder import PROGRAM_SUFFIX, SCRIPT_SUFFIX, URPX_SUFFIX, ProgramFolder
from ur_emulator.program_files.reader import ProgramReader
from ur_emulator.program_files.urpx import Information, information_of, read_urpx

# What a file takes of a disk at least [bytes].
_BLOCK = 4_096
KINDS = (URPX_SUFFIX, PROGRAM_SUFFIX, SCRIPT_SUFFIX)


def find_program(folder: ProgramFolder, name: str) -> PurePosixPath:
    """Return the file of a program; FileMissingError if there is none of that name."""
    for kind in KINDS:
        if folder.has(name + kind):
            return folder.find(name + kind)
    raise FileMissingError(f"there is no program {name!r}: its file would be {name} with {', '.join(KINDS)}")


def list_programs(folder: ProgramFolder) -> list[Information]:
    """Return what is known of all programs of the folder itself, in alphabetical order of their names."""
    if not folder.exists:
        return []
    files = (path for path, _ in folder.sizes())
    names = sorted({path.stem for path in files if len(path.parts) == 1 and path.suffix in KINDS})
    return [_information(folder, name) for name in names]


def _information(folder: ProgramFolder, name: str) -> Information:
    file = find_program(folder, name)
    if file.suffix == URPX_SUFFIX:
        with suppress(ProgramFileError):
            return read_urpx(file.name, ProgramReader(folder).unpacked(file)).information | {"name": name}
    return information_of(name)


def read_program(folder: ProgramFolder, name: str) -> bytes:
    """Return what is in the file of a program; FileMissingError or ProgramFileError if that fails."""
    return folder.read(find_program(folder, name), BUDGETS.program_bytes)


def write_program(folder: ProgramFolder, content_type: str, body: bytes, is_new: bool, in_use: str) -> str:
    """Write the file of a program, a new one or one that exists; return its name.

    A `.urpx` program says itself what it is called; clients send it under any file name. Programs of other
    kinds have the name of their file.

    Args:
        body: of a form with the field `file`.
        is_new: it must be one that does not exist, otherwise one that exists.
        in_use: name of a program that must stay as it is.

    Raises:
        FileMissingError: the name leads out of the folder, or the box has none; or no such program exists.
        ArgumentError: such a program exists already.
        RefusedError: it is in use.
        ProgramFileError: it cannot be written, is no program, or is too much beside the others.
    """
    file_name, data = _form_file(content_type, body)
    if data.lstrip().startswith(b"{") or file_name.endswith(URPX_SUFFIX):
        file_name = read_urpx(file_name, data).name + URPX_SUFFIX
    inside = folder.locate(PurePosixPath(file_name).name)
    if inside.suffix not in KINDS:
        raise ProgramFileError(
            f"file name {file_name!r} given: a program is JSON, as a .urpx, or its name ends in "
            f"{PROGRAM_SUFFIX} or {SCRIPT_SUFFIX}"
        )
    if inside.stem == in_use:
        raise RefusedError(f"{inside.stem} is loaded and plays: stop it first")
    if folder.has(str(inside)) is is_new:
        if is_new:
            raise ArgumentError(f"there is a program {inside.stem!r} already: PUT replaces it")
        raise FileMissingError(f"there is no program {inside.stem!r} yet: POST makes it")
    others = (size for path, size in folder.sizes() if path.suffix in KINDS and path != inside)
    held = sum(max(size, _BLOCK) for size in others)
    if held + max(len(data), _BLOCK) > BUDGETS.uploads_bytes:
        raise ProgramFileError(
            f"{inside} has {len(data)} bytes, other programs in the folder hold {held}: "
            f"{BUDGETS.uploads_bytes} are allowed, remove some"
        )
    folder.write(inside, data)
    return inside.stem


def _form_file(content_type: str, body: bytes) -> tuple[str, bytes]:
    """Return name and content of the form field `file` of a multipart body, or ProgramFileError."""
    if content_type.lower().startswith("multipart/form-data"):
        head = f"Content-Type: {content_type}\r\n\r\n".encode("latin-1", "replace")
        form = BytesParser(policy=HTTP).parsebytes(head + body)
        for part in form.iter_parts() if form.is_multipart() else ():
            if part.get_param("name", header="content-disposition") == "file":
                content = part.get_payload(decode=True)
                return part.get_filename() or "", content if isinstance(content, bytes) else b""
    raise ProgramFileError("the body has no form field 'file': send multipart/form-data")
