"""PolyScope's files: XML, mostly compressed with gzip, in which one element may stand for another.

An element with a `reference` attribute, such as `<variable reference="../../Assignment[2]/variable"/>`, is
another occurrence of the element at that path; paths start at the element itself and use `..`, names, and
counts from 1. Source: files as public generators write them and public readers take them.
"""

from __future__ import annotations

import re
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

from ur_emulator.errors import ProgramFileError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# Most bytes of a file, packed or not; the largest programs in the field have some megabytes unpacked.
MAX_SIZE = 32 << 20
# References that lead to references; PolyScope writes one step.
_MAX_STEPS = 16
_STEP = re.compile(r"([A-Za-z_][\w.\-]*)(?:\[(\d{1,6})\])?")
# So much is parsed without a break [bytes]: the control cycle of the same process must not wait for more.
_BITE = 16 << 10
_GZIP_MAGIC = b"\x1f\x8b"


class XmlTree:
    """A file that was read.

    Attributes:
        name: of the file, for messages.
        root: of the tree.
    """

    def __init__(self, name: str, root: Element) -> None:
        self.name = name
        self.root = root
        self._parents = {child: parent for parent in root.iter() for child in parent}

    def resolve(self, element: Element) -> Element:
        """Return the element that `element` stands for, itself if it has no reference.

        Raises:
            ProgramFileError: the reference does not lead to an element.
        """
        for _ in range(_MAX_STEPS):
            reference = element.get("reference")
            if reference is None:
                return element
            element = self._follow(element, reference)
        raise ProgramFileError(f"{self.name}: references of <{element.tag}> lead in a circle")

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
            raise ProgramFileError(f"{self.name}: the reference {reference!r} of <{start.tag}> leads nowhere")
        return element


def read_xml(path: Path) -> XmlTree:
    """Read a file, packed or not.

    Raises:
        ProgramFileError: it cannot be read, is too large, or is not XML.
    """
    data = read_bytes(path)
    if data.startswith(_GZIP_MAGIC):
        data = _unpack(path.name, data)
    if b"<!DOCTYPE" in data:
        raise ProgramFileError(f"{path.name}: a document type is declared, PolyScope's files have none")
    from xml.etree import ElementTree  # a slow import, which few boxes need

    parser = ElementTree.XMLParser()
    try:
        for start in range(0, len(data), _BITE):
            parser.feed(data[start : start + _BITE])
        root: Element = parser.close()
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise ProgramFileError(f"{path.name} is not XML that PolyScope has written: {error}") from None
    return XmlTree(path.name, root)


def read_bytes(path: Path) -> bytes:
    """Read a file that is not too large.

    Raises:
        ProgramFileError: it cannot be read, or is too large.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MAX_SIZE + 1)
    except OSError as error:
        raise ProgramFileError(f"{path.name} cannot be read: {error.strerror or error}") from None
    if len(data) > MAX_SIZE:
        raise ProgramFileError(f"{path.name} has more than {MAX_SIZE} bytes, no program is that long")
    return data


def _unpack(name: str, data: bytes) -> bytes:
    unpacker = zlib.decompressobj(wbits=31)
    try:
        plain = unpacker.decompress(data, MAX_SIZE + 1)
    except zlib.error as error:
        raise ProgramFileError(f"{name} is damaged: {error}") from None
    if len(plain) > MAX_SIZE:
        raise ProgramFileError(f"{name} has more than {MAX_SIZE} bytes unpacked, no program is that long")
    if not unpacker.eof:
        raise ProgramFileError(f"{name} is damaged: it ends too early")
    return plain
