"""What the sub-packages of a robot state have in common; their tables are in `primary.layout`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from protocol.wire_record import ALWAYS, Since

__all__ = ["NO_TIME", "SubPackage"]

NO_TIME = 2**64 - 1
"""Timestamp of a package that has none: all ones."""


@dataclass(frozen=True, slots=True)
class SubPackage:
    """What all sub-packages share.

    Attributes:
        SUB_TYPE: number on the wire.
        SINCE: software that first sent the sub-package.
        FIRST_STATE_ONLY: sent in the first state of a connection and when the configuration changes.
    """

    SUB_TYPE: ClassVar[int]
    SINCE: ClassVar[Since] = ALWAYS
    FIRST_STATE_ONLY: ClassVar[bool] = False
