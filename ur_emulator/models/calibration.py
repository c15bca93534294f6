"""Calibration: how one built arm differs from the nominal table of its type.

The factory measures every arm and stores the differences in the control box, so the controller's own
kinematics know them; a client that trusts the nominal table is off by half a millimetre to a millimetre.
"""

from dataclasses import dataclass

from ur_emulator.models.fidelity import Fidelity, random_stream
from ur_emulator.models.robot_model import ZERO6, DhRow, RobotModel, Vector6, six


@dataclass(frozen=True, slots=True)
class Calibration:
    """Differences to add to a nominal DH table [rad, m], in the controller's own naming."""

    delta_theta: Vector6 = ZERO6
    delta_a: Vector6 = ZERO6
    delta_d: Vector6 = ZERO6
    delta_alpha: Vector6 = ZERO6


NOMINAL = Calibration()


def draw_calibration(fidelity: Fidelity, seed: int) -> Calibration:
    """Draw the calibration of the box with this seed: normal, mean 0, independent entries.

    Real tables split the distance between the parallel axes 2, 3 and 4 into huge offsets that cancel;
    here the offsets stay small; the arm is the same.

    Source: three factory calibrations of UR3e arms (kevinhpham/DalESelfEBot): lengths .06-.5 mm, tilts
    .3-2.9 mrad; pose error over random joint angles .6-.85 mm and 3.3-3.9 mrad in the mean.
    """
    rng = random_stream(seed, "calibration")
    angles = rng.standard_normal((2, 6)) * fidelity.calibration_angle
    lengths = rng.standard_normal((2, 6)) * fidelity.calibration_length
    theta, alpha = (six(row.tolist()) for row in angles)
    a, d = (six(row.tolist()) for row in lengths)
    return Calibration(delta_theta=theta, delta_a=a, delta_d=d, delta_alpha=alpha)


def calibrated_dh(robot: RobotModel, calibration: Calibration) -> tuple[DhRow, ...]:
    """Return the six rows of one arm: nominal plus calibration."""
    return tuple(
        DhRow(row.a + da, row.d + dd, row.alpha + dalpha, row.theta + dtheta)
        for row, da, dd, dalpha, dtheta in zip(
            robot.dh,
            calibration.delta_a,
            calibration.delta_d,
            calibration.delta_alpha,
            calibration.delta_theta,
            strict=True,
        )
    )
