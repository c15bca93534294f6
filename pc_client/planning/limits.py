"""What a plan may ask of the arm: limits and margins, stated once.

The joint ranges and speeds themselves belong to the arm (kinematics.robot_model); here stands how much of
them a plan uses, and what the arm's maker does not publish.
"""

from __future__ import annotations

from dataclasses import dataclass

from pc_client.kinematics.robot_model import Six


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
        sigma_min: smallest singular value of the Jacobian to keep (m and rad mixed).
        position_error_max: error of the inverse kinematics at a sample [m].
        rotation_error_max: the same for the orientation [rad].
        interpolation_error_max: distance of the spline from the movement between samples [m].
        floor_clearance_min: distance of forearm and wrists from the base plane [m].
        own_clearance_min: distance between links of the arm that are not neighbours [m].
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
    floor_clearance_min: float
    own_clearance_min: float


DEFAULT_LIMITS = PlanLimits(
    speed_fraction=0.9,
    position_margin=0.1,
    # UR publishes none. UR's own driver streams speedj with a = 40 rad/s² (Universal_Robots_Client_Library,
    # external_control.urscript); for base and shoulder less, from torque: (56 - 19 gravity - 10 friction) Nm
    # over about .95 kg m² with rotor; the elbow has (28 - 7 - 4) Nm over about .4 kg m².
    qdd_max=(28.0, 28.0, 40.0, 40.0, 40.0, 40.0),
    # UR3 data sheet: "typical tool speed 1 m/s".
    tcp_speed_max=1.0,
    rest_speed_max=0.01,
    # 25 rad/s at 4 ms: four times what any joint can do, and far less than the way between two branches.
    joint_step_max=0.1,
    # At .03 a TCP speed of .1 m/s in the worst direction needs about 3.3 rad/s, the limit of a big joint. The
    # box recommended for movements keeps .08.
    sigma_min=0.03,
    position_error_max=1e-9,
    rotation_error_max=1e-9,
    interpolation_error_max=1e-4,
    # Hulls are good to a few mm, calibration and tracking add as much.
    floor_clearance_min=0.03,
    own_clearance_min=0.01,
)
"""What `plan_movement` holds unless told otherwise. For a UR3 without a tool on a plane."""
