"""The checked figures of a plan, as one record and as lines of text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pc_client.kinematics.cell import Cell
from pc_client.kinematics.clearance import Nearest
from pc_client.kinematics.robot_model import JointLimits
from pc_client.planning.limits import PlanLimits
from protocol.ur_types import JOINT_NAMES

Array = NDArray[np.float64]


class Extreme(NamedTuple):
    """The worst value of a quantity along a path.

    Attributes:
        value: in the unit of the quantity.
        sample: index of the sample where it occurs (the nearest one, when it occurs between two).
        joint: index 0..5 of the joint it belongs to, or None.
        limit: what the value is held against, at that joint.
        share: `value` over its limit (of a quantity to keep low) or limit over `value` (of one to keep high).
    """

    value: float
    sample: int
    joint: int | None
    limit: float
    share: float


class LeastClearance(NamedTuple):
    """How near bodies come along a path.

    Attributes:
        extreme: the distance [m], held against the one that must be kept.
        nearest: which bodies these are; None where there are none.
    """

    extreme: Extreme
    nearest: Nearest | None

    @property
    def says(self) -> str:
        """The refusal of what comes too near; empty where there is nothing."""
        return "" if self.nearest is None else self.nearest.says(self.extreme.value, self.extreme.limit)

    @property
    def text(self) -> str:
        """Distance and bodies, e.g. `31 mm, forearm from box 'press'`; empty where there is nothing."""
        if self.nearest is None:
            return ""
        return f"{self.extreme.value * 1e3:.0f} mm, {self.nearest.first} from {self.nearest.second}"


@dataclass(frozen=True, slots=True)
class PlanReport:
    """Figures of a plan, all in SI.

    Attributes:
        robot: name of the nominal arm.
        joint_limits: what the arm can do.
        limits: what the plan was held against.
        cell: what stands around the arm and what it carries.
        duration: [s].
        samples: number of samples.
        path_length: length of the TCP path [m].
        box_min: (3,) lower corner of the box that the TCP stays in [m].
        box_max: (3,) upper corner [m].
        q_min: (6,) lowest joint angles [rad].
        q_max: (6,) highest joint angles [rad].
        qd_peak: (6,) top joint speeds [rad/s].
        qdd_peak: (6,) top joint accelerations [rad/s²].
        tcp_speed: top TCP speed [m/s].
        joint_range: least distance of a joint from an end of its range [rad].
        joint_speed: top joint speed relative to its limit [rad/s].
        joint_acceleration: top joint acceleration relative to its limit [rad/s²].
        sigma_min: least smallest singular value of the Jacobian.
        condition_max: largest condition number.
        manipulability_min: least |det J|.
        floor_clearance: how near forearm, wrists and tool come to the floor.
        own_clearance: how near the arm and its tool come to themselves.
        cell_clearance: how near they come to walls and solids of the cell.
        position_error: largest error of the inverse kinematics [m].
        rotation_error: the same for the orientation [rad].
        interpolation_error: largest distance of the spline from the movement half way between samples [m].
        ik_iterations: steps of the inverse kinematics per sample.
    """

    robot: str
    joint_limits: JointLimits
    limits: PlanLimits
    cell: Cell
    duration: float
    samples: int
    path_length: float
    box_min: Array
    box_max: Array
    q_min: Array
    q_max: Array
    qd_peak: Array
    qdd_peak: Array
    tcp_speed: Extreme
    joint_range: Extreme
    joint_speed: Extreme
    joint_acceleration: Extreme
    sigma_min: Extreme
    condition_max: Extreme
    manipulability_min: Extreme
    floor_clearance: LeastClearance
    own_clearance: LeastClearance
    cell_clearance: LeastClearance
    position_error: Extreme
    rotation_error: Extreme
    interpolation_error: Extreme
    ik_iterations: float

    @property
    def clearances(self) -> tuple[LeastClearance, ...]:
        """From the floor, of the arm from itself, from the cell."""
        return self.floor_clearance, self.own_clearance, self.cell_clearance

    def lines(self) -> tuple[str, ...]:
        """Return the figures that matter to someone who stands beside the arm, one a line."""
        size = (self.box_max - self.box_min) * 1e3
        speed, acceleration, margin = self.joint_speed, self.joint_acceleration, self.joint_range
        return (
            f"box of motion   x {_span(self, 0)}  y {_span(self, 1)}  z {_span(self, 2)} m"
            f"  ({size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm)",
            f"duration        {self.duration:.2f} s, path {self.path_length:.3f} m",
            f"top TCP speed   {self.tcp_speed.value:.3f} m/s ({_percent(self.tcp_speed)} of the"
            f" {self.limits.tcp_speed_max:g} m/s allowed)",
            f"top joint speed {np.degrees(speed.value):.0f} deg/s, {_joint(speed)}"
            f" ({_percent(speed)} of what is allowed)",
            f"top joint accel {np.degrees(acceleration.value):.0f} deg/s², {_joint(acceleration)}"
            f" ({_percent(acceleration)} of what is allowed)",
            f"joint range     nearest to its end: {_joint(margin)}, {np.degrees(margin.value):.0f} deg away",
            f"singularity     smallest singular value {self.sigma_min.value:.3f}"
            f" (at least {self.limits.sigma_min:g}), condition number up to {self.condition_max.value:.0f}",
            f"cell            {self.cell.summary}",
            f"clearance       {'; '.join(least.text for least in self.clearances if least.text)}",
            f"accuracy        inverse kinematics {self.position_error.value:.1e} m,"
            f" spline {self.interpolation_error.value * 1e6:.2f} um",
        )


def _span(report: PlanReport, axis: int) -> str:
    return f"{report.box_min[axis]:.3f}..{report.box_max[axis]:.3f}"


def _percent(extreme: Extreme) -> str:
    return f"{extreme.share * 100:.0f} %"


def _joint(extreme: Extreme) -> str:
    return "" if extreme.joint is None else JOINT_NAMES[extreme.joint]
