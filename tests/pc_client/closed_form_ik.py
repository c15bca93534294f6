"""An oracle for the client's iterative kinematics: the UR arm in closed form, from its DH table alone.

Uses nothing of the code under test. All eight branches (shoulder, wrist, elbow), after K. Hawkins, "Analytic
inverse kinematics for the Universal Robots UR-5/UR-10 arms", 2013, written for the standard DH form.
"""

from __future__ import annotations

from math import acos, atan2, cos, hypot, pi, sin
from typing import NamedTuple

import numpy as np


class DhTable(NamedTuple):
    """Lengths [m] of a UR arm. Source: Universal Robots article on DH parameters."""

    d1: float
    a2: float
    a3: float
    d4: float
    d5: float
    d6: float


DH = {
    "ur3": DhTable(0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819),
    "ur5": DhTable(0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823),
    "ur10": DhTable(0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922),
    "ur3e": DhTable(0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
    "ur5e": DhTable(0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
    "ur7e": DhTable(0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
    "ur10e": DhTable(0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
    "ur12e": DhTable(0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
    "ur16e": DhTable(0.1807, -0.4784, -0.36, 0.17415, 0.11985, 0.11655),
    "ur8long": DhTable(0.2186, -0.8989, -0.7149, 0.1824, 0.1361, 0.1434),
    "ur15": DhTable(0.2186, -0.6475, -0.5164, 0.1824, 0.1361, 0.1434),
    "ur18": DhTable(0.2186, -0.475, -0.3389, 0.1824, 0.1361, 0.1434),
    "ur20": DhTable(0.2363, -0.862, -0.7287, 0.201, 0.1593, 0.1543),
    "ur30": DhTable(0.2363, -0.637, -0.5037, 0.201, 0.1593, 0.1543),
}


def link(theta, d, a, alpha):
    c, s, ca, sa = cos(theta), sin(theta), cos(alpha), sin(alpha)
    return np.array(
        [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0.0, sa, ca, d], [0.0, 0.0, 0.0, 1.0]]
    )


def frames(q, dh=DH["ur3"]):
    """Return T_base_1 .. T_base_6, the DH frames, at joint angles q."""
    rows = (
        (dh.d1, 0, pi / 2),
        (0, dh.a2, 0),
        (0, dh.a3, 0),
        (dh.d4, 0, pi / 2),
        (dh.d5, 0, -pi / 2),
        (dh.d6, 0, 0),
    )
    T, chain = np.eye(4), []
    for theta, (d, a, alpha) in zip(q, rows, strict=True):
        T = T @ link(theta, d, a, alpha)
        chain.append(T)
    return chain


def dh_pose(q, dh=DH["ur3"]):
    """Return T_base_tcp (flange) at joint angles q."""
    return frames(q, dh)[-1]


def wrap(angle):
    """Wrap to (-pi, pi]."""
    return -((-np.asarray(angle) + pi) % (2 * pi) - pi)


def closed_form_ik(T, dh=DH["ur3"]):
    """Return every q (6,) in (-pi, pi] with dh_pose(q) = T by branch (shoulder, wrist, elbow)."""
    solutions = {}
    p5 = T[:3, 3] - dh.d6 * T[:3, 2]
    r = hypot(p5[0], p5[1])
    if r < dh.d4:
        return solutions
    for shoulder in (1, -1):
        q1 = atan2(p5[1], p5[0]) + shoulder * acos(dh.d4 / r) + pi / 2
        # The row of T that the base angle turns into (s5 c6, -s5 s6, c5): well-conditioned for every q5.
        row = T[0, :3] * sin(q1) - T[1, :3] * cos(q1)
        if hypot(row[0], row[1]) < 1e-9:
            continue  # wrist singularity: q4 and q6 are not determined
        for wrist in (1, -1):
            q5 = atan2(wrist * hypot(row[0], row[1]), row[2])
            q6 = atan2(-wrist * row[1], wrist * row[0])
            T14 = (
                np.linalg.inv(link(q1, dh.d1, 0, pi / 2))
                @ T
                @ np.linalg.inv(link(q5, dh.d5, 0, -pi / 2) @ link(q6, dh.d6, 0, 0))
            )
            p3 = T14 @ (0.0, -dh.d4, 0.0, 1.0)
            c3 = (p3[0] ** 2 + p3[1] ** 2 - dh.a2**2 - dh.a3**2) / (2 * dh.a2 * dh.a3)
            if abs(c3) > 1.0:
                continue
            for elbow in (1, -1):
                q3 = elbow * acos(c3)
                q2 = atan2(p3[1], p3[0]) - atan2(dh.a3 * sin(q3), dh.a2 + dh.a3 * cos(q3))
                T34 = np.linalg.inv(link(q2, 0, dh.a2, 0) @ link(q3, 0, dh.a3, 0)) @ T14
                q4 = atan2(T34[1, 0], T34[0, 0])
                solutions[shoulder, wrist, elbow] = wrap([q1, q2, q3, q4, q5, q6])
    return solutions


def branch_error(q, T, dh=DH["ur3"]):
    """Return (branch, distance [rad]) of the closed-form solution of T nearest to q, up to whole turns."""
    distances = {
        branch: float(np.abs(wrap(np.asarray(q) - solution)).max())
        for branch, solution in closed_form_ik(T, dh).items()
    }
    nearest = min(distances, key=distances.get)
    return nearest, distances[nearest]
