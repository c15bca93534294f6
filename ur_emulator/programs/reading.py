"""Reads the files of one program. Its budgets hold for all of them together: a program may name many."""

from __future__ import annotations

from protocol.script_channel import MAX_PROGRAM
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError
from ur_emulator.programs.folder import FoundFile, ProgramFolder
from ur_emulator.programs.urpx_program import UrpxProgram, read_urpx
from ur_emulator.programs.xml_tree import XmlTree, count_marks, parse_xml, unpack
from urscript.source import as_utf8, program_text


class ProgramReader:
    """Reads the files of one program.

    Attributes:
        folder: where they lie.
    """

    def __init__(self, folder: ProgramFolder) -> None:
        self.folder = folder
        self._bytes_left = BUDGETS.program_bytes
        self._marks_left = BUDGETS.program_marks
        self._steps_left = BUDGETS.reference_steps

    def xml(self, file: FoundFile) -> XmlTree:
        """Read an XML file, packed or not.

        Raises:
            ProgramFileError: it cannot be read, is not XML, or the program becomes too large with it.
        """
        return self.parsed(file.name, self.unpacked(file))

    def unpacked(self, file: FoundFile) -> bytes:
        """Read a file, packed or not.

        Raises:
            ProgramFileError: it cannot be read, or the program becomes too large with it.
        """
        data = unpack(file.name, self.folder.read(file, self._bytes_left), self._bytes_left)
        self._bytes_left -= len(data)
        return data

    def parsed(self, name: str, data: bytes) -> XmlTree:
        """Return the tree of an XML file.

        Raises:
            ProgramFileError: it is not XML, or the program becomes too large with it.
        """
        self._marks_left -= count_marks(data)
        if self._marks_left < 0:
            raise ProgramFileError(
                f"{name}: the program has more than {BUDGETS.program_marks} tags and attributes"
            )
        return parse_xml(name, data, self._take_steps)

    def urpx(self, file: FoundFile) -> UrpxProgram:
        """Read a program of PolyScope X.

        Raises:
            ProgramFileError: it cannot be read, or has another form.
        """
        return read_urpx(file.name, self.unpacked(file))

    def script(self, file: FoundFile) -> str:
        """Read a text file, UTF-8 or else Latin-1.

        Raises:
            ProgramFileError: it cannot be read, is not text, or the program becomes too large with it.
        """
        data = self.folder.read(file, min(MAX_PROGRAM, self._bytes_left))
        self._bytes_left -= len(data)
        try:
            text = program_text(data, file.name)
        except ValueError as error:
            raise ProgramFileError(str(error)) from None
        if "\0" in text:
            raise ProgramFileError(f"{file.name} is not text: it has zero bytes")
        return as_utf8(text).replace("\r\n", "\n")

    def _take_steps(self, name: str, count: int) -> None:
        """Count elements that references have led past."""
        self._steps_left -= count
        if self._steps_left < 0:
            raise ProgramFileError(
                f"{name}: references lead past more than {BUDGETS.reference_steps} elements in all"
            )
