"""The UR7e: a UR5e for a greater payload, which says on the wire that it is a UR5e.

Sources: UR client library (type, first version), data sheet (payload).
"""

from __future__ import annotations

from dataclasses import replace

from ur_emulator.models.ur5e import UR5E

UR7E = replace(UR5E, name="ur7e", title="UR7e", payload_max=7.5, first_version="5.22.0")
