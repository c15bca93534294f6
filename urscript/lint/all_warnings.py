"""All warnings of a program without errors."""

from __future__ import annotations

from urscript.catalogue import Catalogue
from urscript.lint.arguments import argument_warnings
from urscript.lint.flow import flow_warnings
from urscript.lint.names import name_warnings
from urscript.lint.rules import ScriptWarning
from urscript.lint.values import value_warnings
from urscript.names.scopes import ResolvedProgram


def find_warnings(program: ResolvedProgram, catalogue: Catalogue) -> list[ScriptWarning]:
    """All warnings in the order of the text; `program` has no errors."""
    groups = (name_warnings, flow_warnings, value_warnings, argument_warnings)
    found = [warning for group in groups for warning in group(program, catalogue)]
    return sorted(found, key=lambda warning: (warning.line, warning.column, warning.rule.code))
