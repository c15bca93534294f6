"""Warnings of a program whose names are all known: what is allowed but probably not meant."""

from __future__ import annotations

from urscript.catalogue import Catalogue
from urscript.lint_arguments import argument_warnings
from urscript.lint_flow import flow_warnings
from urscript.lint_names import name_warnings
from urscript.lint_rules import ScriptWarning
from urscript.lint_values import value_warnings
from urscript.scopes import ResolvedProgram


def find_warnings(program: ResolvedProgram, catalogue: Catalogue) -> list[ScriptWarning]:
    """All warnings in the order of the text; `program` has no errors."""
    groups = (name_warnings, flow_warnings, value_warnings, argument_warnings)
    found = [warning for group in groups for warning in group(program, catalogue)]
    return sorted(found, key=lambda warning: (warning.line, warning.column, warning.rule.code))
