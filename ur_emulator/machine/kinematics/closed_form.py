"""Inverse kinematics of the nominal UR geometry in closed form, all eight branches.

Valid for all arms whose table has the UR pattern: axes 2, 3 and 4 parallel, d2 = d3 = 0, twists
+90, 0, 0, +90, -90, 0 degrees. Calibration is not included; `ArmModel.inverse` refines the results.

Derivation: the first axis follows from the wrist's distance d4 to the plane of the arm; joint 5 from the
flange's distance to the same plane; joint 6 from the direction of the parallel axes in the flange frame; the
rest is a planar two-link arm. Same geometry as K. P. Hawkins, "Analytic inverse kinematics for the
Universal Robots UR-5/UR-10 arms", Georgia Tech, 2013.
"""

from collections.abc import Sequence
from math import acos, atan2, cos, hypot, pi, sin

from ur_emulator.machine.models.robot_model import DhRow, Vector3, Vector6, six

# A cosine outside [-1, 1] by less than this counts as the limit: a calibrated arm may reach a little further
# than the nominal one, and the refinement decides.
_TOLERANCE = 0.02


def closed_form_inverse(
    dh: Sequence[DhRow], rotation: Sequence[float], position: Vector3, q6_free: float
) -> list[Vector6]:
    """Find all joint angles that bring the flange to a pose in the base frame.

    Args:
        dh: six nominal rows of UR pattern.
        rotation: nine numbers row by row.
        position: [m].
        q6_free: value for joint 6 where it is undetermined (wrist singularity) [rad].

    Returns:
        Up to eight solutions, each angle within [-pi, pi); none out of reach. Close to the limits of reach a
        solution may be approximate.
    """
    d1, d4, d5, d6 = dh[0].d, dh[3].d, dh[4].d, dh[5].d
    a2, a3 = dh[1].a, dh[2].a
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation
    px, py, pz = position
    wrist_x, wrist_y = px - d6 * r02, py - d6 * r12
    swing = _acos(d4, hypot(wrist_x, wrist_y))
    if swing is None:
        return []
    solutions: list[Vector6] = []
    toward_wrist = atan2(wrist_y, wrist_x) + pi / 2
    for q1 in (toward_wrist + swing, toward_wrist - swing):
        c1, s1 = cos(q1), sin(q1)
        bend = _acos(s1 * px - c1 * py - d4, d6)
        if bend is None:
            continue
        # The direction of axes 2, 3 and 4 in the flange frame.
        axis_x, axis_y = s1 * r00 - c1 * r10, s1 * r01 - c1 * r11
        for q5 in (bend, -bend):
            s5 = sin(q5)
            q6 = q6_free if abs(s5) < 1e-9 else atan2(-axis_y / s5, axis_x / s5)
            c6, s6 = cos(q6), sin(q6)
            # Axis 5 in the base frame, then in the plane of the arm.
            z4x, z4y, z4z = -s6 * r00 - c6 * r01, -s6 * r10 - c6 * r11, -s6 * r20 - c6 * r21
            q234 = atan2(c1 * z4x + s1 * z4y, -z4z)
            ex, ey, ez = px - d6 * r02 - d5 * z4x, py - d6 * r12 - d5 * z4y, pz - d6 * r22 - d5 * z4z
            u, v = c1 * ex + s1 * ey, ez - d1
            fold = _acos(u * u + v * v - a2 * a2 - a3 * a3, 2.0 * a2 * a3)
            if fold is None:
                continue
            for q3 in (fold, -fold):
                q2 = atan2(v, u) - atan2(a3 * sin(q3), a2 + a3 * cos(q3))
                angles = (q1, q2, q3, q234 - q2 - q3, q5, q6)
                solutions.append(six([(angle + pi) % (2.0 * pi) - pi for angle in angles]))
    return solutions


def _acos(numerator: float, denominator: float) -> float | None:
    """Arc cosine of a quotient; None if it is out of range by more than the tolerance."""
    if abs(numerator) > (1.0 + _TOLERANCE) * abs(denominator):
        return None
    return acos(max(-1.0, min(1.0, numerator / denominator))) if denominator else None
