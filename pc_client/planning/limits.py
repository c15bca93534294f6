"""Limits and margins of plans, defined once, and the one line that refuses a plan.

The limits of the arm itself are in `kinematics.arms`; here is the share that a plan uses,
and the distances that it keeps.
"""

from dataclasses import dataclass

from pc_client.arrays import Array
from pc_client.errors import PlanningError
from pc_client.kinematics.arms import Six
from pc_client.kinematics.clearance import Clearance
from pc_client.kinematics.model import RobotModel
from protocol.ur_types import JOINT_NAMES


@dataclass(frozen=True, slots=True)
class PlanLimits:
    """Limits and margins of a plan.

    Attributes:
        speed_fraction: share of the joint speed limits that the reference may use; feedback needs the rest.
        position_margin: distance to keep from the ends of the joint ranges [rad].
        qdd_max: joint acceleration limits [rad/s²].
        tcp_speed_max: TCP speed limit [m/s].
        rest_speed_max: TCP speed at which a movement may begin and end; the spline is clamped there [m/s].
        joint_step_max: largest joint step between samples; more is a jump to another branch [rad].
        sigma_min: smallest singular value of the Jacobian to keep, lengths in reaches of the arm.
        position_error_max: error of the inverse kinematics at a sample [m].
        rotation_error_max: the same for the orientation [rad].
        interpolation_error_max: distance of the spline from the movement between samples [m].
        clearance_min: distances to keep [m].
        approach_speed: speed of the leading joint during the approach to the start [rad/s].
        approach_acceleration: its acceleration [rad/s²].
    """

    speed_fraction: float
    position_margin: float
    qdd_max: Six
    tcp_speed_max: float
    rest_speed_max: float
    joint_step_max: float
    sigma_min: float
    position_error_max: float
    rotation_error_max: float
    interpolation_error_max: float
    clearance_min: Clearance[float]
    approach_speed: float
    approach_acceleration: float


# Speed [m/s] and acceleration [m/s²] of the TCP when the leading joint moves the stretched arm: UR's
# recovery mode allows 250 mm/s.
_APPROACH_SPEED = 0.25
_APPROACH_ACCELERATION = 0.4


def limits_of(arm: RobotModel) -> PlanLimits:
    """Return the default limits of plans for an arm."""
    description = arm.description
    return PlanLimits(
        speed_fraction=0.9,
        position_margin=0.1,
        qdd_max=description.limits.qdd_max,
        tcp_speed_max=description.tcp_speed_max,
        rest_speed_max=0.01,
        # 25 rad/s at 4 ms: four times what any joint can do, and far less than the distance of two branches.
        joint_step_max=0.1,
        # At .035 a TCP speed of a tenth of the reach a second in the worst direction needs 2.9 rad/s, nearly
        # the limit of a big joint. The box recommended for movements keeps .16 on a UR3.
        sigma_min=0.035,
        position_error_max=1e-9,
        rotation_error_max=1e-9,
        interpolation_error_max=1e-4,
        # Hulls are good to a few mm, calibration and tracking add as much, and the surface under the arm is
        # seldom flat. From what stands around, 20 mm: the shoulder of a UR5 turns 24 mm above the plane that
        # it is mounted on, and that plane may be the top of a box of the cell.
        clearance_min=Clearance(floor=0.03, own=0.01, cell=0.02),
        approach_speed=_APPROACH_SPEED / arm.reach,
        approach_acceleration=_APPROACH_ACCELERATION / arm.reach,
    )


@dataclass(frozen=True, slots=True)
class PathNames:
    """What is needed to name a sample of a path: the movement, times (n,) [s], TCP positions (n, 3) [m]."""

    movement: str
    t: Array
    p: Array

    def refuse(self, sample: int, what: str, *, joint: int | None = None) -> PlanningError:
        """Return (not raise) the error for one sample.

        Args:
            what: what is wrong, what is allowed, what to do.
        """
        x, y, z = self.p[sample]
        where = f"t = {self.t[sample]:.3f} s, TCP at ({x:.4f}, {y:.4f}, {z:.4f}) m"
        at = f"sample {sample} of {len(self.t)} ({where})"
        who = "" if joint is None else f"{JOINT_NAMES[joint]}: "
        return PlanningError(f"{self.movement}: {at}: {who}{what}", sample=sample, joint=joint)
