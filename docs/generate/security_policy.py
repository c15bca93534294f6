"""The page SECURITY.md: who may do what through which port, what is promised, and all limits."""

from __future__ import annotations

from collections.abc import Iterator

from docs.generate.page_parts import table
from pc_client.input_files import FILE_KINDS, MIB
from ur_emulator.budgets import rows

_INTRODUCTION = """\
# Security

Made from `docs/generate/security_policy.py`, `ur_emulator/budgets.py` and `pc_client/input_files.py` by
`make docs`.
"""


def render() -> str:
    """Return the page."""
    return "\n".join(
        (
            _INTRODUCTION,
            "## Limits of a box",
            "",
            *table(("limit", "of", "beyond it", "name"), _budgets()),
            "",
            "## Files that the client reads",
            "",
            *table(("file", "most MiB", "reason"), _files()),
            "",
        )
    )


def _budgets() -> Iterator[tuple[str, ...]]:
    for row in rows():
        yield f"{row.limit:,} {row.unit}", row.scope, row.beyond, f"`{row.name}`"


def _files() -> Iterator[tuple[str, ...]]:
    for name, kind in FILE_KINDS.items():
        yield name, f"{kind.most_bytes // MIB}", kind.reason
