"""The TCP path of one recording: reference and actual position at the same controller time stamps.

Both go through the same operator, the first difference over the time between two samples, so that a perfect
arm gives a perfect figure. Nothing here smooths or shifts. Samples are 8 ms apart, as the paper's were: of
an arm with 500 Hz, every fourth frame is one.
"""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from pc_client.arrays import Array
from pc_client.control.loop import SAMPLING_TIME
from pc_client.errors import RecordingError
from pc_client.recording.recording import Recording
from pc_client.recording.rows import Phase

# Fewer samples than this are no movement: 80 ms.
MIN_MOVEMENT_ROWS = 10

SHORTEST_CYCLE, LONGEST_CYCLE = 0.5e-3, 0.05
"""Median steps of time stamps outside are of no robot [s]: UR's control cycles are 8 and 2 ms."""

_MOST = MappingProxyType(
    {
        "timestamp": 1e9,  # s: 30 years
        "ref_t": 1e9,
        "ref_tcp_position": 100.0,  # m
        "actual_TCP_pose": 100.0,
        "ref_q": 1e3,  # rad
        "actual_q": 1e3,
    }
)
"""What is measured, and the largest value that a robot can report."""


@dataclass(frozen=True, slots=True)
class TcpTrack:
    """Positions of the tool centre point in the base frame.

    Attributes:
        t: (n,) controller time in s, strictly rising.
        p_ref: (n, 3) reference position at these times, m.
        p_actual: (n, 3) position that the robot reported at these times, m.
        rows: index of each sample's row in the recording, (n,).
        new_rows: index of every row with a time stamp of its own, (m,): of each control cycle.
        movement: samples first..last of the movement phase, as a slice.
        t_begin: controller time at which the movement began, s: up to a cycle before its first sample.
    """

    t: Array
    p_ref: Array
    p_actual: Array
    rows: NDArray[np.intp]
    new_rows: NDArray[np.intp]
    movement: slice
    t_begin: float

    @property
    def movement_steps(self) -> slice:
        """The first differences that lie wholly inside the movement: step k is sample k to k + 1."""
        return slice(self.movement.start, self.movement.stop - 1)

    @property
    def t_start(self) -> float:
        """Time of the first sample of the movement, s."""
        return float(self.t[self.movement.start])

    @property
    def t_end(self) -> float:
        """Time of the last sample of the movement, s."""
        return float(self.t[self.movement.stop - 1])


def track_of(recording: Recording) -> TcpTrack:
    """Take the TCP path out of a recording.

    Rows that repeat a time stamp (a heartbeat of a standing controller) are left out, and those between two
    samples; the first row of the movement is one.

    Raises:
        RecordingError: signals are missing, or the movement phase is too short to be judged.
    """
    t = recording.t
    with np.errstate(invalid="ignore"):  # endless times are refused below
        new_rows = np.flatnonzero(np.diff(t, prepend=-np.inf) > 0.0)
    moving = _movement_of(recording, new_rows)
    for name, most in _MOST.items():
        if not np.all(np.abs(recording.column(name)) <= most):  # NaN is not
            raise RecordingError(f"{recording.path} has {name} with values beyond {most:g}, or not a number")
    if not np.all(np.diff(t[new_rows]) > 0.0):
        raise RecordingError(f"{recording.path} has time stamps that go back; those of a robot do not")
    cycle = float(np.median(np.diff(t[new_rows])))
    if not SHORTEST_CYCLE <= cycle <= LONGEST_CYCLE:
        raise RecordingError(
            f"{recording.path} has time stamps {cycle:g} s apart; {SHORTEST_CYCLE:g} to {LONGEST_CYCLE:g} s "
            "are a robot's"
        )
    each = rows_per_sample(t[new_rows])
    rows = new_rows[moving[0] % each :: each]
    moving = _movement_of(recording, rows)
    return TcpTrack(
        t=t[rows],
        p_ref=recording.column("ref_tcp_position")[rows],
        p_actual=recording.column("actual_TCP_pose")[rows, :3],
        rows=rows,
        new_rows=new_rows,
        movement=slice(int(moving[0]), int(moving[-1]) + 1),
        t_begin=float((t - recording.column("ref_t"))[rows[moving[0]]]),
    )


def rows_per_sample(t: Array) -> int:
    """How many steps of the times (n,) [s] make 8 ms: 1 at 125 Hz, 4 at 500 Hz."""
    return 1 if len(t) < 2 else max(round(SAMPLING_TIME / float(np.median(np.diff(t)))), 1)


def _movement_of(recording: Recording, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Which of these rows (n,) are of the movement phase; RecordingError if they are too few."""
    moving = np.flatnonzero(recording.rows_of(Phase.MOVEMENT)[rows])
    if len(moving) < MIN_MOVEMENT_ROWS:
        raise RecordingError(
            f"{recording.path} has {len(moving)} samples of movement; at least {MIN_MOVEMENT_ROWS} are needed"
        )
    return moving


def velocity(t: Array, p: Array) -> Array:
    """First differences of positions (n, 3) [m] over times (n,) [s]: (n - 1, 3) m/s.

    Step k is from sample k to k + 1.
    """
    return np.diff(p, axis=0) / np.diff(t)[:, None]


def speed(t: Array, p: Array) -> Array:
    """Length of `velocity`, (n - 1,) m/s: the scalar TCP speed."""
    length: Array = np.linalg.norm(velocity(t, p), axis=1)
    return length


class ShiftedReference:
    """The reference path, delayed by any time: what an arm would do whose only fault is a lag.

    The reference is shifted rather than the measurement, because it is smooth: interpolating it changes
    nothing, while interpolating noisy positions would smooth them.
    """

    def __init__(self, track: TcpTrack) -> None:
        self._t = track.t
        self._spline = CubicSpline(track.t, track.p_ref)

    def at(self, lag_s: float, samples: slice = slice(None)) -> Array:
        """Return the reference position at `t - lag_s`, (n, 3) m; at rest before and after the recording."""
        t = np.clip(self._t[samples] - lag_s, self._t[0], self._t[-1])
        positions: Array = self._spline(t)
        return positions
