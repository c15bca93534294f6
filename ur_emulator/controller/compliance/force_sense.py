"""ForceSense: the measured wrench at the flange: its zero, its history, and contacts in it.

A CB3 arm has no force sensor; the wrench is estimated from motor currents (see `plant/force_estimate.py`).
Source: maker's script manual for e-Series 5.x, zero_ftsensor and tool_contact; on a CB3 the
compiler knows both, undocumented. Thresholds are chosen for the precision of the estimate.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import islice
from math import hypot

from ur_emulator.controller.compliance.external_sensor import ExternalSensor
from ur_emulator.models.robot_generation import RobotGeneration
from ur_emulator.models.robot_model import ZERO6, Vector6, six

# Least and most time that is averaged to separate a zero from noise [s]: 0.2 s leave 0.6 N of 3 N, 1 s 0.3 N.
# The greater one is the length of the history.
MIN_AVERAGING_TIME, MAX_AVERAGING_TIME = 0.2, 1.0
# Precision of the estimate [N, Nm]. Source: UR3/CB3 manual.
PRECISION: Vector6 = (10.0, 10.0, 10.0, 5.0, 5.0, 5.0)

# A contact is a force that has risen by this within the history [N]. The friction offset of the
# estimate changes its sign with the motion, by 8 N for a poor arm, and noise leaves 2 N of the mean below.
CONTACT_FORCE = 15.0
# Time that is averaged at the end and, as the force before, at the beginning of the history [s].
_RECENT_TIME, _EARLY_TIME = 0.04, 0.2
# A contact begins where the force has risen by this part of its total change.
_ONSET_SHARE = 0.2


class ForceSense:
    """The wrench at the flange, in base axes [N, Nm], as measured from cycle to cycle.

    Attributes:
        zero: wrench that counts as zero; None until a program has set it.
        sensor: an external sensor, which takes the place of the estimate; None without one.
    """

    def __init__(self, generation: RobotGeneration) -> None:
        """Begin with an empty history; the generation gives the duration of a cycle."""
        self._n_min, self._n_max = (
            generation.cycles(MIN_AVERAGING_TIME),
            generation.cycles(MAX_AVERAGING_TIME),
        )
        self._n_recent, self._n_early = generation.cycles(_RECENT_TIME), generation.cycles(_EARLY_TIME)
        self._history: deque[Vector6] = deque(maxlen=self._n_max)
        self.zero: Vector6 | None = None
        self.sensor: ExternalSensor | None = None

    def measure(self, wrench: Vector6) -> Vector6:
        """Add the measurement of this cycle; return it less the zero."""
        self._history.appendleft(wrench)
        zero = self.zero
        return wrench if zero is None else six([w - z for w, z in zip(wrench, zero, strict=True)])

    def use(self, sensor: ExternalSensor | None) -> None:
        """Measure with an external sensor from now on, or with the estimate; the history is cleared."""
        self.sensor = sensor
        self._history.clear()
        self.zero = None

    def set_zero(self, still_cycles: int) -> None:
        """Set the zero to the present wrench. Source: zero_ftsensor.

        Args:
            still_cycles: number of cycles for which the arm has stood still.
        """
        self.zero = self._present(still_cycles)

    def residual(self, still_cycles: int) -> Vector6:
        """Return the present wrench, averaged, less the zero; argument as in `set_zero`."""
        zero = ZERO6 if self.zero is None else self.zero
        return six([w - z for w, z in zip(self._present(still_cycles), zero, strict=True)])

    def offset(self, still_cycles: int) -> Vector6:
        """Return the part of the present wrench that may be an error of the estimate: see PRECISION.

        Zero once a program has set the zero. Argument as in `set_zero`.
        """
        if self.zero is not None:
            return ZERO6
        present = self.residual(still_cycles)
        return six([w if abs(w) <= bound else 0.0 for w, bound in zip(present, PRECISION, strict=True)])

    def steps_since_contact(self, direction: Sequence[float]) -> int:
        """Return how many cycles ago a contact began; 0 if the history has none.

        Args:
            direction: of the contact, base axes (3,); zero for any.
        """
        forces = [wrench[:3] for wrench in self._history]
        if len(forces) < self._n_recent + self._n_early:
            return 0
        before = _mean(forces[-self._n_early :])
        change = [now - then for now, then in zip(_mean(forces[: self._n_recent]), before, strict=True)]
        size = hypot(*direction)
        # The reaction of a contact points against the direction.
        against = (
            [-x / size for x in direction] if size > 0.0 else [x / (hypot(*change) or 1.0) for x in change]
        )
        risen = _along(change, against)
        if risen < CONTACT_FORCE:
            return 0
        onset = _along(before, against) + _ONSET_SHARE * risen
        felt = [_along(force, against) for force in forces]
        # Two cycles in a row below it: one alone may be noise.
        for steps in range(1, len(felt) - 1):
            if felt[steps] < onset and felt[steps + 1] < onset:
                return steps
        return len(felt) - 1

    def _present(self, still_cycles: int) -> Vector6:
        least, most = self._n_min, self._n_max
        # The arm comes to rest a little after its target.
        latest = list(islice(self._history, min(max(still_cycles - least, least), most)))
        return six(_mean(latest)) if latest else ZERO6


def _mean(vectors: Sequence[Sequence[float]]) -> list[float]:
    return [sum(column) / len(vectors) for column in zip(*vectors, strict=True)]


def _along(vector: Sequence[float], direction: Sequence[float]) -> float:
    return sum(v * d for v, d in zip(vector, direction, strict=True))
