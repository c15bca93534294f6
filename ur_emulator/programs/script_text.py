"""Scripts in files, and how they become one program."""

from __future__ import annotations

from protocol.script_channel import MAX_PROGRAM, ProgramText, ScriptChannel
from ur_emulator.errors import ProgramFileError
from urscript.values import to_script_text


def as_one_program(text: str, name: str) -> str:
    """Return a script file as one program, one character a byte.

    A file with one `def` and nothing else is a program, as PolyScope saves it beside a .urp.
    Any other file is wrapped into a program with the name of the file, as a node of type script is: several
    functions and a call of one of them, or statements alone, are a program then.

    Raises:
        ProgramFileError: the script is longer than a box takes.
    """
    plain = to_script_text(text).rstrip() + "\n"
    if len(plain) > MAX_PROGRAM:
        raise ProgramFileError(f"the script has more than {MAX_PROGRAM} bytes")
    items = ScriptChannel().feed(plain.encode("latin-1"))
    if len(items) == 1 and isinstance(items[0], ProgramText) and items[0].kind == "def":
        return items[0].text.rstrip("\n")
    return f"def {name}():\n{plain}end"
