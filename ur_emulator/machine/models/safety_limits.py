"""The limits of a safety system, as records; a generation and an installation have numbers for them."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmLimits:
    """Limits of a mode beside the speeds of the joints; infinite where the mode has none.

    Attributes:
        tool_speed: of TCP and elbow [m/s].
        force: at the TCP [N].
        power: mechanical, of all joints [W].
        momentum: of the arm [kg m/s].
    """

    tool_speed: float = math.inf
    force: float = math.inf
    power: float = math.inf
    momentum: float = math.inf

    def within(self, other: ArmLimits) -> ArmLimits:
        """Return the stricter of two limits, each."""
        return ArmLimits(
            tool_speed=min(self.tool_speed, other.tool_speed),
            force=min(self.force, other.force),
            power=min(self.power, other.power),
            momentum=min(self.momentum, other.momentum),
        )


UNLIMITED = ArmLimits()


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyLimits:
    """Limits that the safety systems of all arms have in common.

    Attributes:
        holding_deviation: how far a joint of a resting arm may give way [rad]; None: as that of a moving one.
        reduced_share: joint speeds of reduced mode, as a share of the rated ones.
        recovery_speed: joint speed of recovery mode [rad/s].
        speed_margin: how far a joint may exceed its rated speed before the safety system stops it [rad/s].
        acceleration: largest joint acceleration that the configuration data announce [rad/s^2].
        reduced, recovery, manual: in these modes, where the generation has them.
        has_programs_in_recovery: programs run in recovery mode.
        clamping_distance: distance of forearm and flange at which the arm is stopped, so that no hand is
            clamped [m]; 0: it is not watched.
        brakes_within_torque: a stop brakes no harder than the drives can with the declared payload.
    """

    holding_deviation: float | None = None
    reduced_share: float
    recovery_speed: float
    speed_margin: float
    acceleration: float
    reduced: ArmLimits = UNLIMITED
    recovery: ArmLimits = UNLIMITED
    manual: ArmLimits = UNLIMITED
    has_programs_in_recovery: bool
    clamping_distance: float = 0.0
    brakes_within_torque: bool = False
