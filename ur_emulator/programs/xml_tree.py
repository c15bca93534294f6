"""PolyScope's files: XML, mostly compressed with gzip, in which one element may stand for another.

An element with a `reference` attribute, such as `<variable reference="../../Assignment[2]/variable"/>`, is
another occurrence of the element at that path; paths start at the element itself and use `..`, names, and
counts from 1. Source: files as public generators write them and public readers take them.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable
from typing import TYPE_CHECKING

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# References that lead to references; PolyScope writes one step.
_MAX_STEPS = 16
_STEP = re.compile(r"([A-Za-z_][\w.\-]*)(?:\[(\d{1,6})\])?")
_GZIP_MAGIC = b"\x1f\x8b"


class XmlTree:
    """A file that was read.

    Attributes:
        name: of the file, for messages.
        root: of the tree.
    """

    def __init__(self, name: str, root: Element, take_steps: Callable[[str, int], None]) -> None:
        """Take a tree.

        Args:
            name: of the file.
            root: of the tree.
            take_steps: gets the name and how many elements a reference has passed; may raise.

        Raises:
            ProgramFileError: the elements are nested too deep.
        """
        self.name = name
        self.root = root
        self._take_steps = take_steps
        self._parents: dict[Element, Element] = {}
        level = [root]
        for _ in range(BUDGETS.program_depth):
            self._parents |= {child: parent for parent in level for child in parent}
            level = [child for parent in level for child in parent]
        if level:
            raise ProgramFileError(f"{name}: elements are nested more than {BUDGETS.program_depth} deep")

    def resolve(self, element: Element) -> Element:
        """Return the element that `element` stands for, itself if it has no reference.

        Raises:
            ProgramFileError: the reference does not lead to an element.
        """
        for _ in range(_MAX_STEPS):
            self._take_steps(self.name, 1 + len(element))  # the caller looks at its children
            reference = element.get("reference")
            if reference is None:
                return element
            element = self._follow(element, reference)
        raise ProgramFileError(f"{self.name}: references of <{element.tag}> lead in a circle")

    def _follow(self, start: Element, reference: str) -> Element:
        self._take_steps(self.name, len(reference))
        element: Element | None = start
        for step in reference.split("/"):
            if element is None:
                break
            if step == "..":
                element = self._parents.get(element)
            elif match := _STEP.fullmatch(step):
                self._take_steps(self.name, len(element))
                found = element.findall(match[1])
                count = int(match[2] or 1)
                element = found[count - 1] if 1 <= count <= len(found) else None
            else:
                element = None
        if element is None:
            raise ProgramFileError(
                f"{self.name}: the reference {reference[:100]!r} of <{start.tag}> leads nowhere"
            )
        return element


def count_marks(data: bytes) -> int:
    """Return a number that the tags and attributes of a file in UTF-8 together do not exceed."""
    return data.count(b"<") + data.count(b"=")


def parse_xml(name: str, data: bytes, take_steps: Callable[[str, int], None]) -> XmlTree:
    """Return the tree of a file.

    Args:
        name: of the file, for messages.
        data: what is in it, unpacked.
        take_steps: see `XmlTree`.

    Raises:
        ProgramFileError: it is not XML as PolyScope writes it.
    """
    if not _is_text(data):  # in another encoding the searches for marks and document types see nothing
        raise ProgramFileError(f"{name} is not text in UTF-8, as PolyScope's files are")
    if b"<!DOCTYPE" in data:
        raise ProgramFileError(f"{name}: a document type is declared, PolyScope's files have none")
    from xml.etree import ElementTree  # a slow import, which few boxes need

    parser = ElementTree.XMLParser(encoding="utf-8")
    try:
        parser.feed(data)
        root: Element = parser.close()
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise ProgramFileError(f"{name} is not XML that PolyScope has written: {error}") from None
    return XmlTree(name, root, take_steps)


def unpack(name: str, data: bytes, most: int) -> bytes:
    """Return what is in a file that may be packed with gzip.

    Raises:
        ProgramFileError: it is damaged, or has more than `most` bytes unpacked.
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


def _is_text(data: bytes) -> bool:
    try:
        return "\0" not in data.decode("utf-8")
    except UnicodeDecodeError:
        return False
