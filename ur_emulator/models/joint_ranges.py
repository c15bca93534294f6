"""Ends of joint ranges, as the safety systems of both generations have them.

Source: safety blocks of real CB3 installations and the configuration data of a UR5e: ±363 degrees.
"""

from __future__ import annotations

from math import pi, radians

RANGE_END = 2.0 * pi + radians(3.0)
"""[rad]"""

# Ends where the installation sets no position limit: the least and the greatest number of revolutions [rad].
FIRST_TURN, LAST_TURN = -(2**31) * 2.0 * pi, (2**31 - 1) * 2.0 * pi
