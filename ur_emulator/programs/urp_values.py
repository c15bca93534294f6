"""Numbers in the files of PolyScope."""

from __future__ import annotations

import math
import re

from ur_emulator.errors import ProgramFileError
from ur_emulator.programs.xml_tree import XmlTree

_NUMBER = re.compile(r"-?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_SHOWN = 100


def number_text(tree: XmlTree, text: str | None, what: str) -> str:
    """Return a finite number as it stands in the file, which is how a script has it.

    Raises:
        ProgramFileError: it is not a finite number.
    """
    plain = (text or "").strip()
    if not _NUMBER.fullmatch(plain) or not math.isfinite(float(plain)):
        shown = None if text is None else text[:_SHOWN]
        raise ProgramFileError(f"{tree.name}: {what} is {shown!r}, a number is needed")
    return plain


def number(tree: XmlTree, text: str | None, what: str) -> float:
    """Return a finite number.

    Raises:
        ProgramFileError: it is not a finite number.
    """
    return float(number_text(tree, text, what))


def number_texts(tree: XmlTree, text: str | None, what: str, count: int = 6) -> list[str]:
    """Return numbers that have commas between, as they stand in the file.

    Raises:
        ProgramFileError: there are more or less, or one is not a finite number.
    """
    parts = text.split(",") if text else []
    if len(parts) != count:
        raise ProgramFileError(f"{tree.name}: {what} has {len(parts)} values, it needs {count}")
    return [number_text(tree, part, what) for part in parts]
