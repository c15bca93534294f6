"""Scripts in files, and how they become one program."""

from __future__ import annotations

from pathlib import Path

from protocol.script_channel import MAX_PROGRAM, ProgramText, ScriptChannel
from ur_emulator.errors import ProgramFileError
from ur_emulator.programs.xml_tree import read_bytes
from urscript.values import to_script_text

_BYTE_ORDER_MARK = "\ufeff"


def read_script(path: Path) -> str:
    """Read a text file, UTF-8 or else Latin-1.

    Raises:
        ProgramFileError: it cannot be read, is too large, or is not text.
    """
    data = read_bytes(path)
    if b"\0" in data:
        raise ProgramFileError(f"{path.name} is not text: it has zero bytes")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.removeprefix(_BYTE_ORDER_MARK).replace("\r\n", "\n")


def as_one_program(text: str, name: str) -> str:
    """Return a script file as one program, one character a byte.

    A file with one `def` and nothing else is a program, as PolyScope saves it beside a .urp.
    Any other file is wrapped into a program with the name of the file, as a node of type script is: several
    functions and a call of one of them, or statements alone, are a program then.

    Raises:
        ProgramFileError: the script is longer than a box takes.
    """
    if len(text) > MAX_PROGRAM:
        raise ProgramFileError(f"the script has more than {MAX_PROGRAM} bytes")
    plain = to_script_text(text).rstrip() + "\n"
    items = ScriptChannel().feed(plain.encode("latin-1"))
    if len(items) == 1 and isinstance(items[0], ProgramText) and items[0].kind == "def":
        return items[0].text.rstrip("\n")
    return f"def {name}():\n{plain}end"
