"""Loads programs: from a name to a program that can be played, as PolyScope's `load`."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePosixPath

from protocol.script_channel import MAX_PROGRAM, ProgramText, ScriptChannel
from ur_emulator.errors import ProgramFileError, UnknownNodeError
from ur_emulator.program_files.folder import PROGRAM_SUFFIX, SCRIPT_SUFFIX, URPX_SUFFIX, ProgramFolder
from ur_emulator.program_files.header import header_lines
from ur_emulator.program_files.installation import ExternalControlPc, Installation
from ur_emulator.program_files.installation_reader import NEW_BOX, installation_of
from ur_emulator.program_files.names import identifier
from ur_emulator.program_files.reader import ProgramReader, XmlTree
from ur_emulator.program_files.script_writer import Gap, Header, Part
from ur_emulator.program_files.urp_nodes import OLD_ROOT, ROOT
from ur_emulator.program_files.urp_program import make_script, uses_external_control
from ur_emulator.program_files.urpx import read_urpx
from urscript.values import to_script_text

# So many things that are left out are named one by one.
_MOST_NOTES = 20
# Marks of the part of a PC's program that is written once, before the rest. Source: External Control URCap.
_HEADER_BEGIN = "# HEADER_BEGIN"
_HEADER_END = "# HEADER_END"
# Twin: the script that PolyScope saves beside a program, and never reads. A script of that name can be the
# user's own. Source of the marks: scripts that PolyScope saved, and the software that saved them.
_DEF = re.compile(r"\s*def \w+\(\):")
_LABEL = re.compile(r'^\s*\$ \d+ "', re.MULTILINE)
# Text in the header -> the software that writes it; the first that is found.
_MARKS = (
    ("_hidden_verificationVariable", "5.12 or later"),
    ("set_target_payload", "5.10 or later"),
    ("set_tool_communication", "5.x"),
    ("set_tool_voltage", "3.x"),
)


@dataclass(frozen=True, slots=True)
class LoadedProgram:
    """A program as it is in the memory of the box.

    Attributes:
        wire_path: how the box calls its file, `/programs/sub/x.urp`.
        installation: of the program; a script file has none.
        parts: its script, and places for what is known when it is played.
        origin: where the script comes from if not from the file itself.
        undefined: what somebody has to fill in before it can be played, in one line; "" for nothing.
    """

    wire_path: str
    installation: Installation | None
    parts: tuple[Part, ...]
    notes: tuple[str, ...] = ()
    origin: str = ""
    undefined: str = ""

    @property
    def file_name(self) -> str:
        """Name of the file without folder."""
        return PurePosixPath(self.wire_path).name

    @property
    def pcs(self) -> tuple[ExternalControlPc, ...]:
        """The PCs that its nodes name, each once."""
        return tuple(dict.fromkeys(part.pc for part in self.parts if isinstance(part, Gap)))

    def script(self, received: Callable[[ExternalControlPc], str]) -> str:
        """Return the script, one character a byte; `received` gives what a PC has sent.

        ProgramFileError if it becomes longer than a box takes.
        """
        texts: list[str] = []
        size = 0
        headed: set[ExternalControlPc] = set()
        for part in self.parts:
            if isinstance(part, str):
                texts.append(part)
            elif isinstance(part, Header):
                declared = header_lines(self.installation or NEW_BOX)
                texts += [f"  {to_script_text(line)}" for line in declared]
            else:
                header, lines = split_header(received(part.pc))
                if part.pc not in headed:
                    headed.add(part.pc)
                    lines = header + lines
                size += sum(map(len, lines)) + len(lines) * (len(part.indent) + 1)
                if size > MAX_PROGRAM:
                    raise ProgramFileError(f"the parts of PCs together have more than {MAX_PROGRAM} bytes")
                texts.append(part.indent + f"\n{part.indent}".join(lines))
        return "\n".join(texts) + "\n"


def as_one_program(text: str, name: str) -> str:
    """Return a script file as one program, one character a byte.

    A file with one `def` and nothing else is a program, as PolyScope saves it beside a .urp. Any other file
    is wrapped into a program with the name of the file, as a node of type script is: several functions and a
    call of one of them, or statements alone, are a program then. ProgramFileError: the script is longer than
    a box takes.
    """
    plain = to_script_text(text).rstrip() + "\n"
    if len(plain) > MAX_PROGRAM:
        raise ProgramFileError(f"the script has more than {MAX_PROGRAM} bytes")
    items = ScriptChannel().feed(plain.encode("latin-1"))
    if len(items) == 1 and isinstance(items[0], ProgramText) and items[0].kind == "def":
        return items[0].text.rstrip("\n")
    return f"def {name}():\n{plain}end"


def split_header(text: str) -> tuple[list[str], list[str]]:
    """Split the text of a PC into its header, which is written once, and the part for each node."""
    lines = text.replace("\r\n", "\n").rstrip("\n").split("\n")
    marks = [line.strip() for line in lines]
    try:
        begin = marks.index(_HEADER_BEGIN)
        end = marks.index(_HEADER_END, begin)
    except ValueError:
        return [], lines
    return lines[begin : end + 1], lines[end + 1 :]


def load_program(folder: ProgramFolder, name: str, *, skip_unknown: bool = False) -> LoadedProgram:
    """Read a program and its installation.

    A program file becomes the script that PolyScope makes of its nodes; the script beside it, which PolyScope
    saved, only if a node is not known, unless such nodes are skipped. FileMissingError if there is no such
    program, ProgramFileError if it cannot be used.
    """
    file = folder.find(name)
    reader = ProgramReader(folder)
    path = folder.wire_path(file)
    if file.suffix in (SCRIPT_SUFFIX, URPX_SUFFIX):
        is_script = file.suffix == SCRIPT_SUFFIX
        text = reader.script(file) if is_script else read_urpx(file.name, reader.unpacked(file)).script
        return LoadedProgram(path, None, (as_one_program(text, identifier(file.stem)),))
    if file.suffix != PROGRAM_SUFFIX:
        raise ProgramFileError(
            f"{file.name} is not a program: its name must end in {PROGRAM_SUFFIX}, {SCRIPT_SUFFIX} or "
            f"{URPX_SUFFIX}"
        )
    tree = reader.xml(file)
    if tree.root.tag not in (ROOT, OLD_ROOT):
        raise ProgramFileError(f"{file.name} is not a program: it is a <{tree.root.tag}>, not a <{ROOT}>")
    installation = installation_of(reader, tree)
    try:
        made = make_script(tree, reader, installation, skip_unknown=skip_unknown)
    except UnknownNodeError as unknown:
        return _twin_instead(reader, tree, installation, unknown)
    notes: list[str] = []
    for texts, what in ((made.left_out, "left out"), (made.undefined, "undefined")):
        notes += [f"{_cause(text)}: it is {what}" for text in texts[:_MOST_NOTES]]
        if len(texts) > _MOST_NOTES:
            notes.append(f"{file.name}: {len(texts)} things are {what} in all")
    others = f", and {len(made.undefined) - 1} more" if len(made.undefined) > 1 else ""
    undefined = made.undefined[0] + others if made.undefined else ""
    return LoadedProgram(path, installation, tuple(made.parts), tuple(notes), undefined=undefined)


def _twin_instead(
    reader: ProgramReader, tree: XmlTree, installation: Installation, unknown: UnknownNodeError
) -> LoadedProgram:
    """Return the program with the script that PolyScope saved; raise `unknown` if there is none."""
    saved = str(tree.file.with_suffix(SCRIPT_SUFFIX))
    if not reader.folder.has(saved):
        raise unknown
    twin = reader.folder.find(saved)
    text = as_one_program(reader.script(twin), identifier(twin.stem))
    if not (_DEF.match(text) and _LABEL.search(text)):  # no program with labels, as PolyScope makes it
        raise ProgramFileError(f"{_cause(unknown)}, and {twin.name} is not a script that PolyScope saved")
    if uses_external_control(tree):
        raise ProgramFileError(f"{_cause(unknown)}, and {twin.name} has what a PC sent when it was saved")
    software = next((software for mark, software in _MARKS if mark in text), "unknown")
    origin = f"{twin.name}, saved by software {software}"
    note = f"{_cause(unknown)}: instead of the nodes runs {origin}"
    return LoadedProgram(reader.folder.wire_path(tree.file), installation, (text,), (note,), origin)


def _cause(error: object) -> str:
    """Return what is wrong, without what to do."""
    return str(error).partition(";")[0]
