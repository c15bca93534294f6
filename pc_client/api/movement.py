"""`Movement` with its constructors: through points, from samples, from files, from the library."""

from __future__ import annotations

from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from pc_client.errors import MovementError
from pc_client.movements import movement
from pc_client.movements.files import load_movement
from pc_client.movements.own_points import Style, load_targets, through
from pc_client.movements.robotic import Corners
from pc_client.movements.samples import SampledTrajectory, rotations_of
from pc_client.movements.twins import SETBACK

__all__ = ["Movement"]


class Movement(movement.Movement):
    """A movement of the TCP from rest to rest, in the robot's base frame; metres and seconds.

    It is independent of a robot: `plan` checks whether an arm can execute it.
    """

    __slots__ = ()

    @classmethod
    def through(
        cls,
        points: ArrayLike,
        style: Style = "human",
        durations: ArrayLike | None = None,
        *,
        name: str = "through",
        corners: Corners = "stop",
        setback: float = SETBACK,
    ) -> Self:
        """A movement that begins at the first point, rests at each of the others and ends at the last.

        Args:
            points: (n, 3) [m]; at least two, consecutive ones apart.
            style: "human", straight lognormal strokes by the paper's recipe; "robot", a smoothed trapezoid of
                speed on the same lines.
            durations: of the strokes between the points, (n - 1,) [s]; chosen from their lengths if None.
            name: as in recordings and tables.
            corners: of "robot" only: "stop" at inner points, or "blend" them.
            setback: of blended corners [m].

        Raises:
            MovementError: points, durations or options are not valid.
        """
        return cls._of(through(points, style, durations, name=name, corners=corners, setback=setback))

    @classmethod
    def from_samples(
        cls, t: ArrayLike, points: ArrayLike, rotations: ArrayLike | None = None, *, name: str = "samples"
    ) -> Self:
        """A movement given as samples; a spline interpolates them, nothing is smoothed.

        Args:
            t: (n,) increasing times [s], n >= 4.
            points: (n, 3) positions [m].
            rotations: orientation of the TCP at each sample: rotation vectors (n, 3) [rad] or quaternions
                (n, 4) x, y, z, w. None: the experiment's fixed orientation, tool forward and 45 degrees down.
            name: as in recordings and tables.

        Raises:
            MovementError: shapes or values are not valid.
        """
        turns = None if rotations is None else rotations_of(rotations)
        trajectory = SampledTrajectory(
            np.asarray(t, dtype=np.float64), np.asarray(points, dtype=np.float64), turns
        )
        return cls(name, trajectory, np.array([trajectory.duration]))

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        style: Style | None = None,
        durations: ArrayLike | None = None,
        *,
        corners: Corners = "stop",
    ) -> Self:
        """A movement from a table, by the name of its file; see docs/movements.md.

        Args:
            path: x, y, z, t, or with orientations: samples. x, y, z alone: target points.
            style: "human" or "robot": the rows are target points, t when each is reached, as those of
                `ur-client movements new`; None: samples, if they have t.
            durations: of the strokes between target points without t, (n - 1,) [s]; as of `through` if None.
            corners: of "robot" only, as of `through`.

        Raises:
            MovementError: the file cannot be read or is not valid; names the line.
        """
        path = Path(path)
        if style is None and durations is None:
            return cls._of(load_movement(path))
        points, times = load_targets(path)
        if times is not None and durations is not None:
            raise MovementError(f"durations, but {path} has a column t: give only one of them")
        given = times if durations is None else durations
        return cls.through(points, style or "human", given, name=path.stem, corners=corners)

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """A movement from a file of its parameters.

        Raises:
            MovementError: the file cannot be read or is not valid; names the field.
        """
        return cls._of(load_movement(Path(path)))

    @classmethod
    def library(cls, name: str) -> Self:
        """A movement of the library, such as "lognorm_4_1"; `ur-client movements list` names all.

        Raises:
            MovementError: no movement has that name.
        """
        return cls._of(load_movement(name))

    @classmethod
    def _of(cls, one: movement.Movement) -> Self:
        return cls(one.name, one.trajectory, one.stroke_durations, one.provenance)
