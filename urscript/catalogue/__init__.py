"""The catalogue of all URScript builtins: which version has what, how it is called, how well it is modelled.

One table module for each chapter of the script manual; `catalogue_for(version)` is the view of one release.
"""

from .catalogue import ALL_ROWS, CB3_3_15, Catalogue, catalogue_for
from .types import REQUIRED, Builtin, BuiltinArray, ModuleVariable, Param, ParamType, Support, TimeClass
from .versions import STEP_TIME, Generation, PerGeneration, Version

__all__ = [
    "ALL_ROWS",
    "CB3_3_15",
    "REQUIRED",
    "STEP_TIME",
    "Builtin",
    "BuiltinArray",
    "Catalogue",
    "Generation",
    "ModuleVariable",
    "Param",
    "ParamType",
    "PerGeneration",
    "Support",
    "TimeClass",
    "Version",
    "catalogue_for",
]
