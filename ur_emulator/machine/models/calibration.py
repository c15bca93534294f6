"""The factory calibration: how the DH table of one built arm differs from the nominal one of its type.

The factory measures every arm and stores the differences in the control box, so the controller's own
kinematics know them; a client that trusts the nominal table is off by one or two millimetres.
"""

from dataclasses import dataclass, replace

import numpy as np

from ur_emulator.machine.models.fidelity import Fidelity, random_stream
from ur_emulator.machine.models.robot_model import ZERO6, DhRow, RobotModel, Vector6


@dataclass(frozen=True, slots=True)
class CalibrationSpread:
    """The calibrations of the arms of a type.

    Attributes:
        mean: of the differences of d1, a2, a3, d4, d5, d6 [mm].
        sd: of the same [mm].
        tilt: rms of the differences of the six twists alpha [mrad].
        zero: rms of the offsets of the joints' zeros, theta [mrad].
    """

    mean: Vector6
    sd: Vector6
    tilt: Vector6
    zero: float


# Source: factory calibrations of 35 real arms in public repositories, in the form of the ROS kinematics file;
# the number of arms stands at the row. A mean below twice its standard error is 0, and the spread is that
# about 0. Tilts have mean 0; what some types have in common, up to 1.3 mrad at wrists 2 and 3, is in the rms.
# A DH row has no pitch: that of forearm and wrist 1 is in their roll, as root of the sum of squares. Real
# tables split the distance between the parallel axes 2, 3 and 4 into huge offsets that cancel; here they
# stay small; the arm is the same.
# Columns: mean, sd (d1, a2, a3, d4, d5, d6 [mm]), tilt (alpha 1 to 6 [mrad]), zero [mrad].
_UR10E = CalibrationSpread(  # 9
    (0.0, 0.43, 0.21, 0.0, 0.0, -0.94),
    (0.25, 0.14, 0.21, 0.36, 0.10, 0.10),
    (0.7, 2.1, 6.4, 1.1, 0.6, 0.0),
    0.01,
)
_UR5E = CalibrationSpread(  # 7
    (0.0, -0.20, -0.17, 0.0, 0.0, 0.0),
    (0.17, 0.13, 0.15, 0.33, 0.12, 0.13),
    (1.0, 2.0, 4.7, 1.7, 1.1, 0.0),
    0.01,
)
# By the name of the arm. UR7e and UR12e are a UR5e and a UR10e with another payload.
_SPREADS = {
    "ur3": CalibrationSpread(  # 3
        (0.06, 0.0, 0.0, 0.0, 0.0, 0.45),
        (0.02, 0.32, 0.16, 0.49, 0.11, 0.06),
        (0.35, 4.0, 6.6, 0.5, 0.4, 0.0),
        0.05,
    ),
    "ur5": CalibrationSpread(  # 3
        (0.0, -0.30, 0.0, 1.11, 0.11, 0.10),
        (0.14, 0.14, 0.16, 0.56, 0.02, 0.08),
        (1.0, 2.6, 3.8, 0.4, 0.4, 0.0),
        0.05,
    ),
    # Tilts of forearm and wrist 1: those of the better arm and of the UR5. The other has 17 and 11 mrad, and
    # 13 mrad of offset at wrist 3: one arm says nothing of how often there is such a one.
    "ur10": CalibrationSpread(  # 2
        (0.77, 0.0, 0.98, -0.63, 0.0, 0.0),
        (0.06, 0.38, 0.10, 0.19, 0.17, 0.02),
        (0.25, 2.6, 3.8, 0.8, 0.7, 0.0),
        0.05,
    ),
    "ur3e": CalibrationSpread(  # 9
        (0.10, -0.23, -0.07, 0.0, 0.0, 0.06),
        (0.10, 0.12, 0.05, 0.27, 0.08, 0.07),
        (0.6, 4.1, 5.2, 1.1, 1.4, 0.0),
        0.01,
    ),
    "ur5e": _UR5E,
    "ur7e": _UR5E,
    "ur10e": _UR10E,
    "ur12e": _UR10E,
    # 2; spreads, also of tilts, are a UR10e's, which has the same joints
    "ur16e": replace(_UR10E, mean=(0.38, 0.0, -0.16, 0.0, 0.0, -0.94)),
}
# No arm is known: spreads of a UR10e, the largest with a known one (I).
_OTHERS = replace(_UR10E, mean=ZERO6)


def draw_dh(robot: RobotModel, fidelity: Fidelity, seed: int) -> tuple[DhRow, ...]:
    """Return the DH table of the box with this seed: the nominal one plus normal, independent differences."""
    spread = _SPREADS.get(robot.name, _OTHERS)
    rng = random_stream(seed, "calibration")
    lengths = np.add(spread.mean, spread.sd * rng.standard_normal(6))
    angles = np.multiply([spread.tilt, [spread.zero] * 6], rng.standard_normal((2, 6)))
    d1, a2, a3, d4, d5, d6 = (1e-3 * fidelity.calibration * lengths).tolist()
    alpha, theta = (1e-3 * fidelity.calibration * angles).tolist()
    a, d = (0.0, a2, a3, 0.0, 0.0, 0.0), (d1, 0.0, 0.0, d4, d5, d6)
    return tuple(
        DhRow(row.a + da, row.d + dd, row.alpha + dalpha, row.theta + dtheta)
        for row, da, dd, dalpha, dtheta in zip(robot.dh, a, d, alpha, theta, strict=True)
    )
