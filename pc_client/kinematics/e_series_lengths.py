"""Lengths of the e-Series arms, which example-robot-data does not have.

Source: UR's article "DH parameters for calculations of kinematics and dynamics"; UR8 Long, UR15 and UR18 by
ros-industrial/universal_robot (ur_description/config/*/default_kinematics.yaml); offsets from UR's ROS
description (config/*/physical_parameters.yaml, "measured from model"; of UR8 Long, UR15 and UR18 it has the
faces between two links, in the middle between their planes). The foot is half of the footprint in the data
sheet. Radii go by joint size, from the meshes of the CB3 arms, whose housings are as large: 32 mm
for size 0, 38 for 1, 46 for 2, 60 for 3, 75 for 4. Those of UR20 and UR30 are assumed, in proportion to the
offsets; those of a UR15 are half of the widths of a UR8 Long's parts, by public notes on their STL files.
"""

from __future__ import annotations

from dataclasses import replace

from pc_client.kinematics.dh_arm import DhArm

UR3E = DhArm(
    d1=0.15185,
    a2=-0.24355,
    a3=-0.2132,
    d4=0.13105,
    d5=0.08535,
    d6=0.0921,
    shoulder_offset=0.12,
    elbow_offset=0.027,
    foot=0.064,
    radii=(0.046, 0.038, 0.032),
)
UR5E = DhArm(
    d1=0.1625,
    a2=-0.425,
    a3=-0.3922,
    d4=0.1333,
    d5=0.0997,
    d6=0.0996,
    shoulder_offset=0.138,
    elbow_offset=0.007,
    foot=0.075,
    radii=(0.06, 0.06, 0.038),
)
UR10E = DhArm(
    d1=0.1807,
    a2=-0.6127,
    a3=-0.57155,
    d4=0.17415,
    d5=0.11985,
    d6=0.11655,
    shoulder_offset=0.1762,
    elbow_offset=0.0393,
    foot=0.095,
    radii=(0.075, 0.06, 0.046),
)
UR16E = replace(UR10E, a2=-0.4784, a3=-0.36, shoulder_offset=0.176, elbow_offset=0.04)
UR20 = DhArm(
    d1=0.2363,
    a2=-0.862,
    a3=-0.7287,
    d4=0.201,
    d5=0.1593,
    d6=0.1543,
    shoulder_offset=0.26,
    elbow_offset=0.043,
    foot=0.1225,
    radii=(0.11, 0.095, 0.064),
)
UR30 = replace(UR20, a2=-0.637, a3=-0.5037)
UR15 = DhArm(
    d1=0.2186,
    a2=-0.6475,
    a3=-0.5164,
    d4=0.1824,
    d5=0.1361,
    d6=0.1434,
    shoulder_offset=0.218,
    elbow_offset=0.0505,
    foot=0.102,
    radii=(0.075, 0.062, 0.045),
)
UR18 = replace(UR15, a2=-0.475, a3=-0.3389)
UR8LONG = replace(UR15, a2=-0.8989, a3=-0.7149)
