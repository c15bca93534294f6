"""The row builder that the chapter tables share, and the names of the documents they rest on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from .types import Builtin, Param, Support, TimeClass
from .versions import EVERYWHERE, NEVER, Generation, PerGeneration

MANUAL_CB3 = "URScript API Reference CB3 3.15.4"
MANUAL_E = "Script Manual e-Series 5.11"
MANUAL_LATE = "Script Directory e-Series 5.2x"
MANUAL_X = "world model and ROS 2 pages of the 5.2x / 10.x script directories"
DRIVER_SCRIPT = "called after run-time tests by the maker's driver script, which 3.14.3 and later accept"
POLYSCOPE_EXPORT = "written by PolyScope into exported programs"
FIELD_USE = "called by field scripts and public clients"


@dataclass(frozen=True, slots=True)
class Chapter:
    """One module of the script manual; `row` fills in what its rows have in common."""

    module: str
    nan_ok: bool = False
    default_support: Support = Support.DECLARED_ONLY

    def row(
        self,
        name: str,
        params: tuple[Param, ...],
        returns: str,
        summary: str,
        *,
        time: TimeClass = TimeClass.ZERO,
        since: PerGeneration = EVERYWHERE,
        until: PerGeneration = NEVER,
        support: Support | None = None,
        undocumented: Iterable[Generation] = (),
        deprecated: bool = False,
        nan_ok: bool | None = None,
        any_names: bool = False,
        note: str = "",
        source: str = "",
    ) -> Builtin:
        """Build one row; without `source` it cites the manuals of the generations that document the name."""
        hidden = frozenset(undocumented)
        if not source:
            manuals = ((Generation.CB3, MANUAL_CB3), (Generation.E_SERIES, MANUAL_E))
            cited = [text for g, text in manuals if since.get(g) is not None and g not in hidden]
            source = f"{' and '.join(cited)}, module {self.module}"
        return Builtin(
            name=name,
            params=params,
            returns=returns,
            time=time,
            module=self.module,
            since=since,
            until=until,
            support=self.default_support if support is None else support,
            summary=summary,
            source=source,
            undocumented=hidden,
            deprecated=deprecated,
            nan_ok=self.nan_ok if nan_ok is None else nan_ok,
            any_names=any_names,
            note=note,
        )
