"""ForceSense: the measured wrench at the flange: its zero, its history, and contacts in it.

A CB3 arm has no force sensor; the wrench is estimated from motor currents. The sensor of an e-Series arm is
also zeroed when a program starts and when it declares a payload (Universal_Robots_ROS_Driver issue 512).
Source: maker's script manual for e-Series 5.x, zero_ftsensor and tool_contact; on a CB3 the compiler knows
both, undocumented.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from protocol.pose import rotvec_to_matrix
from ur_emulator.machine.controller.settings import ToolSettings
from ur_emulator.machine.models.robot_generation import RobotGeneration
from ur_emulator.machine.models.robot_model import ZERO6, Vector3, Vector6, six
from ur_hil.arithmetic import add_up

# The RTDE input of an external sensor. Source: URScript manual CB3 3.15, ft_rtde_input_enable: the reading is
# a wrench at the sensor's measuring point, in the axes of the flange. Chosen: the reading is the external
# wrench; mass and centre of gravity of the sensor are kept, but its weight is not subtracted.
VARIABLE = "external_force_torque"


@dataclass(frozen=True, slots=True)
class ExternalSensor:
    """An enabled sensor: mass [kg]; measuring point `offset` and centre of gravity in the flange frame [m].

    `lever_sign` is 1; -1 for the deprecated builtin, which kept a sign error of the moments.
    """

    mass: float
    offset: Vector3
    cog: Vector3
    lever_sign: float = 1.0

    def wrench_at_flange(self, reading: Vector6, flange_pose: Vector6) -> Vector6:
        """Return the wrench at the flange in base axes [N, Nm] for a reading; zero if it is not finite."""
        if not all(map(math.isfinite, reading)):
            return ZERO6
        fx, fy, fz, mx, my, mz = reading
        x, y, z = (self.lever_sign * r for r in self.offset)
        moment = (mx + y * fz - z * fy, my + z * fx - x * fz, mz + x * fy - y * fx)
        rotation = rotvec_to_matrix(flange_pose[3:])
        return six([float(v) for part in ((fx, fy, fz), moment) for v in rotation @ part])


# Length of the history [s].
HISTORY_TIME = 1.0
# A declared payload is in the measurements after this time [s].
_PAYLOAD_TIME = 0.01
# Time that is averaged at the end and, as the force before, at the beginning of the history [s].
_RECENT_TIME, _EARLY_TIME = 0.04, 0.2
# A contact begins where the force has risen by this part of its total change.
_ONSET_SHARE = 0.2


class ForceSense:
    """The wrench at the flange, in base axes [N, Nm], as measured from cycle to cycle.

    `zero` counts as zero once a program has set it; an external sensor takes the place of the estimate. The
    weight of the declared payload is no part of the wrench, so the history holds measurements with the
    present payload only.
    """

    def __init__(self, generation: RobotGeneration, tool: ToolSettings) -> None:
        """Begin with an empty history; the generation has the control cycle and says how arms measure."""
        self._tool, self._payload = tool, tool.payload
        self._sensing = sensing = generation.force_sensing
        self._n_min = generation.cycles(sensing.least_averaging)
        self._n_max = generation.cycles(sensing.most_averaging)
        self._precision = np.repeat(sensing.precision, 3).tolist()
        self._n_payload = generation.cycles(_PAYLOAD_TIME) + self._n_min
        # Cycles until there are enough measurements with the present payload and sensor.
        self._cycles_left = 0
        self._is_to_zero = False
        self._n_recent, self._n_early = generation.cycles(_RECENT_TIME), generation.cycles(_EARLY_TIME)
        self._history: deque[Vector6] = deque(maxlen=generation.cycles(HISTORY_TIME))
        self.zero: Vector6 | None = None
        self.sensor: ExternalSensor | None = None

    def measure(self, wrench: Vector6) -> Vector6:
        """Add the measurement of this cycle; return it less the zero."""
        if not self._knows_payload:
            self._payload, self._cycles_left = self._tool.payload, self._n_payload
            self._history.clear()
        if self._cycles_left <= self._n_min:
            self._history.appendleft(wrench)
        if self._cycles_left:
            self._cycles_left -= 1
        if self._is_to_zero:
            self.set_zero(0)
        zero = self.zero
        return wrench if zero is None else six([w - z for w, z in zip(wrench, zero, strict=True)])

    def use(self, sensor: ExternalSensor | None) -> None:
        """Measure with an external sensor from now on, or with the estimate; the history is cleared."""
        self.sensor = sensor
        self._history.clear()
        self._cycles_left = self._n_min
        self.zero = None
        self._is_to_zero = False

    def set_zero(self, still_cycles: int) -> None:
        """Set the zero to the present wrench, after some cycles of standstill. Source: zero_ftsensor.

        After a change of payload or sensor that is done as soon as the new one has been measured with.
        """
        self._is_to_zero = self._cycles_left > 0 or not self._knows_payload
        if not self._is_to_zero:
            self.zero = self._present(still_cycles)

    def zero_built_in(self, still_cycles: int) -> None:
        """Zero the sensor of an arm that has one, where it measures; argument as in `set_zero`."""
        if self.refers_to_flange:
            self.set_zero(still_cycles)

    @property
    def refers_to_flange(self) -> bool:
        """The reported wrench is that at the flange; otherwise that at the TCP."""
        return self._sensing.has_sensor and self.sensor is None

    def residual(self, still_cycles: int) -> Vector6:
        """Return the present wrench, averaged, less the zero; argument as in `set_zero`.

        Zero as long as there is no measurement with the present payload.
        """
        if not (self._history and self._knows_payload):
            return ZERO6
        zero = ZERO6 if self.zero is None else self.zero
        return six([w - z for w, z in zip(self._present(still_cycles), zero, strict=True)])

    def offset(self, still_cycles: int) -> Vector6:
        """Return the part of the present wrench that may be an error, see `ForceSensing.precision`.

        Zero once a program has set the zero. Argument as in `set_zero`.
        """
        if self.zero is not None:
            return ZERO6
        present = self.residual(still_cycles)
        return six([w if abs(w) <= bound else 0.0 for w, bound in zip(present, self._precision, strict=True)])

    def steps_since_contact(self, direction: Sequence[float]) -> int:
        """Return how many cycles ago a contact began; 0 if the history has none.

        `direction` is that of the contact (3,), base axes; zero for any.
        """
        forces = [wrench[:3] for wrench in self._history]
        if len(forces) < self._n_recent + self._n_early:
            return 0
        before = _mean(forces[-self._n_early :])
        change = [now - then for now, then in zip(_mean(forces[: self._n_recent]), before, strict=True)]
        size = math.hypot(*direction)
        # The reaction of a contact points against the direction.
        against = (
            [-x / size for x in direction]
            if size > 0.0
            else [x / (math.hypot(*change) or 1.0) for x in change]
        )
        risen = _along(change, against)
        if risen < self._sensing.contact_force:
            return 0
        onset = _along(before, against) + _ONSET_SHARE * risen
        felt = [_along(force, against) for force in forces]
        # Two cycles in a row below it: one alone may be noise.
        for steps in range(1, len(felt) - 1):
            if felt[steps] < onset and felt[steps + 1] < onset:
                return steps
        return len(felt) - 1

    @property
    def _knows_payload(self) -> bool:
        """Whether the payload stays the one that was measured with last."""
        payload = self._tool.payload
        return not self._tool.is_changing and (payload is self._payload or payload == self._payload)

    def _present(self, still_cycles: int) -> Vector6:
        least, most = self._n_min, self._n_max
        # The arm comes to rest a little after its target.
        latest = list(islice(self._history, min(max(still_cycles - least, least), most)))
        return six(_mean(latest)) if latest else ZERO6


def _mean(vectors: Sequence[Sequence[float]]) -> list[float]:
    return [add_up(column) / len(vectors) for column in zip(*vectors, strict=True)]


def _along(vector: Sequence[float], direction: Sequence[float]) -> float:
    return add_up(v * d for v, d in zip(vector, direction, strict=True))
