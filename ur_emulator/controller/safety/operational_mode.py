"""The operational mode of an e-Series box as tables: who chooses it, what each mode allows.

Sources: UR5e hardware manual 2022, safety I/O (a wired selector overrides PolyScope and dashboard; what acts
in which mode); PolyScope X manual SW 10.6 (rights of each mode); UR dashboard server e-Series: NONE without a
password. What is chosen stands in docs/fidelity.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum


class OperationalMode(Enum):
    """An operational mode; the values are those of the control API and of the dashboard."""

    NONE = "none"
    MANUAL = "manual"
    AUTOMATIC = "automatic"


class ModeSource(IntEnum):
    """Who may choose the operational mode; the first one that has chosen counts."""

    SELECTOR = 0  # configurable input: low automatic, high manual
    DASHBOARD = 1
    PENDANT = 2


@dataclass(frozen=True, slots=True)
class OperationalRow:
    """What an operational mode allows.

    Attributes:
        allows_freedrive: by the teach button, an input or a client; programs always may.
        is_slow: the limits of manual mode hold, see `SafetyLimits`.
        needs_enabling: an enabling device that is not held stops the arm.
        heeds_safeguard: the automatic-mode safeguard stops the arm.
    """

    allows_freedrive: bool
    is_slow: bool
    needs_enabling: bool
    heeds_safeguard: bool


OPERATIONAL_MODES: dict[OperationalMode, OperationalRow] = {
    OperationalMode.NONE: OperationalRow(True, False, False, False),
    OperationalMode.MANUAL: OperationalRow(True, True, True, False),
    OperationalMode.AUTOMATIC: OperationalRow(False, False, False, True),
}


class OperationalModeChoice:
    """Who has chosen which operational mode.

    Attributes:
        mode: that of the first source that has chosen one.
        allows: what it allows.
    """

    def __init__(self) -> None:
        self._choices: dict[ModeSource, OperationalMode] = {}
        self.mode = OperationalMode.NONE
        self.allows = OPERATIONAL_MODES[self.mode]

    @property
    def source(self) -> ModeSource:
        """Who decides at present."""
        return min(self._choices, default=ModeSource.PENDANT)

    def choose(self, source: ModeSource, mode: OperationalMode | None) -> None:
        """Let a source choose a mode, or leave the choice to the others."""
        if mode is None:
            self._choices.pop(source, None)
        else:
            self._choices[source] = mode
        self.mode = self._choices.get(self.source, OperationalMode.NONE)
        self.allows = OPERATIONAL_MODES[self.mode]
