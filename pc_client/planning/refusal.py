"""The refusal of a plan: one line with movement, sample, time, point, joint, what is wrong and what to do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import PlanningError
from protocol.ur_types import JOINT_NAMES


@dataclass(frozen=True, slots=True)
class PathNames:
    """What is needed to name a sample of a path.

    Attributes:
        movement: name of the movement.
        t: (n,) time of the samples [s].
        p: (n, 3) TCP positions [m].
    """

    movement: str
    t: NDArray[np.float64]
    p: NDArray[np.float64]

    def refuse(self, sample: int, what: str, *, joint: int | None = None) -> PlanningError:
        """Return (not raise) the error for one sample.

        Args:
            sample: index of the offending sample.
            what: what is wrong, what is allowed, what to do.
            joint: index of the offending joint, named in the text.
        """
        x, y, z = self.p[sample]
        where = f"t = {self.t[sample]:.3f} s, TCP at ({x:.4f}, {y:.4f}, {z:.4f}) m"
        at = f"sample {sample} of {len(self.t)} ({where})"
        who = "" if joint is None else f"{JOINT_NAMES[joint]}: "
        return PlanningError(f"{self.movement}: {at}: {who}{what}", sample=sample, joint=joint)
