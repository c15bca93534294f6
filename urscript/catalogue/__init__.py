"""The catalogue of all URScript builtins: which version has what, how it is called, how well it is modelled.

`chapters/` has a table for each chapter of the script manual, `catalogue` reads them, `calls` binds and
checks arguments; `catalogue_for(version)` is the view of one release.
"""

from urscript.catalogue.catalogue import ALL_ROWS, CB3_3_15, Catalogue, catalogue_for
from urscript.catalogue.types import STEP_TIME, Builtin, Generation, TimeClass

__all__ = [
    "ALL_ROWS",
    "CB3_3_15",
    "STEP_TIME",
    "Builtin",
    "Catalogue",
    "Generation",
    "TimeClass",
    "catalogue_for",
]
