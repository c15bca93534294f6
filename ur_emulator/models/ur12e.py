"""The UR12e: a UR10e for a greater payload, which says on the wire that it is a UR10e.

Sources: UR client library (type, first version), data sheet (payload).
"""

from __future__ import annotations

from dataclasses import replace

from ur_emulator.models.ur10e import UR10E

UR12E = replace(UR10E, name="ur12e", title="UR12e", payload_max=12.5, first_version="5.22.0")
