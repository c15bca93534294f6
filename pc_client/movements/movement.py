"""`Movement`: a named trajectory of the TCP, made by any model; `JointTrajectory`: samples of joint angles.

Planning, running and analysis use a movement through this class only. Files are read and written by
`files.py`; new ones are made by `generate.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pc_client.errors import MovementError
from pc_client.files import ALLOWED, MOST_BYTES, is_file_name
from pc_client.movements.geometry import Similarity, read_only
from pc_client.movements.minimum_jerk import MinimumJerk
from pc_client.movements.power_law import PowerLaw
from pc_client.movements.robotic import RoboticTrajectory
from pc_client.movements.samples import SampledTrajectory
from pc_client.movements.sigma_lognormal import Motion, SigmaLognormal

__all__ = [
    "JOINT_COLUMNS",
    "LONGEST_DURATION",
    "MIN_SAMPLES",
    "JointTrajectory",
    "Kind",
    "Movement",
    "MovementSample",
    "SampleColumns",
    "Trajectory",
    "export_samples",
]


#: Which model made a movement, as its file says it; "samples" are given.
Kind = Literal["lognormal", "uniform", "minimum_jerk", "power_law", "samples"]

_KINDS: Mapping[type, Kind] = MappingProxyType(
    {
        SigmaLognormal: "lognormal",
        RoboticTrajectory: "uniform",
        MinimumJerk: "minimum_jerk",
        PowerLaw: "power_law",
    }
)


LONGEST_DURATION = 1200.0
"""No movement lasts longer [s]: its recording could not be read back (`pc_client.files`)."""


def _check_name(name: str) -> None:
    """Refuse a name that is no file name of the same folder on every system.

    Raises:
        MovementError: saying what is allowed.
    """
    if not is_file_name(name):
        raise MovementError(
            f"a movement is called {name[:MOST_BYTES]!r}: files are named after it, so give {ALLOWED}"
        )


def _check_duration(duration: float, whose: str) -> None:
    """Refuse a duration outside the range of movements.

    Raises:
        MovementError: saying what is allowed.
    """
    if not 0.0 < duration <= LONGEST_DURATION:  # NaN is not
        raise MovementError(
            f"{whose} with a duration of {duration:g} s: it must last longer than 0 s, "
            f"and {LONGEST_DURATION:g} s at most"
        )


class MovementSample(NamedTuple):
    """Position (m) and velocity (m/s) of the TCP in the base frame, each (n, 3)."""

    p: NDArray[np.float64]
    v: NDArray[np.float64]


class SampleColumns(NamedTuple):
    """A movement as columns, each (n,): time (s) and position (m)."""

    t: NDArray[np.float64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]


class Trajectory(Protocol):
    """What makes a movement: a closed form of position, velocity and acceleration in time."""

    @property
    def duration(self) -> float:
        """Total time, s."""
        ...

    @property
    def target_points(self) -> NDArray[np.float64]:
        """(n, 3), m."""
        ...

    def evaluate(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t (n,), s."""
        ...

    def transformed(self, similarity: Similarity) -> Trajectory:
        """The same movement elsewhere."""
        ...

    def stretched(self, factor: float) -> Trajectory:
        """The same movement, slower."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """A movement of the TCP from rest to rest; its orientation is fixed by planning unless samples give it.

    Attributes:
        name: as in tables and file names.
        trajectory: the closed form behind it.
        stroke_durations: (n_strokes,), s, one after the other from time 0: the windows of strokes that do not
            overlap, the times between the speed minima of those that do, or, where a trajectory names them,
            between its passages at the target points; their sum is the duration.
        provenance: how it was made, as short facts; written into its file.
        may_be_moved: it was made for the UR3's box; planning moves it for an arm that cannot do it there.
    """

    name: str
    trajectory: Trajectory
    stroke_durations: NDArray[np.float64]
    provenance: Mapping[str, str | int | float] = field(default_factory=lambda: MappingProxyType({}))
    may_be_moved: bool = False

    def __post_init__(self) -> None:
        durations = read_only(self.stroke_durations)
        _check_name(self.name)
        _check_duration(self.duration, f"movement {self.name}")
        if durations.ndim != 1 or not len(durations) or not np.all(durations > 0.0):
            raise MovementError(
                f"movement {self.name} with stroke durations {durations.tolist()} s: give times above 0 s"
            )
        if abs(math.fsum(durations) - self.duration) > 1e-6:
            raise MovementError(
                f"movement {self.name}: stroke durations add up to {math.fsum(durations):.6f} s, "
                f"but it lasts {self.duration:.6f} s; they must be equal"
            )
        object.__setattr__(self, "stroke_durations", durations)
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))

    def __repr__(self) -> str:
        return f"<Movement {self.name!r}: {self.kind}, {self.duration:.2f} s>"

    @property
    def kind(self) -> Kind:
        """Which model made it."""
        return _KINDS.get(type(self.trajectory), "samples")

    @property
    def duration(self) -> float:
        """Total time, s; the movement begins at 0."""
        return self.trajectory.duration

    @property
    def target_points(self) -> NDArray[np.float64]:
        """Target points, (n, 3), m. Inner ones of a human-like movement are aimed at, not reached."""
        return self.trajectory.target_points

    def motion(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t, s; each (n, 3).

        Before 0 and after `duration` the TCP rests at the start and the end.
        """
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        if not np.all(np.isfinite(times)):
            raise MovementError(f"movement {self.name} sampled at a time that is not finite")
        motion = self.trajectory.evaluate(np.clip(times, 0.0, self.duration))
        moving = ((times >= 0.0) & (times <= self.duration))[:, None]
        return Motion(motion.p, np.where(moving, motion.v, 0.0), np.where(moving, motion.a, 0.0))

    def sample(self, t: ArrayLike) -> MovementSample:
        """Position (m) and velocity (m/s) at the times t, s, a number or (n,); each (n, 3).

        Before 0 and after `duration` the TCP rests at the start and the end.
        """
        motion = self.motion(t)
        return MovementSample(motion.p, motion.v)

    def rotations(self, t: ArrayLike) -> NDArray[np.float64] | None:
        """R_base_tcp at the times t, s, (n, 3, 3); None: the TCP keeps the one that planning fixes."""
        if not isinstance(self.trajectory, SampledTrajectory):
            return None
        return self.trajectory.rotations(np.clip(t, 0.0, self.duration))

    def speed(self, t: ArrayLike) -> NDArray[np.float64]:
        """Speed of the TCP at the times t, m/s, (n,)."""
        velocity = self.motion(t).v
        speed: NDArray[np.float64] = np.linalg.norm(velocity, axis=1)
        return speed

    def transformed(self, similarity: Similarity) -> Self:
        """Moved, scaled and rotated; the time is untouched, so the shape of the speed is too."""
        return replace(self, trajectory=self.trajectory.transformed(similarity))

    def stretched(self, factor: float) -> Self:
        """`factor` times as slow on the same path (the theory's own scaling of time): speeds / factor."""
        if not (math.isfinite(factor) and factor > 0.0):
            raise MovementError(f"time stretch of {factor}: give a number greater than 0")
        return replace(
            self,
            trajectory=self.trajectory.stretched(factor),
            stroke_durations=self.stroke_durations * factor,
        )

    def renamed(self, name: str) -> Self:
        """The same movement under another name."""
        return replace(self, name=name)


def export_samples(movement: Movement, dt: float) -> SampleColumns:
    """The movement as columns t, x, y, z at 0, dt, 2 dt ... and at its end.

    Args:
        movement: what to sample.
        dt: sampling time, s, > 0.
    """
    if not (math.isfinite(dt) and dt > 0.0):
        raise MovementError(f"sampling time of {dt} s: give a number greater than 0")
    if movement.duration / dt > 1e7:
        raise MovementError(f"sampling time of {dt} s gives more than 10 million samples: give a longer one")
    t = dt * np.arange(math.floor(movement.duration / dt + 1e-9) + 1, dtype=np.float64)
    t = np.append(t[t < movement.duration - 1e-9 * dt], movement.duration)
    x, y, z = movement.sample(t).p.T
    return SampleColumns(t, x, y, z)


#: Columns of a file; angles in rad, base to wrist 3.
JOINT_COLUMNS = ("t", "q0", "q1", "q2", "q3", "q4", "q5")

#: Fewest samples: a cubic has four coefficients.
MIN_SAMPLES = 4


@dataclass(frozen=True, slots=True, eq=False)
class JointTrajectory:
    """Joint angles over time, from rest to rest.

    Attributes:
        t: (n,) times [s], increasing; shifted so that the first is 0.
        q: (n, 6) joint angles [rad], base to wrist 3.
        name: as in tables and file names.

    Raises:
        MovementError: shapes, times or values make no sense, or there are fewer than 4 samples.
    """

    t: NDArray[np.float64]
    q: NDArray[np.float64]
    name: str = "joints"

    def __post_init__(self) -> None:
        t, q = read_only(self.t), read_only(self.q)
        _check_name(self.name)
        if t.ndim != 1 or q.shape != (len(t), 6):
            raise MovementError(
                f"{self.name}: t {t.shape} and q {q.shape}: give n times and n rows of six angles in rad"
            )
        if len(t) < MIN_SAMPLES:
            raise MovementError(f"{self.name}: {len(t)} samples; give at least {MIN_SAMPLES}")
        bad = np.flatnonzero(~(np.isfinite(t) & np.isfinite(q).all(axis=1)))
        if len(bad):
            raise MovementError(f"{self.name}: sample {bad[0]} is not finite; give finite numbers")
        stalled = np.flatnonzero(np.diff(t) <= 0.0)
        if len(stalled):
            k = int(stalled[0]) + 1
            raise MovementError(
                f"{self.name}: sample {k} is at t = {t[k]:g} s after {t[k - 1]:g} s: times must increase"
            )
        object.__setattr__(self, "t", read_only(t - t[0]))
        object.__setattr__(self, "q", q)
        _check_duration(self.duration, self.name)

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.t[-1])
