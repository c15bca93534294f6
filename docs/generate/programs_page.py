"""The part of docs/programs.md about nodes, made from the tables of their kinds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from docs.generate.page_parts import table
from ur_emulator.program_files.script_writer import KINDS
from ur_emulator.program_files.urp_program import NOT_KNOWN, TOP_KINDS

_BEGIN = "<!-- made from ur_emulator/program_files/urp_program.py by `make docs` -->\n"
_END = "<!-- end of what is made -->\n"
_PAGE = Path(__file__).parents[1] / "programs.md"


def render() -> str:
    """Return the page with its tables as they are now."""
    text = _PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(_BEGIN)
    _, _, after = rest.partition(_END)
    return "\n".join((before + _BEGIN, *_tables(), "", _END + after))


def _tables() -> Iterator[str]:
    yield from table(("outer node", "becomes"), ((f"`{tag}`", text) for tag, text in TOP_KINDS.items()))
    yield ""
    yield from table(("node", "becomes"), ((f"`{tag}`", kind.becomes) for tag, kind in sorted(KINDS.items())))
    yield ""
    yield "No script is known for:"
    yield ""
    yield from (f"- {text}" for text in NOT_KNOWN)
