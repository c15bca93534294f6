"""Reads the files of one program: XML and numbers, within budgets that hold for all of them together."""

from __future__ import annotations

import math
import re
import zlib
from pathlib import PurePosixPath
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from protocol.script_channel import MAX_PROGRAM
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError, UndefinedError, UnknownNodeError
from ur_emulator.machine.models.robot_model import Vector3, Vector6, six
from ur_emulator.program_files.folder import ProgramFolder
from urscript.source import as_utf8, program_text

# References that lead to references; PolyScope writes one step.
_MAX_STEPS = 16
_STEP = re.compile(r"([A-Za-z_][\w.\-]*)(?:\[(\d{1,6})\])?")
_GZIP_MAGIC = b"\x1f\x8b"
_NUMBER = re.compile(r"-?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_SHOWN = 100


class ProgramReader:
    """Reads the files of one program."""

    def __init__(self, folder: ProgramFolder) -> None:
        self.folder = folder
        self._bytes_left = BUDGETS.program_bytes
        self._marks_left = BUDGETS.program_marks

    def xml(self, file: PurePosixPath) -> XmlTree:
        """Read an XML file, packed or not; ProgramFileError also if the program becomes too large."""
        return self.parsed(file, self.unpacked(file))

    def unpacked(self, file: PurePosixPath) -> bytes:
        """Read a file, packed or not; ProgramFileError also if the program becomes too large."""
        data = unpack(file.name, self.folder.read(file, self._bytes_left), self._bytes_left)
        self._bytes_left -= len(data)
        return data

    def parsed(self, file: PurePosixPath, data: bytes) -> XmlTree:
        """Return the tree of an XML file; ProgramFileError also if the program becomes too large."""
        # Tags and attributes together are not more than these marks.
        self._marks_left -= data.count(b"<") + data.count(b"=")
        if self._marks_left < 0:
            raise ProgramFileError(
                f"{file.name}: the program has more than {BUDGETS.program_marks} tags and attributes"
            )
        try:
            is_text = "\0" not in data.decode("utf-8")
        except UnicodeDecodeError:
            is_text = False
        if not is_text:  # in another encoding the searches for marks and document types see nothing
            raise ProgramFileError(f"{file.name} is not text in UTF-8, as PolyScope's files are")
        if b"<!DOCTYPE" in data:
            raise ProgramFileError(f"{file.name}: a document type is declared, PolyScope's files have none")
        try:
            root = ElementTree.fromstring(data, ElementTree.XMLParser(encoding="utf-8"))
        except (ElementTree.ParseError, ValueError, LookupError) as error:
            raise ProgramFileError(f"{file.name} is not XML that PolyScope has written: {error}") from None
        return XmlTree(file, root)

    def script(self, file: PurePosixPath) -> str:
        """Read a text file, UTF-8 or else Latin-1; ProgramFileError also if the program becomes too large."""
        data = self.folder.read(file, min(MAX_PROGRAM, self._bytes_left))
        self._bytes_left -= len(data)
        try:
            text = program_text(data, file.name)
        except ValueError as error:
            raise ProgramFileError(str(error)) from None
        if "\0" in text:
            raise ProgramFileError(f"{file.name} is not text: it has zero bytes")
        return as_utf8(text).replace("\r\n", "\n")


class XmlTree:
    """A file that was read: XML, in which one element may stand for another.

    An element with a `reference` attribute, such as `<variable reference="../../Assignment[2]/variable"/>`,
    is another occurrence of the element at that path; paths start at the element itself and use `..`, names,
    and counts from 1. Source: files as public generators write them and public readers take them.

    Attributes:
        is_cb3: software of CB3 has saved it, not that of the e-Series.
    """

    def __init__(self, file: PurePosixPath, root: Element) -> None:
        """Take a tree; ProgramFileError if the elements are nested too deep."""
        self.file = file
        self.root = root
        self.is_cb3 = not root.get("lastSavedIn", "").startswith("5")
        self._parents: dict[Element, Element] = {}
        level = [root]
        for _ in range(BUDGETS.program_depth):
            self._parents |= {child: parent for parent in level for child in parent}
            level = [child for parent in level for child in parent]
        if level:
            raise self.error(f"elements are nested more than {BUDGETS.program_depth} deep")

    def error(self, problem: str) -> ProgramFileError:
        """Return the error that says what is wrong with this file."""
        return ProgramFileError(f"{self.file.name}: {problem}")

    def undefined(self, problem: str) -> UndefinedError:
        """Return the error that says what is missing; the program is loaded, and not played."""
        return UndefinedError(f"{self.file.name}: {problem}")

    def unknown(self, what: str) -> UnknownNodeError:
        """Return the error that names what is not known."""
        return UnknownNodeError(
            f"{self.file.name}: {what} cannot be turned into a script; "
            "put the .script that PolyScope saved with the program beside it, "
            "or leave it out (--skip-unknown-nodes)"
        )

    def number_text(self, text: str | None, what: str) -> str:
        """Return a finite number as it stands in the file, which is how a script has it.

        UndefinedError if it is none; `what` names it there.
        """
        plain = (text or "").strip()
        if not _NUMBER.fullmatch(plain) or not math.isfinite(float(plain)):
            shown = None if text is None else text[:_SHOWN]
            raise self.undefined(f"{what} is {shown!r}, a number is needed")
        return plain

    def number(self, text: str | None, what: str) -> float:
        """Return a finite number; UndefinedError if it is none."""
        return float(self.number_text(text, what))

    def number_texts(self, text: str | None, what: str, count: int = 6) -> list[str]:
        """Return numbers that have commas between, as they stand in the file.

        UndefinedError if there are more or fewer than `count`, or one is not a finite number.
        """
        parts = text.split(",") if text else []
        if len(parts) != count:
            raise self.undefined(f"{what} has {len(parts)} values, it needs {count}")
        return [self.number_text(part, what) for part in parts]

    def vector3(self, text: str | None, what: str) -> Vector3:
        """Return three numbers; UndefinedError if they are not."""
        x, y, z = map(float, self.number_texts(text, what, 3))
        return x, y, z

    def vector6(self, text: str | None, what: str) -> Vector6:
        """Return six numbers; UndefinedError if they are not."""
        return six(list(map(float, self.number_texts(text, what))))

    def resolve(self, element: Element) -> Element:
        """Return the element that `element` stands for, itself if it has no reference.

        ProgramFileError if the reference does not lead to an element.
        """
        for _ in range(_MAX_STEPS):
            reference = element.get("reference")
            if reference is None:
                return element
            element = self._follow(element, reference)
        raise self.error(f"references of <{element.tag}> lead in a circle")

    def _follow(self, start: Element, reference: str) -> Element:
        element: Element | None = start
        for step in reference.split("/"):
            if element is None:
                break
            if step == "..":
                element = self._parents.get(element)
            elif match := _STEP.fullmatch(step):
                found = element.findall(match[1])
                count = int(match[2] or 1)
                element = found[count - 1] if 1 <= count <= len(found) else None
            else:
                element = None
        if element is None:
            raise self.error(f"the reference {reference[:100]!r} of <{start.tag}> leads nowhere")
        return element


def unpack(name: str, data: bytes, most: int) -> bytes:
    """Return what is in a file that may be packed with gzip.

    ProgramFileError if it is damaged, or has more than `most` bytes unpacked.
    """
    if not data.startswith(_GZIP_MAGIC):
        return data
    unpacker = zlib.decompressobj(wbits=31)
    try:
        plain = unpacker.decompress(data, most + 1)
    except zlib.error as error:
        raise ProgramFileError(f"{name} is damaged: {error}") from None
    if len(plain) > most:
        raise ProgramFileError(f"{name} has more than {most} bytes unpacked")
    if not unpacker.eof:
        raise ProgramFileError(f"{name} is damaged: it ends too early")
    if unpacker.unused_data.strip(b"\0"):
        raise ProgramFileError(f"{name} is damaged: something stands behind its end")
    return plain
