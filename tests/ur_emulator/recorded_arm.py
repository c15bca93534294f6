"""What a real UR3 did in three motions, and the same motions on an emulated one.

The figures are of `real_arm_figures` over record files of a real UR3 of the CB3, 125 Hz (public repository
mkrssg/UniversalRobots, 2019).
"""

import numpy as np
from box_support import Bench
from real_arm_figures import Moving

UPRIGHT = "[0, d2r(-90), d2r(90), d2r(-90), d2r(-90), 0]"
BESIDE = "[2.1186, -1.4028, 1.8805, -3.2782, -1.0855, -0.6707]"
NAMES = ("timestamp", "target_q", "actual_q", "target_qd", "actual_qd", "actual_current", "target_current")

# Start and motion, by name.
MOTIONS = {
    "base": (UPRIGHT, "movej([d2r(90), d2r(-90), d2r(90), d2r(-90), d2r(-90), 0], a=1, v=0.8)"),
    "three": (UPRIGHT, "movej([d2r(90), d2r(-60), d2r(30), d2r(-90), d2r(-90), 0], a=1, v=0.8)"),
    "line": (BESIDE, "movel(pose_add(get_target_tcp_pose(), p[0, 0.4, 0, 0, 0, 0]), a=1, v=0.2)"),
}

# By motion and joint.
MOVING = {
    ("base", 0): Moving(0.80, 0.55, 0.19, 1.03, 2.4, 2.6, 0.54, 0.054, 0.50),
    ("three", 0): Moving(0.80, 0.55, 0.19, 1.01, 2.4, 3.0, 0.53, 0.056, 0.49),
    ("three", 1): Moving(0.27, 0.54, 0.14, 0.47, 1.9, 0.2, -0.55, 0.053, -0.52),
    ("three", 2): Moving(0.53, 0.52, 0.17, 0.68, 4.3, 3.0, 1.17, 0.072, 1.18),
    ("line", 0): Moving(0.92, -0.01, 0.18, 0.88, 2.7, 3.3, 0.59, 0.070, 0.52),
    ("line", 1): Moving(0.44, 0.21, 0.24, 0.62, 3.8, 3.6, -0.40, 0.052, -0.35),
    ("line", 2): Moving(0.65, 0.43, 0.07, 0.73, 4.2, 3.4, 1.06, 0.059, 1.13),
    ("line", 3): Moving(0.53, 0.72, 0.05, 0.76, 7.7, 1.8, 0.22, 0.077, 0.10),
    ("line", 4): Moving(0.88, 1.22, 0.18, 1.49, 6.5, 1.6, 0.36, 0.057, 0.41),
    ("line", 5): Moving(0.43, 0.49, 0.03, 0.46, 3.7, 2.6, 0.33, 0.057, 0.28),
}

# Before each motion, base to wrist 3: sd of an angle and target - actual [µrad], actual - target current [A].
NOISE = {
    "base": (22.0, 23.6, 23.1, 21.0, 16.9, 21.9),
    "three": (24.9, 23.2, 21.0, 22.2, 24.7, 24.6),
    "line": (24.5, 23.0, 24.6, 21.0, 20.1, 22.7),
}
STANDING = {
    "base": (13.3, -74.6, -34.3, -63.5, -53.1, -23.5),
    "three": (-36.3, -75.3, -45.4, -74.9, 53.1, -74.1),
    "line": (-11.5, -50.2, -85.9, 41.9, 16.2, -52.0),
}
STANDING_CURRENT = {
    "base": (0.008, 0.141, 0.047, 0.031, -0.051, 0.160),
    "three": (0.025, -0.100, 0.031, 0.089, -0.079, 0.115),
    "line": (-0.055, 0.064, 0.052, 0.029, 0.124, -0.019),
}


def record(seed, motion):
    """The packages of a motion by its name, and of half a second of rest before it, by RTDE names."""
    start, statement = MOTIONS[motion]
    bench = Bench(robot="ur3", seed=seed)
    bench.run(f"def there():\n movej({start})\n sleep(5)\nend\n")
    bench.snapshots.clear()
    bench.tick(60)
    bench.run(f"def motion():\n {statement}\nend\n")
    return {name: np.array([getattr(it, name) for it in bench.snapshots]) for name in NAMES}
