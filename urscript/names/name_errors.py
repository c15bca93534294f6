"""The errors that name resolution finds in one program, each with its place and, where it helps, a hint."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from urscript.catalogue import Catalogue
from urscript.catalogue.versions import NEVER
from urscript.errors import ScriptCompileError, ScriptNameError
from urscript.source import Source, Span

MAX_SUGGESTIONS: Final = 40
"""Unknown names of one program for which a suggestion is searched."""


class NameErrors:
    """Collects errors.

    Attributes:
        found: In the order in which they were found.
    """

    def __init__(self, source: Source, catalogue: Catalogue) -> None:
        self._source = source
        self._catalogue = catalogue
        self._n_unknown = 0
        self.found: list[ScriptCompileError] = []

    def unknown(self, name: str, span: Span, known: Callable[[], list[str]]) -> None:
        """Add an unknown name, with a hint; `known` returns the names that may have been meant."""
        self._n_unknown += 1
        hint = None
        # The searches are slow, so there is a limit.
        if self._n_unknown <= MAX_SUGGESTIONS:
            releases, version = self._catalogue.first_releases(name), self._catalogue.version
            if releases != NEVER:
                hint = f"known since {releases}; this is {version.generation.value} {version}"
            elif alike := self._catalogue.suggest(name, known()):
                hint = f"did you mean '{alike}'?"
        name_only = Span(span.line, span.column, span.line, span.column + len(name))
        self.add(ScriptNameError(name, hint=hint), name_only)

    def add(self, error: ScriptCompileError, span: Span) -> None:
        """Add an error at its place."""
        width = span.end_column - span.column if span.line == span.end_line else 1
        self.found.append(error.locate(self._source, span.line, span.column, width))
